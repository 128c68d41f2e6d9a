// The one definition of quality's large functions.
#include "quadrig/quality.hpp"

#include "quadrig/quality/coverage.ipp"
#include "quadrig/quality/deformation.ipp"
#include "quadrig/quality/distance.ipp"
#include "quadrig/quality/guidance.ipp"
#include "quadrig/quality/statistics.ipp"
#include "quadrig/quality/validity.ipp"
