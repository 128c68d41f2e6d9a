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
