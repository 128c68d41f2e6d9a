# OpenSubdiv::CPU; Debian's package has no package files of its own.
include(FindPackageHandleStandardArgs)
find_path(OPENSUBDIV_INCLUDE_DIR NAMES opensubdiv/far/primvarRefiner.h)
find_library(OPENSUBDIV_LIBRARY NAMES osdCPU)
find_package_handle_standard_args(OpenSubdiv REQUIRED_VARS OPENSUBDIV_LIBRARY OPENSUBDIV_INCLUDE_DIR)
mark_as_advanced(OPENSUBDIV_INCLUDE_DIR OPENSUBDIV_LIBRARY)
if(OpenSubdiv_FOUND AND NOT TARGET OpenSubdiv::CPU)
  add_library(OpenSubdiv::CPU UNKNOWN IMPORTED)
  set_target_properties(OpenSubdiv::CPU PROPERTIES
    IMPORTED_LOCATION "${OPENSUBDIV_LIBRARY}" INTERFACE_INCLUDE_DIRECTORIES "${OPENSUBDIV_INCLUDE_DIR}")
endif()
