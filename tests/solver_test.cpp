// One body over every backend and precision, against dense Cholesky.
#include "test.hpp"

#include "quadrig/laws.hpp"

using namespace quadrig;

TEMPLATE_TEST_CASE("solver: every backend in this build obeys the laws", "[solver]", float, double, std::complex<float>,
                   std::complex<double>) {
  using K = TestType;
  for (const std::string_view name : solver_names()) {
    if (!solver_built<K>(name)) continue;
    INFO(name);
    Context context;
    const Status status = check_solver_backend<K>([&] { return make_solver<K>(name).value(); }, context);
    INFO((status.ok() ? std::string() : status.error().message()));
    CHECK(status.ok());
    CHECK(make_solver<K>(name)->name() == name);
  }
}

TEST_CASE("solver: a backend that is not built is an error by name, never another one", "[solver]") {
  Index absent = 0;
  for (const std::string_view name : solver_names()) {
    const auto solver = make_solver<float>(name);
    if (solver_built<float>(name)) {
      CHECK(solver->name() == name);
      continue;
    }
    ++absent;
    REQUIRE(!solver);
    CHECK(solver.error().code == ErrorCode::unsupported);
    CHECK(solver.error().where.find(name) != std::string::npos);
  }
  CHECK(absent == 2);  // CHOLMOD has no single precision
  const auto unknown = make_solver<double>("eigan");
  REQUIRE(!unknown);
  CHECK(unknown.error().code == ErrorCode::bad_option);
  CHECK(unknown.error().remedy.find("eigen") != std::string::npos);
}

TEMPLATE_TEST_CASE("solver: a failure names the unknown that caused it", "[solver]", double, std::complex<double>) {
  using K = TestType;
  QuadraticForm<K> form(5);
  const RowTerm springs{"springs", [](EmitRow<K> emit) {
                          const std::array<K, 2> difference{K(1), K(-1)};
                          for (const std::array<Index, 2>& at : {std::array<Index, 2>{0, 1}, {1, 3}, {3, 4}})
                            emit(Row<K>{at, difference, K(1), 1});
                          const std::array<Index, 1> first{0};
                          emit(Row<K>{first, std::span(difference).first(1), K(2), 1});
                        }};
  REQUIRE(form.assemble(springs).ok());  // unknown 2 has no row at all
  auto solver = make_solver<K>();
  Context context;
  const Status status = solver->prepare(form.matrix(), form.pattern_version(), context);
  REQUIRE(!status.ok());
  CHECK(status.error().code == ErrorCode::numeric);
  CHECK(status.error().where == "solver eigen, unknown 2");

  form.fix(2, K(7));
  REQUIRE(form.assemble(springs).ok());
  REQUIRE(solver->prepare(form.matrix(), form.pattern_version(), context).ok());
  std::vector<K> x(4);
  REQUIRE(solver->solve(form.rhs(), x, context).status.ok());
  const std::vector<K> z = form.expand(x);
  const std::array<K, 5> wanted{K(2), K(1), K(7), K(0), K(-1)};
  for (std::size_t i = 0; i < z.size(); ++i) CHECK(std::abs(z[i] - wanted[i]) < 1e-12);
}

TEST_CASE("solver: a copy has the analysis and numbers of its own", "[solver]") {
  const detail::LawSystem<Complex> system(50, 3);
  const auto A = system.matrix(1), B = system.matrix(2);
  Context context;
  auto first = make_solver<Complex>().value();
  REQUIRE(first.can_clone());
  REQUIRE(first.analyze(A.view(), {}, context).ok());
  auto second = first.clone();
  REQUIRE(first.factorize(A.view(), context).ok());
  REQUIRE(second.factorize(B.view(), context).ok());
  const std::vector<Complex> b(50, Complex(1, -2));
  std::vector<Complex> x(50), y(50);
  REQUIRE(first.solve(b, x, context).status.ok());
  REQUIRE(second.solve(b, y, context).status.ok());
  CHECK(relative_residual<Complex>(A.view(), x, b) < 1e-12);
  CHECK(relative_residual<Complex>(B.view(), y, b) < 1e-12);
}

TEST_CASE("solver: an order that is no permutation is refused", "[solver]") {
  const detail::LawSystem<double> system(6, 3);
  const auto A = system.matrix(1);
  Context context;
  auto solver = make_solver<double>().value();
  for (const std::vector<Index>& order :
       {std::vector<Index>{0, 1, 2}, {0, 1, 2, 3, 4, 4}, {0, 1, 2, 3, 4, 6}, {-1, 1, 2, 3, 4, 5}})
    CHECK(!solver.analyze(A.view(), order, context).ok());
}

TEST_CASE("laws: backends that break a promise are found out", "[laws]") {
  // Answers right where it answers, but never refuses: what a user's first backend may look like.
  struct Careless : SimplicialLdlt<double> {
    SolveInfo solve(std::span<const double> b, std::span<double> x, Context& context) {
      const SolveInfo info = SimplicialLdlt<double>::solve(b, x, context);
      return {.status = {}, .residual = info.residual};
    }
    Status factorize(const HermitianView<double>& A, Context& context) {
      (void)SimplicialLdlt<double>::factorize(A, context).ok();
      return {};
    }
  };
  struct Imprecise : SimplicialLdlt<double> {
    SolveInfo solve(std::span<const double> b, std::span<double> x, Context& context) {
      SolveInfo info = SimplicialLdlt<double>::solve(b, x, context);
      x[0] *= 1 + 1e-6;
      return info;
    }
  };
  Context context;
  const Status careless = check_solver_backend<double>([] { return Careless(); }, context);
  REQUIRE(!careless.ok());
  CHECK(careless.error().what.find("indefinite") != std::string::npos);
  const Status imprecise = check_solver_backend<double>([] { return Imprecise(); }, context);
  REQUIRE(!imprecise.ok());
  CHECK(imprecise.error().what.find("dense") != std::string::npos);
}
