// Hinges: where limbs bend, as closed curves round them on the surface.
#pragma once

#include <numbers>
#include <queue>
#include <span>

#include "quadrig/skinning.hpp"

namespace quadrig {

/// A closed way over faces: it leaves the face of each half-edge across it, the last into the face of the first.
struct FaceLoop {
  std::vector<Index> crossed;
  std::vector<double> where;  ///< of each crossing, from the origin (0) to the target (1) of the half-edge
};

/// A joint as the surface shows it: the closed curve round a limb along which what the joint moves and what it does not
/// have equal weight. What it moves lies to the left.
struct Hinge {
  Index bone = no_index;  ///< the bone that turns about its head
  FaceLoop loop;
  double length = 0;  ///< of the curve
  double bend = 0;    ///< how far the bend reaches to either side of it
};

/// Where a loop crosses the k-th of its half-edges.
template <class Scalar>
[[nodiscard]] Vector3 crossing(const TriangleMesh<Scalar>& mesh, const FaceLoop& loop, std::size_t k) {
  const Index h = loop.crossed[k];
  return ((1 - loop.where[k]) * mesh.position(mesh.origin(h)) + loop.where[k] * mesh.position(mesh.target(h)))
      .template cast<double>();
}

/// The closed curves along which a function on the vertices has a value; greater values lie to the left.
/// \cost O(m)
[[nodiscard]] inline std::vector<FaceLoop> level_loops(const TriangleMesh<double>& mesh, std::span<const double> values,
                                                       double level) {
  const auto rises = [&](Index h) {
    return values[detail::at(mesh.origin(h))] < level && !(values[detail::at(mesh.target(h))] < level);
  };
  std::vector<char> seen(detail::at(mesh.halfedge_count()), 0);
  std::vector<FaceLoop> loops;
  for (Index seed = 0; seed < mesh.halfedge_count(); ++seed) {
    if (seen[detail::at(seed)] || !rises(seed)) continue;
    FaceLoop loop;
    Index h = seed;
    while (h != no_index && !seen[detail::at(h)]) {
      seen[detail::at(h)] = 1;
      const double a = values[detail::at(mesh.origin(h))], b = values[detail::at(mesh.target(h))];
      loop.crossed.push_back(h);
      loop.where.push_back((level - a) / (b - a));
      const Index g = mesh.twin(h);
      h = g == no_index ? no_index : rises(mesh.next(g)) ? mesh.next(g) : mesh.prev(g);
    }
    if (h == seed && loop.crossed.size() >= 3) loops.push_back(std::move(loop));
  }
  return loops;
}

/// A vertex beside a loop.
struct BesideLoop {
  Index vertex = no_index;
  double distance = 0;       ///< along edges, positive to the left
  std::size_t crossing = 0;  ///< from which crossing of the loop
};

/// The vertices within `reach` of a loop, the nearest first.
/// \cost O(n), and O(k log k) for k vertices within reach
[[nodiscard]] inline std::vector<BesideLoop> vertices_beside(const TriangleMesh<double>& mesh, const FaceLoop& loop,
                                                             double reach) {
  struct Reached {
    double distance;
    Index vertex;
    bool left;
    std::size_t crossing;
    bool operator>(const Reached& o) const {
      return std::tie(distance, vertex, left, crossing) > std::tie(o.distance, o.vertex, o.left, o.crossing);
    }
  };
  std::vector<double> distance(detail::at(mesh.vertex_count()), std::numeric_limits<double>::infinity());
  std::vector<char> done(distance.size(), 0);
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> queue;
  const auto offer = [&](Index v, double d, bool left, std::size_t crossing) {
    if (!(d <= reach && d < distance[detail::at(v)])) return;
    distance[detail::at(v)] = d;
    queue.push({d, v, left, crossing});
  };
  std::vector<Index> across;  // edges that nothing goes along: it would come out on the other side
  for (std::size_t k = 0; k < loop.crossed.size(); ++k) {
    const Index h = loop.crossed[k];
    const double length = mesh.edge_vector(h).norm();
    offer(mesh.target(h), (1 - loop.where[k]) * length, true, k);
    offer(mesh.origin(h), loop.where[k] * length, false, k);
    across.push_back(h);
    across.push_back(mesh.twin(h));
  }
  std::sort(across.begin(), across.end());
  std::vector<BesideLoop> beside;
  while (!queue.empty()) {
    const auto [d, v, left, crossing] = queue.top();
    queue.pop();
    if (done[detail::at(v)] || d > distance[detail::at(v)]) continue;
    done[detail::at(v)] = 1;
    beside.push_back({v, left ? d : -d, crossing});
    for (const Index h : mesh.around(v)) {
      const Index last = mesh.prev(h);  // of a fan on the border no half-edge leaves v
      if (!std::binary_search(across.begin(), across.end(), h))
        offer(mesh.target(h), d + mesh.edge_vector(h).norm(), left, crossing);
      if (mesh.twin(last) == no_index) offer(mesh.origin(last), d + mesh.edge_vector(last).norm(), left, crossing);
    }
  }
  return beside;
}

namespace detail {

/// Finds the hinges of one bone.
class HingeFinder {
 public:
  HingeFinder(const TriangleMesh<double>& mesh, const Skeleton& skeleton) : mesh_(mesh), skeleton_(skeleton) {}

  /// \param moved of each vertex the weight of what hangs on the bone
  void find(Index bone, std::span<const double> moved, std::vector<Hinge>& hinges) const {
    for (FaceLoop& loop : level_loops(mesh_, moved, 0.5)) {
      Hinge hinge{bone, std::move(loop), 0, 0};
      if (round_a_limb(hinge, moved)) hinges.push_back(std::move(hinge));
    }
  }

 private:
  /// Whether the curve goes round something that is longer than wide on either side, near the joint; then its measures
  /// are set.
  [[nodiscard]] bool round_a_limb(Hinge& hinge, std::span<const double> moved) const {
    constexpr double pi = std::numbers::pi, roundish = 0.25, near = 1.75, cap = 1.6;
    const std::size_t n = hinge.loop.crossed.size();
    Vector3 middle = Vector3::Zero(), area = Vector3::Zero();
    for (std::size_t k = 0; k < n; ++k) {
      const Vector3 a = crossing(mesh_, hinge.loop, k), b = crossing(mesh_, hinge.loop, (k + 1) % n);
      hinge.length += (b - a).norm();
      middle += (b - a).norm() * (a + b) / 2;
    }
    if (!(hinge.length > 0)) return false;
    middle /= hinge.length;
    for (std::size_t k = 0; k < n; ++k)
      area += (crossing(mesh_, hinge.loop, k) - middle).cross(crossing(mesh_, hinge.loop, (k + 1) % n) - middle) / 2;
    const double disc = area.norm(), radius = hinge.length / (2 * pi);
    if (!(disc > roundish * pi * radius * radius)) return false;
    const Vector3 joint = skeleton_.bones[at(hinge.bone)].head;
    if (!((joint - middle).norm() < near * radius)) return false;
    // A patch of a face that something moves is not much more than flat.
    const auto [far_side, bend] = side(hinge, moved, cap * disc);
    if (!(far_side >= cap * disc)) return false;
    constexpr double most = 1.5;
    hinge.bend = std::clamp(bend, radius, most * radius);
    return true;
  }

  /// Area of what is moved beyond the curve, as far as `enough`, and how wide the blend is there.
  [[nodiscard]] std::pair<double, double> side(const Hinge& hinge, std::span<const double> moved, double enough) const {
    std::vector<Index> open;
    std::vector<char> seen(at(mesh_.face_count()), 0);
    for (const Index h : hinge.loop.crossed)
      if (!std::exchange(seen[at(TriangleMesh<double>::face_of(h))], char{1}))
        open.push_back(TriangleMesh<double>::face_of(h));
    const auto weight = [&](Index f) {
      double sum = 0;
      for (int i = 0; i < 3; ++i) sum += moved[at(mesh_.faces()(f, i))] / 3;
      return sum;
    };
    constexpr double whole = 0.95;
    double beyond = 0, blend = 0;
    for (std::size_t k = 0; k < open.size(); ++k) {
      const Index f = open[k];
      const double here = weight(f);
      if (here >= 0.5) beyond += mesh_.area(f);
      if (here < whole) blend += mesh_.area(f) / 2;
      for (const Index h : mesh_.halfedges_of(f)) {
        const Index g = mesh_.twin(h);
        if (g == no_index || seen[at(TriangleMesh<double>::face_of(g))]) continue;
        const double there = weight(TriangleMesh<double>::face_of(g));
        if (there < 1 - whole || (there >= whole && beyond >= enough) || there < 0.5) continue;
        seen[at(TriangleMesh<double>::face_of(g))] = 1;
        open.push_back(TriangleMesh<double>::face_of(g));
      }
    }
    return {beyond, 2 * blend / hinge.length};
  }

  const TriangleMesh<double>& mesh_;
  const Skeleton& skeleton_;
};

}  // namespace detail

/// The hinges of a surface with a rig, by bone: for every bone that hangs on another the curves round limbs that part
/// what it moves from the rest. Bones that part the surface at the same place have one hinge.
/// \cost O(b m) for b bones \fails never
[[nodiscard]] inline std::vector<Hinge> find_hinges(const TriangleMesh<double>& mesh, const Rig& rig) {
  using detail::at;
  std::vector<Hinge> hinges;
  const detail::HingeFinder finder(mesh, rig.skeleton);
  const Eigen::SparseMatrix<double, Eigen::ColMajor, Index> columns = rig.weights;
  // Of each bone those that carry weight, of it and all below it. A chain as long as a file can name is not followed to
  // its end.
  constexpr std::size_t most_below = 1 << 20;
  constexpr double most_work = 4e8;  // bones times half-edges
  std::vector<std::vector<Index>> weighted(at(rig.skeleton.bone_count()));
  std::size_t below_all = 0;
  for (Index b = 0; b < rig.skeleton.bone_count(); ++b) {
    if (columns.outerIndexPtr()[b + 1] == columns.outerIndexPtr()[b]) continue;
    Index up = b;
    for (std::size_t step = 0; up != no_index && step < weighted.size() && below_all < most_below;
         ++step, ++below_all) {
      if (!weighted[at(up)].empty() && weighted[at(up)].back() == b) break;  // parents that form a ring
      weighted[at(up)].push_back(b);
      up = rig.skeleton.bones[at(up)].parent;
    }
  }
  std::vector<double> moved(at(mesh.vertex_count()));
  std::vector<std::vector<Index>> known;
  double work = 0;
  for (Index b = 0; b < rig.skeleton.bone_count(); ++b) {
    if (rig.skeleton.bones[at(b)].parent == no_index || weighted[at(b)].empty()) continue;
    if ((work += mesh.halfedge_count()) > most_work) break;
    std::fill(moved.begin(), moved.end(), 0.0);
    for (const Index below : weighted[at(b)])
      for (Eigen::SparseMatrix<double, Eigen::ColMajor, Index>::InnerIterator it(columns, below); it; ++it)
        moved[at(static_cast<Index>(it.row()))] += it.value();
    const std::size_t before = hinges.size();
    finder.find(b, moved, hinges);
    for (std::size_t k = before; k < hinges.size();) {
      std::vector<Index> edges = hinges[k].loop.crossed;
      std::sort(edges.begin(), edges.end());
      if (std::find(known.begin(), known.end(), edges) != known.end()) {
        hinges.erase(hinges.begin() + static_cast<std::ptrdiff_t>(k));
      } else {
        known.push_back(std::move(edges));
        ++k;
      }
    }
  }
  return hinges;
}

}  // namespace quadrig
