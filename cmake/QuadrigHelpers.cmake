# Our own sources are compiled with these; what uses the library from outside is not.
add_library(quadrig_warnings INTERFACE)
target_compile_options(quadrig_warnings INTERFACE
  $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Wall -Wextra -Wconversion -Wshadow -Wpedantic>
  $<$<AND:$<BOOL:${QUADRIG_WERROR}>,$<CXX_COMPILER_ID:GNU,Clang,AppleClang>>:-Werror>
  $<$<CXX_COMPILER_ID:MSVC>:/W4 /utf-8 /bigobj>)

# Keeps the names of files that are there.
function(quadrig_present out)
  set(found)
  foreach(file IN LISTS ARGN)
    if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
      list(APPEND found "${file}")
    endif()
  endforeach()
  set(${out} ${found} PARENT_SCOPE)
endfunction()
