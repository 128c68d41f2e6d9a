#pragma once

#include <queue>

#include "quadrig/seamless/cut_graph.hpp"

namespace quadrig {

namespace detail {

/// Dual spanning tree by shortest paths over face centroids; returns combing per face and marks tree edges.
inline std::vector<std::int8_t> comb_faces(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                           std::vector<std::int8_t>& in_tree, const Context* context) {
  const Index m = mesh.face_count();
  std::vector<double> distance(at(m), std::numeric_limits<double>::infinity());
  std::vector<Index> entered(at(m), no_index);
  std::vector<std::int8_t> combing(at(m), 0);
  std::vector<char> done(at(m), 0);
  Points<double> centroid(m, 3);
  for (Index f = 0; f < m; ++f)
    centroid.row(f) =
        (mesh.position(mesh.faces()(f, 0)) + mesh.position(mesh.faces()(f, 1)) + mesh.position(mesh.faces()(f, 2)))
            .transpose() /
        3;
  in_tree.assign(at(3 * m), 0);
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (Index seed = 0; seed < m; ++seed) {
    if (done[at(seed)]) continue;
    distance[at(seed)] = 0;
    queue.push({0, seed});
    for (std::size_t steps = 0; !queue.empty(); ++steps) {
      if (steps % 8192 == 0 && context && context->cancelled()) return combing;
      const auto [d, f] = queue.top();
      queue.pop();
      if (done[at(f)]) continue;
      done[at(f)] = 1;
      if (const Index h = entered[at(f)]; h != no_index) {
        in_tree[at(h)] = in_tree[at(mesh.twin(h))] = 1;
        combing[at(f)] = static_cast<std::int8_t>((combing[at(h / 3)] + rotation[at(h)]) & 3);
      }
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        const Index across = mesh.twin(h);
        if (across == no_index || done[at(across / 3)]) continue;
        const double next = d + (centroid.row(f) - centroid.row(across / 3)).norm();
        if (next < distance[at(across / 3)]) {
          distance[at(across / 3)] = next;
          entered[at(across / 3)] = h;
          queue.push({next, across / 3});
        }
      }
    }
  }
  return combing;
}

/// Cuts, branches and corners of a combed surface.
class CutTracer {
 public:
  CutTracer(const TriangleMesh<double>& mesh, const std::vector<Index>& index, CutGraph& cut,
            const std::vector<std::int8_t>& in_tree)
      : mesh_(mesh), index_(index), cut_(cut) {
    on_cut_.assign(at(mesh.halfedge_count()), 0);
    valence_.assign(at(mesh.vertex_count()), 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (mesh.twin(h) != no_index && !in_tree[at(h)]) {
        on_cut_[at(h)] = 1;
        ++valence_[at(mesh.origin(h))];
      }
  }

  /// Takes off dangling ends that open nothing.
  void prune() {
    const auto prunable = [&](Index v) { return valence_[at(v)] == 1 && index_[at(v)] == 0 && !mesh_.on_boundary(v); };
    std::vector<Index> stack;
    for (Index v = 0; v < mesh_.vertex_count(); ++v)
      if (prunable(v)) stack.push_back(v);
    while (!stack.empty()) {
      const Index v = stack.back();
      stack.pop_back();
      if (!prunable(v)) continue;
      const Index h = cut_leaving(v), w = mesh_.target(h);
      on_cut_[at(h)] = on_cut_[at(mesh_.twin(h))] = 0;
      --valence_[at(v)];
      --valence_[at(w)];
      if (prunable(w)) stack.push_back(w);
    }
  }

  /// Nodes, and the branches between them.
  void trace_branches() {
    const Index half_edges = mesh_.halfedge_count();
    cut_.node.assign(at(mesh_.vertex_count()), 0);
    for (Index v = 0; v < mesh_.vertex_count(); ++v)
      cut_.node[at(v)] = valence_[at(v)] > 0 && (valence_[at(v)] != 2 || index_[at(v)] != 0 || mesh_.on_boundary(v));
    cut_.branch.assign(at(half_edges), no_index);
    cut_.forward.assign(at(half_edges), 0);
    for (Index h = 0; h < half_edges; ++h)
      if (on_cut_[at(h)] && cut_.branch[at(h)] == no_index && cut_.node[at(mesh_.origin(h))]) trace(h);
    for (Index h = 0; h < half_edges; ++h)  // closed loops without a node get one
      if (on_cut_[at(h)] && cut_.branch[at(h)] == no_index) {
        cut_.node[at(mesh_.origin(h))] = 1;
        trace(h);
      }
  }

  /// Each corner's chart relative to its vertex, and what closes around nodes. Incomplete once cancelled.
  void place_corners(const Context* context) {
    cut_.corner_rotation.assign(at(mesh_.halfedge_count()), 0);
    cut_.corner_translation.resize(at(mesh_.halfedge_count()));
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      if (v % 8192 == 0 && context && context->cancelled()) return;
      if (mesh_.outgoing(v) != no_index) place_corners_of(v);
    }
  }

 private:
  [[nodiscard]] Index cut_leaving(Index v) const {
    Index h = mesh_.outgoing(v);
    const Index start = h;
    do {
      if (on_cut_[at(h)]) return h;
      // The last edge of a boundary fan is not a half-edge that leaves v, and it is never on the cut.
      h = mesh_.next_around(h);
    } while (h != no_index && h != start);
    return no_index;
  }

  void trace(Index h) {
    const Index b = cut_.branch_count++;
    for (;;) {
      const Index g = mesh_.twin(h);
      cut_.branch[at(h)] = cut_.branch[at(g)] = b;
      cut_.forward[at(h)] = 1;
      const Index v = mesh_.target(h);
      if (cut_.node[at(v)]) return;
      Index next = mesh_.prev_around(g);  // g leaves v; turn to the other cut half-edge that leaves v
      while (!on_cut_[at(next)]) next = mesh_.prev_around(next);
      assert(cut_.rotation[at(next)] == cut_.rotation[at(h)]);
      h = next;
    }
  }

  void place_corners_of(Index v) {
    Index start = mesh_.outgoing(v);
    if (!mesh_.on_boundary(v) && valence_[at(v)] > 0) start = cut_leaving(v);
    int turn = 0;
    LinearExpression<Gaussian> translation;
    Index h = start;
    for (;;) {
      cut_.corner_rotation[at(h)] = static_cast<std::int8_t>(turn & 3);
      cut_.corner_translation[at(h)] = translation;
      const Index x = mesh_.prev(h), across = mesh_.twin(x);
      if (across == no_index) return;
      if (cut_.branch[at(x)] != no_index || cut_.rotation[at(x)] != 0) {
        const int r = cut_.rotation[at(x)];
        turn += r;
        for (auto& term : translation) term.coefficient = rotated(term.coefficient, r);
        if (const Index b = cut_.branch[at(x)]; b != no_index) {
          const Gaussian one = cut_.forward[at(x)] ? Gaussian{1, 0} : -rotated(Gaussian{1, 0}, r);
          accumulate(translation, LinearExpression<Gaussian>{{b, one}}, Gaussian{1, 0});
        }
      }
      h = across;
      if (h != start) continue;
      if (cut_.node[at(v)]) cut_.closings.push_back({v, static_cast<std::int8_t>(turn & 3), translation});
      return;
    }
  }

  const TriangleMesh<double>& mesh_;
  const std::vector<Index>& index_;
  CutGraph& cut_;
  std::vector<std::int8_t> on_cut_;
  std::vector<Index> valence_;
};

}  // namespace detail

QUADRIG_INLINE CutGraph make_cut_graph(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                       const std::vector<Index>& index, const Context* context) {
  using detail::at;
  CutGraph cut;
  std::vector<std::int8_t> in_tree;
  cut.combing = detail::comb_faces(mesh, rotation, in_tree, context);
  if (context && context->cancelled()) return cut;
  cut.rotation.assign(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (const Index g = mesh.twin(h); g != no_index)
      cut.rotation[at(h)] =
          static_cast<std::int8_t>((rotation[at(h)] + cut.combing[at(h / 3)] - cut.combing[at(g / 3)]) & 3);
  detail::CutTracer tracer(mesh, index, cut, in_tree);
  tracer.prune();
  tracer.trace_branches();
  if (context && context->cancelled()) return cut;
  tracer.place_corners(context);
  return cut;
}

}  // namespace quadrig
