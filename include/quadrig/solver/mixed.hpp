// A direct solver for large systems: the factor in single precision, the solution in double.
#pragma once

#include "quadrig/solver/ordered_rows.hpp"
#include "quadrig/solver/supernodal.hpp"

namespace quadrig {

struct MixedOptions {
  Ordering ordering = Ordering::automatic;  ///< what `analyze` uses where it is given no order
  double tolerance = 1e-12;                 ///< of |A x − b| / |b|; never below what the number type can hold

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const {
    if (tolerance > 0 && tolerance < 1) return {};
    return Error{ErrorCode::bad_option, "tolerance is out of range", "MixedOptions", "give a number in (0, 1)"};
  }
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

  explicit MixedCholesky(MixedOptions options = {})
      : options_(options), rough_(options.ordering, negligible, 0, name()) {}

  [[nodiscard]] static constexpr std::string_view name() { return "supernodal-mixed"; }

  /// \fails bad_option by MixedOptions::validate(); bad_input where `order` is not a permutation of the unknowns;
  ///   cancelled.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    if (Status status = options_.validate(); !status.ok()) return status;
    factorized_ = false;
    exact_.reset();
    if (Status status = rough_.analyze({A.size, A.column_starts, A.rows, {}}, order, context); !status.ok())
      return status;
    matrix_.analyze(A, rough_.elimination_order(), context);
    return context.cancelled() ? Status(cancelled_error(where())) : Status();
  }

  /// \fails numeric where a pivot is not positive beyond rounding, or not finite: names the unknown; cancelled.
  Status factorize(const HermitianView<K>& A, Context& context) {
    factorized_ = false;
    exact_.reset();
    std::vector<Real> scale(at(A.size));  // takes the diagonal to 1
    for (Index j = 0; j < A.size; ++j) {
      const Real diagonal = std::real(A.values[at(A.column_starts[at(j)])]);
      if (!(diagonal > 0 && std::isfinite(diagonal)))
        return Error{ErrorCode::numeric,
                     std::isfinite(diagonal) ? "the matrix is not positive definite" : "the matrix is not finite",
                     where() + ", unknown " + std::to_string(j),
                     "every unknown needs a term, or a fixed value in its component"};
      scale[at(j)] = 1 / std::sqrt(diagonal);
    }
    matrix_.fill(A.values, context);
    scale_.resize(scale.size());
    const std::span<const Index> unknown = rough_.elimination_order();
    for (std::size_t k = 0; k < scale.size(); ++k) scale_[k] = scale[at(unknown[k])];
    std::vector<Rough, detail::Untouched<Rough>> scaled(A.values.size());
    context.parallel_for(scale.size(), 16384, [&](std::size_t first, std::size_t last) {
      for (std::size_t j = first; j < last; ++j)
        for (std::size_t e = at(A.column_starts[j]); e < at(A.column_starts[j + 1]); ++e)
          scaled[e] = static_cast<Rough>(A.values[e] * scale[at(A.rows[e])] * scale[j]);
    });
    if (context.cancelled()) return cancelled_error(where());
    const Status status = rough_.factorize({A.size, A.column_starts, A.rows, scaled}, context);
    if (!status.ok()) {
      if (status.error().code != ErrorCode::numeric) return status;
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
  static Status unsolved(std::string what) {
    return Error{ErrorCode::numeric, std::move(what), where(), "check the matrix"};
  }

  Status factorize_exactly(Context& context) {
    const auto pattern = rough_.matrix();
    const std::vector<K> values = matrix_.given_values();
    const HermitianView<K> A{pattern.size, pattern.column_starts, pattern.rows, values};
    SupernodalCholesky<K> exact(options_.ordering, 0, detail::large_system + 1, name());
    if (Status status = exact.analyze(A, rough_.elimination_order(), context); !status.ok()) return status;
    if (Status status = exact.factorize(A, context); !status.ok()) return status;
    exact_ = std::move(exact);
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, bool from_zero, double tolerance, Context& context) {
    if (!factorized_) return {.status = Error{ErrorCode::numeric, "solve without a factorization", where(), {}}};
    if (!exact_) {
      SolveInfo info = refine(b, x, from_zero, tolerance, workspace_, context);
      if (info.status.ok() || info.status.error().code != ErrorCode::numeric) return info;
      if (Status status = factorize_exactly(context); !status.ok()) return {.status = status};
    }
    return exact_->solve(b, x, context);
  }

  // Of one solve, in the order of elimination.
  struct Workspace {
    std::vector<K> solution, residual, direction, product;
    std::vector<Rough> y;
    double size = 0;         // of the residual
    double scaled_size = 0;  // of the residual where the diagonal is scaled to 1
    double rho = 0;          // residual · preconditioned residual of the last step; 0: there was none
  };
  static constexpr std::size_t grain = 16384;

  /// \fails numeric where the iteration does not converge; cancelled.
  SolveInfo refine(std::span<const K> b, std::span<K> x, bool from_zero, double tolerance, Workspace& work,
                   Context& context) const {
    tolerance = std::max(tolerance, 16.0 * std::numeric_limits<Real>::epsilon());
    const std::span<const Index> unknown = rough_.elimination_order();
    const std::size_t n = unknown.size();
    for (auto* each : {&work.solution, &work.residual, &work.direction, &work.product}) each->resize(n);
    work.y.resize(n);
    const double unit = std::sqrt(context.parallel_sum(n, [&](std::size_t begin, std::size_t end) {
      double sum = 0;
      for (std::size_t i = begin; i < end; ++i) sum += inner(b[i], b[i]);
      return sum;
    }));
    SolveInfo info;
    info.residual = 0;
    if (!std::isfinite(unit)) {
      info.status = Error{ErrorCode::numeric, "the right-hand side is not finite", where(), "check it"};
      return info;
    }
    if (unit == 0) {
      std::fill(x.begin(), x.end(), K{});
      if (std::ranges::any_of(b, [](const K& each) { return each != K{}; }))
        info.status = unsolved("the right-hand side is too small");
      return info;
    }
    context.parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) work.solution[k] = from_zero ? K{} : x[at(unknown[k])];
    });
    const auto measure = [&] {
      take_sizes(context, work, [&](std::size_t k) {
        return work.residual[k] = b[at(unknown[k])] - matrix_.row_times(k, work.solution);
      });
      info.residual = work.size / unit;
    };
    measure();
    // Above this the residual that the iteration renews is the residual: rounding moves it by far less.
    constexpr double lasting = 1e7 * std::numeric_limits<Real>::epsilon();
    const double goal = tolerance > lasting ? tolerance : tolerance / 2;
    for (double before = std::numeric_limits<double>::infinity(); !(info.residual <= tolerance); measure()) {
      if (!(info.residual < before / 2)) {  // what rounding leaves cannot be bettered by starting again
        if (!(info.residual < 1e3 * tolerance)) info.status = unsolved("the iteration does not converge");
        break;
      }
      before = info.residual;
      for (work.rho = 0; info.residual > goal; ++info.iterations) {
        info.status = info.iterations < patience ? advance(work, context) : unsolved("too many iterations");
        if (!info.status.ok()) return info;
        info.residual = work.size / unit;
        if (!std::isfinite(info.residual)) info.status = unsolved("the iteration is not finite");
        if (!info.status.ok()) return info;
      }
      if (info.residual > lasting) break;
    }
    context.parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) x[at(unknown[k])] = work.solution[k];
    });
    return info;
  }

  // One step of conjugate gradients from a solution whose residual is known.
  Status advance(Workspace& work, Context& context) const {
    std::vector<K>&solution = work.solution, &r = work.residual, &p = work.direction, &product = work.product;
    std::vector<Rough>& y = work.y;
    const double scaled_size = work.scaled_size;  // taken anew at the end
    double& rho = work.rho;
    if (context.cancelled()) return cancelled_error(where());
    context.parallel_for(r.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k)
        y[k] = static_cast<Rough>(r[k] * static_cast<Real>(scale_[k] / scaled_size));
    });
    rough_.substitute_ordered(y, &context);
    if (context.cancelled()) return cancelled_error(where());
    const auto preconditioned = [&](std::size_t k) {
      return static_cast<K>(y[k]) * static_cast<Real>(scale_[k] * scaled_size);
    };
    const bool first = rho == 0;
    const double next = context.parallel_sum(r.size(), [&](std::size_t begin, std::size_t end) {
      double sum = 0;
      for (std::size_t k = begin; k < end; ++k) {
        const K z = preconditioned(k);
        if (first) p[k] = z;
        sum += inner(r[k], z);
      }
      return sum;
    });
    if (!first) {
      const auto beta = static_cast<Real>(next / rho);
      context.parallel_for(r.size(), grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) p[k] = preconditioned(k) + beta * p[k];
      });
    }
    rho = next;
    const double curvature = context.parallel_sum(r.size(), [&](std::size_t begin, std::size_t end) {
      double sum = 0;
      for (std::size_t k = begin; k < end; ++k) {
        product[k] = matrix_.row_times(k, p);
        sum += inner(p[k], product[k]);
      }
      return sum;
    });
    if (!(rho > 0 && curvature > 0)) return unsolved("the matrix is not positive definite");
    const auto step = static_cast<Real>(rho / curvature);
    take_sizes(context, work, [&](std::size_t k) {
      solution[k] += step * p[k];
      return r[k] -= step * product[k];
    });
    return {};
  }

  // Those of the numbers residual(k).
  template <class Residual>
  void take_sizes(const Context& context, Workspace& work, Residual&& residual) const {
    using Sums = Eigen::Array2d;
    const auto of_run = [&](std::size_t begin, std::size_t end) {
      Sums sum = Sums::Zero();
      for (std::size_t k = begin; k < end; ++k) {
        const K r = residual(k);
        const double square = inner(r, r);
        sum += Sums(square, square * (static_cast<double>(scale_[k]) * scale_[k]));
      }
      return sum;
    };
    const Sums squares = context.parallel_sum<Sums>(scale_.size(), of_run, Sums::Zero());
    work.size = std::sqrt(squares[0]);
    work.scaled_size = std::sqrt(squares[1]);
  }

  // Re x̄ y, and |x|², in double.
  static double inner(const K& x, const K& y) {
    if constexpr (std::is_same_v<K, Real>)
      return static_cast<double>(x) * y;
    else
      return static_cast<double>(x.real()) * y.real() + static_cast<double>(x.imag()) * y.imag();
  }

  MixedOptions options_;
  SupernodalCholesky<Rough> rough_;
  detail::OrderedRows<K> matrix_;
  std::vector<Real> scale_;  // what takes its diagonal to 1, in the order of elimination
  std::optional<SupernodalCholesky<K>> exact_;
  Workspace workspace_;  // of one solve, kept for the next
  bool factorized_ = false;
};

}  // namespace quadrig
