// Normals of a field's quads: smooth within what the file draws smooth, parted where its normals part.
#pragma once

#include "polygons.hpp"
#include "quadrig/gltf.hpp"
#include "quadrig/quads.hpp"

namespace quadrig::gltf {

/// Whether the file's normals are the author's: on average far from those that its faces have, which part where the
/// file's do. A flag a shell.
[[nodiscard]] std::vector<char> authored_normals(const Gathered& gathered, const Wedges& wedges,
                                                 const Components& shells);

/// Corners of quads with one normal in common.
class FieldNormals {
 public:
  /// \param quads `source` refers to the surface \param keep a flag a shell: the file's normals are carried over
  /// \cost O(quads · faces below a quad)
  FieldNormals(const Gathered& gathered, const Wedges& wedges, const Components& shells, const QuadMesh& quads,
               const std::vector<char>& keep);

  /// Which of the normals a corner has; those of one vertex are its alone.
  [[nodiscard]] Index of_corner(Index quad, int corner) const { return group_[at(4 * quad + corner)]; }
  [[nodiscard]] Vector3 normal(Index which) const { return normals_.row(which).transpose(); }
  [[nodiscard]] const Points<double>& normals() const { return normals_; }
  /// Those that the quads' own faces have, with their vertices at other places.
  [[nodiscard]] Points<double> anew(const Points<double>& positions) const;

 private:
  void find_groups(const Gathered& gathered, const Wedges& wedges, const Components& shells);
  void carry_over(const Gathered& gathered, const Wedges& wedges, const Components& shells,
                  const std::vector<char>& keep);

  const QuadMesh& quads_;
  std::vector<Index> group_;  // a corner
  Index count_ = 0;
  Points<double> normals_;
};

}  // namespace quadrig::gltf
