// The choice of a backend for a pattern: direct while its factor fits, else iterative.
#pragma once

#include "quadrig/solver/multigrid.hpp"
#include "quadrig/solver/supernodal.hpp"

namespace quadrig {

struct AutomaticOptions {
  /// What the factor may take. The same on every machine unless the caller says otherwise, as the choice must be.
  double factor_bytes = 8e9;
};

/// Supernodal Cholesky, under the ordering that elimination_order chooses, where the pattern's factor stays within the
/// limit; multigrid above it. `description()` tells which.
template <SparseScalar K>
class AutomaticSolver {
 public:
  explicit AutomaticSolver(AutomaticOptions options = {}) : options_(options) {}

  [[nodiscard]] static constexpr std::string_view name() { return "automatic"; }
  [[nodiscard]] std::string description() const {
    if (!analyzed_) return std::string(name());
    return std::string(name()) + ": " + (iterative_ ? iterative_->description() : direct_.description());
  }
  [[nodiscard]] std::span<const Index> elimination_order() const {
    return analyzed_ && !iterative_ ? direct_.elimination_order() : std::span<const Index>();
  }

  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    analyzed_ = false;
    iterative_.reset();
    if (Status status = direct_.analyze(A, order, context); !status.ok()) return status;
    if (static_cast<double>(direct_.factor_nonzeros()) * sizeof(K) > options_.factor_bytes) {
      direct_ = SupernodalCholesky<K>();
      iterative_.emplace();
      if (Status status = iterative_->analyze(A, order, context); !status.ok()) return status;
    }
    analyzed_ = true;
    return {};
  }
  Status factorize(const HermitianView<K>& A, Context& context) {
    return iterative_ ? iterative_->factorize(A, context) : direct_.factorize(A, context);
  }
  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    return iterative_ ? iterative_->solve(b, x, context) : direct_.solve(b, x, context);
  }
  SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) {
    if (!iterative_) return direct_.solve_all(b, x, count, context);
    return detail::solve_each<K>(b, x, count, false, context, [&](auto right, auto solution, Context& own) {
      return iterative_->solve(right, solution, own);
    });
  }

 private:
  AutomaticOptions options_;
  SupernodalCholesky<K> direct_;
  std::optional<MultigridCg<K>> iterative_;
  bool analyzed_ = false;
};

}  // namespace quadrig
