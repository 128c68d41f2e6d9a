// ω fields: their sum, their order, their gradient.
#include "surfaces.hpp"
#include "test.hpp"

#include "quadrig/dominance.hpp"

using namespace quadrig;
using quadrig::test::Grid;

namespace {

TriangleMesh<double> sheet() {
  const Grid grid{9, 7, false, false};
  return test::build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0.05 * i * j); }), grid.triangles());
}

Rig random_rig(const TriangleMesh<double>& mesh, Index bones, std::uint32_t seed) {
  Rig rig;
  rig.skeleton.bones.resize(static_cast<std::size_t>(bones));
  std::mt19937 engine(seed);
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    std::vector<double> weights(static_cast<std::size_t>(bones), 0.0);
    for (int k = 0; k < 5; ++k)
      weights[engine() % static_cast<std::uint32_t>(bones)] += static_cast<double>(engine() % 8);
    weights[0] += 1;
    double sum = 0;
    for (const double weight : weights) sum += weight;
    for (Index b = 0; b < bones; ++b)
      if (weights[static_cast<std::size_t>(b)] > 0)
        entries.emplace_back(v, b, weights[static_cast<std::size_t>(b)] / sum);
  }
  rig.weights.resize(mesh.vertex_count(), bones);
  rig.weights.setFromTriplets(entries.begin(), entries.end());
  return rig;
}

}  // namespace

TEST_CASE("dominance: ω of all orders sum to the weights' sum, and shares fall", "[dominance]") {
  const auto mesh = sheet();
  const Rig rig = random_rig(mesh, 11, 5);
  const auto dominance = Dominance::create(mesh, rig);
  REQUIRE(dominance);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto shares = dominance->shares(f);
    double sum = 0;
    for (std::size_t k = 1; k <= shares.size(); ++k) {
      CHECK(dominance->omega(f, k) >= 0);
      sum += dominance->omega(f, k);
      double wanted = 0;
      for (int corner = 0; corner < 3; ++corner)
        wanted += rig.weights.coeff(mesh.faces()(f, corner), shares[k - 1].bone) / 3;
      CHECK(shares[k - 1].weight == Approx(wanted));
      if (k > 1)
        CHECK((shares[k - 2].weight > shares[k - 1].weight ||
               (shares[k - 2].weight == shares[k - 1].weight && shares[k - 2].bone < shares[k - 1].bone)));
    }
    CHECK(sum == Approx(1.0));
    CHECK(dominance->omega(f, shares.size() + 1) == 0);
    CHECK(dominance->share(f, shares.size() + 1).bone == no_index);
  }
}

TEST_CASE("dominance: the gradient of ω1 gives back its differences along the edges", "[dominance]") {
  const auto mesh = sheet();
  const auto dominance = Dominance::create(mesh, random_rig(mesh, 4, 8));
  REQUIRE(dominance);
  const auto& omega = dominance->vertex_omega1();
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const double difference =
        omega[static_cast<std::size_t>(mesh.target(h))] - omega[static_cast<std::size_t>(mesh.origin(h))];
    CHECK(dominance->gradient_omega1(mesh, h / 3).dot(mesh.edge_vector(h)) == Approx(difference).margin(1e-12));
    CHECK(std::abs(dominance->gradient_omega1(mesh, h / 3).dot(mesh.normal(h / 3))) < 1e-12);
  }
}

TEST_CASE("dominance: weights that do not fit are an error with both counts", "[dominance]") {
  const auto mesh = sheet();
  Rig rig = random_rig(mesh, 4, 8);
  rig.skeleton.bones.pop_back();
  const auto columns = Dominance::create(mesh, rig);
  REQUIRE(!columns);
  CHECK(columns.error().what == "4 columns of weights for 3 bones");
  rig = random_rig(mesh, 4, 8);
  rig.weights.conservativeResize(mesh.vertex_count() - 1, 4);
  const auto rows = Dominance::create(mesh, rig);
  REQUIRE(!rows);
  CHECK(rows.error().code == ErrorCode::bad_input);
}
