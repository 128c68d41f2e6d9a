#include <map>
#include <numeric>

#include "quadrig/field/loops.hpp"
#include "quadrig/field/surgery.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/hinge_bands.hpp"
#include "quadrig/quantize.hpp"
#include "quadrig/quantize/quantizer.hpp"
#include "quadrig/samples.hpp"
#include "quadrig/seamless.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

Asset limbs(std::string_view name, Index triangles) {
  Context context;
  return make_sample(name, triangles, context).value();
}

struct LimbField {
  Asset asset;
  Connection<double> connection;
  FieldResult field;
  std::vector<Hinge> hinges;
};
LimbField limb_field(std::string_view name) {
  Context context;
  Asset asset = limbs(name, 6000);
  Connection<double> connection(asset.mesh);
  FieldOptions options;
  options.quad_edge = std::sqrt(asset.mesh.total_area() / 2000);
  FieldResult field = design_field(asset, connection, options, context).value();
  RepairOptions repair;
  repair.edge = options.quad_edge;
  repair.quads = 2000;
  field = repair_singularities(asset.mesh, std::move(field), repair, context).value();
  std::vector<Hinge> hinges = find_hinges(asset.mesh, *asset.rig);
  return {std::move(asset), std::move(connection), std::move(field), std::move(hinges)};
}

std::vector<FaceLoop> loops_of(const std::vector<Hinge>& hinges) {
  std::vector<FaceLoop> loops;
  for (const Hinge& hinge : hinges) loops.push_back(hinge.loop);
  return loops;
}

}  // namespace

TEST_CASE("loops: a level curve is closed, and what is above it lies to its left", "[loops][fast]") {
  const Asset asset = limbs("pear", 2000);
  const TriangleMesh<double>& mesh = asset.mesh;
  const Eigen::VectorXd axis = mesh.positions().rowwise().norm();
  const std::vector<double> height(axis.data(), axis.data() + axis.size());
  const double level = 0.5 * (axis.minCoeff() + axis.maxCoeff());
  const std::vector<FaceLoop> loops = level_loops(mesh, height, level);
  REQUIRE(!loops.empty());
  for (const FaceLoop& loop : loops)
    for (std::size_t k = 0; k < loop.crossed.size(); ++k) {
      const Index h = loop.crossed[k], after = loop.crossed[(k + 1) % loop.crossed.size()];
      CHECK(mesh.twin(h) / 3 == after / 3);
      CHECK(crossing(mesh, loop, k).norm() == Approx(level).epsilon(0.05));
      CHECK(height[at(mesh.target(h))] >= level);
    }
  for (const BesideLoop& beside : vertices_beside(mesh, loops[0], 0.2 * axis.maxCoeff()))
    CHECK((height[at(beside.vertex)] >= level) == (beside.distance > 0));
}

TEST_CASE("loops: every joint of a limb is a hinge, once", "[loops][fast]") {
  const Asset asset = limbs("humanoid", 6000);
  const std::vector<Hinge> hinges = find_hinges(asset.mesh, *asset.rig);
  std::vector<Index> bones;
  for (const Hinge& hinge : hinges) {
    bones.push_back(hinge.bone);
    CHECK(hinge.length > 0);
    CHECK(hinge.bend >= 0.99 * hinge.length / (2 * std::numbers::pi));
  }
  CHECK(std::adjacent_find(bones.begin(), bones.end()) == bones.end());
  CHECK(hinges.size() >= 8);  // elbows, wrists, knees, ankles at least
}

TEST_CASE("loops: turns are four less the indices to the left", "[loops][fast]") {
  const LimbField c = limb_field("humanoid");
  const TriangleMesh<double>& mesh = c.asset.mesh;
  REQUIRE(mesh.closed());
  for (const Hinge& hinge : c.hinges) {
    std::vector<char> barred(at(mesh.halfedge_count()), 0), left(at(mesh.vertex_count()), 0);
    std::vector<Index> open;
    for (const Index h : hinge.loop.crossed) {
      barred[at(h)] = barred[at(mesh.twin(h))] = 1;
      if (!std::exchange(left[at(mesh.target(h))], char{1})) open.push_back(mesh.target(h));
    }
    Index sum = 0;
    for (std::size_t k = 0; k < open.size(); ++k) {
      sum += c.field.singularities.index4[at(open[k])];
      for (const Index h : mesh.around(open[k]))
        if (!barred[at(h)] && !std::exchange(left[at(mesh.target(h))], char{1})) open.push_back(mesh.target(h));
    }
    CHECK(quarter_turns(mesh, c.field.matching, hinge.loop) == 4 - sum);
  }
}

TEST_CASE("loops: the translation across a loop that a map is to close is 0", "[loops]") {
  const LimbField c = limb_field("humanoid");
  Context context;
  SeamlessOptions options;
  options.quads = 2000;
  const SeamlessMap free = seamless_map(c.asset.mesh, c.connection, c.field, options, context).value();
  options.loops = loops_of(c.hinges);
  const SeamlessMap map = seamless_map(c.asset.mesh, c.connection, c.field, options, context).value();
  REQUIRE(map.valid());
  REQUIRE(map.report.closed.size() == options.loops.size());
  Index closed = 0, were = 0;
  for (std::size_t k = 0; k < options.loops.size(); ++k) {
    if (!map.report.closed[k]) continue;
    CHECK(quarter_turns(c.asset.mesh, c.field.matching, options.loops[k]) == 0);
    const auto across = [&](const SeamlessMap& of) {
      const Complex t = loop_translation(c.asset.mesh, of.cut, of.z, options.loops[k]);
      return std::min(std::abs(t.real()), std::abs(t.imag()));
    };
    CHECK(across(map) < 1e-9);
    ++closed;
    were += across(free) < 1e-9;
  }
  CHECK(closed >= 8);
  CHECK(were < closed);
  // Lines of the coarse map come back to where they began, and integers keep that.
  const CoarseMap coarse = decimate_map(c.asset.mesh, map.cut, map.index4, map.aligned, map.z);
  const std::vector<detail::Ring> rings = detail::near_rings(coarse, 1, 1.5);
  CHECK(std::ranges::count_if(rings, &detail::Ring::closed) >= 4);
  for (const double quads : {1500.0, 3000.0}) {
    QuantizeOptions wanted;
    wanted.target_quads = quads;
    const std::vector<char> on_border(at(c.asset.mesh.vertex_count()), 0);
    const Quantization integers = quantize(coarse, map.index4, on_border, wanted, context).value();
    for (const detail::Ring& ring : rings) {
      if (!ring.closed()) continue;
      Gaussian sum{};
      for (const auto& [h, turn] : ring.walk) sum = sum + rotated(integers.edge[at(h)], turn & 3);
      CHECK(ring.across(sum.re, sum.im) == 0);
    }
  }
}

TEST_CASE("loops: those where a map flips are let go, and no others", "[loops][fast]") {
  const Asset asset = limbs("humanoid", 3000);
  const std::vector<FaceLoop> loops = loops_of(find_hinges(asset.mesh, *asset.rig));
  REQUIRE(loops.size() > 3);
  detail::DemandedLoops demanded;
  for (std::size_t k = 1; k < loops.size(); ++k) demanded.add(static_cast<Index>(k), {{}, static_cast<int>(k % 2)});
  std::vector<char> closed(loops.size(), 1);
  std::vector<Index> trouble;
  CHECK_FALSE(demanded.in_trouble(asset.mesh, loops, trouble));
  CHECK_FALSE(demanded.release(asset.mesh, loops, trouble, closed));
  trouble = {loops[2].crossed[0] / 3};
  CHECK(demanded.in_trouble(asset.mesh, loops, trouble));
  const std::size_t before = demanded.number.size();
  CHECK(demanded.release(asset.mesh, loops, trouble, closed));
  CHECK(demanded.number.size() < before);
  CHECK(closed[2] == 0);
  const std::vector<char> corners = corners_of(asset.mesh, trouble);
  for (std::size_t k = 0; k < demanded.number.size(); ++k) {
    const Index loop = demanded.number[k];
    CHECK(demanded.demands[k].component == loop % 2);
    CHECK_FALSE(passes(asset.mesh, loops[at(loop)], corners));
    CHECK(closed[at(loop)] == 1);
  }
  CHECK_FALSE(demanded.in_trouble(asset.mesh, loops, trouble));
}

TEST_CASE("loops: a limb has closed rings at its joint at every count", "[loops][pipeline]") {
  const Asset asset = limbs("pear", 4000);
  for (const Index quads : {400, 700, 1100, 1700}) {
    Context context;
    RemeshOptions options;
    options.quads = quads;
    const RemeshResult result = remesh(asset, options, context).value();
    REQUIRE(result.report.hinges.size() == 1);
    CHECK(result.report.hinges[0].rings.loops >= 3);
    CHECK(result.report.hinges[0].rings.around >= 6);
  }
}

TEST_CASE("loops: round the middle of a hinge directions are asked for, where a curve runs round its bones",
          "[loops][fast]") {
  const Asset asset = limbs("humanoid", 6000);
  const std::vector<Hinge> hinges = find_hinges(asset.mesh, *asset.rig);
  const auto pulls = [&](double edge, LoopOptions loops = {}) {
    std::vector<FaceDirection> all;
    detail::pull_along_hinges(
        asset.mesh, *asset.rig, loops, [&](const FaceLoop&) { return edge; }, all);
    return all;
  };
  CHECK(pulls(1e3).empty());  // no quad goes round
  CHECK(pulls(1e-3, {0, {}}).empty());
  const std::vector<FaceDirection> all = pulls(1e-3);
  REQUIRE(!all.empty());
  // Shins hang on thighs: bones 11 and 12 of the left leg, 19 and 20 of the right; their directions are nearly level.
  std::size_t at_knees = 0;
  for (const Hinge& hinge : hinges) {
    if (hinge.bone != 11 && hinge.bone != 19) continue;
    const Bone& bone = asset.rig->skeleton.bones[at(hinge.bone)];
    for (const FaceDirection& one : all) {
      CHECK(std::abs(one.direction.norm() - 1) < 1e-9);
      CHECK(std::abs(one.direction.dot(asset.mesh.normal(one.face))) < 1e-9);
      if ((position(asset.mesh, {one.face, Vector3::Constant(1.0 / 3)}) - bone.head).norm() > 0.75 * hinge.bend)
        continue;
      ++at_knees;
      CHECK(std::abs(one.direction.dot(bone.direction())) < 0.5);
    }
  }
  CHECK(at_knees > 20);
  // The curve of a clavicle runs along the spine and along the clavicle: there is no way round it without poles.
  CHECK(pulls(1e-3, {0, {{asset.rig->skeleton.bones[5].name, 3}}}).empty());
  CHECK(!pulls(1e-3, {0, {{asset.rig->skeleton.bones[11].name, 3}}}).empty());
}

TEST_CASE("loops: a joint that is named gets rows for its loops, and its twin on the other side too",
          "[loops][pipeline]") {
  const Asset asset = limbs("humanoid", 10000);
  const auto loops_at = [&](std::vector<LoopOptions::OfJoint> of_joints) {
    RemeshOptions options;
    options.quads = 1500;
    options.loops.of_joints = std::move(of_joints);
    Context context;
    const Expected<RemeshResult> result = remesh(asset, options, context);
    REQUIRE(result);
    std::map<std::string, Index> loops;
    for (const HingeReport& hinge : result->report.hinges) loops[hinge.joint] = hinge.rings.loops;
    return loops;
  };
  const std::string left = asset.rig->skeleton.bones[7].name, right = asset.rig->skeleton.bones[15].name;
  std::map<std::string, Index> before = loops_at({}), after = loops_at({{left, 7}});
  CHECK(after[left] >= before[left] + 2);
  CHECK(after[right] >= before[right] + 2);
}

TEST_CASE("loops: what is wanted goes by the name of the joint", "[loops][fast]") {
  LoopOptions options;
  options.of_joints = {{"elbow*", 5}, {"*.R", 2}, {"knee.L", 0}};
  CHECK(options.of("hip.L") == 3);
  CHECK(options.of("elbow.L") == 5);
  CHECK(options.of("elbow.R") == 2);
  CHECK(options.of("knee.L") == 0);
  CHECK(options.of("knee.LL") == 3);
  CHECK(LoopOptions::matches("lower_arm.L", "*arm*"));
  CHECK(!LoopOptions::matches("lower_arm.L", "*leg*"));
}
