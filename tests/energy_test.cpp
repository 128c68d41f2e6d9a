// QuadraticForm against dense sums, its kept pattern, fixed values and errors; and the laws of terms.
#include "test.hpp"

#include <Eigen/Dense>

#include "quadrig/laws.hpp"

using namespace quadrig;

namespace {

template <class K>
struct Rows {
  std::vector<std::vector<Index>> at;
  std::vector<std::vector<K>> coeff;
  std::vector<K> rhs;
  std::vector<double> weight;

  static Rows random(Index unknowns, int count, std::uint32_t seed) {
    quadrig::detail::LawNumbers<K> numbers(seed);
    Rows rows;
    for (int r = 0; r < count; ++r) {
      rows.at.emplace_back();
      rows.coeff.emplace_back();
      for (Index k = 0; k < 1 + numbers.below(5); ++k) {
        rows.at.back().push_back(numbers.below(unknowns));
        rows.coeff.back().push_back(numbers.number());
      }
      rows.rhs.push_back(numbers.number());
      rows.weight.push_back(1.5 + static_cast<double>(numbers.real()));
    }
    return rows;
  }

  [[nodiscard]] static std::string_view name() { return "random rows"; }
  void for_each_row(EmitRow<K> emit) const {
    for (std::size_t r = 0; r < at.size(); ++r) emit(Row<K>{at[r], coeff[r], rhs[r], weight[r]});
  }
};

template <class K>
using Dense = Eigen::Matrix<K, Eigen::Dynamic, Eigen::Dynamic>;
template <class K>
using DenseVector = Eigen::Matrix<K, Eigen::Dynamic, 1>;

template <class K>
std::pair<Dense<K>, DenseVector<K>> dense_sum(const Rows<K>& rows, Index n) {
  Dense<K> A = Dense<K>::Zero(n, n);
  DenseVector<K> b = DenseVector<K>::Zero(n);
  for (std::size_t r = 0; r < rows.at.size(); ++r) {
    DenseVector<K> row = DenseVector<K>::Zero(n);
    for (std::size_t k = 0; k < rows.at[r].size(); ++k) row[rows.at[r][k]] += rows.coeff[r][k];
    const auto weight = static_cast<real_of<K>>(rows.weight[r]);
    A += weight * row.conjugate() * row.transpose();
    b += weight * rows.rhs[r] * row.conjugate();
  }
  return {A, b};
}

template <class K>
Dense<K> lower_of(const HermitianView<K>& A) {
  Dense<K> dense = Dense<K>::Zero(A.size, A.size);
  for (Index j = 0; j < A.size; ++j)
    for (Index e = A.column_starts[static_cast<std::size_t>(j)]; e < A.column_starts[static_cast<std::size_t>(j) + 1];
         ++e)
      dense(A.rows[static_cast<std::size_t>(e)], j) = A.values[static_cast<std::size_t>(e)];
  return dense;
}

}  // namespace

TEMPLATE_TEST_CASE("energy: a form is the dense sum of its rows, repeated unknowns and all", "[energy]", float, double,
                   std::complex<float>, std::complex<double>) {
  using K = TestType;
  const double tolerance = 200 * static_cast<double>(std::numeric_limits<real_of<K>>::epsilon());
  constexpr Index n = 30;
  const auto rows = Rows<K>::random(n, 150, 5);
  QuadraticForm<K> form(n);
  REQUIRE(form.assemble(rows).ok());
  const auto [A, b] = dense_sum(rows, n);
  CHECK((lower_of(form.matrix()) - Dense<K>(A.template triangularView<Eigen::Lower>())).norm() < tolerance * A.norm());
  const Eigen::Map<const DenseVector<K>> rhs(form.rhs().data(), n);
  CHECK((rhs - b).norm() < tolerance * b.norm());
  for (Index j = 0; j < n; ++j)
    CHECK(form.matrix().rows[static_cast<std::size_t>(form.matrix().column_starts[static_cast<std::size_t>(j)])] == j);
}

TEMPLATE_TEST_CASE("energy: fixed values leave the system of the others, and come back in place", "[energy]", double,
                   std::complex<double>) {
  using K = TestType;
  constexpr Index n = 20;
  auto rows = Rows<K>::random(n, 120, 9);
  QuadraticForm<K> form(n);
  const K held = K(0.75);
  form.fix(3, K(-1));
  form.fix(11, held);
  REQUIRE(form.assemble(rows).ok());
  const auto version = form.pattern_version();
  form.fix(3, K(2));
  rows.weight[0] *= 3;
  REQUIRE(form.assemble(rows).ok());
  CHECK(form.pattern_version() == version);
  REQUIRE(form.free_count() == n - 2);

  auto solver = make_solver<K>();
  Context context;
  REQUIRE(solver->prepare(form.matrix(), form.pattern_version(), context).ok());
  std::vector<K> x(form.rhs().size());
  REQUIRE(solver->solve(form.rhs(), x, context).status.ok());
  const std::vector<K> z = form.expand(x);
  CHECK(z[3] == K(2));
  CHECK(z[11] == held);
  CHECK(form.restrict_to_free(z) == x);

  // At the minimum the gradient of the whole energy vanishes in every free unknown.
  const auto [A, b] = dense_sum(rows, n);
  const DenseVector<K> gradient = A * Eigen::Map<const DenseVector<K>>(z.data(), n) - b;
  for (Index i = 0; i < n; ++i)
    if (!form.is_fixed(i)) CHECK(std::abs(gradient[i]) < 1e-10 * b.norm());
  form.release(3);
  REQUIRE(form.assemble(rows).ok());
  CHECK(form.pattern_version() != version);
  CHECK(form.free_count() == n - 1);
}

TEST_CASE("energy: the pattern stays while weights change and is found again when unknowns do", "[energy]") {
  auto rows = Rows<double>::random(25, 100, 3);
  QuadraticForm<double> form(25);
  REQUIRE(form.assemble(rows).ok());
  const auto version = form.pattern_version();
  for (double& weight : rows.weight) weight *= -0.5;
  REQUIRE(form.assemble(rows).ok());
  CHECK(form.pattern_version() == version);
  CHECK((lower_of(form.matrix()) - Eigen::MatrixXd(dense_sum(rows, 25).first.triangularView<Eigen::Lower>())).norm() <
        1e-10);
  rows.at[4][0] = (rows.at[4][0] + 1) % 25;
  REQUIRE(form.assemble(rows).ok());
  CHECK(form.pattern_version() != version);
  CHECK((lower_of(form.matrix()) - Eigen::MatrixXd(dense_sum(rows, 25).first.triangularView<Eigen::Lower>())).norm() <
        1e-10);
}

TEST_CASE("energy: energy_of is the sum of squares, and least at the minimizer", "[energy]") {
  const auto rows = Rows<Complex>::random(12, 60, 21);
  QuadraticForm<Complex> form(12);
  REQUIRE(form.assemble(rows).ok());
  auto solver = make_solver<Complex>();
  Context context;
  REQUIRE(solver->prepare(form.matrix(), form.pattern_version(), context).ok());
  std::vector<Complex> x(12);
  REQUIRE(solver->solve(form.rhs(), x, context).status.ok());
  const double least = energy_of<Complex>(rows, x);
  CHECK(least > 0);
  for (std::size_t i = 0; i < x.size(); ++i)
    for (const Complex step : {Complex(0.01), Complex(0, 0.01), Complex(-0.01)}) {
      auto moved = x;
      moved[i] += step;
      CHECK(energy_of<Complex>(rows, moved) > least);
    }
}

TEST_CASE("energy: a bad row is an error that names the term and the row", "[energy]") {
  auto rows = Rows<double>::random(10, 20, 2);
  QuadraticForm<double> form(10);
  SECTION("unknown out of range") {
    rows.at[7][0] = 10;
    const Status status = form.assemble(rows);
    REQUIRE(!status.ok());
    CHECK(status.error().where == "term random rows, row 7");
    CHECK(!check_energy_term<double>(rows, 10).ok());
  }
  SECTION("not a number, in an assembly that worked before") {
    REQUIRE(form.assemble(rows).ok());
    rows.coeff[12][0] = std::numeric_limits<double>::quiet_NaN();
    const Status status = form.assemble(rows);
    REQUIRE(!status.ok());
    CHECK(status.error().where == "term random rows, row 12");
    CHECK(!check_energy_term<double>(rows, 10).ok());
  }
  SECTION("coefficients missing") {
    rows.coeff[3].push_back(1);
    const Status status = form.assemble(rows);
    REQUIRE(!status.ok());
    CHECK(status.error().where == "term random rows, row 3");
  }
}

TEST_CASE("laws: a term that changes between calls is found out", "[laws]") {
  struct Fickle {
    mutable int calls = 0;
    bool grows = false;
    [[nodiscard]] static std::string_view name() { return "fickle"; }
    void for_each_row(EmitRow<double> emit) const {
      const std::array<Index, 1> at{grows ? 0 : calls % 3};
      const std::array<double, 1> one{1.0};
      for (int row = 0; row < (grows ? 1 + calls : 1); ++row) emit(Row<double>{at, one, 0, 1});
      ++calls;
    }
  };
  CHECK(!check_energy_term<double>(Fickle{}, 3).ok());
  CHECK(!check_energy_term<double>(Fickle{0, true}, 3).ok());
  CHECK(check_energy_term<double>(Rows<double>::random(10, 20, 2), 10).ok());
}
