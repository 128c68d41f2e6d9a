// Singularities moved off the bands beside loops that quads are to close along.
#pragma once

#include "quadrig/field/loops.hpp"
#include "quadrig/field/surgery.hpp"

namespace quadrig {

/// A loop, and how far to either side of it there should be no singularity.
struct LoopBand {
  FaceLoop loop;
  double width = 0;
};

/// What clear_bands did.
struct BandReport {
  Index carried = 0, cancelled = 0, moved = 0;  ///< units of I4: across loops, pairs, off a band
};

namespace detail {

class BandSurgery {
 public:
  /// \param apart two singularities at least, a length
  BandSurgery(const TriangleMesh<double>& mesh, FieldSurgery& surgery, std::span<const LoopBand> bands, double apart)
      : mesh_(mesh), surgery_(surgery), bands_(bands), apart_(apart) {
    clearance_.assign(at(mesh.vertex_count()), free);
    distance_.assign(at(mesh.vertex_count()), 0);
    from_.assign(at(mesh.vertex_count()), no_index);
    visited_.assign(at(mesh.vertex_count()), 0);
    barred_.assign(at(mesh.halfedge_count()), 0);
    for (const LoopBand& band : bands) {
      for (const Index h : band.loop.crossed) ++barred_[at(h)], ++barred_[at(mesh.twin(h))];
      for (const BesideLoop& beside : vertices_beside(mesh, band.loop, band.width))
        clearance_[at(beside.vertex)] = std::min(clearance_[at(beside.vertex)], std::abs(beside.distance) / band.width);
    }
  }

  BandReport run(const Context& context) {
    for (const LoopBand& band : bands_) {
      if (context.cancelled()) return report_;
      unturn(band);
    }
    clear(context);
    return report_;
  }

 private:
  static constexpr double free = 1e9;  // clearance of what lies on no band

  [[nodiscard]] Index index(Index v) const { return surgery_.field().singularities.index4[at(v)]; }
  [[nodiscard]] bool inside(Index v) const { return mesh_.outgoing(v) != no_index && !mesh_.on_boundary(v); }

  /// Carries units across a loop until the field turns by nothing along it, where there is what to carry or room.
  void unturn(const LoopBand& band) {
    constexpr Index most = 4;  // quarter turns of a limb whose end the field does not see
    Index turns = quarter_turns(mesh_, surgery_.field().matching, band.loop);
    if (turns == 0 || std::abs(turns) > most) return;
    const double reach = 4 * band.width;
    const auto beside = vertices_beside(mesh_, band.loop, reach);
    // On each side the nearest that is in excess there, or room for what it lacks.
    while (turns != 0) {
      const Index sign = turns > 0 ? 1 : -1;
      struct End {
        double cost = std::numeric_limits<double>::infinity();
        Index vertex = no_index;
      };
      std::array<End, 2> ends;  // right and left
      for (const BesideLoop& near : beside) {
        const Index v = near.vertex;
        const double d = near.distance;
        if (!inside(v)) continue;
        const bool left = d > 0;
        const Index here = index(v) * sign;
        double cost = std::numeric_limits<double>::infinity();
        if (left ? here < 0 : here > 0)
          cost = std::abs(d);
        else if (here == 0 && clearance_[at(v)] == free)
          cost = std::abs(d) + band.width;
        if (cost < ends[left].cost) ends[left] = {cost, v};
      }
      if (ends[0].vertex == no_index || ends[1].vertex == no_index) return;
      const Index from = sign > 0 ? ends[0].vertex : ends[1].vertex, to = sign > 0 ? ends[1].vertex : ends[0].vertex;
      if (!search(from, false, [&](Index w) { return w == to; })) return;
      follow(from, to);
      ++report_.carried;
      const Index now = quarter_turns(mesh_, surgery_.field().matching, band.loop);
      if (std::abs(now) >= std::abs(turns)) return;
      turns = now;
    }
  }

  /// Takes singularities off the bands: those nearest to a loop first, to one of the other sign or to where no band is.
  void clear(const Context& context) {
    std::vector<std::pair<double, Index>> within;
    for (Index v = 0; v < mesh_.vertex_count(); ++v)
      if (clearance_[at(v)] < 1 && inside(v) && index(v) != 0) within.push_back({clearance_[at(v)], v});
    std::sort(within.begin(), within.end());
    for (const auto& [clearance, v] : within) {
      if (context.cancelled()) return;
      for (int unit = 0; unit < 4 && index(v) != 0; ++unit)
        if (!clear_unit(v)) break;
    }
  }

  bool clear_unit(Index v) {
    const Index sign = index(v) > 0 ? 1 : -1;
    constexpr double cancelling = 1.5;  // how much farther another may be than room
    Index other = no_index, room = no_index, best = no_index;
    double to_room = std::numeric_limits<double>::infinity(), clearest = clearance_[at(v)] + 0.1;
    search(v, true, [&](Index w) {
      if (distance_[at(w)] > cancelling * to_room) return true;
      if (w == v || !inside(w)) return false;
      if (index(w) * sign < 0) {
        other = w;
        return true;
      }
      if (index(w) != 0) return false;
      if (room == no_index && clearance_[at(w)] >= 1 && alone(w)) {
        room = w;
        to_room = distance_[at(w)];
      } else if (room == no_index && clearance_[at(w)] > clearest) {
        clearest = clearance_[at(w)];
        best = w;
      }
      return false;
    });
    const Index to = other != no_index ? other : room != no_index ? room : best;
    if (to == no_index) return false;
    if (other != no_index)
      ++report_.cancelled;
    else
      ++report_.moved;
    // The path is that of the search: a unit of I4 > 0 goes along it, one of I4 < 0 comes back along it.
    for (Index w = to; w != v;) {
      const Index h = from_[at(w)];
      surgery_.move_unit(sign > 0 ? h : mesh_.twin(h));
      w = mesh_.origin(h);
    }
    return true;
  }

  /// Whether no singularity is near.
  [[nodiscard]] bool alone(Index v) const {
    // By its neighbours' neighbours as far as `apart_`, in space: the surface is nearly flat over so little.
    std::vector<Index> open{v};
    for (std::size_t k = 0; k < open.size(); ++k)
      for (const Index h : mesh_.around(open[k])) {
        const Index w = mesh_.target(h);
        if ((mesh_.position(w) - mesh_.position(v)).norm() > apart_) continue;
        if (index(w) != 0) return false;
        if (std::find(open.begin(), open.end(), w) == open.end()) open.push_back(w);
      }
    return true;
  }

  /// Shortest paths over inner vertices; visit(vertex) returns true to stop, and then the search does.
  /// \param bars whether no path crosses a loop
  template <class Visit>
  bool search(Index seed, bool bars, Visit&& visit) {
    ++search_;
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    distance_[at(seed)] = 0;
    visited_[at(seed)] = search_;
    queue.push({0, seed});
    while (!queue.empty()) {
      const auto [d, v] = queue.top();
      queue.pop();
      if (d > distance_[at(v)]) continue;
      if (visit(v)) return true;
      for (const Index h : mesh_.around(v)) {
        const Index w = mesh_.target(h);
        if (!inside(w) || (bars && barred_[at(h)])) continue;
        const double there = d + mesh_.edge_vector(h).norm();
        if (visited_[at(w)] == search_ && !(there < distance_[at(w)])) continue;
        visited_[at(w)] = search_;
        distance_[at(w)] = there;
        from_[at(w)] = h;
        queue.push({there, w});
      }
    }
    return false;
  }
  void follow(Index from, Index to) {
    for (Index v = to; v != from;) {
      const Index h = from_[at(v)];
      surgery_.move_unit(h);
      v = mesh_.origin(h);
    }
  }

  const TriangleMesh<double>& mesh_;
  FieldSurgery& surgery_;
  std::span<const LoopBand> bands_;
  double apart_;
  std::vector<double> clearance_, distance_;  // from the nearest loop, in widths of its band; of the last search
  std::vector<Index> from_, visited_;
  std::vector<char> barred_;
  Index search_ = 0;
  BandReport report_;
};

}  // namespace detail

/// Changes the singularities of a field so that it turns by nothing along the loops, and none is on their bands: those
/// of opposite sign cancel, others go to where no band is, or as far from the loops as there is room. What cannot go
/// stays. `FieldSurgery::apply` makes it so.
/// \cost a search for each singularity on a band
inline BandReport clear_bands(const TriangleMesh<double>& mesh, FieldSurgery& surgery, std::span<const LoopBand> bands,
                              double apart, const Context& context) {
  return detail::BandSurgery(mesh, surgery, bands, apart).run(context);
}

}  // namespace quadrig
