// Eigen's simplicial LDLᴴ, with the ordering kept apart from the numbers.
#pragma once

#include <cmath>

#include <Eigen/SparseCholesky>

#include "quadrig/solver/backend.hpp"
#include "quadrig/solver/ordering.hpp"

namespace quadrig {

/// Sparse LDLᴴ, one thread. The permuted pattern and the place of every value in it are found by `analyze`, so that a
/// new factorization copies values and nothing else. Copies share the analysis.
/// \cost on a surface's dual graph O(n log n) memory, O(n^1.5) factorization.
template <SparseScalar K>
class SimplicialLdlt {
 public:
  /// `ordering` is what `analyze` uses where it is given no order.
  explicit SimplicialLdlt(Ordering ordering = Ordering::automatic) : ordering_(ordering) {}
  SimplicialLdlt(const SimplicialLdlt& other) : ordering_(other.ordering_), analysis_(other.analysis_) {
    adopt_analysis();
  }
  SimplicialLdlt(SimplicialLdlt&&) noexcept = default;
  SimplicialLdlt& operator=(const SimplicialLdlt&) = delete;
  SimplicialLdlt& operator=(SimplicialLdlt&&) noexcept = default;
  ~SimplicialLdlt() = default;

  [[nodiscard]] static constexpr std::string_view name() { return "eigen"; }

  /// \fails bad_input where `order` is not a permutation of the unknowns; cancelled.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    const auto n = static_cast<std::size_t>(A.size);
    auto analysis = std::make_shared<Analysis>();
    analysis->position.assign(n, no_index);
    if (order.empty()) {
      const EliminationOrder found = elimination_order(A.size, A.column_starts, A.rows, ordering_, context);
      if (context.cancelled()) return cancelled_error("solver eigen");
      for (std::size_t k = 0; k < n; ++k)
        analysis->position[static_cast<std::size_t>(found.unknowns[k])] = static_cast<Index>(k);
    } else {
      if (Status status = check_order(order, A.size, name()); !status.ok()) return status;
      for (std::size_t k = 0; k < n; ++k)
        analysis->position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
    }
    analysis->permute_pattern(A);
    analysis_ = std::move(analysis);
    adopt_analysis();
    return {};
  }

  /// \fails numeric where a pivot is not positive beyond rounding, or not finite: names the unknown.
  Status factorize(const HermitianView<K>& A, Context&) {
    assert(analysis_ && A.rows.size() == analysis_->place.size());
    factorized_ = false;
    K* const values = permuted_.valuePtr();
    for (std::size_t e = 0; e < A.values.size(); ++e) {
      const Index place = analysis_->place[e];
      if (place >= 0)
        values[place] = A.values[e];
      else
        values[-1 - place] = conjugate(A.values[e]);
    }
    ldlt_->factorize(permuted_);
    const auto pivots = ldlt_->vectorD();
    const Real rounding = Real(4) * std::numeric_limits<Real>::epsilon();
    for (Index k = 0; k < A.size; ++k) {
      const Real pivot = std::real(pivots[k]);
      const Real diagonal = std::real(permuted_.valuePtr()[permuted_.outerIndexPtr()[k + 1] - 1]);
      // Written so that NaN fails too; Eigen stops at an exact zero and leaves the later pivots unset.
      if (std::isfinite(pivot) && pivot > rounding * diagonal) continue;
      const auto& position = analysis_->position;
      const auto unknown = std::find(position.begin(), position.end(), k) - position.begin();
      return Error{ErrorCode::numeric,
                   std::isfinite(pivot) ? "the matrix is not positive definite" : "the matrix is not finite",
                   "solver eigen, unknown " + std::to_string(unknown),
                   "every unknown needs a term, or a fixed value in its component"};
    }
    factorized_ = ldlt_->info() == Eigen::Success;
    if (!factorized_)
      return Error{ErrorCode::numeric, "the factorization failed", "solver eigen", "check the matrix for huge values"};
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context&) {
    if (!factorized_)
      return {.status = Error{ErrorCode::numeric, "solve without a successful factorization", "solver eigen", {}}};
    assert(b.size() == analysis_->position.size() && x.size() == b.size());
    const auto n = static_cast<Eigen::Index>(b.size());
    Vector right(n);
    for (std::size_t i = 0; i < b.size(); ++i) right[analysis_->position[i]] = b[i];
    Vector left = ldlt_->solve(right);
    const Vector product = permuted_.template selfadjointView<Eigen::Upper>() * left;
    const Real scale = right.norm(), difference = (product - right).norm();
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = left[analysis_->position[i]];
    SolveInfo info;
    info.residual = static_cast<double>(scale > 0 ? difference / scale : difference);
    if (!std::isfinite(info.residual))
      info.status =
          Error{ErrorCode::numeric, "the solution is not finite", "solver eigen", "check the right-hand side"};
    return info;
  }

  /// Entries of the factor below its diagonal. \pre analyze succeeded
  [[nodiscard]] std::size_t factor_nonzeros() const {
    return ldlt_ ? static_cast<std::size_t>(ldlt_->factor_nonzeros()) : 0;
  }

 private:
  using Real = real_of<K>;
  using Vector = Eigen::Matrix<K, Eigen::Dynamic, 1>;
  using Matrix = Eigen::SparseMatrix<K, Eigen::ColMajor, Index>;

  // Upper storage in natural order is what Eigen factors without another copy.
  struct Ldlt : Eigen::SimplicialLDLT<Matrix, Eigen::Upper, Eigen::NaturalOrdering<Index>> {
    [[nodiscard]] Eigen::Index factor_nonzeros() const { return this->m_matrix.nonZeros(); }
  };

  struct Analysis {
    std::vector<Index> position;  // of each unknown in the order of elimination
    std::vector<Index> starts, rows;
    std::vector<Index> place;  // of each entry of the given lower triangle; −1 − place where it is conjugated

    void permute_pattern(const HermitianView<K>& A) {
      const auto n = static_cast<std::size_t>(A.size);
      starts.assign(n + 1, 0);
      const auto for_each_entry = [&](auto&& body) {
        for (std::size_t j = 0; j < n; ++j)
          for (auto e = static_cast<std::size_t>(A.column_starts[j]);
               e < static_cast<std::size_t>(A.column_starts[j + 1]); ++e)
            body(e, position[static_cast<std::size_t>(A.rows[e])], position[j]);
      };
      for_each_entry([&](std::size_t, Index p, Index q) { ++starts[static_cast<std::size_t>(std::max(p, q)) + 1]; });
      for (std::size_t j = 0; j < n; ++j) starts[j + 1] += starts[j];
      struct Entry {
        Index row, place;
        std::size_t source;
      };
      std::vector<Entry> entries(A.rows.size());
      std::vector<Index> next(starts.begin(), starts.end());
      for_each_entry([&](std::size_t e, Index p, Index q) {
        const Index slot = next[static_cast<std::size_t>(std::max(p, q))]++;
        entries[static_cast<std::size_t>(slot)] = {std::min(p, q), p > q ? Index{-1} : Index{0}, e};
      });
      rows.resize(entries.size());
      place.resize(entries.size());
      for (std::size_t j = 0; j < n; ++j) {
        std::sort(entries.begin() + starts[j], entries.begin() + starts[j + 1],
                  [](const Entry& a, const Entry& b) { return a.row < b.row; });
        for (Index slot = starts[j]; slot < starts[j + 1]; ++slot) {
          const Entry& entry = entries[static_cast<std::size_t>(slot)];
          rows[static_cast<std::size_t>(slot)] = entry.row;
          place[entry.source] = entry.place < 0 ? -1 - slot : slot;
        }
      }
    }
  };

  // Eigen's symbolic step on the shared, permuted pattern.
  void adopt_analysis() {
    factorized_ = false;
    ldlt_.reset();
    if (!analysis_) return;
    const auto n = static_cast<Eigen::Index>(analysis_->position.size());
    permuted_.resize(n, n);
    permuted_.resizeNonZeros(static_cast<Eigen::Index>(analysis_->rows.size()));
    std::copy(analysis_->starts.begin(), analysis_->starts.end(), permuted_.outerIndexPtr());
    std::copy(analysis_->rows.begin(), analysis_->rows.end(), permuted_.innerIndexPtr());
    std::fill_n(permuted_.valuePtr(), analysis_->rows.size(), K{});
    ldlt_ = std::make_unique<Ldlt>();
    ldlt_->analyzePattern(permuted_);
  }

  Ordering ordering_;
  std::shared_ptr<const Analysis> analysis_;
  Matrix permuted_;
  std::unique_ptr<Ldlt> ldlt_;
  bool factorized_ = false;
};

}  // namespace quadrig
