// The one definition of the symmetry's large functions.
#include "quadrig/symmetry.hpp"

#include "quadrig/symmetry/find.ipp"
#include "quadrig/symmetry/symmetrize.ipp"
