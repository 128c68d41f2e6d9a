// The one definition of what finds rims.
#include "quadrig/rims.hpp"

#include "quadrig/rims/find.ipp"
