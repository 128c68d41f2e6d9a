// Seams as edges of quads: the edges that part regions are moved onto the seams of the surface, where quads stay good.
#pragma once

#include "regions.hpp"

namespace quadrig::gltf {

/// How far the seams became edges.
struct SeamFigures {
  Index edges = 0;     ///< of quads, between two regions
  Index on_seams = 0;  ///< of those, both ends lie on a seam
  /// A flag a vertex: it has such an edge, and lies where that is best.
  std::vector<char> placed;
};

/// Moves the vertices at which two regions of quads meet onto the nearest seam, ends and branches of seams first; those
/// and the ones beside them then give way to each other. A vertex moves only where the quads around it cost less, by
/// their distance from their regions and by their shape, and none becomes worse than `least` or than it was. Every
/// vertex stays on `mesh`, and `source` follows. Ends early once the context is cancelled.
/// \param held a flag a vertex: stays where it is
/// \cost O(vertices near seams · faces below a quad)
[[nodiscard]] SeamFigures snap_to_seams(const TriangleMesh<double>& mesh, Regions& regions, double least,
                                        const std::vector<char>& held, QuadMesh& quads, const Context& context);

}  // namespace quadrig::gltf
