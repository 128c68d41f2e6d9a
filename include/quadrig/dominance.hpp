// How strongly one bone, two bones, … rule each place of a skinned surface (thesis 4.1).
#pragma once

#include <span>

#include "quadrig/rig.hpp"

namespace quadrig {

/// A bone and its share of a face or vertex.
struct BoneShare {
  Index bone = no_index;
  double weight = 0;
};

/// The bones of each face by falling weight, and the fields ω_k = k (w_k − w_{k+1}) made of them. Σ_k ω_k = 1 where
/// the weights sum to 1: ω_1 = 1 on the skin of one bone, ω_2 = 1 where two bones share alike.
class Dominance {
 public:
  /// \pre weights have one row a vertex
  /// \cost O(stored weights) time and memory. Source: thesis 4.1.
  /// \fails bad_input where the weights have another number of rows than the mesh has vertices, or of columns than the
  ///   skeleton has bones; cancelled, where there is a context to ask.
  template <class Scalar>
  [[nodiscard]] static Expected<Dominance> create(const TriangleMesh<Scalar>& mesh, const Rig& rig,
                                                  const Context* context = nullptr);

  [[nodiscard]] Index face_count() const { return static_cast<Index>(starts_.size()) - 1; }
  /// Bones with a positive share of a face, falling weight, ties by bone index.
  [[nodiscard]] std::span<const BoneShare> shares(Index face) const {
    const auto begin = starts_[static_cast<std::size_t>(face)], end = starts_[static_cast<std::size_t>(face) + 1];
    return {shares_.data() + begin, shares_.data() + end};
  }
  /// The k-th strongest share of a face, k ≥ 1; weight 0 and no bone past the last.
  [[nodiscard]] BoneShare share(Index face, std::size_t k) const {
    const auto list = shares(face);
    return k <= list.size() ? list[k - 1] : BoneShare{};
  }
  /// ω_k of a face, k ≥ 1.
  [[nodiscard]] double omega(Index face, std::size_t k) const {
    return static_cast<double>(k) * (share(face, k).weight - share(face, k + 1).weight);
  }
  /// ω_1 of each vertex, and its gradient on each face (m×3, one over length) as a piecewise linear function.
  [[nodiscard]] const std::vector<double>& vertex_omega1() const { return vertex_omega1_; }
  [[nodiscard]] Vector3 gradient_omega1(Index face) const { return gradient_.row(face).transpose(); }

 private:
  std::vector<std::size_t> starts_{0};
  std::vector<BoneShare> shares_;
  std::vector<double> vertex_omega1_;
  Points<double> gradient_;
};

template <class Scalar>
Expected<Dominance> Dominance::create(const TriangleMesh<Scalar>& mesh, const Rig& rig, const Context* context) {
  const auto cancelled = [&](Index i) { return i % 16'384 == 0 && context && context->cancelled(); };
  const SkinWeights& weights = rig.weights;
  if (weights.rows() != mesh.vertex_count())
    return Error{
        ErrorCode::bad_input,
        std::to_string(weights.rows()) + " rows of weights for " + std::to_string(mesh.vertex_count()) + " vertices",
        "skin weights", "give one row of weights a vertex"};
  if (weights.cols() != rig.skeleton.bone_count())
    return Error{ErrorCode::bad_input,
                 std::to_string(weights.cols()) + " columns of weights for " +
                     std::to_string(rig.skeleton.bone_count()) + " bones",
                 "skin weights", "give one column of weights a bone"};

  Dominance result;
  result.starts_.reserve(static_cast<std::size_t>(mesh.face_count()) + 1);
  std::vector<double> sum(static_cast<std::size_t>(weights.cols()), 0.0);
  std::vector<Index> touched;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (cancelled(f)) return cancelled_error("dominance");
    for (int corner = 0; corner < 3; ++corner)
      for (SkinWeights::InnerIterator entry(weights, mesh.faces()(f, corner)); entry; ++entry) {
        if (!(entry.value() > 0)) continue;
        if (sum[static_cast<std::size_t>(entry.col())] == 0) touched.push_back(static_cast<Index>(entry.col()));
        sum[static_cast<std::size_t>(entry.col())] += entry.value();
      }
    for (const Index bone : touched) {
      result.shares_.push_back({bone, sum[static_cast<std::size_t>(bone)] / 3});
      sum[static_cast<std::size_t>(bone)] = 0;
    }
    touched.clear();
    std::sort(result.shares_.begin() + static_cast<std::ptrdiff_t>(result.starts_.back()), result.shares_.end(),
              [](const BoneShare& a, const BoneShare& b) {
                return a.weight != b.weight ? a.weight > b.weight : a.bone < b.bone;
              });
    result.starts_.push_back(result.shares_.size());
  }

  result.vertex_omega1_.assign(static_cast<std::size_t>(mesh.vertex_count()), 0.0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (cancelled(v)) return cancelled_error("dominance");
    double first = 0, second = 0;
    for (SkinWeights::InnerIterator entry(weights, v); entry; ++entry) {
      if (entry.value() > first)
        second = std::exchange(first, entry.value());
      else
        second = std::max(second, entry.value());
    }
    result.vertex_omega1_[static_cast<std::size_t>(v)] = first - second;
  }
  result.gradient_.setZero(mesh.face_count(), 3);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (cancelled(f)) return cancelled_error("dominance");
    if (!(mesh.area(f) > 0)) continue;
    Vector3 gradient = Vector3::Zero();
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      const auto vertex = static_cast<std::size_t>(mesh.origin(TriangleMesh<Scalar>::prev(h)));  // across from h
      gradient += result.vertex_omega1_[vertex] * mesh.normal(f).cross(mesh.edge_vector(h)).template cast<double>();
    }
    result.gradient_.row(f) = gradient.transpose() / (2 * static_cast<double>(mesh.area(f)));
  }
  return result;
}

}  // namespace quadrig
