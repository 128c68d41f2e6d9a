#include "quadrig/simplify.hpp"

#include <map>
#include <queue>
#include <set>

#include "quadrig/simplify/decimate.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using quadrig::test::build;
using quadrig::test::Grid;

namespace {

Points<double> points(std::initializer_list<std::array<double, 3>> list) {
  Points<double> result(static_cast<Eigen::Index>(list.size()), 3);
  Eigen::Index row = 0;
  for (const auto& p : list) result.row(row++) << p[0], p[1], p[2];
  return result;
}

Triangles triangles(std::initializer_list<std::array<Index, 3>> list) {
  Triangles result(static_cast<Eigen::Index>(list.size()), 3);
  Eigen::Index row = 0;
  for (const auto& f : list) result.row(row++) << f[0], f[1], f[2];
  return result;
}

struct Topology {
  Index euler = 0, components = 0, loops = 0;
  bool operator==(const Topology& other) const {
    return std::tie(euler, components, loops) == std::tie(other.euler, other.components, other.loops);
  }
};

/// Counts, of polygons of `corners` corners each; requires that every edge has one face, or two that run it oppositely,
/// and that the faces of a vertex form one fan.
template <class Faces>
Topology topology(const Faces& faces) {
  const auto corners = static_cast<Index>(faces.cols());
  bool sound = true;
  std::map<std::array<Index, 2>, std::array<Index, 2>> across;  // directed edge: face, corner
  std::map<Index, Index> used;                                  // corners of each vertex
  for (Index f = 0; f < static_cast<Index>(faces.rows()); ++f)
    for (Index i = 0; i < corners; ++i) {
      const Index a = faces(f, i), b = faces(f, (i + 1) % corners);
      sound = sound && a != b;
      sound = across.emplace(std::array{a, b}, std::array{f, i}).second && sound;
      ++used[a];
    }
  Topology result;
  Index edges = 0;
  std::map<Index, Index> along;  // boundary: from vertex to vertex
  std::vector<Index> component(static_cast<std::size_t>(faces.rows()), no_index);
  for (const auto& [edge, place] : across) {
    const bool boundary = !across.contains({edge[1], edge[0]});
    edges += boundary || edge[0] < edge[1];
    if (boundary) sound = along.emplace(edge[0], edge[1]).second && sound;
  }
  for (Index seed = 0; seed < static_cast<Index>(faces.rows()); ++seed) {
    if (component[static_cast<std::size_t>(seed)] != no_index) continue;
    std::vector<Index> stack{seed};
    component[static_cast<std::size_t>(seed)] = result.components++;
    while (!stack.empty()) {
      const Index f = stack.back();
      stack.pop_back();
      for (Index i = 0; i < corners; ++i) {
        const auto twin = across.find({faces(f, (i + 1) % corners), faces(f, i)});
        if (twin == across.end() || component[static_cast<std::size_t>(twin->second[0])] != no_index) continue;
        component[static_cast<std::size_t>(twin->second[0])] = component[static_cast<std::size_t>(seed)];
        stack.push_back(twin->second[0]);
      }
    }
  }
  // One fan a vertex: turning from any corner, or from the first of a boundary fan, meets them all.
  std::map<Index, std::array<Index, 2>> start;
  for (const auto& [edge, place] : across)
    if (!across.contains({edge[1], edge[0]}) || !start.contains(edge[0])) start[edge[0]] = place;
  for (const auto& [v, place] : start) {
    Index seen = 0;
    for (std::array<Index, 2> at = place; seen <= used[v];) {
      ++seen;
      const auto next = across.find({v, faces(at[0], (at[1] + corners - 1) % corners)});
      if (next == across.end() || next->second == place) break;
      at = next->second;
    }
    sound = sound && seen == used[v];
  }
  REQUIRE(sound);
  while (!along.empty()) {
    ++result.loops;
    for (auto it = along.begin(); it != along.end();) {
      const Index next = it->second;
      along.erase(it);
      it = along.find(next);
    }
  }
  result.euler = static_cast<Index>(used.size()) - edges + static_cast<Index>(faces.rows());
  return result;
}

SplitQuads split(const TriangleMesh<double>& mesh, Index quads) {
  Context context;
  SplitOptions options;
  options.quads = quads;
  Expected<SplitQuads> result = split_quads(mesh, options, context);
  INFO((result ? std::string() : result.error().message()));
  REQUIRE(result.has_value());
  return std::move(*result);
}

/// What holds for every surface and every count.
void check_valid(const TriangleMesh<double>& mesh, const SplitQuads& result) {
  const QuadMesh& quads = result.mesh;
  REQUIRE(quads.quad_count() > 0);
  REQUIRE(quads.source.size() == static_cast<std::size_t>(quads.vertex_count()));
  CHECK(topology(quads.quads) == topology(mesh.faces()));
  double least = 1, farthest = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    least = std::min(least, scaled_jacobian(quads.positions, quads.quads.row(q)));
  CHECK(least > 0);
  CHECK(least == result.report.least_jacobian);
  Index beside = 0;
  for (Index v = 0; v < quads.vertex_count(); ++v) {
    const SurfacePoint& source = quads.source[static_cast<std::size_t>(v)];
    const bool sound = source.face >= 0 && source.face < mesh.face_count() && source.barycentric.minCoeff() >= 0 &&
                       std::abs(source.barycentric.sum() - 1) < 1e-9;
    if (!sound) FAIL("vertex " << v << " has no sound source");
    const double distance = (position(mesh, source) - quads.positions.row(v).transpose()).norm();
    farthest = std::max(farthest, distance);
    beside += distance > 1e-9 * mesh.diagonal();
  }
  CHECK(beside == result.report.off_surface);
  CHECK(farthest == result.report.largest_distance);
}

/// A plate of two sheets of n × n cells on the unit square, joined by a rim of height `thickness`.
TriangleMesh<double> plate(Index n, double thickness) {
  const Index sheet = (n + 1) * (n + 1);
  Points<double> positions(2 * sheet, 3);
  const auto vertex = [&](Index i, Index j, Index side) { return i + j * (n + 1) + side * sheet; };
  for (Index side = 0; side < 2; ++side)
    for (Index j = 0; j <= n; ++j)
      for (Index i = 0; i <= n; ++i)
        positions.row(vertex(i, j, side)) << static_cast<double>(i) / n, static_cast<double>(j) / n, side * thickness;
  std::vector<std::array<Index, 3>> faces;
  const auto quad = [&](Index a, Index b, Index c, Index d) {
    faces.push_back({a, b, c});
    faces.push_back({a, c, d});
  };
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      quad(vertex(i, j, 1), vertex(i + 1, j, 1), vertex(i + 1, j + 1, 1), vertex(i, j + 1, 1));
      quad(vertex(i, j, 0), vertex(i, j + 1, 0), vertex(i + 1, j + 1, 0), vertex(i + 1, j, 0));
    }
    quad(vertex(j, 0, 0), vertex(j + 1, 0, 0), vertex(j + 1, 0, 1), vertex(j, 0, 1));
    quad(vertex(j + 1, n, 0), vertex(j, n, 0), vertex(j, n, 1), vertex(j + 1, n, 1));
    quad(vertex(0, j + 1, 0), vertex(0, j, 0), vertex(0, j, 1), vertex(0, j + 1, 1));
    quad(vertex(n, j, 0), vertex(n, j + 1, 0), vertex(n, j + 1, 1), vertex(n, j, 1));
  }
  Triangles triangles(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    triangles.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
  return build(std::move(positions), std::move(triangles));
}

TriangleMesh<double> torus(Index columns, Index rows, double small) {
  Grid grid{columns, rows, true, true};
  return build(test::torus_positions(grid, 2, small), grid.triangles());
}

/// A wavy square with faces left out at random, mended.
TriangleMesh<double> torn_sheet(unsigned seed) {
  std::mt19937 random(seed);
  Grid grid{24, 24};
  const Points<double> positions =
      grid.positions([](Index i, Index j) { return Vector3(i, j, 2 * std::sin(0.4 * i) * std::cos(0.3 * j)); });
  const Triangles all = grid.triangles();
  PolygonMesh mesh;
  mesh.positions = positions;
  for (Eigen::Index f = 0; f < all.rows(); ++f)
    if (random() % 16 != 0) mesh.add_polygon(std::array{all(f, 0), all(f, 1), all(f, 2)});
  Context context;
  return std::move(prepare(mesh, nullptr, {}, context)->mesh);
}

}  // namespace

TEST_CASE("simplify: the smallest surfaces give valid quads at every count", "[simplify][fast]") {
  const Points<double> corners = points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  const std::vector<TriangleMesh<double>> meshes{
      build(corners, triangles({{0, 1, 2}})),
      build(corners, triangles({{0, 1, 2}, {1, 0, 3}})),
      build(corners, triangles({{0, 2, 1}, {0, 1, 3}, {1, 2, 3}})),
      build(corners, triangles({{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}})),
      build(points({{0, 0, 0}, {1, 0, 0}, {0.3, 1e-6, 0}}), triangles({{0, 1, 2}})),
      build(points({{0, 0, 0}, {1, 0, 0}, {1, 1e-6, 0}}), triangles({{0, 1, 2}})),
      torus(3, 3, 1),
  };
  for (const TriangleMesh<double>& mesh : meshes)
    for (const Index count : {1, 3, 12, 50, 300}) check_valid(mesh, split(mesh, count));
}

TEST_CASE("simplify: the count is met within one in twenty where the surface allows it", "[simplify][fast]") {
  Grid grid{40, 40};
  const std::vector<TriangleMesh<double>> meshes{
      torus(30, 60, 1), plate(16, 0.2),
      build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0); }), grid.triangles())};
  for (const TriangleMesh<double>& mesh : meshes)
    for (const Index count : {100, 300, 1000, 4000}) {
      const SplitQuads result = split(mesh, count);
      check_valid(mesh, result);
      CHECK(std::abs(result.mesh.quad_count() - count) <= count / 20);
      CHECK(result.report.off_surface == 0);
      CHECK(result.report.minimum_count == 0);
      CHECK(result.report.average_jacobian > 0.7);
    }
}

TEST_CASE("simplify: fewer quads than the topology allows give the fewest, and say so", "[simplify][fast]") {
  const TriangleMesh<double> mesh = torus(20, 40, 1);
  const SplitQuads result = split(mesh, 4);
  check_valid(mesh, result);
  CHECK(result.mesh.quad_count() < 200);
  CHECK(result.report.minimum_count == result.mesh.quad_count());
}

TEST_CASE("simplify: holes of any number and shape keep their loops when a sheet is torn", "[simplify][fast]") {
  const TriangleMesh<double> mesh = torn_sheet(0);
  for (const Index count : {20, 400, 1500}) check_valid(mesh, split(mesh, count));
}
TEST_CASE("simplify: so do those of many torn sheets", "[simplify][slow]") {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const TriangleMesh<double> mesh = torn_sheet(seed);
    for (const Index count : {20, 400, 1500}) check_valid(mesh, split(mesh, count));
  }
}

TEST_CASE("simplify: the border of the quads lies on the border of the surface", "[simplify][fast]") {
  Grid grid{20, 50, true, false};
  const TriangleMesh<double> mesh = build(test::tube_positions(grid, 6, 1), grid.triangles());
  const SplitQuads result = split(mesh, 200);
  check_valid(mesh, result);
  CHECK(result.report.off_surface == 0);
  std::map<std::array<Index, 2>, int> sides;
  for (Index q = 0; q < result.mesh.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Index a = result.mesh.quads(q, i), b = result.mesh.quads(q, (i + 1) % 4);
      ++sides[{std::min(a, b), std::max(a, b)}];
    }
  Index border = 0;
  for (const auto& [side, count] : sides) {
    if (count != 1) continue;
    ++border;
    for (const Index v : side) {
      const double x = result.mesh.positions(v, 0);
      CHECK(std::min(std::abs(x), std::abs(x - 6)) < 1e-9);
    }
  }
  CHECK(border >= 12);
}

TEST_CASE("simplify: thin plates stay two sheets whatever their thickness", "[simplify][fast]") {
  for (const double thickness : {1e-1, 1e-3, 1e-6}) {
    const TriangleMesh<double> mesh = plate(20, thickness);
    for (const Index count : {100, 1000}) {
      const SplitQuads result = split(mesh, count);
      check_valid(mesh, result);
      CHECK(std::abs(result.mesh.quad_count() - count) <= count / 20);
      double area = 0;
      for (Index q = 0; q < result.mesh.quad_count(); ++q) {
        const auto p = [&](int i) -> Vector3 { return result.mesh.positions.row(result.mesh.quads(q, i)).transpose(); };
        area += (p(2) - p(0)).cross(p(3) - p(1)).norm() / 2;
      }
      CHECK(area == Approx(2 + 4 * thickness).epsilon(count < 1000 ? 0.1 : 0.03));
    }
  }
}

TEST_CASE("simplify: sampling of 1 : 1000, noise and folds leave no quad inverted", "[simplify][fast]") {
  for (unsigned seed = 0; seed < 6; ++seed) {
    std::mt19937 random(seed);
    const auto noise = [&](double size) { return size * (static_cast<double>(random() % 2001) / 1000 - 1); };
    Grid grid{30, 30, seed % 3 == 2, seed % 3 == 2};
    const TriangleMesh<double> mesh = build(grid.positions([&](Index i, Index j) -> Vector3 {
      if (seed % 3 == 0) return {std::pow(10, i / 10.0), std::pow(10, j / 10.0), std::sin(0.3 * i + 0.2 * j)};
      if (seed % 3 == 1) return {i + noise(1.2), j + noise(1.2), noise(1)};
      return {noise(1), noise(1), noise(1)};  // a torus through itself everywhere
    }),
                                            grid.triangles());
    for (const Index count : {30, 500}) check_valid(mesh, split(mesh, count));
  }
}

TEST_CASE("simplify: whatever faces are joined at random, what prepare lets through becomes quads",
          "[simplify][fast]") {
  for (unsigned seed = 0; seed < 100; ++seed) {
    std::mt19937 random(seed);
    PolygonMesh mesh;
    const Index n = 4 + static_cast<Index>(random() % 8);
    mesh.positions.resize(n, 3);
    for (Eigen::Index i = 0; i < mesh.positions.size(); ++i)
      mesh.positions.data()[i] = seed % 3 ? static_cast<double>(random() % 1000) : static_cast<double>(random() % 3);
    const Index faces = 1 + static_cast<Index>(random() % 30);
    for (Index f = 0; f < faces; ++f) {
      std::array<Index, 3> polygon{};
      for (Index& v : polygon) v = static_cast<Index>(random() % static_cast<unsigned>(n));
      mesh.add_polygon(polygon);
    }
    Context context;
    const Expected<Prepared> ready = prepare(mesh, nullptr, {}, context);
    if (!ready) continue;
    INFO("seed " << seed);
    for (const Index count : {5, 200}) check_valid(ready->mesh, split(ready->mesh, count));
  }
}

TEST_CASE("simplify: no thread count and no repetition changes a bit", "[simplify][fast]") {
  const TriangleMesh<double> mesh = torus(24, 40, 0.7);
  SplitOptions options;
  options.quads = 500;
  std::optional<SplitQuads> first;
  for (const unsigned threads : {1u, 2u, 16u}) {
    Context context;
    context.threads = threads;
    Expected<SplitQuads> result = split_quads(mesh, options, context);
    REQUIRE(result.has_value());
    if (!first)
      first = std::move(*result);
    else {
      CHECK(result->mesh.positions == first->mesh.positions);
      CHECK(result->mesh.quads == first->mesh.quads);
    }
  }
}

TEST_CASE("simplify: bad options and empty meshes are refused by name, and a stop is heard", "[simplify][fast]") {
  const TriangleMesh<double> mesh = torus(12, 20, 0.7);
  Context context;
  const auto refusal = [&](const TriangleMesh<double>& of, const SplitOptions& options) {
    const Expected<SplitQuads> result = split_quads(of, options, context);
    REQUIRE_FALSE(result.has_value());
    return result.error();
  };
  SplitOptions options;
  options.quads = 0;
  CHECK(refusal(mesh, options).what.find("quads") != std::string::npos);
  options = {};
  options.uniformity = -1;
  CHECK(refusal(mesh, options).what.find("uniformity") != std::string::npos);
  options = {};
  options.pair_quality = 1;
  CHECK(refusal(mesh, options).what.find("pair_quality") != std::string::npos);
  CHECK(refusal(TriangleMesh<double>{}, {}).code == ErrorCode::bad_input);
  const std::atomic<bool> stop = true;
  context.cancel_flag = &stop;
  CHECK(refusal(mesh, {}).code == ErrorCode::cancelled);
}

TEST_CASE("simplify: the queue of costs gives the least first, in the order of one heap", "[simplify][fast]") {
  struct Item {
    double cost;
    int number;
    bool operator<(const Item& other) const { return std::tie(cost, number) > std::tie(other.cost, other.number); }
  };
  quadrig::detail::CostQueue<Item> queue(true);
  std::priority_queue<Item> heap;
  std::uint32_t state = 7;
  const auto random = [&] { return (state = state * 1664525u + 1013904223u) >> 8; };
  const double special[] = {0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, std::numeric_limits<double>::infinity()};
  for (int k = 0; k < 20'000; ++k) {
    if (random() % 3 != 0 || heap.empty()) {
      const double cost =
          random() % 8 == 0 ? special[random() % 7] : std::ldexp(random() - 8e6, int(random() % 80) - 40);
      queue.push({cost, k});
      heap.push({cost, k});
    } else {
      REQUIRE_FALSE(queue.empty());
      REQUIRE(queue.pop().number == heap.top().number);
      heap.pop();
    }
  }
  for (; !heap.empty(); heap.pop()) {
    REQUIRE_FALSE(queue.empty());
    REQUIRE(queue.pop().number == heap.top().number);
  }
  CHECK(queue.empty());
}

TEST_CASE("simplify: the queue of costs that is not exact is off by less than an eighth", "[simplify][fast]") {
  struct Item {
    double cost;
    int number;
    bool operator<(const Item& other) const { return cost > other.cost; }
  };
  quadrig::detail::CostQueue<Item> queue(false);
  std::multiset<double> costs;
  std::set<int> numbers;
  std::uint32_t state = 5;
  const auto random = [&] { return (state = state * 1664525u + 1013904223u) >> 8; };
  for (int k = 0; k < 20'000; ++k) {
    if (random() % 3 != 0 || costs.empty()) {
      const double cost = random() % 50 == 0 ? 0.0 : std::ldexp(1 + random() % 1000, int(random() % 20) - 10);
      queue.push({cost, k});
      costs.insert(cost);
    } else {
      REQUIRE_FALSE(queue.empty());
      const Item item = queue.pop();
      REQUIRE(item.cost <= 1.125 * *costs.begin());
      REQUIRE(numbers.insert(item.number).second);
      costs.erase(costs.find(item.cost));
    }
  }
  for (; !queue.empty(); costs.erase(costs.find(queue.pop().cost))) REQUIRE_FALSE(costs.empty());
  CHECK(costs.empty());
}

TEST_CASE("simplify: a dense grid loses vertices evenly", "[simplify][fast]") {
  const Grid grid{120, 120, false, false};
  const TriangleMesh<double> mesh =
      build(grid.positions([](Index i, Index j) { return Vector3(i, j, 3 * std::sin(0.05 * i) * std::cos(0.07 * j)); }),
            grid.triangles());
  Context context;
  constexpr Index wanted = 1000;
  quadrig::detail::Decimator decimator(mesh, 1.0, std::sqrt(2 * mesh.total_area() / wanted), context);
  REQUIRE(decimator.reduce(wanted, context));
  double sum = 0, least = 1;
  for (const auto& face : decimator.faces()) {
    const double quality =
        quadrig::detail::triangle_quality(mesh.position(face[0]), mesh.position(face[1]), mesh.position(face[2]));
    sum += quality;
    least = std::min(least, quality);
  }
  CHECK(decimator.face_count() <= wanted);
  CHECK(sum / decimator.face_count() > 0.78);
  CHECK(least > 0.3);
}
