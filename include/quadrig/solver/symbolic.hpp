// What a sparse Cholesky factorization can know from the pattern: elimination tree, counts, supernodes, places.
#pragma once

#include <numeric>

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

/// The symbolic factorization of a pattern under an order of elimination, by supernodes: runs of columns that share
/// the rows below them. Supernodes are numbered children first; column k below means the k-th to be eliminated.
struct SymbolicFactor {
  std::vector<Index> position;        ///< of each unknown in the order of elimination
  std::vector<Index> first;           ///< column of each supernode, and the number of columns at the end
  std::vector<Index> parent;          ///< supernode, or no_index
  std::vector<Index> child, sibling;  ///< first child of each supernode, and the next of the same parent
  std::vector<Index> rows;            ///< columns below each supernode, ascending
  std::vector<std::size_t> rows_start;
  std::vector<Index> relative;             ///< of each entry of `rows`, its row in the parent's front
  std::vector<std::size_t> panel;          ///< where each supernode's panel begins; the size of the factor at the end
  std::vector<std::size_t> entries_start;  ///< of each supernode in the two lists that follow
  std::vector<Index> given;          ///< the given entries of its panel; −1 − entry where it is to be conjugated
  std::vector<std::size_t> inside;   ///< where each of them lies in the panel
  std::vector<double> work;          ///< multiplications in the subtree of each supernode
  std::vector<Index> first_in_tree;  ///< first supernode of each one's subtree

  [[nodiscard]] Index supernode_count() const { return static_cast<Index>(parent.size()); }
  [[nodiscard]] Index width(Index s) const { return first[at(s) + 1] - first[at(s)]; }
  [[nodiscard]] Index below(Index s) const { return static_cast<Index>(rows_start[at(s) + 1] - rows_start[at(s)]); }
  [[nodiscard]] std::size_t entries() const { return panel.back(); }
};

/// \pre `order` is a permutation. \cost O(nonzeros + rows of the supernodes), almost. \fails never
/// Source: Liu 1990 (elimination tree), Gilbert, Ng and Peyton 1994 (counts), Ashcraft and Grimes 1989 (relaxation).
class SymbolicBuilder {
 public:
  /// `context`, where there is one, is polled between columns.
  SymbolicBuilder(Index size, std::span<const Index> column_starts, std::span<const Index> rows,
                  const Context* context = nullptr)
      : n_(size), column_starts_(column_starts), rows_(rows), context_(context) {}

  /// Of a factorization under the order: Σ over columns of half the square of the entries below the diagonal.
  [[nodiscard]] double multiplications(std::span<const Index> order) {
    count(order);
    double total = 0;
    for (const Index entries : counts_) total += static_cast<double>(entries) * (entries - 1) / 2;
    return total;
  }

  /// Of the factor under the last order, the diagonal too.
  [[nodiscard]] double entries() const { return std::accumulate(counts_.begin(), counts_.end(), 0.0); }

  /// Invalid once the context is cancelled.
  [[nodiscard]] SymbolicFactor build(std::span<const Index> order) {
    SymbolicFactor factor;
    count(order);
    if (cancelled()) return factor;
    merge();
    if (cancelled()) return factor;
    factor.position = position_;
    structure(factor);
    if (cancelled()) return factor;
    locate(factor);
    return factor;
  }

 private:
  [[nodiscard]] bool cancelled() const { return context_ && context_->cancelled(); }
  template <class Body>
  void for_each_entry(Body&& body) const {
    for (std::size_t j = 0; j < at(n_); ++j) {
      if (j % 65536 == 0 && cancelled()) return;
      for (auto e = at(column_starts_[j]); e < at(column_starts_[j + 1]); ++e) body(e, at(rows_[e]), j);
    }
  }

  // For each column the positions of its entries before it (upper) by elimination.
  void gather() {
    starts_.assign(at(n_) + 1, 0);
    for_each_entry([&](std::size_t, std::size_t i, std::size_t j) {
      if (i != j) ++starts_[at(std::max(position_[i], position_[j])) + 1];
    });
    for (std::size_t k = 0; k < at(n_); ++k) starts_[k + 1] += starts_[k];
    before_.resize(at(starts_.back()));
    std::vector<Index> next(starts_.begin(), starts_.end());
    for_each_entry([&](std::size_t, std::size_t i, std::size_t j) {
      if (i == j) return;
      const auto [low, high] = std::minmax(position_[i], position_[j]);
      before_[at(next[at(high)]++)] = low;
    });
  }

  void eliminate() {
    parent_.assign(at(n_), no_index);
    std::vector<Index> ancestor(at(n_), no_index);
    for (Index k = 0; k < n_; ++k)
      for (Index e = starts_[at(k)]; e < starts_[at(k) + 1]; ++e)
        for (Index i = before_[at(e)]; i != no_index && i < k;) {
          const Index next = std::exchange(ancestor[at(i)], k);
          if (next == no_index) parent_[at(i)] = k;
          i = next;
        }
  }

  // Children before parents, subtrees in one run; sequence[k] is the k-th node.
  static std::vector<Index> postorder(const std::vector<Index>& parent) {
    const auto n = static_cast<Index>(parent.size());
    std::vector<Index> child(parent.size(), no_index), sibling(parent.size(), no_index), sequence, stack;
    for (Index i = n - 1; i >= 0; --i)
      if (parent[at(i)] != no_index) sibling[at(i)] = std::exchange(child[at(parent[at(i)])], i);
    sequence.reserve(parent.size());
    for (Index root = 0; root < n; ++root) {
      if (parent[at(root)] != no_index) continue;
      stack.push_back(root);
      while (!stack.empty()) {
        const Index i = stack.back();
        if (child[at(i)] != no_index) {
          stack.push_back(child[at(i)]);
          child[at(i)] = sibling[at(stack.back())];
        } else {
          sequence.push_back(i);
          stack.pop_back();
        }
      }
    }
    return sequence;
  }

  void renumber(const std::vector<Index>& sequence) {
    std::vector<Index> fresh(sequence.size());
    for (std::size_t k = 0; k < sequence.size(); ++k) fresh[at(sequence[k])] = static_cast<Index>(k);
    for (Index& each : position_) each = fresh[at(each)];
    std::vector<Index> parent(parent_.size());
    for (std::size_t i = 0; i < parent_.size(); ++i)
      parent[at(fresh[i])] = parent_[i] == no_index ? no_index : fresh[at(parent_[i])];
    parent_ = std::move(parent);
  }

  void count(std::span<const Index> order) {
    position_.assign(at(n_), 0);
    for (std::size_t k = 0; k < order.size(); ++k) position_[at(order[k])] = static_cast<Index>(k);
    gather();
    if (cancelled()) return;
    eliminate();
    if (cancelled()) return;
    renumber(postorder(parent_));
    if (cancelled()) return;
    count_entries();
  }

  // Entries of every column of the factor, the diagonal too.
  void count_entries() {
    // Entries after each column.
    std::vector<Index> starts(at(n_) + 1, 0);
    for_each_entry([&](std::size_t, std::size_t i, std::size_t j) {
      if (i != j) ++starts[at(std::min(position_[i], position_[j])) + 1];
    });
    for (std::size_t k = 0; k < at(n_); ++k) starts[k + 1] += starts[k];
    std::vector<Index> after(at(starts.back())), given(after.size()), next(starts.begin(), starts.end());
    for_each_entry([&](std::size_t e, std::size_t i, std::size_t j) {
      if (i == j) return;
      const Index p = position_[i], q = position_[j];
      const auto place = at(next[at(std::min(p, q))]++);
      after[place] = std::max(p, q);
      given[place] = p > q ? static_cast<Index>(e) : -1 - static_cast<Index>(e);
    });
    if (cancelled()) return;

    std::vector<Index> first(at(n_), no_index), latest(at(n_), no_index), leaf(at(n_), no_index), set(at(n_));
    std::iota(set.begin(), set.end(), Index{0});
    counts_.assign(at(n_), 0);
    for (Index k = 0; k < n_; ++k) {
      if (first[at(k)] == no_index) ++counts_[at(k)];
      for (Index i = k; i != no_index && first[at(i)] == no_index; i = parent_[at(i)]) first[at(i)] = k;
    }
    for (Index j = 0; j < n_; ++j) {
      if (parent_[at(j)] != no_index) --counts_[at(parent_[at(j)])];
      for (Index e = starts[at(j)]; e < starts[at(j) + 1]; ++e) {
        const Index i = after[at(e)];
        if (first[at(j)] <= latest[at(i)]) continue;  // not a leaf of the subtree of row i
        latest[at(i)] = first[at(j)];
        ++counts_[at(j)];
        if (const Index previous = std::exchange(leaf[at(i)], j); previous != no_index) {
          Index root = previous;
          while (set[at(root)] != root) root = set[at(root)];
          for (Index k = previous; k != root;) k = std::exchange(set[at(k)], root);
          --counts_[at(root)];
        }
      }
      if (parent_[at(j)] != no_index) set[at(j)] = parent_[at(j)];
    }
    for (Index j = 0; j < n_; ++j)
      if (parent_[at(j)] != no_index) counts_[at(parent_[at(j)])] += counts_[at(j)];
    after_starts_ = std::move(starts);
    after_ = std::move(after);
    after_given_ = std::move(given);
  }

  // Supernodes of equal structure, then those merged into their parents where that stores few zeros.
  void merge() {
    std::vector<Index> owner(at(n_));  // fundamental supernode of each column
    std::vector<Index> begin;
    for (Index j = 0; j < n_; ++j) {
      const bool joins = j > 0 && parent_[at(j) - 1] == j && counts_[at(j) - 1] == counts_[at(j)] + 1;
      if (!joins) begin.push_back(j);
      owner[at(j)] = static_cast<Index>(begin.size()) - 1;
    }
    const auto count = static_cast<Index>(begin.size());
    begin.push_back(n_);
    std::vector<Index> up(at(count), no_index), width(at(count)), below(at(count)), into(at(count));
    std::vector<Index> child(at(count), no_index), sibling(at(count), no_index);
    std::vector<double> zeros(at(count), 0.0);
    for (Index s = 0; s < count; ++s) {
      const Index last = begin[at(s) + 1] - 1;
      width[at(s)] = begin[at(s) + 1] - begin[at(s)];
      below[at(s)] = counts_[at(last)] - 1;
      if (parent_[at(last)] != no_index) up[at(s)] = owner[at(parent_[at(last)])];
      into[at(s)] = s;
    }
    for (Index s = count - 1; s >= 0; --s)
      if (up[at(s)] != no_index) sibling[at(s)] = std::exchange(child[at(up[at(s)])], s);
    const auto entries = [](double w, double r) { return w * (w + 1) / 2 + w * r; };
    std::vector<Index> queue;
    for (Index p = 0; p < count; ++p) {
      // Children come first in the numbering, so they are settled; the one that costs least joins first.
      queue.clear();
      for (Index c = child[at(p)]; c != no_index; c = sibling[at(c)]) queue.push_back(c);
      while (!queue.empty()) {
        std::size_t best = queue.size();
        double least = 0;
        for (std::size_t k = 0; k < queue.size(); ++k) {
          const Index c = queue[k];
          const double w = width[at(c)] + width[at(p)];
          const double added =
              entries(w, below[at(p)]) - entries(width[at(c)], below[at(c)]) - entries(width[at(p)], below[at(p)]);
          const double share = (added + zeros[at(c)] + zeros[at(p)]) / entries(w, below[at(p)]);
          if (!(added <= 0 || w <= relax_small || (w <= 16 && share < relax_16) || (w <= 48 && share < relax_48) ||
                share < relax_large))
            continue;
          if (best == queue.size() || added < least) {
            best = k;
            least = added;
          }
        }
        if (best == queue.size()) break;
        const Index c = queue[best];
        zeros[at(p)] += zeros[at(c)] + least;
        width[at(p)] += width[at(c)];
        into[at(c)] = p;
        queue.erase(queue.begin() + static_cast<std::ptrdiff_t>(best));
      }
    }
    // The merged tree, children first, and the columns of each supernode in one run.
    std::vector<Index> head(at(count));
    for (Index s = count - 1; s >= 0; --s) head[at(s)] = into[at(s)] == s ? s : head[at(into[at(s)])];
    std::vector<Index> number(at(count), no_index), heads;
    for (Index s = 0; s < count; ++s)
      if (head[at(s)] == s) {
        number[at(s)] = static_cast<Index>(heads.size());
        heads.push_back(s);
      }
    std::vector<Index> tree(heads.size(), no_index);
    for (std::size_t k = 0; k < heads.size(); ++k)
      if (up[at(heads[k])] != no_index) tree[k] = number[at(head[at(up[at(heads[k])])])];
    const std::vector<Index> sequence = postorder(tree);
    std::vector<Index> place(heads.size());
    for (std::size_t k = 0; k < sequence.size(); ++k) place[at(sequence[k])] = static_cast<Index>(k);
    first_.assign(heads.size() + 1, 0);
    super_parent_.assign(heads.size(), no_index);
    rows_count_ = 0;
    for (std::size_t k = 0; k < heads.size(); ++k) {
      rows_count_ += at(below[at(heads[k])]);
      first_[at(place[k]) + 1] = width[at(heads[k])];
      if (tree[k] != no_index) super_parent_[at(place[k])] = place[at(tree[k])];
    }
    for (std::size_t k = 0; k < heads.size(); ++k) first_[k + 1] += first_[k];
    fresh_.resize(at(n_));
    old_.resize(at(n_));
    std::vector<Index> next(first_.begin(), first_.end());
    for (Index j = 0; j < n_; ++j) {
      fresh_[at(j)] = next[at(place[at(number[at(head[at(owner[at(j)])])])])]++;
      old_[at(fresh_[at(j)])] = j;
    }
    for (Index& each : position_) each = fresh_[at(each)];
  }

  // Rows below each supernode: those of its columns and its children's.
  void structure(SymbolicFactor& factor) {
    const std::size_t count = super_parent_.size();
    std::vector<Index> mark(at(n_), no_index);
    std::vector<Index>&child = factor.child, &sibling = factor.sibling;
    child.assign(count, no_index);
    sibling.assign(count, no_index);
    for (std::size_t s = count; s-- > 0;)
      if (super_parent_[s] != no_index) sibling[s] = std::exchange(child[at(super_parent_[s])], static_cast<Index>(s));
    factor.rows_start.assign(1, 0);
    factor.panel.assign(1, 0);
    factor.work.assign(count, 0);
    factor.first_in_tree.resize(count);
    std::vector<Index>& rows = factor.rows;
    rows.reserve(rows_count_);
    for (std::size_t s = 0; s < count; ++s) {
      if (s % 4096 == 0 && cancelled()) return;
      const auto me = static_cast<Index>(s);
      const Index last = first_[s + 1] - 1;
      const std::size_t begin = rows.size();
      const auto add = [&](Index row) {
        if (row <= last || mark[at(row)] == me) return;
        mark[at(row)] = me;
        rows.push_back(row);
      };
      for (Index j = first_[s]; j <= last; ++j)
        for (Index e = after_starts_[at(old_[at(j)])]; e < after_starts_[at(old_[at(j)]) + 1]; ++e)
          add(fresh_[at(after_[at(e)])]);
      factor.first_in_tree[s] = me;
      for (Index c = child[s]; c != no_index; c = sibling[at(c)]) {
        for (std::size_t r = factor.rows_start[at(c)]; r < factor.rows_start[at(c) + 1]; ++r) add(rows[r]);
        factor.first_in_tree[s] = std::min(factor.first_in_tree[s], factor.first_in_tree[at(c)]);
        factor.work[s] += factor.work[at(c)];
      }
      std::sort(rows.begin() + static_cast<std::ptrdiff_t>(begin), rows.end());
      factor.rows_start.push_back(rows.size());
      const auto w = static_cast<double>(first_[s + 1] - first_[s]), r = static_cast<double>(rows.size() - begin);
      factor.work[s] += w * w * w / 3 + w * w * r + w * r * r + 200;
      factor.panel.push_back(factor.panel.back() +
                             at(first_[s + 1] - first_[s]) * (at(first_[s + 1] - first_[s]) + rows.size() - begin));
    }
    factor.first = first_;
    factor.parent = super_parent_;
    if (cancelled()) return;
    factor.relative.resize(rows.size());
    for (std::size_t s = 0; s < count; ++s) {
      if (super_parent_[s] == no_index) continue;
      const auto p = at(super_parent_[s]);
      std::size_t r = factor.rows_start[p];
      for (std::size_t k = factor.rows_start[s]; k < factor.rows_start[s + 1]; ++k) {
        if (rows[k] < first_[p + 1]) {
          factor.relative[k] = rows[k] - first_[p];
          continue;
        }
        while (rows[r] != rows[k]) ++r;
        factor.relative[k] = first_[p + 1] - first_[p] + static_cast<Index>(r - factor.rows_start[p]);
      }
    }
  }

  void locate(SymbolicFactor& factor) const {
    const std::size_t count = super_parent_.size();
    std::vector<Index> unknown(at(n_));  // of each column
    for (Index i = 0; i < n_; ++i) unknown[at(factor.position[at(i)])] = i;
    factor.entries_start.assign(1, 0);
    for (std::size_t s = 0; s < count; ++s) {
      std::size_t entries = at(first_[s + 1] - first_[s]);
      for (Index j = first_[s]; j < first_[s + 1]; ++j)
        entries += at(after_starts_[at(old_[at(j)]) + 1] - after_starts_[at(old_[at(j)])]);
      factor.entries_start.push_back(factor.entries_start.back() + entries);
    }
    factor.given.resize(factor.entries_start.back());
    factor.inside.resize(factor.entries_start.back());
    const auto place = [&](std::size_t s) {
      const auto width = at(first_[s + 1] - first_[s]);
      const auto begin = factor.rows.begin() + static_cast<std::ptrdiff_t>(factor.rows_start[s]);
      const auto end = factor.rows.begin() + static_cast<std::ptrdiff_t>(factor.rows_start[s + 1]);
      const std::size_t height = width + static_cast<std::size_t>(end - begin);
      std::size_t e = factor.entries_start[s];
      for (Index j = first_[s]; j < first_[s + 1]; ++j) {
        const std::size_t column = at(j - first_[s]);
        factor.given[e] = column_starts_[at(unknown[at(j)])];
        factor.inside[e++] = column * height + column;
        for (Index k = after_starts_[at(old_[at(j)])]; k < after_starts_[at(old_[at(j)]) + 1]; ++k) {
          const Index row = fresh_[at(after_[at(k)])];
          const std::size_t inside = row < first_[s + 1]
                                         ? at(row - first_[s])
                                         : width + static_cast<std::size_t>(std::lower_bound(begin, end, row) - begin);
          factor.given[e] = after_given_[at(k)];
          factor.inside[e++] = column * height + inside;
        }
      }
    };
    parallel_for(context_, count, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end && !(s % 4096 == 0 && cancelled()); ++s) place(s);
    });
  }

  // Shares of stored zeros that a merged supernode may have, by its width.
  static constexpr double relax_small = 4, relax_16 = 0.25, relax_48 = 0.1, relax_large = 0.03;

  Index n_;
  std::span<const Index> column_starts_, rows_;
  const Context* context_;
  std::vector<Index> position_, starts_, before_, parent_, counts_, after_starts_, after_, after_given_;
  std::vector<Index> first_, super_parent_;
  std::vector<Index> fresh_, old_;  // what each column is called after merging, and was before
  std::size_t rows_count_ = 0;      // below all supernodes
};

}  // namespace quadrig::detail
