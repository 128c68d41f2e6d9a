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

}  // namespace detail

QUADRIG_INLINE CutGraph make_cut_graph(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                       const std::vector<Index>& index, const Context* context) {
  using detail::at;
  const Index half_edges = mesh.halfedge_count(), n = mesh.vertex_count();
  CutGraph cut;
  std::vector<std::int8_t> in_tree;
  cut.combing = detail::comb_faces(mesh, rotation, in_tree, context);
  if (context && context->cancelled()) return cut;
  cut.rotation.assign(at(half_edges), 0);
  std::vector<std::int8_t> on_cut(at(half_edges), 0);
  std::vector<Index> valence(at(n), 0);
  for (Index h = 0; h < half_edges; ++h) {
    const Index g = mesh.twin(h);
    if (g == no_index) continue;
    cut.rotation[at(h)] =
        static_cast<std::int8_t>((rotation[at(h)] + cut.combing[at(h / 3)] - cut.combing[at(g / 3)]) & 3);
    if (!in_tree[at(h)]) {
      on_cut[at(h)] = 1;
      ++valence[at(mesh.origin(h))];
    }
  }

  // Prune dangling ends that open nothing.
  const auto cut_leaving = [&](Index v) {
    Index h = mesh.outgoing(v);
    const Index start = h;
    do {
      if (on_cut[at(h)]) return h;
      // The last edge of a boundary fan is not a half-edge that leaves v, and it is never on the cut.
      h = mesh.next_around(h);
    } while (h != no_index && h != start);
    return no_index;
  };
  const auto prunable = [&](Index v) { return valence[at(v)] == 1 && index[at(v)] == 0 && !mesh.on_boundary(v); };
  std::vector<Index> stack;
  for (Index v = 0; v < n; ++v)
    if (prunable(v)) stack.push_back(v);
  while (!stack.empty()) {
    const Index v = stack.back();
    stack.pop_back();
    if (!prunable(v)) continue;
    const Index h = cut_leaving(v), w = mesh.target(h);
    on_cut[at(h)] = on_cut[at(mesh.twin(h))] = 0;
    --valence[at(v)];
    --valence[at(w)];
    if (prunable(w)) stack.push_back(w);
  }

  cut.node.assign(at(n), 0);
  for (Index v = 0; v < n; ++v)
    cut.node[at(v)] = valence[at(v)] > 0 && (valence[at(v)] != 2 || index[at(v)] != 0 || mesh.on_boundary(v));

  cut.branch.assign(at(half_edges), no_index);
  cut.forward.assign(at(half_edges), 0);
  const auto trace = [&](Index h) {
    const Index b = cut.branch_count++;
    for (;;) {
      const Index g = mesh.twin(h);
      cut.branch[at(h)] = cut.branch[at(g)] = b;
      cut.forward[at(h)] = 1;
      const Index v = mesh.target(h);
      if (cut.node[at(v)]) return;
      Index next = mesh.prev_around(g);  // g leaves v; turn to the other cut half-edge that leaves v
      while (!on_cut[at(next)]) next = mesh.prev_around(next);
      assert(cut.rotation[at(next)] == cut.rotation[at(h)]);
      h = next;
    }
  };
  for (Index h = 0; h < half_edges; ++h)
    if (on_cut[at(h)] && cut.branch[at(h)] == no_index && cut.node[at(mesh.origin(h))]) trace(h);
  for (Index h = 0; h < half_edges; ++h)  // closed loops without a node get one
    if (on_cut[at(h)] && cut.branch[at(h)] == no_index) {
      cut.node[at(mesh.origin(h))] = 1;
      trace(h);
    }

  if (context && context->cancelled()) return cut;
  cut.corner_rotation.assign(at(half_edges), 0);
  cut.corner_translation.resize(at(half_edges));
  for (Index v = 0; v < n; ++v) {
    if (v % 8192 == 0 && context && context->cancelled()) return cut;
    Index start = mesh.outgoing(v);
    if (start == no_index) continue;
    const bool boundary = mesh.on_boundary(v);
    if (!boundary && valence[at(v)] > 0) start = cut_leaving(v);
    int turn = 0;
    LinearExpression<Gaussian> translation;
    Index h = start;
    for (;;) {
      cut.corner_rotation[at(h)] = static_cast<std::int8_t>(turn & 3);
      cut.corner_translation[at(h)] = translation;
      const Index x = mesh.prev(h), across = mesh.twin(x);
      if (across == no_index) break;
      if (cut.branch[at(x)] != no_index || cut.rotation[at(x)] != 0) {
        const int r = cut.rotation[at(x)];
        turn += r;
        for (auto& term : translation) term.coefficient = rotated(term.coefficient, r);
        if (const Index b = cut.branch[at(x)]; b != no_index) {
          const Gaussian one = cut.forward[at(x)] ? Gaussian{1, 0} : -rotated(Gaussian{1, 0}, r);
          accumulate(translation, LinearExpression<Gaussian>{{b, one}}, Gaussian{1, 0});
        }
      }
      h = across;
      if (h == start) {
        if (cut.node[at(v)]) cut.closings.push_back({v, static_cast<std::int8_t>(turn & 3), translation});
        break;
      }
    }
  }
  return cut;
}

}  // namespace quadrig
