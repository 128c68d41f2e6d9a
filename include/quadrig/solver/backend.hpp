// The second extension point: what solves Hermitian positive definite systems. Knows no mesh.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <string_view>

#include "quadrig/sparse.hpp"

namespace quadrig {

/// What one solve did.
struct SolveInfo {
  Status status;
  /// |A x − b| / |b|; NaN where the backend does not measure it.
  double residual = std::numeric_limits<double>::quiet_NaN();
  Index iterations = 0;  ///< 0 for a direct backend
};

/// Anything that solves A x = b in three steps. `analyze` sees the pattern (once), `factorize` the values (as often as
/// they change, the pattern being that of `analyze`), `solve` a right-hand side. `order` lists the unknowns in the
/// order in which to eliminate them, or is empty: the backend finds its own. Views are borrowed for the call.
/// A matrix that is not positive definite, or not finite, is an error of `factorize` or `solve`, never an assertion.
/// `laws.hpp` checks one.
template <class S, class K>
concept SolverBackend = requires(S& solver, HermitianView<K> A, std::span<const Index> order, std::span<const K> b,
                                 std::span<K> x, Context& context) {
  { solver.name() } -> std::convertible_to<std::string_view>;
  { solver.analyze(A, order, context) } -> std::same_as<Status>;
  { solver.factorize(A, context) } -> std::same_as<Status>;
  { solver.solve(b, x, context) } -> std::same_as<SolveInfo>;
};

/// Whether `order` lists the unknowns [0, size), each once; an empty order does, too: the backend finds its own.
/// \fails bad_input, in the words of `solver`. \cost O(size)
[[nodiscard]] inline Status check_order(std::span<const Index> order, Index size, std::string_view solver) {
  if (order.empty()) return {};
  std::vector<char> seen(detail::at(size), 0);
  bool sound = order.size() == seen.size();
  for (std::size_t k = 0; sound && k < order.size(); ++k)
    sound = order[k] >= 0 && order[k] < size && !std::exchange(seen[detail::at(order[k])], char{1});
  if (sound) return {};
  return Error{ErrorCode::bad_input, "the elimination order is not a permutation of the unknowns",
               "solver " + std::string(solver), "list every unknown once, or pass an empty order"};
}

namespace detail {

/// Calls one(b, x, context) for each of several right-hand sides, side by side where `parallel` says so.
template <class K, class One>
SolveInfo solve_each(std::span<const K> b, std::span<K> x, Index count, bool parallel, Context& context, One&& one) {
  const std::size_t n = count > 0 ? b.size() / static_cast<std::size_t>(count) : 0;
  std::vector<SolveInfo> infos(static_cast<std::size_t>(std::max(count, Index{0})));
  const auto work = [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      Context own = context.quiet(parallel ? 1 : context.threads);  // its callbacks are for the caller's thread
      infos[k] = one(b.subspan(k * n, n), x.subspan(k * n, n), own);
    }
  };
  if (parallel)
    context.parallel_for(infos.size(), 1, work);
  else
    work(0, infos.size());
  SolveInfo all;
  for (const SolveInfo& info : infos) {
    if (!info.status.ok()) return info;
    all.residual = std::isnan(all.residual) ? info.residual : std::max(all.residual, info.residual);
    all.iterations = std::max(all.iterations, info.iterations);
  }
  return all;
}

/// What AnySolver's functions of these names do with a backend that may lack them.
template <class K, class S>
SolveInfo solve_all(S& solver, std::span<const K> b, std::span<K> x, Index count, Context& context) {
  if constexpr (requires {
                  { solver.solve_all(b, x, count, context) } -> std::same_as<SolveInfo>;
                })
    return solver.solve_all(b, x, count, context);
  else
    return solve_each<K>(b, x, count, false, context,
                         [&](auto right, auto solution, Context& own) { return solver.solve(right, solution, own); });
}
template <class K, class S>
SolveInfo improve(S& solver, std::span<const K> b, std::span<K> x, double tolerance, Context& context) {
  if constexpr (requires {
                  { solver.improve(b, x, tolerance, context) } -> std::same_as<SolveInfo>;
                })
    return solver.improve(b, x, tolerance, context);
  else
    return solver.solve(b, x, context);
}

}  // namespace detail

/// A backend of any type. Copies are deep where the backend can be copied, and then share nothing that a later call
/// changes: analyze once, copy, and factorize different values of the same pattern side by side.
template <SparseScalar K>
class AnySolver {
 public:
  template <class S>
  requires(!std::is_same_v<std::remove_cvref_t<S>, AnySolver> && SolverBackend<std::remove_cvref_t<S>, K>)
      AnySolver(S&& backend)
      : model_(std::make_unique<Model<std::remove_cvref_t<S>>>(std::forward<S>(backend))) {}

  [[nodiscard]] std::string_view name() const { return model_->name(); }
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    analyzed_version_ = 0;
    return model_->analyze(A, order, context);
  }
  Status factorize(const HermitianView<K>& A, Context& context) { return model_->factorize(A, context); }
  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) { return model_->solve(b, x, context); }
  /// `count` right-hand sides at once, one after the other in b, their solutions in x: side by side where the backend
  /// has a function of this name, else in turn. The bits are those of `solve`. Returns the first failure, or the
  /// largest residual and number of iterations. \pre b and x hold `count` times as many numbers as there are unknowns
  SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) {
    return model_->solve_all(b, x, count, context);
  }
  /// From the x that is given until |A x − b| / |b| is within `tolerance`, by a backend that iterates and has a
  /// function of this name; others solve from 0.
  SolveInfo improve(std::span<const K> b, std::span<K> x, double tolerance, Context& context) {
    return model_->improve(b, x, tolerance, context);
  }

  /// The order of the last analysis if the backend provides `elimination_order()`, else empty.
  [[nodiscard]] std::span<const Index> elimination_order() const { return model_->elimination_order(); }
  /// What the backend chose, in words, if it provides `description()`; else its name.
  [[nodiscard]] std::string description() const { return model_->description(); }

  /// Analyzes where `pattern_version` is not that of the last call, then factorizes.
  Status prepare(const HermitianView<K>& A, std::uint64_t pattern_version, Context& context,
                 std::span<const Index> order = {}) {
    if (analyzed_version_ != pattern_version) {
      if (Status status = analyze(A, order, context); !status.ok()) return status;
      analyzed_version_ = pattern_version;
    }
    return factorize(A, context);
  }

  [[nodiscard]] bool can_clone() const { return model_->can_clone(); }
  /// A copy with the same analysis. \pre can_clone()
  [[nodiscard]] AnySolver clone() const { return AnySolver(model_->clone(), analyzed_version_); }

 private:
  struct Base {
    virtual ~Base() = default;
    [[nodiscard]] virtual std::string_view name() const = 0;
    virtual Status analyze(const HermitianView<K>&, std::span<const Index>, Context&) = 0;
    virtual Status factorize(const HermitianView<K>&, Context&) = 0;
    virtual SolveInfo solve(std::span<const K>, std::span<K>, Context&) = 0;
    virtual SolveInfo solve_all(std::span<const K>, std::span<K>, Index, Context&) = 0;
    virtual SolveInfo improve(std::span<const K>, std::span<K>, double, Context&) = 0;
    [[nodiscard]] virtual std::span<const Index> elimination_order() const = 0;
    [[nodiscard]] virtual std::string description() const = 0;
    [[nodiscard]] virtual bool can_clone() const = 0;
    [[nodiscard]] virtual std::unique_ptr<Base> clone() const = 0;
  };
  template <class S>
  struct Model final : Base {
    explicit Model(S backend) : solver(std::move(backend)) {}
    std::string_view name() const override { return solver.name(); }
    Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) override {
      return solver.analyze(A, order, context);
    }
    Status factorize(const HermitianView<K>& A, Context& context) override { return solver.factorize(A, context); }
    SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) override {
      return solver.solve(b, x, context);
    }
    SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) override {
      return detail::solve_all<K>(solver, b, x, count, context);
    }
    SolveInfo improve(std::span<const K> b, std::span<K> x, double tolerance, Context& context) override {
      return detail::improve<K>(solver, b, x, tolerance, context);
    }
    std::span<const Index> elimination_order() const override {
      if constexpr (requires(const S& s) {
                      { s.elimination_order() } -> std::convertible_to<std::span<const Index>>;
                    })
        return solver.elimination_order();
      else
        return {};
    }
    std::string description() const override {
      if constexpr (requires(const S& s) {
                      { s.description() } -> std::convertible_to<std::string>;
                    })
        return solver.description();
      else
        return std::string(solver.name());
    }
    bool can_clone() const override { return std::copy_constructible<S>; }
    std::unique_ptr<Base> clone() const override {
      if constexpr (std::copy_constructible<S>)
        return std::make_unique<Model>(solver);
      else
        return nullptr;
    }
    S solver;
  };

  AnySolver(std::unique_ptr<Base> model, std::uint64_t version)
      : model_(std::move(model)), analyzed_version_(version) {}

  std::unique_ptr<Base> model_;
  std::uint64_t analyzed_version_ = 0;
};

}  // namespace quadrig
