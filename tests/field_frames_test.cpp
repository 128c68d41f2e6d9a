// Roots, matching and singularities.
#include "field_shapes.hpp"

using namespace quadrig;
using quadrig::test::Grid;

namespace {

FrameField random_frames(std::size_t count, std::uint32_t seed) {
  std::mt19937 engine(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  FrameField frames;
  for (std::size_t f = 0; f < count; ++f) {
    const double angle = uniform(0, 2 * std::numbers::pi), opening = uniform(0.5, std::numbers::pi - 0.5);
    frames.u.push_back(std::polar(uniform(0.5, 3), angle));
    frames.v.push_back(std::polar(uniform(0.5, 3), angle + opening));
  }
  return frames;
}

}  // namespace

TEST_CASE("field: roots of a frame's polynomial are the frame, up to sign and order", "[field]") {
  const FrameField frames = random_frames(500, 4);
  const Roots found = roots(coefficients(frames));
  CHECK(found.bounded == 0);
  for (std::size_t f = 0; f < frames.u.size(); ++f) {
    const Complex u = found.frames.u[f], v = found.frames.v[f];
    const auto same = [](Complex a, Complex b) { return std::min(std::abs(a - b), std::abs(a + b)) < 1e-9; };
    CHECK(((same(u, frames.u[f]) && same(v, frames.v[f])) || (same(u, frames.v[f]) && same(v, frames.u[f]))));
    CHECK(opening_angle(u, v) > 0);
    const double apart = bisector_angle(u, v) - bisector_angle(frames.u[f], frames.v[f]);
    CHECK(std::abs(std::remainder(apart, std::numbers::pi / 2)) < 1e-9);
  }
}

TEST_CASE("field: frames outside the limits are brought to them with their cross kept", "[field]") {
  PolyVectorField field;
  const auto add = [&](Complex u, Complex v) {
    field.x0.push_back(u * u * v * v);
    field.x1.push_back(-(u * u + v * v));
  };
  add(std::polar(1.0, 0.3), std::polar(1.2, 0.35));  // narrow
  add(std::polar(1.0, 0.3), std::polar(1.0, 3.4));   // narrow to −v
  add(std::polar(1.0, 1.0), std::polar(0.01, 2.5));  // unequal
  field.x0.push_back(0);                             // nothing there
  field.x1.push_back(0);
  field.x0.push_back(0);  // v = 0
  field.x1.push_back(-1);
  add(std::polar(2.0, 0.4), std::polar(2.0, 0.4));  // a double root
  const FrameLimits limits;
  const Roots found = roots(field, limits);
  CHECK(found.bounded == 6);
  for (std::size_t f = 0; f < field.x0.size(); ++f) {
    const Complex u = found.frames.u[f], v = found.frames.v[f];
    const double opening = opening_angle(u, v);
    CHECK(opening >= limits.least_angle_radians - 1e-12);
    CHECK(opening <= std::numbers::pi - limits.least_angle_radians + 1e-12);
    CHECK(std::max(std::abs(u), std::abs(v)) <=
          limits.largest_ratio * std::min(std::abs(u), std::abs(v)) * (1 + 1e-12));
    if (f < 3)
      CHECK(std::abs(std::remainder(4 * bisector_angle(u, v) - std::arg(field.x0[f]), 2 * std::numbers::pi)) < 1e-9);
  }
}

TEST_CASE("field: matching is antisymmetric, and names the continuing vector of orthogonal frames", "[field]") {
  const auto mesh = test::ball(2);
  const Connection<double> connection(mesh);
  FrameField frames = random_frames(static_cast<std::size_t>(mesh.face_count()), 12);
  for (std::size_t f = 0; f < frames.u.size(); ++f) frames.v[f] = Complex(0, 1) * frames.u[f];
  const Matching matching = match(mesh, connection, frames);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const auto i = static_cast<std::size_t>(h), j = static_cast<std::size_t>(mesh.twin(h));
    CHECK(matching.r[i] == -matching.r[j]);
    CHECK(matching.rho[i] == -matching.rho[j]);
    CHECK(std::abs(matching.rho[i]) <= std::numbers::pi / 4 + 1e-12);
    // u, carried over and turned by −ρ, is vector r of the other face.
    const Complex carried = frames.u[i / 3] * connection.transport(mesh, h) * std::polar(1.0, -matching.rho[i]);
    const Complex wanted = frames.u[j / 3] * std::polar(1.0, std::numbers::pi / 2 * matching.r[i]);
    CHECK(std::abs(carried / std::abs(carried) - wanted / std::abs(wanted)) < 1e-9);
  }
}

TEST_CASE("field: any frames at all obey Poincaré–Hopf, on closed and open surfaces", "[field]") {
  const Grid torus{14, 10, true, true}, tube{14, 10, true, false}, sheet{7, 5, false, false};
  const std::array meshes{
      test::ball(2), test::build(test::torus_positions(torus, 2, 0.7), torus.triangles()),
      test::build(test::tube_positions(tube, 3, 1), tube.triangles()),
      test::build(sheet.positions([](Index i, Index j) { return Vector3(i, j, 0.1 * i * j); }), sheet.triangles())};
  for (const auto& mesh : meshes)
    for (std::uint32_t seed = 0; seed < 5; ++seed) {
      const Connection<double> connection(mesh);
      const auto frames = random_frames(static_cast<std::size_t>(mesh.face_count()), seed);
      const auto found = singularities(mesh, match(mesh, connection, frames));
      REQUIRE(found);
      CHECK(found->sum == 4 * euler_characteristic(mesh));
    }
}

TEST_CASE("field: the coordinate field of a torus has no singularity", "[field]") {
  const Grid grid{30, 60, true, true};
  const auto mesh = test::build(test::torus_positions(grid, 3, 1), grid.triangles());
  const Connection<double> connection(mesh);
  FrameField frames;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const Vector3 centre =
        (mesh.position(mesh.faces()(f, 0)) + mesh.position(mesh.faces()(f, 1)) + mesh.position(mesh.faces()(f, 2))) / 3;
    const Complex round = connection.to_complex(f, Vector3::UnitZ().cross(centre).normalized());
    frames.u.push_back(round);
    frames.v.push_back(round * std::polar(0.5, 1.0));  // skewed, the same everywhere
  }
  const auto found = singularities(mesh, match(mesh, connection, frames));
  REQUIRE(found);
  CHECK(found->plus == 0);
  CHECK(found->minus == 0);
}

TEST_CASE("field: a matching of another mesh is an error, not an index", "[field]") {
  const auto mesh = test::ball(1);
  Matching matching{std::vector<Index>(static_cast<std::size_t>(mesh.halfedge_count()), 0),
                    std::vector<double>(static_cast<std::size_t>(mesh.halfedge_count()), 0.1)};
  const auto found = singularities(mesh, matching);
  REQUIRE(!found);
  CHECK(found.error().code == ErrorCode::numeric);
}
