// The seamless map: charts cut open, constraints built in exactly, a Poisson solve that ends without flips.
//
//   seamless_map   the arrow: a field with sizes in, the map with its report out
//   from_uv        the same of corner coordinates of one's own
//   cut_graph      combs the frames and cuts the surface to a disc; each corner's chart relative to its vertex
//   aligned_edges  where the map has to be straight: along the border and along edges that are kept
//   unknowns       transitions, cones and straight borders eliminated over Z[i] or Z; what remains is free
//   target         wanted parameter vectors from a frame field, made more nearly integrable by correcting lengths
//   reduce_curl    directions and sizes of a field moved towards those of a map
//   poisson        the map nearest to the target, stiffened until no triangle flips and every cone is right
//   untangle       the last flips taken out where they are
#pragma once

#include "quadrig/seamless/aligned_edges.hpp"
#include "quadrig/seamless/closed_loops.hpp"
#include "quadrig/seamless/cut_graph.hpp"
#include "quadrig/seamless/from_uv.hpp"
#include "quadrig/seamless/poisson.hpp"
#include "quadrig/seamless/reduce_curl.hpp"
#include "quadrig/seamless/seamless_map.hpp"
#include "quadrig/seamless/target.hpp"
#include "quadrig/seamless/unknowns.hpp"
#include "quadrig/seamless/untangle.hpp"
