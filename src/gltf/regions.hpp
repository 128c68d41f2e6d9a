// What the surface carries, on the corners of quads: continuous within a quad, never averaged across a seam.
#pragma once

#include "gather.hpp"
#include "quadrig/closest.hpp"

namespace quadrig::gltf {

/// Edges at which the primitive changes, or a texture coordinate or colour jumps, are seams. A quad takes its values
/// from the faces around its centre that are reached without crossing one.
class Regions {
 public:
  /// `source_face`: m, the face of the gathered surface that each face of `mesh` is; both turn and count corners alike.
  Regions(const Gathered& gathered, const TriangleMesh<double>& mesh, std::span<const Index> source_face);

  struct QuadValues {
    Index primitive = no_index;
    std::array<Eigen::VectorXd, 4> corners;  ///< all columns of Gathered::attributes
  };
  /// The primitive that a quad belongs to, that of the surface below its centre, and the values of its corners there:
  /// at their own place or, beyond a seam, at the nearest point on this side. \cost O(faces below the quad)
  [[nodiscard]] QuadValues of_quad(const QuadMesh& quads, Index quad);
  /// The same, with how badly the quad stands for its region: the mean squared distance of places on it from the
  /// nearest point of the region, in space and, by the surface's diagonal, in the texture.
  [[nodiscard]] QuadValues of_quad(const QuadMesh& quads, Index quad, double& misfit);
  /// All columns at a point of `mesh`.
  [[nodiscard]] Eigen::VectorXd values_at(const SurfacePoint& point) const;
  /// Between two faces; the border of the surface is none.
  [[nodiscard]] bool is_seam(Index halfedge) const { return seam_[at(halfedge)] && mesh_.twin(halfedge) != no_index; }
  [[nodiscard]] bool any_seam() const;
  /// A seam at which the primitive changes.
  [[nodiscard]] bool parts_primitives(Index halfedge) const;
  /// Whether two rows are the same in all columns that make seams.
  [[nodiscard]] bool alike(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;

 private:
  [[nodiscard]] SurfaceHit hit(Index face, const Vector3& p) const;
  [[nodiscard]] bool farther(Index face, const Vector3& p, double squared_distance) const;
  void spread(Index face, const Vector3& centre, double squared_radius);

  const Gathered& gathered_;
  const TriangleMesh<double>& mesh_;
  std::span<const Index> source_face_;
  std::vector<Eigen::Index> seam_columns_, texture_columns_;
  double diagonal_ = 0;                // of the surface
  std::vector<Eigen::Vector4d> ball_;  // around each face: centre and radius
  std::vector<char> seam_;             // a half-edge
  std::vector<Index> reached_;         // faces of the quad at hand
  std::vector<std::uint32_t> mark_;    // a face: the last quad that reached it
  std::uint32_t current_ = 0;
};

}  // namespace quadrig::gltf
