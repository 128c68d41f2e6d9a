// Edges that quads must keep: curves of them, creases, the caller's own, and borders of vertex groups.
#include <numeric>

#include "corpus/synthetic.hpp"
#include "quadrig/constraints/features.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/samples.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// Marks of the edges whose ends and middle fulfil a condition.
EdgeMarks marks_where(const TriangleMesh<double>& mesh, function_ref<bool(const Vector3&)> on) {
  EdgeMarks marks(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Vector3 a = mesh.position(mesh.origin(h)), b = mesh.position(mesh.target(h));
    marks[at(h)] = mesh.twin(h) != no_index && on(a) && on(b) && on((a + b) / 2);
  }
  return marks;
}
std::vector<Index> halfedges_of(const EdgeMarks& marks) {
  std::vector<Index> halfedges;
  for (std::size_t h = 0; h < marks.size(); ++h)
    if (marks[h]) halfedges.push_back(static_cast<Index>(h));
  return halfedges;
}
TriangleMesh<double> sheet(Index n) {
  const Grid grid{n, n};
  return build(grid.positions([&](Index i, Index j) -> Vector3 { return Vector3(i, j, 0) / n; }), grid.triangles());
}
TriangleMesh<double> tube(Index columns, Index rows) {
  const Grid grid{columns, rows, true};
  return build(tube_positions(grid, 4, 1), grid.triangles());
}
SurfacePoint vertex_point(const TriangleMesh<double>& mesh, Index v) {
  const Index h = mesh.outgoing(v);
  return {h / 3, Vector3::Unit(h % 3)};
}

/// What the edges of quads that lie within `near` of a set are long in all.
double length_along(const QuadMesh& quads, double near, function_ref<double(const Vector3&)> distance) {
  double sum = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Vector3 a = quads.positions.row(quads.quads(q, i)).transpose(),
                    b = quads.positions.row(quads.quads(q, (i + 1) % 4)).transpose();
      if (distance(a) < near && distance(b) < near && distance((a + b) / 2) < near) sum += (a - b).norm() / 2;
    }
  return sum;
}
double kept_share(const RemeshReport& report) {
  double length = 0, quads = 0;
  for (const ComponentReport& c : report.components) {
    length += c.kept_length;
    quads += c.kept_as_quads;
  }
  REQUIRE(length > 0);
  return quads / length;
}

}  // namespace

TEST_CASE("curves: loops close, corners part, and a corner is where edges bend within the surface", "[curves][fast]") {
  const TriangleMesh<double> mesh = sheet(8);
  // A square inside: four curves of four edges. The border: one loop.
  const EdgeMarks square = marks_where(mesh, [](const Vector3& p) {
    return std::abs(std::max(std::abs(p[0] - 0.5), std::abs(p[1] - 0.5)) - 0.25) < 1e-9;
  });
  const EdgeCurves curves(mesh, square, EdgeCurves::eighth);
  CHECK(curves.length() == Approx(2));
  Index corners = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) corners += curves.corner(v);
  CHECK(corners == 4);
  const Grid grid{8, 8};
  const SurfacePoint a = vertex_point(mesh, grid.vertex(2, 2)), b = vertex_point(mesh, grid.vertex(6, 2)),
                     c = vertex_point(mesh, grid.vertex(6, 6));
  CHECK(curves.distance(a, b).value() == Approx(0.5));
  CHECK_FALSE(curves.distance(a, c).has_value());
  CHECK((position(mesh, *curves.between(a, b, 0.25)) - Vector3(0.375, 0.25, 0)).norm() < 1e-12);

  const EdgeCurves border(mesh, border_marks(mesh));
  CHECK(border.length() == Approx(4));
  for (Index v = 0; v < mesh.vertex_count(); ++v) CHECK_FALSE(border.corner(v));
  // With the border: the long way round where that is its direction.
  const SurfacePoint low = vertex_point(mesh, grid.vertex(0, 0)), next = vertex_point(mesh, grid.vertex(1, 0));
  CHECK(border.distance(low, next).value() == Approx(0.125));
  CHECK(border.distance(next, low).value() == Approx(4 - 0.125));

  // Around a tube of six sides edges bend by 60° in space and not at all within it.
  const TriangleMesh<double> six = tube(6, 8);
  const EdgeCurves ring(six, marks_where(six, [](const Vector3& p) { return std::abs(p[0] - 2) < 1e-9; }),
                        EdgeCurves::eighth);
  for (Index v = 0; v < six.vertex_count(); ++v) CHECK_FALSE(ring.corner(v));
  const Grid sides{6, 8, true};
  const SurfacePoint first = vertex_point(six, sides.vertex(0, 4)), third = vertex_point(six, sides.vertex(2, 4)),
                     fifth = vertex_point(six, sides.vertex(4, 4));
  CHECK(ring.distance(first, third).value() == Approx(2));
  CHECK(ring.distance(first, fifth).value() == Approx(2));  // a closed curve has a shorter way
  CHECK((position(six, *ring.between(first, fifth, 0.5)) - six.position(sides.vertex(5, 4))).norm() < 1e-9);
}

TEST_CASE("remesh: the creases of a box become edges of quads, each from corner to corner", "[features]") {
  Context context;
  const Soup cube = synthetic::cells({{0, 0, 0}}, 5);
  auto made = prepare(PolygonMesh::from_triangles(cube.positions(), cube.triangles()), nullptr, {}, context);
  REQUIRE(made);
  const Asset asset{std::move(made->mesh), std::nullopt};
  const Vector3 low = asset.mesh.positions().colwise().minCoeff(), high = asset.mesh.positions().colwise().maxCoeff();
  const auto to_edge = [&](const Vector3& p) {
    Vector3 d = (p - low).cwiseMin(high - p).cwiseAbs();
    std::sort(d.data(), d.data() + 3);
    return std::hypot(d[0], d[1]);
  };
  for (const Index quads : {150, 600}) {
    RemeshOptions options;
    options.quads = quads;
    options.crease_angle_radians = 0.8;
    const auto result = remesh(asset, options, context);
    REQUIRE(result);
    CHECK(kept_share(result->report) == Approx(1));
    const double side = (high - low)[0];
    CHECK(length_along(result->mesh, 1e-6 * side, to_edge) == Approx(12 * side).epsilon(1e-6));
  }
}

TEST_CASE("remesh: edges that the caller names become edges of quads", "[features]") {
  Context context;
  // A circle about a tube, askew to its triangles' rows as little as they allow; and a square drawn on a sheet.
  const Asset round{tube(24, 40), std::nullopt};
  RemeshOptions options;
  options.quads = 600;
  options.features =
      halfedges_of(marks_where(round.mesh, [](const Vector3& p) { return std::abs(p[0] - 1.3) < 1e-9; }));
  REQUIRE(options.features.size() == 48);
  auto result = remesh(round, options, context);
  REQUIRE(result);
  CHECK(kept_share(result->report) > 0.999);
  const auto to_circle = [](const Vector3& p) { return std::abs(p[0] - 1.3); };
  CHECK(length_along(result->mesh, 1e-6, to_circle) > 6.1);
  options.features.clear();
  result = remesh(round, options, context);
  REQUIRE(result);
  CHECK(length_along(result->mesh, 1e-6, to_circle) < 0.1);

  const Asset flat{sheet(20), std::nullopt};
  const auto to_square = [](const Vector3& p) {
    return std::abs(std::max(std::abs(p[0] - 0.5), std::abs(p[1] - 0.5)) - 0.25);
  };
  options.features = halfedges_of(marks_where(flat.mesh, [&](const Vector3& p) { return to_square(p) < 1e-9; }));
  result = remesh(flat, options, context);
  REQUIRE(result);
  CHECK(kept_share(result->report) > 0.999);
  CHECK(length_along(result->mesh, 1e-6, to_square) == Approx(2).epsilon(1e-3));

  // The same bits at any number of threads.
  Context several;
  several.threads = 3;
  const auto again = remesh(flat, options, several);
  REQUIRE(again);
  CHECK(again->mesh.positions == result->mesh.positions);
}

TEST_CASE("remesh: edges are kept on a surface of far more triangles than its map needs", "[features][slow]") {
  Context context;
  const Asset fine{tube(160, 260), std::nullopt};
  REQUIRE(fine.mesh.face_count() > 80'000);
  RemeshOptions options;
  options.quads = 400;
  options.features =
      halfedges_of(marks_where(fine.mesh, [](const Vector3& p) { return std::abs(p[0] - 4 * 80 / 260.0) < 1e-9; }));
  REQUIRE(options.features.size() == 320);
  const auto result = remesh(fine, options, context);
  REQUIRE(result);
  CHECK(kept_share(result->report) > 0.99);
}

TEST_CASE("remesh: borders of vertex groups become edges of quads where that is asked for", "[features]") {
  Context context;
  const auto pear = make_sample("pear", 3000, context);
  REQUIRE(pear);
  RemeshOptions options;
  options.quads = 500;
  options.group_borders = true;
  const auto result = remesh(*pear, options, context);
  REQUIRE(result);
  CHECK(kept_share(result->report) > 0.99);
  // Each quad has corners of one group alone, but for those on the border, whose weights are alike.
  REQUIRE(result->weights);
  Index mixed = 0;
  for (Index q = 0; q < result->mesh.quad_count(); ++q) {
    bool first = false, second = false;
    for (int i = 0; i < 4; ++i) {
      const double difference =
          result->weights->coeff(result->mesh.quads(q, i), 0) - result->weights->coeff(result->mesh.quads(q, i), 1);
      first = first || difference > 0.02;
      second = second || difference < -0.02;
    }
    mixed += first && second;
  }
  CHECK(mixed == 0);
}

TEST_CASE("remesh: blocks on a terrain keep most of their creases at every count", "[features]") {
  // The walls are a triangle wide, and some of their corners wedges of a few degrees: those lines give way, not all.
  const Index n = 60;
  const Grid grid{n, n};
  const TriangleMesh<double> blocks = build(grid.positions([&](Index i, Index j) -> Vector3 {
    const double x = 6.0 * i / n, y = 6.0 * j / n, u = std::abs(std::fmod(x, 3) - 1.5),
                 v = std::abs(std::fmod(y, 3) - 1.5);
    return {x, y, std::max(u, v) < 0.7 ? 1 : 0.15 * std::sin(x) * std::cos(0.7 * y)};
  }),
                                            grid.triangles());
  for (const Index quads : {600, 2000}) {
    RemeshOptions options;
    options.quads = quads;
    options.crease_angle_radians = 30 * std::numbers::pi / 180;
    Context context;
    const auto result = remesh({blocks, {}}, options, context);
    REQUIRE(result);
    const ComponentReport& part = result->report.components[0];
    CAPTURE(quads, part.kept_length, part.kept_as_quads, rung_name(part.rung));
    CHECK(part.kept_as_quads > 0.5 * part.kept_length);
    CHECK(std::abs(part.quads - quads) <= 0.05 * quads);
  }
}

TEST_CASE("features: what lines enclose that has no room for half a quad is joined where it bends least",
          "[features][fast]") {
  // A sheet parted at x = 1/2, with a square of 1/64 of its area in the corner of one half.
  const TriangleMesh<double> flat = sheet(8);
  const auto on = [](const Vector3& p) {
    const bool square = (p.x() == 0.125 && p.y() <= 0.125) || (p.y() == 0.125 && p.x() <= 0.125);
    return p.x() == 0.5 || square;
  };
  const EdgeMarks marks = marks_where(flat, on);
  const auto count = [](const EdgeMarks& kept) { return std::count(kept.begin(), kept.end(), 1) / 2; };
  EdgeMarks kept = marks;
  quadrig::detail::release_small_patches(flat, 0.1, kept);
  CHECK(kept == marks);  // 1/64 is more than half of 1/100
  quadrig::detail::release_small_patches(flat, 0.2, kept);
  CHECK(count(kept) == count(marks) - 2);
  for (Index h = 0; h < flat.halfedge_count(); ++h)
    if (kept[at(h)]) CHECK(flat.position(flat.origin(h)).x() == 0.5);
  // A line that ends within a patch encloses nothing.
  const EdgeMarks ending = marks_where(flat, [](const Vector3& p) { return p.x() == 0.5 && p.y() <= 0.5; });
  kept = ending;
  quadrig::detail::release_small_patches(flat, 10, kept);
  CHECK(kept == ending);
}

TEST_CASE("remesh: features that are none, and groups without a rig, are refused by name", "[features][fast]") {
  const Asset asset{sheet(4), std::nullopt};
  Context context;
  RemeshOptions options;
  options.features = {asset.mesh.halfedge_count()};
  auto result = remesh(asset, options, context);
  REQUIRE_FALSE(result);
  CHECK(result.error().code == ErrorCode::bad_option);
  CHECK(result.error().where == "features");
  options.features.clear();
  options.group_borders = true;
  result = remesh(asset, options, context);
  REQUIRE_FALSE(result);
  CHECK(result.error().where == "group_borders");
}

TEST_CASE("features: labels part where they differ, and nowhere else", "[features][fast]") {
  const TriangleMesh<double> mesh = sheet(6);
  std::vector<Index> label(at(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f)
    label[at(f)] = position(mesh, {f, Vector3::Constant(1.0 / 3)})[0] < 0.5 ? 7 : 3;
  const std::vector<Index> borders = label_borders(mesh, std::span<const Index>(label));
  CHECK(borders.size() == 12);
  for (const Index h : borders) CHECK(mesh.position(mesh.origin(h))[0] == Approx(0.5));
}
