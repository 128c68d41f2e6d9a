// Our own direct solver: multifrontal LLᴴ over supernodes, under nested dissection.
#pragma once

#include <array>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "quadrig/solver/backend.hpp"
#include "quadrig/solver/front.hpp"
#include "quadrig/solver/ordering.hpp"
#include "quadrig/solver/substitution.hpp"
#include "quadrig/solver/tree_substitution.hpp"

namespace quadrig {

/// Sparse LLᴴ, multifrontal over supernodes, parallel over subtrees of the elimination tree. Every sum has an order of
/// its own, so the bits do not depend on the threads. Copies share the analysis.
/// \cost on a surface's dual graph O(n log n) memory, O(n^1.5) factorization.
/// Source: Duff and Reid 1983; Liu, The multifrontal method, 1992.
template <SparseScalar K>
class SupernodalCholesky {
 public:
  using Real = real_of<K>;

  /// `ordering` is what `analyze` uses where it is given no order. Entries of the factor below `negligible` count as 0:
  /// subnormal numbers take a processor a hundred times as long, and in single precision a factor is full of them.
  /// Solutions of at least `by_tree_from` unknowns are found by subtrees side by side. Errors name the solver
  /// `reported_as`, which outlives this: a backend that uses this one reports them as its own.
  explicit SupernodalCholesky(Ordering ordering = Ordering::automatic, Real negligible = 0,
                              Index by_tree_from = detail::large_system + 1, std::string_view reported_as = name())
      : ordering_(ordering), negligible_(negligible), by_tree_from_(by_tree_from), reported_as_(reported_as) {}

  [[nodiscard]] static constexpr std::string_view name() { return "supernodal"; }

  /// \fails bad_input where `order` is not a permutation of the unknowns; cancelled.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context& context) {
    const auto n = at(A.size);
    factorized_ = false;
    auto analysis = std::make_shared<Analysis>();
    if (order.empty()) {
      EliminationOrder found = quadrig::elimination_order(A.size, A.column_starts, A.rows, ordering_, context);
      if (context.cancelled()) return cancelled_error(where());
      analysis->unknown = std::move(found.unknowns);
      analysis->ordering = found.ordering;
    } else {
      if (Status status = check_order(order, A.size, reported_as_); !status.ok()) return status;
      analysis->unknown.assign(order.begin(), order.end());
      analysis->ordering.reset();
    }
    analysis->symbolic = detail::SymbolicBuilder(A.size, A.column_starts, A.rows, &context).build(analysis->unknown);
    if (context.cancelled()) return cancelled_error(where());
    for (std::size_t i = 0; i < n; ++i) analysis->unknown[at(analysis->symbolic.position[i])] = static_cast<Index>(i);
    analysis->column_starts.assign(A.column_starts.begin(), A.column_starts.end());
    analysis->rows.assign(A.rows.begin(), A.rows.end());
    analysis_ = std::move(analysis);
    return {};
  }

  /// \fails numeric where a pivot is not positive beyond rounding, or not finite: names the unknown; cancelled.
  Status factorize(const HermitianView<K>& A, Context& context) {
    assert(analysis_ && A.rows.size() == analysis_->rows.size());
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
    factorized_ = false;
    values_.assign(A.values.begin(), A.values.end());
    panels_.resize(symbolic.entries() + detail::substitution_slack);
    std::fill(panels_.end() - detail::substitution_slack, panels_.end(), K{});
    Run run(symbolic.supernode_count());
    eliminate_all(run, context);
    if (context.cancelled()) return cancelled_error(where());
    if (run.failure != none) {
      const Index unknown = analysis_->unknown[at(run.failure)];
      return Error{ErrorCode::numeric, run.finite ? "the matrix is not positive definite" : "the matrix is not finite",
                   where() + ", unknown " + std::to_string(unknown),
                   "every unknown needs a term, or a fixed value in its component"};
    }
    factorized_ = true;
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) const {
    if (!factorized_)
      return {.status = Error{ErrorCode::numeric, "solve without a successful factorization", where(), {}}};
    if (context.cancelled()) return {.status = cancelled_error(where())};
    substitute(b, x, &context);
    if (context.cancelled()) return {.status = cancelled_error(where())};
    SolveInfo info;
    info.residual = static_cast<double>(relative_residual<K>(matrix(), x, b));
    if (!std::isfinite(info.residual))
      info.status = Error{ErrorCode::numeric, "the solution is not finite", where(), "check the right-hand side"};
    return info;
  }

  /// Several right-hand sides side by side; see AnySolver.
  SolveInfo solve_all(std::span<const K> b, std::span<K> x, Index count, Context& context) const {
    return detail::solve_each<K>(b, x, count, true, context,
                                 [&](auto right, auto solution, Context& own) { return solve(right, solution, own); });
  }

  /// A solve that measures nothing. x is invalid once the context is cancelled. \pre factorize succeeded
  void substitute(std::span<const K> b, std::span<K> x, const Context* context = nullptr) const {
    assert(factorized_ && b.size() == analysis_->unknown.size() && x.size() == b.size());
    std::vector<K> y(b.size());
    for (std::size_t k = 0; k < y.size(); ++k) y[k] = b[at(analysis_->unknown[k])];
    substitute_ordered(y, context);
    for (std::size_t k = 0; k < y.size(); ++k) x[at(analysis_->unknown[k])] = y[k];
  }
  /// The same in place, the unknowns as they are eliminated. \pre factorize succeeded
  void substitute_ordered(std::span<K> y, const Context* context = nullptr) const {
    assert(factorized_ && y.size() == analysis_->unknown.size());
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
#if defined(__GNUC__)
    if (static_cast<Index>(y.size()) >= by_tree_from_) {
      const Context alone = Context().quiet(1);
      const Context& own = context ? *context : alone;
      return detail::substitute_by_tree<K>(symbolic, subtrees(own.thread_count()), panels_.data(), y.data(), own);
    }
#endif
    detail::substitute(symbolic, panels_.data(), y.data(), context);
  }

  /// The matrix of the last factorize. \pre analyze succeeded
  [[nodiscard]] HermitianView<K> matrix() const {
    return {static_cast<Index>(analysis_->unknown.size()), analysis_->column_starts, analysis_->rows, values_};
  }
  /// Entries stored for the factor, zeros of merged supernodes among them. \pre analyze succeeded
  [[nodiscard]] std::size_t factor_nonzeros() const { return analysis_ ? analysis_->symbolic.entries() : 0; }
  /// The unknowns as they are eliminated; empty before analyze.
  [[nodiscard]] std::span<const Index> elimination_order() const {
    return analysis_ ? std::span<const Index>(analysis_->unknown) : std::span<const Index>();
  }
  /// "supernodal, nested dissection", or as the unknowns were ordered by the last analyze.
  [[nodiscard]] std::string description() const {
    if (!analysis_) return std::string(name());
    return std::string(name()) + ", " +
           std::string(analysis_->ordering ? ordering_name(*analysis_->ordering) : "given order");
  }

 private:
  [[nodiscard]] std::string where() const { return "solver " + std::string(reported_as_); }

  static constexpr Index none = std::numeric_limits<Index>::max();
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }

  struct Analysis {
    std::vector<Index> unknown;  // k-th to be eliminated
    std::optional<Ordering> ordering;
    std::vector<Index> column_starts, rows;
    detail::SymbolicFactor symbolic;
  };

  // What one factorization shares between its threads.
  struct Run {
    explicit Run(Index supernodes) : square(at(supernodes), nullptr), kept(at(supernodes)) {}
    std::vector<K*> square;                  // of each supernode, until its parent has added it
    std::vector<std::unique_ptr<K[]>> kept;  // squares that outlive a stack
    std::mutex mutex;
    Index failure = none;  // the first column that failed
    bool finite = true;

    void fail(Index column, Real pivot) {
      const std::scoped_lock lock(mutex);
      if (column >= failure) return;
      failure = column;
      finite = std::isfinite(pivot);
    }
  };

  void keep_square(Run& run, Index s) const {
    const std::size_t below = at(analysis_->symbolic.below(s));
    run.kept[at(s)] = std::make_unique_for_overwrite<K[]>(below * below);
    run.square[at(s)] = run.kept[at(s)].get();
  }

  // Disjoint subtrees, largest first, that leave enough to share; the whole forest where there is one thread.
  [[nodiscard]] std::vector<Index> subtrees(unsigned threads) const {
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
    const auto lighter = [&](Index a, Index b) {
      return symbolic.work[at(a)] != symbolic.work[at(b)] ? symbolic.work[at(a)] < symbolic.work[at(b)] : a < b;
    };
    std::vector<Index> heap;
    double total = 0;
    for (Index s = 0; s < symbolic.supernode_count(); ++s)
      if (symbolic.parent[at(s)] == no_index) {
        heap.push_back(s);
        total += symbolic.work[at(s)];
      }
    if (threads > 1) {
      const double share = std::max(total / (8.0 * threads), 2e5);
      std::make_heap(heap.begin(), heap.end(), lighter);
      while (!heap.empty() && symbolic.work[at(heap.front())] > share) {
        std::pop_heap(heap.begin(), heap.end(), lighter);
        const Index s = heap.back();
        heap.pop_back();
        for (Index c = symbolic.child[at(s)]; c != no_index; c = symbolic.sibling[at(c)]) {
          heap.push_back(c);
          std::push_heap(heap.begin(), heap.end(), lighter);
        }
      }
    }
    std::sort(heap.begin(), heap.end(), [&](Index a, Index b) { return lighter(b, a); });
    return heap;
  }

  // Subtrees side by side, and each supernode above them when its children are done; above one that fails, none.
  void eliminate_all(Run& run, const Context& context) {
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
    const unsigned threads = context.thread_count();
    std::vector<Index> ready = subtrees(threads), pending(at(symbolic.supernode_count()), 0);
    std::reverse(ready.begin(), ready.end());  // the last is taken first
    std::vector<char> is_subtree(pending.size(), 0);
    for (const Index root : ready) is_subtree[at(root)] = 1;
    for (std::size_t s = 0; s < pending.size(); ++s)
      if (symbolic.parent[s] != no_index) ++pending[at(symbolic.parent[s])];
    unsigned running = 0;
    std::mutex mutex;
    std::condition_variable changed;
    const auto work = [&](std::size_t, std::size_t) {
      std::array<std::vector<K>, 2> stacks;
      std::unique_lock lock(mutex);
      while (true) {
        changed.wait(lock, [&] { return !ready.empty() || running == 0; });
        if (ready.empty()) return;
        const Index s = ready.back();
        ready.pop_back();
        const bool alone = ready.empty() && running == 0;
        ++running;
        lock.unlock();
        bool done = false;
        try {
          keep_square(run, s);
          done = is_subtree[at(s)] ? eliminate_subtree(run, s, stacks, context)
                                   : eliminate(run, s, alone ? &context : nullptr, context);
        } catch (...) {  // no memory: the others are not to wait for this one
          lock.lock();
          --running;
          ready.clear();
          changed.notify_all();
          throw;
        }
        if (!is_subtree[at(s)])
          for (Index c = symbolic.child[at(s)]; c != no_index; c = symbolic.sibling[at(c)]) run.kept[at(c)].reset();
        lock.lock();
        --running;
        const Index parent = symbolic.parent[at(s)];
        if (done && parent != no_index && --pending[at(parent)] == 0) ready.push_back(parent);
        changed.notify_all();
      }
    };
    context.parallel_for(std::min<std::size_t>(threads, ready.size()), 1, work);
  }

  // Squares of even and odd depths lie on stacks of their own, so that a square is placed before its children's go.
  bool eliminate_subtree(Run& run, Index root, std::array<std::vector<K>, 2>& stacks, const Context& context) {
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
    const Index first = symbolic.first_in_tree[at(root)];
    std::vector<char> odd(at(root - first) + 1, 0);
    for (Index s = root; s-- > first;) odd[at(s - first)] = odd[at(symbolic.parent[at(s)] - first)] == 0;
    const auto square_size = [&](Index s) { return at(symbolic.below(s)) * at(symbolic.below(s)); };
    std::array<std::size_t, 2> top{}, peak{};
    const auto walk = [&](auto&& visit) {  // false where a visit says so
      top = {};
      for (Index s = first; s <= root; ++s) {
        const auto parity = static_cast<std::size_t>(odd[at(s - first)]);
        const std::size_t begin = top[parity];
        if (s != root) top[parity] += square_size(s);
        peak[parity] = std::max(peak[parity], top[parity]);
        if (!visit(s, parity, begin)) return false;
        for (Index c = symbolic.child[at(s)]; c != no_index; c = symbolic.sibling[at(c)])
          top[1 - parity] -= square_size(c);
      }
      return true;
    };
    walk([](Index, std::size_t, std::size_t) { return true; });
    for (std::size_t k = 0; k < 2; ++k) {
      stacks[k].reserve(peak[k]);
      while (stacks[k].size() < peak[k]) {
        if (context.cancelled()) return false;
        stacks[k].resize(std::min(peak[k], stacks[k].size() + (std::size_t{1} << 20)));
      }
    }
    return walk([&](Index s, std::size_t parity, std::size_t begin) {
      if (s != root) run.square[at(s)] = stacks[parity].data() + begin;
      return !context.cancelled() && eliminate(run, s, nullptr, context);
    });
  }

  // One front: the given entries, then what its children leave, is added in their order, its columns are factored, and
  // the rest is left. `context` is that of the threads it may use, `asked` is polled. False when it failed or was
  // cancelled.
  bool eliminate(Run& run, Index s, const Context* context, const Context& asked) {
    const detail::SymbolicFactor& symbolic = analysis_->symbolic;
    const Index width = symbolic.width(s), below = symbolic.below(s), height = width + below;
    K* const panel = panels_.data() + symbolic.panel[at(s)];
    K* const square = run.square[at(s)];
    std::fill_n(panel, at(width) * at(height), K{});
    for (std::size_t e = symbolic.entries_start[at(s)]; e < symbolic.entries_start[at(s) + 1]; ++e) {
      const Index given = symbolic.given[e];
      panel[symbolic.inside[e]] = given >= 0 ? values_[at(given)] : conjugate(values_[at(-1 - given)]);
    }
    for (Index j = 0; j < below; ++j) std::fill_n(square + static_cast<std::ptrdiff_t>(j) * below + j, below - j, K{});
    for (Index c = symbolic.child[at(s)]; c != no_index; c = symbolic.sibling[at(c)]) {
      const Index size = symbolic.below(c);
      const Index* const row = symbolic.relative.data() + symbolic.rows_start[at(c)];
      const K* from = run.square[at(c)];
      for (Index j = 0; j < size; ++j, from += size) {
        K* const to = row[j] < width ? panel + static_cast<std::ptrdiff_t>(row[j]) * height
                                     : square + static_cast<std::ptrdiff_t>(row[j] - width) * below - width;
        for (Index i = j; i < size; ++i) to[row[i]] += from[i];
      }
    }
    const Real rounding = Real(4) * std::numeric_limits<Real>::epsilon();
    const Index first = symbolic.first[at(s)];
    const auto accept = [&](Index j, Real pivot) {
      if (j > 0 && j % 8 == 0 && asked.cancelled()) return false;
      const auto unknown = at(analysis_->unknown[at(first + j)]);
      const Real diagonal = std::real(values_[at(analysis_->column_starts[unknown])]);
      if (std::isfinite(pivot) && pivot > 0 && pivot > rounding * diagonal) return true;  // false for NaN too
      run.fail(first + j, pivot);
      return false;
    };
    if (detail::Front<K>::factorize(panel, width, height, negligible_, accept, context) != no_index) return false;
    // Some blocks of columns at a time, to ask between them.
    const double block_work = static_cast<double>(detail::Front<K>::thread_block) * width * below;
    const double blocks = std::max(1.0, std::floor(3e7 / block_work)) * (context ? context->thread_count() : 1);
    const Index step = detail::Front<K>::thread_block * static_cast<Index>(std::min(blocks, 1e6));
    for (Index c = 0; c < below; c += step) {
      if (c > 0 && asked.cancelled()) return false;
      detail::Front<K>::subtract_product(panel + width + c, width, height,
                                         square + static_cast<std::ptrdiff_t>(c) * below + c, below, below - c,
                                         std::min(step, below - c), context);
    }
    return true;
  }

  Ordering ordering_;
  Real negligible_;
  Index by_tree_from_;
  std::string_view reported_as_;
  std::shared_ptr<const Analysis> analysis_;
  std::vector<K> values_;  // of the last factorization, for residuals
  std::vector<K, detail::Untouched<K>> panels_;
  bool factorized_ = false;
};

}  // namespace quadrig
