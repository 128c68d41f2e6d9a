// Checkers for extensions by users: energy terms and solver backends.
#pragma once

#include <random>

#include <Eigen/Cholesky>

#include "quadrig/energy.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

namespace detail {

inline Error broken_law(std::string what, std::string where) {
  return {ErrorCode::bad_input, std::move(what), std::move(where), {}};
}

// Reproducible numbers in [−1, 1], the same on every standard library.
template <class K>
class LawNumbers {
 public:
  explicit LawNumbers(std::uint32_t seed) : engine_(seed) {}
  real_of<K> real() { return static_cast<real_of<K>>(static_cast<double>(engine_()) / 2147483647.5 - 1); }
  K number() {
    if constexpr (std::is_same_v<K, real_of<K>>) {
      return real();
    } else {
      const auto a = real();
      return K(a, real());
    }
  }
  Index below(Index n) { return static_cast<Index>(engine_() % static_cast<std::uint32_t>(n)); }

 private:
  std::mt19937 engine_;
};

// A ring with random chords, whose values are those of a sum of squares and so positive definite.
template <class K>
struct LawSystem {
  LawSystem(Index n, std::uint32_t pattern_seed) : size(n) {
    LawNumbers<K> numbers(pattern_seed);
    for (Index i = 0; i < n; ++i) edges.push_back({i, (i + 1) % n});
    for (Index i = 0; i < n / 2; ++i) {
      const Index a = numbers.below(n);  // the order of two draws in one expression would be the compiler's choice
      edges.push_back({a, numbers.below(n)});
    }
  }

  [[nodiscard]] HermitianMatrix<K> matrix(std::uint32_t value_seed) const {
    LawNumbers<K> numbers(value_seed);
    const RowTerm rows{"law", [&](EmitRow<K> emit) {
                         for (Index i = 0; i < size; ++i) {
                           const std::array<Index, 1> at{i};
                           const std::array<K, 1> one{K(1)};
                           emit(Row<K>{at, one, K{}, 0.5});
                         }
                         for (const auto& edge : edges) {
                           const K first = numbers.number();
                           const std::array<K, 2> coeff{first, numbers.number()};
                           emit(Row<K>{edge, coeff, K{}, 1.0});
                         }
                       }};
    QuadraticForm<K> form(size);
    // Two passes emit different numbers; the pattern pass reads none of them, so the values are of the second.
    [[maybe_unused]] const Status status = form.assemble(rows);
    assert(status.ok());
    const auto A = form.matrix();
    return {A.size,
            {A.column_starts.begin(), A.column_starts.end()},
            {A.rows.begin(), A.rows.end()},
            {A.values.begin(), A.values.end()}};
  }

  Index size;
  std::vector<std::array<Index, 2>> edges;
};

template <class K>
[[nodiscard]] std::vector<K> dense_solution(const HermitianView<K>& A, std::span<const K> b) {
  using Matrix = Eigen::Matrix<K, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<K, Eigen::Dynamic, 1>;
  Matrix dense = Matrix::Zero(A.size, A.size);
  for (Index j = 0; j < A.size; ++j)
    for (Index e = A.column_starts[static_cast<std::size_t>(j)]; e < A.column_starts[static_cast<std::size_t>(j) + 1];
         ++e)
      dense(A.rows[static_cast<std::size_t>(e)], j) = A.values[static_cast<std::size_t>(e)];
  const Vector x =
      dense.template selfadjointView<Eigen::Lower>().llt().solve(Eigen::Map<const Vector>(b.data(), A.size));
  return {x.data(), x.data() + x.size()};
}

}  // namespace detail

/// Checks that a term keeps the promises of EnergyTerm: it has a name, its rows are well formed and finite with
/// unknowns in [0, unknowns), and a second call emits the same rows, bit for bit.
/// \cost two passes over the rows. \fails bad_input, naming the law and the row
template <SparseScalar K, EnergyTerm<K> Term>
[[nodiscard]] Status check_energy_term(const Term& term, Index unknowns) {
  const std::string name(term.name());
  if (name.empty()) return detail::broken_law("a term has a name", "energy term");
  struct Kept {
    std::vector<Index> at;
    std::vector<K> coeff;
    K rhs;
    double weight;
  };
  std::vector<Kept> kept;
  std::optional<Error> error;
  std::size_t number = 0;
  const auto fail = [&](std::string what) {
    if (!error) error = detail::broken_law(std::move(what), "term " + name + ", row " + std::to_string(number));
  };
  const auto first = [&](const Row<K>& row) {
    if (row.at.empty()) fail("a row has an unknown");
    if (row.at.size() != row.coeff.size()) fail("a row has as many coefficients as unknowns");
    for (const Index unknown : row.at)
      if (unknown < 0 || unknown >= unknowns) fail("unknown " + std::to_string(unknown) + " exists");
    bool finite = std::isfinite(row.weight) && std::isfinite(std::norm(row.rhs));
    for (const K& coefficient : row.coeff) finite = finite && std::isfinite(std::norm(coefficient));
    if (!finite) fail("the numbers of a row are finite");
    kept.push_back({{row.at.begin(), row.at.end()}, {row.coeff.begin(), row.coeff.end()}, row.rhs, row.weight});
    ++number;
  };
  term.for_each_row(EmitRow<K>(first));
  if (error) return *error;
  number = 0;
  const auto second = [&](const Row<K>& row) {
    if (number >= kept.size() || !std::ranges::equal(row.at, kept[number].at))
      fail("every call emits the same unknowns in the same order");
    else if (!std::ranges::equal(row.coeff, kept[number].coeff) || row.rhs != kept[number].rhs ||
             row.weight != kept[number].weight)
      fail("the numbers of a row change only when the term is changed");
    ++number;
  };
  term.for_each_row(EmitRow<K>(second));
  if (!error && number != kept.size()) fail("every call emits as many rows");
  if (error) return *error;
  return {};
}

/// Checks a backend against dense Cholesky on small systems: right answers for several right-hand sides, for new
/// values after one analysis, with an elimination order given and without; equal bits when repeated; an error, not a
/// wrong answer, for matrices that are indefinite, singular or not finite, and right answers again afterwards.
/// `make` returns a fresh backend. The tolerance is relative to the largest entry of the solution.
/// \fails numeric, naming the law and the size of the system
template <SparseScalar K, class Make>
requires SolverBackend<std::remove_cvref_t<std::invoke_result_t<Make&>>, K>
[[nodiscard]] Status check_solver_backend(Make&& make, Context& context,
                                          double tolerance = 2e3 * std::numeric_limits<real_of<K>>::epsilon()) {
  for (const Index n : {1, 2, 3, 17, 60, 200}) {
    const auto fail = [&](std::string law) {
      return Status(Error{
          ErrorCode::numeric, "broken law: " + std::move(law), "solver of " + std::to_string(n) + " unknowns", {}});
    };
    const detail::LawSystem<K> system(n, 7u + static_cast<std::uint32_t>(n));
    detail::LawNumbers<K> numbers(11);
    std::vector<K> b(static_cast<std::size_t>(n)), x(b.size()), again(b.size());
    const auto solves = [&](auto& solver, const HermitianMatrix<K>& A) {
      for (K& each : b) each = numbers.number();
      const SolveInfo info = solver.solve(b, x, context);
      if (!info.status.ok()) return false;
      const std::vector<K> wanted = detail::dense_solution<K>(A.view(), b);
      double largest = 0, worst = 0;
      for (std::size_t i = 0; i < x.size(); ++i) {
        largest = std::max(largest, static_cast<double>(std::abs(wanted[i])));
        worst = std::max(worst, static_cast<double>(std::abs(x[i] - wanted[i])));
      }
      return worst <= tolerance * largest;
    };

    auto solver = make();
    const HermitianMatrix<K> A = system.matrix(1), B = system.matrix(2);
    if (!solver.analyze(A.view(), {}, context).ok()) return fail("a pattern is analyzed");
    if (!solver.factorize(A.view(), context).ok()) return fail("a positive definite matrix is factored");
    for (int k = 0; k < 3; ++k)
      if (!solves(solver, A)) return fail("a solution is that of dense Cholesky");
    if (!solver.solve(b, again, context).status.ok() || x != again) return fail("repeated, a solve gives equal bits");
    if (!solver.factorize(B.view(), context).ok() || !solves(solver, B)) return fail("new values need no new analysis");

    std::vector<Index> order(b.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = n - 1 - static_cast<Index>(i);
    auto ordered = make();
    if (!ordered.analyze(A.view(), order, context).ok() || !ordered.factorize(A.view(), context).ok() ||
        !solves(ordered, A))
      return fail("a given order changes nothing but time");

    const auto refuses = [&](const HermitianMatrix<K>& bad) {
      for (K& each : b) each = numbers.number();
      return !solver.factorize(bad.view(), context).ok() || !solver.solve(b, x, context).status.ok();
    };
    const auto diagonal = [&](HermitianMatrix<K>& M, Index i) -> K& {
      return M.values[static_cast<std::size_t>(M.column_starts[static_cast<std::size_t>(i)])];
    };
    HermitianMatrix<K> indefinite = A, singular = A, poisoned = A;
    diagonal(indefinite, n / 2) = K(-1);
    std::fill(singular.values.begin(), singular.values.end(), K{});
    for (Index i = 0; i + 1 < n; ++i) diagonal(singular, i) = K(1);
    diagonal(poisoned, n - 1) = K(std::numeric_limits<real_of<K>>::quiet_NaN());
    if (!refuses(indefinite)) return fail("an indefinite matrix is an error");
    if (!refuses(singular)) return fail("a singular matrix is an error");
    if (!refuses(poisoned)) return fail("a matrix that is not finite is an error");
    if (!solver.factorize(A.view(), context).ok() || !solves(solver, A))
      return fail("an error does not outlast its matrix");
  }
  return {};
}

}  // namespace quadrig
