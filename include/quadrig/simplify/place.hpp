// The split polygons on the surface: every vertex as near its place as its quads stay valid.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/simplify/pair.hpp"

namespace quadrig::detail {

/// Splits polygons by the middles of their edges and their centres, and moves these onto the mesh.
class SplitPlacer {
 public:
  /// \pre sources: one point of the mesh a position; positions of corners used by polygons are at their sources
  SplitPlacer(const TriangleMesh<double>& mesh, const std::vector<Vector3>& positions,
              const std::vector<SurfacePoint>& sources, const std::vector<SplitPolygon>& polygons)
      : mesh_(mesh), border_(mesh, border_marks(mesh)), tree_(mesh) {
    split(positions, sources, polygons);
    find_incident();
  }

  [[nodiscard]] Status run(Context& context) {
    for (Index v = corners_; v < vertex_count(); ++v) {
      if (v % 1024 == 0 && context.cancelled()) return cancelled_error("simplify");
      find_goal(v);
    }
    approach();
    for (int round = 0; round < 8; ++round) {
      if (context.cancelled()) return cancelled_error("simplify");
      if (round == 4)  // better thin than beside the surface
        for (double& least : least_) least *= 0.1;
      bool moved = false;
      for (Index v = corners_; v < vertex_count(); ++v) moved |= !vertices_[at(v)].there && settle(v);
      if (!moved && round > 4) break;
    }
    make_room();
    return {};
  }

  /// Retries the vertices off the surface, from the current positions of all.
  void retry(const QuadMesh& quads) {
    const double tolerance = 1e-9 * mesh_.diagonal();
    bool all = true;
    for (Index v = 0; v < vertex_count(); ++v) {
      Vertex& vertex = vertices_[at(v)];
      vertex.position = quads.positions.row(v).transpose();
      vertex.goal = quads.source[at(v)];
      vertex.there = (quadrig::position(mesh_, vertex.goal) - vertex.position).norm() <= tolerance;
      all = all && vertex.there;
    }
    if (all) return;
    for (Index v = corners_; v < vertex_count(); ++v)
      if (!vertices_[at(v)].there) settle(v);
    make_room();
  }

  /// The quads; the source of a vertex off the surface is the closest point.
  [[nodiscard]] QuadMesh result() {
    QuadMesh quads;
    quads.positions.resize(vertex_count(), 3);
    quads.source.resize(vertices_.size());
    for (Index v = 0; v < vertex_count(); ++v) {
      Vertex& vertex = vertices_[at(v)];
      if (!vertex.there && !try_place(v, nearest(v, vertex.position))) vertex.goal = nearest(v, vertex.position);
      quads.source[at(v)] = vertex.goal;
      quads.positions.row(v) = vertex.position.transpose();
    }
    quads.quads.resize(static_cast<Eigen::Index>(quads_.size()), 4);
    for (std::size_t q = 0; q < quads_.size(); ++q)
      for (std::size_t i = 0; i < 4; ++i)
        quads.quads(static_cast<Eigen::Index>(q), static_cast<Eigen::Index>(i)) = quads_[q][i];
    return quads;
  }

 private:
  struct Vertex {
    Vector3 position, flat;
    Vector3 normal = Vector3::Zero();  // of the flat polygons around it
    SurfacePoint goal;
    bool there = false;                                                    // on the surface, at its goal
    std::array<Index, 4> anchors{no_index, no_index, no_index, no_index};  // corners that it lies between
    bool border = false;
  };
  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(vertices_.size()); }

  void split(const std::vector<Vector3>& positions, const std::vector<SurfacePoint>& sources,
             const std::vector<SplitPolygon>& polygons) {
    std::vector<Index> number(positions.size(), no_index);
    for (const SplitPolygon& polygon : polygons)
      for (std::size_t i = 0; i < polygon.size(); ++i) number[at(polygon.corner[i])] = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (number[v] == no_index) continue;
      number[v] = vertex_count();
      Vertex vertex;
      vertex.position = vertex.flat = positions[v];
      vertex.goal = sources[v];
      vertex.there = true;
      vertices_.push_back(vertex);
    }
    corners_ = vertex_count();  // those on the boundary are marked below

    struct Place {
      std::size_t polygon, side;
    };
    std::vector<Place> places;  // of each half-edge
    std::vector<SortedSide> ends;
    for (std::size_t p = 0; p < polygons.size(); ++p)
      for (std::size_t i = 0; i < polygons[p].size(); ++i) {
        const Index a = number[at(polygons[p].corner[i])];
        const Index b = number[at(polygons[p].corner[(i + 1) % polygons[p].size()])];
        ends.push_back(SortedSide::of(a, b, static_cast<Index>(ends.size())));
        places.push_back({p, i});
      }
    const std::vector<SortedSide> sides =
        sorted_by_edge(corners_, static_cast<Index>(ends.size()), [&](Index h) { return ends[at(h)]; });
    std::vector<std::array<Index, 4>> middle(polygons.size());
    for_each_edge(sides, [&](std::span<const SortedSide> edge) {
      const Index low = edge[0].low, high = edge[0].high;
      const auto [first, side] = places[at(edge[0].halfedge)];
      const SplitPolygon& polygon = polygons[first];
      Vertex vertex;
      vertex.border = edge.size() == 1;
      if (vertex.border) vertices_[at(low)].border = vertices_[at(high)].border = true;
      vertex.anchors[0] = number[at(polygon.corner[side])];  // in the direction of the face
      vertex.anchors[1] = number[at(polygon.corner[(side + 1) % polygon.size()])];
      vertex.flat = (vertices_[at(low)].flat + vertices_[at(high)].flat) / 2;
      vertex.position = vertex.flat;
      for (const SortedSide& each : edge) {
        const Place& place = places[at(each.halfedge)];
        middle[place.polygon][place.side] = vertex_count();
      }
      vertices_.push_back(vertex);
    });
    for (std::size_t p = 0; p < polygons.size(); ++p) {
      const std::size_t n = polygons[p].size();
      Vertex vertex;
      vertex.flat = Vector3::Zero();
      for (std::size_t i = 0; i < n; ++i) {
        vertex.anchors[i] = number[at(polygons[p].corner[i])];
        vertex.flat += vertices_[at(vertex.anchors[i])].flat / static_cast<double>(n);
      }
      vertex.position = vertex.flat;
      const Index center = vertex_count();
      vertices_.push_back(vertex);
      for (std::size_t i = 0; i < n; ++i)
        quads_.push_back({vertices_[at(center)].anchors[i], middle[p][i], center, middle[p][(i + n - 1) % n]});
    }
    flat_normal_.resize(quads_.size());
    least_.resize(quads_.size());
    for (std::size_t q = 0; q < quads_.size(); ++q) {
      flat_normal_[q] = normal(q).normalized();
      for (const Index v : quads_[q]) vertices_[at(v)].normal += flat_normal_[q];
      // What a quad must keep. Slivers are thin already where they lie flat.
      least_[q] = std::min(0.1, 0.5 * jacobian(q));
    }
  }

  void find_incident() {
    starts_.assign(vertices_.size() + 1, 0);
    for (const auto& quad : quads_)
      for (const Index v : quad) ++starts_[at(v) + 1];
    for (std::size_t v = 0; v < vertices_.size(); ++v) starts_[v + 1] += starts_[v];
    incident_.resize(starts_.back());
    std::vector<std::size_t> next(starts_.begin(), starts_.end() - 1);
    for (std::size_t q = 0; q < quads_.size(); ++q)
      for (const Index v : quads_[q]) incident_[next[at(v)]++] = q;
  }

  [[nodiscard]] Vector3 normal(std::size_t q) const {
    const auto p = [&](std::size_t i) -> const Vector3& { return vertices_[at(quads_[q][i])].position; };
    return (p(2) - p(0)).cross(p(3) - p(1));
  }
  [[nodiscard]] double jacobian(std::size_t q) const {
    Points<double> points(4, 3);
    for (std::size_t i = 0; i < 4; ++i)
      points.row(static_cast<Eigen::Index>(i)) = vertices_[at(quads_[q][i])].position.transpose();
    return scaled_jacobian(points, Eigen::Matrix<Index, 1, 4>(0, 1, 2, 3));
  }
  /// As good as it must be, and not turned over.
  [[nodiscard]] bool valid(std::size_t q) const {
    const Vector3 n = normal(q);
    return n.dot(flat_normal_[q]) > 0.2 * n.norm() && jacobian(q) > 0 && jacobian(q) >= least_[q];
  }
  [[nodiscard]] bool valid_around(Index v) const {
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
      if (!valid(incident_[k])) return false;
    return true;
  }

  /// The point of the surface near p that faces as v's polygons do: walked to from the corners that v lies between, so
  /// that the far side of a thin part does not answer, or, where that ends far away, the closest that faces so.
  [[nodiscard]] SurfacePoint nearest(Index v, const Vector3& p) const {
    const Vertex& vertex = vertices_[at(v)];
    SurfaceHit best;
    bool best_faces = false;
    double reach = 0;
    for (const Index anchor : vertex.anchors) {
      if (anchor == no_index) continue;
      const SurfaceHit hit = walk_closest(mesh_, p, vertices_[at(anchor)].goal);
      const bool faces = mesh_.normal(hit.face).dot(vertex.normal) > 0;
      if (!best.found() || std::pair(!faces, hit.squared_distance) < std::pair(!best_faces, best.squared_distance)) {
        best = hit;
        best_faces = faces;
      }
      reach = std::max(reach, (vertices_[at(anchor)].position - p).norm());
    }
    ClosestFilter filter;
    filter.normal = vertex.normal;
    filter.minimum_cosine = 0.2;
    filter.maximum_distance = best_faces ? std::sqrt(best.squared_distance) / 2 : reach;
    if (const SurfaceHit hit = tree_.closest(p, filter); hit.found()) best = hit;
    return best;
  }

  void find_goal(Index v) {
    Vertex& vertex = vertices_[at(v)];
    if (vertex.border)
      if (const auto point = on_border(vertex, 0.5)) {
        vertex.goal = *point;
        return;
      }
    vertex.goal = nearest(v, vertex.flat);
  }
  [[nodiscard]] std::optional<SurfacePoint> on_border(const Vertex& vertex, double share) const {
    return border_.between(vertices_[at(vertex.anchors[0])].goal, vertices_[at(vertex.anchors[1])].goal, share);
  }

  /// Moves all to their goals; vertices of invalid quads go back step by step, at last to where the quad is flat.
  void approach() {
    constexpr std::array<double, 5> steps{1, 0.75, 0.5, 0.25, 0};
    std::vector<std::size_t> level(vertices_.size(), 0);
    const auto put = [&](Index v) {
      Vertex& vertex = vertices_[at(v)];
      const double t = steps[level[at(v)]];
      vertex.there = t == 1;
      vertex.position = vertex.flat + t * (quadrig::position(mesh_, vertex.goal) - vertex.flat);
      if (t == 1) vertex.position = quadrig::position(mesh_, vertex.goal);
      if (t == 0) vertex.position = vertex.flat;
    };
    for (Index v = corners_; v < vertex_count(); ++v) put(v);
    std::vector<std::size_t> wrong;
    do {
      wrong.clear();
      for (std::size_t q = 0; q < quads_.size(); ++q)
        if (!valid(q)) wrong.push_back(q);
      std::vector<Index> back;
      for (const std::size_t q : wrong)
        for (const Index v : quads_[q])
          if (v >= corners_ && level[at(v)] + 1 < steps.size()) back.push_back(v);
      std::sort(back.begin(), back.end());
      back.erase(std::unique(back.begin(), back.end()), back.end());
      if (back.empty()) break;  // nothing wrong, or flat already
      for (const Index v : back) {
        ++level[at(v)];
        put(v);
      }
    } while (true);
  }

  bool try_place(Index v, const SurfacePoint& point) {
    Vertex& vertex = vertices_[at(v)];
    const Vector3 before = vertex.position;
    vertex.position = quadrig::position(mesh_, point);
    if (!valid_around(v)) {
      vertex.position = before;
      return false;
    }
    vertex.goal = point;
    vertex.there = true;
    return true;
  }

  /// Searches a place on the surface for a vertex that is off it: its goal, then around its position.
  bool settle(Index v) {
    const Vertex& vertex = vertices_[at(v)];
    if (try_place(v, vertex.goal)) return true;
    if (vertex.border) {
      for (const double share : {0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9})
        if (const auto point = on_border(vertex, share); point && try_place(v, *point)) return true;
      if (on_border(vertex, 0.5)) return false;
    }
    const Vector3 here = vertex.position;
    if (try_place(v, nearest(v, here))) return true;
    double reach = 0;
    for (const Index anchor : vertex.anchors)
      if (anchor != no_index) reach = std::max(reach, (vertices_[at(anchor)].position - here).norm());
    if (!(vertex.normal.norm() > 0)) return false;
    const Vector3 x = vertex.normal.unitOrthogonal(), y = vertex.normal.normalized().cross(x);
    for (const double radius : {0.15, 0.3, 0.5})
      for (int k = 0; k < 8; ++k) {
        const double angle = k * 0.78539816339744831;
        const Vector3 p = here + radius * reach * (elementary::cos(angle) * x + elementary::sin(angle) * y);
        if (try_place(v, nearest(v, p))) return true;
      }
    // Where the surface bends away under the polygon: between here and the vertices around.
    for (const double share : {0.25, 0.5, 0.75})
      for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
        for (const Index w : quads_[incident_[k]]) {
          const Vertex& other = vertices_[at(w)];
          if (w == v || !other.there) continue;
          if (try_place(v, walk_closest(mesh_, here + share * (other.position - here), other.goal))) return true;
        }
    return false;
  }

  /// For vertices that no place is left for: their neighbours are moved as well.
  void make_room() {
    for (Index v = corners_; v < vertex_count(); ++v) {
      if (vertices_[at(v)].there || settle_with_neighbours(v)) continue;
      if (vertices_[at(v)].border) {
        for (const double share : {0.35, 0.65, 0.2, 0.8}) {
          const auto point = on_border(vertices_[at(v)], share);
          if (!point) break;
          vertices_[at(v)].goal = *point;
          if (settle_with_neighbours(v)) break;
        }
        continue;
      }
      for (const Index anchor : vertices_[at(v)].anchors) {
        if (anchor == no_index) continue;
        const Vertex& corner = vertices_[at(anchor)];
        const Vector3 half = (vertices_[at(v)].position + corner.position) / 2;
        vertices_[at(v)].goal = walk_closest(mesh_, half, corner.goal);
        if (settle_with_neighbours(v)) break;
      }
    }
  }

  /// Least scaled Jacobian around v, less 1 where a quad is turned over or thinner than it must be.
  [[nodiscard]] double least_around(Index v) const {
    double least = 1;
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k) {
      const double j = jacobian(incident_[k]);
      least = std::min(least, valid(incident_[k]) ? j : std::min(j, 0.0) - 1);
    }
    return least;
  }

  /// Puts a vertex at its goal and lets those around it make way along the surface; all go back where that fails, and
  /// it returns false.
  bool settle_with_neighbours(Index v) {
    std::vector<Index> near;
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
      for (const Index w : quads_[incident_[k]])
        for (std::size_t i = starts_[at(w)]; i < starts_[at(w) + 1]; ++i)
          for (const Index u : quads_[incident_[i]])
            if (u != v && vertices_[at(u)].there && !vertices_[at(u)].border) near.push_back(u);
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    const Vertex before = vertices_[at(v)];
    std::vector<Vertex> kept;
    for (const Index u : near) kept.push_back(vertices_[at(u)]);

    vertices_[at(v)].position = quadrig::position(mesh_, before.goal);
    vertices_[at(v)].there = true;
    for (int round = 0; round < 4 && !valid_around(v); ++round)
      for (const Index u : near) make_way(u, round < 2 ? 0.3 : 0.1);
    bool good = valid_around(v);
    for (const Index u : near) good = good && valid_around(u);
    if (good) return true;
    vertices_[at(v)] = before;
    for (std::size_t k = 0; k < near.size(); ++k) vertices_[at(near[k])] = kept[k];
    return false;
  }

  void make_way(Index u, double radius) {
    Vertex& vertex = vertices_[at(u)];
    double now = least_around(u), reach = 0;
    if (now > 0.2 || !(vertex.normal.norm() > 0)) return;
    for (std::size_t k = starts_[at(u)]; k < starts_[at(u) + 1]; ++k)
      for (const Index w : quads_[incident_[k]])
        reach = std::max(reach, (vertices_[at(w)].position - vertex.position).norm());
    const Vector3 here = vertex.position;
    const Vector3 x = vertex.normal.unitOrthogonal(), y = vertex.normal.normalized().cross(x);
    Vertex best = vertex;
    const SurfacePoint start = vertex.goal;
    for (int k = 0; k < 8; ++k) {
      const double angle = k * 0.78539816339744831;
      const SurfaceHit hit =
          walk_closest(mesh_, here + radius * reach * (elementary::cos(angle) * x + elementary::sin(angle) * y), start);
      vertex.goal = hit;
      vertex.position = quadrig::position(mesh_, hit);
      if (const double least = least_around(u); least > now) {
        now = least;
        best = vertex;
      }
    }
    vertex = best;
  }

  const TriangleMesh<double>& mesh_;
  EdgeCurves border_;
  ClosestPoint tree_;
  std::vector<Vertex> vertices_;  // corners first
  Index corners_ = 0;
  std::vector<std::array<Index, 4>> quads_;
  std::vector<Vector3> flat_normal_;
  std::vector<double> least_;
  std::vector<std::size_t> starts_, incident_;
};

}  // namespace quadrig::detail
