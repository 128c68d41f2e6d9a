// Nothing lost, nothing silent: what quads leave out of a surface is measured, mended and reported.
#include "quadrig/quality/coverage.hpp"
#include "corpus/synthetic.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/landing.hpp"
#include "quadrig/quality/distance.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

/// A pyramid over a square of side 1: its tip is vertex 4.
TriangleMesh<double> tall_pyramid(double height) {
  Points<double> p(5, 3);
  p << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, height;
  Triangles t(6, 3);
  t << 0, 2, 1, 0, 3, 2, 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4;
  return test::build(std::move(p), std::move(t));
}

/// A box of the given sides, its corner 0 at the origin.
TriangleMesh<double> plain_box(const Vector3& side) {
  Points<double> p(8, 3);
  for (Index v = 0; v < 8; ++v) p.row(v) << (v & 1) * side[0], (v >> 1 & 1) * side[1], (v >> 2 & 1) * side[2];
  Triangles t(12, 3);
  t << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5;
  return test::build(std::move(p), std::move(t));
}

Quads box_sides() {
  Quads q(6, 4);
  q << 0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5;
  return q;
}

std::vector<Index> all_faces(const TriangleMesh<double>& mesh) {
  std::vector<Index> faces;
  for (Index f = 0; f < mesh.face_count(); ++f) faces.push_back(f);
  return faces;
}

double nearest_vertex(const QuadMesh& quads, const Vector3& p) {
  return (quads.positions.rowwise() - p.transpose()).rowwise().norm().minCoeff();
}

}  // namespace

TEST_CASE("coverage: a corner that is cut off is found with its distance, its place and its share",
          "[coverage][fast]") {
  const TriangleMesh<double> mesh = plain_box({2, 2, 2});
  const std::vector<Index> faces = all_faces(mesh);
  const Context context;
  Points<double> positions = mesh.positions();
  const Coverage whole = coverage(mesh, faces, positions, box_sides(), 0.1, context);
  CHECK(whole.farthest < 1e-12);
  CHECK(whole.share_beyond == 0);

  positions.row(7) << 1, 1, 1;  // the corner (2, 2, 2) goes to the centre
  std::vector<double> off(8, 0.0);
  const Coverage cut = coverage(mesh, faces, positions, box_sides(), 0.1, context, off);
  CHECK((cut.place - Vector3(2, 2, 2)).norm() < 1e-12);
  CHECK(off[7] == Approx(cut.farthest));
  CHECK(off[0] < 1e-12);
  // Three of the six sides dip to the centre, but for strips along two of their edges.
  CHECK(cut.share_beyond > 0.35);
  CHECK(cut.share_beyond < 0.5);
  // The same as by the other measure, which samples both surfaces.
  Context other;
  const QuadMesh quads{positions, box_sides(), {}};
  const auto distance = surface_distance(mesh, quads, DistanceOptions{}, other);
  REQUIRE(distance);
  CHECK(cut.farthest == Approx(distance->from_input.maximum).epsilon(1e-6));
}

TEST_CASE("coverage: quads that stand off the surface stray", "[coverage][fast]") {
  const TriangleMesh<double> mesh = plain_box({2, 2, 2});
  QuadMesh quads{mesh.positions(), box_sides(), std::vector<SurfacePoint>(8)};
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    quads.source[static_cast<std::size_t>(mesh.origin(h))] = {h / 3, Vector3::Unit(h % 3)};
  CHECK(stray(mesh, all_faces(mesh), quads, 0, 6, 0.1, Context{}).farthest < 1e-12);
  quads.positions.row(7) << 2, 2, 3;
  const Stray off = stray(mesh, all_faces(mesh), quads, 0, 6, 0.1, Context{});
  CHECK(off.farthest == Approx(1));
  CHECK((off.place - Vector3(2, 2, 3)).norm() < 1e-12);
}

TEST_CASE("coverage: solids are made of flat sides, round and rough bodies are not", "[coverage][fast]") {
  const auto flats = [](const TriangleMesh<double>& mesh) {
    return detail::made_of_flats(mesh, face_components(mesh)).front() != 0;
  };
  CHECK(flats(plain_box({2, 1.5, 0.06})));
  CHECK(flats(tall_pyramid(4)));
  for (const auto& [name, make] : test::synthetic_cases()) {
    if (!name.starts_with("sphere_48") && !name.starts_with("bumpy_1") && name != "torus_fat") continue;
    const test::Soup soup = make();
    CHECK_FALSE(flats(test::build(soup.positions(), soup.triangles())));
  }
}

TEST_CASE("remesh: every corner of a board gets a vertex without being asked, and none where creases are off",
          "[coverage]") {
  const Asset board{plain_box({2, 1.5, 0.06}), std::nullopt};
  for (const Index quads : {50, 116, 150}) {
    Context context;
    RemeshOptions options;
    options.quads = quads;
    const auto result = remesh(board, options, context);
    REQUIRE(result);
    for (Index v = 0; v < 8; ++v) CHECK(nearest_vertex(result->mesh, board.mesh.position(v)) < 1e-9);
    CHECK_FALSE(result->report.components[0].misses());
    CHECK(result->report.components[0].kept_length == Approx(4 * (2 + 1.5 + 0.06)));
    options.crease_angle_radians = std::numbers::pi;
    const auto smooth = remesh(board, options, context);
    REQUIRE(smooth);
    CHECK(smooth->report.components[0].kept_length == 0);
  }
}

TEST_CASE("remesh: tips stay within an edge of the quads where no crease leads to them", "[coverage]") {
  const Asset pyramid{tall_pyramid(4), std::nullopt};
  for (const Index quads : {30, 116, 300, 900}) {
    Context context;
    RemeshOptions options;
    options.quads = quads;
    options.crease_angle_radians = std::numbers::pi;
    const auto result = remesh(pyramid, options, context);
    REQUIRE(result);
    const ComponentReport& part = result->report.components[0];
    CHECK(part.farthest < part.edge);
    CHECK(result->report.scaled_jacobian_minimum > 0.15);
  }
}

TEST_CASE("remesh: the report measures what a measure of its own finds", "[coverage]") {
  const Asset pyramid{tall_pyramid(8), std::nullopt};
  Context context;
  RemeshOptions options;
  options.quads = 60;
  const auto result = remesh(pyramid, options, context);
  REQUIRE(result);
  const ComponentReport& part = result->report.components[0];
  const auto distance = surface_distance(pyramid.mesh, result->mesh, DistanceOptions{}, context);
  REQUIRE(distance);
  CHECK(part.farthest >= 0.9 * distance->hausdorff());
  CHECK(part.farthest <= 1.1 * distance->hausdorff());
  CHECK(part.edge == Approx(std::sqrt(pyramid.mesh.total_area() / result->report.quads)));
  const bool warned = std::any_of(result->report.warnings.begin(), result->report.warnings.end(),
                                  [](const Warning& warning) { return warning.stage == "coverage"; });
  CHECK(warned == part.misses());
}

TEST_CASE("remesh: tubes thinner than four quads get four around, however long they are", "[coverage]") {
  constexpr Index around = 12, along = 150;
  constexpr double length = 1250;  // of radius 1
  Points<double> p(around * (along + 1) + 2, 3);
  std::vector<std::array<Index, 3>> t;
  for (Index i = 0; i <= along; ++i)
    for (Index k = 0; k < around; ++k) {
      const double angle = 2 * std::numbers::pi * k / around;
      p.row(around * i + k) << length * i / along, std::cos(angle), std::sin(angle);
    }
  const Index low = around * (along + 1), high = low + 1;
  p.row(low) << 0, 0, 0;
  p.row(high) << length, 0, 0;
  for (Index k = 0; k < around; ++k) {
    const Index m = (k + 1) % around, last = around * along;
    for (Index i = 0; i < along; ++i) {
      const Index a = around * i + k, b = around * i + m;
      t.push_back({a, a + around, b + around});
      t.push_back({a, b + around, b});
    }
    t.push_back({low, k, m});
    t.push_back({high, last + m, last + k});
  }
  Triangles faces(static_cast<Eigen::Index>(t.size()), 3);
  for (std::size_t f = 0; f < t.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) faces(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(i)) = t[f][i];
  const Asset tube{test::build(std::move(p), std::move(faces)), std::nullopt};
  for (const Index quads : {30, 100}) {
    Context context;
    RemeshOptions options;
    options.quads = quads;
    const auto result = remesh(tube, options, context);
    REQUIRE(result);
    CHECK(std::abs(result->report.quads - quads) <= 0.05 * quads);
    CHECK(result->report.scaled_jacobian_minimum > 0.9);
    CHECK(result->report.components[0].farthest < 0.1 * result->report.components[0].edge);
  }
}

TEST_CASE("features: lines that meet at an acute angle are let go where they do, others are not", "[coverage][fast]") {
  const TriangleMesh<double> pyramid = tall_pyramid(4), box = plain_box({1, 1, 1});
  const auto marks = [](const TriangleMesh<double>& mesh) {
    EdgeMarks kept(static_cast<std::size_t>(mesh.halfedge_count()), 0);
    for (const Index h : crease_halfedges(mesh, 0.5)) kept[static_cast<std::size_t>(h)] = 1;
    return kept;
  };
  const auto count = [](const EdgeMarks& kept) { return std::count(kept.begin(), kept.end(), 1) / 2; };
  EdgeMarks kept = marks(pyramid);
  REQUIRE(count(kept) == 8);
  detail::release_acute(pyramid, 1, kept);
  CHECK(count(kept) == 4);  // those of the base
  for (Index h = 0; h < pyramid.halfedge_count(); ++h)
    CHECK(!(kept[static_cast<std::size_t>(h)] && (pyramid.origin(h) == 4 || pyramid.target(h) == 4)));
  kept = marks(box);
  detail::release_acute(box, 1, kept);
  CHECK(count(kept) == 12);
}

TEST_CASE("prepare: quads cut along both diagonals and stray flaps do not open the surface", "[coverage][fast]") {
  Context context;
  PolygonMesh ball;
  for (const auto& [name, make] : test::synthetic_cases())
    if (name == "sphere_16") {
      const test::Soup soup = make();
      ball = PolygonMesh::from_triangles(soup.positions(), soup.triangles());
    }
  const auto clean = prepare(ball, nullptr, {}, context);
  REQUIRE(clean);
  REQUIRE(clean->mesh.closed());
  PolygonMesh dirty = ball;
  const Index tops[] = {0, 40, 90};
  for (const Index h : tops) {  // the other diagonal of two triangles, and at one a flap of no great area
    const TriangleMesh<double>& mesh = clean->mesh;
    const Index g = mesh.twin(h), a = mesh.origin(h), b = mesh.target(h), c = mesh.target(mesh.next(h)),
                d = mesh.target(mesh.next(g));
    const auto source = [&](Index v) { return clean->source_vertex[static_cast<std::size_t>(v)]; };
    const std::array<Index, 3> one{source(a), source(d), source(c)}, other{source(d), source(b), source(c)};
    dirty.add_polygon(one);
    dirty.add_polygon(other);
  }
  const Index v = dirty.vertex_count();
  dirty.positions.conservativeResize(v + 1, 3);
  dirty.positions.row(v) = 1.02 * dirty.positions.row(dirty.polygon(200)[0]);
  const std::array<Index, 3> flap{dirty.polygon(200)[0], dirty.polygon(200)[1], v};
  dirty.add_polygon(flap);
  const auto mended = prepare(dirty, nullptr, {}, context);
  REQUIRE(mended);
  CHECK(mended->mesh.closed());
  CHECK(mended->mesh.face_count() == clean->mesh.face_count());
  CHECK(mended->report.components == 1);
  CHECK(mended->report.split_edges == 0);
  CHECK(mended->report.repeated_faces == 2 * 3 + 1);
}

TEST_CASE("remesh: sheets of two triangles are one quad each, and stray triangles three", "[coverage][fast]") {
  constexpr Index cards = 10;
  Points<double> p(4 * cards + 3, 3);
  Triangles t(2 * cards + 1, 3);
  for (Index c = 0; c < cards; ++c) {
    p.middleRows(4 * c, 4) << 3 * c, 0, 0, 3 * c + 1, 0, 0, 3 * c + 1, 1, 0.1, 3 * c, 1, 0;
    t.middleRows(2 * c, 2) << 4 * c, 4 * c + 1, 4 * c + 2, 4 * c, 4 * c + 2, 4 * c + 3;
  }
  p.bottomRows(3) << 0, 5, 0, 1, 5, 0, 0, 6, 0;
  t.bottomRows(1) << 4 * cards, 4 * cards + 1, 4 * cards + 2;
  const Asset asset{test::build(std::move(p), std::move(t)), std::nullopt};
  Context context;
  RemeshOptions options;
  options.quads = 10;
  const auto result = remesh(asset, options, context);
  REQUIRE(result);
  CHECK(result->report.quads == cards + 3);
  for (const ComponentReport& part : result->report.components) CHECK(part.farthest < 0.1 * part.edge);
  const bool told = std::any_of(result->report.warnings.begin(), result->report.warnings.end(),
                                [](const Warning& warning) { return warning.stage == "count"; });
  CHECK(told);  // 13 for 10
}
