// How far coarse polygons stray from the fine skinned surface when both are posed alike.
#pragma once

#include "quadrig/quality/distance.hpp"
#include "quadrig/subdivision.hpp"
#include "quadrig/transfer.hpp"

namespace quadrig {

struct DeformationOptions {
  Skinning skinning = Skinning::linear_blend;
  Index samples = 40000;  ///< of either surface, each pose
  std::uint64_t seed = 7;
  double joint_blending = 0.05;  ///< a sample is at a joint where its strongest bone leaves more than this to others
  double bent_blending = 0.1;    ///< a sample is bent by a pose where the strongest rigid body leaves more than this
  /// Borrowed: the coarse mesh is a cage, posed and then subdivided so; null: it is drawn as it is.
  const Subdivision* subdivision = nullptr;
  [[nodiscard]] Status validate() const;
};

/// Distances are from points of the one surface to the plane of the closest triangle of the other, in 1e-4 of the
/// diagonal of the input at rest; normals are compared there. Figures are over all samples and poses, rest apart.
struct DeformationFigures {
  struct Row {
    double rms = 0, p99 = 0;
    double normal_degrees = 0;  ///< mean angle between the normals
  };
  Row joints;                                    ///< coarse to fine, samples at joints
  Row all;                                       ///< coarse to fine
  double back_rms = 0, back_p99 = 0;             ///< fine to coarse: missing parts show here
  double rest_joints_rms = 0, rest_all_rms = 0;  ///< coarse to fine, at rest
  double bent_rms = 0;                           ///< coarse to fine, samples in poses that bend them
  double bent_rest_rms = 0;                      ///< the same samples, each as often, at rest
  double bent_normal_degrees = 0;
  double flipped = 0;  ///< share of samples whose normal points the other way, in [0, 1]
  /// Volume within the coarse surface over that of the input, less 1: at rest, and where it is furthest from 0 in a
  /// pose; 0 where a surface is open.
  double rest_volume = 0, posed_volume = 0;
  double scaled_jacobian_average = 0;  ///< of the posed quads, over all poses
  double scaled_jacobian_minimum = 0;
  double scaled_jacobian_negative = 0;  ///< share below 0, in [0, 1]
};

/// Poses both surfaces by their own weights and compares them.
/// \param coarse any polygons, cut along the diagonals of their first corners
/// \pre corners in range; weights sum to 1 a row
/// \cost O(poses (m + samples log m)); 8 bytes a sample and pose. The same bits at any number of threads.
/// \fails bad_option by validate(); bad_input where weights, poses and surfaces do not fit, a surface has no area, or
///   no pose is given; cancelled
[[nodiscard]] Expected<DeformationFigures> deformation_error(const TriangleMesh<double>& input,
                                                             const SkinWeights& weights, const PolygonMesh& coarse,
                                                             const SkinWeights& coarse_weights,
                                                             std::span<const Pose> poses,
                                                             const DeformationOptions& options, Context& context);

/// Weights for points without a source on the surface: those of the closest point, all influences kept.
/// \fails as transfer_weights
[[nodiscard]] Expected<SkinWeights> closest_weights(const TriangleMesh<double>& surface, const SkinWeights& weights,
                                                    const Points<double>& points);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void closest_weights(const Arguments&...) = delete;  // see with_columns

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/deformation.ipp"
#endif
