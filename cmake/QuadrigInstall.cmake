include(CMakePackageConfigHelpers)

set(quadrig_cmake_dir "${CMAKE_INSTALL_LIBDIR}/cmake/quadrig")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/quadrig" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
  FILES_MATCHING PATTERN "*.hpp" PATTERN "*.ipp" PATTERN "*.h")
set_target_properties(quadrig_compiled PROPERTIES EXPORT_NAME compiled)
set_target_properties(quadrig_io PROPERTIES EXPORT_NAME io)
install(TARGETS quadrig quadrig_compiled quadrig_io EXPORT quadrig_targets)
if(TARGET quadrig_cli)
  install(TARGETS quadrig_cli)
endif()
if(TARGET quadrig_picture_cli AND QUADRIG_BUILD_CLI)
  install(TARGETS quadrig_picture_cli)
endif()
install(EXPORT quadrig_targets NAMESPACE quadrig:: DESTINATION "${quadrig_cmake_dir}")

configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/quadrig-config.cmake.in"
  "${PROJECT_BINARY_DIR}/quadrig-config.cmake" INSTALL_DESTINATION "${quadrig_cmake_dir}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/quadrig-config-version.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/quadrig-config.cmake" "${PROJECT_BINARY_DIR}/quadrig-config-version.cmake"
  DESTINATION "${quadrig_cmake_dir}")
set(quadrig_pc_flags)
set(quadrig_pc_libs)
if(QUADRIG_WITH_CHOLMOD)
  install(FILES "${CMAKE_CURRENT_LIST_DIR}/FindCHOLMOD.cmake" DESTINATION "${quadrig_cmake_dir}")
  set(quadrig_pc_flags " -DQUADRIG_WITH_CHOLMOD -I${CHOLMOD_INCLUDE_DIR}")
  set(quadrig_pc_libs " -lcholmod")
endif()
if(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL)
  string(APPEND quadrig_pc_flags " -DQUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL")
endif()

# The prefix as seen from the .pc files, so that an installed tree can be moved.
file(RELATIVE_PATH quadrig_up "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/prefix")
string(REGEX REPLACE "/$" "" quadrig_up "${quadrig_up}")
foreach(name IN ITEMS quadrig quadrig-compiled quadrig-io)
  configure_file("${CMAKE_CURRENT_LIST_DIR}/${name}.pc.in" "${PROJECT_BINARY_DIR}/${name}.pc" @ONLY)
endforeach()
install(FILES "${PROJECT_BINARY_DIR}/quadrig.pc" "${PROJECT_BINARY_DIR}/quadrig-compiled.pc"
  "${PROJECT_BINARY_DIR}/quadrig-io.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
