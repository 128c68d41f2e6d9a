// Face bases, transport of vectors across edges (Levi-Civita), and angle defects.
#pragma once

#include "quadrig/mesh.hpp"

namespace quadrig {

/// z to an integer power n ≥ 0.
template <class Scalar>
[[nodiscard]] std::complex<Scalar> integer_power(std::complex<Scalar> z, int n) {
  std::complex<Scalar> result(1);
  for (; n > 0; n >>= 1, z *= z)
    if (n & 1) result *= z;
  return result;
}

/// Tangent vectors of a face as complex numbers: the real axis is the unit vector along half-edge 3 f, the imaginary
/// axis is normal × real axis.
/// \pre no face has zero area (prepare removes them)
/// Threads: those of the context. \cost O(m) time, 96 m bytes. \fails never. Source: Crane et al. 2010; thesis (3.2).
template <class Scalar = double>
class Connection {
 public:
  using Vector = Eigen::Matrix<Scalar, 3, 1>;
  using K = std::complex<Scalar>;

  explicit Connection(const TriangleMesh<Scalar>& mesh, const Context* context = nullptr)
      : real_axes_(mesh.face_count(), 3),
        imaginary_axes_(mesh.face_count(), 3),
        edges_(static_cast<std::size_t>(mesh.halfedge_count())) {
    parallel_each(context, static_cast<std::size_t>(mesh.face_count()), [&](std::size_t i) {
      const auto f = static_cast<Index>(i);
      const Vector x = mesh.edge_vector(3 * f).normalized();
      real_axes_.row(f) = x.transpose();
      imaginary_axes_.row(f) = mesh.normal(f).cross(x).transpose();
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        const K z = to_complex(f, mesh.edge_vector(h));
        edges_[static_cast<std::size_t>(h)] = z / std::abs(z);
      }
    });
  }

  /// Components of a 3D vector in the face's basis; its normal part is dropped.
  [[nodiscard]] K to_complex(Index face, const Vector& v) const {
    return {real_axes_.row(face).dot(v.transpose()), imaginary_axes_.row(face).dot(v.transpose())};
  }
  [[nodiscard]] Vector to_vector(Index face, K z) const {
    return (z.real() * real_axes_.row(face) + z.imag() * imaginary_axes_.row(face)).transpose();
  }
  /// Unit direction of a half-edge, from its origin to its target, in the basis of its own face.
  [[nodiscard]] K edge(Index halfedge) const { return edges_[static_cast<std::size_t>(halfedge)]; }
  /// Factor that carries z^n from the face of `halfedge` to the face across it: z_g = z_f · transport(h, n).
  /// \pre the half-edge is not on the boundary
  [[nodiscard]] K transport(const TriangleMesh<Scalar>& mesh, Index halfedge, int n = 1) const {
    return integer_power(K(-edge(mesh.twin(halfedge)) * std::conj(edge(halfedge))), n);
  }

 private:
  Points<Scalar> real_axes_, imaginary_axes_;
  std::vector<K> edges_;
};

/// Per vertex 2π (on the boundary π) minus the sum of the corner angles, radians. Zero for a vertex without faces.
/// Gauss–Bonnet: the sum over the surface is 2π times its Euler characteristic. Threads: those of the context.
template <class Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, Eigen::Dynamic, 1> angle_defects(const TriangleMesh<Scalar>& mesh,
                                                                     const Context* context = nullptr) {
  constexpr Scalar pi = std::numbers::pi_v<Scalar>;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> defect(mesh.vertex_count());
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    defect[v] = mesh.outgoing(v) == no_index ? Scalar(0) : mesh.on_boundary(v) ? pi : 2 * pi;
  std::vector<Scalar> angle(static_cast<std::size_t>(mesh.halfedge_count()));
  parallel_each(context, angle.size(), [&](std::size_t h) { angle[h] = mesh.corner_angle(static_cast<Index>(h)); });
  for (std::size_t h = 0; h < angle.size(); ++h) defect[mesh.origin(static_cast<Index>(h))] -= angle[h];
  return defect;
}

}  // namespace quadrig
