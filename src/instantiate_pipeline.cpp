// The one definition of the pipeline's large functions.
#include "quadrig/pipeline.hpp"

#include "quadrig/pipeline/attempt.ipp"
#include "quadrig/pipeline/component.ipp"
#include "quadrig/pipeline/finish.ipp"
#include "quadrig/pipeline/gaps.ipp"
#include "quadrig/pipeline/hinges.ipp"
#include "quadrig/pipeline/mapped_quads.ipp"
#include "quadrig/pipeline/remesh.ipp"
#include "quadrig/pipeline/rims.ipp"
