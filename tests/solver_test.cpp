// One body over every backend and precision, against dense Cholesky.
#include "test.hpp"

#include "quadrig/laws.hpp"

using namespace quadrig;

namespace {

using quadrig::detail::at;

// The dual of a strip of triangles, two in each cell: neighbours agree up to a phase, all are drawn to a number.
template <class K>
struct Strip {
  Strip(Index across, Index along, double pull = 0.1) : form(2 * across * along) {
    const RowTerm rows{"strip", [&](EmitRow<K> emit) {
                         detail::LawNumbers<K> numbers(3);
                         const auto link = [&](Index f, Index g) {
                           K phase = numbers.number();
                           phase /= std::abs(phase);
                           emit(Row<K>{std::array<Index, 2>{f, g}, std::array<K, 2>{K(1), -phase}, K{}, 1.0});
                         };
                         for (Index i = 0; i < along; ++i)
                           for (Index j = 0; j < across; ++j) {
                             const Index f = 2 * (i * across + j);
                             link(f, f + 1);
                             if (j + 1 < across) link(f + 1, f + 2);
                             if (i + 1 < along) link(f, f + 2 * across + 1);
                             for (const Index g : {f, f + 1})
                               emit(Row<K>{std::array<Index, 1>{g}, std::array<K, 1>{K(1)}, numbers.number(), pull});
                           }
                       }};
    [[maybe_unused]] const Status status = form.assemble(rows);
    assert(status.ok());
  }
  QuadraticForm<K> form;
};

// A grid with cuts that end inside it. Over each the values jump by unknowns of their own, along the first rows by two
// of them, as in a seamless map; over every other cut they change their sign too.
template <class K>
struct Cuts {
  static constexpr Index count = 5;

  explicit Cuts(Index size, double pull = 1e-6) : side(size), cells(size * size), form(cells + count) {
    const RowTerm rows{
        "cuts", [&](EmitRow<K> emit) {
          detail::LawNumbers<K> numbers(3);
          for (Index f = 0; f < cells; ++f) {
            const Index i = f / side, j = f % side, over = cut(f);
            if (over != no_index)
              emit(Row<K>{std::array<Index, 4>{f, f + 1, cells + over, cells + (over + 1) % count},
                          std::array<K, 4>{K(1), K(over % 2 == 0 ? -1 : 1), K(-1), K(i < side / 8 ? 1 : 0)},
                          numbers.number(), 1.0});
            else if (j + 1 < side)
              emit(Row<K>{std::array<Index, 2>{f, f + 1}, std::array<K, 2>{K(1), K(-1)}, numbers.number(), 1.0});
            if (i + 1 < side)
              emit(Row<K>{std::array<Index, 2>{f, f + side}, std::array<K, 2>{K(1), K(-1)}, numbers.number(), 1.0});
            emit(Row<K>{std::array<Index, 1>{f}, std::array<K, 1>{K(1)}, numbers.number(), pull});
          }
        }};
    [[maybe_unused]] const Status status = form.assemble(rows);
    assert(status.ok());
  }
  // The cut between a cell and the next of its row.
  [[nodiscard]] Index cut(Index f) const {
    const Index i = f / side, j = f % side;
    for (Index k = 0; k < count; ++k)
      if (j == (k + 1) * side / (count + 1) && i < (k + 3) * side / (count + 4)) return k;
    return no_index;
  }
  Index side, cells;
  QuadraticForm<K> form;
};

}  // namespace

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

TEMPLATE_TEST_CASE("solver: multigrid obeys the laws with levels of its own on small systems", "[solver]", float,
                   double, std::complex<float>, std::complex<double>) {
  using K = TestType;
  Context context;
  const Status status = check_solver_backend<K>([] { return MultigridCg<K>({.tolerance = 1e-13, .coarsest = 4}); },
                                                context, 2e4 * std::numeric_limits<real_of<K>>::epsilon());
  INFO((status.ok() ? std::string() : status.error().message()));
  CHECK(status.ok());
}

TEMPLATE_TEST_CASE("solver: multigrid takes as many iterations on a large surface as on a small one", "[solver]",
                   double, std::complex<float>, std::complex<double>) {
  using K = TestType;
  Index fewest = 1000, most = 0;
  for (const Index side : {16, 32, 64, 128}) {
    const Strip<K> strip(side, side, 1e-6);
    Context context;
    MultigridCg<K> solver({.tolerance = 1e-10, .coarsest = 60});
    REQUIRE(solver.factorize(strip.form.matrix(), context).ok());
    CHECK(solver.stored_entries() < 24 * static_cast<std::size_t>(strip.form.matrix().size));
    std::vector<K> x(at(strip.form.matrix().size));
    const SolveInfo info = solver.solve(strip.form.rhs(), x, context);
    REQUIRE(info.status.ok());
    CHECK(info.residual < 1e3 * std::max(1e-10, static_cast<double>(std::numeric_limits<real_of<K>>::epsilon())));
    fewest = std::min(fewest, info.iterations);
    most = std::max(most, info.iterations);
  }
  CHECK(fewest >= 5);
  CHECK(most <= 60);
  CHECK(most <= 2.5 * fewest);
}

TEST_CASE("solver: multigrid's groups follow the strong entries, however many neighbours there are", "[solver]") {
  // A grid whose lines are joined to each other at 0.4 of what joins the unknowns along them.
  constexpr Index side = 30;
  const RowTerm rows{"lines", [](EmitRow<double> emit) {
                       constexpr std::array<double, 2> difference{1, -1};
                       for (Index f = 0; f < side * side; ++f) {
                         if (f % side + 1 < side) emit(Row<double>{std::array<Index, 2>{f, f + 1}, difference, 0, 1});
                         if (f + side < side * side)
                           emit(Row<double>{std::array<Index, 2>{f, f + side}, difference, 0, 0.4});
                         emit(Row<double>{std::array<Index, 1>{f}, std::array<double, 1>{1}, 0, 1e-3});
                       }
                     }};
  QuadraticForm<double> form(side * side);
  REQUIRE(form.assemble(rows).ok());
  const auto groups = quadrig::detail::aggregate(quadrig::detail::full_rows(form.matrix()), {}, 0);
  std::vector<Index> line(at(groups.columns_count), no_index);
  REQUIRE(groups.values.size() == at(side * side));
  for (Index f = 0; f < side * side; ++f) {
    Index& mine = line[at(groups.columns[at(f)])];
    if (mine == no_index) mine = f / side;
    CHECK(mine == f / side);
  }
}

TEMPLATE_TEST_CASE("solver: multigrid solves where values jump along cuts by shared unknowns, at any size", "[solver]",
                   double, std::complex<float>, std::complex<double>) {
  using K = TestType;
  Index fewest = 1000, most = 0;
  for (const Index side : {40, 80, 160}) {
    const Cuts<K> cuts(side, 1e-4);
    const auto A = cuts.form.matrix();
    Context context;
    MultigridCg<K> solver({.tolerance = 1e-10, .coarsest = 60});
    REQUIRE(solver.factorize(A, context).ok());
    CHECK(solver.description().find(", 5 long rows") != std::string::npos);
    std::vector<K> x(at(A.size)), again(x.size());
    const SolveInfo info = solver.solve(cuts.form.rhs(), x, context);
    INFO((info.status.ok() ? std::string() : info.status.error().message()));
    REQUIRE(info.status.ok());
    CHECK(relative_residual<K>(A, x, cuts.form.rhs()) <
          1e3 * std::max(1e-10, static_cast<double>(std::numeric_limits<real_of<K>>::epsilon())));
    context.threads = 3;
    REQUIRE(solver.solve(cuts.form.rhs(), again, context).status.ok());
    CHECK(x == again);
    fewest = std::min(fewest, info.iterations);
    most = std::max(most, info.iterations);
  }
  CHECK(fewest >= 5);
  CHECK(most <= 30);
}

TEST_CASE("solver: multigrid's groups end where values jump", "[solver]") {
  const Cuts<double> cuts(40);
  const auto full = quadrig::detail::full_rows(cuts.form.matrix());
  std::vector<Index> found = quadrig::detail::long_rows(full, 100);
  CHECK(quadrig::detail::long_rows(full, 2).size() == 2);
  std::sort(found.begin(), found.end());
  REQUIRE(found.size() == at(Cuts<double>::count));
  std::vector<char> kept(at(full.size()), 0);
  for (Index k = 0; k < Cuts<double>::count; ++k) {
    CHECK(found[at(k)] == cuts.cells + k);
    kept[at(cuts.cells + k)] = 1;
  }
  const auto groups = quadrig::detail::aggregate(full, kept, 0);
  const auto group = [&](Index i) {
    return groups.starts[at(i)] == groups.starts[at(i) + 1] ? no_index : groups.columns[groups.starts[at(i)]];
  };
  for (Index k = 0; k < Cuts<double>::count; ++k)
    CHECK(group(cuts.cells + k) == groups.columns_count - Cuts<double>::count + k);
  Index grouped = 0;
  for (Index f = 0; f + 1 < cuts.cells; ++f) {
    grouped += group(f) != no_index;
    if (cuts.cut(f) != no_index) CHECK((group(f) == no_index || group(f) != group(f + 1)));
  }
  CHECK(grouped > cuts.cells * 9 / 10);
}

TEST_CASE("solver: multigrid keeps its levels in double where floats cannot hold them", "[solver]") {
  Context context;
  for (const auto& [pull, levels] :
       {std::pair{1e-4, "multigrid, 3 levels"}, {1e-12, "multigrid, 3 levels in double"}}) {
    const Index side = 100;
    const RowTerm rows{"grid", [pull = pull](EmitRow<double> emit) {
                         detail::LawNumbers<double> numbers(3);
                         const std::array<double, 2> difference{1, -1};
                         for (Index f = 0; f < side * side; ++f) {
                           if (f % side + 1 < side)
                             emit(Row<double>{std::array<Index, 2>{f, f + 1}, difference, numbers.number(), 1});
                           if (f + side < side * side)
                             emit(Row<double>{std::array<Index, 2>{f, f + side}, difference, numbers.number(), 1});
                           emit(Row<double>{std::array<Index, 1>{f}, std::array<double, 1>{1}, numbers.number(), pull});
                         }
                       }};
    QuadraticForm<double> form(side * side);
    REQUIRE(form.assemble(rows).ok());
    MultigridCg<double> solver;
    REQUIRE(solver.factorize(form.matrix(), context).ok());
    std::vector<double> x(at(side * side)), again(x.size());
    for (const auto& each : {std::span(x), std::span(again)}) {
      const SolveInfo info = solver.solve(form.rhs(), each, context);
      REQUIRE(info.status.ok());
      CHECK(info.residual < 1e-9);
    }
    CHECK(solver.description() == levels);
    CHECK(x == again);
  }
}

TEST_CASE("solver: the automatic choice is direct while the factor fits, and tells", "[solver]") {
  const Strip<Complex> strip(30, 30);
  const auto A = strip.form.matrix();
  Context context;
  std::vector<Complex> x(at(A.size));
  for (const auto& [bytes, wanted] :
       {std::pair{8e9, "automatic: supernodal, minimum degree"}, {1e5, "automatic: multigrid, 2 levels"}}) {
    AutomaticSolver<Complex> solver({.factor_bytes = bytes});
    CHECK(solver.description() == "automatic");
    REQUIRE(solver.analyze(A, {}, context).ok());
    REQUIRE(solver.factorize(A, context).ok());
    CHECK(solver.description() == wanted);
    CHECK(solver.elimination_order().empty() == (bytes < 1e6));
    REQUIRE(solver.solve(strip.form.rhs(), x, context).status.ok());
    CHECK(relative_residual<Complex>(A, x, strip.form.rhs()) < 1e-11);
  }
}

TEST_CASE("solver: mixed precision where asked, for systems in double alone", "[solver]") {
  const Strip<Complex> strip(30, 30);
  const Strip<std::complex<float>> single(30, 30);
  Context context;
  for (const auto& [from, wanted] : {std::pair{1800, "automatic: supernodal-mixed, minimum degree"},
                                     {1801, "automatic: supernodal, minimum degree"}}) {
    AutomaticSolver<Complex> solver({.mixed_from = from});
    REQUIRE(solver.analyze(strip.form.matrix(), {}, context).ok());
    CHECK(solver.description() == wanted);
    CHECK(solver.elimination_order().size() == 1800);
    REQUIRE(solver.factorize(strip.form.matrix(), context).ok());
    std::vector<Complex> x(1800);
    const SolveInfo info = solver.solve(strip.form.rhs(), x, context);
    REQUIRE(info.status.ok());
    CHECK(info.residual < 1e-12);
    CHECK((info.iterations > 0) == (from == 1800));
  }
  AutomaticSolver<std::complex<float>> floats({.mixed_from = 1});
  REQUIRE(floats.analyze(single.form.matrix(), {}, context).ok());
  CHECK(floats.description() == "automatic: supernodal, minimum degree");
}

TEMPLATE_TEST_CASE("solver: where the factor in single precision is not enough, one in double is made", "[solver]",
                   double, std::complex<double>) {
  using K = TestType;
  Context context;
  for (const auto& [pull, in_double] : {std::pair{1e-4, false}, {1e-9, true}}) {
    constexpr Index size = 60;
    const RowTerm rows{"pairs", [pull = pull](EmitRow<K> emit) {
                         detail::LawNumbers<K> numbers(3);
                         const std::array<K, 2> difference{K(1), K(-1)};
                         for (Index f = 0; f < size; f += 2)
                           emit(Row<K>{std::array<Index, 2>{f, f + 1}, difference, numbers.number(), 1});
                         for (Index f = 0; f < size; ++f)
                           emit(Row<K>{std::array<Index, 1>{f}, std::array<K, 1>{K(1)}, numbers.number(), pull});
                       }};
    QuadraticForm<K> form(size);
    REQUIRE(form.assemble(rows).ok());
    const auto A = form.matrix();
    MixedCholesky<K> solver;
    SupernodalCholesky<K> direct;
    std::vector<K> x(at(A.size)), wanted(x.size());
    for (int round = 0; round < 2; ++round) {  // what one matrix needed is not what the next needs
      REQUIRE(solver.analyze(A, {}, context).ok());
      REQUIRE(solver.factorize(A, context).ok());
      const SolveInfo info = solver.solve(form.rhs(), x, context);
      REQUIRE(info.status.ok());
      CHECK(info.residual < 1e-9);
      CHECK(solver.description() == std::string("supernodal-mixed, minimum degree") + (in_double ? ", in double" : ""));
    }
    REQUIRE(direct.analyze(A, {}, context).ok());
    REQUIRE(direct.factorize(A, context).ok());
    REQUIRE(direct.solve(form.rhs(), wanted, context).status.ok());
    if (in_double) CHECK((x == wanted));
  }
}

TEMPLATE_TEST_CASE("solver: mixed precision takes numbers that no float can hold", "[solver]", double,
                   std::complex<double>) {
  using K = TestType;
  const Strip<K> strip(40, 40);
  const auto A = strip.form.matrix();
  HermitianMatrix<K> scaled{A.size,
                            {A.column_starts.begin(), A.column_starts.end()},
                            {A.rows.begin(), A.rows.end()},
                            {A.values.begin(), A.values.end()}};
  std::vector<K> b(strip.form.rhs().begin(), strip.form.rhs().end()), x(b.size()), wanted(b.size());
  const auto scale = [](Index i) { return std::pow(10.0, -60 + i % 7); };
  for (Index j = 0; j < A.size; ++j) {
    b[at(j)] *= scale(j);
    for (Index e = A.column_starts[at(j)]; e < A.column_starts[at(j) + 1]; ++e)
      scaled.values[at(e)] *= scale(j) * scale(A.rows[at(e)]);
  }
  Context context;
  auto mixed = make_solver<K>("supernodal-mixed").value(), direct = make_solver<K>("supernodal").value();
  for (auto [solver, solution] : {std::pair(&mixed, &x), {&direct, &wanted}}) {
    REQUIRE(solver->analyze(scaled.view(), {}, context).ok());
    REQUIRE(solver->factorize(scaled.view(), context).ok());
    REQUIRE(solver->solve(b, *solution, context).status.ok());
  }
  CHECK(mixed.description() == "supernodal-mixed, minimum degree");
  double worst = 0, largest = 0;
  for (Index i = 0; i < A.size; ++i) {
    worst = std::max(worst, std::abs(x[at(i)] - wanted[at(i)]) * scale(i));
    largest = std::max(largest, std::abs(wanted[at(i)]) * scale(i));
  }
  CHECK(worst < 1e-9 * largest);
}

TEMPLATE_TEST_CASE("solver: a guess is improved to the tolerance asked, or solved for where a backend does not iterate",
                   "[solver]", double, std::complex<double>) {
  using K = TestType;
  const Strip<K> strip(60, 60, 1e-3);
  const auto A = strip.form.matrix();
  const auto b = strip.form.rhs();
  for (const std::string_view name : solver_names()) {
    if (!solver_built<K>(name)) continue;
    INFO(name);
    Context context;
    auto solver = make_solver<K>(name).value();
    REQUIRE(solver.analyze(A, {}, context).ok());
    REQUIRE(solver.factorize(A, context).ok());
    std::vector<K> x(at(A.size)), near(x.size()), zero(x.size());
    const SolveInfo whole = solver.solve(b, x, context), some = solver.improve(b, zero, 1e-3, context);
    near = x;
    for (K& each : near) each *= 1 + 1e-3;
    const SolveInfo less = solver.improve(b, near, 1e-5, context);
    std::vector<K> again = x;
    const SolveInfo none = solver.improve(b, again, 1e-9, context);
    REQUIRE((whole.status.ok() && some.status.ok() && less.status.ok() && none.status.ok()));
    CHECK(relative_residual<K>(A, zero, b) < 1e-3);
    CHECK(relative_residual<K>(A, near, b) < 1e-5);
    CHECK(less.residual == Approx(relative_residual<K>(A, near, b)).epsilon(1e-3).margin(1e-14));
    CHECK(again == x);
    CHECK(none.iterations == 0);
    if (whole.iterations > 0) {
      CHECK(some.iterations < whole.iterations);
      CHECK(less.iterations < whole.iterations);
      CHECK(relative_residual<K>(A, near, b) > 1e-12);
    }
    const std::vector<K> nothing(x.size());
    REQUIRE(solver.improve(nothing, again, 1e-6, context).status.ok());
    CHECK(again == nothing);
  }
}

TEST_CASE("solver: an iteration that does not end is an error", "[solver]") {
  const Strip<Complex> strip(30, 30, 1e-6);
  Context context;
  MultigridCg<Complex> solver({.max_iterations = 2, .coarsest = 60});
  REQUIRE(solver.factorize(strip.form.matrix(), context).ok());
  std::vector<Complex> x(at(strip.form.matrix().size));
  const SolveInfo info = solver.solve(strip.form.rhs(), x, context);
  REQUIRE(!info.status.ok());
  CHECK(info.status.error().code == ErrorCode::numeric);
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
  const auto apart = make_solver<Complex>("petsc");
  REQUIRE_FALSE(apart);
  CHECK(apart.error().code == ErrorCode::unsupported);
  CHECK(apart.error().remedy.find("PetscCg") != std::string::npos);
  const auto unknown = make_solver<double>("eigan");
  REQUIRE(!unknown);
  CHECK(unknown.error().code == ErrorCode::bad_option);
  CHECK(unknown.error().remedy.find("eigen") != std::string::npos);
  const auto unordered = make_solver<double>("supernodal/alphabetical");
  REQUIRE(!unordered);
  CHECK(unordered.error().code == ErrorCode::bad_option);
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
  for (const std::string_view name : {"supernodal", "eigen", "supernodal/dissection", "eigen/dissection"}) {
    INFO(name);
    auto solver = make_solver<K>(name);
    Context context;
    form.release(2);
    REQUIRE(form.assemble(springs).ok());
    const Status status = solver->prepare(form.matrix(), form.pattern_version(), context);
    REQUIRE(!status.ok());
    CHECK(status.error().code == ErrorCode::numeric);
    CHECK(status.error().where == "solver " + std::string(solver->name()) + ", unknown 2");

    form.fix(2, K(7));
    REQUIRE(form.assemble(springs).ok());
    REQUIRE(solver->prepare(form.matrix(), form.pattern_version(), context).ok());
    std::vector<K> x(4);
    REQUIRE(solver->solve(form.rhs(), x, context).status.ok());
    const std::vector<K> z = form.expand(x);
    const std::array<K, 5> wanted{K(2), K(1), K(7), K(0), K(-1)};
    for (std::size_t i = 0; i < z.size(); ++i) CHECK(std::abs(z[i] - wanted[i]) < 1e-12);
  }
}

TEST_CASE("solver: a copy has the analysis and numbers of its own", "[solver]") {
  for (const std::string_view name : {"supernodal", "eigen"}) {
    const detail::LawSystem<Complex> system(50, 3);
    const auto A = system.matrix(1), B = system.matrix(2);
    Context context;
    auto first = make_solver<Complex>(name).value();
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
}

TEST_CASE("solver: an order that is no permutation is refused", "[solver]") {
  const detail::LawSystem<double> system(6, 3);
  const auto A = system.matrix(1);
  Context context;
  for (const std::string_view name : solver_names()) {
    if (!solver_built<double>(name)) continue;
    INFO(name);
    auto solver = make_solver<double>(name).value();
    for (const std::vector<Index>& order :
         {std::vector<Index>{0, 1, 2}, {0, 1, 2, 3, 4, 4}, {0, 1, 2, 3, 4, 6}, {-1, 1, 2, 3, 4, 5}})
      CHECK(!solver.analyze(A.view(), order, context).ok());
  }
}

TEMPLATE_TEST_CASE("solver: orderings change nothing but time, at any size", "[solver]", double, std::complex<float>) {
  using K = TestType;
  for (const Index side : {1, 3, 9, 30, 70}) {
    const Strip<K> strip(side, 2 * side);
    const auto A = strip.form.matrix();
    std::vector<K> reference(at(A.size)), x(reference.size());
    Context context;
    for (const std::string_view name : {"eigen/minimum-degree", "eigen/dissection", "supernodal/minimum-degree",
                                        "supernodal/dissection", "supernodal"}) {
      INFO(name << ", " << A.size << " unknowns");
      auto solver = make_solver<K>(name).value();
      REQUIRE(solver.analyze(A, {}, context).ok());
      REQUIRE(solver.factorize(A, context).ok());
      const SolveInfo info = solver.solve(strip.form.rhs(), x, context);
      REQUIRE(info.status.ok());
      CHECK(info.residual < 100 * std::numeric_limits<real_of<K>>::epsilon());
      CHECK(relative_residual<K>(A, x, strip.form.rhs()) < 100 * std::numeric_limits<real_of<K>>::epsilon());
      if (name == "eigen/minimum-degree") reference = x;
      double worst = 0;
      for (std::size_t i = 0; i < x.size(); ++i)
        worst = std::max(worst, static_cast<double>(std::abs(x[i] - reference[i])));
      CHECK(worst < 1e4 * std::numeric_limits<real_of<K>>::epsilon());
    }
  }
}

TEMPLATE_TEST_CASE("solver: our own give the same bits at any number of threads", "[solver]", float, double,
                   std::complex<float>, std::complex<double>) {
  using K = TestType;
  const Strip<K> strip(100, 170);
  const auto A = strip.form.matrix();
  std::vector<K> first(at(A.size)), x(first.size());
  for (const std::string_view name :
       {"supernodal/dissection", "supernodal/minimum-degree", "supernodal-mixed", "multigrid"})
    for (const unsigned threads : {1u, 2u, 3u, 7u}) {
      INFO(name << ", " << threads << " threads");
      Context context;
      context.threads = threads;
      auto solver = make_solver<K>(name).value();
      REQUIRE(solver.analyze(A, {}, context).ok());
      REQUIRE(solver.factorize(A, context).ok());
      REQUIRE(solver.solve(strip.form.rhs(), x, context).status.ok());
      if (threads == 1) first = x;
      CHECK(x == first);
    }
}

TEMPLATE_TEST_CASE("solver: subtrees side by side find the solution, with the same bits at any number of threads",
                   "[solver]", float, double, std::complex<float>, std::complex<double>) {
  using K = TestType;
  using Real = real_of<K>;
  for (const Index along : {1, 7, 60, 200}) {  // one front, a few, and more than are shared out at a time
    const Strip<K> strip(60, along);
    const auto A = strip.form.matrix();
    const auto b = strip.form.rhs();
    std::vector<K> in_a_row(b.size()), first;
    Context context;
    context.threads = 1;
    SupernodalCholesky<K> direct;
    REQUIRE(direct.analyze(A, {}, context).ok());
    REQUIRE(direct.factorize(A, context).ok());
    direct.substitute(b, in_a_row, &context);
    for (const unsigned threads : {1u, 2u, 3u, 7u}) {
      INFO(along << " along, " << threads << " threads");
      context.threads = threads;
      SupernodalCholesky<K> by_tree(Ordering::automatic, 0, 0);
      REQUIRE(by_tree.analyze(A, {}, context).ok());
      REQUIRE(by_tree.factorize(A, context).ok());
      std::vector<K> x(b.size());
      by_tree.substitute(b, x, &context);
      if (threads == 1) first = x;
      CHECK((x == first));
      CHECK(relative_residual<K>(A, x, b) < 1000 * std::numeric_limits<Real>::epsilon());
      double worst = 0, largest = 0;
      for (std::size_t i = 0; i < x.size(); ++i) {
        worst = std::max(worst, static_cast<double>(std::abs(x[i] - in_a_row[i])));
        largest = std::max(largest, static_cast<double>(std::abs(x[i])));
      }
      CHECK(worst < 1000 * static_cast<double>(std::numeric_limits<Real>::epsilon()) * largest);
    }
    std::vector<K> alone(b.size());
    SupernodalCholesky<K> by_tree(Ordering::automatic, 0, 0);
    REQUIRE(by_tree.analyze(A, {}, context).ok());
    REQUIRE(by_tree.factorize(A, context).ok());
    by_tree.substitute(b, alone);
    CHECK((alone == first));
  }
}

TEST_CASE("solver: subtrees that are cancelled end soundly, wherever it happens", "[solver]") {
  const Strip<Complex> strip(60, 200);
  const auto A = strip.form.matrix();
  const auto b = strip.form.rhs();
  for (const unsigned threads : {1u, 3u}) {
    Context context;
    context.threads = threads;
    SupernodalCholesky<Complex> solver(Ordering::automatic, 0, 0);
    REQUIRE(solver.analyze(A, {}, context).ok());
    REQUIRE(solver.factorize(A, context).ok());
    std::vector<Complex> x(b.size()), wanted(b.size());
    REQUIRE(solver.solve(b, wanted, context).status.ok());
    std::atomic<int> polls{0};
    int most = 0;
    context.on_poll = [&] { return ++polls > most; };
    SolveInfo info;
    int cancelled = 0;
    for (most = 0; most < 10000; ++most) {
      polls = 0;
      info = solver.solve(b, x, context);
      if (info.status.ok()) break;
      CHECK(info.status.error().code == ErrorCode::cancelled);
      ++cancelled;
    }
    CHECK(cancelled > 10);
    CHECK(info.status.ok());
    CHECK((x == wanted));
  }
}

TEST_CASE("solver: of several pivots that fail the first is named, at any number of threads", "[solver]") {
  const Strip<double> strip(60, 200);
  const auto A = strip.form.matrix();
  HermitianMatrix<double> broken{A.size,
                                 {A.column_starts.begin(), A.column_starts.end()},
                                 {A.rows.begin(), A.rows.end()},
                                 {A.values.begin(), A.values.end()}};
  for (Index j = 100; j < A.size; j += 997) broken.values[at(A.column_starts[at(j)])] = -1;
  std::string first;
  for (const unsigned threads : {1u, 2u, 3u, 7u}) {
    Context context;
    context.threads = threads;
    SupernodalCholesky<double> solver;
    REQUIRE(solver.analyze(A, {}, context).ok());
    const Status status = solver.factorize(broken.view(), context);
    REQUIRE(!status.ok());
    CHECK(status.error().code == ErrorCode::numeric);
    if (threads == 1) first = status.error().message();
    CHECK(status.error().message() == first);
  }
}

TEST_CASE("solver: rows in the order of elimination are those of the matrix", "[solver]") {
  const Strip<Complex> strip(9, 11);
  const auto A = strip.form.matrix();
  std::vector<Index> order(at(A.size));
  for (Index k = 0; k < A.size; ++k) order[at(k)] = (k * 67 + 5) % A.size;
  Context context;
  detail::OrderedRows<Complex> rows;
  rows.analyze(A, order, context);
  rows.fill(A.values, context);
  std::vector<Complex> x(order.size()), ordered(x.size()), product(x.size());
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] = Complex(1.0 + static_cast<double>(i % 7), static_cast<double>(i % 5));
  for (std::size_t k = 0; k < x.size(); ++k) ordered[k] = x[at(order[k])];
  multiply<Complex>(A, x, product);
  for (std::size_t k = 0; k < x.size(); ++k)
    CHECK(std::abs(rows.row_times(k, ordered) - product[at(order[k])]) < 1e-12);
  CHECK(std::ranges::equal(rows.given_values(), A.values));
}

TEMPLATE_TEST_CASE("solver: several right-hand sides at once have the bits of one by one, at any number of threads",
                   "[solver]", double, std::complex<float>) {
  using K = TestType;
  const Strip<K> strip(30, 40);
  const auto A = strip.form.matrix();
  constexpr Index count = 5;
  detail::LawNumbers<K> numbers(17);
  std::vector<K> b(at(A.size * count)), x(b.size()), wanted(b.size());
  for (K& each : b) each = numbers.number();
  for (const std::string_view name : solver_names()) {
    if (!solver_built<K>(name)) continue;
    INFO(name);
    Context context;
    auto solver = make_solver<K>(name).value();
    REQUIRE(solver.analyze(A, {}, context).ok());
    REQUIRE(solver.factorize(A, context).ok());
    for (Index k = 0; k < count; ++k)
      REQUIRE(solver
                  .solve(std::span<const K>(b).subspan(at(k * A.size), at(A.size)),
                         std::span<K>(wanted).subspan(at(k * A.size), at(A.size)), context)
                  .status.ok());
    for (const unsigned threads : {1u, 2u, 7u}) {
      context.threads = threads;
      std::fill(x.begin(), x.end(), K{});
      const SolveInfo info = solver.solve_all(b, x, count, context);
      REQUIRE(info.status.ok());
      CHECK(info.residual < 1e4 * std::numeric_limits<real_of<K>>::epsilon());
      CHECK(x == wanted);
    }
    b[at(3 * A.size)] = K(std::numeric_limits<real_of<K>>::quiet_NaN());
    CHECK(!solver.solve_all(b, x, count, context).status.ok());
    b[at(3 * A.size)] = K(1);
  }
}

TEST_CASE("ordering: a permutation, the same at any number of threads, of any pattern", "[solver]") {
  const auto check = [](const HermitianView<double>& A) {
    Context one, many;
    one.threads = 1;
    many.threads = 5;
    const auto dissect = [&](Context& context) {
      return nested_dissection(A.size, A.column_starts, A.rows, {}, context);
    };
    std::vector<Index> order = dissect(one);
    CHECK(order == dissect(many));
    std::sort(order.begin(), order.end());
    bool permutation = order.size() == at(A.size);
    for (std::size_t i = 0; permutation && i < order.size(); ++i) permutation = order[i] == static_cast<Index>(i);
    CHECK(permutation);
  };
  for (const Index side : {1, 7, 40, 130}) check(Strip<double>(side, side).form.matrix());
  check(Strip<double>(3, 5000).form.matrix());  // long
  for (const int kind : {0, 1, 2, 3}) {
    INFO(kind);
    constexpr Index n = 4000;
    const RowTerm rows{"pairs", [&](EmitRow<double> emit) {
                         const std::array<double, 2> both{1, -0.5};
                         detail::LawNumbers<double> numbers(5);
                         for (Index i = 0; i < n; ++i) {
                           const std::array<Index, 1> at_i{i};
                           emit(Row<double>{at_i, std::span(both).first(1), 0.0, 1.0});
                           if (kind == 1 && i > 0) emit(Row<double>{std::array<Index, 2>{0, i}, both, 0.0, 1.0});
                           if (kind == 2 && i % 5 != 0)
                             emit(Row<double>{std::array<Index, 2>{i - 1, i}, both, 0.0, 1.0});
                           if (kind == 3) {
                             const Index a = numbers.below(n), b = numbers.below(n);
                             if (a != b) emit(Row<double>{std::array<Index, 2>{a, b}, both, 0.0, 1.0});
                           }
                         }
                       }};  // alone, a star, many chains, at random
    QuadraticForm<double> form(n);
    REQUIRE(form.assemble(rows).ok());
    check(form.matrix());
    Context context;
    auto solver = make_solver<double>("supernodal/dissection").value();
    REQUIRE(solver.analyze(form.matrix(), {}, context).ok());
    REQUIRE(solver.factorize(form.matrix(), context).ok());
    const std::vector<double> b(n, 1.0);
    std::vector<double> x(n);
    REQUIRE(solver.solve(b, x, context).status.ok());
    CHECK(relative_residual<double>(form.matrix(), x, b) < 1e-11);
  }
}

TEST_CASE("ordering: counts are those of the factor, and dissection is as good as minimum degree", "[solver]") {
  const Strip<Complex> small(6, 9), large(120, 120);
  Context context;
  for (const Ordering ordering : {Ordering::minimum_degree, Ordering::nested_dissection}) {
    // The factor's entries, one by one.
    const auto A = small.form.matrix();
    const EliminationOrder found = elimination_order(A.size, A.column_starts, A.rows, ordering, context);
    std::vector<std::vector<char>> filled(at(A.size), std::vector<char>(at(A.size), 0));
    std::vector<Index> position(at(A.size));
    for (std::size_t k = 0; k < position.size(); ++k) position[at(found.unknowns[k])] = static_cast<Index>(k);
    for (Index j = 0; j < A.size; ++j)
      for (Index e = A.column_starts[at(j)]; e < A.column_starts[at(j) + 1]; ++e) {
        const Index p = position[at(A.rows[at(e)])], q = position[at(j)];
        filled[at(std::min(p, q))][at(std::max(p, q))] = 1;
      }
    double multiplications = 0;
    for (std::size_t k = 0; k < filled.size(); ++k) {
      double entries = 0;
      for (std::size_t i = k + 1; i < filled.size(); ++i) {
        if (!filled[k][i]) continue;
        ++entries;
        for (std::size_t j = i; j < filled.size(); ++j)
          if (filled[k][j]) filled[i][j] = 1;
      }
      multiplications += entries * (entries + 1) / 2;
    }
    CHECK(found.multiplications == multiplications);
  }
  const auto A = large.form.matrix();
  const auto work = [&](Ordering ordering) {
    return elimination_order(A.size, A.column_starts, A.rows, ordering, context).multiplications;
  };
  CHECK(work(Ordering::nested_dissection) < 1.25 * work(Ordering::minimum_degree));
  // Leaves by minimum degree see what lies around them: their size hardly matters.
  detail::SymbolicBuilder builder(A.size, A.column_starts, A.rows);
  const auto leaves = [&](Index leaf) {
    std::vector<Index> order = nested_dissection(A.size, A.column_starts, A.rows, {.leaf = leaf}, context);
    const double multiplications = builder.multiplications(order);
    std::sort(order.begin(), order.end());
    for (std::size_t i = 0; i < order.size(); ++i) REQUIRE(order[i] == static_cast<Index>(i));
    return multiplications;
  };
  const double usual = leaves(160);
  CHECK(usual == leaves(0));
  for (const Index leaf : {700, 3000}) CHECK(leaves(leaf) < 1.25 * usual);
  CHECK(work(Ordering::automatic) <= work(Ordering::minimum_degree));
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
