// The one definition of the large functions from a field to quads.
#include "quadrig/quads/from_uv.hpp"

#include "quadrig/quads/extract.ipp"
#include "quadrig/quads/from_uv.ipp"
#include "quadrig/quads/integer_map.ipp"
#include "quadrig/quantize/coarse_map.ipp"
#include "quadrig/quantize/quantize.ipp"
#include "quadrig/seamless/cut_graph.ipp"
#include "quadrig/seamless/from_uv.ipp"
#include "quadrig/seamless/seamless_map.ipp"
#include "quadrig/seamless/target.ipp"
#include "quadrig/seamless/untangle.ipp"
