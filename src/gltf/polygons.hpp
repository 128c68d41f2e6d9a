// Triangles and quads over the file's own vertices: what a shell is made of, before and after it loses some.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "gather.hpp"

namespace quadrig::gltf {

/// Normals that part by more than 10° are an edge that is meant to be seen.
inline constexpr double hard_cosine = 0.985;

/// A triangle or a quad that lies in one primitive.
struct Polygon {
  std::array<Index, 4> vertex{no_index, no_index, no_index, no_index};  ///< of the surface; the last: no_index or not
  std::array<Index, 4> wedge{no_index, no_index, no_index, no_index};   ///< the gathered vertex that stands for each
  /// Those that the file has at the corners of its one or two triangles: 0 1 2, and 0 2 3.
  std::array<std::array<Index, 3>, 2> own{{{no_index, no_index, no_index}, {no_index, no_index, no_index}}};
  Index primitive = no_index;

  [[nodiscard]] std::size_t size() const { return vertex[3] == no_index ? 3 : 4; }
  /// Corner at which the vertex is; size() where it is at none.
  [[nodiscard]] std::size_t corner(Index v) const {
    std::size_t i = 0;
    while (i < size() && vertex[i] != v) ++i;
    return i;
  }
};
/// A quad is drawn as two.
[[nodiscard]] Index triangle_count(std::span<const Polygon> polygons);
/// Corner whose diagonal folds neither half of a quad over the other, the shorter of both where both do or neither.
[[nodiscard]] int first_corner(const std::array<Vector3, 4>& quad);

/// Which gathered vertices at one place of the surface are the same corner: alike in everything that makes seams and,
/// unless the shell is shaded flat, in their normals.
class Wedges {
 public:
  explicit Wedges(const Gathered& gathered, const Components& shells);
  /// Of each corner 3 f + i of the surface, one gathered vertex for all that are alike.
  [[nodiscard]] Index at_corner(Index corner) const { return of_corner_[static_cast<std::size_t>(corner)]; }
  /// Whether the file's normals part across a half-edge: an edge that is meant to be seen, on a seam or not.
  [[nodiscard]] bool is_hard(Index halfedge) const;
  /// Nearly every face of the shell has one normal, its own or that of a polygon that it is of: it is to be written so
  /// again.
  [[nodiscard]] bool flat(Index shell) const { return flat_[static_cast<std::size_t>(shell)]; }
  /// How unlike two gathered vertices are in what makes seams and in their normals.
  [[nodiscard]] double difference(Index a, Index b, Index primitive) const;
  /// Whether they are alike in what makes seams.
  [[nodiscard]] bool joined(Index a, Index b) const;
  /// The normal that the file gives the corner; nothing where it has none.
  [[nodiscard]] std::optional<Vector3> normal(Index wedge, Index primitive) const;

 private:
  const Gathered& gathered_;
  std::vector<Eigen::Index> columns_;  // that make seams
  std::vector<Index> of_corner_;
  std::vector<char> flat_;
};

/// The faces as polygons, one each.
[[nodiscard]] std::vector<Polygon> triangles_of(const Gathered& gathered, const Wedges& wedges,
                                                std::span<const Index> faces);

/// Pairs triangles of one primitive to quads, never across a seam: where triangles follow each other in the file, the
/// quads that a modeller had come back. What finds no partner for a quad of positive Jacobian stays a triangle.
/// \param order where each polygon stood in the file, or empty
/// \cost O(n log n), and a bounded search for each triangle that is left over
[[nodiscard]] std::vector<Polygon> paired(const Points<double>& positions, std::vector<Polygon> triangles,
                                          std::span<const Index> order);

/// How regular: vertices inside with other than four edges, as a share of all inside.
[[nodiscard]] double irregular_share(std::span<const Polygon> polygons, Index& irregular);

}  // namespace quadrig::gltf
