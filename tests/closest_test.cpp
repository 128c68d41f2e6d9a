#include "quadrig/closest.hpp"

#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

Vector3 random_point(std::mt19937& engine) {
  const auto coordinate = [&] { return static_cast<double>(engine()) / 2147483648.0 - 1.0; };
  const double x = coordinate(), y = coordinate();
  return {x, y, coordinate()};
}

TriangleMesh<double> torus() {
  const test::Grid grid{16, 40, true, true};
  return test::build(test::torus_positions(grid, 1.0, 0.3), grid.triangles());
}

}  // namespace

TEST_CASE("closest: the tree finds what looking at every face finds", "[closest][fast]") {
  const auto mesh = torus();
  const ClosestPoint tree(mesh);
  std::mt19937 engine(3);
  for (int k = 0; k < 400; ++k) {
    const Vector3 p = 1.5 * random_point(engine);
    double least = std::numeric_limits<double>::infinity();
    Index face = no_index;
    for (Index f = 0; f < mesh.face_count(); ++f) {
      const auto& t = mesh.faces();
      const double d = closest_on_triangle(p, mesh.position(t(f, 0)), mesh.position(t(f, 1)), mesh.position(t(f, 2)))
                           .squared_distance;
      if (d < least) least = d, face = f;
    }
    const SurfaceHit hit = tree.closest(p);
    CHECK(hit.squared_distance == least);
    CHECK(hit.face == face);
    CHECK(hit.barycentric.minCoeff() >= 0);
    CHECK(std::abs(hit.barycentric.sum() - 1) < 1e-14);
    CHECK((position(mesh, hit) - hit.position).norm() < 1e-14);
  }
}

TEST_CASE("closest: no point of a triangle is nearer than the answer when it is a needle or has no area",
          "[closest][fast]") {
  std::mt19937 engine(5);
  for (const double height : {1.0, 1e-6, 1e-12, 0.0})
    for (int k = 0; k < 100; ++k) {
      const Vector3 a = random_point(engine), b = random_point(engine);
      const Vector3 c = a + 0.3 * (b - a) + height * random_point(engine), p = random_point(engine);
      const SurfaceHit hit = closest_on_triangle(p, a, b, c);
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j) {
          const Vector3 q = a + i / 20.0 * (b - a) + j / 20.0 * (c - a);
          CHECK(hit.squared_distance <= (q - p).squaredNorm() + 1e-13);
        }
    }
}

TEST_CASE("closest: a triangle that is one point answers with that point", "[closest][fast]") {
  const Vector3 a(1, 2, 3);
  const SurfaceHit hit = closest_on_triangle(Vector3(1, 2, 5), a, a, a);
  CHECK(hit.squared_distance == 4);
  CHECK(hit.position == a);
}

TEST_CASE("closest: the lowest face answers when a vertex is closest to its whole fan", "[closest][fast]") {
  const test::Grid grid{4, 4};
  const auto mesh = test::build(
      grid.positions([](Index i, Index j) { return Vector3(i, j, -(i - 2) * (i - 2) - (j - 2) * (j - 2)); }),
      grid.triangles());
  const Index tip = grid.vertex(2, 2);
  Index lowest = mesh.face_count();
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.origin(h) == tip) lowest = std::min(lowest, h / 3);
  const SurfaceHit hit = ClosestPoint(mesh).closest(Vector3(2, 2, 5));
  CHECK(hit.squared_distance == 25);
  CHECK(hit.face == lowest);
}

TEST_CASE("closest: a filter by normal or distance passes over faces that it does not admit", "[closest][fast]") {
  // two sheets, 0.1 apart, facing away from each other
  const test::Grid grid{6, 6};
  Points<double> upper = grid.positions([](Index i, Index j) { return Vector3(i, j, 0.1); });
  Points<double> points(2 * upper.rows(), 3);
  points << upper, upper;
  points.bottomRows(upper.rows()).col(2).setZero();
  const Triangles top = grid.triangles();
  Triangles faces(2 * top.rows(), 3);
  faces.topRows(top.rows()) = top;
  for (Eigen::Index f = 0; f < top.rows(); ++f)
    faces.row(top.rows() + f) = (top.row(f).reverse().array() + static_cast<Index>(upper.rows())).matrix();
  const auto mesh = test::build(points, faces);
  const ClosestPoint tree(mesh);

  const Vector3 p(2.3, 3.4, 0.02);
  CHECK(tree.closest(p).position.z() == Approx(0.0).margin(1e-14));
  const SurfaceHit above = tree.closest(p, {.normal = Vector3(0, 0, 2), .minimum_cosine = 0.5});
  REQUIRE(above.found());
  CHECK(above.position.z() == Approx(0.1));
  CHECK_FALSE(tree.closest(p, {.normal = Vector3(1, 0, 0), .minimum_cosine = 0.5}).found());
  CHECK_FALSE(tree.closest(p, {.maximum_distance = 0.01}).found());
  CHECK(tree.closest(p, {.maximum_distance = 0.03}).found());

  // the walk stays on the sheet where it starts, though the other is nearer
  const SurfaceHit walked = walk_closest(mesh, p, tree.closest(Vector3(0.5, 0.5, 1)));
  CHECK(walked.position.z() == Approx(0.1));
  CHECK((walked.position - Vector3(2.3, 3.4, 0.1)).norm() < 1e-12);
}

TEST_CASE("closest: an empty surface answers nothing", "[closest][fast]") {
  CHECK_FALSE(ClosestPoint().closest(Vector3::Zero()).found());
  CHECK_FALSE(ClosestPoint(Points<double>(0, 3), Triangles(0, 3)).closest(Vector3::Zero()).found());
}
