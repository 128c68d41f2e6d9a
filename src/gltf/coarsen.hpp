// Fewer polygons of the same make: whole rows of quads go, pairs of corners meet, edges of triangles collapse.
#pragma once

#include "polygons.hpp"

namespace quadrig::gltf {

/// The places of a shell's vertices in each pose that counts: at rest, bent, with each morph target.
struct PosedPoints {
  std::vector<Points<double>> places;  ///< n×3 each, of all vertices of the surface
  std::vector<double> weight;          ///< of each pose
  std::size_t bends = 0;               ///< the poses after the first that a skin makes
};

struct CoarsenOptions {
  Index triangles = 0;  ///< wanted, a quad counted as two
  bool rows = true;     ///< rows and single quads go; else edges between triangles alone
  /// By how much more the removal of a single quad costs for each irregular vertex that it makes.
  double irregular_cost = 0.5;
};

/// Takes away what costs least first, by the squared distance from the planes of the faces that went, summed over the
/// poses, until as few triangles are left as wanted or none can go. Vertices that stay keep their places: what they
/// carry is that of the input. Borders of primitives and open borders stay lines, their branches and ends stay where
/// they are; so do edges where normals part, and seams, as long as the count can be had: then first those, then these
/// may be crossed. Topology stays. \param locked a flag a vertex of the surface, or empty: it stays \cost O(rounds ·
/// polygons · poses) \fails never; what is cancelled is of no use
[[nodiscard]] std::vector<Polygon> coarsened(std::span<const Polygon> polygons, const Wedges& wedges,
                                             const PosedPoints& points, const CoarsenOptions& options,
                                             const std::vector<char>& locked, const Context& context);

}  // namespace quadrig::gltf
