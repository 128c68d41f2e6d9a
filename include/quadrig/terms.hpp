// The terms a field is made of: smooth across edges, near to targets, orthogonal.
#pragma once

#include "quadrig/constraints.hpp"
#include "quadrig/energy.hpp"

namespace quadrig {

/// Σ over interior edges of weight · |z_f ē_f^n − z_g ē_g^n|²: how far the n-th powers of a field's directions are from
/// being parallel. One unknown a face.
/// \pre mesh and connection outlive the term; `weights` has one entry a half-edge, that of the lower of a pair is read.
/// Source: thesis (4.16) with the transport of (3.5).
template <class Scalar = double>
class Smoothness {
 public:
  using K = std::complex<Scalar>;
  Smoothness(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection, int power,
             std::span<const double> weights)
      : mesh_(&mesh), connection_(&connection), power_(power), weights_(weights) {}

  [[nodiscard]] static constexpr std::string_view name() { return "smoothness"; }
  void for_each_row(EmitRow<K> emit) const {
    for (Index h = 0; h < mesh_->halfedge_count(); ++h) {
      const Index twin = mesh_->twin(h);
      if (twin == no_index || twin < h) continue;
      const std::array<Index, 2> at{h / 3, twin / 3};
      const std::array<K, 2> coeff{std::conj(integer_power(connection_->edge(h), power_)),
                                   -std::conj(integer_power(K(-connection_->edge(twin)), power_))};
      emit(Row<K>{at, coeff, K{}, weights_[static_cast<std::size_t>(h)]});
    }
  }

 private:
  const TriangleMesh<Scalar>* mesh_;
  const Connection<Scalar>* connection_;
  int power_;
  std::span<const double> weights_;
};

/// Σ_f weight_f |z_f − target_f|². A row for every face, also of weight 0, so that weights may change.
/// \pre the spans have one entry a face and outlive the term. Source: thesis (4.16).
template <class Scalar = double>
class Alignment {
 public:
  using K = std::complex<Scalar>;
  Alignment(std::span<const K> targets, std::span<const double> weights) : targets_(targets), weights_(weights) {}

  [[nodiscard]] static constexpr std::string_view name() { return "alignment"; }
  void for_each_row(EmitRow<K> emit) const {
    const std::array<K, 1> one{K(1)};
    for (std::size_t f = 0; f < weights_.size(); ++f) {
      const std::array<Index, 1> at{static_cast<Index>(f)};
      emit(Row<K>{at, one, targets_[f], weights_[f]});
    }
  }

 private:
  std::span<const K> targets_;
  std::span<const double> weights_;
};

/// Σ_f weight_f |z_f|²: on x1 = −(u² + v²) it asks for u ⟂ v of equal length.
/// \pre the span has one entry a face and outlives the term. Source: thesis (4.16).
template <class Scalar = double>
class Orthogonality {
 public:
  using K = std::complex<Scalar>;
  explicit Orthogonality(std::span<const double> weights) : weights_(weights) {}

  [[nodiscard]] static constexpr std::string_view name() { return "orthogonality"; }
  void for_each_row(EmitRow<K> emit) const {
    const std::array<K, 1> one{K(1)};
    for (std::size_t f = 0; f < weights_.size(); ++f) {
      const std::array<Index, 1> at{static_cast<Index>(f)};
      emit(Row<K>{at, one, K{}, weights_[f]});
    }
  }

 private:
  std::span<const double> weights_;
};

/// Weights of smoothness, one a half-edge, 3|e|² / (A_f + A_g): with them Σ w |Δz|² tends to the Dirichlet energy of
/// a field on the smooth surface, whatever the resolution. Times an optional factor, the mean of its two faces'.
/// 0 on the boundary. Threads: those of the context. \cost O(m). \fails never
template <class Scalar>
[[nodiscard]] std::vector<double> dirichlet_weights(const TriangleMesh<Scalar>& mesh,
                                                    std::span<const double> face_factor = {},
                                                    const Context* context = nullptr) {
  std::vector<double> weights(static_cast<std::size_t>(mesh.halfedge_count()), 0.0);
  parallel_each(context, weights.size(), [&](std::size_t i) {
    const auto h = static_cast<Index>(i);
    const Index twin = mesh.twin(h);
    if (twin == no_index) return;
    const double area = static_cast<double>(mesh.area(h / 3)) + static_cast<double>(mesh.area(twin / 3));
    double weight = 3 * static_cast<double>(mesh.edge_vector(h).squaredNorm()) / area;
    if (!face_factor.empty())
      weight *= (face_factor[static_cast<std::size_t>(h / 3)] + face_factor[static_cast<std::size_t>(twin / 3)]) / 2;
    weights[i] = weight;
  });
  return weights;
}

}  // namespace quadrig
