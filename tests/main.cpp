// Catch2 2 has no library to link a main function from; Catch2 3 has.
#define CATCH_CONFIG_MAIN
#include <catch2/catch.hpp>
