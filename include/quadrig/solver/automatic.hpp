// The choice of a backend for a pattern: direct while its factor fits, else iterative.
#pragma once

#include "quadrig/solver/mixed.hpp"
#include "quadrig/solver/multigrid.hpp"

namespace quadrig {

struct AutomaticOptions {
  /// Largest factor. The same on every machine unless the caller sets it, since the choice decides the last bits.
  double factor_bytes = 8e9;
  /// Systems in double of at least this many unknowns are factored in single precision, which is quicker where a
  /// factorization serves few right-hand sides.
  Index mixed_from = std::numeric_limits<Index>::max();
  double mixed_tolerance = MixedOptions().tolerance;  ///< of those

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const {
    if (!(factor_bytes >= 0))
      return Error{ErrorCode::bad_option, "factor_bytes is out of range", "AutomaticOptions", "give 0 or more"};
    if (mixed_from < 0)
      return Error{ErrorCode::bad_option, "mixed_from is out of range", "AutomaticOptions", "give 0 or more"};
    return MixedOptions{.tolerance = mixed_tolerance}.validate();
  }
};

/// Supernodal Cholesky, under the ordering that elimination_order chooses, where the pattern's factor stays within the
/// limit, in mixed precision where the options say so; multigrid above it. `description()` says which.
template <SparseScalar K>
class AutomaticSolver {
 public:
  explicit AutomaticSolver(AutomaticOptions options = {}) : options_(options) {}

  [[nodiscard]] static constexpr std::string_view name() { return "automatic"; }
  [[nodiscard]] std::string description() const {
    if (!analyzed_) return std::string(name());
    return std::string(name()) + ": " + chosen(*this, [](const auto& solver) { return solver.description(); });
  }
  [[nodiscard]] std::span<const Index> elimination_order() const {
    if (!analyzed_ || iterative_) return {};
    return mixed_ ? mixed_->elimination_order() : direct_.elimination_order();
  }

  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    if (Status status = options_.validate(); !status.ok()) return status;
    analyzed_ = false;
    iterative_.reset();
    mixed_.reset();
    direct_ = SupernodalCholesky<K>();
    if (sizeof(real_of<K>) > sizeof(float) && A.size >= options_.mixed_from)
      mixed_.emplace(MixedOptions{.tolerance = options_.mixed_tolerance});
    if (Status status = mixed_ ? mixed_->analyze(A, order, context) : direct_.analyze(A, order, context); !status.ok())
      return status;
    const double bytes = mixed_
                             ? static_cast<double>(mixed_->factor_nonzeros()) * sizeof(typename MixedCholesky<K>::Rough)
                             : static_cast<double>(direct_.factor_nonzeros()) * sizeof(K);
    if (bytes > options_.factor_bytes) {
      mixed_.reset();
      direct_ = SupernodalCholesky<K>();
      iterative_.emplace();
      if (Status status = iterative_->analyze(A, order, context); !status.ok()) return status;
    }
    analyzed_ = true;
    return {};
  }
  Status factorize(const HermitianView<K>& A, Context& context) {
    return chosen(*this, [&](auto& solver) { return solver.factorize(A, context); });
  }
  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    return chosen(*this, [&](auto& solver) { return solver.solve(b, x, context); });
  }
  SolveInfo improve(std::span<const K> b, std::span<K> x, double tolerance, Context& context) {
    return chosen(*this, [&](auto& solver) { return detail::improve<K>(solver, b, x, tolerance, context); });
  }
  SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) {
    return chosen(*this, [&](auto& solver) { return detail::solve_all<K>(solver, b, x, count, context); });
  }

 private:
  template <class Self, class Body>
  static auto chosen(Self& self, Body&& body) {
    return self.iterative_ ? body(*self.iterative_) : self.mixed_ ? body(*self.mixed_) : body(self.direct_);
  }

  AutomaticOptions options_;
  SupernodalCholesky<K> direct_;
  std::optional<MixedCholesky<K>> mixed_;
  std::optional<MultigridCg<K>> iterative_;
  bool analyzed_ = false;
};

}  // namespace quadrig
