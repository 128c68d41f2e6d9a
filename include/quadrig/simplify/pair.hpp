// Triangles joined in pairs whose quad is fit to be split in four.
#pragma once

#include "quadrig/quads.hpp"

namespace quadrig::detail {

/// A triangle or a quad over the corners of a simplified surface; corner[3] is no_index for a triangle.
struct SplitPolygon {
  std::array<Index, 4> corner{no_index, no_index, no_index, no_index};
  [[nodiscard]] std::size_t size() const { return corner[3] == no_index ? 3 : 4; }
};

/// A matching of the triangles' dual graph.
class Pairing {
 public:
  using Face = std::array<Index, 3>;

  Pairing(const std::vector<Vector3>& positions, std::vector<Face> faces, double least_quality)
      : positions_(&positions), faces_(std::move(faces)) {
    join(least_quality);
    greedy();
    augment();
  }

  [[nodiscard]] Index pair_count() const { return pairs_; }
  /// Quads that the polygons split to.
  [[nodiscard]] Index quad_count() const { return 3 * static_cast<Index>(faces_.size()) - 2 * pairs_; }

  /// Parts the worst pairs until there are `count` quads or one more.
  void part(Index count) {
    std::vector<Index> order;
    for (Index e = 0; e < static_cast<Index>(edges_.size()); ++e)
      if (mate_[at(edges_[at(e)].f)] == e) order.push_back(e);
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return edges_[at(a)].weight < edges_[at(b)].weight; });
    for (const Index e : order) {
      if (quad_count() >= count) break;
      remove(e);
    }
  }

  [[nodiscard]] std::vector<SplitPolygon> polygons() const {
    std::vector<SplitPolygon> result;
    for (Index f = 0; f < static_cast<Index>(faces_.size()); ++f) {
      const Index e = mate_[at(f)];
      if (e == no_index)
        result.push_back({{faces_[at(f)][0], faces_[at(f)][1], faces_[at(f)][2], no_index}});
      else if (edges_[at(e)].f == f)
        result.push_back({edges_[at(e)].quad});
    }
    return result;
  }

 private:
  struct Edge {
    Index f, g;
    std::array<Index, 4> quad;  // a, d, b, c: the edge is a–b
    double weight;
  };

  /// Least scaled Jacobian of the quads that the flat split of a polygon gives; −1 where one is turned from n.
  template <std::size_t corners>
  [[nodiscard]] double split_quality(const std::array<Index, corners>& polygon, const Vector3& n) const {
    Vector3 p[corners], middle[corners], center = Vector3::Zero();
    for (std::size_t i = 0; i < corners; ++i) p[i] = (*positions_)[at(polygon[i])];
    for (std::size_t i = 0; i < corners; ++i) {
      middle[i] = (p[i] + p[(i + 1) % corners]) / 2;
      center += p[i] / static_cast<double>(corners);
    }
    double least = 1;
    for (std::size_t i = 0; i < corners; ++i) {
      Points<double> points(4, 3);
      points << p[i].transpose(), middle[i].transpose(), center.transpose(),
          middle[(i + corners - 1) % corners].transpose();
      const Vector3 m = (center - p[i]).cross(middle[(i + corners - 1) % corners] - middle[i]);
      if (!(m.dot(n) > 0.5 * m.norm() * n.norm())) return -1;
      least = std::min(least, scaled_jacobian(points, Eigen::Matrix<Index, 1, 4>(0, 1, 2, 3)));
    }
    return least;
  }

  void join(double least_quality) {
    degree_.assign(positions_->size(), 0);
    incident_.resize(faces_.size());
    mate_.assign(faces_.size(), no_index);
    const auto vertices = static_cast<Index>(positions_->size());
    const std::vector<SortedSide> sides = sorted_by_edge(vertices, static_cast<Index>(3 * faces_.size()), [&](Index h) {
      return SortedSide::of(faces_[at(h / 3)][at(h % 3)], faces_[at(h / 3)][at((h + 1) % 3)], h);
    });
    std::vector<double> alone(faces_.size());
    for (Index f = 0; f < static_cast<Index>(faces_.size()); ++f)
      alone[at(f)] = split_quality(faces_[at(f)], normal(f));
    // A vertex on the boundary may lose more edges: its boundary edges stay, and half as many stand for a full turn.
    for_each_edge(sides, [&](std::span<const SortedSide> edge) {
      for (const Index v : {edge[0].low, edge[0].high}) degree_[at(v)] += edge.size() == 1 ? 2 : 1;
    });
    for_each_edge(sides, [&](std::span<const SortedSide> edge) {
      if (edge.size() != 2) return;
      const Index h = edge[0].halfedge, k = edge[1].halfedge;
      const Index f = h / 3, g = k / 3;
      const Index a = faces_[at(f)][at(h % 3)], b = faces_[at(f)][at((h + 1) % 3)];
      const Index c = corner(f, h + 2), d = corner(g, k + 2);
      if (c == d) return;
      const Vector3 n1 = normal(f), n2 = normal(g);
      if (!(n1.dot(n2) > 0.5)) return;
      const std::array<Index, 4> quad{a, d, corner(f, h + 1), c};
      const double quality = split_quality(quad, n1 + n2);
      // Slivers are thin alone as well: a pair that is no worse is welcome.
      if (!(quality > 0 && quality >= std::min({least_quality, alone[at(f)], alone[at(g)]}))) return;
      const auto e = static_cast<Index>(edges_.size());
      // Edges between vertices of many edges go first: that evens out the valences of the quads.
      const double evening = 0.08 * (std::clamp(degree_[at(a)], 4, 9) + std::clamp(degree_[at(b)], 4, 9) - 12);
      edges_.push_back({std::min(f, g), std::max(f, g), quad, quality + evening - (1 - n1.dot(n2))});
      incident_[at(f)].push_back(e);
      incident_[at(g)].push_back(e);
    });
  }

  [[nodiscard]] Index corner(Index f, Index h) const { return faces_[at(f)][at(h % 3)]; }
  [[nodiscard]] Vector3 normal(Index f) const {
    const Face& face = faces_[at(f)];
    const Vector3& p = (*positions_)[at(face[0])];
    return ((*positions_)[at(face[1])] - p).cross((*positions_)[at(face[2])] - p).normalized();
  }

  // An inner vertex keeps three edges: two quads around a vertex cannot both be valid in a plane.
  [[nodiscard]] bool allowed(Index e) const {
    return degree_[at(edges_[at(e)].quad[0])] > 3 && degree_[at(edges_[at(e)].quad[2])] > 3;
  }
  void add(Index e) {
    mate_[at(edges_[at(e)].f)] = mate_[at(edges_[at(e)].g)] = e;
    --degree_[at(edges_[at(e)].quad[0])];
    --degree_[at(edges_[at(e)].quad[2])];
    ++pairs_;
  }
  void remove(Index e) {
    mate_[at(edges_[at(e)].f)] = mate_[at(edges_[at(e)].g)] = no_index;
    ++degree_[at(edges_[at(e)].quad[0])];
    ++degree_[at(edges_[at(e)].quad[2])];
    --pairs_;
  }
  [[nodiscard]] Index other(Index e, Index f) const { return edges_[at(e)].f == f ? edges_[at(e)].g : edges_[at(e)].f; }

  void greedy() {
    std::vector<Index> order(edges_.size());
    for (std::size_t e = 0; e < order.size(); ++e) order[e] = static_cast<Index>(e);
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return edges_[at(a)].weight > edges_[at(b)].weight; });
    for (const Index e : order)
      if (mate_[at(edges_[at(e)].f)] == no_index && mate_[at(edges_[at(e)].g)] == no_index && allowed(e)) add(e);
  }

  /// Alternating paths between two single triangles make one pair more each. Breadth first, blossoms passed over, so
  /// short paths are found and a few long ones missed.
  void augment() {
    constexpr std::size_t reach = 200;
    std::vector<Index> from(faces_.size(), no_index), seen(faces_.size(), no_index), queue;
    for (Index root = 0; root < static_cast<Index>(faces_.size()); ++root) {
      if (mate_[at(root)] != no_index) continue;
      queue.assign(1, root);
      seen[at(root)] = root;
      bool done = false;
      for (std::size_t next = 0; next < queue.size() && next < reach && !done; ++next) {
        const Index f = queue[next];
        for (const Index e : incident_[at(f)]) {
          const Index g = other(e, f);
          if (seen[at(g)] == root) continue;
          seen[at(g)] = root;
          from[at(g)] = e;
          if (mate_[at(g)] != no_index) {
            const Index beyond = other(mate_[at(g)], g);
            if (seen[at(beyond)] == root) continue;
            seen[at(beyond)] = root;
            queue.push_back(beyond);
            continue;
          }
          if (swap_along(root, g, from)) {
            done = true;
            break;
          }
        }
      }
    }
  }

  /// Swaps pairs and gaps on the path that `from` leads back from `end` to `root`; undone where a vertex would keep
  /// fewer than three edges.
  bool swap_along(Index root, Index end, const std::vector<Index>& from) {
    std::vector<Index> joined, parted;
    for (Index g = end;;) {
      const Index e = from[at(g)];
      joined.push_back(e);
      const Index f = other(e, g);
      if (f == root) break;
      parted.push_back(mate_[at(f)]);
      g = other(mate_[at(f)], f);
    }
    for (const Index e : parted) remove(e);
    for (std::size_t k = 0; k < joined.size(); ++k) {
      if (allowed(joined[k])) {
        add(joined[k]);
        continue;
      }
      while (k-- > 0) remove(joined[k]);
      for (const Index e : parted) add(e);
      return false;
    }
    return true;
  }

  const std::vector<Vector3>* positions_;
  std::vector<Face> faces_;
  std::vector<Edge> edges_;
  std::vector<std::vector<Index>> incident_;  // edges_ of each face
  std::vector<Index> mate_;                   // edge that pairs each face, or no_index
  std::vector<int> degree_;                   // edges of each vertex that are left
  Index pairs_ = 0;
};

}  // namespace quadrig::detail
