// Which edges of quads the map takes from the border and from edges that are kept.
#pragma once

#include "quadrig/connection.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/field.hpp"
#include "quadrig/seamless/unknowns.hpp"

namespace quadrig::detail {

/// Which parameter is constant along the edges of the border and along kept edges that the field follows.
class Alignment {
 public:
  Alignment(const TriangleMesh<double>& mesh, const Connection<double>& connection, const CutGraph& cut,
            const FieldResult& field, const FrameField& frames, const EdgeMarks& kept)
      : mesh_(mesh), connection_(connection), cut_(cut), frames_(frames) {
    aligned.assign(at(mesh.halfedge_count()), Aligned::none);
    deviation_.assign(kept.empty() ? 0 : aligned.size(), 0.0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      double here = 0, there = 0;
      if (mesh.twin(h) == no_index) {
        aligned[at(h)] = label(h, here);
      } else if (!kept.empty() && kept[at(h)]) {
        const Aligned mine = label(h, here);
        (void)label(mesh.twin(h), there);
        if (here > 0.05 || there > 0.05) continue;
        aligned[at(h)] = mine;
        deviation_[at(h)] = std::max(here, there);
      }
    }
    for (Index v = 0; !kept.empty() && v < mesh.vertex_count(); ++v)
      while (open_sector(v, field.matching)) continue;
    any = std::any_of(aligned.begin(), aligned.end(), [](Aligned a) { return a != Aligned::none; });
  }

  std::vector<Aligned> aligned;  ///< a half-edge
  bool any = false;

 private:
  [[nodiscard]] Aligned label(Index h, double& deviation) const {
    const auto f = at(h / 3);
    const std::array<Complex, 4> d{frames_.u[f], frames_.v[f], -frames_.u[f], -frames_.v[f]};
    const auto turn = static_cast<std::size_t>(cut_.combing[f]);
    const Complex e = connection_.edge(h);
    const double along_u = std::abs((e * std::conj(d[turn])).real()) / std::abs(d[turn]);
    const double along_v = std::abs((e * std::conj(d[(turn + 1) % 4])).real()) / std::abs(d[(turn + 1) % 4]);
    deviation = std::acos(std::min(1.0, std::max(along_u, along_v)));
    return along_u >= along_v ? Aligned::v_constant : Aligned::u_constant;
  }

  /// Where the field does not turn from one aligned edge to the next around the vertex, no quad would be between them:
  /// that one is let go which it follows worse. Returns whether there was such a place.
  bool open_sector(Index v, const Matching& matching) {
    Index h = mesh_.outgoing(v);
    if (h == no_index) return false;
    const Index start = h;
    struct Spoke {
      Index halfedge;
      double angle;
    };
    std::vector<Spoke> spokes;
    double turned = 0;
    do {
      if (aligned[at(h)] != Aligned::none) spokes.push_back({h, turned});
      turned += mesh_.corner_angle(h) + matching.rho[at(mesh_.prev(h))];
      const Index in = mesh_.prev(h);
      h = mesh_.next_around(h);
      if (h == no_index) spokes.push_back({in, turned});  // the other end of the border
    } while (h != no_index && h != start);
    if (spokes.size() < 2) return false;
    if (h == start) spokes.push_back({spokes.front().halfedge, spokes.front().angle + turned});
    for (std::size_t k = 0; k + 1 < spokes.size(); ++k) {
      if (spokes[k + 1].angle - spokes[k].angle > 0.78539816339744831) continue;
      const Index a = spokes[k].halfedge, b = spokes[k + 1].halfedge;
      const auto inside = [&](Index e) { return mesh_.twin(e) != no_index; };
      if (!inside(a) && !inside(b)) return false;
      const Index less = !inside(b) || (inside(a) && deviation_[at(a)] >= deviation_[at(b)]) ? a : b;
      aligned[at(less)] = aligned[at(mesh_.twin(less))] = Aligned::none;
      return true;
    }
    return false;
  }

  const TriangleMesh<double>& mesh_;
  const Connection<double>& connection_;
  const CutGraph& cut_;
  const FrameField& frames_;
  std::vector<double> deviation_;
};

}  // namespace quadrig::detail
