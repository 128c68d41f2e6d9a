// The one definition of the field's large functions.
#include "quadrig/field.hpp"

#include "quadrig/field/design.ipp"
#include "quadrig/field/lengths.ipp"
#include "quadrig/field/power.ipp"
#include "quadrig/field/systems.ipp"
