// Quadratic energies as rows of a least-squares system, gathered into one sparse Hermitian matrix. Knows no mesh.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <string_view>

#include "quadrig/sparse.hpp"

namespace quadrig {

/// One summand of an energy: weight · |Σ_k coeff[k] · z[at[k]] − rhs|². The spans are borrowed for one call.
/// The weight may be negative (cotangents), as long as the whole energy is positive definite.
template <class K>
struct Row {
  std::span<const Index> at;
  std::span<const K> coeff;
  K rhs{};
  double weight = 1;
};

template <class K>
using EmitRow = function_ref<void(const Row<K>&)>;

/// First extension point: anything that names itself and emits rows. At every call it emits the same unknowns in the
/// same order; coefficients, right-hand sides and weights may change. `laws.hpp` checks one.
template <class T, class K>
concept EnergyTerm = requires(const T& term, EmitRow<K> emit) {
  { term.name() } -> std::convertible_to<std::string_view>;
  { term.for_each_row(emit) } -> std::same_as<void>;
};

/// A borrowed energy term of any type. \pre the term outlives it
template <class K>
class TermRef {
 public:
  template <class T>
  requires(!std::is_same_v<std::remove_cvref_t<T>, TermRef> && EnergyTerm<T, K>) TermRef(const T& term)
      : term_(&term),
        name_([](const void* t) -> std::string_view { return static_cast<const T*>(t)->name(); }),
        rows_([](const void* t, EmitRow<K> emit) { static_cast<const T*>(t)->for_each_row(emit); }) {}

  [[nodiscard]] std::string_view name() const { return name_(term_); }
  void for_each_row(EmitRow<K> emit) const { rows_(term_, emit); }

 private:
  const void* term_;
  std::string_view (*name_)(const void*);
  void (*rows_)(const void*, EmitRow<K>);
};

/// An owned energy term of any type; copies share it.
template <class K>
class AnyTerm {
 public:
  template <class T>
  requires(!std::is_same_v<std::remove_cvref_t<T>, AnyTerm> && EnergyTerm<std::remove_cvref_t<T>, K>) AnyTerm(T&& term)
      : owner_(std::make_shared<const std::remove_cvref_t<T>>(std::forward<T>(term))),
        ref_(*static_cast<const std::remove_cvref_t<T>*>(owner_.get())) {}

  [[nodiscard]] std::string_view name() const { return ref_.name(); }
  void for_each_row(EmitRow<K> emit) const { ref_.for_each_row(emit); }

 private:
  std::shared_ptr<const void> owner_;
  TermRef<K> ref_;
};

/// A term from a callable that takes EmitRow<K>: `RowTerm term{"poisson", [&](EmitRow<double> emit) { ... }};`
template <class F>
struct RowTerm {
  std::string title;
  F rows;

  [[nodiscard]] std::string_view name() const { return title; }
  template <class K>
  requires std::invocable<const F&, EmitRow<K>>
  void for_each_row(EmitRow<K> emit) const { rows(emit); }
};
template <class F>
RowTerm(const char*, F) -> RowTerm<F>;

/// The energy of one term at z, summed row by row in the order they are emitted.
template <SparseScalar K, EnergyTerm<K> Term>
[[nodiscard]] double energy_of(const Term& term, std::span<const K> z) {
  double total = 0;
  const auto add = [&](const Row<K>& row) {
    K sum = -row.rhs;
    for (std::size_t k = 0; k < row.at.size(); ++k) sum += row.coeff[k] * z[static_cast<std::size_t>(row.at[k])];
    total += row.weight * static_cast<double>(std::norm(sum));
  };
  term.for_each_row(EmitRow<K>(add));
  return total;
}

/// Sum of quadratic terms over n unknowns, some of them held at fixed values: the minimizer over the free ones solves
/// matrix() · x = rhs(), and expand(x) puts the fixed values back.
///
/// The pattern and the place of every product in it are found once; later calls of `assemble` with the same terms
/// only refill values, in O(products), so that a solver needs no new analysis while `pattern_version()` stays.
///
///     QuadraticForm<double> form(n);
///     form.fix(0, 0.0);
///     if (Status s = form.assemble(smoothness, data); !s) return s.error();
///     if (Status s = solver.prepare(form.matrix(), form.pattern_version(), context); !s) return s.error();
///     if (SolveInfo info = solver.solve(form.rhs(), x, context); !info.status) return info.status.error();
///     std::vector<double> z = form.expand(x);
template <SparseScalar K>
class QuadraticForm {
 public:
  using Real = real_of<K>;

  explicit QuadraticForm(Index unknowns)
      : fixed_(static_cast<std::size_t>(unknowns), 0), fixed_values_(static_cast<std::size_t>(unknowns), K{}) {}

  [[nodiscard]] Index unknown_count() const { return static_cast<Index>(fixed_.size()); }
  [[nodiscard]] Index free_count() const { return unknown_count() - fixed_count_; }
  [[nodiscard]] bool is_fixed(Index unknown) const { return fixed_[static_cast<std::size_t>(unknown)] != 0; }

  /// Holds an unknown at a value from the next `assemble` on. A new value for one already held keeps the pattern.
  void fix(Index unknown, K value) {
    const auto i = static_cast<std::size_t>(unknown);
    fixed_values_[i] = value;
    if (fixed_[i]) return;
    fixed_[i] = 1;
    ++fixed_count_;
    structured_ = false;
  }
  void release(Index unknown) {
    const auto i = static_cast<std::size_t>(unknown);
    if (!fixed_[i]) return;
    fixed_[i] = 0;
    --fixed_count_;
    structured_ = false;
  }

  /// Sums the terms' rows into matrix() and rhs().
  /// \cost first call, or after the fixed set or the rows' unknowns changed: O(p + e log e) for p products and
  ///   e entries of the matrix; else O(p).
  /// \fails bad_input on an unknown out of range, spans of different length, or a number that is not finite: names
  ///   the term and the row; cancelled, where there is a context to ask.
  Status assemble(std::span<const TermRef<K>> terms, const Context* context = nullptr) {
    context_ = context;
    Status status = assemble_all(terms);
    context_ = nullptr;
    if (context && context->cancelled()) {
      structured_ = false;
      return cancelled_error("energy");
    }
    return status;
  }
  template <EnergyTerm<K>... Terms>
  Status assemble(const Terms&... terms) {
    const std::array<TermRef<K>, sizeof...(Terms)> list{TermRef<K>(terms)...};
    return assemble(std::span<const TermRef<K>>(list));
  }
  /// The same, cancelled with the context.
  template <EnergyTerm<K>... Terms>
  Status assemble(const Context& context, const Terms&... terms) {
    const std::array<TermRef<K>, sizeof...(Terms)> list{TermRef<K>(terms)...};
    return assemble(std::span<const TermRef<K>>(list), &context);
  }

  /// Lower triangle over the free unknowns, ascending. \pre assemble succeeded
  [[nodiscard]] HermitianView<K> matrix() const { return matrix_.view(); }
  [[nodiscard]] std::span<const K> rhs() const { return rhs_; }
  /// Adds a real number to the diagonal entry of a free unknown (a shift, a regularization) until the next assemble.
  void add_to_diagonal(Index free_unknown, Real value) {
    matrix_.values[static_cast<std::size_t>(matrix_.column_starts[static_cast<std::size_t>(free_unknown)])] += value;
  }
  /// Replaces the diagonal entry of a free unknown, and its right-hand side, until the next assemble: for a weight that
  /// changes while everything else stays.
  void set_diagonal(Index free_unknown, Real value, const K& right) {
    K& entry = matrix_.values[static_cast<std::size_t>(matrix_.column_starts[static_cast<std::size_t>(free_unknown)])];
    entry = K(value);
    rhs_[static_cast<std::size_t>(free_unknown)] = right;
  }
  [[nodiscard]] Real diagonal(Index free_unknown) const {
    return std::real(
        matrix_.values[static_cast<std::size_t>(matrix_.column_starts[static_cast<std::size_t>(free_unknown)])]);
  }
  /// Changes whenever a solver has to analyze again.
  [[nodiscard]] std::uint64_t pattern_version() const { return version_; }

  /// All unknowns from the free ones.
  [[nodiscard]] std::vector<K> expand(std::span<const K> free_values) const {
    std::vector<K> all(fixed_values_);
    std::size_t next = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (!fixed_[i]) all[i] = free_values[next++];
    return all;
  }
  /// The free unknowns of a full vector.
  [[nodiscard]] std::vector<K> restrict_to_free(std::span<const K> all) const {
    std::vector<K> free_values;
    free_values.reserve(static_cast<std::size_t>(free_count()));
    for (std::size_t i = 0; i < all.size(); ++i)
      if (!fixed_[i]) free_values.push_back(all[i]);
    return free_values;
  }

 private:
  static Error row_error(std::string what, std::string_view term, std::size_t row) {
    return {ErrorCode::bad_input, std::move(what), "term " + std::string(term) + ", row " + std::to_string(row),
            "check the term with quadrig/laws.hpp"};
  }

  Status assemble_all(std::span<const TermRef<K>> terms) {
    if (structured_) {
      if (Status status = fill(terms); !status.ok()) return status;
      if (structured_ || cancelled(0)) return {};
    }
    if (Status status = build_pattern(terms); !status.ok()) return status;
    if (cancelled(0)) return {};
    return fill(terms);
  }

  // Polled every 8192 rows; the assembled system is invalid afterwards.
  [[nodiscard]] bool cancelled(std::size_t row) const { return row % 8192 == 0 && context_ && context_->cancelled(); }

  // `size` zeros, in steps: touching much new memory takes long. False once cancelled.
  template <class T>
  [[nodiscard]] bool grow(std::vector<T>& list, std::size_t size) const {
    list.clear();
    list.reserve(size);
    while (list.size() < size) {
      if (cancelled(0)) return false;
      list.resize(std::min(size, list.size() + (std::size_t{1} << 20)));
    }
    return !cancelled(0);
  }

  // Finds the unknowns of every row, the union of their products, and for each product its place in that union.
  Status build_pattern(std::span<const TermRef<K>> terms) {
    ++version_;
    row_starts_.assign(1, 0);
    row_unknowns_.clear();
    std::optional<Error> error;
    for (const TermRef<K>& term : terms) {
      std::size_t number = 0;
      bool stopped = false;
      const auto gather = [&](const Row<K>& row) {
        if (stopped || (stopped = cancelled(number))) return;
        if (!error && row.at.size() != row.coeff.size())
          error = row_error("as many coefficients as unknowns are needed", term.name(), number);
        for (const Index unknown : row.at)
          if (!error && (unknown < 0 || unknown >= unknown_count()))
            error = row_error("unknown " + std::to_string(unknown) + " does not exist", term.name(), number);
        row_unknowns_.insert(row_unknowns_.end(), row.at.begin(), row.at.end());
        row_starts_.push_back(row_unknowns_.size());
        ++number;
      };
      term.for_each_row(EmitRow<K>(gather));
      if (error) return *error;
    }
    if (cancelled(0)) return {};

    free_index_.assign(fixed_.size(), no_index);
    Index free_unknowns = 0;
    for (std::size_t i = 0; i < fixed_.size(); ++i)
      if (!fixed_[i]) free_index_[i] = free_unknowns++;

    // The rows of the products beside the diagonal, by column.
    const auto n = static_cast<std::size_t>(free_unknowns);
    std::vector<std::size_t> starts(n + 1, 0);
    const auto for_each_product = [&](auto&& body) {  // in the order in which `fill` meets them
      for (std::size_t r = 0; r + 1 < row_starts_.size() && !cancelled(r); ++r)
        for (std::size_t p = row_starts_[r]; p < row_starts_[r + 1]; ++p) {
          const Index a = free_index_[static_cast<std::size_t>(row_unknowns_[p])];
          if (a == no_index) continue;
          for (std::size_t q = row_starts_[r]; q <= p; ++q) {
            const Index b = free_index_[static_cast<std::size_t>(row_unknowns_[q])];
            if (b != no_index) body(std::max(a, b), std::min(a, b));
          }
        }
    };
    std::size_t products = 0;
    for_each_product([&](Index row, Index column) {
      if (row != column) ++starts[static_cast<std::size_t>(column) + 1];
      ++products;
    });
    if (cancelled(0)) return {};
    for (std::size_t j = 0; j < n; ++j) starts[j + 1] += starts[j];
    if (products > std::size_t{0x7fffffff})
      return Error{ErrorCode::unsupported, "more than 2^31 products in one system", "energy", "use a coarser mesh"};
    std::vector<Index> by_column;
    if (!grow(by_column, starts[n])) return {};
    {
      std::vector<std::size_t> next(starts.begin(), starts.end() - (n > 0 ? 1 : 0));
      for_each_product([&](Index row, Index column) {
        if (row != column) by_column[next[static_cast<std::size_t>(column)]++] = row;
      });
    }
    if (cancelled(0)) return {};
    matrix_.size = free_unknowns;
    matrix_.column_starts.assign(1, 0);
    matrix_.column_starts.reserve(n + 1);
    matrix_.rows.clear();
    matrix_.rows.reserve(n);
    // Many products share a row: only the distinct ones are sorted. The diagonal leads each column.
    std::vector<Index> met(n, no_index);  // the last column that has each row
    for (std::size_t j = 0; j < n && !cancelled(j); ++j) {
      const auto column = static_cast<Index>(j);
      matrix_.rows.push_back(column);
      const std::size_t first = matrix_.rows.size();
      for (std::size_t e = starts[j]; e < starts[j + 1]; ++e)
        if (std::exchange(met[static_cast<std::size_t>(by_column[e])], column) != column)
          matrix_.rows.push_back(by_column[e]);
      std::sort(matrix_.rows.begin() + static_cast<std::ptrdiff_t>(first), matrix_.rows.end());
      matrix_.column_starts.push_back(static_cast<Index>(matrix_.rows.size()));
    }
    if (cancelled(0)) return {};
    if (!grow(places_, products)) return {};
    std::size_t number = 0;
    for_each_product([&](Index row, Index column) {
      const Index* const begin = matrix_.rows.data() + matrix_.column_starts[static_cast<std::size_t>(column)];
      const Index* const end = matrix_.rows.data() + matrix_.column_starts[static_cast<std::size_t>(column) + 1];
      const Index* const place = row == column ? begin : std::lower_bound(begin + 1, end, row);
      places_[number++] = static_cast<Index>(place - matrix_.rows.data());
    });
    if (cancelled(0)) return {};
    structured_ = true;
    return {};
  }

  // Adds every row's products at their known places. Clears `structured_` where the rows' unknowns have changed.
  Status fill(std::span<const TermRef<K>> terms) {
    matrix_.values.assign(matrix_.rows.size(), K{});
    rhs_.assign(static_cast<std::size_t>(matrix_.size), K{});
    std::size_t r = 0, place = 0;
    const auto add = [&](const Row<K>& row) {
      if (!structured_) return;
      if (cancelled(r)) {
        structured_ = false;
        return;
      }
      if (r + 1 >= row_starts_.size() || row_starts_[r + 1] - row_starts_[r] != row.at.size() ||
          row.coeff.size() != row.at.size() ||
          !std::equal(row.at.begin(), row.at.end(),
                      row_unknowns_.begin() + static_cast<std::ptrdiff_t>(row_starts_[r]))) {
        structured_ = false;
        return;
      }
      ++r;
      const Real weight = static_cast<Real>(row.weight);
      K target = row.rhs;
      if (fixed_count_ > 0)
        for (std::size_t p = 0; p < row.at.size(); ++p) {
          const auto unknown = static_cast<std::size_t>(row.at[p]);
          if (fixed_[unknown]) target -= row.coeff[p] * fixed_values_[unknown];
        }
      for (std::size_t p = 0; p < row.at.size(); ++p) {
        const Index a = free_index_[static_cast<std::size_t>(row.at[p])];
        if (a == no_index) continue;
        const K left = weight * conjugate(row.coeff[p]);
        rhs_[static_cast<std::size_t>(a)] += left * target;
        for (std::size_t q = 0; q < p; ++q) {
          const Index b = free_index_[static_cast<std::size_t>(row.at[q])];
          if (b == no_index) continue;
          const K product = left * row.coeff[q];  // entry (a, b); its conjugate is entry (b, a)
          K& value = matrix_.values[static_cast<std::size_t>(places_[place++])];
          if (a > b)
            value += product;
          else if (a < b)
            value += conjugate(product);
          else
            value += product + conjugate(product);
        }
        matrix_.values[static_cast<std::size_t>(places_[place++])] += weight * std::norm(row.coeff[p]);
      }
    };
    for (const TermRef<K>& term : terms) term.for_each_row(EmitRow<K>(add));
    if (r + 1 != row_starts_.size()) structured_ = false;
    if (!structured_) return {};
    const auto finite = [](const K& z) { return std::isfinite(std::norm(z)); };
    if (std::all_of(matrix_.values.begin(), matrix_.values.end(), finite) &&
        std::all_of(rhs_.begin(), rhs_.end(), finite))
      return {};
    return name_bad_row(terms);
  }

  // Only called once a sum is known not to be finite.
  [[nodiscard]] Error name_bad_row(std::span<const TermRef<K>> terms) const {
    for (const TermRef<K>& term : terms) {
      std::size_t number = 0, bad = no_row;
      const auto look = [&](const Row<K>& row) {
        Real sum = static_cast<Real>(row.weight) * std::norm(row.rhs);
        for (const K& coefficient : row.coeff) sum += static_cast<Real>(row.weight) * std::norm(coefficient);
        if (!std::isfinite(sum) && bad == no_row) bad = number;
        ++number;
      };
      term.for_each_row(EmitRow<K>(look));
      if (bad != no_row) return row_error("a number is not finite", term.name(), bad);
    }
    return {ErrorCode::bad_input, "the sum of the terms is not finite", "energy", "scale the terms or a fixed value"};
  }

  static constexpr std::size_t no_row = static_cast<std::size_t>(-1);

  std::vector<char> fixed_;
  std::vector<K> fixed_values_;
  Index fixed_count_ = 0;
  bool structured_ = false;
  const Context* context_ = nullptr;  // while assembling
  std::uint64_t version_ = 0;
  std::vector<std::size_t> row_starts_;  // of each row in row_unknowns_, in the order of emission
  std::vector<Index> row_unknowns_;
  std::vector<Index> free_index_;
  std::vector<Index> places_;  // entry of matrix_ that each product of free unknowns adds to
  HermitianMatrix<K> matrix_;
  std::vector<K> rhs_;
};

}  // namespace quadrig
