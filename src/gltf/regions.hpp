// Regions of one primitive within which what the surface carries is continuous, and values on quads of one region.
#pragma once

#include <map>
#include <span>

#include "gather.hpp"
#include "quadrig/closest.hpp"

namespace quadrig::gltf {

/// Faces of a surface in regions: joined over edges across which the primitive stays the same and no texture
/// coordinate or colour jumps.
class Regions {
 public:
  /// `source_face`: m, the face of the gathered surface that each face of `mesh` is; both turn and count corners alike.
  Regions(const Gathered& gathered, const TriangleMesh<double>& mesh, std::span<const Index> source_face);

  [[nodiscard]] Index of_face(Index face) const { return of_face_[at(face)]; }
  [[nodiscard]] Index primitive(Index region) const { return primitive_[at(region)]; }
  /// The region that a quad lies in: that of the surface closest to its centre.
  [[nodiscard]] Index of_quad(const QuadMesh& quads, Index quad) const;
  /// The values that a vertex of the quads has within a region: at its place, or at the region's point closest to it.
  [[nodiscard]] Eigen::VectorXd values(const QuadMesh& quads, Index vertex, Index region);

 private:
  [[nodiscard]] Eigen::VectorXd values_at(const SurfacePoint& point) const;

  const Gathered& gathered_;
  const TriangleMesh<double>& mesh_;
  std::span<const Index> source_face_;
  std::vector<Index> of_face_, primitive_;
  std::vector<std::vector<Index>> faces_;
  std::map<Index, ClosestPoint> trees_;  // made when a region is first asked for a point outside it
};

}  // namespace quadrig::gltf
