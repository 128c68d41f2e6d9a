// N-RoSy fields against dense eigenvalues, and their singularities.
#include "field_shapes.hpp"

#include <Eigen/Eigenvalues>

using namespace quadrig;

namespace {

PowerFieldResult design(const TriangleMesh<double>& mesh, const PowerFieldOptions& options) {
  Context context;
  auto result = design_power_field(mesh, Connection<double>(mesh), options, context);
  INFO((result ? std::string() : result.error().message()));
  REQUIRE(result);
  return std::move(*result);
}

}  // namespace

TEST_CASE("field: the free power field is the eigenvector of the least eigenvalue", "[field][power]") {
  const int n = GENERATE(1, 2, 4, 6);
  const auto sphere = test::ball(1);
  const auto mesh = test::build(test::limbed(sphere.positions()), sphere.faces());
  const Connection<double> connection(mesh);
  const auto weights = dirichlet_weights(mesh);
  const Smoothness<> smoothness(mesh, connection, n, weights);
  const Index m = mesh.face_count();
  Eigen::MatrixXcd L = Eigen::MatrixXcd::Zero(m, m), M = Eigen::MatrixXcd::Zero(m, m);
  const auto add = [&](const Row<Complex>& row) {
    for (std::size_t p = 0; p < row.at.size(); ++p)
      for (std::size_t q = 0; q < row.at.size(); ++q)
        L(row.at[p], row.at[q]) += row.weight * std::conj(row.coeff[p]) * row.coeff[q];
  };
  smoothness.for_each_row(EmitRow<Complex>(add));
  for (Index f = 0; f < m; ++f) M(f, f) = mesh.area(f);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXcd> dense(L, M);

  const PowerFieldResult result = design(mesh, {.n = n});
  CHECK(result.free_components == 1);
  double mass = 0;
  for (Index f = 0; f < m; ++f) mass += mesh.area(f) * std::norm(result.field.power[static_cast<std::size_t>(f)]);
  CHECK(mass == Approx(mesh.total_area()));
  CHECK(energy_of<Complex>(smoothness, result.field.power) / mass == Approx(dense.eigenvalues()[0]).epsilon(1e-6));
}

TEST_CASE("field: power fields on the sphere have 2N singularities of index 1/N", "[field][power]") {
  const int n = GENERATE(1, 2, 4, 6);
  const auto mesh = test::ball(3);
  const PowerFieldResult result = design(mesh, {.n = n});
  CHECK(result.index_sum == 2 * n);
  Index found = 0;
  for (const Index index : result.index) {
    CHECK(index >= 0);
    found += index;
  }
  CHECK(found == 2 * n);
}

TEST_CASE("field: a power field meets fixed directions and follows targets", "[field][power]") {
  const auto mesh = test::ball(3);
  const Connection<double> connection(mesh);
  for (const int n : {1, 2, 4, 6}) {
    PowerFieldOptions options{.n = n};
    options.fixed = {{5, Complex(0, 2)}, {700, std::polar(1.0, 0.3)}};
    const PowerFieldResult fixed = design(mesh, options);
    for (const FixedDirection& each : options.fixed) {
      const Complex z = fixed.field.power[static_cast<std::size_t>(each.face)];
      CHECK(std::abs(z - integer_power(each.direction / std::abs(each.direction), n)) < 1e-12);
      double nearest = 2;
      for (int k = 0; k < n; ++k)
        nearest = std::min(nearest,
                           std::abs(fixed.field.direction(each.face, k) - each.direction / std::abs(each.direction)));
      CHECK(nearest < 1e-12);
    }

    PowerFieldOptions round{.n = n, .smoothing_length = 0.01};
    for (Index f = 0; f < mesh.face_count(); ++f)
      round.target_directions.push_back(
          connection.to_complex(f, Vector3::UnitZ().cross(mesh.position(mesh.faces()(f, 0)))));
    const PowerFieldResult followed = design(mesh, round);
    CHECK(followed.free_components == 0);
    for (Index f = 0; f < mesh.face_count(); ++f) {
      if (std::abs(mesh.position(mesh.faces()(f, 0)).z()) > 0.8) continue;
      const Complex d = round.target_directions[static_cast<std::size_t>(f)];
      double nearest = 2;
      for (int k = 0; k < n; ++k)
        nearest = std::min(nearest, std::abs(followed.field.direction(f, k) - d / std::abs(d)));
      CHECK(nearest < 0.1);
    }
  }
}

TEST_CASE("field: power fields refuse bad options", "[field][power]") {
  const auto mesh = test::ball(0);
  Context context;
  const auto where = [&](const PowerFieldOptions& options) {
    const auto result = design_power_field(mesh, Connection<double>(mesh), options, context);
    return result ? std::string("no error") : result.error().where;
  };
  CHECK(where({.n = 0}) == "power field, n");
  CHECK(where({.smoothing_length = 0}) == "power field, smoothing_length");
  CHECK(where({.fixed = {{20, 1.0}}}) == "power field, fixed");
  CHECK(where({.target_directions = {1.0}}) == "power field, target_directions");
}

TEST_CASE("field solver: an update of weights is a whole solution, bit for bit, without an analysis", "[field]") {
  const Asset asset = test::limbed_asset(3, false);
  const auto m = static_cast<std::size_t>(asset.mesh.face_count());
  const Connection<double> connection(asset.mesh);
  const std::vector<double> smoothness = dirichlet_weights(asset.mesh), shrink(m, 0.5);
  std::mt19937 random(3);
  const auto number = [&] { return static_cast<double>(random()) / 4294967296.0; };
  const std::array<FieldSystem::Fixed, 2> fixed{FieldSystem::Fixed{5, Complex(0, 1)}, {77, Complex(1, 0)}};
  for (const std::string_view backend : solver_names()) {
    if (!solver_built<Complex>(backend)) continue;
    INFO(backend);
    Context context;
    auto brushed = FieldSolver::create(asset.mesh, connection, solver_factory<Complex>(backend)).value();
    for (int stroke = 0; stroke < 3; ++stroke) {
      std::vector<Complex> target(m);
      std::vector<double> weight(m);
      for (std::size_t f = 0; f < m; ++f) {
        target[f] = std::polar(1.0, 6 * number());
        weight[f] = stroke == 1 && f % 3 != 0 ? 0.0 : number();
      }
      const std::array<FieldSystem, 2> systems{
          FieldSystem{.power = 4, .smoothness = smoothness, .target = target, .target_weight = weight, .fixed = fixed},
          FieldSystem{.power = 2,
                      .smoothness = smoothness,
                      .target = target,
                      .target_weight = weight,
                      .shrink = shrink,
                      .fixed = fixed}};
      auto whole = FieldSolver::create(asset.mesh, connection, solver_factory<Complex>(backend)).value();
      const auto wanted = whole.minimize(systems, context);
      REQUIRE(wanted);
      if (stroke == 0) {
        REQUIRE(brushed.minimize(systems, context));
        continue;
      }
      for (std::size_t k = 0; k < 2; ++k) {
        const auto updated = brushed.update(k, target, weight, context);
        REQUIRE(updated);
        CHECK(*updated == wanted.value()[k]);
        CHECK(updated.value()[5] == fixed[0].value);
      }
    }
    CHECK(brushed.report().analyses == (make_solver<Complex>(backend)->can_clone() ? 1 : 2));
    CHECK(brushed.report().backend.find(backend) == 0);
    std::vector<Complex> poisoned(m);
    poisoned[9] = std::numeric_limits<double>::quiet_NaN();
    const auto refused = brushed.update(0, poisoned, shrink, context);
    REQUIRE(!refused);
    CHECK(refused.error().where.find("row 9") != std::string::npos);
  }
}

TEST_CASE("field solver: both systems side by side, the same bits at any number of threads", "[field]") {
  const Asset asset = test::limbed_asset(4, false);
  const auto m = static_cast<std::size_t>(asset.mesh.face_count());
  const Connection<double> connection(asset.mesh);
  const std::vector<double> smoothness = dirichlet_weights(asset.mesh), weight(m, 1e-3), shrink(m, 0.5);
  const std::vector<Complex> target(m, Complex(1));
  for (const std::string_view backend : {"supernodal/dissection", "supernodal/minimum-degree", "multigrid", "eigen"}) {
    INFO(backend);
    std::vector<std::vector<Complex>> first;
    for (const unsigned threads : {1u, 2u, 3u, 8u}) {
      Context context;
      context.threads = threads;
      auto solver = FieldSolver::create(asset.mesh, connection, solver_factory<Complex>(backend)).value();
      const std::array<FieldSystem, 2> systems{
          FieldSystem{.power = 4, .smoothness = smoothness, .target = target, .target_weight = weight},
          FieldSystem{
              .power = 2, .smoothness = smoothness, .target = target, .target_weight = weight, .shrink = shrink}};
      auto solved = solver.minimize(systems, context);
      REQUIRE(solved);
      const auto updated = solver.update(1, target, shrink, context);
      REQUIRE(updated);
      solved->push_back(*updated);
      if (threads == 1) first = *solved;
      CHECK(*solved == first);
    }
  }
}

TEST_CASE("field solver: other fixed faces, the same solution as from the start", "[field]") {
  const Asset asset = test::limbed_asset(3, false);
  const auto m = static_cast<std::size_t>(asset.mesh.face_count());
  const Connection<double> connection(asset.mesh);
  const std::vector<double> smoothness = dirichlet_weights(asset.mesh), weight(m, 1e-3);
  const std::vector<Complex> target(m, Complex(1));
  Context context;
  auto lasting = FieldSolver::create(asset.mesh, connection).value();
  std::vector<FieldSystem::Fixed> fixed;
  for (int change = 0; change < 4; ++change) {
    // More, others, fewer, and so many others that an order of its own is worth it.
    fixed.clear();
    const Index first = change == 3 ? 0 : 100 * change, last = change == 3 ? 400 : first + 20 - 5 * change;
    for (Index f = first; f < last; ++f) fixed.push_back({f, std::polar(1.0, 0.1 * f)});
    const FieldSystem system{
        .power = 4, .smoothness = smoothness, .target = target, .target_weight = weight, .fixed = fixed};
    const auto again = lasting.minimize(std::span(&system, 1), context);
    auto fresh = FieldSolver::create(asset.mesh, connection).value();
    const auto wanted = fresh.minimize(std::span(&system, 1), context);
    REQUIRE((again && wanted));
    double worst = 0;
    for (std::size_t f = 0; f < m; ++f) worst = std::max(worst, std::abs(again.value()[0][f] - wanted.value()[0][f]));
    CHECK(worst < 1e-10);
  }
  CHECK(lasting.report().analyses == 4);
  CHECK(lasting.report().residual < 1e-12);
}

TEST_CASE("field: factors in single precision leave it as it is, whatever the threads", "[field]") {
  const bool rigged = GENERATE(true, false), pinned = GENERATE(true, false);
  if (rigged && !pinned) return;
  const Asset asset = test::limbed_asset(4, true);
  const Rig* rig = rigged ? &*asset.rig : nullptr;
  const Connection<double> connection(asset.mesh);
  FieldOptions options;
  options.quad_edge = 0.2;
  if (!pinned) options.curvature_weight = 0;
  Context context;
  const auto exact = design_field(asset.mesh, rig, connection, options, context);
  REQUIRE(exact);
  CHECK(exact->report.merge_rounds > 1);
  CHECK((exact->report.solve.inverse_iterations > 1) == !pinned);
  CHECK(exact->report.solve.backend.starts_with("automatic: supernodal, "));
  options.own_solver = [] { return Expected<AnySolver<Complex>>(AutomaticSolver<Complex>({.mixed_from = 1})); };
  std::optional<FieldResult> first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    context.threads = threads;
    auto field = design_field(asset.mesh, rig, connection, options, context);
    REQUIRE(field);
    CHECK(field->report.solve.backend.starts_with("automatic: supernodal-mixed, "));
    CHECK(field->report.solve.residual < 1e-11);
    CHECK(field->singularities.sum == exact->singularities.sum);
    double worst = 0;
    for (std::size_t f = 0; f < exact->polynomial.x0.size(); ++f)
      worst = std::max(worst, std::abs(field->polynomial.x0[f] - exact->polynomial.x0[f]));
    CHECK(worst < 1e-4);
    if (first) CHECK(field->polynomial.x0 == first->polynomial.x0);
    if (!first) first = std::move(*field);
  }
}

TEST_CASE("field solver: what is prepared and improved is what is minimized", "[field]") {
  const Asset asset = test::limbed_asset(3, false);
  const auto m = static_cast<std::size_t>(asset.mesh.face_count());
  const Connection<double> connection(asset.mesh);
  Context context;
  const std::vector<double> smoothness = dirichlet_weights(asset.mesh), weight(m, 1e-2);
  const std::vector<Complex> target(m, Complex(1)), nothing(m);
  const std::array<FieldSystem::Fixed, 2> held{FieldSystem::Fixed{3, Complex(0, 1)}, {9, Complex(-1, 0)}};
  const FieldSystem system{
      .power = 4, .smoothness = smoothness, .target = target, .target_weight = weight, .fixed = held};
  for (const std::string_view backend : {"supernodal", "supernodal-mixed", "multigrid"}) {
    INFO(backend);
    auto solver = FieldSolver::create(asset.mesh, connection, solver_factory<Complex>(backend)).value();
    const auto wanted = solver.minimize(std::span(&system, 1), context);
    REQUIRE(wanted);
    REQUIRE(solver.prepare(std::span(&system, 1), context).ok());
    std::vector<Complex> z(m);
    for (const FieldSystem::Fixed& each : held) z[static_cast<std::size_t>(each.face)] = each.value;
    REQUIRE(solver.improve(0, nothing, 1e-12, z, context).ok());
    double worst = 0;
    for (std::size_t f = 0; f < m; ++f) worst = std::max(worst, std::abs(z[f] - wanted.value()[0][f]));
    CHECK(worst < 1e-9);
    // Twice the pull of the targets' right-hand side: another field, the same held faces.
    std::vector<Complex> more(m);
    for (std::size_t f = 0; f < m; ++f) more[f] = weight[f] * target[f];
    REQUIRE(solver.improve(0, more, 1e-12, z, context).ok());
    CHECK(z[3] == Complex(0, 1));
    CHECK(std::abs(z[50] - wanted.value()[0][50]) > 1e-3);
  }
}

TEST_CASE("field: in single precision it is that of double precision, to what floats can hold", "[field]") {
  const bool flat = GENERATE(false, true);
  const Asset asset = test::limbed_asset(4, true);
  const Rig* rig = flat ? nullptr : &*asset.rig;
  Context context;
  const auto exact = design_field(asset.mesh, rig, Connection<double>(asset.mesh), {.bone_density = true}, context);
  REQUIRE(exact);

  const auto single = TriangleMesh<float>::create(asset.mesh.positions().cast<float>(), asset.mesh.faces()).value();
  BasicFieldOptions<float> options;
  options.bone_density = true;
  options.own_solver = [&] { return make_solver<std::complex<float>>("supernodal"); };
  const auto field = design_field(single, rig, Connection<float>(single), options, context);
  INFO((field ? std::string() : field.error().message()));
  REQUIRE(field);
  CHECK(field->report.solve.residual > 1e-9);  // those were floats
  CHECK(field->report.solve.residual < 1e-5);
  CHECK(field->singularities.sum == exact->singularities.sum);
  CHECK(field->report.energy_smooth == Approx(exact->report.energy_smooth).epsilon(1e-3));
  double worst = 0, sum = 0;
  for (std::size_t f = 0; f < exact->polynomial.x0.size(); ++f) {
    const double away = std::abs(field->polynomial.x0[f] - exact->polynomial.x0[f]);
    worst = std::max(worst, away);
    sum += away / static_cast<double>(exact->polynomial.x0.size());
  }
  CAPTURE(sum);
  CHECK(worst < 2e-3);
  CHECK(sum < 1e-4);
}

TEST_CASE("field solver: in single precision, updates and free components too", "[field]") {
  const Asset asset = test::limbed_asset(3, false);
  const auto m = static_cast<std::size_t>(asset.mesh.face_count());
  const auto single = TriangleMesh<float>::create(asset.mesh.positions().cast<float>(), asset.mesh.faces()).value();
  const Connection<double> connection(asset.mesh);
  const Connection<float> floats(single);
  Context context;
  const std::vector<double> smoothness = dirichlet_weights(asset.mesh), weight(m, 1e-2), heavier(m, 3e-2);
  const std::vector<Complex> target(m, Complex(1));
  const FieldSystem system{.power = 4, .smoothness = smoothness, .target = target, .target_weight = weight};
  const BasicFieldSystem<float> same{.power = 4, .smoothness = smoothness, .target = target, .target_weight = weight};
  const auto near = [&](const std::vector<Complex>& a, const std::vector<Complex>& b) {
    double worst = 0;
    for (std::size_t f = 0; f < m; ++f) worst = std::max(worst, std::abs(a[f] - b[f]));
    return worst;
  };
  for (const std::string_view backend : {"supernodal", "eigen", "multigrid"}) {
    INFO(backend);
    auto exact = FieldSolver::create(asset.mesh, connection, solver_factory<Complex>(backend)).value();
    auto rough = BasicFieldSolver<float>::create(single, floats, solver_factory<std::complex<float>>(backend)).value();
    const auto wanted = exact.minimize(std::span(&system, 1), context);
    const auto got = rough.minimize(std::span(&same, 1), context);
    REQUIRE((wanted && got));
    CHECK(near(wanted.value()[0], got.value()[0]) < 1e-3);
    const auto wanted_update = exact.update(0, target, heavier, context);
    const auto update = rough.update(0, target, heavier, context);
    REQUIRE((wanted_update && update));
    CHECK(near(*wanted_update, *update) < 1e-3);
    CHECK(near(*wanted_update, wanted.value()[0]) > 1e-2);
  }
  const auto exact = design_power_field(asset.mesh, connection, {.n = 4}, context);
  const auto rough = design_power_field(single, floats, {.n = 4}, context);
  REQUIRE((exact && rough));
  CHECK(rough->free_components == 1);
  CHECK(rough->index_sum == exact->index_sum);
  CHECK(near(exact->field.power, rough->field.power) < 1e-2);
}
