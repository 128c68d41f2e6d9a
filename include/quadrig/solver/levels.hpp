// The levels of multigrid and one cycle over them, in a precision of their own.
#pragma once

#include "quadrig/solver/blocked.hpp"
#include "quadrig/solver/supernodal.hpp"

namespace quadrig::detail {

/// Smoothed aggregation made in the numbers K and kept in the numbers L, which may be shorter: what a preconditioner
/// reads at every iteration is half as much then.
template <class K, class L>
class MultigridLevels {
 public:
  /// Unknowns that fall into one of the coarser levels stand together in `order()`, so that what a block of rows reads
  /// is near. Those with long rows stand last: they are unknowns of every level, and the coarsest alone moves them.
  /// `in_order`: how many such there are, where `finest` is in that order already, which stays.
  /// \fails numeric where a diagonal entry, or the coarsest matrix, shows that the matrix is not positive definite;
  ///   cancelled.
  Status build(const SparseRows<K>& finest, Index coarsest, std::optional<Index> in_order, Context& context) {
    levels_.clear();
    const auto last_of = [&](Index n) {  // marked where there are any
      std::vector<char> marks(kept_ > 0 ? at(n) : 0, 0);
      std::fill_n(marks.rbegin(), kept_, char{1});
      return marks;
    };
    std::vector<char> kept;
    kept_ = in_order.value_or(0);
    if (in_order) {
      kept = last_of(finest.size());
    } else if (const std::vector<Index> found = long_rows(finest, 4 * at(coarsest)); !found.empty()) {
      kept_ = static_cast<Index>(found.size());
      kept.resize(at(finest.size()), 0);
      for (const Index i : found) kept[at(i)] = 1;
    }
    const auto indefinite = [] {
      return Error{ErrorCode::numeric, "the matrix is not positive definite", "solver multigrid",
                   "every unknown needs a term, or a fixed value in its component"};
    };
    struct Made {
      SparseRows<K> coarse, prolong;  // `coarse`: this level's matrix, but for the finest
      std::vector<Index> group;
    };
    std::vector<Made> made(1);
    const auto matrix = [&](std::size_t depth) -> const SparseRows<K>& {
      return depth == 0 ? finest : made[depth].coarse;
    };
    real_of<K> largest = 0;
    for (;;) {
      if (context.cancelled()) return cancelled_error("solver multigrid");
      const SparseRows<K>& fine = matrix(made.size() - 1);
      for (const real_of<K> each : fine.diagonal()) {
        if (!(each > 0) || !std::isfinite(each)) return indefinite();
        if (made.size() == 1) largest = std::max(largest, each);
      }
      const Index moved = fine.size() - kept_;
      if (moved <= coarsest || made.size() >= 30) break;
      const SparseRows<K> tentative = aggregate<K>(fine, kept, static_cast<int>(made.size()) - 1);
      const Index groups = tentative.columns_count - kept_;
      if (groups == 0 || groups > moved / 10 * 9) break;
      Made& level = made.back();
      level.prolong = smoothed<K>(fine, kept, kept.empty() ? tentative : joined<K>(fine, kept, tentative));
      kept = last_of(tentative.columns_count);
      level.group.resize(at(fine.size()), no_index);
      for (std::size_t i = 0; i < level.group.size(); ++i)
        if (tentative.starts[i] < tentative.starts[i + 1]) level.group[i] = tentative.columns[tentative.starts[i]];
      SparseRows<K> coarse = product(adjoint(level.prolong), product(fine, level.prolong));
      made.push_back({std::move(coarse), {}, {}});
    }
    if (made.size() == 1) kept_ = 0;  // nothing is smoothed, and nothing stands last
    const HermitianMatrix<K> last = lower_columns(matrix(made.size() - 1));
    coarsest_ = coarsest_solver();
    Context own;
    own.threads = 1;
    if (Status status = coarsest_.analyze(last.view(), {}, own); !status.ok()) return status;
    if (Status status = coarsest_.factorize(last.view(), own); !status.ok()) {
      Error error = status.error();
      if (made.size() > 1) error.where = "solver multigrid, coarsest level";  // its unknowns have no number outside
      return error;
    }

    // From the coarsest up: each level in the order of the one below it, and what that order makes of it.
    factor_ = std::is_same_v<K, L> ? real_of<K>(1) : 1 / largest;  // within what L can hold
    levels_.resize(made.size());
    std::vector<Index> below;
    for (std::size_t depth = made.size(); depth-- > 0; below = order_) {
      Made& from = made[depth];
      Level& level = levels_[depth];
      order_.resize(at(matrix(depth).size()));
      for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<Index>(i);
      const bool finer = depth + 1 < made.size();
      std::vector<Index> position(below.size());
      for (std::size_t i = 0; i < below.size(); ++i) position[at(below[i])] = static_cast<Index>(i);
      if (!in_order && finer) order_ = by_group(from.group, position, at(kept_));
      level.matrix = BlockedRows<L>(matrix(depth), order_, factor_, at(kept_));
      if (finer) {
        level.prolong = permuted<L>(from.prolong, order_, position);
        level.restrict_to = adjoint(level.prolong);
        level.residual.resize(order_.size());
        for (std::vector<L>* each : {&level.right, &level.correction, &level.rest, &level.more})
          each->resize(below.size());
      }
      from = {};
    }
    return {};
  }

  /// Unknowns with long rows.
  [[nodiscard]] Index kept() const { return kept_; }
  /// The unknown at each place of `cycle`'s vectors.
  [[nodiscard]] const std::vector<Index>& order() const { return order_; }

  /// x = one cycle on b from zero; returns b · x, and anything once the context is cancelled. \pre build succeeded
  double cycle(std::span<const L> b, std::span<L> x, Context& context) { return cycle(0, b, x, context); }

  [[nodiscard]] std::size_t count() const { return levels_.size(); }
  /// Entries of all levels' matrices, prolongations and restrictions.
  [[nodiscard]] std::size_t entries() const {
    std::size_t total = 0;
    for (const Level& level : levels_)
      total += level.matrix.entries() + level.prolong.values.size() + level.restrict_to.values.size();
    return total;
  }

 private:
  // Groups in their order, unknowns of none after them, but before the last groups, of those kept.
  static std::vector<Index> by_group(std::span<const Index> group, std::span<const Index> position, std::size_t kept) {
    std::vector<std::size_t> next(position.size() + 2, 0);
    const std::size_t none = position.size() - kept;
    const auto place = [&](Index g) {
      const std::size_t p = g == no_index ? none : at(position[at(g)]);
      return g != no_index && p >= none ? p + 1 : p;
    };
    for (const Index g : group) ++next[place(g) + 1];
    for (std::size_t k = 0; k + 1 < next.size(); ++k) next[k + 1] += next[k];
    std::vector<Index> order(group.size());
    for (std::size_t i = 0; i < group.size(); ++i) order[next[place(group[i])]++] = static_cast<Index>(i);
    return order;
  }

  static SupernodalCholesky<K> coarsest_solver() {
    return SupernodalCholesky<K>(Ordering::automatic, 0, large_system + 1, "multigrid");
  }

  struct Level {
    BlockedRows<L> matrix;
    SparseRows<L> prolong, restrict_to;
    std::vector<L> residual, right, correction, rest, more;  // all but the first are of the level below
  };

  // Gauss–Seidel within blocks upwards, then the coarser levels, then downwards. Levels that are small beside the one
  // above them are visited twice, which costs little and bounds the iterations.
  double cycle(std::size_t depth, std::span<const L> b, std::span<L> x, Context& context) {
    Level& level = levels_[depth];
    if (depth + 1 == levels_.size()) {
      if constexpr (std::is_same_v<K, L>) {
        coarsest_.substitute(b, x, &context);
      } else {
        const std::vector<K> wide(b.begin(), b.end());
        std::vector<K> solution(wide.size());
        coarsest_.substitute(wide, solution, &context);
        for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<L>(solution[i] / factor_);
      }
      double sum = 0;
      for (std::size_t i = 0; i < x.size(); ++i) sum += BlockedRows<L>::product(b[i], x[i]);
      return sum;
    }
    if (context.cancelled()) return 0;
    level.matrix.smooth_upwards(b, x, level.residual, context);
    if (context.cancelled()) return 0;
    level.restrict_to.multiply(level.residual, level.right, context);
    cycle(depth + 1, level.right, level.correction, context);
    BlockedRows<L>& below = levels_[depth + 1].matrix;
    if (depth + 2 < levels_.size() && 2 * below.entries() <= level.matrix.entries()) {
      below.residual(level.right, level.correction, level.rest, context);
      cycle(depth + 1, level.rest, level.more, context);
      for (std::size_t i = 0; i < level.more.size(); ++i) level.correction[i] += level.more[i];
    }
    if (context.cancelled()) return 0;
    return level.matrix.correct_and_smooth_downwards(level.prolong, level.correction, b, x, context);
  }

  std::vector<Level> levels_;
  SupernodalCholesky<K> coarsest_ = coarsest_solver();
  std::vector<Index> order_;
  Index kept_ = 0;
  real_of<K> factor_ = 1;  // of the matrices of all levels
};

}  // namespace quadrig::detail
