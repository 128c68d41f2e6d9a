# cmake -DSOURCE=... -DFILE=... -P QuadrigCommit.cmake: writes FILE with the commit of the sources, where git knows it. An
# unchanged file is left alone, so that nothing is compiled again.
find_program(GIT git)
set(commit "")
if(GIT AND EXISTS "${SOURCE}/.git")
  execute_process(COMMAND ${GIT} -C "${SOURCE}" describe --always --dirty --abbrev=12 --exclude=* OUTPUT_VARIABLE commit
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT "${FILE}" CONTENT "#define QUADRIG_COMMIT \"@commit@\"\n" @ONLY)
