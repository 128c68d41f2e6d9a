// Targets from bones, features and curvature.
#include "surfaces.hpp"
#include "test.hpp"

#include "quadrig/asset.hpp"
#include "quadrig/constraints.hpp"

using namespace quadrig;
using quadrig::test::Grid;

namespace {

// A tube about x with bones [0, 5] and [5, 10] along it; weights blend between x = 4 and 6.
Asset tube(bool side_by_side = false) {
  const Grid grid{24, 40, true, false};
  Asset asset{test::build(test::tube_positions(grid, 10, 1), grid.triangles()), Rig{}};
  Bone first, second;
  first.tail = Vector3(5, 0, 0);
  second.head = Vector3(5, 0, 0);
  second.tail = Vector3(10, 0, 0);
  if (side_by_side) {  // bones across the tube, side by side along it
    first.tail = Vector3(0, 5, 0);
    second.tail = Vector3(5, 5, 0);
  }
  asset.rig->skeleton.bones = {first, second};
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) {
    const double t = std::clamp((asset.mesh.position(v).x() - 4) / 2, 0.0, 1.0);
    if (t < 1) entries.emplace_back(v, 0, 1 - t);
    if (t > 0) entries.emplace_back(v, 1, t);
  }
  asset.rig->weights.resize(asset.mesh.vertex_count(), 2);
  asset.rig->weights.setFromTriplets(entries.begin(), entries.end());
  return asset;
}

}  // namespace

TEST_CASE("constraints: where one bone rules the target is the cross along it, with u² v² = −b⁴", "[constraints]") {
  const Asset asset = tube();
  const Connection<double> connection(asset.mesh);
  const auto dominance = Dominance::create(asset.mesh, *asset.rig).value();
  for (const auto lengths : {BoneTargetOptions::Lengths::thesis, BoneTargetOptions::Lengths::unit}) {
    const auto targets = bone_targets(asset.mesh, connection, asset.rig->skeleton, dominance, {.lengths = lengths});
    Index ruled = 0;
    for (Index f = 0; f < asset.mesh.face_count(); ++f) {
      if (dominance.omega(f, 1) < 1) continue;
      ++ruled;
      const Complex along = connection.to_complex(f, Vector3::UnitX());
      CHECK(std::abs(targets.x0[static_cast<std::size_t>(f)] + integer_power(along, 4)) < 1e-12);
      CHECK(std::abs(targets.x1[static_cast<std::size_t>(f)]) < 1e-12);
      CHECK(targets.weight[static_cast<std::size_t>(f)] == Approx(0.6));
    }
    CHECK(ruled > 1000);
  }
}

TEST_CASE("constraints: lines are dense along bones end to end and across bones side by side", "[constraints]") {
  for (const bool side_by_side : {false, true}) {
    const Asset asset = tube(side_by_side);
    const Connection<double> connection(asset.mesh);
    const auto dominance = Dominance::create(asset.mesh, *asset.rig).value();
    Index blended = 0;
    for (Index f = 0; f < asset.mesh.face_count(); ++f) {
      if (dominance.omega(f, 2) < 0.5) continue;
      ++blended;
      const BoneDensity s = two_bone_density(asset.mesh, connection, asset.rig->skeleton, dominance, f);
      if (side_by_side) {
        CHECK(s.along < 0.1);
        CHECK(s.across > 3.9);
      } else {
        CHECK(s.along == 4);
        CHECK(s.across == 1);
      }
    }
    CHECK(blended > 20);
  }
}

TEST_CASE("constraints: a bone without direction pulls nothing", "[constraints]") {
  Asset asset = tube();
  asset.rig->skeleton.bones[0].has_direction = false;
  const Connection<double> connection(asset.mesh);
  const auto dominance = Dominance::create(asset.mesh, *asset.rig).value();
  const auto targets = bone_targets(asset.mesh, connection, asset.rig->skeleton, dominance);
  for (Index f = 0; f < asset.mesh.face_count(); ++f)
    CHECK((targets.weight[static_cast<std::size_t>(f)] == 0) == (dominance.share(f, 1).bone == 0));
}

TEST_CASE("constraints: the curvature measure of a torus integrates to its total mean curvature, across its tube",
          "[constraints]") {
  const Grid grid{60, 120, true, true};
  const double large = 3, small = 1;
  const auto mesh = test::build(test::torus_positions(grid, large, small), grid.triangles());
  const Connection<double> connection(mesh);
  const CurvatureMeasure measure = curvature_measure(mesh, connection);
  double mean = 0, agreement = 0, deviation = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    mean += measure.mean[static_cast<std::size_t>(f)];
    // The larger curvature, 1 / small, runs round the tube: across the direction round the axis.
    const Vector3 centre =
        (mesh.position(mesh.faces()(f, 0)) + mesh.position(mesh.faces()(f, 1)) + mesh.position(mesh.faces()(f, 2))) / 3;
    const Complex round = connection.to_complex(f, Vector3::UnitZ().cross(centre).normalized());
    agreement -= std::real(measure.deviation[static_cast<std::size_t>(f)] * std::conj(round * round));
    deviation += std::abs(measure.deviation[static_cast<std::size_t>(f)]);
  }
  // ∫ H = ∫ (1 / r + cos a / (R + r cos a)) / 2 dA = 2π² R
  CHECK(mean == Approx(2 * std::numbers::pi * std::numbers::pi * large).epsilon(0.01));
  CHECK(agreement > 0);
  CHECK(agreement ==
        Approx(2 * std::numbers::pi * std::numbers::pi * large).epsilon(0.02));  // ∫ (κ1 − κ2) / 2 is 2π² R too
  CHECK(deviation >= agreement);
}

TEST_CASE("constraints: creases are runs of sharp edges, and faces follow their longest", "[constraints]") {
  const Grid grid{8, 6, false, false};  // a sheet folded by 60° along i = 4
  const auto mesh = test::build(grid.positions([](Index i, Index j) {
    const double beyond = std::max(0, i - 4);
    return Vector3(std::min(i, Index{4}) + beyond / 2, j, beyond * std::sqrt(3.0) / 2);
  }),
                                grid.triangles());
  const Connection<double> connection(mesh);
  const auto creases = crease_halfedges(mesh, 0.7);
  CHECK(creases.size() == 12);
  for (const Index h : creases) CHECK(static_cast<double>(dihedral_angle(mesh, h)) == Approx(std::numbers::pi / 3));
  CHECK(crease_halfedges(mesh, 1.2).empty());
  const auto at_least = [&](double length) {
    const auto same = [=](Index) { return length; };
    return crease_halfedges(mesh, 0.7, function_ref<double(Index)>(same)).size();
  };
  CHECK(at_least(5.9) == 12);
  CHECK(at_least(6.1) == 0);

  const auto border = directions_along(mesh, connection, boundary_halfedges(mesh));
  std::vector<Index> faces;
  for (const FixedDirection& each : border) {
    faces.push_back(each.face);
    bool along_an_edge = false;
    for (Index h = 3 * each.face; h < 3 * each.face + 3; ++h)
      along_an_edge = along_an_edge || (mesh.twin(h) == no_index && each.direction == connection.edge(h));
    CHECK(along_an_edge);
  }
  CHECK(std::ranges::is_sorted(faces));
  CHECK(std::ranges::adjacent_find(faces) == faces.end());
  CHECK(faces.size() == boundary_halfedges(mesh).size() - 2);  // two corner faces have two border edges each
}

TEST_CASE("constraints: a clip that straightens bones gives the targets of the straight surface", "[constraints]") {
  const Asset straight = tube();
  const SkinWeights& weights = straight.rig->weights;
  const Skeleton& skeleton = straight.rig->skeleton;
  const Dominance dominance = Dominance::create(straight.mesh, *straight.rig).value();
  // The rest pose: the second bone bent by 70 degrees, then its pose back.
  Pose askew = rest_pose(skeleton);
  askew[1] = quadrig::detail::bend_transform(skeleton.bones[1], Vector3::UnitZ(), 70 * std::numbers::pi / 180);
  Pose back = rest_pose(skeleton);
  back[1] = askew[1].inverse();
  Asset bent{test::build(skin(straight.mesh.positions(), weights, askew), straight.mesh.faces()), straight.rig};
  for (Vector3* end : {&bent.rig->skeleton.bones[1].head, &bent.rig->skeleton.bones[1].tail}) *end = askew[1] * *end;
  const Connection<double> flat(straight.mesh), curved(bent.mesh);
  Context context;
  const auto wanted = bone_targets(straight.mesh, flat, skeleton, dominance);
  const auto posed = [&](std::span<const Pose> poses) {
    return posed_bone_targets(bent.mesh, curved, bent.rig->skeleton, weights, dominance, poses, {}, context).value();
  };
  // Angle of the cross to the face's first edge, against that on the straight surface; degrees, over blending faces.
  const auto off = [&](const PolyVectorTargets& targets) {
    double sum = 0;
    Index count = 0;
    for (Index f = 0; f < bent.mesh.face_count(); ++f) {
      const auto i = static_cast<std::size_t>(f);
      if (dominance.omega(f, 1) > 0.95 || !(targets.weight[i] > 0) || !(wanted.weight[i] > 0)) continue;
      // by the whole gradient of the face, as turned
      const auto edge = [&](const Connection<double>& c, const TriangleMesh<double>& m, Index h) {
        return c.to_complex(f, m.edge_vector(h));
      };
      const Complex e0 = edge(flat, straight.mesh, 3 * f), e1 = edge(flat, straight.mesh, 3 * f + 1),
                    d0 = edge(curved, bent.mesh, 3 * f), d1 = edge(curved, bent.mesh, 3 * f + 1);
      const Complex p = (d0 * std::conj(e1) - d1 * std::conj(e0)) / (e0 * std::conj(e1) - e1 * std::conj(e0));
      const Complex turned = wanted.x0[i] * integer_power(p / std::abs(p), 4);
      sum += std::abs(std::arg(targets.x0[i] / turned)) / 4 * 180 / std::numbers::pi;
      ++count;
    }
    return sum / count;
  };
  const double at_rest = off(bone_targets(bent.mesh, curved, bent.rig->skeleton, dominance));
  const double straightened = off(posed(std::span(&back, 1)));
  INFO(at_rest << " degrees at rest, " << straightened << " by the clip");
  CHECK(at_rest > 3);
  CHECK(straightened < at_rest / 3);

  // In the rest pose, however often, they are those at rest.
  const std::vector<Pose> still(3, rest_pose(skeleton));
  const auto same = posed(still), rest = bone_targets(bent.mesh, curved, bent.rig->skeleton, dominance);
  for (std::size_t i = 0; i < rest.weight.size(); ++i) {
    CHECK(same.weight[i] == Approx(rest.weight[i]).margin(1e-9));
    CHECK(std::abs(same.x0[i] - rest.x0[i]) < 1e-9);
  }
}
