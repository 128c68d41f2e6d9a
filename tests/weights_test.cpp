// Binding: what every kind of weights must keep, and what each promises.
#include "surfaces.hpp"
#include "test.hpp"

#include "quadrig/io.hpp"
#include "quadrig/samples.hpp"
#include "quadrig/weights.hpp"

using namespace quadrig;
using quadrig::test::Grid;

namespace {

constexpr std::array methods{BindMethod::nearest_bone, BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic};

BoundWeights bound(const TriangleMesh<double>& mesh, const Skeleton& skeleton, const BindOptions& options,
                   unsigned threads = 1) {
  Context context;
  context.threads = threads;
  Expected<BoundWeights> result = bind_weights(mesh, skeleton, options, context);
  INFO(bind_method_name(options.method) << (result ? std::string() : ": " + result.error().message()));
  REQUIRE(result);
  return std::move(*result);
}

Skeleton chain(std::initializer_list<Vector3> joints) {
  Skeleton skeleton;
  const Vector3* previous = nullptr;
  for (const Vector3& joint : joints) {
    if (previous) skeleton.bones.push_back({*previous, joint, skeleton.bone_count() - 1});
    previous = &joint;
  }
  return skeleton;
}

/// Two tubes along x, side by side, `gap` apart from skin to skin.
TriangleMesh<double> two_tubes(double gap) {
  const Grid grid{16, 40, true, false};
  const Points<double> one = test::tube_positions(grid, 4, 0.5);
  Points<double> positions(2 * one.rows(), 3);
  positions << one, one.rowwise() + Eigen::RowVector3d(0, 1 + gap, 0);
  const Triangles faces = grid.triangles();
  Triangles both(2 * faces.rows(), 3);
  both << faces, (faces.array() + static_cast<Index>(one.rows())).matrix();
  return test::build(positions, both);
}

}  // namespace

TEST_CASE("weights: every method gives each vertex at most the asked influences that sum to 1", "[weights]") {
  Context context;
  const Asset asset = make_sample("humanoid", 1500, context).value();
  for (const BindMethod method : methods)
    for (const Index influences : {1, 2, 4}) {
      INFO(bind_method_name(method) << ", " << influences);
      const BoundWeights made =
          bound(asset.mesh, asset.rig->skeleton, {.method = method, .influences = influences, .resolution = 40});
      REQUIRE(made.weights.rows() == asset.mesh.vertex_count());
      REQUIRE(made.weights.cols() == asset.rig->skeleton.bone_count());
      CHECK(made.bones_outside == 0);
      CHECK(made.unmoved_bones == 0);
      bool good = true;
      for (Index v = 0; v < made.weights.rows(); ++v) {
        double sum = 0;
        Index count = 0;
        for (SkinWeights::InnerIterator entry(made.weights, v); entry; ++entry) {
          good = good && entry.value() > 0;
          sum += entry.value();
          ++count;
        }
        good = good && count >= 1 && count <= influences && std::abs(sum - 1) < 1e-12;
      }
      CHECK(good);
    }
}

TEST_CASE("weights: smooth methods blend at the joint and leave the middles of bones alone", "[weights]") {
  const Grid grid{20, 80, true, false};
  const auto mesh = test::build(test::tube_positions(grid, 8, 0.5), grid.triangles());
  const Skeleton skeleton = chain({Vector3(0, 0, 0), Vector3(4, 0, 0), Vector3(8, 0, 0)});
  for (const BindMethod method : {BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic}) {
    INFO(bind_method_name(method));
    const SkinWeights weights = bound(mesh, skeleton, {.method = method}).weights;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      const double x = mesh.position(v).x(), second = weights.coeff(v, 1);
      if (x < 1) CHECK(second < 0.02);
      if (x > 7) CHECK(second > 0.98);
      if (std::abs(x - 4) < 1e-9) CHECK(second == test::Approx(0.5).margin(0.05));
    }
    // Rising along the tube, in steps a smooth blend has.
    for (Index j = 0; j < grid.rows; ++j)
      for (Index i = 0; i < grid.columns; ++i) {
        const double step = weights.coeff(grid.vertex(i, j + 1), 1) - weights.coeff(grid.vertex(i, j), 1);
        CHECK(step > -0.02);
        CHECK(step < 0.25);
      }
  }
}

TEST_CASE("weights: what is near in space and far through the body stays apart", "[weights]") {
  const double gap = 0.3;
  const auto mesh = two_tubes(gap);
  Skeleton skeleton = chain({Vector3(0, 0, 0), Vector3(4, 0, 0)});
  // The second bone lies off the axis of its tube, nearer to the first tube's skin than the first bone.
  skeleton.bones.push_back({Vector3(0, 0.55 + gap, 0), Vector3(4, 0.55 + gap, 0), no_index});
  const Index half = mesh.vertex_count() / 2;
  const auto stray = [&](BindMethod method) {
    const SkinWeights weights = bound(mesh, skeleton, {.method = method}).weights;
    double most = 0;
    for (Index v = 0; v < half; ++v) most = std::max(most, weights.coeff(v, 1));
    return most;
  };
  CHECK(stray(BindMethod::nearest_bone) == 1);
  CHECK(stray(BindMethod::geodesic_voxel) < 0.1);
  CHECK(stray(BindMethod::bounded_biharmonic) < 0.1);
}

TEST_CASE("weights: bones outside the body are bound all the same, and told", "[weights]") {
  const Grid grid{16, 30, true, false};
  const auto mesh = test::build(test::tube_positions(grid, 4, 0.5), grid.triangles());
  const Skeleton skeleton = chain({Vector3(0, 3, 0), Vector3(2, 3, 0), Vector3(4, 3, 0)});
  for (const BindMethod method : {BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic}) {
    INFO(bind_method_name(method));
    const BindOptions options{.method = method, .resolution = 48};
    const BoundWeights made = bound(mesh, skeleton, options);
    CHECK(made.bones_outside == 2);
    CHECK(made.unmoved_bones == 0);
    CHECK(made.summary(options).find("outside the body: 2") != std::string::npos);
    for (Index i = 0; i < grid.columns; ++i) {
      CHECK(made.weights.coeff(grid.vertex(i, 0), 0) > 0.5);
      CHECK(made.weights.coeff(grid.vertex(i, grid.rows), 1) > 0.5);
    }
  }
}

TEST_CASE("weights: a bone far away changes no other's weights by much", "[weights]") {
  const Grid grid{16, 30, true, false};
  const auto mesh = test::build(test::tube_positions(grid, 4, 0.5), grid.triangles());
  const Skeleton near = chain({Vector3(0, 0, 0), Vector3(2, 0, 0), Vector3(4, 0, 0)});
  for (const BindMethod method : {BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic}) {
    INFO(bind_method_name(method));
    const BindOptions options{.method = method, .resolution = 48};
    const BoundWeights before = bound(mesh, near, options);
    for (const double far : {20.0, 1e4, 1e9}) {
      Skeleton skeleton = near;
      skeleton.bones.push_back({Vector3(far, 0, 0), Vector3(2 * far, far, 0), no_index});
      const BoundWeights made = bound(mesh, skeleton, options);
      CHECK(made.bones_outside == 1);
      const Eigen::MatrixXd old(before.weights), now(made.weights);
      CHECK((now.leftCols(2) - old).cwiseAbs().maxCoeff() < 0.1);
      CHECK(now.col(2).maxCoeff() < 0.05);
    }
    // One that comes from far through the body is followed where it is within.
    Skeleton through = near;
    through.bones.push_back({Vector3(2, -1e4, 0), Vector3(2, 1e4, 0), no_index});
    CHECK(bound(mesh, through, options).bones_outside == 0);
  }
}

TEST_CASE("weights: the same bits at any number of threads, and in any unit of a power of two", "[weights]") {
  Context context;
  const Asset asset = make_sample("humanoid", 1500, context).value();
  Skeleton small = asset.rig->skeleton;
  for (Bone& bone : small.bones) bone.head *= 0x1p-10, bone.tail *= 0x1p-10;
  const auto tiny = test::build(asset.mesh.positions() * 0x1p-10, asset.mesh.faces());
  const auto same = [](const SkinWeights& a, const SkinWeights& b) {
    return a.nonZeros() == b.nonZeros() && std::equal(a.valuePtr(), a.valuePtr() + a.nonZeros(), b.valuePtr()) &&
           std::equal(a.innerIndexPtr(), a.innerIndexPtr() + a.nonZeros(), b.innerIndexPtr());
  };
  for (const BindMethod method : methods) {
    INFO(bind_method_name(method));
    const BindOptions options{.method = method, .resolution = 32};
    const SkinWeights one = bound(asset.mesh, asset.rig->skeleton, options).weights;
    for (const unsigned threads : {2u, 16u})
      CHECK(same(one, bound(asset.mesh, asset.rig->skeleton, options, threads).weights));
    const SkinWeights scaled = bound(tiny, small, options).weights;
    CHECK((one - scaled).norm() < 1e-6 * one.norm());
  }
}

TEST_CASE("weights: biharmonic weights of the arm are near those it came with", "[weights]") {
  const auto folder = test::corpus("libigl_arm");
  if (!folder) return;
  // Bounded biharmonic weights of the whole volume, made by others.
  Context context;
  const auto loaded = load_asset({*folder / "arm.obj", *folder / "arm.tgf", *folder / "arm-weights.dmat"}, {}, context);
  REQUIRE(loaded);
  const Asset& arm = loaded->asset;
  const SkinWeights made = bound(arm.mesh, arm.rig->skeleton, {.method = BindMethod::bounded_biharmonic}).weights;
  const double off = Eigen::MatrixXd(made - arm.rig->weights).cwiseAbs().sum() / 2;
  CHECK(off / arm.mesh.vertex_count() < 0.06);
}

TEST_CASE("weights: biharmonic weights of a body are near its heat weights, and every bone has a region", "[weights]") {
  Context context;
  const Asset body = make_sample("humanoid", 6000, context).value();
  const SkinWeights made = bound(body.mesh, body.rig->skeleton, {.method = BindMethod::bounded_biharmonic}).weights;
  const double misplaced = Eigen::MatrixXd(made - body.rig->weights).cwiseAbs().sum() / 2 / body.mesh.vertex_count();
  CAPTURE(misplaced);
  CHECK(misplaced < 0.1);
  std::vector<Index> ruled(static_cast<std::size_t>(body.rig->skeleton.bone_count()), 0);
  for (Index v = 0; v < made.rows(); ++v) {
    BoneShare most;
    for (SkinWeights::InnerIterator it(made, v); it; ++it)
      if (it.value() > most.weight) most = {static_cast<Index>(it.col()), it.value()};
    ++ruled[static_cast<std::size_t>(most.bone)];
  }
  CHECK(*std::min_element(ruled.begin(), ruled.end()) > 10);
}

TEST_CASE("weights: bad options and inputs are refused by name", "[weights]") {
  const Grid grid{8, 8, true, false};
  const auto mesh = test::build(test::tube_positions(grid, 2, 0.5), grid.triangles());
  const Skeleton skeleton = chain({Vector3(0, 0, 0), Vector3(2, 0, 0)});
  Context context;
  const auto refused = [&](const BindOptions& options, std::string_view name) {
    const auto result = bind_weights(mesh, skeleton, options, context);
    REQUIRE_FALSE(result);
    CHECK(result.error().code == ErrorCode::bad_option);
    CHECK(result.error().message().find(name) != std::string::npos);
  };
  refused({.influences = 0}, "influences");
  refused({.resolution = 7}, "resolution");
  refused({.resolution = 513}, "resolution");
  refused({.stiffness = 1.5}, "stiffness");
  refused({.smoothing = std::nan("")}, "smoothing");
  refused({.solver = "magic"}, "magic");
  CHECK_FALSE(bind_weights(mesh, {}, {}, context));
  CHECK_FALSE(bind_weights({}, skeleton, {}, context));
  CHECK_FALSE(bind_weights(mesh, chain({Vector3(0, 0, 0), Vector3(std::nan(""), 0, 0)}), {}, context));
  std::atomic<bool> stop = true;
  context.cancel_flag = &stop;
  for (const BindMethod method : {BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic}) {
    const auto cancelled = bind_weights(mesh, skeleton, {.method = method}, context);
    REQUIRE_FALSE(cancelled);
    CHECK(cancelled.error().code == ErrorCode::cancelled);
  }
}
