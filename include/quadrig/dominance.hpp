// How strongly one bone, two bones, … rule each place of a skinned surface (thesis 4.1).
#pragma once

#include <span>

#include "quadrig/rig.hpp"

namespace quadrig {

/// The bones of each face by falling weight, and the fields ω_k = k (w_k − w_{k+1}) made of them. Σ_k ω_k = 1 where
/// the weights sum to 1: ω_1 = 1 on the skin of one bone, ω_2 = 1 where two bones share alike.
class Dominance {
 public:
  /// From the weights alone, a column a bone.
  /// Threads: those of the context. \cost O(stored weights) time and memory. Source: thesis 4.1.
  /// \fails bad_input where the weights have another number of rows than the mesh has vertices; cancelled, where there
  ///   is a context.
  template <class Scalar>
  [[nodiscard]] static Expected<Dominance> create(const TriangleMesh<Scalar>& mesh, const SkinWeights& weights,
                                                  const Context* context = nullptr);
  /// The same for the weights of a rig. \fails bad_input too where they have not one column a bone of the skeleton
  template <class Scalar>
  [[nodiscard]] static Expected<Dominance> create(const TriangleMesh<Scalar>& mesh, const Rig& rig,
                                                  const Context* context = nullptr) {
    if (rig.weights.cols() != rig.skeleton.bone_count())
      return Error{ErrorCode::bad_input,
                   std::to_string(rig.weights.cols()) + " columns of weights for " +
                       std::to_string(rig.skeleton.bone_count()) + " bones",
                   "skin weights", "give one column of weights a bone"};
    return create(mesh, rig.weights, context);
  }

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
  /// ω_1 of each vertex.
  [[nodiscard]] const std::vector<double>& vertex_omega1() const { return vertex_omega1_; }
  /// Its gradient on a face, one over length, as a piecewise linear function. \pre the mesh of `create`
  template <class Scalar>
  [[nodiscard]] Vector3 gradient_omega1(const TriangleMesh<Scalar>& mesh, Index face) const {
    Vector3 gradient = Vector3::Zero();
    if (!(mesh.area(face) > 0)) return gradient;
    for (const Index h : mesh.halfedges_of(face)) {
      const auto across = detail::at(mesh.origin(mesh.prev(h)));
      gradient += vertex_omega1_[across] * mesh.normal(face).cross(mesh.edge_vector(h)).template cast<double>();
    }
    return gradient / (2 * static_cast<double>(mesh.area(face)));
  }

 private:
  std::vector<std::size_t> starts_{0};
  std::vector<BoneShare> shares_;
  std::vector<double> vertex_omega1_;
};

template <class Scalar>
Expected<Dominance> Dominance::create(const TriangleMesh<Scalar>& mesh, const SkinWeights& weights,
                                      const Context* context) {
  if (weights.rows() != mesh.vertex_count())
    return Error{
        ErrorCode::bad_input,
        std::to_string(weights.rows()) + " rows of weights for " + std::to_string(mesh.vertex_count()) + " vertices",
        "skin weights", "give one row of weights a vertex"};

  // Faces in runs, each run's shares in a list of its own until all are known.
  constexpr std::size_t run = 16'384;
  const auto m = static_cast<std::size_t>(mesh.face_count()), n = static_cast<std::size_t>(mesh.vertex_count());
  const auto each_run = [&](std::size_t count, auto&& body) {  // body(run, begin, end)
    const auto bodies = [&](std::size_t first, std::size_t last) {
      for (std::size_t r = first; r < last; ++r)
        if (!context || !context->cancelled()) body(r, r * run, std::min(count, (r + 1) * run));
    };
    if (context)
      context->parallel_for((count + run - 1) / run, 1, bodies);
    else
      bodies(0, (count + run - 1) / run);
  };
  Dominance result;
  result.starts_.assign(m + 1, 0);
  std::vector<std::vector<BoneShare>> of_run((m + run - 1) / run);
  each_run(m, [&](std::size_t r, std::size_t begin, std::size_t end) {
    std::vector<double> sum(static_cast<std::size_t>(weights.cols()), 0.0);
    std::vector<Index> touched;
    std::vector<BoneShare>& shares = of_run[r];
    std::size_t most = 0;
    for (std::size_t f = begin; f < end; ++f)
      for (int corner = 0; corner < 3; ++corner) {
        const Index v = mesh.faces()(static_cast<Index>(f), corner);
        most += static_cast<std::size_t>(weights.outerIndexPtr()[v + 1] - weights.outerIndexPtr()[v]);
      }
    shares.reserve(most);
    for (std::size_t f = begin; f < end; ++f) {
      for (int corner = 0; corner < 3; ++corner)
        for (SkinWeights::InnerIterator entry(weights, mesh.faces()(static_cast<Index>(f), corner)); entry; ++entry) {
          if (!(entry.value() > 0)) continue;
          if (sum[static_cast<std::size_t>(entry.col())] == 0) touched.push_back(static_cast<Index>(entry.col()));
          sum[static_cast<std::size_t>(entry.col())] += entry.value();
        }
      const auto own = static_cast<std::ptrdiff_t>(shares.size());
      for (const Index bone : touched) {
        shares.push_back({bone, sum[static_cast<std::size_t>(bone)] / 3});
        sum[static_cast<std::size_t>(bone)] = 0;
      }
      result.starts_[f + 1] = touched.size();
      touched.clear();
      std::sort(shares.begin() + own, shares.end(), BoneShare::stronger);
    }
  });
  for (std::size_t f = 0; f < m; ++f) result.starts_[f + 1] += result.starts_[f];
  result.shares_.resize(result.starts_[m]);
  each_run(m, [&](std::size_t r, std::size_t begin, std::size_t) {
    std::copy(of_run[r].begin(), of_run[r].end(),
              result.shares_.begin() + static_cast<std::ptrdiff_t>(result.starts_[begin]));
  });

  result.vertex_omega1_.assign(n, 0.0);
  each_run(n, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      double first = 0, second = 0;
      for (SkinWeights::InnerIterator entry(weights, static_cast<Index>(v)); entry; ++entry) {
        if (entry.value() > first)
          second = std::exchange(first, entry.value());
        else
          second = std::max(second, entry.value());
      }
      result.vertex_omega1_[v] = first - second;
    }
  });
  if (context && context->cancelled()) return cancelled_error("dominance");
  return result;
}

}  // namespace quadrig
