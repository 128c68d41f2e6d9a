// Our own iterative solver: conjugate gradients with a multigrid preconditioner, in linear memory and time.
#pragma once

#include "quadrig/solver/aggregation.hpp"
#include "quadrig/solver/supernodal.hpp"

namespace quadrig {

struct MultigridOptions {
  double tolerance = 1e-12;  ///< of |A x − b| / |b|; never below what the number type can hold
  Index max_iterations = 500;
  Index coarsest = 500;  ///< unknowns that are left to a direct solver
};

/// Conjugate gradients, preconditioned by one V-cycle of smoothed aggregation whose prolongation carries phases: an
/// unknown is its neighbour's turned as the entry between them says, so that a field's transport, or a map's jumps,
/// are those of the coarser levels too. Sums run in blocks of their own, so the bits do not depend on the threads.
/// \cost factorize and each iteration O(nonzeros); on surfaces about 20 iterations at any size.
/// Source: Vaněk, Mandel and Brezina 1996; the phases as in connection-aware multigrid on Laplacians of vector bundles.
template <SparseScalar K>
class MultigridCg {
 public:
  using Real = real_of<K>;

  explicit MultigridCg(MultigridOptions options = {}) : options_(options) {}

  [[nodiscard]] static constexpr std::string_view name() { return "multigrid"; }

  /// The pattern alone says nothing about levels: they are made with the values. `order` is not needed.
  /// \fails bad_input where `order` is given and is not a permutation.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context&) {
    ready_ = false;
    if (!order.empty()) {
      std::vector<char> seen(detail::to_size(A.size), 0);
      bool sound = order.size() == seen.size();
      for (std::size_t k = 0; sound && k < order.size(); ++k)
        sound = order[k] >= 0 && order[k] < A.size && !std::exchange(seen[detail::to_size(order[k])], char{1});
      if (!sound)
        return Error{ErrorCode::bad_input, "the elimination order is not a permutation of the unknowns",
                     "solver multigrid", "list every unknown once, or pass an empty order"};
    }
    return {};
  }

  /// Makes the levels. \fails numeric where a diagonal entry, or the coarsest matrix, shows that the matrix is not
  /// positive definite, or an entry is not finite; cancelled.
  Status factorize(const HermitianView<K>& A, Context& context) {
    ready_ = false;
    levels_.clear();
    levels_.push_back({detail::full_rows(A), {}, {}, {}, {}, {}, {}});
    for (Index i = 0; i < A.size; ++i) {
      const auto begin = detail::to_size(A.column_starts[detail::to_size(i)]);
      const auto end = detail::to_size(A.column_starts[detail::to_size(i) + 1]);
      bool finite = true;
      for (std::size_t e = begin; e < end; ++e) finite = finite && std::isfinite(std::norm(A.values[e]));
      if (finite && std::real(A.values[begin]) > 0) continue;
      return Error{ErrorCode::numeric, finite ? "the matrix is not positive definite" : "the matrix is not finite",
                   "solver multigrid, unknown " + std::to_string(i),
                   "every unknown needs a term, or a fixed value in its component"};
    }
    while (levels_.back().matrix.size() > options_.coarsest && levels_.size() < 30) {
      if (context.cancelled()) return cancelled_error("solver multigrid");
      Level& fine = levels_.back();
      const Index size = fine.matrix.size();
      detail::SparseRows<K> tentative = detail::aggregate(fine.matrix, static_cast<int>(levels_.size()) - 1);
      if (tentative.columns_count == 0 || tentative.columns_count > size * 9 / 10) break;
      fine.prolong = detail::smoothed(fine.matrix, tentative);
      fine.restrict_to = detail::adjoint(fine.prolong);
      detail::SparseRows<K> coarse = detail::product(fine.restrict_to, detail::product(fine.matrix, fine.prolong));
      levels_.push_back({std::move(coarse), {}, {}, {}, {}, {}, {}});
    }
    for (Level& level : levels_) {
      level.diagonal = level.matrix.diagonal();
      for (const Real each : level.diagonal)
        if (!(each > 0) || !std::isfinite(each))
          return Error{ErrorCode::numeric, "the matrix is not positive definite", "solver multigrid",
                       "every unknown needs a term, or a fixed value in its component"};
    }
    const HermitianMatrix<K> last = detail::lower_columns(levels_.back().matrix);
    coarsest_ = SupernodalCholesky<K>();
    Context own;
    own.threads = 1;
    if (Status status = coarsest_.analyze(last.view(), {}, own); !status.ok()) return status;
    if (Status status = coarsest_.factorize(last.view(), own); !status.ok()) {
      Error error = status.error();
      error.where = levels_.size() == 1 ? "solver multigrid" + error.where.substr(error.where.find(','))
                                        : std::string("solver multigrid, coarsest level");
      return error;
    }
    ready_ = true;
    return {};
  }

  /// From x = 0. \fails numeric where a direction of no curvature shows that the matrix is not positive definite, or
  /// where the iteration does not end; cancelled.
  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    const auto fail = [](std::string what, std::string remedy) {
      return SolveInfo{.status = Error{ErrorCode::numeric, std::move(what), "solver multigrid", std::move(remedy)}};
    };
    if (!ready_) return fail("solve without a successful factorization", {});
    const detail::SparseRows<K>& A = levels_.front().matrix;
    const std::size_t n = x.size();
    std::vector<K> r(b.begin(), b.end()), z(n), p(n), q(n);
    std::fill(x.begin(), x.end(), K{});
    const Real tolerance = std::max(static_cast<Real>(options_.tolerance), 16 * std::numeric_limits<Real>::epsilon());
    const Real scale = std::sqrt(std::real(dot(r, r, context)));
    if (!std::isfinite(scale)) return fail("the right-hand side is not finite", "check the right-hand side");
    SolveInfo info;
    info.residual = 0;
    if (scale == 0) return info;
    Real rho = 0;
    for (Index iteration = 0;; ++iteration) {
      const Real size = std::sqrt(std::real(dot(r, r, context)));
      if (!(size > tolerance * scale)) {
        if (!std::isfinite(size)) return fail("the iteration is not finite", "check the matrix");
        break;
      }
      if (iteration >= options_.max_iterations)
        return fail("no convergence after " + std::to_string(iteration) + " iterations, residual " +
                        std::to_string(static_cast<double>(size / scale)),
                    "use a direct solver");
      if (context.cancelled()) return {.status = cancelled_error("solver multigrid")};
      cycle(0, r, z, context);
      const Real next = std::real(dot(r, z, context));
      if (!(next > 0))
        return fail("the matrix is not positive definite", "use a direct solver, which names an unknown");
      const Real beta = iteration == 0 ? Real(0) : next / rho;
      rho = next;
      blocks(n, context, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) p[i] = z[i] + beta * p[i];
      });
      A.multiply(p, q, context);
      const Real curvature = std::real(dot(p, q, context));
      if (!(curvature > 0))
        return fail("the matrix is not positive definite", "use a direct solver, which names an unknown");
      const Real step = rho / curvature;
      blocks(n, context, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          x[i] += step * p[i];
          r[i] -= step * q[i];
        }
      });
      info.iterations = iteration + 1;
    }
    A.multiply(x, q, context);
    for (std::size_t i = 0; i < n; ++i) r[i] = b[i] - q[i];
    info.residual = static_cast<double>(std::sqrt(std::real(dot(r, r, context))) / scale);
    if (!(info.residual < 1e3 * static_cast<double>(tolerance)))
      return fail("the iteration lost its residual", "use a direct solver");
    return info;
  }

  /// Nonzeros of all levels' matrices and prolongations. \pre factorize succeeded
  [[nodiscard]] std::size_t stored_entries() const {
    std::size_t total = 0;
    for (const Level& level : levels_)
      total += level.matrix.values.size() + level.prolong.values.size() + level.restrict_to.values.size();
    return total;
  }
  [[nodiscard]] std::string description() const {
    return levels_.empty() ? std::string(name())
                           : std::string(name()) + ", " + std::to_string(levels_.size()) + " levels";
  }

 private:
  static constexpr std::size_t block = 16384;  // rows that are smoothed one after the other

  struct Level {
    detail::SparseRows<K> matrix, prolong, restrict_to;
    std::vector<Real> diagonal;
    std::vector<K> residual, right, correction;  // right and correction are of the level below
  };

  // body(begin, end) over ranges made of whole blocks.
  template <class Body>
  static void blocks(std::size_t n, const Context& context, Body&& body) {
    const std::size_t count = (n + block - 1) / block;
    context.parallel_for(count, 2, [&](std::size_t first, std::size_t last) {
      for (std::size_t k = first; k < last; ++k) body(k * block, std::min(n, (k + 1) * block));
    });
  }

  static K dot(std::span<const K> a, std::span<const K> b, const Context& context) {
    std::vector<K> part((a.size() + block - 1) / block);
    blocks(a.size(), context, [&](std::size_t begin, std::size_t end) {
      Real re = 0;
      for (std::size_t i = begin; i < end; ++i)
        re += std::real(a[i]) * std::real(b[i]) + std::imag(a[i]) * std::imag(b[i]);
      part[begin / block] = K(re);
    });
    K sum{};
    for (const K& each : part) sum += each;
    return sum;
  }

  // x = one V-cycle on b from zero: Gauss–Seidel within blocks forward, then the coarser levels, then backward.
  void cycle(std::size_t depth, std::span<const K> b, std::span<K> x, Context& context) {
    Level& level = levels_[depth];
    if (depth + 1 == levels_.size()) {
      coarsest_.substitute(b, x);
      return;
    }
    const detail::SparseRows<K>& A = level.matrix;
    const std::size_t n = x.size();
    blocks(n, context, [&](std::size_t begin, std::size_t end) {
      const auto first = static_cast<Index>(begin);
      for (std::size_t i = begin; i < end; ++i) {
        K sum = b[i];
        for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e) {
          const Index j = A.columns[e];
          if (j >= first && j < static_cast<Index>(i))
            detail::subtract_product(sum, A.values[e], x[detail::to_size(j)]);
        }
        x[i] = sum / level.diagonal[i];
      }
    });
    level.residual.resize(n);
    level.right.resize(detail::to_size(levels_[depth + 1].matrix.size()));
    level.correction.resize(level.right.size());
    blocks(n, context, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        K sum = b[i];
        for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e)
          detail::subtract_product(sum, A.values[e], x[detail::to_size(A.columns[e])]);
        level.residual[i] = sum;
      }
    });
    level.restrict_to.multiply(level.residual, level.right, context);
    cycle(depth + 1, level.right, level.correction, context);
    const detail::SparseRows<K>& P = level.prolong;
    std::vector<K>& before = level.residual;
    blocks(n, context, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        K sum{};
        for (std::size_t e = P.starts[i]; e < P.starts[i + 1]; ++e)
          detail::subtract_product(sum, P.values[e], level.correction[detail::to_size(P.columns[e])]);
        x[i] -= sum;
        before[i] = x[i];
      }
    });
    blocks(n, context, [&](std::size_t begin, std::size_t end) {
      const auto first = static_cast<Index>(begin), last = static_cast<Index>(end);
      for (std::size_t i = end; i-- > begin;) {
        K sum = b[i];
        for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e) {
          const Index j = A.columns[e];
          if (j == static_cast<Index>(i)) continue;
          detail::subtract_product(sum, A.values[e],
                                   (j >= first && j < last ? x : std::span<K>(before))[detail::to_size(j)]);
        }
        x[i] = sum / level.diagonal[i];
      }
    });
  }

  MultigridOptions options_;
  std::vector<Level> levels_;
  SupernodalCholesky<K> coarsest_;
  bool ready_ = false;
};

}  // namespace quadrig
