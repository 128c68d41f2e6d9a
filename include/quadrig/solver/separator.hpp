// Pieces of a graph and the smallest sets of vertices that part them: what nested dissection is made of.
#pragma once

#include <array>

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

// A piece of the graph with numbers of its own. Neighbours with numbers from size() on lie outside it and are
// eliminated later.
struct DissectionPiece {
  std::vector<Index> unknown;
  std::vector<Index> starts{0}, neighbors;
  Index outside = 0;
  std::vector<std::array<Index, 2>> place;  // coordinates of each vertex, where they are fresh enough
  int age = 0;                              // splits since they were found

  [[nodiscard]] Index size() const { return static_cast<Index>(unknown.size()); }
  [[nodiscard]] std::span<const Index> around(Index v) const {
    const auto begin = static_cast<std::size_t>(starts[static_cast<std::size_t>(v)]);
    const auto end = static_cast<std::size_t>(starts[static_cast<std::size_t>(v) + 1]);
    return std::span(neighbors).subspan(begin, end - begin);
  }
};

// The vertices among which a separator is sought, and the edges between them.
struct DissectionBand {
  std::vector<Index> starts{0}, neighbors;
  std::vector<char> touches;  // bit 0: the vertex has a neighbour on the first side; bit 1: on the second

  [[nodiscard]] Index size() const { return static_cast<Index>(touches.size()); }
};

// The most vertex-disjoint paths through a band between its two sides, and from them the smallest separators. Each
// vertex is an arc from its inner to its outer end that one path may use. States are 2 v for the inner end, 2 v + 1 for
// the outer one.
class VertexCut {
 public:
  explicit VertexCut(const DissectionBand& band)
      : starts_(band.starts), neighbors_(band.neighbors), touches_(band.touches) {
    from_.assign(touches_.size(), none);
    to_.assign(touches_.size(), none);
    level_.resize(2 * touches_.size());
    next_arc_.resize(touches_.size());
  }

  void maximize() {
    while (label(1, from_, to_)) {
      std::copy(starts_.begin(), starts_.end() - 1, next_arc_.begin());
      bool found = false;
      for (Index v = 0; v < count(); ++v)
        if ((touches_[at(v)] & 1) != 0 && augment(v)) found = true;
      if (!found) break;
    }
  }

  // Marks 0 and 1 for the sides, 2 for the smallest separator that leaves the sides, given their sizes without the
  // band, most alike: the one nearest to the first side or the one nearest to the second.
  [[nodiscard]] std::vector<char> separate(Index first, Index second) {
    const auto lesser = [&](const std::vector<char>& side) {
      return std::min(first + std::count(side.begin(), side.end(), char{0}),
                      second + std::count(side.begin(), side.end(), char{1}));
    };
    std::vector<char> near_first = mark(0), near_second = mark(1);
    return lesser(near_first) > lesser(near_second) ? near_first : near_second;
  }

 private:
  static constexpr Index none = -1, outside = -2;
  [[nodiscard]] Index count() const { return static_cast<Index>(touches_.size()); }

  std::vector<char> mark(char own) {
    if (own == 0)
      label(1, from_, to_);
    else
      label(2, to_, from_);
    std::vector<char> side(touches_.size());
    for (std::size_t v = 0; v < side.size(); ++v)
      side[v] = level_[2 * v + 1] >= 0 ? own : level_[2 * v] >= 0 ? char{2} : static_cast<char>(1 - own);
    return side;
  }

  // Levels of all states from one side, in the residual graph; whether the other side is reached.
  bool label(char start, const std::vector<Index>& from, const std::vector<Index>& to) {
    std::fill(level_.begin(), level_.end(), none);
    queue_.clear();
    for (Index v = 0; v < count(); ++v)
      if ((touches_[at(v)] & start) != 0) {
        level_[at(2 * v)] = 0;
        queue_.push_back(2 * v);
      }
    bool reached = false;
    const auto reach = [&](Index state, Index level) {
      if (level_[at(state)] >= 0) return;
      level_[at(state)] = level;
      queue_.push_back(state);
    };
    for (std::size_t k = 0; k < queue_.size(); ++k) {
      const Index v = queue_[k] / 2, level = level_[at(queue_[k])] + 1;
      if (queue_[k] % 2 == 0) {
        if (from[at(v)] != outside) reach(2 * (from[at(v)] == none ? v : from[at(v)]) + 1, level);
        continue;
      }
      if ((touches_[at(v)] & (3 - start)) != 0) reached = true;
      for (Index e = starts_[at(v)]; e < starts_[at(v) + 1]; ++e)
        if (to[at(v)] != neighbors_[at(e)]) reach(2 * neighbors_[at(e)], level);
      if (from[at(v)] != none) reach(2 * v, level);
    }
    return reached;
  }

  // One more path along growing levels that begins at v, by depth-first search; what leads nowhere is left for good.
  bool augment(Index start) {
    if (level_[at(2 * start)] != 0) return false;
    path_.clear();
    path_.push_back(2 * start);
    while (!path_.empty()) {
      const Index state = path_.back(), v = state / 2, level = level_[at(state)] + 1;
      Index next = none;
      if (state % 2 == 0) {
        const Index w = from_[at(v)] == none ? v : from_[at(v)];
        if (w != outside && level_[at(2 * w + 1)] == level) next = 2 * w + 1;
      } else {
        if ((touches_[at(v)] & 2) != 0) {
          apply();
          return true;
        }
        Index& arc = next_arc_[at(v)];
        for (; arc < starts_[at(v) + 1] && next == none; ++arc) {
          const Index u = neighbors_[at(arc)];
          if (to_[at(v)] != u && level_[at(2 * u)] == level) next = 2 * u;
        }
        if (next == none && arc == starts_[at(v) + 1]) {
          ++arc;
          if (from_[at(v)] != none && level_[at(2 * v)] == level) next = 2 * v;
        }
      }
      if (next != none) {
        path_.push_back(next);
        continue;
      }
      level_[at(state)] = none;
      path_.pop_back();
    }
    return false;
  }

  // The states of a path are used up for the phase.
  void apply() {
    from_[at(path_.front() / 2)] = outside;
    for (std::size_t k = 0; k < path_.size(); ++k) {
      const Index v = path_[k] / 2;
      level_[at(path_[k])] = none;
      if (path_[k] % 2 == 0) continue;
      if (k + 1 == path_.size()) {
        to_[at(v)] = outside;
      } else if (path_[k + 1] == 2 * v) {
        from_[at(v)] = to_[at(v)] = none;
      } else {
        const Index u = path_[k + 1] / 2;
        to_[at(v)] = u;
        from_[at(u)] = v;
      }
    }
  }

  std::span<const Index> starts_, neighbors_;
  std::span<const char> touches_;
  std::vector<Index> from_, to_;  // along the path through each vertex
  std::vector<Index> level_, next_arc_, queue_, path_;
};

}  // namespace quadrig::detail
