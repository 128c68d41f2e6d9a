// The one definition of the large functions of the field and of the orders of elimination.
#include "quadrig/field.hpp"

#include "quadrig/field/design.ipp"
#include "quadrig/field/lengths.ipp"
#include "quadrig/field/power.ipp"
#include "quadrig/field/systems.ipp"
#include "quadrig/solver/dissection.ipp"
#include "quadrig/solver/ordering.ipp"
