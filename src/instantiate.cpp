// The one definition of every large function and of every costly template's double instantiation.
#include "quadrig/asset.hpp"
#include "quadrig/connection.hpp"
#include "quadrig/quads.hpp"
