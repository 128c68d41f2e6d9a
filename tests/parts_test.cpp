// Parts of stages, each by its own law: what whole remeshes would hide, as the next attempt makes up for it.
#include <map>
#include <set>

#include "quadrig/closest.hpp"
#include "quadrig/prepare/split_edges.hpp"
#include "quadrig/quality.hpp"
#include "quadrig/simplify.hpp"
#include "quadrig/simplify/decimate.hpp"
#include "quadrig/simplify/pair.hpp"
#include "quadrig/simplify/place.hpp"
#include "quadrig/simplify/refined.hpp"
#include "quadrig/weights/voxel_body.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

Triangles matrix_of(const std::vector<std::array<Index, 3>>& faces) {
  Triangles result(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    result.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
  return result;
}

std::vector<Vector3> points_of(const TriangleMesh<double>& mesh) {
  std::vector<Vector3> points;
  for (Index v = 0; v < mesh.vertex_count(); ++v) points.push_back(mesh.position(v));
  return points;
}

TriangleMesh<double> wavy_sheet(Index side) {
  const test::Grid grid{side, side};
  return test::build(grid.positions([&](Index i, Index j) {
    const double x = i / static_cast<double>(side), y = j / static_cast<double>(side);
    return Vector3(x, y, 0.1 * std::sin(5 * x) * std::cos(4 * y));
  }),
                     grid.triangles());
}

TriangleMesh<double> ring() {
  const test::Grid grid{24, 16, true, true};
  return test::build(grid.positions([](Index i, Index j) {
    const double a = 2 * std::numbers::pi * i / 24, b = 2 * std::numbers::pi * j / 16;
    const double r = 2 + 0.7 * std::cos(a);
    return Vector3(r * std::cos(b), r * std::sin(b), 0.7 * std::sin(a));
  }),
                     grid.triangles());
}

Index euler_number(const TriangleMesh<double>& mesh) {
  Index used = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) used += mesh.outgoing(v) != no_index;
  return used - mesh.edge_count() + mesh.face_count();
}

}  // namespace

TEST_CASE("decimator: every step leaves a mesh of the same topology, on vertices of the input", "[simplify][fast]") {
  for (const TriangleMesh<double>& mesh : {wavy_sheet(20), ring()}) {
    Context context;
    detail::Decimator decimator(mesh, 0.05, 0.3, context);
    const Index loops = mesh_statistics(to_polygons(mesh)).boundary_loops;
    for (const Index wanted : {400, 150, 60, 20, 4, 1}) {
      const Index before = decimator.face_count();
      REQUIRE(decimator.reduce(wanted, context).ok());
      CHECK(decimator.face_count() <= before);
      const auto faces = decimator.faces();
      REQUIRE(static_cast<Index>(faces.size()) == decimator.face_count());
      const auto left = TriangleMesh<double>::create(mesh.positions(), matrix_of(faces));
      REQUIRE(left);
      CHECK(euler_number(*left) == euler_number(mesh));
      CHECK(left->closed() == mesh.closed());
      CHECK(mesh_statistics(to_polygons(*left)).boundary_loops == loops);
      if (wanted >= 60) CHECK(decimator.face_count() <= wanted);
    }
  }
}

TEST_CASE("decimator: a curve that is kept stays one curve between its ends, along vertices of it",
          "[simplify][fast]") {
  const TriangleMesh<double> mesh = wavy_sheet(20);
  EdgeMarks marks(static_cast<std::size_t>(mesh.halfedge_count()), 0);
  std::set<Index> middle;  // vertices of the line x = 1/2
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const auto on = [&](Index v) { return std::abs(mesh.position(v).x() - 0.5) < 1e-12; };
    if (!on(mesh.origin(h)) || !on(mesh.target(h))) continue;
    marks[static_cast<std::size_t>(h)] = 1;
    middle.insert({mesh.origin(h), mesh.target(h)});
  }
  Context context;
  detail::Decimator decimator(mesh, 0.05, 0.3, context, marks);
  REQUIRE(decimator.reduce(60, context).ok());
  std::map<Index, Index> ends;  // how many kept edges each vertex has
  std::set<std::pair<Index, Index>> kept;
  for (const auto& face : decimator.faces())
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(face[i], face[(i + 1) % 3]);
      if (decimator.kept(low, high) && kept.insert({low, high}).second) {
        ++ends[low];
        ++ends[high];
      }
    }
  REQUIRE(!kept.empty());
  Index single = 0;
  for (const auto& [v, count] : ends) {
    CHECK(middle.contains(v));
    CHECK(count <= 2);
    single += count == 1;
  }
  CHECK(single == 2);
}

TEST_CASE("decimator: a stop is heard", "[simplify][fast]") {
  const TriangleMesh<double> mesh = wavy_sheet(20);
  Context context;
  detail::Decimator decimator(mesh, 0.05, 0.3, context);
  std::atomic<bool> stop = true;
  context.cancel_flag = &stop;
  const Status status = decimator.reduce(10, context);
  REQUIRE_FALSE(status.ok());
  CHECK(status.error().code == ErrorCode::cancelled);
}

TEST_CASE("pairing: polygons cover every triangle once, and their quads are as good as asked", "[simplify][fast]") {
  for (const TriangleMesh<double>& mesh : {wavy_sheet(12), ring()}) {
    const std::vector<Vector3> points = points_of(mesh);
    std::vector<std::array<Index, 3>> faces;
    for (Index f = 0; f < mesh.face_count(); ++f)
      faces.push_back({mesh.faces()(f, 0), mesh.faces()(f, 1), mesh.faces()(f, 2)});
    detail::Pairing pairing(points, faces, 0.3);
    const auto check = [&] {
      std::multiset<std::array<Index, 2>> sides, of_mesh;  // directed sides, but those inside of pairs
      Index quads = 0, pairs = 0;
      for (const detail::SplitPolygon& polygon : pairing.polygons()) {
        const std::size_t n = polygon.size();
        quads += static_cast<Index>(n);
        pairs += n == 4;
        for (std::size_t i = 0; i < n; ++i) sides.insert({polygon.corner[i], polygon.corner[(i + 1) % n]});
      }
      CHECK(quads == pairing.quad_count());
      CHECK(pairs == pairing.pair_count());
      for (const auto& face : faces)
        for (std::size_t i = 0; i < 3; ++i) of_mesh.insert({face[i], face[(i + 1) % 3]});
      CHECK(sides.size() == of_mesh.size() - 2 * static_cast<std::size_t>(pairs));
      for (const auto& side : sides) CHECK(of_mesh.count(side) == 1);
    };
    check();
    CHECK(pairing.pair_count() > mesh.face_count() / 4);  // more than half of the triangles
    const Index before = pairing.quad_count();
    pairing.part(before + 9);
    CHECK(pairing.quad_count() >= before + 9);
    CHECK(pairing.quad_count() <= before + 10);
    check();
  }
}

TEST_CASE("placement: polygons become valid quads of the same topology, on the surface", "[simplify][fast]") {
  for (const TriangleMesh<double>& mesh : {wavy_sheet(16), ring()}) {
    Context context;
    detail::Decimator decimator(mesh, 0.05, 0.3, context);
    REQUIRE(decimator.reduce(120, context).ok());
    const std::vector<Vector3> points = points_of(mesh);
    const detail::Pairing pairing(points, decimator.faces(), 0.3);
    detail::SplitPlacer placer(mesh, points, detail::vertex_points(mesh), pairing.polygons());
    REQUIRE(placer.run(context).ok());
    const QuadMesh quads = placer.result();
    CHECK(quads.quad_count() == pairing.quad_count());
    const MeshStatistics statistics = mesh_statistics(quads);
    CHECK(statistics.euler == euler_number(mesh));
    CHECK(statistics.misoriented_edges + statistics.nonmanifold_edges + statistics.nonmanifold_vertices == 0);
    CHECK(statistics.scaled_jacobian_minimum > 0);
    double off = 0;
    for (Index v = 0; v < quads.vertex_count(); ++v)
      off += (position(mesh, quads.source[static_cast<std::size_t>(v)]) - quads.positions.row(v).transpose()).norm() >
             1e-9;
    CHECK(off <= 0.05 * quads.vertex_count());  // some may stay beside it for a quad to stay valid
  }
}

TEST_CASE("voxel body: cells inside a closed surface are body, far ones are air, and a hole changes neither",
          "[weights][fast]") {
  const TriangleMesh<double> whole = ring();
  const TriangleMesh<double> holed =
      test::build(whole.positions(), Triangles(whole.faces().topRows(whole.face_count() - 2)));
  for (const TriangleMesh<double>& mesh : {whole, holed}) {
    const detail::VoxelBody body(mesh, Skeleton{}, 48);
    Index inside = 0, outside = 0;
    for (std::size_t cell = 0; cell < body.cell_count(); ++cell) {
      const Vector3 p = body.centre(cell);
      CHECK(body.cell_of(p) == cell);
      const double tube = std::hypot(std::hypot(p.x(), p.y()) - 2, p.z());  // the ring has radii 2 and 0.7
      if (tube < 0.7 - 2 * body.side()) {
        CHECK(body.is_body(cell));
        ++inside;
      }
      if (tube > 0.7 + 2 * body.side()) {
        CHECK_FALSE(body.is_body(cell));
        ++outside;
      }
    }
    CHECK(inside > 1000);
    CHECK(outside > 1000);
  }
}

TEST_CASE("voxel body: the part of a segment inside the grid is where its points are", "[weights][fast]") {
  const detail::VoxelBody body(ring(), Skeleton{}, 16);
  const auto part = body.part_inside({-100, 0, 0}, {100, 0, 0});
  REQUIRE(part);
  CHECK(part->first > 0.48);
  CHECK(part->first < 0.49);
  CHECK(part->first + part->second == Approx(1).epsilon(0.01));
  CHECK_FALSE(body.part_inside({-100, 50, 0}, {100, 50, 0}));
  const auto all = body.part_inside({-1, 0, 0}, {1, 0, 0});
  REQUIRE(all);
  CHECK(*all == std::pair(0.0, 1.0));
}

TEST_CASE("split edges: the surface stays what it is, and each face knows the one it is part of", "[prepare][fast]") {
  const TriangleMesh<double> mesh = wavy_sheet(6);
  std::mt19937 random(5);
  std::vector<char> marked(static_cast<std::size_t>(mesh.halfedge_count()), 0);
  for (char& each : marked) each = random() % 4 == 0;
  std::size_t edges = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index g = mesh.twin(h);
    const bool cut = marked[static_cast<std::size_t>(h)] || (g != no_index && marked[static_cast<std::size_t>(g)]);
    edges += mesh.is_representative(h) && cut;
  }
  const Refinement fine = split_edges(mesh, marked, [](Index) { return 0.3; });
  CHECK(fine.mesh.vertex_count() == mesh.vertex_count() + static_cast<Index>(edges));
  CHECK(euler_number(fine.mesh) == euler_number(mesh));
  std::vector<double> area(static_cast<std::size_t>(mesh.face_count()), 0);
  for (Index f = 0; f < fine.mesh.face_count(); ++f) {
    const Index parent = fine.source_face[static_cast<std::size_t>(f)];
    area[static_cast<std::size_t>(parent)] += fine.mesh.area(f);
    CHECK(fine.mesh.normal(f).dot(mesh.normal(parent)) == Approx(1));
  }
  for (Index f = 0; f < mesh.face_count(); ++f) CHECK(area[static_cast<std::size_t>(f)] == Approx(mesh.area(f)));
  for (Index v = 0; v < fine.mesh.vertex_count(); ++v)
    CHECK((position(mesh, fine.source[static_cast<std::size_t>(v)]) - fine.mesh.position(v)).norm() < 1e-14);
}

TEST_CASE("options: each that is out of range is refused by its name", "[mesh][fast]") {
  const auto named = [](const Status& status, const std::string& field) {
    return !status.ok() && status.error().code == ErrorCode::bad_option &&
           status.error().message().find(field) != std::string::npos;
  };
  CHECK(PolishOptions().validate().ok());
  CHECK(named(PolishOptions{.rounds = -1}.validate(), "rounds"));
  CHECK(named(PolishOptions{.accepted = 2}.validate(), "accepted"));
  CHECK(named(PolishOptions{.wanted = std::nan("")}.validate(), "wanted"));
  CHECK(RefineOptions().validate().ok());
  CHECK(named(RefineOptions{.max_faces = 0}.validate(), "max_faces"));
  CHECK(GuidanceOptions().validate().ok());
  CHECK(named(GuidanceOptions{.rule_limit = -0.1}.validate(), "rule_limit"));
  CHECK(named(GuidanceOptions{.least_projection = 2}.validate(), "least_projection"));
  CHECK(named(DistanceOptions{.samples = 0}.validate(), "samples"));
  SplitOptions split;
  CHECK(split.validate().ok());
  split.polish.freed = 7;
  CHECK(named(split.validate(), "freed"));
  Context context;
  CHECK_FALSE(split_quads(wavy_sheet(4), split, context));
  CHECK_FALSE(refine(
      wavy_sheet(2), [](Index) { return 1.0; }, RefineOptions{.max_faces = -5}, context));
}
