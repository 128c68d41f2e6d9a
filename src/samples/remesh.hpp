// A closed triangle mesh that can be changed in place, and even remeshing of it.
#pragma once

#include "shape.hpp"

namespace quadrig::samples {

/// Half-edge 3 f + i runs from corner i of face f, as in TriangleMesh; faces and vertices that were removed stay as
/// holes until `compact`. \pre closed and manifold; every operation keeps that.
class EditableMesh {
 public:
  EditableMesh(const Shape& shape, const TriangleMesh<double>& mesh);

  /// One round towards edges of the given length, times the shape's grading: split what is longer than 4/3, collapse
  /// what is shorter than 4/5, flip towards valence 6, relax along the surface (Botsch and Kobbelt 2004).
  void remesh_round(const Shape& shape, double length, const Context& context);
  [[nodiscard]] Index face_count() const { return live_faces_; }
  [[nodiscard]] Expected<TriangleMesh<double>> compact() const;

 private:
  [[nodiscard]] static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  [[nodiscard]] static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }
  [[nodiscard]] Index& origin(Index h) { return corners_[static_cast<std::size_t>(h)]; }
  [[nodiscard]] Index origin(Index h) const { return corners_[static_cast<std::size_t>(h)]; }
  [[nodiscard]] Index target(Index h) const { return origin(next(h)); }
  [[nodiscard]] Index twin(Index h) const { return twins_[static_cast<std::size_t>(h)]; }
  [[nodiscard]] Vector3& at(Index v) { return points_[static_cast<std::size_t>(v)]; }
  [[nodiscard]] const Vector3& at(Index v) const { return points_[static_cast<std::size_t>(v)]; }
  [[nodiscard]] bool live(Index h) const { return corners_[static_cast<std::size_t>(h)] != no_index; }
  [[nodiscard]] Index halfedge_count() const { return static_cast<Index>(corners_.size()); }
  [[nodiscard]] double length(Index h) const { return (at(target(h)) - at(origin(h))).norm(); }
  void join(Index h, Index g) {
    twins_[static_cast<std::size_t>(h)] = g;
    twins_[static_cast<std::size_t>(g)] = h;
  }
  void leave(Index v, Index h) { outgoing_[static_cast<std::size_t>(v)] = h; }
  /// Calls visit(h) for each half-edge that leaves the vertex.
  template <class Visit>
  void around(Index v, Visit&& visit) const {
    const Index start = outgoing_[static_cast<std::size_t>(v)];
    Index h = start;
    do {
      visit(h);
      h = twin(prev(h));
    } while (h != start);
  }
  [[nodiscard]] Index valence(Index v) const {
    Index count = 0;
    around(v, [&](Index) { ++count; });
    return count;
  }
  [[nodiscard]] bool adjacent(Index a, Index b) const {
    bool found = false;
    around(a, [&](Index h) { found = found || target(h) == b; });
    return found;
  }
  [[nodiscard]] Vector3 normal(Index a, Index b, Index c) const { return (at(b) - at(a)).cross(at(c) - at(a)); }

  void split(Index h, const Vector3& middle);
  bool collapse(Index h, const Vector3& place, double longest);
  bool flip_helps(Index h) const;
  // Curves of kept planes: an edge between vertices of one plane lies on its curve, and no other edge may become one.
  [[nodiscard]] std::uint8_t planes(Index v) const { return planes_[static_cast<std::size_t>(v)]; }
  [[nodiscard]] std::uint8_t planes_along(Index h) const { return planes(origin(h)) & planes(target(h)); }
  /// Turns the half-edge so that it runs from the vertex that may move. False: its ends must stay apart.
  bool collapses_within(Index& h) const;
  void flip(Index h);
  void relax(const Shape& shape, const Context& context);

  std::vector<Vector3> points_;
  std::vector<Index> corners_, twins_, outgoing_;
  std::vector<std::uint8_t> planes_;  ///< a bit for each kept plane that the vertex lies on
  Index live_faces_ = 0;
};

}  // namespace quadrig::samples
