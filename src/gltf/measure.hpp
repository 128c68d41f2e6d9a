// How far two surfaces are apart, posed alike.
#pragma once

#include <map>

#include "coarsen.hpp"
#include "quadrig/closest.hpp"

namespace quadrig::gltf {

/// Distances both ways, in the units of the surface.
struct Apart {
  double rms = 0, mean = 0;  ///< over samples and poses, by their weights
  /// What candidates are compared by: as rms, with how far at rest places are from the nearest of their own material,
  /// each material counting the same: what is painted apart is looked at, be it as small as an eye.
  double seen = 0;
  double largest = 0;  ///< at vertices and samples
  /// Of those at rest and with morph targets. Bends are no measure of what was lost: between its vertices a coarse
  /// surface bends along straight lines, where finer quads follow the joint.
  double largest_unbent = 0;
};

/// The triangles of one material, at rest.
struct MaterialPart {
  Triangles faces;
  ClosestPoint tree;
};

/// Holds what is made of a shell against the shell.
class Measure {
 public:
  /// \param faces the triangles of the shell, over the rows of `points` \param materials one a face
  Measure(Triangles faces, PosedPoints points, std::vector<Index> materials);
  [[nodiscard]] const PosedPoints& points() const { return points_; }
  [[nodiscard]] const Triangles& faces() const { return faces_; }
  [[nodiscard]] double diagonal() const { return diagonal_; }
  /// \param places of the other surface's vertices, in the same poses \param materials one a face
  /// \cost O(poses · samples · log faces)
  [[nodiscard]] Apart apart(const Triangles& faces, std::span<const Points<double>> places,
                            const std::vector<Index>& materials) const;

 private:
  Triangles faces_;
  PosedPoints points_;
  double diagonal_ = 0;              // of the shell at rest
  std::vector<ClosestPoint> trees_;  // of the shell, a pose
  std::vector<Index> materials_;
  std::map<Index, MaterialPart> parts_;  // of the shell at rest; empty where there is one material alone
};

/// The polygons as triangles, quads cut along the diagonal of their first corners.
[[nodiscard]] Triangles as_triangles(std::span<const Polygon> polygons);

}  // namespace quadrig::gltf
