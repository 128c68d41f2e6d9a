// Our own iterative solver: conjugate gradients with a multigrid preconditioner, in linear memory and time.
#pragma once

#include "quadrig/solver/levels.hpp"

namespace quadrig {

struct MultigridOptions {
  double tolerance = 1e-12;  ///< of |A x − b| / |b|; never below what the number type can hold
  Index max_iterations = 500;
  Index coarsest = 500;  ///< unknowns that are left to a direct solver

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const {
    const auto fail = [](const char* field, const char* remedy) {
      return Error{ErrorCode::bad_option, std::string(field) + " is out of range", "MultigridOptions", remedy};
    };
    if (!(tolerance > 0 && tolerance < 1)) return fail("tolerance", "give a number in (0, 1)");
    if (max_iterations < 1) return fail("max_iterations", "give 1 or more");
    if (coarsest < 1) return fail("coarsest", "give 1 or more");
    return {};
  }
};

/// Conjugate gradients, preconditioned by one cycle of smoothed aggregation whose prolongation carries phases: an
/// unknown is its neighbour's turned as the entry between them says, so that a field's transport, or a map's jumps,
/// are those of the coarser levels too. The levels are kept in single precision, which halves what an iteration reads;
/// where a matrix is too ill-conditioned for that they are made again in double. Sums run in blocks of their own, so
/// the bits do not depend on the threads. The few unknowns that very many rows share (the jumps and singular vertices
/// of a seamless map) are unknowns of every level, and the coarsest, which is solved exactly, moves them.
/// \cost factorize and each iteration O(nonzeros); on surfaces 20 to 30 iterations at any size.
/// Source: Vaněk, Mandel and Brezina 1996; the phases as in connection-aware multigrid on Laplacians of vector bundles;
/// l1 Gauss–Seidel: Baker, Falgout, Kolev and Yang 2011.
template <SparseScalar K>
class MultigridCg {
 public:
  using Real = real_of<K>;
  using Rough = std::conditional_t<std::is_same_v<K, Real>, float, std::complex<float>>;

  explicit MultigridCg(MultigridOptions options = {}) : options_(options) {}

  [[nodiscard]] static constexpr std::string_view name() { return "multigrid"; }

  /// The pattern alone says nothing about levels: they are made with the values. `order` is not needed.
  /// \fails bad_option by MultigridOptions::validate(); bad_input where `order` is given and is not a permutation.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context&) {
    ready_ = false;
    if (Status status = options_.validate(); !status.ok()) return status;
    return check_order(order, A.size, name());
  }

  /// Makes the levels. \fails numeric where a diagonal entry, or the coarsest matrix, shows that the matrix is not
  /// positive definite, or an entry is not finite; cancelled.
  Status factorize(const HermitianView<K>& A, Context& context) {
    ready_ = false;
    exact_.reset();
    for (Index i = 0; i < A.size; ++i) {
      const auto begin = detail::at(A.column_starts[detail::at(i)]);
      const auto end = detail::at(A.column_starts[detail::at(i) + 1]);
      bool finite = true;
      for (std::size_t e = begin; e < end; ++e) finite = finite && std::isfinite(std::norm(A.values[e]));
      if (finite && std::real(A.values[begin]) > 0) continue;
      return Error{ErrorCode::numeric, finite ? "the matrix is not positive definite" : "the matrix is not finite",
                   "solver multigrid, unknown " + std::to_string(i),
                   "every unknown needs a term, or a fixed value in its component"};
    }
    const detail::SparseRows<K> full = detail::full_rows(A);
    if (Status status = rough_.build(full, options_.coarsest, std::nullopt, context); !status.ok()) return status;
    matrix_ = detail::BlockedRows<K>(full, rough_.order());
    ready_ = true;
    return {};
  }

  /// \fails numeric where a direction of no curvature shows that the matrix is not positive definite, or
  /// where the iteration does not end; cancelled.
  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    std::fill(x.begin(), x.end(), K{});
    return improve(b, x, options_.tolerance, context);
  }

  /// From the x that is given, until |A x − b| / |b| is within `tolerance`.
  SolveInfo improve(std::span<const K> b, std::span<K> x, double tolerance, Context& context) {
    if (!ready_)
      return {.status = Error{ErrorCode::numeric, "solve without a successful factorization", "solver multigrid", {}}};
    if constexpr (!std::is_same_v<K, Rough>) {
      if (!exact_) {
        constexpr Index patience = 100;
        SolveInfo info = iterate(rough_, b, x, tolerance, std::min(patience, options_.max_iterations), context);
        if (info.status.ok() || info.status.error().code != ErrorCode::numeric || definite_failure_) return info;
        exact_.emplace();
        if (Status status = exact_->build(matrix_.rows(), options_.coarsest, rough_.kept(), context); !status.ok()) {
          exact_.reset();
          return {.status = status};
        }
      }
      return iterate(*exact_, b, x, tolerance, options_.max_iterations, context);
    } else {
      return iterate(rough_, b, x, tolerance, options_.max_iterations, context);
    }
  }

  /// Nonzeros of all levels' matrices and prolongations. \pre factorize succeeded
  [[nodiscard]] std::size_t stored_entries() const { return matrix_.entries() + rough_.entries(); }
  [[nodiscard]] std::string description() const {
    if (rough_.count() == 0) return std::string(name());
    return std::string(name()) + ", " + std::to_string(rough_.count()) + " levels" + (exact_ ? " in double" : "") +
           (rough_.kept() > 0 ? ", " + std::to_string(rough_.kept()) + " long rows" : "");
  }

 private:
  using Exact = detail::MultigridLevels<K, K>;

  template <class Levels, class L = std::conditional_t<std::is_same_v<Levels, Exact>, K, Rough>>
  SolveInfo iterate(Levels& levels, std::span<const K> b, std::span<K> x, double tolerance, Index limit,
                    Context& context) {
    definite_failure_ = false;
    const auto fail = [&](std::string what, std::string remedy, bool definite) {
      definite_failure_ = definite;
      return SolveInfo{.status = Error{ErrorCode::numeric, std::move(what), "solver multigrid", std::move(remedy)}};
    };
    const auto indefinite = [&](bool definite) {
      return fail("the matrix is not positive definite", "use a direct solver, which names an unknown", definite);
    };
    const std::size_t n = x.size();
    const std::vector<Index>& order = rough_.order();
    std::vector<K> right_hand(n), solution(n), q(n), r(n);
    for (std::size_t i = 0; i < n; ++i) {
      right_hand[i] = b[detail::at(order[i])];
      solution[i] = x[detail::at(order[i])];
    }
    std::vector<L> right(n), z(n), p(n);  // r over its size, what the levels make of it, the direction
    const auto square = [&](std::span<const K> v) {
      return matrix_.sum_of_blocks(context, [&](std::size_t, std::size_t begin, std::size_t end) {
        double sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += detail::BlockedRows<K>::product(v[i], v[i]);
        return sum;
      });
    };
    tolerance = std::max(tolerance, 16.0 * std::numeric_limits<Real>::epsilon());
    const double scale = std::sqrt(square(right_hand));
    if (!std::isfinite(scale)) return fail("the right-hand side is not finite", "check the right-hand side", true);
    SolveInfo info;
    info.residual = 0;
    if (scale == 0) {
      std::fill(x.begin(), x.end(), K{});
      return info;
    }
    matrix_.residual(right_hand, solution, r, context);
    double size = std::sqrt(square(r));
    if (!std::isfinite(size)) return fail("what it begins from is not finite", "begin from 0", true);
    const auto rough = [&](std::size_t i, double factor) {
      right[i] = static_cast<L>(static_cast<Real>(factor) * r[i]);
    };
    for (std::size_t i = 0; i < n && size > 0; ++i) rough(i, 1 / size);
    double unit = size, rho = 0;  // r is `unit` times `right`; so are the direction and its product
    for (double before = size; size > tolerance * scale; ++info.iterations) {
      if (info.iterations >= limit)
        return fail(
            "no convergence after " + std::to_string(limit) + " iterations, residual " + std::to_string(size / scale),
            "use a direct solver", false);
      if (context.cancelled()) return {.status = cancelled_error("solver multigrid")};
      const double next = levels.cycle(right, z, context);
      if (context.cancelled()) return {.status = cancelled_error("solver multigrid")};
      if (!(next > 0)) return indefinite(false);
      const double beta = info.iterations == 0 ? 0 : next / rho * (unit / before);
      rho = next;
      before = unit;
      const double curvature = matrix_.template renew_and_multiply<L>(z, static_cast<real_of<L>>(beta), p, q, context);
      if (!(curvature > 0)) return indefinite(!std::isnan(curvature));
      const auto step = static_cast<Real>(rho / curvature * unit);
      unit = size;
      size = std::sqrt(matrix_.sum_of_blocks(context, [&](std::size_t, std::size_t begin, std::size_t end) {
        double sum = 0;
        for (std::size_t i = begin; i < end; ++i) {
          solution[i] += step * static_cast<K>(p[i]);
          r[i] -= step * q[i];
          rough(i, 1 / unit);
          sum += detail::BlockedRows<K>::product(r[i], r[i]);
        }
        return sum;
      }));
      if (!std::isfinite(size)) return fail("the iteration is not finite", "check the matrix", false);
    }
    matrix_.residual(right_hand, solution, r, context);
    for (std::size_t i = 0; i < n; ++i) x[detail::at(order[i])] = solution[i];
    info.residual = std::sqrt(square(r)) / scale;
    if (!(info.residual < 1e3 * tolerance))
      return fail("the iteration lost its residual", "use a direct solver", false);
    return info;
  }

  MultigridOptions options_;
  detail::BlockedRows<K> matrix_;
  detail::MultigridLevels<K, Rough> rough_;
  std::optional<Exact> exact_;  // where single precision is not enough
  bool ready_ = false, definite_failure_ = false;
};

}  // namespace quadrig
