// What a field should be at each face: targets built from bones, borders, creases and curvature.
#pragma once

#include "quadrig/constraints/bones.hpp"
#include "quadrig/constraints/curvature.hpp"
#include "quadrig/constraints/features.hpp"
#include "quadrig/constraints/gradation.hpp"
#include "quadrig/constraints/targets.hpp"
