// Where Catch2 has no library to link a main function from: 2, but for some distributions' packages of it.
#define CATCH_CONFIG_MAIN
#include <catch2/catch.hpp>
