// The one definition of the fit's large functions.
#include "quadrig/fit.hpp"

#include "quadrig/fit/fit.ipp"
#include "quadrig/fit/slide.ipp"
