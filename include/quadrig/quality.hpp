// The figures of a result: counts and shapes, validity, distance to the input, how it bends, how it follows the rig.
#pragma once

#include "quadrig/quality/coverage.hpp"
#include "quadrig/quality/deformation.hpp"
#include "quadrig/quality/distance.hpp"
#include "quadrig/quality/guidance.hpp"
#include "quadrig/quality/hinges.hpp"
#include "quadrig/quality/statistics.hpp"
#include "quadrig/quality/validity.hpp"
