// What a job will take, from above, before it is taken.
#pragma once

#include <algorithm>

#include "quadrig/pipeline/ladder.hpp"

namespace quadrig::io {

/// Bytes that remeshing takes at its peak, from above: measured as docs/c.md says, where the peak of the process
/// was 0.37 to 0.87 of it.
[[nodiscard]] inline double remesh_bytes(double triangles, double bones, double quads) {
  // The map is made on the triangles themselves or, of far more than it needs, on a stand-in.
  const double mapped = std::min(triangles, enough_triangles(quads));
  const double poses =
      std::min(512 * bones * bones, 1.4e8);  // surface_bends: four bends a bone, a transform a bone each
  return 32e6 + poses + triangles * (1.2e3 + 13 * bones) + 3.5e3 * mapped + 8.5e3 * quads;
}

/// Bytes that an asset takes while it is welded and mended, from above.
[[nodiscard]] inline double prepare_bytes(double triangles, double influences) {
  return 8e6 + triangles * (900 + 16 * influences);
}

/// Bytes that a whole run takes at its peak, by the bytes of its files alone: far from above, since a triangle has more
/// than 15 of them in most formats, and few rigs have as many bones.
[[nodiscard]] inline double run_bytes(double file_bytes, double quads) {
  return 2e9 + 2 * remesh_bytes(file_bytes / 15, 512, quads);
}

}  // namespace quadrig::io
