// Targets along the bones where one rules, and a blend across where two do (thesis 4.2 to 4.14).
#pragma once

#include "quadrig/constraints/targets.hpp"
#include "quadrig/dominance.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig {

struct BoneTargetOptions {
  enum class Lengths : std::uint8_t {
    thesis,  ///< magnitudes exactly as the thesis has them: s1, s2 and the bones' projections not normalized
    unit,    ///< unit crosses, each bone's share scaled by how much of it lies in the face
  };
  Lengths lengths = Lengths::unit;
};

/// Density of lines that the two-bone rule asks of a face: across the first root (along the bone) and the second.
struct BoneDensity {
  double along = 1, across = 1;
};

/// Weights of alignment and of smoothness on a face: α = 0.6 ω1 + 0.2 ω2 and β = half of what α leaves of ω, which is
/// 0.2 ω1 + 0.4 ω2 + 0.5 (1 − ω1 − ω2). Source: thesis (4.17) to (4.18), continued past ω3.
[[nodiscard]] inline double bone_alpha(const Dominance& dominance, Index face) {
  return 0.6 * dominance.omega(face, 1) + 0.2 * dominance.omega(face, 2);
}
[[nodiscard]] inline double bone_beta(const Dominance& dominance, Index face) {
  const double omega1 = dominance.omega(face, 1), omega2 = dominance.omega(face, 2);
  return 0.2 * omega1 + 0.4 * omega2 + 0.5 * (1 - omega1 - omega2);
}

/// A bone's direction projected into a face, not normalized, in the face's basis; 0 for a bone without direction.
template <class Scalar>
[[nodiscard]] Complex bone_on_face(const Connection<Scalar>& connection, const Skeleton& skeleton, Index bone,
                                   Index face) {
  if (bone == no_index || !skeleton.bones[static_cast<std::size_t>(bone)].has_direction) return {};
  const Vector3 direction = skeleton.bones[static_cast<std::size_t>(bone)].direction();
  return Complex(connection.to_complex(face, direction.cast<Scalar>()));
}

/// The densities (s1, s2) of the two-bone rule: 4D and 4(1 − D) where the bones lie side by side (the gradient of ω1
/// runs across the first bone), 4 and 1 where they lie end to end, 1 and 1 where ω1 has no gradient.
template <class Scalar>
[[nodiscard]] BoneDensity two_bone_density(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                                           const Skeleton& skeleton, const Dominance& dominance, Index face) {
  const Vector3 gradient = dominance.gradient_omega1(mesh, face);
  const double slope = gradient.norm();
  if (slope * std::sqrt(static_cast<double>(mesh.area(face))) < 1e-9) return {1, 1};
  const Complex along = Complex(connection.to_complex(face, gradient.template cast<Scalar>())) / slope;
  const Complex bone = bone_on_face(connection, skeleton, dominance.share(face, 1).bone, face);
  const double cosine = std::clamp(std::abs(std::real(along * std::conj(bone))), 0.0, 1.0);
  constexpr double cos_45 = 0.70710678118654752440;
  return cosine < cos_45 ? BoneDensity{4 * cosine, 4 * (1 - cosine)} : BoneDensity{4, 1};
}

/// Targets c = (ω1 c¹ + ω2 c²) / (ω1 + ω2), weighted by α; none where a face's strongest bone has no direction.
/// Threads: those of the context. \pre dominance was made of this mesh and rig. \cost O(m). \fails never. Source:
/// thesis (4.2) to (4.14).
template <class Scalar>
[[nodiscard]] PolyVectorTargets bone_targets(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                                             const Skeleton& skeleton, const Dominance& dominance,
                                             const BoneTargetOptions& options = {}, const Context* context = nullptr) {
  const bool unit = options.lengths == BoneTargetOptions::Lengths::unit;
  PolyVectorTargets targets = PolyVectorTargets::none(mesh.face_count());
  parallel_each(context, targets.weight.size(), [&](std::size_t i) {
    const auto f = static_cast<Index>(i);
    const BoneShare first = dominance.share(f, 1), second = dominance.share(f, 2);
    const double omega1 = dominance.omega(f, 1), omega2 = dominance.omega(f, 2);
    if (first.bone == no_index || !skeleton.bones[static_cast<std::size_t>(first.bone)].has_direction) return;
    if (!(omega1 + omega2 > 0)) return;
    const Complex b1 = bone_on_face(connection, skeleton, first.bone, f);
    const Complex b2 = bone_on_face(connection, skeleton, second.bone, f);
    const bool second_pulls =
        second.bone != no_index && skeleton.bones[static_cast<std::size_t>(second.bone)].has_direction;
    const double w1 = first.weight, w2 = second_pulls ? second.weight : 0.0;

    if (unit) {
      // −b⁴/|b|² is the unit cross times |b|²: a bone normal to the face has no weight.
      const auto cross = [](Complex b) {
        const double squared = std::norm(b);
        return squared > 0 ? -integer_power(b, 4) / squared : Complex{};
      };
      const Complex one = cross(b1), two = (w1 * cross(b1) + w2 * cross(b2)) / (w1 + w2);
      const Complex blend = (omega1 * one + omega2 * two) / (omega1 + omega2);
      const double size = std::abs(blend);
      if (!(size > 1e-12)) return;
      targets.x0[i] = blend / size;
      targets.weight[i] = bone_alpha(dominance, f) * std::min(1.0, size);
      return;
    }

    const Complex unit_bone = b1 / std::max(std::abs(b1), 1e-12);
    const BoneDensity s = two_bone_density(mesh, connection, skeleton, dominance, f);
    const auto x0_of = [&](Complex z) {
      const Complex a = s.along * z, b = s.across * Complex(0, 1) * z;
      return a * a * b * b;
    };
    const auto x1_of = [&](Complex z) {
      const Complex a = s.along * z, b = s.across * Complex(0, 1) * z;
      return -(a * a + b * b);
    };
    const Complex two0 = (w1 * x0_of(b1) + w2 * x0_of(b2)) / (w1 + w2);
    const Complex two1 = (w1 * x1_of(b1) + w2 * x1_of(b2)) / (w1 + w2);
    targets.x0[i] = (omega1 * -integer_power(unit_bone, 4) + omega2 * two0) / (omega1 + omega2);
    targets.x1[i] = omega2 * two1 / (omega1 + omega2);
    targets.weight[i] = bone_alpha(dominance, f);
  });
  return targets;
}

/// The same in poses, carried back to the rest surface: the targets of the posed surface and its posed bones, each
/// turned by the rotation within the skinning's gradient on its face, averaged as crosses. Where poses disagree unit
/// targets weigh less. Source: thesis, figure 5.11: a rest pose that blends bones badly. \pre each pose has a transform
/// a bone. \cost O(m) a pose. \fails cancelled
template <class Scalar>
[[nodiscard]] Expected<PolyVectorTargets> posed_bone_targets(const TriangleMesh<Scalar>& mesh,
                                                             const Connection<Scalar>& connection,
                                                             const Skeleton& skeleton, const SkinWeights& weights,
                                                             const Dominance& dominance, std::span<const Pose> poses,
                                                             const BoneTargetOptions& options, Context& context) {
  PolyVectorTargets sum = PolyVectorTargets::none(mesh.face_count());
  const Points<double> rest = mesh.positions().template cast<double>();
  for (const Pose& pose : poses) {
    if (context.cancelled()) return cancelled_error("field");
    const auto posed = TriangleMesh<double>::create(skin(rest, weights, pose), mesh.faces());
    if (!posed) return posed.error();
    Skeleton moved = skeleton;
    for (std::size_t b = 0; b < moved.bones.size(); ++b)
      for (Vector3* end : {&moved.bones[b].head, &moved.bones[b].tail}) *end = pose[b] * *end;
    const Connection<double> posed_connection(*posed, &context);
    const PolyVectorTargets found = bone_targets(*posed, posed_connection, moved, dominance, options, &context);
    parallel_each(&context, sum.weight.size(), [&](std::size_t i) {
      const auto f = static_cast<Index>(i);
      constexpr double collapsed = 1e-3;  // of its area at rest
      if (!(found.weight[i] > 0) || !(posed->area(f) > collapsed * static_cast<double>(mesh.area(f)))) return;
      const auto edge = [&](Index h) { return Complex(connection.to_complex(f, mesh.edge_vector(h))); };
      const auto posed_edge = [&](Index h) { return posed_connection.to_complex(f, posed->edge_vector(h)); };
      const Complex e0 = edge(3 * f), e1 = edge(3 * f + 1), d0 = posed_edge(3 * f), d1 = posed_edge(3 * f + 1);
      // The gradient is e → p e + q ē; p turns.
      const Complex p = (d0 * std::conj(e1) - d1 * std::conj(e0)) / (e0 * std::conj(e1) - e1 * std::conj(e0));
      const Complex back = std::conj(p) / std::abs(p);
      sum.x0[i] += found.weight[i] * found.x0[i] * integer_power(back, 4);
      sum.x1[i] += found.weight[i] * found.x1[i] * back * back;
      sum.weight[i] += found.weight[i];
    });
  }
  const bool unit = options.lengths == BoneTargetOptions::Lengths::unit;
  for (std::size_t i = 0; i < sum.weight.size(); ++i) {
    if (!(sum.weight[i] > 0)) continue;
    // Of unit crosses the mean's size says how much they agree.
    const double agreed = unit ? std::abs(sum.x0[i]) / sum.weight[i] : 1.0;
    const double divisor = unit ? std::max(std::abs(sum.x0[i]), 1e-300) : sum.weight[i];
    sum.x0[i] /= divisor;
    sum.x1[i] /= divisor;
    sum.weight[i] *= agreed / static_cast<double>(poses.size());
  }
  return sum;
}

}  // namespace quadrig
