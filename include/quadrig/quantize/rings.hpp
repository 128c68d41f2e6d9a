// Rings: straight lines of a flat cone metric that come back, or nearly, to where they began, as they do round a limb.
#pragma once

#include "quadrig/quantize/coarse_map.hpp"

namespace quadrig::detail {

/// A class of parallel lines round something. Its quads close to a ring where the whole translation is along the line.
struct Ring {
  /// Half-edges of the coarse map, and the quarter turns into the chart where the line begins: their vectors sum to the
  /// translation once round.
  std::vector<std::pair<Index, int>> walk;
  int axis = 0;       ///< of the line in that chart: 0 for U, 1 for V
  double length = 0;  ///< once round: the translation along the line
  double pitch = 0;   ///< and to the left of it: how far beside its beginning it comes back
  /// Whether the map closes it, as it does where it was asked to: then quads have to.
  [[nodiscard]] bool closed() const { return std::abs(pitch) < 1e-6 * length; }

  template <class T>
  [[nodiscard]] T across(const T& u, const T& v) const {
    return axis == 0 ? v : -u;
  }
};

/// Follows the two lines through the middle of every face. \param quad the length of a quad in the map
/// \return those that come back in the same direction less than `most_pitch` quads beside where they began, one a class
///   where that can be decided. \cost O(faces · crossings)
[[nodiscard]] inline std::vector<Ring> near_rings(const CoarseMap& map, double quad, double most_pitch) {
  constexpr double shortest = 2.5, longest = 120;  // quads
  constexpr int most_crossings = 400;
  constexpr std::size_t most_rings = 200;  // beside those that are closed
  const auto next = [](Index h) { return h % 3 == 2 ? h - 2 : h + 1; };
  const auto prev = [](Index h) { return h % 3 == 0 ? h + 2 : h - 1; };
  const auto turned = [](Complex c, int k) { return rotated(c, k & 3); };
  // A point of a face is kept relative to the face's first corner.
  const auto corner = [&](Index h) {
    return h % 3 == 0 ? Complex{} : h % 3 == 1 ? map.vector[at(prev(h))] : -map.vector[at(h)];
  };
  std::vector<Ring> rings;
  std::vector<std::vector<Index>> vertices;  // of the walks, ascending
  std::size_t open = 0;
  for (Index start = 0; start < map.face_count(); ++start)
    for (int axis = 0; axis < 2; ++axis) {
      const Complex middle = (corner(3 * start + 1) + corner(3 * start + 2)) / 3.0;
      Complex point = middle, direction = turned(1, axis);
      Index face = start, entry = no_index;
      double travelled = 0;
      int turns = 0;  // of the chart of `face` against that of the start
      std::vector<std::pair<Index, int>> crossed;
      for (int step = 0; step < most_crossings && travelled < longest * quad; ++step) {
        if (step > 0 && face == start && (turns & 3) == 0) {
          const Complex off = point - middle;
          const double beside = cross(off, direction);
          const double round = travelled - (off * std::conj(direction)).real();
          if (std::abs(beside) < std::min(most_pitch * quad, 0.1 * round) && round > shortest * quad) {
            Ring ring{{}, axis, round, beside};
            std::vector<Index> passed;
            for (std::size_t k = 0; k < crossed.size(); ++k) {
              // Along the vertices to the left: where the next edge hangs on another one, by the edge between.
              const Index in = map.twin[at(crossed[k].first)];
              const auto& [out, turn] = crossed[(k + 1) % crossed.size()];
              passed.push_back(map.origin[at(in)]);
              if (next(out) != in) ring.walk.push_back({prev(in), 2 - turn});
            }
            std::sort(passed.begin(), passed.end());
            bool known = false;
            for (std::size_t k = 0; k < rings.size() && !known; ++k) {
              std::vector<Index> common;
              std::set_intersection(passed.begin(), passed.end(), vertices[k].begin(), vertices[k].end(),
                                    std::back_inserter(common));
              known = !common.empty() && std::abs(rings[k].length - round) < 1e-6 * round &&
                      std::abs(std::abs(rings[k].pitch) - std::abs(beside)) < 1e-6 * round;
            }
            if (!known && (ring.closed() || open++ < most_rings)) {
              rings.push_back(std::move(ring));
              vertices.push_back(std::move(passed));
            }
            break;
          }
        }
        Index exit = no_index;
        double way = std::numeric_limits<double>::infinity();
        for (Index h = 3 * face; h < 3 * face + 3; ++h) {
          const double facing = cross(direction, map.vector[at(h)]);
          if (h == entry || !(facing > 0)) continue;
          const double to_edge = cross(corner(h) - point, map.vector[at(h)]) / facing;
          if (to_edge < way) {
            way = to_edge;
            exit = h;
          }
        }
        if (exit == no_index || map.twin[at(exit)] == no_index) break;
        travelled += way;
        crossed.push_back({exit, turns});
        const Index in = map.twin[at(exit)];
        const int turn = map.rotation[at(exit)];
        point = turned(point + way * direction - corner(exit) - map.vector[at(exit)], turn) + corner(in);
        direction = turned(direction, turn);
        turns += turn;
        face = in / 3;
        entry = in;
      }
    }
  return rings;
}

}  // namespace quadrig::detail
