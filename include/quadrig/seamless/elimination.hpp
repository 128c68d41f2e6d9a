// Exact, fraction-free elimination of linear relations over Z or Z[i].
#pragma once

#include <algorithm>

#include "quadrig/seamless/gaussian.hpp"

namespace quadrig {

template <class R>
struct LinearTerm {
  Index variable;
  R coefficient;
};

/// Σ coefficient · variable, sorted by variable, no zero coefficients.
template <class R>
using LinearExpression = std::vector<LinearTerm<R>>;

/// Adds factor · right to left.
template <class R>
void accumulate(LinearExpression<R>& left, const LinearExpression<R>& right, R factor) {
  LinearExpression<R> sum;
  sum.reserve(left.size() + right.size());
  auto a = left.begin();
  auto b = right.begin();
  while (a != left.end() || b != right.end()) {
    if (b == right.end() || (a != left.end() && a->variable < b->variable)) {
      sum.push_back(*a++);
    } else if (a == left.end() || b->variable < a->variable) {
      sum.push_back({b->variable, factor * b->coefficient});
      ++b;
    } else {
      const R c = a->coefficient + factor * b->coefficient;
      if (!ring_zero(c)) sum.push_back({a->variable, c});
      ++a;
      ++b;
    }
  }
  left = std::move(sum);
}

/// Rows Σ c x = 0 are added one at a time; each removes one variable by a pivot that divides its row, so that every
/// variable stays an integer combination of those that remain. Free (real) variables are pivoted on before integer
/// ones. Substitution is lazy: an expression is brought up to date when it is read.
/// Source: design of the seamless constraints, fraction-free because every translation enters with a unit.
template <class R>
class Elimination {
 public:
  enum class Kind : std::uint8_t { constant, free, integer };

  explicit Elimination(std::vector<Kind> kinds)
      : kinds_(std::move(kinds)),
        solved_(kinds_.size(), 0),
        occurrences_(kinds_.size(), 0),
        expressions_(kinds_.size()) {}

  [[nodiscard]] Index variable_count() const { return static_cast<Index>(kinds_.size()); }
  [[nodiscard]] Kind kind(Index variable) const { return kinds_[at(variable)]; }
  [[nodiscard]] bool solved(Index variable) const { return solved_[at(variable)] != 0; }

  /// Adds Σ c x = 0. False where the row contradicts the earlier ones (only a constant is left, or an integer
  /// variable would have to be fractional).
  [[nodiscard]] bool add(const LinearExpression<R>& row) {
    LinearExpression<R> r = resolved(row);
    for (;;) {
      Index pivot = no_index;
      R pivot_coefficient{};
      int pivot_class = 4;
      for (const auto& [v, c] : r) {
        if (kind(v) == Kind::constant) continue;
        const int rank = ring_unit(c) ? (kind(v) == Kind::free ? 0 : 2) : 3;
        if (rank < pivot_class ||
            (rank == pivot_class && pivot != no_index && occurrences_[at(v)] < occurrences_[at(pivot)])) {
          pivot = v;
          pivot_coefficient = c;
          pivot_class = rank;
        }
      }
      if (pivot == no_index) return r.empty();
      if (pivot_class < 3) {
        LinearExpression<R> expression;
        const R factor = R{} - unit_inverse(pivot_coefficient);
        for (const auto& [v, c] : r)
          if (v != pivot) {
            expression.push_back({v, factor * c});
            ++occurrences_[at(v)];
          }
        expressions_[at(pivot)] = std::move(expression);
        solved_[at(pivot)] = 1;
        return true;
      }
      if (!shrink(r)) return false;
    }
  }

  /// The same value in variables that remain.
  [[nodiscard]] LinearExpression<R> resolved(const LinearExpression<R>& row) {
    const bool clean = std::none_of(row.begin(), row.end(), [&](const auto& t) { return solved(t.variable); });
    if (clean) return row;
    LinearExpression<R> result;
    for (const auto& [v, c] : row)
      if (!solved(v)) result.push_back({v, c});
    for (const auto& [v, c] : row)
      if (solved(v)) accumulate(result, expression(v), c);
    return result;
  }

 private:
  [[nodiscard]] static std::size_t at(Index variable) { return detail::at(variable); }

  const LinearExpression<R>& expression(Index variable) {
    LinearExpression<R>& e = expressions_[at(variable)];
    const bool clean = std::none_of(e.begin(), e.end(), [&](const auto& t) { return solved(t.variable); });
    if (!clean) {
      LinearExpression<R> stale = std::move(e);
      LinearExpression<R> fresh = resolved(stale);
      expressions_[at(variable)] = std::move(fresh);
    }
    return expressions_[at(variable)];
  }

  /// No unit coefficient: divides the row by its gcd; where that is not enough, one step of Euclid's algorithm on its
  /// two smallest coefficients, by a new variable that replaces one of them.
  bool shrink(LinearExpression<R>& r) {
    R g{};
    for (const auto& term : r) g = ring_gcd(g, term.coefficient);
    if (!ring_unit(g)) {
      for (auto& term : r) term.coefficient = ring_quotient(term.coefficient, g);
      return true;
    }
    std::size_t first = r.size(), second = r.size();
    for (std::size_t k = 0; k < r.size(); ++k) {
      if (kind(r[k].variable) == Kind::constant) continue;
      const auto norm = ring_norm(r[k].coefficient);
      if (first == r.size() || norm < ring_norm(r[first].coefficient)) {
        second = first;
        first = k;
      } else if (second == r.size() || norm < ring_norm(r[second].coefficient)) {
        second = k;
      }
    }
    if (second == r.size()) return false;
    // a x + b y with q = b / a: x = x' − q y leaves a x' + (b − q a) y.
    const Index x = r[first].variable, y = r[second].variable;
    const R q = ring_quotient(r[second].coefficient, r[first].coefficient);
    const Index fresh = variable_count();
    kinds_.push_back(kind(x));
    solved_.push_back(0);
    occurrences_.push_back(0);
    expressions_.emplace_back();
    LinearExpression<R> expression{{y, R{} - q}};
    accumulate(expression, LinearExpression<R>{{fresh, one_of(R{})}}, one_of(R{}));
    expressions_[at(x)] = std::move(expression);
    solved_[at(x)] = 1;
    r = resolved(r);
    return true;
  }

  std::vector<Kind> kinds_;
  std::vector<char> solved_;
  std::vector<Index> occurrences_;
  std::vector<LinearExpression<R>> expressions_;
};

}  // namespace quadrig
