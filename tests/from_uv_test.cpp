#include <map>

#include "map_shapes.hpp"
#include "quadrig/quads/from_uv.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

/// A surface with corner coordinates.
struct Mapped {
  TriangleMesh<double> mesh;
  CornerUv uv;
};

/// A ball as a cube of n × n squares a side, each side with a chart of its own of `quads` × `quads`.
Mapped mapped_cube(Index n, double quads) {
  Points<double> points(0, 3);
  std::map<std::array<long, 3>, Index> number;
  Triangles faces(12 * n * n, 3);
  CornerUv uv(3 * faces.rows(), 2);
  Index face = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (const int sign : {-1, 1})
      for (Index j = 0; j < n; ++j)
        for (Index i = 0; i < n; ++i) {
          const auto corner = [&](Index a, Index b) {
            const double x = 2.0 * a / n - 1, y = 2.0 * b / n - 1;
            Vector3 p;
            p[axis] = sign;
            p[(axis + 1) % 3] = sign * x;  // counter-clockwise from outside on either side
            p[(axis + 2) % 3] = y;
            const std::array<long, 3> key{std::lround(p[0] * n), std::lround(p[1] * n), std::lround(p[2] * n)};
            const auto [at, fresh] = number.try_emplace(key, static_cast<Index>(points.rows()));
            if (fresh) {
              points.conservativeResize(points.rows() + 1, 3);
              points.row(points.rows() - 1) = p.normalized().transpose();
            }
            return at->second;
          };
          const std::array<std::array<Index, 2>, 4> square{{{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}};
          for (const std::array<std::size_t, 3> triangle : {std::array<std::size_t, 3>{0, 1, 2}, {0, 2, 3}}) {
            for (int k = 0; k < 3; ++k) {
              const auto& [a, b] = square[triangle[static_cast<std::size_t>(k)]];
              faces(face, k) = corner(a, b);
              uv.row(3 * face + k) << quads * a / n, quads * b / n;
            }
            ++face;
          }
        }
  return {build(std::move(points), std::move(faces)), std::move(uv)};
}

/// A square of n × n, `quads` quads along a side.
Mapped mapped_square(Index n, double quads) {
  const Grid grid{n, n};
  Mapped result{
      build(grid.positions([&](Index i, Index j) { return Vector3(i, j, 0.1 * i * j / n); }), grid.triangles()), {}};
  result.uv.resize(result.mesh.halfedge_count(), 2);
  for (Index h = 0; h < result.mesh.halfedge_count(); ++h)
    result.uv.row(h) = result.mesh.position(result.mesh.origin(h)).head<2>().transpose() * quads / n;
  return result;
}

std::map<Index, Index> valences(const QuadMesh& mesh) {
  std::vector<Index> corners(static_cast<std::size_t>(mesh.vertex_count()), 0);
  for (Index q = 0; q < mesh.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) ++corners[static_cast<std::size_t>(mesh.quads(q, i))];
  std::map<Index, Index> count;
  for (const Index c : corners) ++count[c];
  return count;
}
UvQuads quads_of(const Mapped& m, double quads = 0) {
  Context context;
  UvQuadsOptions options;
  options.quads = quads;
  return quads_from_uv(m.mesh, m.uv, options, context).value();
}
Error refusal(const Mapped& m) {
  Context context;
  const auto quads = quads_from_uv(m.mesh, m.uv, UvQuadsOptions{}, context);
  REQUIRE_FALSE(quads);
  return quads.error();
}
void turn_chart(Mapped& m, Index face, Complex turn, Complex shift) {
  for (Index h = 3 * face; h < 3 * face + 3; ++h) {
    const Complex z = turn * Complex(m.uv(h, 0), m.uv(h, 1)) + shift;
    m.uv.row(h) << z.real(), z.imag();
  }
}

}  // namespace

TEST_CASE("from_uv: the grid of an integer map is taken as it is", "[extract]") {
  for (const Index quads : {1, 2, 5}) {
    const UvQuads cube = quads_of(mapped_cube(6, quads));
    CHECK(cube.own_grid);
    CHECK(cube.mesh.quad_count() == 6 * quads * quads);
    const auto count = valences(cube.mesh);
    CHECK(count.at(3) == 8);  // eight cones, all else regular
    CHECK(cube.mesh.vertex_count() == 6 * quads * quads + 2);
    if (quads > 1) CHECK(count.at(4) == cube.mesh.vertex_count() - 8);
    // Each vertex is where its coordinates are: corners of the cube among them.
    double nearest = 1;
    for (Index v = 0; v < cube.mesh.vertex_count(); ++v)
      nearest = std::min(nearest, (cube.mesh.positions.row(v).transpose() - Vector3(1, 1, 1).normalized()).norm());
    CHECK(nearest < 1e-6);

    const UvQuads square = quads_of(mapped_square(7, quads));
    CHECK(square.own_grid);
    CHECK(square.mesh.quad_count() == quads * quads);
    CHECK(quad_topology(square.mesh.quads, square.mesh.vertex_count()).boundary_loops == 1);
  }
}

TEST_CASE("from_uv: quarter turns and whole shifts of single triangles change nothing", "[extract]") {
  const Mapped plain = mapped_cube(5, 3);
  Mapped turned = plain;
  Random random(3);
  for (Index f = 0; f < plain.mesh.face_count(); ++f)
    turn_chart(turned, f, rotated(Complex(1, 0), static_cast<int>(random.number(0, 4))),
               Complex(std::floor(random.number(-9, 9)), std::floor(random.number(-9, 9))));
  const UvQuads a = quads_of(plain), b = quads_of(turned);
  CHECK(b.own_grid);
  REQUIRE(a.mesh.vertex_count() == b.mesh.vertex_count());
  CHECK(a.mesh.quad_count() == b.mesh.quad_count());
  const auto sorted = [](const QuadMesh& mesh) {
    std::vector<std::array<long, 3>> points;
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      points.push_back({std::lround(1e5 * mesh.positions(v, 0)), std::lround(1e5 * mesh.positions(v, 1)),
                        std::lround(1e5 * mesh.positions(v, 2))});
    std::sort(points.begin(), points.end());
    return points;
  };
  CHECK(sorted(a.mesh) == sorted(b.mesh));
}

TEST_CASE("from_uv: integers are found for a seamless map that has none, and for another count", "[extract]") {
  const UvQuads loose = quads_of(mapped_cube(6, 4.37));
  CHECK_FALSE(loose.own_grid);
  CHECK(valences(loose.mesh).at(3) == 8);
  CHECK(std::abs(loose.mesh.quad_count() - 6 * 4.37 * 4.37) < 0.25 * 6 * 4.37 * 4.37);
  const UvQuads more = quads_of(mapped_cube(6, 4), 600);
  CHECK_FALSE(more.own_grid);
  CHECK(more.mesh.quad_count() == 600);
  const UvQuads sheet = quads_of(mapped_square(9, 0.1), 400);
  CHECK(sheet.mesh.quad_count() == 400);
}

TEST_CASE("from_uv: coordinates of a file's precision are made exactly seamless", "[extract]") {
  Mapped rough = mapped_cube(8, 4);
  Random random(5);
  for (Eigen::Index h = 0; h < rough.uv.rows(); ++h)
    for (int c = 0; c < 2; ++c) rough.uv(h, c) += random.number(-1e-5, 1e-5);
  Context context;
  const SeamlessMap map = seamless_from_uv(rough.mesh, rough.uv, UvOptions{}, context).value();
  CHECK(map.valid());
  for (Index h = 0; h < rough.mesh.halfedge_count(); ++h) {
    const Index g = rough.mesh.twin(h);
    const auto at = [](Index i) { return static_cast<std::size_t>(i); };
    const Complex here = map.z[at(rough.mesh.next(h))] - map.z[at(h)],
                  there = map.z[at(g)] - map.z[at(rough.mesh.next(g))];
    REQUIRE(std::abs(rotated(here, map.cut.rotation[at(h)]) - there) < 1e-11);
  }
  CHECK(quads_of(rough).mesh.quad_count() == 96);
}

TEST_CASE("from_uv: the library's own map read back is the same map", "[extract]") {
  const int which = GENERATE(0, 1, 3);
  const FieldCase c = field_case(which < 3 ? closed_surface(which) : open_surface(which - 3), 0, 0.12);
  REQUIRE(mappable(c));
  Context context;
  const SeamlessMap map = seamless_map(c.mesh, c.connection, c.field, SeamlessOptions{}, context).value();
  CornerUv uv(c.mesh.halfedge_count(), 2);
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Complex& z = map.z[static_cast<std::size_t>(h)];
    uv.row(h) << z.real(), z.imag();
  }
  const SeamlessMap again = seamless_from_uv(c.mesh, uv, UvOptions{}, context).value();
  CHECK(again.index4 == map.index4);
  CHECK(map_area(again.z) == quadrig::test::Approx(map_area(map.z)).epsilon(1e-9));
  double apart = 0;  // both sides of an edge want the same
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h)
    if (const Index g = c.mesh.twin(h); g != no_index)
      apart = std::max(
          apart, std::abs(again.target[quadrig::detail::at(h)] +
                          rotated(again.target[quadrig::detail::at(g)], -again.cut.rotation[quadrig::detail::at(h)])));
  CHECK(apart < 1e-8);
  const IntegerMap integers = integer_map(c.mesh, again, IntegerOptions{.quads = 500}, context).value();
  const QuadMesh quads = quad_mesh(c.mesh, extract(c.mesh, again, integers, context).value());
  CHECK(unlike(quad_topology(quads.quads, quads.vertex_count()), SurfaceTopology(c.mesh)) == "");
}

TEST_CASE("from_uv: what is no seamless map is refused with its place", "[extract]") {
  const Mapped good = mapped_cube(4, 2);
  Mapped bad = good;
  turn_chart(bad, 17, Complex(1, 0), Complex(0, 0));
  bad.uv.row(3 * 17).swap(bad.uv.row(3 * 17 + 1));
  CHECK(refusal(bad).where == "texture coordinates, face 17");
  CHECK(refusal(bad).what.find("flipped") != std::string::npos);

  bad = good;
  bad.uv.col(0) *= -1;
  CHECK(refusal(bad).remedy.find("negate") != std::string::npos);

  bad = good;
  turn_chart(bad, 9, std::polar(1.0, 0.2), Complex(0, 0));
  CHECK(refusal(bad).what.find("no quarter turn") != std::string::npos);
  CHECK(refusal(bad).where.find("edge") != std::string::npos);
  bad = good;
  turn_chart(bad, 9, Complex(1.1, 0), Complex(0, 0));
  CHECK(refusal(bad).what.find("changes lengths by") != std::string::npos);

  bad = mapped_square(5, 3);
  for (Index f = 0; f < bad.mesh.face_count(); ++f) turn_chart(bad, f, std::polar(1.0, 0.3), Complex(0, 0));
  CHECK(refusal(bad).what == "a border edge is 17° off the grid");

  bad = good;
  bad.uv(5, 1) = std::nan("");
  CHECK(refusal(bad).where == "texture coordinates, face 1");
  bad = good;
  bad.uv.conservativeResize(bad.uv.rows() - 1, 2);
  CHECK(refusal(bad).what.find("rows for") != std::string::npos);

  // Cones off the grid points are no error, but no grid either.
  Context context;
  const Mapped loose = mapped_cube(4, 2.5);
  const auto grid = whole_grid(loose.mesh, seamless_from_uv(loose.mesh, loose.uv, UvOptions{}, context).value());
  REQUIRE_FALSE(grid);
  CHECK(grid.error().where.find("integer grid, ") == 0);

  // Two parts; matrices that do not fit.
  Eigen::MatrixXd v(6, 3), uv(3, 2);
  Eigen::MatrixXi f(2, 3), fuv(2, 3);
  v << 0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0;
  uv << 0, 0, 1, 0, 0, 1;
  f << 0, 1, 2, 3, 4, 5;
  fuv << 0, 1, 2, 0, 1, 2;
  CHECK(quads_from_uv(v, f, uv, fuv, UvQuadsOptions{}, context).error().what == "the mesh is in 2 parts");
  fuv(1, 2) = 3;
  CHECK(quads_from_uv(v, f, uv, fuv, UvQuadsOptions{}, context).error().what == "coordinate 3 of 3");
  CHECK(quads_from_uv(uv, f, uv, fuv, UvQuadsOptions{}, context).error().code == ErrorCode::bad_input);
}
