// The one definition of the pipeline's large functions.
#include "quadrig/pipeline.hpp"

#include "quadrig/pipeline/component.ipp"
#include "quadrig/pipeline/remesh.ipp"
