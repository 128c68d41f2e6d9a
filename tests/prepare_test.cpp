#include "quadrig/prepare.hpp"

#include "test.hpp"

using namespace quadrig;

namespace {

PolygonMesh polygons(std::initializer_list<std::array<double, 3>> points,
                     std::initializer_list<std::vector<Index>> faces) {
  PolygonMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  Eigen::Index row = 0;
  for (const auto& p : points) mesh.positions.row(row++) << p[0], p[1], p[2];
  for (const auto& f : faces) mesh.add_polygon(f);
  return mesh;
}

/// A cube of six quads, outward.
PolygonMesh cube() {
  return polygons({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}},
                  {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}});
}

/// The same polygons, each with vertices of its own.
PolygonMesh soup(const PolygonMesh& mesh) {
  PolygonMesh result;
  result.positions.resize(static_cast<Eigen::Index>(mesh.corners.size()), 3);
  for (Index i = 0; i < mesh.polygon_count(); ++i) {
    std::vector<Index> own;
    for (const Index v : mesh.polygon(i)) {
      const auto next = static_cast<Index>(own.size()) + mesh.first_corner[static_cast<std::size_t>(i)];
      result.positions.row(next) = mesh.positions.row(v);
      own.push_back(next);
    }
    result.add_polygon(own);
  }
  return result;
}

/// A torus of n × n quads.
PolygonMesh torus(Index n) {
  PolygonMesh mesh;
  mesh.positions.resize(n * n, 3);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) {
      const double u = 2 * 3.14159265358979 * i / n, v = 2 * 3.14159265358979 * j / n;
      mesh.positions.row(i * n + j) << (2 + std::cos(v)) * std::cos(u), (2 + std::cos(v)) * std::sin(u), std::sin(v);
      const Index i1 = (i + 1) % n, j1 = (j + 1) % n;
      mesh.add_polygon(std::array{i * n + j, i1 * n + j, i1 * n + j1, i * n + j1});
    }
  return mesh;
}

double volume(const TriangleMesh<double>& mesh) {
  double sum = 0;
  for (Index f = 0; f < mesh.face_count(); ++f)
    sum += mesh.position(mesh.faces()(f, 0)).dot(mesh.normal(f)) * mesh.area(f) / 3;
  return sum;
}

Index euler(const TriangleMesh<double>& mesh) { return mesh.vertex_count() - mesh.edge_count() + mesh.face_count(); }

Prepared prepared(const PolygonMesh& mesh, const PrepareOptions& options = {}) {
  Context context;
  Expected<Prepared> result = prepare(mesh, nullptr, options, context);
  INFO((result ? std::string() : result.error().message()));
  REQUIRE(result.has_value());
  CHECK(result->source_vertex.size() == static_cast<std::size_t>(result->mesh.vertex_count()));
  CHECK(result->source_polygon.size() == static_cast<std::size_t>(result->mesh.face_count()));
  CHECK(context.warnings.size() >= result->report.repairs().size());
  return std::move(*result);
}

Error refused(const PolygonMesh& mesh, const PrepareOptions& options = {}, const VertexWeights* weights = nullptr) {
  Context context;
  const Expected<Prepared> result = prepare(mesh, weights, options, context);
  REQUIRE_FALSE(result.has_value());
  CHECK_FALSE(result.error().what.empty());
  CHECK_FALSE(result.error().remedy.empty());
  return result.error();
}

VertexWeights weights_of(std::initializer_list<std::array<double, 2>> rows) {
  VertexWeights result(static_cast<Eigen::Index>(rows.size()), 2);
  Eigen::Index v = 0;
  for (const auto& row : rows) {
    for (Eigen::Index b = 0; b < 2; ++b) result.coeffRef(v, b) = row[static_cast<std::size_t>(b)];
    ++v;
  }
  return result;
}

}  // namespace

TEST_CASE("prepare: the two sides of two-sided triangles do not hide their seams", "[prepare][fast]") {
  const PolygonMesh sides = soup(cube());
  PolygonMesh mesh;
  mesh.positions = sides.positions;
  for (Index i = 0; i < sides.polygon_count(); ++i) {
    const auto q = sides.polygon(i);
    for (const std::array<Index, 3>& face : {std::array{q[0], q[1], q[2]}, std::array{q[0], q[2], q[3]}}) {
      mesh.add_polygon(face);
      mesh.add_polygon(std::array{face[2], face[1], face[0]});
    }
  }
  Context context;
  const auto prepared = prepare(mesh, nullptr, {}, context);
  REQUIRE(prepared.has_value());
  CHECK(prepared->mesh.face_count() == 12);
  CHECK(prepared->mesh.vertex_count() == 8);
  CHECK(prepared->mesh.closed());
  CHECK(prepared->report.repeated_faces == 12);
  CHECK(volume(prepared->mesh) > 0.99);
}

TEST_CASE("prepare: a clean mesh passes unchanged and without a word", "[prepare][fast]") {
  PrepareOptions strict;
  strict.strict = true;
  const Prepared result = prepared(cube(), strict);
  CHECK(result.report.repairs().empty());
  CHECK(result.mesh.vertex_count() == 8);
  CHECK(result.mesh.face_count() == 12);
  CHECK(result.report.polygons_cut == 6);
  CHECK(result.report.closed_components == 1);
  CHECK(volume(result.mesh) == Approx(1));
  for (Index v = 0; v < 8; ++v) CHECK(result.source_vertex[static_cast<std::size_t>(v)] == v);
}

TEST_CASE("prepare: a polygon soup closes when its doubled vertices are welded", "[prepare][fast]") {
  for (const PolygonMesh& mesh : {cube(), torus(12)}) {
    const Prepared result = prepared(soup(mesh));
    CHECK(result.mesh.closed());
    CHECK(result.mesh.vertex_count() == mesh.vertex_count());
    CHECK(result.report.welded_vertices == static_cast<Index>(mesh.corners.size()) - mesh.vertex_count());
    CHECK(result.report.doubled_vertices == result.report.welded_vertices);
    PrepareOptions never;
    never.weld = Weld::never;
    CHECK_FALSE(prepared(soup(mesh), never).mesh.closed());
    PrepareOptions strict;
    strict.strict = true;
    CHECK(refused(soup(mesh), strict).what.find("welded") != std::string::npos);
  }
}

TEST_CASE("prepare: vertices within the weld distance become one", "[prepare][fast]") {
  PolygonMesh mesh = soup(cube());
  std::mt19937 random(7);
  for (Eigen::Index i = 0; i < mesh.positions.size(); ++i)
    mesh.positions.data()[i] += 1e-5 * (static_cast<double>(random() % 1000) / 1000 - 0.5);
  CHECK_FALSE(prepared(mesh).mesh.closed());
  PrepareOptions options;
  options.weld_distance = 1e-4;
  CHECK(prepared(mesh, options).mesh.closed());
}

TEST_CASE("prepare: shells that touch stay apart when only seams are welded", "[prepare][fast]") {
  PolygonMesh two = cube();
  const PolygonMesh other = cube();
  two.positions.conservativeResize(16, 3);
  two.positions.bottomRows(8) = other.positions.rowwise() + Eigen::RowVector3d(1, 0, 0);
  for (Index i = 0; i < 6; ++i) {
    std::vector<Index> polygon(other.polygon(i).begin(), other.polygon(i).end());
    for (Index& v : polygon) v += 8;
    two.add_polygon(polygon);
  }
  const Prepared result = prepared(two);
  CHECK(result.report.components == 2);
  CHECK(result.report.welded_vertices == 0);
  CHECK(result.report.doubled_vertices == 4);
  CHECK(result.mesh.vertex_count() == 16);
}

TEST_CASE("prepare: two cubes on one edge become two closed shells when their edge has four faces", "[prepare][fast]") {
  // The second cube stands diagonally behind the first: its edge 0-4 is the first one's edge 2-6.
  PolygonMesh two = cube();
  two.positions.conservativeResize(14, 3);
  const PolygonMesh other = cube();
  std::array<Index, 8> number{};
  Index next = 8;
  for (Index v = 0; v < 8; ++v) {
    const Eigen::RowVector3d p = other.positions.row(v) + Eigen::RowVector3d(1, 1, 0);
    if (v == 0)
      number[0] = 2;
    else if (v == 4)
      number[4] = 6;
    else {
      two.positions.row(next) = p;
      number[static_cast<std::size_t>(v)] = next++;
    }
  }
  for (Index i = 0; i < 6; ++i) {
    std::vector<Index> polygon;
    for (const Index v : other.polygon(i)) polygon.push_back(number[static_cast<std::size_t>(v)]);
    two.add_polygon(polygon);
  }
  const Prepared result = prepared(two);
  CHECK(result.report.split_edges == 1);
  CHECK(result.report.split_vertices == 2);
  CHECK(result.report.components == 2);
  CHECK(result.report.closed_components == 2);
  CHECK(result.mesh.vertex_count() == 16);
  CHECK(volume(result.mesh) == Approx(2));
}

TEST_CASE("prepare: any number of faces may share one edge", "[prepare][fast]") {
  for (const Index pages : {Index{5}, Index{64}, Index{65}, Index{3000}}) {
    PolygonMesh book;
    book.positions.resize(pages + 2, 3);
    book.positions.row(0) << 0, 0, 0;
    book.positions.row(1) << 0, 0, 1;
    for (Index k = 0; k < pages; ++k) {
      const double angle = 6.283185307179586 * k / pages;
      book.positions.row(k + 2) << std::cos(angle), std::sin(angle), 0.5;
      book.add_polygon(std::array<Index, 3>{0, 1, static_cast<Index>(k + 2)});
    }
    const Prepared result = prepared(book);
    CHECK(result.report.split_edges == 1);
    CHECK(result.mesh.face_count() == pages);
    CHECK(result.report.components == (pages + 1) / 2);  // pairs of pages, and the last alone
  }
}

TEST_CASE("prepare: a vertex of two fans is doubled", "[prepare][fast]") {
  const PolygonMesh bow_tie =
      polygons({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 3, 4}});
  const Prepared result = prepared(bow_tie);
  CHECK(result.report.split_vertices == 1);
  CHECK(result.mesh.vertex_count() == 6);
  CHECK(result.source_vertex.back() == 0);
}

TEST_CASE("prepare: faces are turned to agree, and outward where they close", "[prepare][fast]") {
  std::mt19937 random(3);
  for (int trial = 0; trial < 20; ++trial) {
    PolygonMesh mesh = trial % 2 ? torus(9) : cube();
    const Prepared before = prepared(mesh);
    for (Index i = 0; i < mesh.polygon_count(); ++i) {
      if (random() % 2) continue;
      const auto first = mesh.corners.begin() + mesh.first_corner[static_cast<std::size_t>(i)];
      std::reverse(first, first + 4);
    }
    const Prepared result = prepared(mesh);
    CHECK(volume(result.mesh) == Approx(volume(before.mesh)));
    CHECK(result.mesh.closed());
    CHECK(result.report.split_vertices == 0);
  }
}

TEST_CASE("prepare: a cavity keeps facing inward", "[prepare][fast]") {
  PolygonMesh hollow = cube();
  hollow.positions.conservativeResize(16, 3);
  hollow.positions.bottomRows(8) = (cube().positions * 0.5).rowwise() + Eigen::RowVector3d(0.25, 0.25, 0.25);
  const PolygonMesh inner = cube();
  for (Index i = 0; i < 6; ++i) {
    std::vector<Index> polygon(inner.polygon(i).rbegin(), inner.polygon(i).rend());
    for (Index& v : polygon) v += 8;
    hollow.add_polygon(polygon);
  }
  CHECK(volume(prepared(hollow).mesh) == Approx(1 - 0.125));
}

TEST_CASE("prepare: a Moebius band is cut across", "[prepare][fast]") {
  PolygonMesh band;
  const Index n = 20;
  band.positions.resize(2 * n, 3);
  for (Index i = 0; i < n; ++i) {
    const double u = 2 * 3.14159265358979 * i / n;
    for (Index s = 0; s < 2; ++s) {
      const double t = 0.3 * (2 * s - 1), r = 1 + t * std::cos(u / 2);
      band.positions.row(2 * i + s) << r * std::cos(u), r * std::sin(u), t * std::sin(u / 2);
    }
    const bool last = i + 1 == n;
    const Index a = last ? 1 : 2 * i + 2, b = last ? 0 : 2 * i + 3;
    band.add_polygon(std::array{2 * i, a, b, 2 * i + 1});
  }
  const Prepared result = prepared(band);
  CHECK(result.report.twisted_edges > 0);
  CHECK(result.mesh.face_count() == 2 * n);
  CHECK(euler(result.mesh) == 1);  // a disk
}

TEST_CASE("prepare: degenerate, repeated and unreferenced things are dropped and counted", "[prepare][fast]") {
  PolygonMesh mesh = cube();
  mesh.positions.conservativeResize(10, 3);
  mesh.positions.bottomRows(2).setConstant(5);
  mesh.add_polygon(std::array{0, 0, 1});
  mesh.add_polygon(std::array{1, 2, 1});
  mesh.add_polygon(std::array{0, 3, 2, 1});
  const Prepared result = prepared(mesh);
  CHECK(result.report.degenerate_faces == 2);
  CHECK(result.report.repeated_faces == 2);
  CHECK(result.report.unreferenced_vertices == 2);
  CHECK(result.mesh.face_count() == 12);
  CHECK(result.mesh.closed());
}

TEST_CASE("prepare: faces without area go and leave no hole", "[prepare][fast]") {
  SECTION("a cap on an inner edge") {
    // Vertex 4 lies on the diagonal 0-2 of a square, in a face of no area.
    const PolygonMesh mesh = polygons({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.25, 0.25, 0}},
                                      {{0, 1, 2}, {0, 2, 4}, {0, 4, 3}, {4, 2, 3}});
    const Prepared result = prepared(mesh);
    CHECK(result.report.flat_faces == 1);
    CHECK(result.mesh.face_count() == 4);
    CHECK(result.mesh.vertex_count() == 5);
    CHECK(result.mesh.total_area() == Approx(1));
    CHECK(result.mesh.areas().minCoeff() > 0.1);
    CHECK(result.mesh.halfedge_count() - 2 * result.mesh.interior_edge_count() == 4);
  }
  SECTION("a needle in a closed surface") {
    PolygonMesh mesh = cube();
    mesh.positions.conservativeResize(9, 3);
    mesh.positions.row(8) = mesh.positions.row(6);
    mesh.corners.clear();
    mesh.first_corner.clear();
    for (const auto& face : std::initializer_list<std::vector<Index>>{
             {0, 3, 2, 1}, {4, 5, 6, 8, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 8, 6}, {3, 0, 4, 7}})
      mesh.add_polygon(face);
    const Prepared result = prepared(mesh);
    CHECK(result.report.contracted_edges == 1);
    CHECK(result.mesh.closed());
    CHECK(result.mesh.vertex_count() == 8);
    CHECK(volume(result.mesh) == Approx(1));
  }
  SECTION("many collinear points in a fan") {
    PolygonMesh mesh = cube();
    const Index n = 9;
    mesh.positions.conservativeResize(8 + n, 3);
    std::vector<Index> top{4, 5, 6}, side{2, 3, 7};
    for (Index i = 0; i < n; ++i) {
      mesh.positions.row(8 + i) << 1 - (i + 1.0) / (n + 1), 1, 1;
      top.push_back(8 + i);
    }
    for (Index i = n; i-- > 0;) side.push_back(8 + i);
    top.push_back(7);
    side.push_back(6);
    mesh.corners.clear();
    mesh.first_corner.clear();
    mesh.add_polygon(std::array{0, 3, 2, 1});
    for (std::size_t i = 1; i + 1 < top.size(); ++i) mesh.add_polygon(std::array{top[0], top[i], top[i + 1]});
    mesh.add_polygon(std::array{2, 3, 7});
    for (std::size_t i = 3; i + 1 < side.size(); ++i) mesh.add_polygon(std::array{7, side[i], side[i + 1]});  // flat
    mesh.add_polygon(std::array{7, 6, 2});
    mesh.add_polygon(std::array{0, 1, 5, 4});
    mesh.add_polygon(std::array{1, 2, 6, 5});
    mesh.add_polygon(std::array{3, 0, 4, 7});
    const Prepared result = prepared(mesh);
    CHECK(result.mesh.closed());
    CHECK(result.mesh.areas().minCoeff() > 1e-4);
    CHECK(volume(result.mesh) == Approx(1));
  }
}

TEST_CASE("prepare: whatever faces are joined at random, the result is manifold", "[prepare][fast]") {
  for (unsigned seed = 0; seed < 400; ++seed) {
    std::mt19937 random(seed);
    PolygonMesh mesh;
    const Index n = 4 + static_cast<Index>(random() % 8);
    mesh.positions.resize(n, 3);
    for (Eigen::Index i = 0; i < mesh.positions.size(); ++i)
      mesh.positions.data()[i] = seed % 3 ? static_cast<double>(random() % 1000) : static_cast<double>(random() % 3);
    const Index faces = 1 + static_cast<Index>(random() % 30);
    for (Index f = 0; f < faces; ++f) {
      std::vector<Index> polygon(3 + random() % 3);
      for (Index& v : polygon) v = static_cast<Index>(random() % static_cast<unsigned>(n));
      mesh.add_polygon(polygon);
    }
    for (const Weld weld : {Weld::never, Weld::seams, Weld::all}) {
      Context context;
      PrepareOptions options;
      options.weld = weld;
      const Expected<Prepared> result = prepare(mesh, nullptr, options, context);
      INFO("seed " << seed << (result ? std::string() : " " + result.error().message()));
      if (!result) {
        CHECK(result.error().what.find("has an area") != std::string::npos);
        continue;
      }
      CHECK(result->mesh.areas().minCoeff() > 0);
      const Expected<Prepared> again = prepare(
          PolygonMesh::from_triangles(result->mesh.positions(), result->mesh.faces()), nullptr,
          [] {
            PrepareOptions o;
            o.strict = true;
            o.weld = Weld::never;
            return o;
          }(),
          context);
      INFO((again ? std::string() : again.error().message()));
      CHECK(again.has_value());  // what comes out of the door may go in again untouched
    }
  }
}

TEST_CASE("prepare: polygons keep their outline when they are concave", "[prepare][fast]") {
  SECTION("an arrow-shaped quad") {
    const auto cut = triangulate(polygons({{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {0.5, 1, 0}}, {{0, 1, 2, 3}}));
    REQUIRE(cut.has_value());
    REQUIRE(cut->faces.rows() == 2);
    for (Eigen::Index f = 0; f < 2; ++f)
      for (Eigen::Index i = 0; i < 3; ++i)  // both halves share the edge 1-3
        CHECK(((cut->faces.row(f).array() == 1).any() && (cut->faces.row(f).array() == 3).any()));
  }
  SECTION("stars") {
    for (Index points = 3; points < 40; points += 4) {
      PolygonMesh star;
      star.positions.resize(2 * points, 3);
      std::vector<Index> polygon;
      double outline = 0;
      for (Index i = 0; i < 2 * points; ++i) {
        const double r = i % 2 ? 0.3 : 1, t = 3.14159265358979 * i / points;
        star.positions.row(i) << r * std::cos(t), 2, -r * std::sin(t);
        polygon.push_back(i);
      }
      for (Index i = 0; i < 2 * points; ++i) {
        const auto a = star.positions.row(i), b = star.positions.row((i + 1) % (2 * points));
        outline += (a[0] * -b[2] + a[2] * b[0]) / 2;
      }
      star.add_polygon(polygon);
      const Prepared result = prepared(star);
      CHECK(result.mesh.face_count() == 2 * points - 2);
      CHECK(result.mesh.total_area() == Approx(outline));
      CHECK(result.mesh.normals().col(1).minCoeff() == Approx(1));
    }
  }
}

TEST_CASE("prepare: what cannot be mended is refused by name", "[prepare][fast]") {
  PolygonMesh bad_index = cube();
  bad_index.corners[5] = 8;
  CHECK(refused(bad_index).message().find("face 1: vertex index 8") == 0);
  bad_index.corners[5] = -1;
  CHECK(refused(bad_index).code == ErrorCode::bad_input);
  PolygonMesh not_finite = cube();
  not_finite.positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK(refused(not_finite).where == "vertex 3");
  CHECK(refused(PolygonMesh{}).what == "the mesh has no faces");
  CHECK(refused(polygons({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}})).what == "none of the 1 faces has an area");
  PrepareOptions options;
  options.weight_tolerance = 2;
  CHECK(refused(cube(), options).code == ErrorCode::bad_option);
}

TEST_CASE("prepare: weights are clipped and rescaled within the tolerance and refused beyond", "[prepare][fast]") {
  const PolygonMesh mesh = polygons({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  Context context;
  const VertexWeights near = weights_of({{0.5, 0.5}, {0.52, 0.5}, {1.02, -0.01}});
  const Expected<Prepared> result = prepare(mesh, &near, {}, context);
  REQUIRE(result.has_value());
  CHECK(result->report.rescaled_weights == 1);  // the third row is clipped to (1, 0)
  CHECK(result->report.clipped_weights == 2);
  for (Index v = 0; v < 3; ++v) CHECK(result->weights->row(v).sum() == Approx(1).epsilon(1e-15));
  CHECK(result->weights->coeff(2, 0) == 1);
  CHECK(context.warnings.size() == 2);

  const VertexWeights far = weights_of({{0.5, 0.5}, {0.2, 0.5}, {1, 0}});
  CHECK(refused(mesh, {}, &far).where == "weights of vertex 1");
  const VertexWeights negative = weights_of({{1.5, -0.5}, {1, 0}, {1, 0}});
  CHECK(refused(mesh, {}, &negative).what.find("outside [0, 1]") != std::string::npos);
  const VertexWeights not_finite = weights_of({{1, 0}, {1, 0}, {std::nan(""), 0}});
  CHECK(refused(mesh, {}, &not_finite).what.find("not finite") != std::string::npos);
  const VertexWeights few = weights_of({{1, 0}, {1, 0}});
  CHECK(refused(mesh, {}, &few).what == "2 rows of weights for 3 vertices");
}

TEST_CASE("prepare: welded vertices get the mean of their weights", "[prepare][fast]") {
  const PolygonMesh mesh =
      polygons({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {3, 4, 5}});
  const VertexWeights weights = weights_of({{1, 0}, {1, 0}, {0, 1}, {0, 1}, {0, 1}, {0, 1}});
  Context context;
  const Expected<Prepared> result = prepare(mesh, &weights, {}, context);
  REQUIRE(result.has_value());
  REQUIRE(result->mesh.vertex_count() == 4);
  CHECK(result->report.merged_weights == 1);
  CHECK(result->weights->coeff(1, 0) == 0.5);
  CHECK(result->weights->coeff(2, 1) == 1);
}

TEST_CASE("refine: every edge is short, the surface is the same and stays conforming", "[prepare][refine][fast]") {
  const Prepared coarse = prepared(torus(7));
  Context context;
  const double target = 0.11;
  const auto fine = refine(
      coarse.mesh, [&](Index) { return target; }, {}, context);
  REQUIRE(fine.has_value());
  CHECK(fine->mesh.closed());
  CHECK(euler(fine->mesh) == 0);
  CHECK(fine->mesh.total_area() == Approx(coarse.mesh.total_area()));
  for (Index h = 0; h < fine->mesh.halfedge_count(); ++h) REQUIRE(fine->mesh.edge_vector(h).norm() <= target);
  const auto least_angle = [](const TriangleMesh<double>& mesh) {
    double least = 4;
    for (Index c = 0; c < mesh.halfedge_count(); ++c) least = std::min(least, mesh.corner_angle(c));
    return least;
  };
  CHECK(least_angle(fine->mesh) >= 0.5 * least_angle(coarse.mesh));  // Rivara's bound
  for (Index v = 0; v < fine->mesh.vertex_count(); ++v) {
    const SurfacePoint& point = fine->source[static_cast<std::size_t>(v)];
    REQUIRE(point.barycentric.sum() == 1);
    REQUIRE(point.barycentric.minCoeff() >= 0);
    REQUIRE((position(coarse.mesh, point) - fine->mesh.position(v)).norm() < 1e-14);
  }
  for (Index f = 0; f < fine->mesh.face_count(); ++f) {
    const Index source = fine->source_face[static_cast<std::size_t>(f)];
    REQUIRE(fine->mesh.normal(f).dot(coarse.mesh.normal(source)) > 1 - 1e-9);
  }
  for (Index v = 0; v < coarse.mesh.vertex_count(); ++v) REQUIRE(fine->mesh.position(v) == coarse.mesh.position(v));
}

TEST_CASE("refine: a part is refined alone, and its neighbours follow", "[prepare][refine][fast]") {
  const Prepared coarse = prepared(torus(16));
  Context context;
  const auto fine = refine(
      coarse.mesh, [](Index f) { return f < 8 ? 0.03 : 100.0; }, {}, context);
  REQUIRE(fine.has_value());
  CHECK(fine->mesh.closed());
  CHECK(fine->mesh.face_count() > 2 * coarse.mesh.face_count());
  for (Index h = 0; h < fine->mesh.halfedge_count(); ++h)
    if (fine->source_face[static_cast<std::size_t>(h / 3)] < 8) REQUIRE(fine->mesh.edge_vector(h).norm() <= 0.03);
}

TEST_CASE("refine: nothing is done when every edge is short, and too much is refused", "[prepare][refine][fast]") {
  const Prepared coarse = prepared(cube());
  Context context;
  const auto same = refine(
      coarse.mesh, [](Index) { return 2.0; }, {}, context);
  REQUIRE(same.has_value());
  CHECK(same->mesh.faces() == coarse.mesh.faces());
  const auto huge = refine(
      coarse.mesh, [](Index) { return 1e-9; }, {}, context);
  REQUIRE_FALSE(huge.has_value());
  CHECK(huge.error().code == ErrorCode::unsupported);
  // As many pieces as a side needs are not too many.
  RefineOptions few;
  few.max_faces = 100;
  CHECK(refine(
      coarse.mesh, [](Index) { return 0.8; }, few, context));
  const auto negative = refine(
      coarse.mesh, [](Index) { return -1.0; }, {}, context);
  REQUIRE_FALSE(negative.has_value());
  CHECK(negative.error().code == ErrorCode::bad_option);
}

TEST_CASE("refine: interpolated rows keep their sum and are exact at the vertices", "[prepare][refine][fast]") {
  const Prepared coarse = prepared(cube());
  VertexWeights rows(8, 3);
  for (Index v = 0; v < 8; ++v) {
    rows.coeffRef(v, v % 3) = 0.25;
    rows.coeffRef(v, (v + 1) % 3) = 0.75;
  }
  Context context;
  const auto fine = refine(
      coarse.mesh, [](Index) { return 0.2; }, {}, context);
  REQUIRE(fine.has_value());
  const VertexWeights carried = interpolate(coarse.mesh, rows, fine->source);
  for (Index v = 0; v < fine->mesh.vertex_count(); ++v) REQUIRE(carried.row(v).sum() == Approx(1).epsilon(1e-14));
  CHECK(Eigen::MatrixXd(carried).topRows(8) == Eigen::MatrixXd(rows));
}
