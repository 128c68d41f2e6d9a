// What everything shares: loops over half-edges, edges as pairs of sides, disjoint sets, and matrices from outside.
#include "quadrig/mesh.hpp"

#include <set>

#include "quadrig/disjoint_sets.hpp"
#include "quadrig/dominance.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/solver/backend.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

TEST_CASE("mesh: the loop around a vertex meets each corner once, in turning order", "[mesh][fast]") {
  const test::Grid sheet{5, 4}, tube{6, 3, true};
  for (const auto& mesh :
       {test::build(sheet.positions([](Index i, Index j) { return Vector3(i, j, 0); }), sheet.triangles()),
        test::build(test::tube_positions(tube, 3, 1), tube.triangles())}) {
    std::vector<int> met(static_cast<std::size_t>(mesh.halfedge_count()), 0);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      Index before = no_index;
      for (const Index h : mesh.around(v)) {
        CHECK(mesh.origin(h) == v);
        if (before != no_index) CHECK(mesh.next_around(before) == h);
        before = h;
        ++met[static_cast<std::size_t>(h)];
      }
    }
    CHECK(met == std::vector<int>(met.size(), 1));
    for (Index f = 0; f < mesh.face_count(); ++f)
      for (const Index h : mesh.halfedges_of(f)) CHECK(mesh.face_of(h) == f);
  }
  Points<double> points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 9, 9, 9;
  const auto lone = test::build(points, (Triangles(1, 3) << 0, 1, 2).finished());
  for ([[maybe_unused]] const Index h : lone.around(3)) FAIL("vertex 3 has no face");
}

TEST_CASE("mesh: matrices of another width are an error that names them", "[mesh][fast]") {
  const Eigen::MatrixXd flat = Eigen::MatrixXd::Random(4, 2), deep = Eigen::MatrixXd::Random(4, 3);
  Eigen::MatrixXi triangle(1, 3), quad(1, 4);
  triangle << 0, 1, 2;
  quad << 0, 1, 2, 3;
  using Mesh = TriangleMesh<double>;
  const auto where = [](const auto& made) { return made ? std::string("none") : made.error().where; };
  CHECK(where(Mesh::create(flat, triangle)) == "positions");
  CHECK(where(Mesh::create(deep, quad)) == "faces");
  CHECK(where(Mesh::create(Points<double>(deep), quad)) == "faces");
  CHECK(where(Mesh::create(flat, Triangles(triangle))) == "positions");
  CHECK(where(Mesh::create(Eigen::MatrixXd(0, 0), Eigen::MatrixXi(0, 0))) == "positions");
  CHECK(where(PolygonMesh::from_triangles(flat, triangle)) == "positions");
  CHECK(where(PolygonMesh::from_triangles(deep, quad)) == "faces");
  const auto mesh = Mesh::create(deep, triangle);
  REQUIRE(mesh);
  CHECK(mesh->positions() == deep);
  CHECK(mesh->faces() == triangle);
  REQUIRE(Mesh::create(deep.topRows(3), triangle));  // expressions too
  const auto polygons = PolygonMesh::from_triangles(deep, triangle);
  REQUIRE(polygons);
  CHECK(polygons->polygon_count() == 1);
}

TEST_CASE("mesh: sides of one edge come together, each once, in the order of the edges", "[mesh][fast]") {
  std::mt19937 random(3);
  std::uniform_int_distribution<Index> any(0, 19);
  for (int trial = 0; trial < 20; ++trial) {
    Quads quads(25, 4);
    for (Index k = 0; k < quads.size(); ++k) quads.data()[k] = any(random);
    const auto sides = detail::sorted_by_edge(20, quads);
    std::set<Index> seen;
    std::pair<Index, Index> last{-1, -1};
    detail::for_each_edge(sides, [&](std::span<const detail::SortedSide> edge) {
      const std::pair key(edge[0].low, edge[0].high);
      CHECK(key > last);
      last = key;
      for (std::size_t k = 0; k < edge.size(); ++k) {
        const Index h = edge[k].halfedge, a = quads(h / 4, h % 4), b = quads(h / 4, (h % 4 + 1) % 4);
        CHECK(std::pair(std::min(a, b), std::max(a, b)) == key);
        if (k > 0) CHECK(edge[k - 1].halfedge < h);
        seen.insert(h);
      }
    });
    CHECK(seen.size() == static_cast<std::size_t>(quads.size()));
  }
}

TEST_CASE("mesh: half cotangents of a flat sheet make linear functions harmonic", "[mesh][fast]") {
  const test::Grid grid{6, 5};
  const auto mesh =
      test::build(grid.positions([](Index i, Index j) { return Vector3(i + 0.3 * j, j, 0); }), grid.triangles());
  const auto value = [&](Index v) { return 2 * mesh.position(v).x() - 3 * mesh.position(v).y(); };
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (mesh.on_boundary(v)) continue;
    double sum = 0;
    for (const Index h : mesh.around(v))
      sum += (half_cotangent(mesh, h) + half_cotangent(mesh, mesh.twin(h))) * (value(mesh.target(h)) - value(v));
    CHECK(std::abs(sum) < 1e-12);
  }
}

TEST_CASE("disjoint sets: what is joined in any order is what a search finds", "[mesh][fast]") {
  std::mt19937 random(1);
  constexpr Index n = 60;
  std::uniform_int_distribution<Index> any(0, n - 1);
  DisjointSets sets(n);
  std::vector<Index> label(n);  // the lowest member, by relabelling
  for (Index i = 0; i < n; ++i) label[static_cast<std::size_t>(i)] = i;
  for (int step = 0; step < 80; ++step) {
    const Index a = any(random), b = any(random);
    const Index from = label[static_cast<std::size_t>(a)], to = label[static_cast<std::size_t>(b)];
    CHECK(sets.join(a, b) == (from != to));
    for (Index& each : label)
      if (each == from || each == to) each = std::min(from, to);
    for (Index i = 0; i < n; ++i) REQUIRE(sets.find(i) == label[static_cast<std::size_t>(i)]);
  }
}

TEST_CASE("rig: the strongest shares stay, sum to 1, and ties go to the lower bone", "[mesh][fast]") {
  std::vector<BoneShare> shares{{4, 0.2}, {1, 0.5}, {3, 0.2}, {2, 0.0}, {0, 0.1}};
  REQUIRE(keep_strongest(shares, 3));
  REQUIRE(shares.size() == 3);
  CHECK(shares[0].bone == 1);
  CHECK(shares[1].bone == 3);
  CHECK(shares[2].bone == 4);
  CHECK(shares[0].weight + shares[1].weight + shares[2].weight == Approx(1));
  CHECK(shares[0].weight == Approx(0.5 / 0.9));
  std::vector<BoneShare> two{{1, 0.5}, {0, 0.0}};
  REQUIRE(keep_strongest(two, 4));
  CHECK(two.size() == 1);
  std::vector<BoneShare> none{{1, 0.0}};
  CHECK_FALSE(keep_strongest(none, 4));
  CHECK(none.empty());
}

TEST_CASE("dominance: weights alone give what a rig of them gives", "[dominance][fast]") {
  const test::Grid grid{4, 4};
  const auto mesh = test::build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0); }), grid.triangles());
  Rig rig;
  rig.skeleton.bones.resize(2);
  rig.weights.resize(mesh.vertex_count(), 2);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    rig.weights.insert(v, 0) = mesh.position(v).x() / 4;
    rig.weights.insert(v, 1) = 1 - mesh.position(v).x() / 4;
  }
  const auto one = Dominance::create(mesh, rig.weights), two = Dominance::create(mesh, rig);
  REQUIRE((one && two));
  CHECK(one->vertex_omega1() == two->vertex_omega1());
  for (Index f = 0; f < mesh.face_count(); ++f) CHECK(one->omega(f, 1) == two->omega(f, 1));
  rig.skeleton.bones.resize(3);
  CHECK_FALSE(Dominance::create(mesh, rig));
}

TEST_CASE("sparse: Eigen's lower triangle is viewed as it is, and anything else is refused with the column",
          "[solver][fast]") {
  using Matrix = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;
  Matrix whole(3, 3);
  whole.insert(0, 0) = 4;
  whole.insert(1, 0) = 1;
  whole.insert(0, 1) = 1;
  whole.insert(1, 1) = 5;
  whole.insert(2, 2) = 6;
  whole.makeCompressed();
  const Matrix lower = whole.triangularView<Eigen::Lower>();
  const auto view = hermitian_view(lower);
  REQUIRE(view);
  const std::vector<double> x{1, 2, 3};
  std::vector<double> y(3);
  multiply(*view, std::span<const double>(x), std::span<double>(y));
  CHECK(y == std::vector<double>{6, 11, 18});
  CHECK(view->values.data() == lower.valuePtr());
  const auto refused = [](const Matrix& matrix) {
    const auto made = hermitian_view(matrix);
    return made ? std::string() : made.error().where;
  };
  CHECK(refused(whole) == "matrix, column 1");
  Matrix gap(2, 2);
  gap.insert(0, 0) = 1;
  gap.makeCompressed();
  CHECK(refused(gap) == "matrix, column 1");
  CHECK(refused(Matrix(2, 3)) == "matrix");
}

TEST_CASE("solver: an order is each unknown once, or none", "[solver][fast]") {
  const auto sound = [](std::vector<Index> order) { return check_order(order, 3, "mine").ok(); };
  CHECK(sound({}));
  CHECK(sound({2, 0, 1}));
  CHECK_FALSE(sound({0, 1}));
  CHECK_FALSE(sound({0, 1, 1}));
  CHECK_FALSE(sound({0, 1, 3}));
  CHECK_FALSE(sound({0, 1, -1}));
  CHECK_FALSE(sound({0, 1, 2, 0}));
  const std::vector<Index> twice{0, 0, 1};
  CHECK(check_order(twice, 3, "mine").error().where == "solver mine");
}
