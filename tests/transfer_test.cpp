#include "quadrig/transfer.hpp"

#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

const test::Grid sheet_grid{4, 4};

TriangleMesh<double> plane() {
  return test::build(sheet_grid.positions([](Index i, Index j) { return Vector3(i, j, 0); }), sheet_grid.triangles());
}

// weights that are linear in x and y, over five bones
SkinWeights linear_weights(const TriangleMesh<double>& mesh) {
  SkinWeights weights(mesh.vertex_count(), 5);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const double x = mesh.positions()(v, 0) / 4, y = mesh.positions()(v, 1) / 4;
    const double w[5] = {0.1 + 0.2 * x, 0.4 - 0.2 * x, 0.05 + 0.1 * y, 0.15 - 0.1 * y, 0.3};
    for (Index b = 0; b < 5; ++b) weights.insert(v, b) = w[b];
  }
  weights.makeCompressed();
  return weights;
}

std::vector<SurfacePoint> some_points(const TriangleMesh<double>& mesh) {
  std::mt19937 engine(1);
  std::vector<SurfacePoint> points;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    Vector3 b;
    for (int i = 0; i < 3; ++i) b[i] = static_cast<double>(engine() % 1000 + 1);
    points.push_back({f, b / b.sum()});
  }
  return points;
}

}  // namespace

TEST_CASE("transfer: weights are interpolated when all influences are kept", "[transfer][fast]") {
  const auto mesh = plane();
  const auto points = some_points(mesh);
  const SkinWeights carried = transfer_weights(mesh, linear_weights(mesh), points, 5).value();
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vector3 p = position(mesh, points[k]);
    CHECK(carried.coeff(static_cast<Index>(k), 0) == Approx(0.1 + 0.05 * p.x()));
    CHECK(carried.coeff(static_cast<Index>(k), 3) == Approx(0.15 - 0.025 * p.y()));
  }
}

TEST_CASE("transfer: the strongest influences are kept and sum to one", "[transfer][fast]") {
  const auto mesh = plane();
  const auto points = some_points(mesh);
  for (const Index most : {1, 2, 4}) {
    const SkinWeights all = transfer_weights(mesh, linear_weights(mesh), points, 5).value();
    const SkinWeights carried = transfer_weights(mesh, linear_weights(mesh), points, most).value();
    REQUIRE(carried.rows() == static_cast<Eigen::Index>(points.size()));
    for (Index k = 0; k < carried.rows(); ++k) {
      double sum = 0, dropped = 0, kept = 1;
      for (Index b = 0; b < 5; ++b) {
        const double w = carried.coeff(k, b);
        sum += w;
        if (w > 0)
          kept = std::min(kept, all.coeff(k, b));
        else
          dropped = std::max(dropped, all.coeff(k, b));
      }
      CHECK(carried.innerVector(k).nonZeros() == most);
      CHECK(std::abs(sum - 1) < 1e-12);
      CHECK(kept >= dropped);
    }
  }
}

TEST_CASE("transfer: impossible requests are refused by name", "[transfer][fast]") {
  const auto mesh = plane();
  const auto points = some_points(mesh);
  CHECK(transfer_weights(mesh, linear_weights(mesh), points, 0).error().code == ErrorCode::bad_option);
  CHECK(transfer_weights(mesh, SkinWeights(3, 2), points).error().code == ErrorCode::bad_input);
  SkinWeights nothing(mesh.vertex_count(), 2);
  CHECK(transfer_weights(mesh, nothing, points).error().where == "face 0");
}

TEST_CASE("transfer: vertex and corner values follow the barycentric coordinates", "[transfer][fast]") {
  const auto mesh = plane();
  const auto points = some_points(mesh);
  const Eigen::MatrixXd values = mesh.positions().leftCols<2>();
  const Eigen::MatrixXd carried = transfer_vertex_values(mesh, values, points);
  Eigen::MatrixXd corners(3 * mesh.face_count(), 1);  // jumps from face to face
  for (Index c = 0; c < corners.rows(); ++c) corners(c, 0) = 100.0 * (c / 3) + mesh.positions()(mesh.origin(c), 0);
  const Eigen::MatrixXd seamed = transfer_corner_values(corners, points);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vector3 p = position(mesh, points[k]);
    const auto row = static_cast<Eigen::Index>(k);
    CHECK((carried.row(row).transpose() - p.head<2>()).norm() < 1e-14);
    CHECK(seamed(row, 0) == Approx(100.0 * points[k].face + p.x()));
  }
}

TEST_CASE("transfer: a quad takes the label of most of its corners", "[transfer][fast]") {
  QuadMesh quads;
  quads.positions = Points<double>::Zero(6, 3);
  quads.quads.resize(2, 4);
  quads.quads << 0, 1, 2, 3, 2, 3, 4, 5;
  for (Index f = 0; f < 6; ++f) quads.source.push_back({f, Vector3::Constant(1.0 / 3)});
  const std::vector<Index> labels{7, 3, 7, 1, 7, 1};
  CHECK(transfer_face_labels(labels, quads) == std::vector<Index>{7, 1});
}
