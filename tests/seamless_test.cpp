#include "map_shapes.hpp"
#include "quadrig/field/surgery.hpp"
#include "test.hpp"

#include <Eigen/LU>

using namespace quadrig;
using namespace quadrig::test;

namespace {

using Z = std::int64_t;

template <class R>
R random_coefficient(Random& random, int size);
template <>
Z random_coefficient<Z>(Random& random, int size) {
  return static_cast<Z>(std::floor(random.number(-size, size + 1)));
}
template <>
Gaussian random_coefficient<Gaussian>(Random& random, int size) {
  return {random_coefficient<Z>(random, size), random_coefficient<Z>(random, size)};
}

template <class R>
LinearExpression<R> random_row(Random& random, Index variables, int terms, int size) {
  LinearExpression<R> row;
  for (int k = 0; k < terms; ++k) {
    const R c = random_coefficient<R>(random, size);
    const auto v = static_cast<Index>(random.number(0, variables));
    if (!ring_zero(c)) accumulate(row, LinearExpression<R>{{v, c}}, one_of(R{}));
  }
  return row;
}

template <class R>
using FieldOf = decltype(to_field(R{}));
template <class R>
using Dense = Eigen::Matrix<FieldOf<R>, Eigen::Dynamic, Eigen::Dynamic>;

/// Rows over n variables, eliminated; columns of the result express the n variables in those that remain.
template <class R>
struct Solved {
  Dense<R> rows, basis;
};
template <class R>
Solved<R> eliminate(Random& random, Index n, int row_count, int size) {
  using Kind = typename Elimination<R>::Kind;
  Elimination<R> elimination(std::vector<Kind>(static_cast<std::size_t>(n), Kind::integer));
  Solved<R> out;
  out.rows = Dense<R>::Zero(row_count, n);
  for (int k = 0; k < row_count; ++k) {
    const auto row = random_row<R>(random, n, 4, size);
    for (const auto& [v, c] : row) out.rows(k, v) = to_field(c);
    REQUIRE(elimination.add(row));
  }
  std::vector<LinearExpression<R>> expressions;
  for (Index v = 0; v < n; ++v) expressions.push_back(elimination.resolved({{v, one_of(R{})}}));
  std::map<Index, Index> column;
  for (const auto& e : expressions)
    for (const auto& term : e) column.try_emplace(term.variable, static_cast<Index>(column.size()));
  out.basis = Dense<R>::Zero(n, static_cast<Eigen::Index>(column.size()));
  for (Index v = 0; v < n; ++v)
    for (const auto& [w, c] : expressions[static_cast<std::size_t>(v)]) {
      REQUIRE_FALSE(elimination.solved(w));
      out.basis(v, column[w]) = to_field(c);
    }
  return out;
}

}  // namespace

TEMPLATE_TEST_CASE("elimination: what remains spans the dense kernel", "[seamless]", std::int64_t, Gaussian) {
  using R = TestType;
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    const auto n = static_cast<Index>(random.number(2, 9));
    const Solved<R> solved = eliminate<R>(random, n, static_cast<int>(random.number(1, n)), 3);
    REQUIRE((solved.rows * solved.basis).norm() == 0);  // exact: small integers
    const Eigen::FullPivLU<Dense<R>> lu(solved.rows);
    REQUIRE(solved.basis.cols() == n - lu.rank());
    if (solved.basis.cols() == 0) continue;
    // Columns may differ much in size: each is compared at its own.
    const Dense<R> columns = solved.basis.colwise().normalized();
    REQUIRE(Eigen::FullPivLU<Dense<R>>(columns).rank() == columns.cols());
  }
}

TEST_CASE("elimination: every integer solution comes from integers", "[seamless]") {
  Random random(4);
  for (int round = 0; round < 60; ++round) {
    const Solved<Z> solved = eliminate<Z>(random, 4, 2, 4);
    if (solved.basis.cols() == 0) continue;
    const Eigen::MatrixXd normal = solved.basis.transpose() * solved.basis;
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(normal);
    constexpr int reach = 4;
    Eigen::VectorXd x(4);
    for (int code = 0; code < 6561; ++code) {
      int rest = code;
      for (int k = 0; k < 4; ++k, rest /= 9) x[k] = rest % 9 - reach;
      if ((solved.rows * x).norm() != 0) continue;
      const Eigen::VectorXd y = lu.solve(solved.basis.transpose() * x);
      REQUIRE((y - y.array().round().matrix()).norm() < 1e-9);
    }
  }
}

TEST_CASE("elimination: contradictions are told, and fractions refused", "[seamless]") {
  using E = Elimination<Z>;
  using Kind = E::Kind;
  const std::vector<Kind> kinds{Kind::integer, Kind::integer, Kind::constant};
  E one(kinds);
  REQUIRE(one.add({{0, 2}, {2, -4}}));  // 2x = 4
  CHECK(one.resolved({{0, 1}})[0].coefficient == 2);
  CHECK(one.add({{0, 3}, {2, -6}}));        // says nothing new
  CHECK_FALSE(one.add({{0, 1}, {2, -3}}));  // x = 3
  E two(kinds);
  CHECK_FALSE(two.add({{0, 2}, {2, -1}}));  // 2x = 1
  E three(kinds);
  REQUIRE(three.add({{0, 6}, {1, 4}, {2, -2}}));  // 3x + 2y = 1 has integer solutions
  CHECK_FALSE(E(kinds).add({{0, 6}, {1, 4}, {2, -3}}));
  E four({Kind::free, Kind::integer});
  REQUIRE(four.add({{0, 1}, {1, 1}}));
  CHECK(four.solved(0));  // the free one goes first
  CHECK_FALSE(four.solved(1));
}

TEST_CASE("gaussian: quotients leave a smaller remainder and gcds divide", "[seamless]") {
  Random random(5);
  for (int k = 0; k < 2000; ++k) {
    const Gaussian a = random_coefficient<Gaussian>(random, 50);
    Gaussian b = random_coefficient<Gaussian>(random, 20);
    if (ring_zero(b)) b = {1, 0};
    const Gaussian r = a - ring_quotient(a, b) * b;
    REQUIRE(ring_norm(r) < ring_norm(b));
    const Gaussian g = ring_gcd(a, b);
    REQUIRE(ring_zero(a - ring_quotient(a, g) * g));
    REQUIRE(ring_zero(b - ring_quotient(b, g) * g));
    REQUIRE(rotated(a, 3) == rotated(a, -1));
    REQUIRE(rotated(rotated(a, 1), 3) == a);
  }
}

TEST_CASE("seamless: integer unknowns are 2 S + 4 g - 4 when charts turn", "[seamless]") {
  const int which = GENERATE(0, 1, 2);
  const std::uint64_t seed = GENERATE(0U, 1U, 2U);
  const FieldCase c = field_case(closed_surface(which), seed, 0.15);
  const auto unknowns = MapUnknowns<Complex>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  const auto integers = 2 * std::count(unknowns.integer().begin(), unknowns.integer().end(), char{1});
  const bool turns = std::any_of(c.cut.rotation.begin(), c.cut.rotation.end(), [](auto r) { return r != 0; });
  const Index genus = which;
  CHECK(integers == (turns ? 2 * c.singular_count() + 4 * genus - 4 : 4 * genus));
  // The same count in the ring of integers, coordinate by coordinate.
  const auto scalar = MapUnknowns<double>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  CHECK(std::count(scalar.integer().begin(), scalar.integer().end(), char{1}) == integers);
}

namespace {

/// Any unknowns give a map whose transitions are one quarter-turn and translation a branch.
template <class K>
void check_transitions(const FieldCase& c, std::uint64_t seed) {
  const auto unknowns = MapUnknowns<K>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  Random random(seed);
  std::vector<K> x;
  bool whole = seed % 2 == 0;
  for (Index k = 0; k < unknowns.count(); ++k) {
    const auto draw = [&] { return whole ? std::floor(random.number(-9, 10)) : random.number(-9, 9); };
    if constexpr (std::is_same_v<K, Complex>)
      x.push_back({draw(), draw()});
    else
      x.push_back(draw());
  }
  const std::vector<Complex> z = unknowns.corners(x);
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  std::vector<std::optional<Complex>> translation(at(c.cut.branch_count));
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Index g = c.mesh.twin(h);
    if (g == no_index) continue;
    const int r = c.cut.rotation[at(h)];
    REQUIRE(((r + c.cut.rotation[at(g)]) & 3) == 0);
    const Complex t = z[at(g)] - rotated(z[at(c.mesh.next(h))], r);
    REQUIRE(std::abs(z[at(c.mesh.next(g))] - rotated(z[at(h)], r) - t) < 1e-9);
    const Index b = c.cut.branch[at(h)];
    if (b == no_index) {
      REQUIRE(r == 0);
      REQUIRE(std::abs(t) < 1e-9);
    } else if (c.cut.forward[at(h)]) {
      if (!translation[at(b)]) translation[at(b)] = t;
      REQUIRE(std::abs(*translation[at(b)] - t) < 1e-9);
      if (whole) REQUIRE(std::abs(t - Complex(std::round(t.real()), std::round(t.imag()))) < 1e-9);
    }
  }
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Complex e = z[at(c.mesh.next(h))] - z[at(h)];
    if (c.aligned[at(h)] == Aligned::v_constant) REQUIRE(std::abs(e.imag()) < 1e-9);
    if (c.aligned[at(h)] == Aligned::u_constant) REQUIRE(std::abs(e.real()) < 1e-9);
  }
}

}  // namespace

TEST_CASE("seamless: corners satisfy every transition for any unknowns", "[seamless]") {
  const std::uint64_t seed = GENERATE(0U, 1U, 2U, 3U);
  for (int which = 0; which < 3; ++which) {
    const FieldCase closed = field_case(closed_surface(which), seed, 0.15);
    check_transitions<Complex>(closed, seed);
    check_transitions<double>(closed, seed);
    const FieldCase open = field_case(open_surface(which), seed, 0.1);
    check_transitions<double>(open, seed);
  }
}

TEST_CASE("seamless: a valid map has cones of 4 - I4 that sum to the surface's", "[seamless]") {
  const int which = GENERATE(0, 1, 2, 3, 4, 5);
  const FieldCase c = field_case(which < 3 ? closed_surface(which) : open_surface(which - 3), 0, 0.12);
  REQUIRE(mappable(c));
  std::vector<Complex> z;
  bool valid = false;
  if (c.pinned) {
    auto map = seamless_case<double>(c);
    z = map.z;
    valid = map.valid;
  } else {
    auto map = seamless_case<Complex>(c);
    z = map.z;
    valid = map.valid;
  }
  REQUIRE(valid);
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  std::vector<double> cone(at(c.mesh.vertex_count()), 0);
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Complex e = z[at(c.mesh.next(h))] - z[at(h)], f = z[at(c.mesh.prev(h))] - z[at(h)];
    CHECK(cross(e, f) > 0);
    cone[at(c.mesh.origin(h))] += std::arg(f / e);
  }
  Index sum = 0;
  for (Index v = 0; v < c.mesh.vertex_count(); ++v) {
    const Index i = c.index()[at(v)];
    CHECK(cone[at(v)] / (std::numbers::pi / 2) ==
          quadrig::test::Approx((c.mesh.on_boundary(v) ? 2 : 4) - i).margin(1e-6));
    sum += i;
  }
  CHECK(sum == 4 * euler_characteristic(c.mesh));
}

TEST_CASE("seamless: correcting the lengths brings neighbours nearer and never turns them", "[seamless]") {
  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  Context context;
  const TargetEdges original = target_edges(c.mesh, c.connection, c.cut, c.field.frames.u, c.field.frames.v);
  CHECK(target_area(original) == quadrig::test::Approx(c.mesh.total_area() / (0.12 * 0.12)));
  const double before = target_curl(c.mesh, c.cut.rotation, original).mean;
  const TargetEdges target =
      correct_log_scale(c.mesh, c.cut, c.index(), LogScaleOptions{}, original, context).value().target;
  CHECK(target_curl(c.mesh, c.cut.rotation, target).mean < 0.8 * before);
  // the same field, whatever the charts
  CHECK(field_curl(c.mesh, c.connection, c.field.frames, c.field.matching).mean == quadrig::test::Approx(before));
  for (std::size_t h = 0; h < target.size(); ++h) {
    CHECK(target[h].real() * original[h].real() >= 0);
    CHECK(target[h].imag() * original[h].imag() >= 0);
  }
}

TEST_CASE("seamless: sizes that are the gradient of a map reach it, at every wavelength and resolution", "[seamless]") {
  for (const Index columns : {40, 120}) {
    const Grid grid{columns, columns / 4};
    const double h = 1.0 / columns;
    const TriangleMesh<double> mesh =
        build(grid.positions([&](Index i, Index j) { return Vector3(h * i, h * j, 0); }), grid.triangles());
    const Connection<double> connection(mesh);
    for (const double wavelength : {0.7, 0.35, 0.2}) {
      // |u| = exp(log 2 sin(2 π x / λ)) lines along x, and 1 along y: curl 0.
      const auto wanted = [&](Index f) {
        double x = 0;
        for (int i = 0; i < 3; ++i) x += mesh.position(mesh.faces()(f, i)).x() / 3;
        return std::log(2.0) * std::sin(2 * std::numbers::pi * x / wavelength);
      };
      std::vector<Complex> u, v;
      for (Index f = 0; f < mesh.face_count(); ++f) {
        u.push_back(std::exp(wanted(f)) * connection.to_complex(f, Vector3::UnitX()));
        v.push_back(connection.to_complex(f, Vector3::UnitY()));
      }
      const std::vector<std::int8_t> rotation(quadrig::detail::at(mesh.halfedge_count()), 0);
      const std::vector<Index> index(quadrig::detail::at(mesh.vertex_count()), 0);
      const CutGraph cut = make_cut_graph(mesh, rotation, index);
      const TargetEdges original = target_edges(mesh, connection, cut, u, v);
      Context context;
      LogScaleOptions options;
      options.fidelity = 64;
      const TargetEdges target = correct_log_scale(mesh, cut, index, options, original, context).value().target;
      // what is left of the wanted contrast of log |u|
      double kept = 0, asked = 0;
      for (Index f = 0; f < mesh.face_count(); ++f)
        for (Index e = 3 * f; e < 3 * f + 3; ++e) {
          const Complex was = original[quadrig::detail::at(e)], is = target[quadrig::detail::at(e)];
          if (std::abs(was.real()) < 1e-9) continue;
          kept += wanted(f) * (wanted(f) + std::log(is.real() / was.real()));
          asked += wanted(f) * wanted(f);
        }
      INFO(columns << " columns, wavelength " << wavelength);
      CHECK(kept / asked == quadrig::test::Approx(1).margin(0.01));
    }
  }
}

TEST_CASE("seamless: straightening turns edges less, stretches them more and keeps the map valid", "[seamless]") {
  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  Context context;
  TargetEdges target = target_edges(c.mesh, c.connection, c.cut, c.field.frames.u, c.field.frames.v);
  // Lengths that no map has, so that something has to give.
  for (std::size_t h = 0; h < target.size(); ++h)
    target[h] *= 1 + 0.5 * std::sin(5 * c.mesh.position(c.mesh.faces()(static_cast<Index>(h / 3), 0))[0]);
  const auto unknowns = MapUnknowns<Complex>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  const auto turn_and_stretch = [&](int straightenings, double stretching) {
    PoissonOptions options;
    options.straightenings = straightenings;
    options.stretching = stretching;
    const auto [x, z, report] = solve_poisson<Complex>(c.mesh, unknowns, c.index(), target, options, context).value();
    CHECK(report.defects.valid());
    CHECK(report.straightenings == straightenings);
    double turn = 0, stretch = 0;
    for (std::size_t h = 0; h < z.size(); h += 3) {  // J = map · target⁻¹
      const Complex a = target[h], b = target[h + 1], p = z[h + 1] - z[h], q = z[h + 2] - z[h + 1];
      const double det = cross(a, b);
      const double uu = (p.real() * b.imag() - q.real() * a.imag()) / det;
      const double uv = (q.real() * a.real() - p.real() * b.real()) / det;
      const double vu = (p.imag() * b.imag() - q.imag() * a.imag()) / det;
      const double vv = (q.imag() * a.real() - p.imag() * b.real()) / det;
      turn += det * (uv * uv + vu * vu);
      stretch += det * ((uu - 1) * (uu - 1) + (vv - 1) * (vv - 1));
    }
    return std::pair{turn, stretch};
  };
  const auto [turn, stretch] = turn_and_stretch(0, 0.5);
  const auto [less, more] = turn_and_stretch(3, 1.0 / 3);
  CHECK(less < 0.8 * turn);
  CHECK(more > stretch);
  // With nothing given way it is the same solve again.
  const auto [same, equal] = turn_and_stretch(2, 1);
  CHECK(same == quadrig::test::Approx(turn));
  CHECK(equal == quadrig::test::Approx(stretch));
}

TEST_CASE("seamless: every system is solved by the backend that is asked for", "[seamless]") {
  FieldCase c = field_case(closed_surface(1), 1, 0.12);
  Context context;
  const Error refusal{ErrorCode::unsupported, "not today", "a solver of one's own", {}};
  int made = 0;
  SolverChoice counted("supernodal/dissection");
  counted.own_real = [&] { return ++made, make_solver<double>("eigen"); };
  SolverChoice refused("eigen");
  refused.own_real = [&]() -> Expected<AnySolver<double>> { return refusal; };

  TargetEdges target = target_edges(c.mesh, c.connection, c.cut, c.field.frames.u, c.field.frames.v);
  LogScaleOptions scales;
  scales.solver = counted.factory<double>();
  CHECK(correct_log_scale(c.mesh, c.cut, c.index(), scales, target, context).value().backend == "eigen");
  CHECK(made == 1);
  scales.solver = refused.factory<double>();
  CHECK(correct_log_scale(c.mesh, c.cut, c.index(), scales, target, context).error().what == refusal.what);

  const auto unknowns = MapUnknowns<double>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  PoissonOptions poisson;
  poisson.solver = counted;
  const auto solved = solve_poisson<double>(c.mesh, unknowns, c.index(), target, poisson, context).value();
  CHECK(solved.report.backend == "eigen");
  CHECK(made == 2);
  const auto complex_unknowns = MapUnknowns<Complex>::create(c.mesh, c.cut, c.index(), c.aligned).value();
  CHECK(solve_poisson<Complex>(c.mesh, complex_unknowns, c.index(), target, poisson, context).value().report.backend ==
        "supernodal, nested dissection");
  poisson.solver = refused;
  CHECK(solve_poisson<double>(c.mesh, unknowns, c.index(), target, poisson, context).error().what == refusal.what);

  // A regular vertex thrown far off leaves flips for untangling.
  std::vector<Complex> z = solved.z;
  Index v = 0;
  while (c.index()[quadrig::detail::at(v)] != 0) ++v;
  Index h = c.mesh.outgoing(v);
  const Index start = h;
  do {
    z[quadrig::detail::at(h)] += rotated(Complex(3, 1), c.cut.corner_rotation[quadrig::detail::at(h)]);
    h = c.mesh.next_around(h);
  } while (h != start);
  UntangleOptions untangling;
  untangling.solver = refused.factory<double>();
  CHECK(untangle(c.mesh, c.cut, c.index(), c.aligned, target, untangling, z, context).error().what == refusal.what);
  untangling.solver = counted.factory<double>();
  CHECK(untangle(c.mesh, c.cut, c.index(), c.aligned, target, untangling, z, context).value().report.backend ==
        "eigen");
  CHECK(made >= 3);

  FieldSurgery refusing(c.mesh, c.field, 1, refused.factory<double>());
  CHECK(refusing.apply({}, context).ok());  // nothing to solve
  refusing.move_unit(start);
  CHECK(refusing.apply({}, context).error().what == refusal.what);
  made = 0;
  FieldSurgery surgery(c.mesh, c.field, 1, counted.factory<double>());
  CHECK(surgery.backend() == "");
  surgery.move_unit(start);
  REQUIRE(surgery.apply({}, context).ok());
  CHECK(surgery.backend() == "eigen");
  CHECK(made == 1);
}

TEST_CASE("surgery: pairs that do not even out sizes go, and no others", "[seamless]") {
  const FieldCase c = field_case(closed_surface(1), 1, 0.12);
  Context context;
  ScaleEnergy energy(c.mesh);
  FieldSurgery surgery(c.mesh, c.field);
  const auto index4 = [&]() -> const std::vector<Index>& { return surgery.field().singularities.index4; };
  const auto sum = [&] { return std::accumulate(index4().begin(), index4().end(), Index{0}); };
  const Index whole = sum();
  surgery.cancel_needless(0.5, context);
  CHECK(surgery.cancel_needless(0.5, context) == 0);
  // A pair made by hand on regular vertices side by side varies the sizes, and goes again.
  const double before = energy(index4());
  Index h = 0;
  while (index4()[quadrig::detail::at(c.mesh.origin(h))] != 0 || index4()[quadrig::detail::at(c.mesh.target(h))] != 0)
    ++h;
  surgery.move_unit(h);
  CHECK(energy(index4()) > before);
  CHECK(surgery.cancel_needless(0.5, context) >= 1);
  CHECK(energy(index4()) <= before * (1 + 1e-9));
  CHECK(sum() == whole);
  CHECK(surgery.apply({}, context).ok());
}

TEST_CASE("untangle: without work left nothing is moved", "[seamless]") {
  const FieldCase c = field_case(closed_surface(1), 1, 0.12);
  auto map = seamless_case<Complex>(c);
  REQUIRE(map.valid);
  Index v = 0;
  while (c.index()[quadrig::detail::at(v)] != 0) ++v;
  Index h = c.mesh.outgoing(v);
  const Index start = h;
  do {
    map.z[quadrig::detail::at(h)] += rotated(Complex(30, 10), c.cut.corner_rotation[quadrig::detail::at(h)]);
    h = c.mesh.next_around(h);
  } while (h != start);
  const std::vector<Complex> tangled = map.z;
  Context context;
  const auto untangled = [&](Budget& budget) {
    return untangle(c.mesh, c.cut, c.index(), c.aligned, map.target, UntangleOptions{}, tangled, context, budget)
        .value();
  };
  Budget spent = Budget().lend(Work::untangling, 0);
  const UntangledMap none = untangled(spent);
  CHECK(none.report.work == 0);
  CHECK_FALSE(none.report.defects.valid());
  CHECK(none.z == tangled);
  Budget budget;
  const std::int64_t before = budget.left(Work::untangling);
  const UntangledMap some = untangled(budget);
  CHECK(some.report.work > 0);
  CHECK(before - budget.left(Work::untangling) == some.report.work);
  CHECK(some.report.defects.valid());
}

TEST_CASE("untangle: flips made by hand are undone and transitions kept", "[seamless]") {
  const FieldCase c = field_case(closed_surface(1), 1, 0.12);
  auto map = seamless_case<Complex>(c);
  REQUIRE(map.valid);
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  Random random(9);
  for (int k = 0; k < 12; ++k) {  // regular vertices thrown about
    const auto v = static_cast<Index>(random.number(0, c.mesh.vertex_count()));
    if (c.index()[at(v)] != 0) continue;
    const Complex move = std::polar(2.0, random.number(0, 6.28));
    Index h = c.mesh.outgoing(v);
    const Index start = h;
    do {
      map.z[at(h)] += rotated(move, c.cut.corner_rotation[at(h)]);
      h = c.mesh.next_around(h);
    } while (h != start);
  }
  REQUIRE(check_map(c.mesh, c.index(), map.z).flips > 0);
  const std::vector<Complex> before = map.z;
  Context context;
  UntangledMap untangled =
      untangle(c.mesh, c.cut, c.index(), c.aligned, map.target, UntangleOptions{}, map.z, context).value();
  map.z = std::move(untangled.z);
  CHECK(untangled.report.defects.valid());
  CHECK(check_map(c.mesh, c.index(), map.z).valid());
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Index g = c.mesh.twin(h);
    const Complex now = map.z[at(g)] - rotated(map.z[at(c.mesh.next(h))], c.cut.rotation[at(h)]);
    const Complex then = before[at(g)] - rotated(before[at(c.mesh.next(h))], c.cut.rotation[at(h)]);
    REQUIRE(std::abs(now - then) < 1e-9);
  }
}

TEST_CASE("seamless: a map that is turned and scaled all over is turned by so much, and by nothing scaled",
          "[seamless]") {
  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  const TargetEdges wanted = target_edges(c.mesh, c.connection, c.cut, c.field.frames.u, c.field.frames.v);
  constexpr double degrees = 7;
  std::vector<Complex> z(wanted.size());
  for (std::size_t h = 0; h < wanted.size(); h += 3) {
    const Complex turn = std::polar(3.0, degrees * std::numbers::pi / 180);
    z[h + 1] = turn * wanted[h];
    z[h + 2] = z[h + 1] + turn * wanted[h + 1];
  }
  const MapStrain strain = map_strain(c.mesh, c.cut.rotation, wanted, z);
  CHECK(strain.turned_mean_degrees == quadrig::test::Approx(degrees));
  CHECK(strain.turned_p95_degrees == quadrig::test::Approx(degrees));
  CHECK(strain.scaled_p95 < 1e-9);
  CHECK(strain.curl_mean ==
        quadrig::test::Approx(field_curl(c.mesh, c.connection, c.field.frames, c.field.matching).mean * 0.12));
  // half of the faces twice as large: they and the others are off by half of ln 2
  for (std::size_t h = 0; h < z.size(); h += 6)
    for (std::size_t k = h; k < h + 3; ++k) z[k] *= 2;
  CHECK(map_strain(c.mesh, c.cut.rotation, wanted, z).scaled_p95 ==
        quadrig::test::Approx(std::log(2) / 2).epsilon(0.1));
}
