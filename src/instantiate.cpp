// The one definition of every large function and of every costly template's double instantiation.
#include "quadrig/asset.hpp"
#include "quadrig/connection.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/quads.hpp"

#include "quadrig/prepare/prepare.ipp"
#include "quadrig/prepare/refine.ipp"
#include "quadrig/prepare/repair.ipp"
#include "quadrig/prepare/triangulate.ipp"
