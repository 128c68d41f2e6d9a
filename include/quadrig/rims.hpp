// Rims: closed curves round eyes, mouth and other openings of a surface.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/symmetry.hpp"

namespace quadrig {

enum class RimKind : std::uint8_t {
  eye,
  mouth,
  nostril,
  ear,
  pocket,  ///< an opening of none of these
};
[[nodiscard]] constexpr std::string_view rim_kind_name(RimKind kind) {
  constexpr std::array<std::string_view, 5> names{"eye", "mouth", "nostril", "ear", "pocket"};
  return names[static_cast<std::size_t>(kind)];
}

/// The rim of an opening: a closed curve on the surface.
struct Rim {
  RimKind kind = RimKind::pocket;
  std::vector<Vector3> points;          ///< evenly spaced, without the first again
  std::vector<Vector3> normals{};       ///< unit, of the surface at these; empty: not known
  double length = 0;                    ///< of the curve
  double score = 0;                     ///< from 0 to 1: how much speaks for the kind
  std::vector<std::string> evidence{};  ///< in words
  Index twin = no_index;                ///< the rim that is its mirror image; itself on the plane

  [[nodiscard]] Vector3 centre() const;
  /// Half of the curve's vector area: out of a pocket, as long as the disc that it bounds is large.
  [[nodiscard]] Vector3 area() const;
  /// Of a circle as long as the curve.
  [[nodiscard]] double radius() const { return length / (2 * std::numbers::pi); }
};

/// How much of the space above each vertex is open: the share of directions, weighted by their cosine with the normal,
/// in which no part of the same connected component stands before it. 1 on convex surfaces, near 0 in deep pockets.
/// \cost some 100 rays a vertex that lies in shade, 24 another; invalid once cancelled
[[nodiscard]] QUADRIG_INLINE std::vector<double> openness(const TriangleMesh<double>& mesh, const Context& context);

/// The rims of a surface, by kind, of each kind the longest first: borders of what cannot be seen from outside and is
/// much larger than the opening that leads into it (sockets, mouths). Two that mirror each other and face the same way
/// are eyes; one on the plane below them is a mouth; names of bones nearby are witnesses, never alone.
/// \param rig with bones in the space of the mesh; null: none
/// \param plane that mirrors the surface; null: that of two openings of one size, where there are two
/// \cost as `openness`; invalid once cancelled
[[nodiscard]] QUADRIG_INLINE std::vector<Rim> find_rims(const TriangleMesh<double>& mesh, const Rig* rig,
                                                        const MirrorPlane* plane, const Context& context);

inline Vector3 Rim::centre() const {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& p : points) sum += p;
  return points.empty() ? sum : Vector3(sum / static_cast<double>(points.size()));
}
inline Vector3 Rim::area() const {
  Vector3 sum = Vector3::Zero();
  const Vector3 middle = centre();
  for (std::size_t k = 0; k < points.size(); ++k)
    sum += (points[k] - middle).cross(points[(k + 1) % points.size()] - middle) / 2;
  return sum;
}

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/rims/find.ipp"
#endif
