// Sparse matrices by rows, and the aggregation that makes a coarser one: what multigrid is made of.
#pragma once

#include <cmath>

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

// sum −= a b, without care for infinities.
template <class K>
void subtract_product(K& sum, const K& a, const K& b) {
  if constexpr (std::is_same_v<K, real_of<K>>)
    sum -= a * b;
  else
    sum = K(sum.real() - (a.real() * b.real() - a.imag() * b.imag()),
            sum.imag() - (a.real() * b.imag() + a.imag() * b.real()));
}

template <class K>
struct SparseRows {
  Index columns_count = 0;
  std::vector<std::size_t> starts{0};
  std::vector<Index> columns;
  std::vector<K> values;

  [[nodiscard]] Index size() const { return static_cast<Index>(starts.size() - 1); }

  void multiply(std::span<const K> x, std::span<K> y, const Context& context) const {
    context.parallel_for(at(size()), 16384, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        K sum{};
        for (std::size_t e = starts[i]; e < starts[i + 1]; ++e) subtract_product(sum, values[e], x[at(columns[e])]);
        y[i] = -sum;
      }
    });
  }
  [[nodiscard]] std::vector<real_of<K>> diagonal() const {
    std::vector<real_of<K>> result(at(size()), 0);
    for (std::size_t i = 0; i < result.size(); ++i)
      for (std::size_t e = starts[i]; e < starts[i + 1]; ++e)
        if (columns[e] == static_cast<Index>(i)) result[i] = std::real(values[e]);
    return result;
  }
};

/// Both triangles, columns ascending.
template <class K>
[[nodiscard]] SparseRows<K> full_rows(const HermitianView<K>& A) {
  SparseRows<K> full;
  const std::size_t n = at(A.size);
  full.columns_count = A.size;
  full.starts.assign(n + 1, 0);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t e = at(A.column_starts[j]); e < at(A.column_starts[j + 1]); ++e) {
      ++full.starts[at(A.rows[e]) + 1];
      if (A.rows[e] != static_cast<Index>(j)) ++full.starts[j + 1];
    }
  for (std::size_t j = 0; j < n; ++j) full.starts[j + 1] += full.starts[j];
  full.columns.resize(full.starts[n]);
  full.values.resize(full.starts[n]);
  std::vector<std::size_t> next(full.starts.begin(), full.starts.end() - 1);
  // Row i meets its columns before i as they come, then its own column, which holds the rows after it.
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t e = at(A.column_starts[j]); e < at(A.column_starts[j + 1]); ++e) {
      const std::size_t i = at(A.rows[e]);
      full.columns[next[i]] = static_cast<Index>(j);
      full.values[next[i]++] = A.values[e];
      if (i == j) continue;
      full.columns[next[j]] = A.rows[e];
      full.values[next[j]++] = conjugate(A.values[e]);
    }
  return full;
}

/// The lower triangle by columns, of a matrix that is Hermitian up to rounding.
template <class K>
[[nodiscard]] HermitianMatrix<K> lower_columns(const SparseRows<K>& A) {
  HermitianMatrix<K> lower;
  lower.size = A.size();
  std::vector<std::size_t> column;
  for (Index j = 0; j < A.size(); ++j) {  // row j of the upper triangle, conjugated
    column.clear();
    K diagonal{};
    for (std::size_t e = A.starts[at(j)]; e < A.starts[at(j) + 1]; ++e) {
      if (A.columns[e] == j) diagonal = K(std::real(A.values[e]));
      if (A.columns[e] > j) column.push_back(e);
    }
    std::sort(column.begin(), column.end(), [&](std::size_t a, std::size_t b) { return A.columns[a] < A.columns[b]; });
    lower.rows.push_back(j);
    lower.values.push_back(diagonal);
    for (const std::size_t e : column) {
      lower.rows.push_back(A.columns[e]);
      lower.values.push_back(conjugate(A.values[e]));
    }
    lower.column_starts.push_back(static_cast<Index>(lower.rows.size()));
  }
  return lower;
}

template <class K>
[[nodiscard]] SparseRows<K> adjoint(const SparseRows<K>& A) {
  SparseRows<K> result;
  result.columns_count = A.size();
  result.starts.assign(at(A.columns_count) + 1, 0);
  for (const Index j : A.columns) ++result.starts[at(j) + 1];
  for (std::size_t j = 0; j < at(A.columns_count); ++j) result.starts[j + 1] += result.starts[j];
  result.columns.resize(A.columns.size());
  result.values.resize(A.columns.size());
  std::vector<std::size_t> next(result.starts.begin(), result.starts.end() - 1);
  for (Index i = 0; i < A.size(); ++i)
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e) {
      const std::size_t place = next[at(A.columns[e])]++;
      result.columns[place] = i;
      result.values[place] = conjugate(A.values[e]);
    }
  return result;
}

/// F B, where F has the pattern of A and the entries factor(row, entry).
template <class K, class Factor>
[[nodiscard]] SparseRows<K> product(const SparseRows<K>& A, const SparseRows<K>& B, Factor&& factor_of) {
  SparseRows<K> result;
  result.columns_count = B.columns_count;
  result.starts.reserve(A.starts.size());
  std::size_t bound = 0;  // what is not written costs no memory
  for (const Index k : A.columns) bound += B.starts[at(k) + 1] - B.starts[at(k)];
  result.columns.reserve(bound);
  result.values.reserve(bound);
  constexpr std::size_t absent = static_cast<std::size_t>(-1);
  std::vector<std::size_t> place(at(B.columns_count), absent);
  for (Index i = 0; i < A.size(); ++i) {
    const std::size_t begin = result.columns.size();
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e) {
      const std::size_t k = at(A.columns[e]);
      const K factor = -factor_of(at(i), e);
      if (factor == K{}) continue;
      for (std::size_t f = B.starts[k]; f < B.starts[k + 1]; ++f) {
        std::size_t& where = place[at(B.columns[f])];
        if (where == absent || where < begin) {
          where = result.columns.size();
          result.columns.push_back(B.columns[f]);
          result.values.push_back(K{});
        }
        subtract_product(result.values[where], factor, B.values[f]);
      }
    }
    result.starts.push_back(result.columns.size());
  }
  return result;
}

template <class K>
[[nodiscard]] SparseRows<K> product(const SparseRows<K>& A, const SparseRows<K>& B) {
  return product(A, B, [&](std::size_t, std::size_t e) { return A.values[e]; });
}

/// Unknowns whose rows are far longer than the others', longest first, at most so many: what is left when they are
/// taken out has no row of more than three times the mean.
template <class K>
[[nodiscard]] std::vector<Index> long_rows(const SparseRows<K>& A, std::size_t at_most) {
  const std::size_t mean = A.columns.size() / std::max<std::size_t>(1, at(A.size()));
  const std::size_t limit = std::max<std::size_t>(20, 3 * mean);
  std::vector<std::size_t> length(at(A.size()));
  std::vector<std::pair<std::size_t, Index>> heap;
  for (std::size_t i = 0; i < length.size(); ++i) {
    length[i] = A.starts[i + 1] - A.starts[i];
    if (length[i] > limit) heap.emplace_back(length[i], static_cast<Index>(i));
  }
  std::make_heap(heap.begin(), heap.end());
  std::vector<Index> result;
  while (!heap.empty() && result.size() < at_most) {
    std::pop_heap(heap.begin(), heap.end());
    auto& [known, i] = heap.back();
    if (known != length[at(i)]) {  // longer rows went in the meantime
      known = length[at(i)];
      if (known > limit)
        std::push_heap(heap.begin(), heap.end());
      else
        heap.pop_back();
      continue;
    }
    result.push_back(i);
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e) --length[at(A.columns[e])];
    heap.pop_back();
  }
  return result;
}

/// Marks the entries that no group may grow along where some unknowns are `kept` apart: those of kept ones, and those
/// between two unknowns that the kept ones do not pull alike, once the one's value is carried to the other. A jump by
/// the kept ones' values can lie there, which no value of a group distinguishes from none.
template <class K>
[[nodiscard]] std::vector<char> across_jumps(const SparseRows<K>& A, std::span<const char> kept,
                                             std::span<const real_of<K>> diagonal) {
  using Real = real_of<K>;
  constexpr Real alike = Real(0.99);  // cosine between the pulls
  const std::size_t n = at(A.size());
  std::vector<char> across(A.columns.size(), 0);
  const auto for_each_pull = [&](std::size_t i, auto&& body) {
    for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e)
      if (const std::size_t d = at(A.columns[e]); kept[d]) body(d, A.values[e]);
  };
  std::vector<Real> length(n, 0);  // of each unknown's pulls
  for (std::size_t i = 0; i < n; ++i) {
    if (!kept[i]) for_each_pull(i, [&](std::size_t d, const K& a) { length[i] += std::norm(a) / diagonal[d]; });
    length[i] = std::sqrt(length[i]);
  }
  std::vector<K> pull(n);  // of the kept ones on i
  for (std::size_t i = 0; i < n; ++i) {
    if (!kept[i] && length[i] == 0) continue;
    for_each_pull(i, [&](std::size_t d, const K& a) { pull[d] = conjugate(a) / diagonal[d]; });
    for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e) {
      const std::size_t j = at(A.columns[e]);
      if (kept[i] || kept[j]) across[e] = 1;
      if (across[e] || j == i || length[j] == 0) continue;
      K sum{};
      for_each_pull(j, [&](std::size_t d, const K& a) { sum += pull[d] * a; });
      const Real along =
          -std::real(A.values[e] * sum) / std::abs(A.values[e]);  // the neighbour's value is carried by −a
      across[e] = !(along > alike * length[i] * length[j]);
    }
    for_each_pull(i, [&](std::size_t d, const K&) { pull[d] = K{}; });
  }
  return across;
}

/// Groups of unknowns that are strongly joined, one column each; an unknown's entry is the phase that carries the
/// group's value to it along its strong entries. Unknowns that their own diagonal settles belong to none. Those that
/// are `kept` apart are the last groups, each alone; the marks are empty where there are none.
template <class K>
[[nodiscard]] SparseRows<K> aggregate(const SparseRows<K>& A, std::span<const char> kept, int depth) {
  using Real = real_of<K>;
  const Index n = A.size();
  const std::vector<Real> diagonal = A.diagonal();
  const Real threshold = static_cast<Real>(std::ldexp(0.08, -depth));
  // Beside the strongest of either unknown: so that groups grow where errors stay smooth, at any number of neighbours.
  constexpr Real share = Real(0.5);
  const std::vector<char> across = kept.empty() ? std::vector<char>() : across_jumps<K>(A, kept, diagonal);
  const auto may_join = [&](Index i, std::size_t e) { return A.columns[e] != i && (across.empty() || !across[e]); };
  std::vector<Real> largest(at(n), 0);
  for (Index i = 0; i < n; ++i)
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e)
      if (may_join(i, e)) largest[at(i)] = std::max(largest[at(i)], std::norm(A.values[e]));
  const auto strong = [&](Index i, std::size_t e) {
    const Index j = A.columns[e];
    const Real square = std::norm(A.values[e]);
    return may_join(i, e) && square > threshold * threshold * diagonal[at(i)] * diagonal[at(j)] &&
           square >= share * share * std::min(largest[at(i)], largest[at(j)]);
  };
  std::vector<Index> group(at(n), no_index);
  std::vector<K> phase(at(n), K(1));
  Index count = 0;
  const auto join = [&](Index i, Index neighbor, const K& entry) {  // entry (i, neighbor)
    group[at(i)] = group[at(neighbor)];
    phase[at(i)] = -entry / std::abs(entry) * phase[at(neighbor)];
  };
  // Whole neighbourhoods first.
  for (Index i = 0; i < n; ++i) {
    if (group[at(i)] != no_index) continue;
    bool free = true, any = false;
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1] && free; ++e)
      if (strong(i, e)) {
        any = true;
        free = group[at(A.columns[e])] == no_index;
      }
    if (!free || !any) continue;
    group[at(i)] = count++;
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e)
      if (strong(i, e)) join(A.columns[e], i, conjugate(A.values[e]));
  }
  // What is left joins the strongest neighbour of the first pass, or else makes groups of its own.
  const std::vector<Index> first = group;
  for (Index i = 0; i < n; ++i) {
    if (first[at(i)] != no_index) continue;
    std::size_t best = A.columns.size();
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e)
      if (strong(i, e) && first[at(A.columns[e])] != no_index &&
          (best == A.columns.size() || std::norm(A.values[e]) > std::norm(A.values[best])))
        best = e;
    if (best != A.columns.size()) join(i, A.columns[best], A.values[best]);
  }
  for (Index i = 0; i < n; ++i) {
    if (group[at(i)] != no_index) continue;
    bool any = false;
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e) any = any || strong(i, e);
    if (!any) continue;
    group[at(i)] = count++;
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e)
      if (strong(i, e) && group[at(A.columns[e])] == no_index) join(A.columns[e], i, conjugate(A.values[e]));
  }
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i]) group[i] = count++;
  SparseRows<K> result;
  result.columns_count = count;
  for (Index i = 0; i < n; ++i) {
    if (group[at(i)] != no_index) {
      result.columns.push_back(group[at(i)]);
      result.values.push_back(phase[at(i)]);
    }
    result.starts.push_back(result.columns.size());
  }
  return result;
}

/// In the numbers L, row i that of order[i], column j at position[j].
template <class L, class K>
[[nodiscard]] SparseRows<L> permuted(const SparseRows<K>& A, std::span<const Index> order,
                                     std::span<const Index> position) {
  SparseRows<L> result;
  result.columns_count = A.columns_count;
  result.starts.reserve(A.starts.size());
  result.columns.reserve(A.columns.size());
  result.values.reserve(A.values.size());
  for (const Index i : order) {
    for (std::size_t e = A.starts[at(i)]; e < A.starts[at(i) + 1]; ++e) {
      result.columns.push_back(position[at(A.columns[e])]);
      result.values.push_back(static_cast<L>(A.values[e]));
    }
    result.starts.push_back(result.columns.size());
  }
  return result;
}

/// The groups, where an unknown of none that the kept ones pull becomes what its own row makes of its neighbours: jumps
/// meet there, and the value is then right on every side. A few sweeps, for such unknowns stand together.
template <class K>
[[nodiscard]] SparseRows<K> joined(const SparseRows<K>& A, std::span<const char> kept, const SparseRows<K>& groups) {
  constexpr int sweeps = 4;
  const std::size_t n = at(A.size());
  std::vector<std::size_t> alone;
  std::vector<Index> place(n, no_index);  // in `alone`
  for (std::size_t i = 0; i < n; ++i) {
    if (groups.starts[i] != groups.starts[i + 1]) continue;
    bool pulled = false;
    for (std::size_t e = A.starts[i]; e < A.starts[i + 1] && !pulled; ++e) pulled = kept[at(A.columns[e])] != 0;
    if (!pulled) continue;
    place[i] = static_cast<Index>(alone.size());
    alone.push_back(i);
  }
  if (alone.empty()) return groups;
  struct Share {
    Index group;
    K value;
  };
  std::vector<std::vector<Share>> made(alone.size());
  constexpr std::size_t absent = static_cast<std::size_t>(-1);
  std::vector<std::size_t> where(at(groups.columns_count), absent);
  std::vector<Share> sum;
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (std::size_t k = 0; k < alone.size(); ++k) {
      const std::size_t i = alone[k];
      K diagonal{};
      const auto subtract = [&](const K& a, Index group, const K& value) {
        std::size_t& place_of = where[at(group)];
        if (place_of == absent) {
          place_of = sum.size();
          sum.push_back({group, K{}});
        }
        subtract_product(sum[place_of].value, a, value);
      };
      for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e) {
        const std::size_t j = at(A.columns[e]);
        if (j == i)
          diagonal = A.values[e];
        else if (place[j] != no_index)
          for (const Share& share : made[at(place[j])]) subtract(A.values[e], share.group, share.value);
        else
          for (std::size_t f = groups.starts[j]; f < groups.starts[j + 1]; ++f)
            subtract(A.values[e], groups.columns[f], groups.values[f]);
      }
      for (Share& share : sum) {
        where[at(share.group)] = absent;
        share.value /= std::real(diagonal);
      }
      made[k] = sum;
      sum.clear();
    }
  SparseRows<K> result;
  result.columns_count = groups.columns_count;
  for (std::size_t i = 0; i < n; ++i) {
    const auto add = [&](Index group, const K& value) {
      result.columns.push_back(group);
      result.values.push_back(value);
    };
    if (place[i] != no_index)
      for (const Share& share : made[at(place[i])]) add(share.group, share.value);
    else
      for (std::size_t f = groups.starts[i]; f < groups.starts[i + 1]; ++f) add(groups.columns[f], groups.values[f]);
    result.starts.push_back(result.columns.size());
  }
  return result;
}

/// (I − ω D⁻¹ A) T with ω = 4/3 over a bound of the spectrum of D⁻¹ A; the rows of unknowns kept apart are those of T.
template <class K>
[[nodiscard]] SparseRows<K> smoothed(const SparseRows<K>& A, std::span<const char> kept,
                                     const SparseRows<K>& tentative) {
  using Real = real_of<K>;
  const std::vector<Real> diagonal = A.diagonal();
  const bool apart = !kept.empty();
  Real bound = 0;
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    if (apart && kept[i]) continue;
    Real sum = 0;
    for (std::size_t e = A.starts[i]; e < A.starts[i + 1]; ++e)
      if (!apart || !kept[at(A.columns[e])]) sum += std::abs(A.values[e]);
    bound = std::max(bound, sum / diagonal[i]);
  }
  const Real omega = Real(4) / (3 * bound);
  return product(A, tentative, [&](std::size_t i, std::size_t e) {
    const bool own = A.columns[e] == static_cast<Index>(i);
    if (apart && kept[i]) return own ? K(1) : K{};
    const K step = A.values[e] * (-omega / diagonal[i]);
    return own ? step + Real(1) : step;
  });
}

}  // namespace quadrig::detail
