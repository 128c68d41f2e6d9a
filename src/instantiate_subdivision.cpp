// The one definition of subdivision, which alone sees OpenSubdiv.
#include "quadrig/subdivision.hpp"

#include "quadrig/subdivision.ipp"
