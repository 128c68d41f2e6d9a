#include "quadrig/samples.hpp"

#include <map>
#include <set>

#include "quadrig/gltf.hpp"

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
    // The head's curves of the mirror and of seams stay lines of edges, whatever lies close to them.
    CHECK(least_angle > (triangles < 10000 ? 0.01 : info.name == "head" ? 0.2 : 0.4));
  }
}

}  // namespace

TEST_CASE("samples: each is one closed surface of the asked size and well-shaped", "[samples][slow]") {
  for (const Index triangles : {1000, 10000}) check_surfaces(triangles);
}
TEST_CASE("samples: a large one is a closed surface of the asked size and well-shaped", "[samples][slow]") {
  check_surfaces(40000);
}

TEST_CASE("samples: a small one is still closed when its limbs are hardly wider than its triangles",
          "[samples][slow]") {
  for (const SampleInfo& info : sample_infos()) {
    const Asset asset = sample(info.name, 500);
    CHECK(asset.mesh.closed());
    CHECK(euler(asset.mesh) == (info.name == "box_torus" ? 0 : 2));
    CHECK(asset.mesh.face_count() < 600);
  }
}

TEST_CASE("samples: weights are a smooth partition of unity that follows the bones", "[samples][slow]") {
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

TEST_CASE("samples: the same bits at any number of threads", "[samples][slow]") {
  for (const SampleInfo& info : sample_infos()) {
    const Asset one = sample(info.name, 12000, 1), many = sample(info.name, 12000, 7);
    CHECK(one.mesh.positions() == many.mesh.positions());
    CHECK(one.mesh.faces() == many.mesh.faces());
    CHECK(Eigen::MatrixXd(one.rig->weights) == Eigen::MatrixXd(many.rig->weights));
  }
}

TEST_CASE("samples: the head is its own image, vertex for vertex", "[samples][slow]") {
  const Asset asset = sample("head", 4000);
  std::map<std::array<double, 3>, Index> at;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) {
    const Vector3 p = asset.mesh.position(v);
    at[{p.x(), p.y(), p.z()}] = v;
  }
  std::set<std::array<Index, 3>> faces;
  const auto sorted = [](std::array<Index, 3> corners) {
    std::sort(corners.begin(), corners.end());
    return corners;
  };
  std::vector<Index> image;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) {
    const Vector3 p = asset.mesh.position(v);
    const auto found = at.find({-p.x(), p.y(), p.z()});
    REQUIRE(found != at.end());
    image.push_back(found->second);
    REQUIRE((asset.rig->weights.row(v) - asset.rig->weights.row(image.back())).norm() == 0);
  }
  for (Index f = 0; f < asset.mesh.face_count(); ++f)
    faces.insert(sorted({asset.mesh.faces()(f, 0), asset.mesh.faces()(f, 1), asset.mesh.faces()(f, 2)}));
  for (const auto& face : faces) {
    const auto of = [&](Index v) { return image[static_cast<std::size_t>(v)]; };
    REQUIRE(faces.contains(sorted({of(face[0]), of(face[1]), of(face[2])})));
  }
}

namespace {

GltfDocument head_document(Index triangles) {
  Context context;
  Expected<std::string> bytes = make_sample_glb("head", triangles, context);
  REQUIRE(bytes.has_value());
  Expected<GltfDocument> document = GltfDocument::parse(std::move(*bytes), "head.glb", {}, context);
  INFO((document ? std::string() : document.error().message()));
  REQUIRE(document.has_value());
  return *document;
}

}  // namespace

TEST_CASE("samples: the head's file has skins that meet at the neck and targets that do not part what touches",
          "[samples][gltf][slow]") {
  const GltfDocument document = head_document(6000);
  Context context;
  const auto surfaces = gltf_surfaces(document, {}, {}, context);
  INFO((surfaces ? std::string() : surfaces.error().message()));
  REQUIRE(surfaces.has_value());
  const auto primitives = gltf_vertices(document, "targets[0].POSITION", context).value();
  REQUIRE(primitives.size() == 7);  // skin, eyes, sheets; body; hair; spectacles, glasses
  using Place = std::array<double, 3>;
  std::array<std::set<Place>, 2> border;
  for (const std::size_t i : {std::size_t{0}, std::size_t{3}})
    for (const auto& p : primitives[i].positions.rowwise())
      if (p.y() == double(-0.2F)) border[i / 3].insert({p.x(), p.y(), p.z()});
  CHECK(border[0].size() > 10);
  CHECK(border[0] == border[1]);
  for (int target = 0; target < 6; ++target) {
    const std::string name = "targets[" + std::to_string(target) + "].POSITION";
    const GltfVertices skin = gltf_vertices(document, name, context).value().front();
    REQUIRE(skin.values.rows() == skin.positions.rows());
    CHECK(skin.values.rowwise().norm().maxCoeff() > 0.003);
    std::map<Place, Eigen::RowVector3d> moved;
    Index doubled = 0;
    for (Eigen::Index v = 0; v < skin.values.rows(); ++v) {
      const Place place{skin.positions(v, 0), skin.positions(v, 1), skin.positions(v, 2)};
      const auto [found, fresh] = moved.emplace(place, skin.values.row(v));
      doubled += fresh ? 0 : 1;
      if (!fresh) REQUIRE(found->second == skin.values.row(v));
    }
    CHECK(doubled > 20);  // at the borders of texture islands
  }
}

TEST_CASE("samples: a blink of the head covers its eye", "[samples][gltf][slow]") {
  const GltfDocument document = head_document(16000);
  Context context;
  // The primitive that is seen first from the front at a place, with a target at full strength.
  const auto seen = [&](int target, double x, double y) {
    const auto primitives =
        gltf_vertices(document, "targets[" + std::to_string(target) + "].POSITION", context).value();
    double nearest = -1;
    std::size_t first = 99;
    for (std::size_t i = 0; i < 2; ++i)
      for (const auto& face : primitives[i].triangles.rowwise()) {
        Eigen::Matrix3d corners;
        for (int c = 0; c < 3; ++c)
          corners.row(c) = primitives[i].positions.row(face[c]) + primitives[i].values.row(face[c]);
        Eigen::Matrix3d system;
        system << corners.leftCols<2>().transpose(), Eigen::RowVector3d::Ones();
        const Vector3 shares = system.partialPivLu().solve(Vector3(x, y, 1));
        if (!(shares.minCoeff() >= 0)) continue;
        const double depth = shares.dot(corners.col(2));
        if (depth > nearest) nearest = depth, first = i;
      }
    return first;
  };
  for (const double side : {1.0, -1.0}) {
    const int own = side > 0 ? 0 : 1;
    for (const double up : {-0.002, 0.0, 0.003}) {
      CHECK(seen(own, side * 0.0315, 0.011 + up) == 0);
      CHECK(seen(1 - own, side * 0.0315, 0.011 + up) == 1);
    }
  }
}

TEST_CASE("samples: an unknown name or a size out of range is refused", "[samples][fast]") {
  Context context;
  const auto unknown = make_sample("teapot", 1000, context);
  REQUIRE_FALSE(unknown.has_value());
  CHECK(unknown.error().remedy == "name one of pear, box_torus, humanoid, head, wing");
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
