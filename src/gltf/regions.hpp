// What the surface carries, on the corners of quads: continuous within a quad, never averaged across a seam.
#pragma once

#include <map>

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
  /// From now on a quad belongs to the primitive of this face, and its values are those around it.
  void claim(Index quad, Index face) { claims_[quad] = face; }
  /// Islands of a primitive, no larger than a few quads, that no quad belongs to get the nearest, where that is not the
  /// last of its own: those of an eighth of a quad and more, those half as large as one that has some, and the largest
  /// of a primitive that has none. \cost O(quads · islands)
  void claim_for_islands(const QuadMesh& quads);
  [[nodiscard]] const std::map<Index, Index>& claims() const { return claims_; }
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
  [[nodiscard]] Index below(const QuadMesh& quads, Index quad, const Vector3& centre, double squared_radius) const;
  [[nodiscard]] Index primitive_of(Index face) const {
    return gathered_.surface.source_primitive[at(source_face_[at(face)])];
  }
  /// Faces of a primitive that hang together.
  struct Island {
    Index primitive = no_index;
    std::vector<Index> faces;
    double area = 0;
    Vector3 centre = Vector3::Zero();
    Index quads = 0;
  };
  [[nodiscard]] std::vector<Island> islands(std::vector<Index>& of_face) const;

  const Gathered& gathered_;
  const TriangleMesh<double>& mesh_;
  std::span<const Index> source_face_;
  std::vector<Eigen::Index> seam_columns_, texture_columns_;
  double diagonal_ = 0;                // of the surface
  std::vector<Eigen::Vector4d> ball_;  // around each face: centre and radius
  std::vector<char> seam_;             // a half-edge
  std::map<Index, Index> claims_;      // of quads: a face
  std::vector<Index> reached_;         // faces of the quad at hand
  std::vector<std::uint32_t> mark_;    // a face: the last quad that reached it
  std::uint32_t current_ = 0;
};

}  // namespace quadrig::gltf
