// Along which edges of the border and of features a map is straight: there one of its parameters is constant.
#pragma once

#include <numbers>

#include "quadrig/connection.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/field/matching.hpp"
#include "quadrig/seamless/unknowns.hpp"

namespace quadrig {

namespace detail {

class EdgeAligner {
 public:
  EdgeAligner(const TriangleMesh<double>& mesh, const Connection<double>& connection, const CutGraph& cut,
              const FrameField& frames)
      : mesh_(mesh), connection_(connection), cut_(cut), frames_(frames) {}

  [[nodiscard]] std::vector<Aligned> run(const Matching& matching, const EdgeMarks& kept) && {
    const TriangleMesh<double>& mesh = mesh_;
    std::vector<Aligned>& aligned = aligned_;
    aligned.assign(at(mesh.halfedge_count()), Aligned::none);
    deviation_.assign(kept.empty() ? 0 : aligned.size(), 0.0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      double here = 0, there = 0;
      if (mesh.twin(h) == no_index) {
        aligned[at(h)] = label(h, here);
      } else if (!kept.empty() && kept[at(h)]) {
        const Aligned mine = label(h, here);
        (void)label(mesh.twin(h), there);
        if (here > largest_deviation || there > largest_deviation) continue;
        aligned[at(h)] = mine;
        deviation_[at(h)] = std::max(here, there);
      }
    }
    for (Index v = 0; !kept.empty() && v < mesh.vertex_count(); ++v)
      while (open_sector(v, matching)) continue;
    return std::move(aligned_);
  }

 private:
  /// Radians; the field follows an edge that is held exactly, and leaves one farther that it could not follow.
  static constexpr double largest_deviation = 0.05;

  [[nodiscard]] Aligned label(Index h, double& deviation) const {
    const auto f = at(h / 3);
    const std::array<Complex, 4> d{frames_.u[f], frames_.v[f], -frames_.u[f], -frames_.v[f]};
    const auto turn = static_cast<std::size_t>(cut_.combing[f]);
    const Complex e = connection_.edge(h);
    const double along_u = std::abs((e * std::conj(d[turn])).real()) / std::abs(d[turn]);
    const double along_v = std::abs((e * std::conj(d[(turn + 1) % 4])).real()) / std::abs(d[(turn + 1) % 4]);
    deviation = elementary::acos(std::min(1.0, std::max(along_u, along_v)));
    return along_u >= along_v ? Aligned::v_constant : Aligned::u_constant;
  }

  /// Where the field does not turn from one aligned edge to the next around the vertex, no quad would be between them,
  /// and where it turns once along edges that go straight on, one with three corners in a line: the edge that it
  /// follows worse is released. Returns whether there was such a place.
  bool open_sector(Index v, const Matching& matching) {
    Index h = mesh_.outgoing(v);
    if (h == no_index) return false;
    const Index start = h;
    struct Spoke {
      Index halfedge;
      double turned;  // the field
      double angle;   // the surface
    };
    std::vector<Spoke> spokes;
    double turned = 0, angle = 0;
    do {
      if (aligned_[at(h)] != Aligned::none) spokes.push_back({h, turned, angle});
      turned += mesh_.corner_angle(h) + matching.rho[at(mesh_.prev(h))];
      angle += mesh_.corner_angle(h);
      const Index in = mesh_.prev(h);
      h = mesh_.next_around(h);
      if (h == no_index) spokes.push_back({in, turned, angle});  // the other end of the border
    } while (h != no_index && h != start);
    if (spokes.size() < 2) return false;
    if (h == start) spokes.push_back({spokes[0].halfedge, spokes[0].turned + turned, spokes[0].angle + angle});
    for (std::size_t k = 0; k + 1 < spokes.size(); ++k) {
      constexpr double quarter = std::numbers::pi / 2, widest = 11 * std::numbers::pi / 12;
      const double quads = std::round((spokes[k + 1].turned - spokes[k].turned) / quarter);
      if (quads > 0 && spokes[k + 1].angle - spokes[k].angle <= quads * widest) continue;
      const Index a = spokes[k].halfedge, b = spokes[k + 1].halfedge;
      const auto inside = [&](Index e) { return mesh_.twin(e) != no_index; };
      if (!inside(a) && !inside(b)) return false;
      const Index less = !inside(b) || (inside(a) && deviation_[at(a)] >= deviation_[at(b)]) ? a : b;
      aligned_[at(less)] = aligned_[at(mesh_.twin(less))] = Aligned::none;
      return true;
    }
    return false;
  }

  const TriangleMesh<double>& mesh_;
  const Connection<double>& connection_;
  const CutGraph& cut_;
  const FrameField& frames_;
  std::vector<Aligned> aligned_;
  std::vector<double> deviation_;
};

}  // namespace detail

/// A half-edge: along which parameter a map of the frames is straight there, on the border and on the kept edges that
/// the field follows to within 3°. Where two of these meet at a vertex and the field does not turn from one to the
/// other, one is released. \param kept marks of the mesh, or empty: none \cost O(m)
[[nodiscard]] inline std::vector<Aligned> aligned_edges(const TriangleMesh<double>& mesh,
                                                        const Connection<double>& connection, const CutGraph& cut,
                                                        const Matching& matching, const FrameField& frames,
                                                        const EdgeMarks& kept = {}) {
  return detail::EdgeAligner(mesh, connection, cut, frames).run(matching, kept);
}

}  // namespace quadrig
