# cmake -DHOW=... -DBINARY=... -DSOURCE=... -DCONFIG=... -DCOMPILER=... -DLAUNCHER=... -P run.cmake
# HOW=install installs to BINARY/consumer/prefix; every other HOW builds, links and runs the consumer in a new empty folder.
cmake_minimum_required(VERSION 3.25)

function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(prefix "${BINARY}/consumer/prefix")
if(HOW STREQUAL "install")
  # Installed at one place and used at another: nothing may remember the first.
  file(REMOVE_RECURSE "${prefix}" "${prefix}-before")
  run(${CMAKE_COMMAND} --install "${BINARY}" --prefix "${prefix}-before" --config "${CONFIG}")
  file(RENAME "${prefix}-before" "${prefix}")
  file(GLOB_RECURSE texts "${prefix}/*.cmake" "${prefix}/*.pc" "${prefix}/*.hpp" "${prefix}/*.ipp")
  foreach(text IN LISTS texts)
    file(READ "${text}" content)
    foreach(path IN ITEMS "${SOURCE}/" "${BINARY}/")
      string(FIND "${content}" "${path}" found)
      if(NOT found EQUAL -1)
        message(FATAL_ERROR "${text} names ${path}")
      endif()
    endforeach()
  endforeach()
  return()
endif()

set(work "${BINARY}/consumer/${HOW}")
file(REMOVE_RECURSE "${work}")
file(COPY "${CMAKE_CURRENT_LIST_DIR}/project/" DESTINATION "${work}")

# Every public header in one translation unit, and in the other order in the second: a function that lacks `inline` is
# defined twice, and a header that leans on one before it is seen.
# Once headers only and once compiled is enough; the other ways differ in how the library is found, not in what it is.
if(HOW MATCHES "^(find_package|compiled)$")
  file(GLOB headers RELATIVE "${prefix}/include" "${prefix}/include/quadrig/*.hpp")
else()
  set(headers quadrig/connection.hpp quadrig/context.hpp quadrig/mesh.hpp quadrig/quads.hpp)
endif()
list(SORT headers)
list(TRANSFORM headers REPLACE "(.+)" "#include \"\\1\"\n")
list(JOIN headers "" forward)
list(REVERSE headers)
list(JOIN headers "" backward)
file(WRITE "${work}/all_headers.hpp" "#pragma once\n${forward}")
file(WRITE "${work}/all_headers_reversed.hpp" "#pragma once\n${backward}")

if(HOW MATCHES "^pkg_config")
  set(ENV{PKG_CONFIG_PATH} "${prefix}/lib/pkgconfig:${prefix}/lib64/pkgconfig:${prefix}/lib/${ARCHITECTURE}/pkgconfig")
  if(HOW STREQUAL "pkg_config_compiled")
    set(module quadrig-compiled)
  else()
    set(module quadrig)
  endif()
  find_program(PKG_CONFIG NAMES pkg-config pkgconf REQUIRED)
  foreach(kind IN ITEMS cflags libs)
    execute_process(COMMAND ${PKG_CONFIG} --${kind} ${module} OUTPUT_VARIABLE ${kind} COMMAND_ERROR_IS_FATAL ANY
      OUTPUT_STRIP_TRAILING_WHITESPACE)
    separate_arguments(${kind} UNIX_COMMAND "${${kind}}")
  endforeach()
  foreach(unit IN ITEMS main other)
    run(${LAUNCHER} ${COMPILER} -std=c++20 ${cflags} -c "${work}/${unit}.cpp" -o "${work}/${unit}.o")
  endforeach()
  run(${COMPILER} "${work}/main.o" "${work}/other.o" ${libs} -o "${work}/consumer")
  run("${work}/consumer")
  return()
endif()

if(HOW STREQUAL "wrong_version")
  execute_process(COMMAND ${CMAKE_COMMAND} -S "${CMAKE_CURRENT_LIST_DIR}/wrong_version" -B "${work}/build"
    "-DCMAKE_PREFIX_PATH=${prefix}" "-DCMAKE_CXX_COMPILER=${COMPILER}" RESULT_VARIABLE code ERROR_VARIABLE error)
  if(code EQUAL 0 OR NOT error MATCHES "version: 0\\.1\\.0")
    message(FATAL_ERROR "version 0.2 was asked for, 0.1.0 is there, and the answer was: ${error}")
  endif()
  return()
endif()

set(arguments "-DHOW=${HOW}" "-DCMAKE_PREFIX_PATH=${prefix}" "-DQUADRIG_SOURCE=${SOURCE}" "-DCMAKE_CXX_COMPILER=${COMPILER}"
  "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}" "-DCMAKE_BUILD_TYPE=Debug" -DCMAKE_CXX_FLAGS_DEBUG=-O0 -G Ninja)
if(HOW STREQUAL "fetch_content")
  # An archive of what a release would have.
  set(files CMakeLists.txt LICENSE cmake include src)
  run(${CMAKE_COMMAND} -E chdir "${SOURCE}" ${CMAKE_COMMAND} -E tar czf "${work}/quadrig.tar.gz" ${files})
  list(APPEND arguments "-DQUADRIG_ARCHIVE=${work}/quadrig.tar.gz")
endif()
run(${CMAKE_COMMAND} -S "${work}" -B "${work}/build" ${arguments})
run(${CMAKE_COMMAND} --build "${work}/build" --target consumer)
run("${work}/build/consumer")
