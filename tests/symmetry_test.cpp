#include "quadrig/symmetry.hpp"

#include <set>

#include "quadrig/pipeline.hpp"
#include "quadrig/samples.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

Asset humanoid(Index triangles = 6000) {
  Context context;
  auto asset = make_sample("humanoid", triangles, context);
  REQUIRE(asset);
  return std::move(*asset);
}
/// The asset with its points and joints moved.
template <class Move>
Asset moved(const Asset& asset, Move&& move) {
  Asset other = asset;
  Points<double> positions = asset.mesh.positions();
  for (Eigen::Index v = 0; v < positions.rows(); ++v)
    positions.row(v) = Vector3(move(Vector3(positions.row(v).transpose()))).transpose();
  other.mesh = build(std::move(positions), asset.mesh.faces());
  if (other.rig)
    for (Bone& bone : other.rig->skeleton.bones) {
      bone.head = move(bone.head);
      bone.tail = move(bone.tail);
    }
  return other;
}
std::optional<MirrorPlane> plane_of(const Asset& asset, SymmetryChoice choice) {
  Context context;
  auto found = find_mirror_plane(asset, choice, context);
  REQUIRE(found);
  return *found;
}
/// Quads whose mirror twins are a quad, turned the other way.
Index mirrored_quads_of(const RemeshResult& result) {
  std::set<std::array<Index, 4>> all;
  const auto least_first = [](std::array<Index, 4> quad) {
    std::rotate(quad.begin(), std::min_element(quad.begin(), quad.end()), quad.end());
    return quad;
  };
  const Quads& quads = result.mesh.quads;
  for (Eigen::Index q = 0; q < quads.rows(); ++q)
    all.insert(least_first({quads(q, 0), quads(q, 1), quads(q, 2), quads(q, 3)}));
  Index count = 0;
  for (Eigen::Index q = 0; q < quads.rows(); ++q) {
    std::array<Index, 4> image{};
    for (int i = 0; i < 4; ++i) image[at(i)] = result.twin[at(quads(q, (4 - i) % 4))];
    count += static_cast<Index>(all.count(least_first(image)));
  }
  return count;
}
/// Two balls side by side, and one of another shape on one side alone.
Asset three_shells() {
  std::vector<Vector3> points;
  std::vector<std::array<Index, 3>> faces;
  const auto add = [&](const Vector3& centre, const Vector3& radii, bool mirror) {
    const Grid ring{24, 14, true, false};
    const auto first = static_cast<Index>(points.size());
    const Points<double> round = ring.positions([&](Index i, Index j) {
      const double u = 2 * std::numbers::pi * i / ring.columns, v = std::numbers::pi * (j + 1) / (ring.rows + 2);
      return Vector3(-std::cos(v), std::sin(v) * std::cos(u), std::sin(v) * std::sin(u));
    });
    for (Eigen::Index v = 0; v < round.rows(); ++v) {
      Vector3 p = round.row(v).transpose().cwiseProduct(radii);
      if (mirror) p.x() = -p.x();
      points.push_back(centre + p);
    }
    const Triangles triangles = ring.triangles();
    for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
      std::array<Index, 3> face{first + triangles(f, 0), first + triangles(f, 1), first + triangles(f, 2)};
      if (mirror) std::swap(face[1], face[2]);
      faces.push_back(face);
    }
  };
  add({2, 0, 0}, {1, 0.6, 0.5}, false);
  add({-2, 0, 0}, {1, 0.6, 0.5}, true);
  add({3, 3, 0}, {0.4, 0.7, 0.9}, false);
  Points<double> positions(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v) positions.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  Triangles triangles(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    triangles.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
  return {build(std::move(positions), std::move(triangles)), std::nullopt};
}

}  // namespace

TEST_CASE("symmetry: names tell left from right when skeletons write them as they do", "[symmetry][fast]") {
  const auto other = [](std::string_view name) {
    const std::vector<std::string> names = mirrored_names(name);
    return names.empty() ? std::string("-") : names.front();
  };
  CHECK(other("upperarm01.L") == "upperarm01.R");
  CHECK(other("hand_r") == "hand_l");
  CHECK(other("mixamorig:LeftArm") == "mixamorig:RightArm");
  CHECK(other("RIGHT_FOOT") == "LEFT_FOOT");
  CHECK(other("L_Clavicle") == "R_Clavicle");
  CHECK(other("lShldr") == "rShldr");
  CHECK(other("Bip01 L Thigh") == "Bip01 R Thigh");
  CHECK(other("b_RightUpperArm_06") == "b_LeftUpperArm_06");
  CHECK(other("spine03") == "-");
  CHECK(other("skull") == "-");
  CHECK(other("Roll") == "-");
}

TEST_CASE("symmetry: the plane is found when the body is tilted, off the origin and slightly uneven",
          "[symmetry][fast]") {
  const Asset body = humanoid();
  const std::optional<MirrorPlane> upright = plane_of(body, SymmetryChoice::automatic);
  REQUIRE(upright);
  CHECK(upright->normal == Vector3::UnitX());
  CHECK(upright->offset == 0);
  CHECK(upright->share > 0.99);  // its triangles differ
  CHECK(upright->paired_bones == Approx(1));

  const Eigen::Affine3d turn = Eigen::Translation3d(3, -2, 0.7) *
                               Eigen::AngleAxisd(0.6, Vector3(0.3, 1, -0.4).normalized()) * Eigen::Scaling(40.0);
  const std::optional<MirrorPlane> turned =
      plane_of(moved(body, [&](const Vector3& p) { return Vector3(turn * p); }), SymmetryChoice::automatic);
  REQUIRE(turned);
  CHECK(std::abs(turned->normal.dot(turn.linear().col(0).normalized())) > 1 - 1e-6);
  CHECK(turned->side(turn * Vector3(0, 1, 0.2)) == Approx(0).margin(1e-3 * 40));
  CHECK(turned->share > 0.99);

  // One shoulder higher by 2 % of the height.
  const std::optional<MirrorPlane> uneven = plane_of(
      moved(body, [](const Vector3& p) { return Vector3(p + Vector3(0, 0.035 * std::clamp(p.x(), 0.0, 0.5), 0)); }),
      SymmetryChoice::automatic);
  REQUIRE(uneven);
  CHECK(uneven->normal.x() > 0.999);
  CHECK(uneven->near_share > 0.95);
  CHECK(uneven->share < 0.9);
}

TEST_CASE("symmetry: no plane is found when the body has none", "[symmetry][fast]") {
  // A body whose right half is another's.
  const Asset body = moved(humanoid(), [](const Vector3& p) {
    return p.x() < 0 ? Vector3(2 * p.x(), p.y() + 0.6 * p.x(), p.z() + 0.3 * p.x() * p.x()) : p;
  });
  CHECK(!plane_of(body, SymmetryChoice::automatic));
  CHECK(!plane_of(body, SymmetryChoice::none));
}

TEST_CASE("symmetry: quads of a symmetric body are mirror images, with weights and morphs", "[symmetry]") {
  const Asset body = humanoid();
  Context context;
  RemeshOptions options;
  options.quads = 1200;
  // A chest that swells, and an arm that does on each side.
  for (int k = 0; k < 3; ++k) {
    Points<double> morph = Points<double>::Zero(body.mesh.vertex_count(), 3);
    for (Index v = 0; v < body.mesh.vertex_count(); ++v) {
      const Vector3 p = body.mesh.position(v);
      const Vector3 centre = k == 0 ? Vector3(0, 1.3, 0.1) : Vector3(k == 1 ? 0.5 : -0.5, 1.2, 0);
      morph.row(v) = 0.03 * std::exp(-30 * (p - centre).squaredNorm()) * (p - centre).transpose();
    }
    options.morphs.push_back(morph);
  }
  const auto result = remesh(body, options, context);
  REQUIRE(result);
  const SymmetryReport& report = result->report.symmetry;
  REQUIRE(report.plane);
  CHECK(report.halved == 1);
  CHECK(report.vertices.exact == report.vertices.pairs);
  const Index n = result->mesh.vertex_count();
  REQUIRE(result->twin.size() == at(n));
  CHECK(mirrored_quads_of(*result) == result->mesh.quad_count());
  CHECK(std::abs(result->mesh.quad_count() - 1200) <= 60);
  CHECK(result->report.scaled_jacobian_minimum > 0.3);
  Index on_plane = 0, uneven = 0;
  double off = 0, weight_off = 0, morph_off = 0;
  const SkinWeights& weights = *result->weights;
  const auto image = [&](const Eigen::RowVector3d& d) {
    return Eigen::RowVector3d(report.plane->mirrored_direction(d.transpose()).transpose());
  };
  for (Index v = 0; v < n; ++v) {
    const Index w = result->twin[at(v)];
    REQUIRE(w != no_index);
    CHECK(result->twin[at(w)] == v);
    on_plane += v == w;
    off = std::max(off, (report.plane->mirrored(result->mesh.positions.row(v).transpose()) -
                         result->mesh.positions.row(w).transpose())
                            .norm());
    uneven += weights.row(v).nonZeros() > options.influences;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      weight_off =
          std::max(weight_off, std::abs(it.value() - weights.coeff(w, report.plane->twin[at(Index(it.col()))])));
    for (const auto& [here, there] : {std::pair{0, 0}, {1, 2}, {2, 1}})
      morph_off =
          std::max(morph_off, (image(result->morphs[at(here)].row(v)) - result->morphs[at(there)].row(w)).norm());
  }
  CHECK(on_plane > 20);
  CHECK(uneven == 0);
  CHECK(off < 1e-12);
  CHECK(weight_off < 1e-12);
  CHECK(morph_off < 1e-12);
  CHECK(result->morphs[0].norm() > 0.01);
}

TEST_CASE("symmetry: a lopsided body has mirrored topology, and each side lies on its own surface", "[symmetry]") {
  // One arm is thicker and hangs lower.
  const Asset body = moved(humanoid(), [](const Vector3& p) {
    const double out = std::clamp((p.x() - 0.2) / 0.3, 0.0, 1.0);
    return Vector3(p.x(), p.y() - 0.12 * out * out, p.z() * (1 + 0.5 * out));
  });
  Context context;
  RemeshOptions options;
  options.quads = 1200;
  options.symmetry = SymmetryChoice::x;
  const auto result = remesh(body, options, context);
  REQUIRE(result);
  const SymmetryReport& report = result->report.symmetry;
  REQUIRE(report.plane);
  CHECK(report.halved == 1);
  CHECK(mirrored_quads_of(*result) == result->mesh.quad_count());
  CHECK(report.vertices.exact < report.vertices.pairs);
  CHECK(result->report.scaled_jacobian_minimum > 0.2);
  double farthest = 0;
  for (Index v = 0; v < result->mesh.vertex_count(); ++v)
    farthest = std::max(
        farthest, (position(body.mesh, result->mesh.source[at(v)]) - result->mesh.positions.row(v).transpose()).norm());
  CHECK(farthest < 0.02 * body.mesh.diagonal());
}

TEST_CASE("symmetry: shells that mirror each other get the same quads when one has no twin", "[symmetry]") {
  const Asset shells = three_shells();
  Context context;
  RemeshOptions options;
  options.quads = 900;
  options.mirror_plane = MirrorPlane{};
  options.mirror_plane->tolerance = 1e-3 * shells.mesh.diagonal();
  options.symmetry = SymmetryChoice::x;
  const auto result = remesh(shells, options, context);
  REQUIRE(result);
  CHECK(result->report.symmetry.paired == 2);
  CHECK(result->report.symmetry.whole == 1);
  CHECK(result->report.components[0].quads == result->report.components[1].quads);
  CHECK(mirrored_quads_of(*result) == 2 * result->report.components[0].quads);
  CHECK(std::abs(result->mesh.quad_count() - 900) <= 45);
}

TEST_CASE("symmetry: none is looked for when there is no rig or none is wanted", "[symmetry][fast]") {
  Asset body = humanoid(2000);
  Context context;
  RemeshOptions options;
  options.quads = 500;
  options.symmetry = SymmetryChoice::none;
  const auto left = remesh(body, options, context);
  REQUIRE(left);
  CHECK(!left->report.symmetry.plane);
  CHECK(left->twin.empty());
  body.rig.reset();
  options.symmetry.reset();
  const auto bare = remesh(body, options, context);
  REQUIRE(bare);
  CHECK(!bare->report.symmetry.plane);
  options.symmetry = SymmetryChoice::automatic;
  const auto mirrored = remesh(body, options, context);
  REQUIRE(mirrored);
  CHECK(mirrored->report.symmetry.plane);
  CHECK(mirrored_quads_of(*mirrored) == mirrored->mesh.quad_count());
}
