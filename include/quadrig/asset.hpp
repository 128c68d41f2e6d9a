// A mesh and its rig: what comes in.
#pragma once

#include "quadrig/rig.hpp"

namespace quadrig {

/// A triangle mesh and, where it moves, its rig. Weights have one row a vertex of the mesh.
struct Asset {
  TriangleMesh<double> mesh;
  std::optional<Rig> rig;
};

}  // namespace quadrig
