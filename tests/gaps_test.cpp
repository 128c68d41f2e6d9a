// Gaps smaller than a quad: ragged borders and pinholes of scans.
#include "quadrig/prepare/gaps.hpp"

#include <random>

#include "quadrig/field/matching.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/quads/topology.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

/// A sheet of n × n cells over the unit square, which waves a little.
struct PunchedSheet {
  explicit PunchedSheet(Index n) : grid{n, n} {}
  [[nodiscard]] Points<double> positions() const {
    return grid.positions([&](Index i, Index j) {
      const double x = static_cast<double>(i) / grid.columns, y = static_cast<double>(j) / grid.rows;
      return Vector3(x, y, 0.1 * std::sin(5 * x) * std::cos(4 * y));
    });
  }
  [[nodiscard]] TriangleMesh<double> whole() const { return test::build(positions(), grid.triangles()); }
  test::Grid grid;
};

/// Without some triangles, each vertex with one fan. \param goes of a face of the mesh
template <class Predicate>
TriangleMesh<double> without(const TriangleMesh<double>& mesh, const Predicate& goes) {
  PolygonMesh polygons;
  polygons.positions = mesh.positions();
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const std::array<Index, 3> corners{mesh.faces()(f, 0), mesh.faces()(f, 1), mesh.faces()(f, 2)};
    if (!goes(f)) polygons.add_polygon(corners);
  }
  Context context;
  return prepare(polygons, nullptr, {}, context).value().mesh;
}

/// Takes triangles off the border, each with a chance of a third, for some rounds.
TriangleMesh<double> ragged(TriangleMesh<double> mesh, int rounds, unsigned seed) {
  std::mt19937 random(seed);
  for (int round = 0; round < rounds; ++round)
    mesh = without(mesh, [&](Index f) {
      bool border = false;
      for (const Index h : mesh.halfedges_of(f)) border = border || mesh.twin(h) == no_index;
      return border && random() % 3 == 0;
    });
  const Components parts = face_components(mesh);  // crumbs that came off are no matter of borders
  std::vector<Index> faces(static_cast<std::size_t>(parts.count), 0);
  for (const Index c : parts.of_face) ++faces[static_cast<std::size_t>(c)];
  const auto largest = std::max_element(faces.begin(), faces.end()) - faces.begin();
  return without(mesh, [&](Index f) { return parts.of_face[static_cast<std::size_t>(f)] != largest; });
}

/// A pinhole in every so many faces of those off the border.
TriangleMesh<double> pierced(const TriangleMesh<double>& mesh, Index every) {
  return without(mesh, [&](Index f) {
    for (int i = 0; i < 3; ++i)
      if (mesh.on_boundary(mesh.faces()(f, i))) return false;
    return f % every == every / 2;
  });
}

double border_length(const TriangleMesh<double>& mesh) {
  double length = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) == no_index) length += mesh.edge_vector(h).norm();
  return length;
}

bool begins_with(const TriangleMesh<double>& mesh, const TriangleMesh<double>& first) {
  return mesh.faces().topRows(first.face_count()) == first.faces() && mesh.positions() == first.positions();
}

RemeshOptions at_count(Index quads) {
  RemeshOptions options;
  options.quads = quads;
  return options;
}

}  // namespace

TEST_CASE("gaps: borders that turn one way have none", "[gaps][fast]") {
  const Context context;
  const GapOptions small{0.2, 0, 0.05};
  CHECK(!bridge_gaps(PunchedSheet(40).whole(), small, context));

  const test::Grid tube{24, 30, true};  // its ends are 0.63 around, and turn not at all
  const TriangleMesh<double> open = test::build(test::tube_positions(tube, 1, 0.1), tube.triangles());
  CHECK(!bridge_gaps(open, {1, 0, 0.05}, context));
  const auto capped = bridge_gaps(open, {0, 1, 0}, context);
  REQUIRE(capped);
  CHECK(capped->mesh.closed());
  CHECK(capped->holes.size() == 2);

  // The outline of a sheet is never closed, however small the sheet.
  CHECK(!bridge_gaps(PunchedSheet(3).whole(), {100, 100, 0}, context));

  // A corner that goes in, and a slit.
  const PunchedSheet sheet(40);
  const TriangleMesh<double> all = sheet.whole();
  const auto cell = [](Index f) { return std::pair(f / 2 % 40, f / 2 / 40); };
  const auto angle = without(all, [&](Index f) { return cell(f).first > 20 && cell(f).second > 20; });
  CHECK(!bridge_gaps(angle, small, context));
  const auto slit = without(all, [&](Index f) { return cell(f).first == 20 && cell(f).second > 10; });
  CHECK(!bridge_gaps(slit, small, context));
}

TEST_CASE("gaps: notches of a ragged border are bridged, at the scale that is asked for", "[gaps][fast]") {
  const Context context;
  for (const unsigned seed : {1U, 2U, 3U}) {
    const TriangleMesh<double> mesh = ragged(PunchedSheet(40).whole(), 3, seed);
    const auto calm = bridge_gaps(mesh, {0, 0, 0.1}, context);
    REQUIRE(calm);
    CHECK(begins_with(calm->mesh, mesh));
    CHECK(calm->mesh.face_count() == mesh.face_count() + calm->notches);
    CHECK(calm->notch_area == Approx(calm->mesh.total_area() - mesh.total_area()).epsilon(1e-9));
    CHECK(calm->holes.empty());
    const SurfaceTopology before(mesh), after(calm->mesh);
    CHECK(after.euler == before.euler);
    CHECK(after.loops == before.loops);
    CHECK(border_length(calm->mesh) < 0.8 * border_length(mesh));
    for (Index f = mesh.face_count(); f < calm->mesh.face_count(); ++f) CHECK(calm->mesh.normal(f)[2] > 0.5);
    // Half as deep as a triangle is no scale at which anything is to be bridged.
    CHECK(!bridge_gaps(mesh, {0, 0, 0.005}, context));
    // The same again: nothing is left that is ragged and small enough.
    const auto twice = bridge_gaps(calm->mesh, {0, 0, 0.1}, context);
    CHECK(!twice);
  }
}

TEST_CASE("gaps: holes are closed by their length, those that touch at a vertex too", "[gaps][fast]") {
  const Context context;
  const PunchedSheet sheet(20);
  const TriangleMesh<double> all = sheet.whole();
  // Two triangles that share a vertex alone: one hole, which passes it twice.
  const auto pair = without(all, [](Index f) { return f == 2 * 210 || f == 2 * (210 - 21); });
  REQUIRE(SurfaceTopology(pair).loops == 2);
  CHECK(pair.vertex_count() == all.vertex_count() + 1);
  const auto whole = bridge_gaps(pair, {1, 0, 0}, context);
  REQUIRE(whole);
  CHECK(whole->holes.size() == 1);
  CHECK(whole->left_open == 0);
  CHECK(SurfaceTopology(whole->mesh).loops == 1);
  CHECK(euler_characteristic(whole->mesh) == 1);
  CHECK(whole->mesh.total_area() == Approx(all.total_area()).epsilon(1e-9));

  // A hole with bays, wider than it is convex.
  const auto bays = without(all, [](Index f) {
    const Index i = f / 2 % 20, j = f / 2 / 20;
    return i > 4 && i < 15 && ((j == 8) || (i % 3 == 0 && j > 5 && j < 12));
  });
  CHECK(!bridge_gaps(bays, {0.5, 0, 0}, context));
  const auto closed = bridge_gaps(bays, {10, 0, 0}, context);
  REQUIRE(closed);
  CHECK(closed->holes.size() == 1);
  CHECK(SurfaceTopology(closed->mesh).loops == 1);
  for (Index f = bays.face_count(); f < closed->mesh.face_count(); ++f) CHECK(closed->mesh.normal(f)[2] > 0.5);
}

TEST_CASE("gaps: a scan with a ragged border and pinholes becomes quads like one without", "[gaps][slow]") {
  for (const Index quads : {300, 1000}) {
    const TriangleMesh<double> mesh = pierced(ragged(PunchedSheet(50).whole(), 3, 7), 700);
    const Asset asset{mesh, {}};
    Context context;
    const auto result = remesh(asset, at_count(quads), context);
    REQUIRE(result);
    const RemeshReport& report = result->report;
    CHECK(report.gaps.notches > 50);
    CHECK(report.gaps.holes_cut == SurfaceTopology(mesh).loops - 1);
    CHECK(report.gaps.holes_closed == 0);
    CHECK(std::abs(report.quads - quads) <= 0.05 * quads);
    CHECK(report.components[0].rung != Rung::split);
    CHECK(report.components[0].faces == mesh.face_count());
    CHECK(report.components[0].farthest < report.components[0].edge);
    CHECK(report.irregular <= 12);
    CHECK(report.scaled_jacobian_minimum > 0.4);
    CHECK(unlike(quad_topology(result->mesh.quads, result->mesh.vertex_count()), SurfaceTopology(mesh)).empty());
    for (Index v = 0; v < result->mesh.vertex_count(); ++v) {
      const SurfacePoint& source = result->mesh.source[static_cast<std::size_t>(v)];
      REQUIRE(source.face < mesh.face_count());
      const Vector3 off = position(mesh, source) - result->mesh.positions.row(v).transpose();
      CHECK(off.norm() < 1.5 * report.components[0].edge);
    }
    CHECK(std::ranges::count(report.warnings, "border", &Warning::stage) == 2);

    RemeshOptions filled = at_count(quads);
    filled.fill_holes = 0.2;
    const auto without_holes = remesh(asset, filled, context);
    REQUIRE(without_holes);
    CHECK(without_holes->report.gaps.holes_filled == report.gaps.holes_cut);
    CHECK(without_holes->report.gaps.holes_cut == 0);
    CHECK(quad_topology(without_holes->mesh.quads, without_holes->mesh.vertex_count()).boundary_loops == 1);
  }
}

TEST_CASE("gaps: borders are followed exactly where that is asked for, and where there is nothing to bridge",
          "[gaps][slow]") {
  const Asset clean{PunchedSheet(30).whole(), {}}, torn{ragged(PunchedSheet(30).whole(), 1, 5), {}};
  Context context;
  const auto plain = remesh(clean, at_count(300), context);
  RemeshOptions exact = at_count(300);
  exact.exact_borders = true;
  const auto same = remesh(clean, exact, context);
  REQUIRE(plain);
  REQUIRE(same);
  CHECK(plain->mesh.positions == same->mesh.positions);
  CHECK(plain->report.warnings.empty());
  const auto followed = remesh(torn, exact, context);
  REQUIRE(followed);
  CHECK(followed->report.gaps.notches == 0);
  RemeshOptions bad = at_count(300);
  bad.fill_holes = -1;
  CHECK(remesh(clean, bad, context).error().where == "fill_holes");
}

TEST_CASE("gaps: holes beside each other and beside a border have four quads about them", "[gaps][slow]") {
  // So many that no quad is free of others' corners.
  const TriangleMesh<double> all = PunchedSheet(20).whole();
  const TriangleMesh<double> mesh =
      without(all, [](Index f) { return f % 2 == 0 && f / 2 % 20 % 4 == 2 && f / 2 / 20 % 4 == 2; });
  Skeleton skeleton;
  skeleton.bones.push_back({});
  skeleton.bones[0].tail = Vector3(1, 0, 0);
  skeleton.bones[0].has_direction = true;
  Rig rig;
  rig.skeleton = skeleton;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < mesh.vertex_count(); ++v) entries.emplace_back(v, 0, 1.0);
  rig.weights = SkinWeights(mesh.vertex_count(), 1);
  rig.weights.setFromTriplets(entries.begin(), entries.end());
  const Asset asset{mesh, rig};
  Context context;
  const Index holes = SurfaceTopology(mesh).loops - 1;
  const auto result = remesh(asset, at_count(4 * holes), context);
  REQUIRE(result);
  CHECK(result->report.gaps.holes_cut == holes);
  CHECK(unlike(quad_topology(result->mesh.quads, result->mesh.vertex_count()), SurfaceTopology(mesh)).empty());
  CHECK(result->report.scaled_jacobian_minimum > 0.2);
  REQUIRE(result->weights);
  for (Index v = 0; v < result->mesh.vertex_count(); ++v)
    CHECK(result->weights->row(v).sum() == Approx(1).epsilon(1e-9));
  // More than one of four quads: holes are followed instead.
  const auto many = remesh(asset, at_count(3 * holes), context);
  REQUIRE(many);
  CHECK(many->report.gaps.holes_cut == 0);
}
