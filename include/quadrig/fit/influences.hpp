// Few skin weights that move a vertex as many do.
#pragma once

#include <numeric>

#include "quadrig/skinning.hpp"

namespace quadrig::detail {

struct Influence {
  Index bone = no_index;
  double weight = 0;
};

/// The `most` weights that keep a vertex closest to where all of its weights take it, over the poses: non-negative
/// least squares with sum 1, on the strongest bones first and then by exchange of one bone at a time.
class InfluenceLimit {
  static constexpr int largest = 24;  // candidates: on the stack
  using Gram = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, largest, largest>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, largest, 1>;

 public:
  /// \param pose_weights one a pose
  InfluenceLimit(std::span<const Pose> poses, std::span<const double> pose_weights, Index most)
      : poses_(poses), pose_weights_(pose_weights), most_(at(most)) {}

  struct Limited {
    std::vector<Influence> weights;  ///< > 0, sum 1, by bone
    double squared_error = 0;        ///< Σ_p weight_p |displacement|²
  };
  /// \pre all > 0, sum 1, more than `most`. \cost O(poses · candidates²)
  [[nodiscard]] Limited operator()(const Vector3& p, std::vector<Influence> all) const {
    std::sort(all.begin(), all.end(), [](const Influence& a, const Influence& b) {
      return a.weight != b.weight ? a.weight > b.weight : a.bone < b.bone;
    });
    // Weaker bones than these hardly move the vertex at all.
    const std::size_t candidates = std::min({all.size(), most_ + 8, at(largest)});
    const auto c = static_cast<Eigen::Index>(candidates);
    Gram gram = Gram::Zero(c, c);
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, largest> off(3, c);
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      Vector3 whole = Vector3::Zero();
      for (std::size_t i = 0; i < all.size(); ++i) {
        const Vector3 moved = poses_[k][at(all[i].bone)] * p;
        whole += all[i].weight * moved;
        if (i < candidates) off.col(static_cast<Eigen::Index>(i)) = moved;
      }
      off.colwise() -= whole;
      gram += pose_weights_[k] * (off.transpose() * off);
    }
    // Bones that move alike in all poses share what is left as they did before.
    Vector given(c);
    for (Eigen::Index i = 0; i < c; ++i) given[i] = all[at(static_cast<Index>(i))].weight;
    given /= given.sum();
    const double ridge = 1e-4 * gram.trace() / static_cast<double>(c) + std::numeric_limits<double>::min();

    std::vector<Eigen::Index> chosen(std::min(most_, candidates));
    std::iota(chosen.begin(), chosen.end(), Eigen::Index{0});
    Fit best = fit(gram, given, ridge, chosen);
    for (int round = 0; round < 8; ++round) {
      Fit better = best;
      std::vector<Eigen::Index> better_chosen = chosen;
      for (std::size_t out = 0; out < chosen.size(); ++out)
        for (Eigen::Index in = 0; in < c; ++in) {
          if (std::find(chosen.begin(), chosen.end(), in) != chosen.end()) continue;
          std::vector<Eigen::Index> trial = chosen;
          trial[out] = in;
          if (Fit found = fit(gram, given, ridge, trial); found.cost < better.cost * (1 - 1e-9))
            better = std::move(found), better_chosen = std::move(trial);
        }
      if (!(better.cost < best.cost)) break;
      best = std::move(better);
      chosen = std::move(better_chosen);
    }
    Limited result;
    for (Eigen::Index i = 0; i < c; ++i)
      if (best.x[i] > 0) result.weights.push_back({all[at(static_cast<Index>(i))].bone, best.x[i]});
    std::sort(result.weights.begin(), result.weights.end(),
              [](const Influence& a, const Influence& b) { return a.bone < b.bone; });
    result.squared_error = std::max(0.0, best.x.dot(gram * best.x));
    return result;
  }

 private:
  struct Fit {
    Vector x;
    double cost = 0;
  };
  /// Least xᵀ G x + ridge |x − given|² on a support, with sum 1; bones that come out negative leave it one by one.
  static Fit fit(const Gram& gram, const Vector& given, double ridge, std::vector<Eigen::Index> support) {
    Fit result{Vector::Zero(given.size()), 0};
    for (;;) {
      const auto k = static_cast<Eigen::Index>(support.size());
      Gram a(k, k);
      Eigen::Matrix<double, Eigen::Dynamic, 2, 0, largest, 2> b(k, 2);
      for (Eigen::Index i = 0; i < k; ++i) {
        for (Eigen::Index j = 0; j < k; ++j) a(i, j) = gram(support[at(int(i))], support[at(int(j))]);
        a(i, i) += ridge;
        b(i, 0) = ridge * given[support[at(int(i))]];
        b(i, 1) = 1;
      }
      const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, largest, 2> solved = a.ldlt().solve(b);
      const Vector x = solved.col(0) + (1 - solved.col(0).sum()) / solved.col(1).sum() * solved.col(1);
      Eigen::Index least = 0;
      if (k == 1 || x.minCoeff(&least) >= 0) {
        for (Eigen::Index i = 0; i < k; ++i) result.x[support[at(int(i))]] = k == 1 ? 1 : x[i];
        break;
      }
      support.erase(support.begin() + least);
    }
    result.cost = result.x.dot(gram * result.x) + ridge * (result.x - given).squaredNorm();
    return result;
  }

  std::span<const Pose> poses_;
  std::span<const double> pose_weights_;
  std::size_t most_;
};

}  // namespace quadrig::detail
