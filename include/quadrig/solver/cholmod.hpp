// CHOLMOD, in two backends named by the licence of the code that they run. Only with QUADRIG_WITH_CHOLMOD.
#pragma once

// Without the GPL component its declarations are left out too.
#if !defined(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL) && !defined(NSUPERNODAL)
#define NSUPERNODAL
#endif
#if __has_include(<suitesparse/cholmod.h>)
#include <suitesparse/cholmod.h>
#else
#include <cholmod.h>
#endif

#include "quadrig/solver/backend.hpp"

namespace quadrig {

namespace detail {

/// What the two backends share. One thread; a threaded BLAS under the supernodal one is the process's to limit.
template <class K>
requires(std::is_same_v<real_of<K>, double>) class Cholmod {
 public:
  Cholmod(int method, int ordering) : ordering_(ordering) {
    cholmod_start(&common_);
    common_.supernodal = method;
    common_.print = 0;
    common_.nmethods = 1;
    common_.method[0].ordering = ordering_;
    common_.postorder = 1;
  }
  ~Cholmod() {
    if (!owns_) return;
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(Cholmod&& other) noexcept
      : ordering_(other.ordering_),
        common_(other.common_),
        factor_(std::exchange(other.factor_, nullptr)),
        factorized_(other.factorized_),
        owns_(std::exchange(other.owns_, false)) {}
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
  Cholmod& operator=(Cholmod&&) = delete;

  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context&) {
    cholmod_free_factor(&factor_, &common_);
    factorized_ = false;
    cholmod_sparse matrix = borrow(A);
    if (order.empty()) {
      common_.method[0].ordering = ordering_;
      factor_ = cholmod_analyze(&matrix, &common_);
    } else {
      if (Status status = check_order(order, A.size, "cholmod"); !status.ok()) return status;
      std::vector<int> permutation(order.begin(), order.end());
      common_.method[0].ordering = CHOLMOD_GIVEN;
      factor_ = cholmod_analyze_p(&matrix, permutation.data(), nullptr, 0, &common_);
    }
    if (!factor_)
      return Error{ErrorCode::numeric, "the analysis failed, CHOLMOD status " + std::to_string(common_.status),
                   "solver cholmod", "check the order and the memory"};
    return {};
  }

  Status factorize(const HermitianView<K>& A, Context&) {
    assert(factor_);
    factorized_ = false;
    cholmod_sparse matrix = borrow(A);
    cholmod_factorize(&matrix, factor_, &common_);
    const auto fail = [](std::string what, std::size_t unknown) {
      return Status(Error{ErrorCode::numeric, std::move(what), "solver cholmod, unknown " + std::to_string(unknown),
                          "every unknown needs a term, or a fixed value in its component"});
    };
    const auto* permutation = static_cast<const int*>(factor_->Perm);
    if (common_.status < 0)
      return Error{ErrorCode::numeric, "the factorization failed, CHOLMOD status " + std::to_string(common_.status),
                   "solver cholmod", "check the memory"};
    if (factor_->minor < factor_->n)
      return fail("the matrix is not positive definite", static_cast<std::size_t>(permutation[factor_->minor]));
    // LDLᴴ goes on past negative pivots, and either kind past NaN.
    const double rounding = 4 * std::numeric_limits<double>::epsilon();
    for (Index k = 0; k < A.size; ++k) {
      const auto unknown = static_cast<std::size_t>(permutation[k]);
      const double diagonal = std::real(A.values[static_cast<std::size_t>(A.column_starts[unknown])]);
      if (factor_->is_super) {
        if (!std::isfinite(diagonal)) return fail("the matrix is not finite", unknown);
        continue;
      }
      const auto place = static_cast<const int*>(factor_->p)[k];
      double pivot = std::real(static_cast<const K*>(factor_->x)[place]);
      if (factor_->is_ll) pivot *= pivot;
      if (!std::isfinite(pivot)) return fail("the matrix is not finite", unknown);
      if (!(pivot > rounding * diagonal)) return fail("the matrix is not positive definite", unknown);
    }
    factorized_ = true;
    matrix_ = {A.size,
               {A.column_starts.begin(), A.column_starts.end()},
               {A.rows.begin(), A.rows.end()},
               {A.values.begin(), A.values.end()}};
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context&) {
    if (!factorized_)
      return {.status = Error{ErrorCode::numeric, "solve without a successful factorization", "solver cholmod", {}}};
    std::vector<K> right(b.begin(), b.end());
    cholmod_dense dense{};
    dense.nrow = dense.nzmax = dense.d = right.size();
    dense.ncol = 1;
    dense.x = right.data();
    dense.xtype = xtype();
    dense.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solution = cholmod_solve(CHOLMOD_A, factor_, &dense, &common_);
    if (!solution)
      return {.status = Error{ErrorCode::numeric, "the solve failed, CHOLMOD status " + std::to_string(common_.status),
                              "solver cholmod", "check the memory"}};
    std::copy_n(static_cast<const K*>(solution->x), x.size(), x.begin());
    cholmod_free_dense(&solution, &common_);
    SolveInfo info;
    info.residual = relative_residual(matrix_.view(), std::span<const K>(x), b);
    if (!std::isfinite(info.residual))
      info.status =
          Error{ErrorCode::numeric, "the solution is not finite", "solver cholmod", "check the right-hand side"};
    return info;
  }

 private:
  static constexpr int xtype() { return std::is_same_v<K, double> ? CHOLMOD_REAL : CHOLMOD_COMPLEX; }

  // CHOLMOD takes no pointers to const, and does not write through these.
  static cholmod_sparse borrow(const HermitianView<K>& A) {
    cholmod_sparse matrix{};
    matrix.nrow = matrix.ncol = static_cast<std::size_t>(A.size);
    matrix.nzmax = A.rows.size();
    matrix.p = const_cast<Index*>(A.column_starts.data());
    matrix.i = const_cast<Index*>(A.rows.data());
    matrix.x = const_cast<K*>(A.values.data());
    matrix.stype = -1;
    matrix.itype = CHOLMOD_INT;
    matrix.xtype = xtype();
    matrix.dtype = CHOLMOD_DOUBLE;
    matrix.sorted = 1;
    matrix.packed = 1;
    return matrix;
  }

  int ordering_;
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
  HermitianMatrix<K> matrix_;  // of the last factorization, for residuals
  bool factorized_ = false;
  bool owns_ = true;
};

}  // namespace detail

/// Simplicial LDLᴴ of CHOLMOD's Cholesky module (LGPL-2.1+).
template <class K>
class CholmodSimplicialLgpl : public detail::Cholmod<K> {
 public:
  /// `ordering` is CHOLMOD_AMD or CHOLMOD_METIS, where CHOLMOD was built with it.
  explicit CholmodSimplicialLgpl(int ordering = CHOLMOD_AMD) : detail::Cholmod<K>(CHOLMOD_SIMPLICIAL, ordering) {}
  [[nodiscard]] static constexpr std::string_view name() { return "cholmod-simplicial-lgpl"; }
};

#if defined(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL)
/// Supernodal LLᴴ of CHOLMOD's Supernodal module (GPL-2+): a program that links it is under that licence.
template <class K>
class CholmodSupernodalGpl : public detail::Cholmod<K> {
 public:
  explicit CholmodSupernodalGpl(int ordering = CHOLMOD_AMD) : detail::Cholmod<K>(CHOLMOD_SUPERNODAL, ordering) {}
  [[nodiscard]] static constexpr std::string_view name() { return "cholmod-supernodal-gpl"; }
};
#endif

}  // namespace quadrig
