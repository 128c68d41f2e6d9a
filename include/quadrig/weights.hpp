// Skin weights for a skeleton that has none: which bones move which part of the surface.
#pragma once

#include "quadrig/energy.hpp"
#include "quadrig/rig.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

enum class BindMethod : std::uint8_t {
  nearest_bone,        ///< each vertex follows the bone nearest to it in space, wholly
  geodesic_voxel,      ///< falls off with the distance inside the body (Dionne and de Lasa 2013)
  bounded_biharmonic,  ///< the smoothest within [0, 1] through the body (Jacobson et al. 2011)
};
/// `nearest`, `voxel` or `biharmonic`: the names that the command takes.
[[nodiscard]] constexpr std::string_view bind_method_name(BindMethod method) {
  switch (method) {
    case BindMethod::nearest_bone:
      return "nearest";
    case BindMethod::geodesic_voxel:
      return "voxel";
    case BindMethod::bounded_biharmonic:
      return "biharmonic";
  }
  return {};
}

struct BindOptions {
  BindMethod method = BindMethod::geodesic_voxel;
  Index influences = 4;    ///< most weights a vertex keeps, the strongest, rescaled to sum 1
  Index resolution = 128;  ///< cells along the longest side of the box around the surface and the bones, 8 to 512
  double stiffness = 0.5;  ///< 0: soft, broad blends; 1: each bone keeps to itself
  double smoothing = 1;    ///< length over which weights are smoothed along the surface, in cells
  std::string solver = std::string(default_solver_name);

  /// \fails bad_option naming the first field out of range.
  [[nodiscard]] QUADRIG_INLINE Status validate() const;
};

struct BoundWeights {
  SkinWeights weights;
  Index bones_outside = 0;  ///< bones none of which lies inside the body: bound through the gap
  Index unmoved_bones = 0;  ///< bones that no vertex follows

  /// One line for the report: how they were made, and what to check.
  [[nodiscard]] QUADRIG_INLINE std::string summary(const BindOptions& options) const;
};

/// Weights of every vertex over the bones of the skeleton. Bones reach round a gap only at eight times the distance, so
/// that legs which almost touch, and an arm beside the trunk, stay apart; a surface with holes is a body all the same.
/// \pre at least one bone and one face
/// \cost `nearest_bone` O(n b); `geodesic_voxel` O(cells near the surface · bones near them · log) time, 9 bytes a cell
///   and 8 bytes a cell and thread; `bounded_biharmonic` a few sparse factorizations a bone, of up to 6000 unknowns at
///   the resolution of 128 (with its third power), in cells at least twice as large.
/// \fails bad_option as validate(); bad_input where there is no bone, no face or a position or bone that is not finite;
///   numeric where a factorization fails; cancelled.
[[nodiscard]] QUADRIG_INLINE Expected<BoundWeights> bind_weights(const TriangleMesh<double>& mesh,
                                                                 const Skeleton& skeleton, const BindOptions& options,
                                                                 Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/weights/bind.ipp"
#endif
