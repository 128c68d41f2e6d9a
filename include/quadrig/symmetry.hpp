// The mirror plane of a body, found from its surface and its rig, and quads made exactly alike on both sides of it.
#pragma once

#include "quadrig/asset.hpp"
#include "quadrig/fit.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/symmetry/names.hpp"

namespace quadrig {

/// Which mirror plane is looked for.
enum class SymmetryChoice : std::uint8_t {
  none,
  automatic,  ///< whichever takes the body to itself, if any does
  x,          ///< across this axis of mesh space, or nearly: the plane may be tilted and off the origin
  y,
  z,
};

/// "none", "auto", "x", "y" or "z". \fails bad_option on any other name
[[nodiscard]] inline Expected<SymmetryChoice> symmetry_choice(std::string_view name) {
  constexpr std::array<std::string_view, 5> names{"none", "auto", "x", "y", "z"};
  for (std::size_t k = 0; k < names.size(); ++k)
    if (names[k] == name) return static_cast<SymmetryChoice>(k);
  return Error{ErrorCode::bad_option, "there is no such symmetry", "symmetry " + std::string(name),
               "one of: none, auto, x, y, z"};
}
[[nodiscard]] constexpr std::string_view symmetry_choice_name(SymmetryChoice choice) {
  constexpr std::array<std::string_view, 5> names{"none", "auto", "x", "y", "z"};
  return names[static_cast<std::size_t>(choice)];
}

/// The plane of points p with normal · p = offset, and how well the body agrees with its mirror image.
struct MirrorPlane {
  Vector3 normal = Vector3::UnitX();  ///< unit; its largest component is positive
  double offset = 0;                  ///< a length
  double tolerance = 0;               ///< a length: the surface agrees with its image where it lies within this
  double share = 0;                   ///< of the area that agrees
  double near_share = 0;              ///< of the area that lies within 20 tolerances of the image
  double deviation = 0;               ///< root mean square distance of the image from the surface, a length
  double paired_bones = 0;            ///< of the bones that move the surface, the share that has a mirror twin
  /// Of each bone the one on the other side, itself on the plane; no_index: none. Empty without a rig.
  std::vector<Index> twin;

  [[nodiscard]] double side(const Vector3& p) const { return normal.dot(p) - offset; }
  [[nodiscard]] Vector3 mirrored(const Vector3& p) const { return p - 2 * side(p) * normal; }
  [[nodiscard]] Vector3 mirrored_direction(const Vector3& d) const { return d - 2 * normal.dot(d) * normal; }
};

/// Values of bones made alike on both sides: where only one of a pair is other than 1, both have it, else their mean.
inline void even_factors(const MirrorPlane& plane, std::vector<double>& of_bone) {
  for (std::size_t b = 0; b < of_bone.size() && b < plane.twin.size(); ++b) {
    const Index twin = plane.twin[b];
    if (twin == no_index || detail::at(twin) <= b) continue;
    double &one = of_bone[b], &other = of_bone[detail::at(twin)];
    one = other = one == 1 ? other : other == 1 ? one : std::sqrt(one * other);
  }
}

/// The mirror plane of an asset: candidates across the axes, across the axes of inertia, and of the pairs of bones
/// whose names tell left from right are moved to where the surface agrees with its image best.
///
/// Nothing where the best is none: `automatic` wants 80 % of the area within 0.5 % of the diagonal of its image, or,
/// where bones pair by name, 60 % within 2 %; an axis half of it within 2 %.
/// \cost some 10^4 closest points. \fails cancelled
[[nodiscard]] QUADRIG_INLINE Expected<std::optional<MirrorPlane>> find_mirror_plane(const Asset& asset,
                                                                                    SymmetryChoice choice,
                                                                                    Context& context);

/// What `symmetrize` did.
struct SymmetrizeReport {
  Index pairs = 0;     ///< of vertices, those on the plane counted once
  Index exact = 0;     ///< of these, exact mirror images now
  double largest = 0;  ///< distance that this moved a vertex, a length
};

/// Makes the two vertices of each pair exact mirror images where the surface is symmetric there: positions, weights
/// with bones in pairs, and morph targets, self-symmetric ones or in pairs. Where it is not each keeps its own.
///
/// \param twin of each vertex its mirror twin; itself: on the plane; no_index: none
///
/// \param held vertices that the twin follows, a flag each, of two the first; empty: each pair meets halfway
///
/// \param source_morphs displacements of the surface's vertices, of each of `quads.morphs`
///
/// \pre quads.mesh.source refers to `surface`, weights of which are `weights` (null: none)
[[nodiscard]] QUADRIG_INLINE SymmetrizeReport symmetrize(const TriangleMesh<double>& surface,
                                                         const SkinWeights* weights,
                                                         std::span<const Points<double>> source_morphs,
                                                         const MirrorPlane& plane, std::span<const Index> twin,
                                                         std::span<const char> held, Index influences,
                                                         FittedQuads& quads, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/symmetry/find.ipp"
#include "quadrig/symmetry/symmetrize.ipp"
#endif
