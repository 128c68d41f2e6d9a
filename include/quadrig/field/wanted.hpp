// What the default field is asked for: targets of the bones, the curvature and the caller, and faces whose cross is
// given.
#pragma once

#include "quadrig/field.hpp"

namespace quadrig::detail {

template <class Scalar>
struct FieldProblem {
  const TriangleMesh<Scalar>* mesh;
  const Connection<Scalar>* connection;
  const Skeleton* skeleton = nullptr;
  std::optional<Dominance> dominance;
  const SkinWeights* weights = nullptr;
};

/// Targets of the bones, at rest or in the poses that are given.
template <class Scalar>
Expected<PolyVectorTargets> bone_targets_of(const FieldProblem<Scalar>& problem, std::span<const Pose> poses,
                                            const BoneTargetOptions& options, Context& context) {
  if (poses.empty())
    return bone_targets(*problem.mesh, *problem.connection, *problem.skeleton, *problem.dominance, options, &context);
  return posed_bone_targets(*problem.mesh, *problem.connection, *problem.skeleton, *problem.weights, *problem.dominance,
                            poses, options, context);
}

struct ComponentScales {
  Components components;
  std::vector<double> area;     // of each component
  std::vector<double> share;    // of each face in its component's area
  std::vector<double> average;  // smoothing length of each component as a fraction of sqrt(area)
};

template <class Scalar>
ComponentScales component_scales(const TriangleMesh<Scalar>& mesh, double fraction, double length) {
  ComponentScales scales;
  scales.components = face_components(mesh);
  scales.area.assign(static_cast<std::size_t>(scales.components.count), 0.0);
  const auto component = [&](Index f) {
    return static_cast<std::size_t>(scales.components.of_face[static_cast<std::size_t>(f)]);
  };
  for (Index f = 0; f < mesh.face_count(); ++f) scales.area[component(f)] += mesh.area(f);
  for (Index f = 0; f < mesh.face_count(); ++f) scales.share.push_back(mesh.area(f) / scales.area[component(f)]);
  // A component of a few quads would be smoothed flat by a length beyond its own size.
  for (const double area : scales.area)
    scales.average.push_back(std::max(fraction, std::min(0.25, length / std::sqrt(area))));
  return scales;
}

// Unit crosses along the averaged principal directions; weights grow from 0, where the surface bends alike in all
// directions or hardly at all, to 1.
template <class Scalar>
Expected<PolyVectorTargets> curvature_targets(const FieldProblem<Scalar>& problem, const ComponentScales& scales,
                                              double fraction, BasicFieldSolver<Scalar>& solver, Context& context) {
  const TriangleMesh<Scalar>& mesh = *problem.mesh;
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const CurvatureMeasure measure = curvature_measure(mesh, *problem.connection);
  std::vector<Complex> mean(m), deviation(m);
  for (std::size_t f = 0; f < m; ++f) {
    const double area = mesh.area(static_cast<Index>(f));
    mean[f] = measure.mean[f] / area;
    deviation[f] = measure.deviation[f] / area;
  }
  std::vector<double> smoothness = dirichlet_weights(mesh);
  for (double& each : smoothness) each *= fraction * fraction;
  const std::array<BasicFieldSystem<Scalar>, 2> systems{
      BasicFieldSystem<Scalar>{
          .power = 2, .smoothness = smoothness, .target = deviation, .target_weight = scales.share},
      BasicFieldSystem<Scalar>{.power = 0, .smoothness = smoothness, .target = mean, .target_weight = scales.share}};
  auto averaged = solver.minimize(systems, context);
  if (!averaged) return averaged.error();
  PolyVectorTargets targets = PolyVectorTargets::none(mesh.face_count());
  for (std::size_t f = 0; f < m; ++f) {
    const Complex q = (*averaged)[0][f];
    const double size = std::abs(q), h = std::abs(std::real((*averaged)[1][f]));
    const double scale = std::sqrt(scales.area[static_cast<std::size_t>(scales.components.of_face[f])]);
    if (!(size * scale > 1e-9)) continue;
    const double pronounced = size / (size + h), bend = size * scale;
    targets.x0[f] = -(q / size) * (q / size);
    targets.weight[f] = pronounced * pronounced * bend * bend / (1 + bend * bend);
  }
  return targets;
}

// `sum` may have no entries yet.
inline void add_targets(PolyVectorTargets& sum, PolyVectorTargets other, double factor, const Context& context) {
  if (sum.weight.empty()) {
    sum = std::move(other);
    return parallel_each(&context, sum.weight.size(), [&](std::size_t f) {
      const double weight = factor * sum.weight[f];
      const bool pulls = weight > 0;
      sum.x0[f] = pulls ? weight * sum.x0[f] / weight : 0;
      sum.x1[f] = pulls ? weight * sum.x1[f] / weight : 0;
      sum.weight[f] = pulls ? weight : 0;
    });
  }
  parallel_each(&context, sum.weight.size(), [&](std::size_t f) {
    const double weight = factor * other.weight[f], total = sum.weight[f] + weight;
    if (!(weight > 0)) return;
    sum.x0[f] = (sum.weight[f] * sum.x0[f] + weight * other.x0[f]) / total;
    sum.x1[f] = (sum.weight[f] * sum.x1[f] + weight * other.x1[f]) / total;
    sum.weight[f] = total;
  });
}

// What the field is drawn to, and by how much its two vectors may differ, by face.
struct WantedCrosses {
  PolyVectorTargets targets;
  std::vector<double> beta;
};

template <class Scalar>
Expected<WantedCrosses> wanted_crosses(const FieldProblem<Scalar>& problem, const BasicFieldOptions<Scalar>& options,
                                       bool flat, const ComponentScales& scales, BasicFieldSolver<Scalar>& solver,
                                       Context& context) {
  const TriangleMesh<Scalar>& mesh = *problem.mesh;
  const auto m = static_cast<std::size_t>(mesh.face_count());
  WantedCrosses wanted{{}, std::vector<double>(m, 0.5)};
  const double bone_weight = options.bone_weight.value_or(flat ? 0.0 : 1.0);
  const double curvature_weight = options.curvature_weight.value_or(flat ? 1.0 : 0.0);
  if (problem.dominance && bone_weight > 0) {
    auto bones = bone_targets_of(problem, options.bone_poses, {}, context);
    if (!bones) return bones.error();
    add_targets(wanted.targets, std::move(*bones), bone_weight, context);
    if (context.cancelled()) return cancelled_error("field");
    for (std::size_t f = 0; f < m; ++f) wanted.beta[f] = bone_beta(*problem.dominance, static_cast<Index>(f));
  }
  if (curvature_weight > 0) {
    auto curved = curvature_targets(problem, scales, options.curvature_length, solver, context);
    if (!curved) return curved.error();
    add_targets(wanted.targets, std::move(*curved), curvature_weight, context);
  }
  if (options.targets) add_targets(wanted.targets, *options.targets, 1, context);
  if (wanted.targets.weight.empty()) wanted.targets = PolyVectorTargets::none(mesh.face_count());
  return wanted;
}

// Faces whose cross is given. A face keeps the first that it gets.
template <class Scalar>
struct HeldCrosses {
  explicit HeldCrosses(std::size_t faces) : held(faces, 0) {}

  void hold(const std::vector<FixedDirection>& directions) {
    for (const FixedDirection& each : directions) {
      if (std::exchange(held[static_cast<std::size_t>(each.face)], char{1})) continue;
      x0.push_back({each.face, -integer_power(each.direction / std::abs(each.direction), 4)});
      x1.push_back({each.face, Complex{}});
    }
  }

  std::vector<char> held;
  std::vector<typename BasicFieldSystem<Scalar>::Fixed> x0, x1;
};

// Given directions first, then borders, features, and creases.
template <class Scalar>
HeldCrosses<Scalar> held_crosses(const FieldProblem<Scalar>& problem, const BasicFieldOptions<Scalar>& options,
                                 bool flat, const ComponentScales& scales, Context& context) {
  const TriangleMesh<Scalar>& mesh = *problem.mesh;
  const Connection<Scalar>& connection = *problem.connection;
  const auto m = static_cast<std::size_t>(mesh.face_count());
  HeldCrosses<Scalar> crosses(m);
  crosses.hold(options.fixed);
  if (options.follow_boundary) crosses.hold(directions_along(mesh, connection, boundary_halfedges(mesh)));
  if (!options.features.empty()) crosses.hold(directions_along(mesh, connection, options.features));
  const double limit = options.crease_angle_radians.value_or(flat ? 0.7 : std::numbers::pi);
  if (!(limit < std::numbers::pi)) return crosses;
  const auto least_length = [&](Index f) {
    const auto c = static_cast<std::size_t>(scales.components.of_face[static_cast<std::size_t>(f)]);
    return options.crease_length * std::sqrt(scales.area[c]);
  };
  const auto along =
      directions_along(mesh, connection, crease_halfedges(mesh, limit, function_ref<double(Index)>(least_length)));
  if (along.size() * 5 <= m)
    crosses.hold(along);
  else
    context.warn("field", std::to_string(along.size()) + " of " + std::to_string(m) +
                              " faces lie beside sharp edges: taken for a coarse or rough surface, no crease is held");
  return crosses;
}

}  // namespace quadrig::detail
