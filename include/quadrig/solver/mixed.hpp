// A direct solver for large systems: the factor in single precision, the solution in double.
#pragma once

#include "quadrig/solver/supernodal.hpp"

namespace quadrig {

struct MixedOptions {
  Ordering ordering = Ordering::automatic;  ///< what `analyze` uses where it is given no order
  double tolerance = 1e-12;                 ///< of |A x − b| / |b|; never below what the number type can hold
};

/// SupernodalCholesky of the matrix, its diagonal scaled to 1, in single precision: half the memory and half the time.
/// Conjugate gradients that it preconditions, in the precision of K, take the solution to the tolerance: three
/// iterations on fields. Where the rough factor does not exist, or the iteration does not converge in `patience` steps,
/// the matrix is factored once more in the precision of K. The bits do not depend on the threads.
/// \cost as SupernodalCholesky, each iteration O(factor). Source: Arioli and Duff 2009; Higham and Mary 2022.
template <SparseScalar K>
class MixedCholesky {
 public:
  using Real = real_of<K>;
  using Rough = std::conditional_t<std::is_same_v<K, Real>, float, std::complex<float>>;

  explicit MixedCholesky(MixedOptions options = {}) : options_(options), rough_(options.ordering, negligible) {}

  [[nodiscard]] static constexpr std::string_view name() { return "supernodal-mixed"; }

  /// \fails bad_input where `order` is not a permutation of the unknowns; cancelled.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    factorized_ = false;
    exact_.reset();
    return renamed(rough_.analyze({A.size, A.column_starts, A.rows, {}}, order, context));
  }

  /// \fails numeric where a pivot is not positive beyond rounding, or not finite: names the unknown; cancelled.
  Status factorize(const HermitianView<K>& A, Context& context) {
    factorized_ = false;
    exact_.reset();
    values_.assign(A.values.begin(), A.values.end());
    scale_.resize(at(A.size));
    for (Index j = 0; j < A.size; ++j) {
      const Real diagonal = std::real(A.values[at(A.column_starts[at(j)])]);
      if (!(diagonal > 0 && std::isfinite(diagonal)))
        return Error{ErrorCode::numeric,
                     std::isfinite(diagonal) ? "the matrix is not positive definite" : "the matrix is not finite",
                     where() + ", unknown " + std::to_string(j),
                     "every unknown needs a term, or a fixed value in its component"};
      scale_[at(j)] = 1 / std::sqrt(diagonal);
    }
    std::vector<Rough> scaled(values_.size());
    for (Index j = 0; j < A.size; ++j)
      for (std::size_t e = at(A.column_starts[at(j)]); e < at(A.column_starts[at(j) + 1]); ++e)
        scaled[e] = static_cast<Rough>(values_[e] * scale_[at(A.rows[e])] * scale_[at(j)]);
    if (context.cancelled()) return cancelled_error(where());
    const Status status = rough_.factorize({A.size, A.column_starts, A.rows, scaled}, context);
    if (!status.ok()) {
      if (status.error().code != ErrorCode::numeric) return renamed(status);
      if (Status again = factorize_exactly(context); !again.ok()) return again;
    }
    factorized_ = true;
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    return solve(b, x, true, options_.tolerance, context);
  }
  /// From the x that is given, until |A x − b| / |b| is within `tolerance`.
  SolveInfo improve(std::span<const K> b, std::span<K> x, double tolerance, Context& context) {
    return solve(b, x, false, tolerance, context);
  }

  /// Several right-hand sides side by side; see AnySolver.
  SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) {
    if (factorized_ && !exact_) {
      const auto refined = [&](auto right, auto solution, Context& own) {
        Workspace workspace;
        return refine(right, solution, true, options_.tolerance, workspace, own);
      };
      const SolveInfo info = detail::solve_each<K>(b, x, count, true, context, refined);
      if (info.status.ok() || info.status.error().code != ErrorCode::numeric) return info;
    }
    return detail::solve_each<K>(b, x, count, false, context,
                                 [&](auto right, auto solution, Context& own) { return solve(right, solution, own); });
  }

  /// Entries stored for the rough factor. \pre analyze succeeded
  [[nodiscard]] std::size_t factor_nonzeros() const { return rough_.factor_nonzeros(); }
  /// The unknowns as they are eliminated; empty before analyze.
  [[nodiscard]] std::span<const Index> elimination_order() const { return rough_.elimination_order(); }
  /// "supernodal-mixed, nested dissection", and "in double" where single precision was not enough for the last matrix.
  [[nodiscard]] std::string description() const {
    return std::string(name()) + rough_.description().substr(rough_.name().size()) + (exact_ ? ", in double" : "");
  }

 private:
  static constexpr float negligible = 1e-18f;  // beside 1; its square is no subnormal number
  static constexpr Index patience = 20;
  template <class I>
  static std::size_t at(I i) {
    return static_cast<std::size_t>(i);
  }
  static std::string where() { return "solver " + std::string(name()); }
  static Status renamed(Status status) {
    if (status.ok()) return status;
    Error error = status.error();
    error.where.replace(0, std::string_view("solver supernodal").size(), where());
    return error;
  }

  static Status unsolved(std::string what) {
    return Error{ErrorCode::numeric, std::move(what), where(), "check the matrix"};
  }

  [[nodiscard]] HermitianView<K> matrix() const {
    const auto rough = rough_.matrix();
    return {rough.size, rough.column_starts, rough.rows, values_};
  }

  Status factorize_exactly(Context& context) {
    SupernodalCholesky<K> exact;
    if (Status status = exact.analyze(matrix(), rough_.elimination_order(), context); !status.ok())
      return renamed(status);
    if (Status status = exact.factorize(matrix(), context); !status.ok()) return renamed(status);
    exact_ = std::move(exact);
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, bool from_zero, double tolerance, Context& context) {
    if (!factorized_) return {.status = Error{ErrorCode::numeric, "solve without a factorization", where(), {}}};
    if (!std::isfinite(square(b)))
      return {.status = Error{ErrorCode::numeric, "the right-hand side is not finite", where(), "check it"}};
    if (!exact_) {
      SolveInfo info = refine(b, x, from_zero, tolerance, workspace_, context);
      if (info.status.ok() || info.status.error().code != ErrorCode::numeric) return info;
      if (Status status = factorize_exactly(context); !status.ok()) return {.status = status};
    }
    SolveInfo info = exact_->solve(b, x, context);
    info.status = renamed(std::move(info.status));
    return info;
  }

  struct Workspace {
    std::vector<K> residual, direction, product;
    std::vector<Rough> y;  // as the unknowns are eliminated
    double rho = 0;        // residual · preconditioned residual of the last step; 0: there was none

    void resize(std::size_t n) {
      for (auto* each : {&residual, &direction, &product}) each->resize(n);
      y.resize(n);
    }
  };

  /// \fails numeric where the iteration does not converge; cancelled.
  SolveInfo refine(std::span<const K> b, std::span<K> x, bool from_zero, double tolerance, Workspace& work,
                   Context& context) const {
    tolerance = std::max(tolerance, 16.0 * std::numeric_limits<Real>::epsilon());
    const double unit = std::sqrt(square(b));
    SolveInfo info;
    info.residual = 0;
    if (from_zero || unit == 0) std::fill(x.begin(), x.end(), K{});
    if (unit == 0) {
      if (std::ranges::any_of(b, [](const K& each) { return each != K{}; }))
        info.status = unsolved("the right-hand side is too small");
      return info;
    }
    work.resize(b.size());
    const auto measure = [&] {
      multiply<K>(matrix(), x, work.product);
      for (std::size_t i = 0; i < b.size(); ++i) work.residual[i] = b[i] - work.product[i];
      info.residual = std::sqrt(square(work.residual)) / unit;
    };
    if (from_zero) {
      std::copy(b.begin(), b.end(), work.residual.begin());
      info.residual = 1;
    } else {
      measure();
    }
    // Above this the residual that the iteration renews is the residual: rounding moves it by far less.
    constexpr double lasting = 1e7 * std::numeric_limits<Real>::epsilon();
    const double goal = tolerance > lasting ? tolerance : tolerance / 2;
    for (double before = std::numeric_limits<double>::infinity(); !(info.residual <= tolerance); measure()) {
      if (!(info.residual < before / 2)) {  // what rounding leaves cannot be bettered by starting again
        if (!(info.residual < 1e3 * tolerance)) info.status = unsolved("the iteration does not converge");
        return info;
      }
      before = info.residual;
      for (work.rho = 0; info.residual > goal; ++info.iterations) {
        info.status = info.iterations < patience ? advance(x, work, context) : unsolved("too many iterations");
        if (!info.status.ok()) return info;
        info.residual = std::sqrt(square(work.residual)) / unit;
        if (!std::isfinite(info.residual)) info.status = unsolved("the iteration is not finite");
        if (!info.status.ok()) return info;
      }
      if (info.residual > lasting) return info;
    }
    return info;
  }

  // One step of conjugate gradients from x, whose residual is known.
  Status advance(std::span<K> x, Workspace& work, Context& context) const {
    auto& [r, p, product, y, rho] = work;
    if (context.cancelled()) return cancelled_error(where());
    const std::span<const Index> unknown = rough_.elimination_order();
    double size = 0;
    for (std::size_t i = 0; i < r.size(); ++i) size += inner(r[i], r[i]) * (static_cast<double>(scale_[i]) * scale_[i]);
    size = std::sqrt(size);
    for (std::size_t k = 0; k < y.size(); ++k) {
      const std::size_t i = at(unknown[k]);
      y[k] = static_cast<Rough>(r[i] * static_cast<Real>(scale_[i] / size));
    }
    rough_.substitute_ordered(y, &context);
    if (context.cancelled()) return cancelled_error(where());
    const auto preconditioned = [&](std::size_t k) {
      return static_cast<K>(y[k]) * static_cast<Real>(scale_[at(unknown[k])] * size);
    };
    double next = 0;
    for (std::size_t k = 0; k < y.size(); ++k) next += inner(r[at(unknown[k])], preconditioned(k));
    const bool first = rho == 0;
    const auto beta = static_cast<Real>(first ? 0 : next / rho);
    rho = next;
    for (std::size_t k = 0; k < y.size(); ++k) {
      K& direction = p[at(unknown[k])];
      direction = first ? preconditioned(k) : preconditioned(k) + beta * direction;
    }
    multiply<K>(matrix(), p, product);
    double curvature = 0;
    for (std::size_t i = 0; i < p.size(); ++i) curvature += inner(p[i], product[i]);
    if (!(rho > 0 && curvature > 0)) return unsolved("the matrix is not positive definite");
    const auto step = static_cast<Real>(rho / curvature);
    for (std::size_t i = 0; i < p.size(); ++i) {
      x[i] += step * p[i];
      r[i] -= step * product[i];
    }
    return {};
  }

  // Re x̄ y, and |x|², in double.
  static double inner(const K& x, const K& y) {
    if constexpr (std::is_same_v<K, Real>)
      return static_cast<double>(x) * y;
    else
      return static_cast<double>(x.real()) * y.real() + static_cast<double>(x.imag()) * y.imag();
  }
  static double square(std::span<const K> v) {
    double sum = 0;
    for (const K& each : v) sum += inner(each, each);
    return sum;
  }

  MixedOptions options_;
  SupernodalCholesky<Rough> rough_;
  std::vector<K> values_;    // of the last matrix
  std::vector<Real> scale_;  // what takes its diagonal to 1
  std::optional<SupernodalCholesky<K>> exact_;
  Workspace workspace_;  // of one solve, kept for the next
  bool factorized_ = false;
};

}  // namespace quadrig
