#include "quadrig/samples.hpp"

#include "test.hpp"

using namespace quadrig;

namespace {

Asset sample(std::string_view name, Index triangles, unsigned threads = 2) {
  Context context;
  context.threads = threads;
  Expected<Asset> asset = make_sample(name, triangles, context);
  INFO(name << (asset ? std::string() : ": " + asset.error().message()));
  REQUIRE(asset.has_value());
  CHECK(context.warnings.empty());
  return std::move(*asset);
}

Index euler(const TriangleMesh<double>& mesh) { return mesh.vertex_count() - mesh.edge_count() + mesh.face_count(); }

void check_surfaces(Index triangles) {
  for (const SampleInfo& info : sample_infos()) {
    const Asset asset = sample(info.name, triangles);
    const TriangleMesh<double>& mesh = asset.mesh;
    INFO(info.name << " of " << triangles);
    CHECK(mesh.closed());
    CHECK(face_components(mesh).count == 1);
    CHECK(euler(mesh) == (info.name == "box_torus" ? 0 : 2));
    CHECK(std::abs(mesh.face_count() - triangles) < triangles / 10);
    double volume = 0, least_angle = 4;
    for (Index f = 0; f < mesh.face_count(); ++f)
      volume += mesh.position(mesh.faces()(f, 0)).dot(mesh.normal(f)) * mesh.area(f) / 3;
    CHECK(volume > 0);
    for (Index c = 0; c < mesh.halfedge_count(); ++c) least_angle = std::min(least_angle, mesh.corner_angle(c));
    CHECK(least_angle > (triangles >= 10000 ? 0.4 : 0.01));
  }
}

}  // namespace

TEST_CASE("samples: each is one closed surface of the asked size and well-shaped", "[samples][fast]") {
  for (const Index triangles : {1000, 10000}) check_surfaces(triangles);
}
TEST_CASE("samples: a large one is a closed surface of the asked size and well-shaped", "[samples][slow]") {
  check_surfaces(40000);
}

TEST_CASE("samples: a small one is still closed when its limbs are hardly wider than its triangles",
          "[samples][fast]") {
  for (const SampleInfo& info : sample_infos()) {
    const Asset asset = sample(info.name, 500);
    CHECK(asset.mesh.closed());
    CHECK(euler(asset.mesh) == (info.name == "box_torus" ? 0 : 2));
    CHECK(asset.mesh.face_count() < 600);
  }
}

TEST_CASE("samples: weights are a smooth partition of unity that follows the bones", "[samples][fast]") {
  for (const SampleInfo& info : sample_infos()) {
    const Asset asset = sample(info.name, 10000);
    const Rig& rig = *asset.rig;
    INFO(info.name);
    REQUIRE(rig.skeleton.bone_count() == info.bones);
    REQUIRE(rig.weights.rows() == asset.mesh.vertex_count());
    REQUIRE(rig.weights.cols() == info.bones);
    const Eigen::MatrixXd weights(rig.weights);
    CHECK(weights.minCoeff() >= 0);
    CHECK((weights.rowwise().sum().array() - 1).abs().maxCoeff() < 1e-12);
    for (Index b = 0; b < info.bones; ++b) {
      CAPTURE(rig.skeleton.bones[static_cast<std::size_t>(b)].name);
      CHECK(weights.col(b).maxCoeff() > 0.5);  // every bone holds some of the surface
    }
    double steepest = 0;
    for (Index h = 0; h < asset.mesh.halfedge_count(); ++h)
      steepest = std::max(
          steepest, (weights.row(asset.mesh.origin(h)) - weights.row(asset.mesh.target(h))).cwiseAbs().maxCoeff());
    CHECK(steepest < 0.5);
    for (const Bone& bone : rig.skeleton.bones) CHECK((bone.tail - bone.head).norm() > 0.01);
  }
}

TEST_CASE("samples: no limb of the humanoid pulls at another that is only near", "[samples][fast]") {
  const Asset asset = sample("humanoid", 10000);
  const Skeleton& skeleton = asset.rig->skeleton;
  const auto bone = [&](const std::string& name) {
    for (Index b = 0; b < skeleton.bone_count(); ++b)
      if (skeleton.bones[static_cast<std::size_t>(b)].name == name) return b;
    return no_index;
  };
  Index torso = 0, left_leg = 0;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) {
    const Vector3 p = asset.mesh.position(v);
    const auto weight = [&](const std::string& name) { return asset.rig->weights.coeff(v, bone(name)); };
    if (std::abs(p.x()) < 0.12 && p.y() > 0.95 && p.y() < 1.2) {
      ++torso;
      for (const char* side : {"_l", "_r"}) {
        REQUIRE(weight(std::string("forearm") + side) == 0);
        REQUIRE(weight(std::string("hand") + side) == 0);
        REQUIRE(weight(std::string("upper_arm") + side) < 0.05);
      }
    }
    if (p.x() > 0 && p.y() < 0.65) {
      ++left_leg;
      REQUIRE(weight("thigh_r") + weight("shin_r") + weight("foot_r") < 0.02);
    }
  }
  CHECK(torso > 100);
  CHECK(left_leg > 100);
}

TEST_CASE("samples: the same bits at any number of threads", "[samples][fast]") {
  for (const SampleInfo& info : sample_infos()) {
    const Asset one = sample(info.name, 12000, 1), many = sample(info.name, 12000, 7);
    CHECK(one.mesh.positions() == many.mesh.positions());
    CHECK(one.mesh.faces() == many.mesh.faces());
    CHECK(Eigen::MatrixXd(one.rig->weights) == Eigen::MatrixXd(many.rig->weights));
  }
}

TEST_CASE("samples: an unknown name or a size out of range is refused", "[samples][fast]") {
  Context context;
  const auto unknown = make_sample("teapot", 1000, context);
  REQUIRE_FALSE(unknown.has_value());
  CHECK(unknown.error().remedy == "name one of pear, box_torus, humanoid, wing");
  for (const Index triangles : {0, 499, 4'000'001}) {
    const auto result = make_sample("pear", triangles, context);
    REQUIRE_FALSE(result.has_value());
    CHECK(result.error().code == ErrorCode::bad_option);
  }
  std::atomic<bool> stop = true;
  context.cancel_flag = &stop;
  const auto cancelled = make_sample("pear", 1000, context);
  REQUIRE_FALSE(cancelled.has_value());
  CHECK(cancelled.error().code == ErrorCode::cancelled);
}
