// Curl: what it is, and what reducing it leaves alone.
#include "map_shapes.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

/// The frames whose line densities are the gradients of a map on each face. \param z of a corner
FrameField gradient_frames(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                           const std::vector<Complex>& z) {
  FrameField frames;
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  for (Index h = 0; h < mesh.halfedge_count(); h += 3) {
    const auto edges = quadrig::detail::quad_edges(connection.to_complex(h / 3, mesh.edge_vector(h)),
                                                   connection.to_complex(h / 3, mesh.edge_vector(h + 1)),
                                                   z[at(h + 1)] - z[at(h)], z[at(h + 2)] - z[at(h + 1)]);
    REQUIRE(edges.has_value());
    frames.u.push_back(edges->a / std::norm(edges->a));
    frames.v.push_back(edges->b / std::norm(edges->b));
  }
  return frames;
}
FrameField gradient_frames(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                           const std::function<Complex(const Vector3&)>& map) {
  std::vector<Complex> z;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) z.push_back(map(mesh.position(mesh.origin(h))));
  return gradient_frames(mesh, connection, z);
}

/// A sheet of 1 × 1 over which hangs a bump, of uneven triangles.
TriangleMesh<double> hill(Index columns, double height) {
  const Grid grid{columns, columns};
  const double step = 1.0 / columns;
  return build(grid.positions([&](Index i, Index j) {
    const double x = step * (i + 0.2 * std::sin(7.0 * j) * (i % columns != 0)), y = step * j;
    return Vector3(x, y, height * std::sin(3 * x) * std::cos(2 * y));
  }),
               grid.triangles());
}

ReducedField reduced(const FieldCase& c, const CurlOptions& options = {}) {
  Context context;
  return reduce_curl(c.mesh, c.connection, c.field.frames, c.field.matching, c.field.singularities, options, context)
      .value();
}

double largest_difference(const FrameField& a, const FrameField& b) {
  double largest = 0;
  for (std::size_t f = 0; f < a.u.size(); ++f)
    largest =
        std::max({largest, std::abs(a.u[f] - b.u[f]) / std::abs(a.u[f]), std::abs(a.v[f] - b.v[f]) / std::abs(a.v[f])});
  return largest;
}

}  // namespace

TEST_CASE("curl: none of the gradients of a map, flat and curved, open and closed", "[curl][fast]") {
  for (const double height : {0.0, 0.6}) {
    const TriangleMesh<double> mesh = hill(12, height);
    const Connection<double> connection(mesh);
    const FrameField frames = gradient_frames(mesh, connection, [](const Vector3& p) {
      return Complex(8 * p.x() + std::sin(4 * p.x() + p.y()), 9 * p.y() + std::cos(3 * p.x()));
    });
    CHECK(field_curl(mesh, connection, frames, match(mesh, connection, frames)).largest < 1e-9);
  }
  const FieldCase c = field_case(closed_surface(1), 0, 0.12);
  const auto map = seamless_case<Complex>(c);
  REQUIRE(map.valid);
  std::vector<Complex> combed = map.z;  // back into the charts of the frames
  for (std::size_t h = 0; h < combed.size(); ++h) combed[h] = rotated(combed[h], c.cut.combing[h / 3]);
  const FrameField frames = gradient_frames(c.mesh, c.connection, combed);
  CHECK(field_curl(c.mesh, c.connection, frames, c.field.matching).largest < 1e-7);
  CHECK(field_curl(c.mesh, c.connection, c.field.frames, c.field.matching).mean > 1e-2);
}

TEST_CASE("curl: of a sampled gradient it falls as triangles get smaller", "[curl][fast]") {
  for (const bool curved : {false, true}) {
    const auto mean = [&](Index columns) {
      const Grid grid{columns, columns};
      const double step = 1.0 / columns;
      const TriangleMesh<double> mesh = build(grid.positions([&](Index i, Index j) {
        return curved ? Vector3(std::sin(step * i), step * j, std::cos(step * i)) : Vector3(step * i, step * j, 0);
      }),
                                              grid.triangles());
      TargetEdges edges;
      for (Index h = 0; h < mesh.halfedge_count(); ++h) {
        const auto along = [&](const Vector3& p) { return curved ? std::atan2(p.x(), p.z()) : p.x(); };
        double x = 0, y = 0;
        for (Index k = 3 * (h / 3); k < 3 * (h / 3) + 3; ++k) {
          x += along(mesh.position(mesh.origin(k))) / 3;
          y += mesh.position(mesh.origin(k)).y() / 3;
        }
        const double dx = along(mesh.position(mesh.target(h))) - along(mesh.position(mesh.origin(h)));
        const double dy = mesh.edge_vector(h).y();
        // of z = e^{x} sin y + 3 x + i (cos(2 x y) + 4 y)
        edges.emplace_back((std::exp(x) * std::sin(y) + 3) * dx + std::exp(x) * std::cos(y) * dy,
                           -2 * y * std::sin(2 * x * y) * dx + (4 - 2 * x * std::sin(2 * x * y)) * dy);
      }
      return target_curl(mesh, std::vector<std::int8_t>(edges.size(), 0), edges).mean;
    };
    const double coarse = mean(8), fine = mean(16), finest = mean(32);
    INFO(curved << ": " << coarse << " " << fine << " " << finest);
    CHECK(fine < coarse / 3.5);
    CHECK(finest < fine / 3.5);
  }
}

TEST_CASE("curl: of a field that turns about a point it is that of the turning", "[curl][fast]") {
  const TriangleMesh<double> mesh = hill(16, 0);
  constexpr double curl = 0.8;
  TargetEdges edges;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    Vector3 centre = Vector3::Zero();
    for (Index k = 3 * (h / 3); k < 3 * (h / 3) + 3; ++k) centre += mesh.position(mesh.origin(k)) / 3;
    const Vector3 e = mesh.edge_vector(h), turning(100 - curl / 2 * centre.y(), curl / 2 * centre.x(), 0);
    edges.emplace_back(turning.dot(e), e.y());
  }
  const FieldCurl found = target_curl(mesh, std::vector<std::int8_t>(edges.size(), 0), edges);
  CHECK(found.largest == quadrig::test::Approx(curl / 100).epsilon(0.02));
  CHECK(found.mean == quadrig::test::Approx(curl / 200).epsilon(0.02));  // the other direction has none
  const auto inside = static_cast<std::size_t>(2 * (8 * 16 + 8));
  CHECK(found.of_face[inside][0] == quadrig::test::Approx(curl / 100).epsilon(0.02));
  CHECK(found.of_face[inside][1] < 1e-9);
}

TEST_CASE("curl: five rounds take out most of it, and neither matching nor singularities change", "[curl]") {
  const int which = GENERATE(0, 1, 2, 3, 4, 5);
  const FieldCase c = field_case(which < 3 ? closed_surface(which) : open_surface(which - 3), 0, 0.12);
  const ReducedField after = reduced(c);
  INFO(which << ": " << after.report.mean_before << " to " << after.report.mean_after);
  CHECK(after.report.mean_after < after.report.mean_before / 5);
  CHECK(after.report.mean_before ==
        quadrig::test::Approx(field_curl(c.mesh, c.connection, c.field.frames, c.field.matching).mean));
  CHECK(after.matching.r == c.field.matching.r);
  CHECK(singularities(c.mesh, after.matching).value().index4 == c.index());
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const auto a = static_cast<std::size_t>(h);
    const Index twin = c.mesh.twin(h);
    if (twin == no_index) continue;
    CHECK(after.matching.rho[a] ==
          quadrig::test::Approx(-after.matching.rho[static_cast<std::size_t>(twin)]).margin(1e-9));
    // ρ is what these frames turn by, beyond r quarter turns
    const auto bisector = [&](Index e) {
      const auto f = static_cast<std::size_t>(e / 3);
      return bisector_angle(after.frames.u[f], after.frames.v[f]);
    };
    const double turn = bisector(h) - std::arg(Complex(c.connection.edge(h))) +
                        std::arg(-Complex(c.connection.edge(twin))) - bisector(twin) -
                        after.matching.r[a] * std::numbers::pi / 2 - after.matching.rho[a];
    CHECK(std::abs(std::remainder(turn, 2 * std::numbers::pi)) < 1e-9);
  }
  for (std::size_t f = 0; f < after.frames.u.size(); ++f)
    CHECK(opening_angle(after.frames.u[f], after.frames.v[f]) > FrameLimits{}.least_angle_radians - 1e-9);
  CHECK(after.report.turned_mean_degrees > 0);
  CHECK(after.report.turned_mean_degrees < 15);
}

TEST_CASE("curl: a field that is the gradient of a map stays, and so does one whose weights are huge", "[curl]") {
  const TriangleMesh<double> mesh = hill(12, 0.6);
  const Connection<double> connection(mesh);
  // The border has to be straight in the map.
  const FrameField frames = gradient_frames(mesh, connection, [](const Vector3& p) {
    return Complex(8 * p.x() + std::sin(2 * std::numbers::pi * p.x()) / 3,
                   9 * p.y() + std::sin(2 * std::numbers::pi * p.y()) / 2);
  });
  const Matching matching = match(mesh, connection, frames);
  const Singularities cones = singularities(mesh, matching).value();
  Context context;
  const ReducedField same = reduce_curl(mesh, connection, frames, matching, cones, {}, context).value();
  CHECK(largest_difference(frames, same.frames) < 1e-8);
  CHECK(same.report.turned_p95_degrees < 1e-6);

  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  CurlOptions unmoved;
  unmoved.direction_weight = unmoved.size_weight = 1e9;
  CHECK(largest_difference(c.field.frames, reduced(c, unmoved).frames) < 1e-8);
  CurlOptions directions;
  directions.direction_weight = 1e9;
  CHECK(reduced(c, directions).report.turned_p95_degrees < 1e-6);
  CHECK(reduced(c, directions).report.scaled_mean > 1e-3);
  CurlOptions none;
  none.rounds = 0;
  CHECK(largest_difference(c.field.frames, reduced(c, none).frames) == 0);
}

TEST_CASE("curl: parts of a mesh do not know of each other", "[curl]") {
  using namespace synthetic;
  const Soup ball = bumpy(sphere(14), 0.3, 3, 5);
  const FieldCase alone = field_case(build(ball), 0, 0.12);
  const FieldCase both = field_case(
      build(joined(ball, moved(ball, [](const Vector3& p) { return Vector3(p.x() + 5, p.y(), p.z()); }))), 0, 0.12);
  const ReducedField one = reduced(alone), two = reduced(both);
  CHECK(two.report.mean_after < two.report.mean_before / 5);
  const std::size_t m = alone.field.frames.u.size();
  // The fields are the same but for the choice of u and v.
  CHECK(both.field.frames.u.size() == 2 * m);
  CHECK(two.report.mean_after == quadrig::test::Approx(one.report.mean_after).epsilon(1e-3));
  CHECK(two.report.turned_mean_degrees == quadrig::test::Approx(one.report.turned_mean_degrees).epsilon(1e-3));
}

TEST_CASE("curl: options that are none are named", "[curl][fast]") {
  const FieldCase c = field_case(open_surface(0), 0, 0.12);
  Context context;
  const auto message = [&](const CurlOptions& options) {
    const auto result =
        reduce_curl(c.mesh, c.connection, c.field.frames, c.field.matching, c.field.singularities, options, context);
    return result ? std::string() : result.error().message();
  };
  CHECK(message({.rounds = -1}).find("curl.rounds") != std::string::npos);
  CHECK(message({.direction_weight = -1}).find("curl.direction_weight") != std::string::npos);
  CHECK(message({.size_weight = std::nan("")}).find("curl.size_weight") != std::string::npos);
  CHECK(message({.kept = EdgeMarks(3)}).find("curl.kept") != std::string::npos);
}
