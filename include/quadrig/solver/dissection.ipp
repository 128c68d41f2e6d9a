// Definitions of solver/dissection.hpp.
#pragma once

#include "quadrig/solver/bisection.hpp"

namespace quadrig {

namespace detail {

// Nested dissection of a large graph by way of a small one: its vertices in clusters of a few. Each cut is sought among
// the clusters and then again, exactly, among the vertices of the clusters around it.
class ClusteredDissection {
 public:
  ClusteredDissection(const DissectionPiece& graph, const DissectionOptions& options, Index cluster_size,
                      const Context& context)
      : graph_(graph),
        context_(context),
        inner_(options, context),
        cluster_size_(cluster_size),
        least_vertices_(std::max(600, options.leaf)),
        local_(at(graph.size()), first) {}

  void order(std::span<Index> out, unsigned threads) { dissect(clusters(), out, threads); }

 private:
  struct Piece {
    DissectionPiece clusters;
    std::vector<Index> starts{0}, members;  // of each cluster
    [[nodiscard]] std::span<const Index> of(Index cluster) const {
      const auto begin = at(starts[at(cluster)]);
      return std::span(members).subspan(begin, at(starts[at(cluster) + 1]) - begin);
    }
  };

  static constexpr Index separated = -1, first = -2, second = -3;  // what local_ says where it is no number

  // Grown from vertices in their order; what is left over joins a neighbour.
  [[nodiscard]] Piece clusters() const {
    const Index n = graph_.size();
    std::vector<Index> cluster(at(n), no_index), queue;
    Index count = 0;
    for (Index root = 0; root < n; ++root) {
      if (root % 65536 == 0 && context_.cancelled()) {  // each by itself will do
        for (Index v = root; v < n; ++v)
          if (cluster[at(v)] == no_index) cluster[at(v)] = count++;
        break;
      }
      if (cluster[at(root)] != no_index) continue;
      queue.assign(1, root);
      cluster[at(root)] = count;
      Index beside = no_index;
      for (std::size_t k = 0; k < queue.size(); ++k)
        for (const Index u : graph_.around(queue[k])) {
          if (u >= n) continue;
          if (cluster[at(u)] == no_index && queue.size() < at(cluster_size_)) {
            cluster[at(u)] = count;
            queue.push_back(u);
          } else if (cluster[at(u)] != no_index && cluster[at(u)] != count) {
            beside = cluster[at(u)];
          }
        }
      if (queue.size() <= 3 && beside != no_index)
        for (const Index v : queue) cluster[at(v)] = beside;
      else
        ++count;
    }
    Piece piece;
    piece.starts.assign(at(count) + 1, 0);
    for (const Index c : cluster) ++piece.starts[at(c) + 1];
    for (std::size_t c = 0; c < at(count); ++c) piece.starts[c + 1] += piece.starts[c];
    piece.members.resize(at(n));
    std::vector<Index> next(piece.starts.begin(), piece.starts.end());
    for (Index v = 0; v < n; ++v) piece.members[at(next[at(cluster[at(v)])]++)] = v;
    std::vector<Index> mark(at(count), no_index);
    for (Index c = 0; c < count; ++c) {
      if (c % 8192 == 0 && context_.cancelled()) return piece;
      mark[at(c)] = c;
      for (const Index v : piece.of(c))
        for (const Index u : graph_.around(v)) {
          if (u >= n) continue;
          const Index other = cluster[at(u)];
          if (std::exchange(mark[at(other)], c) != c) piece.clusters.neighbors.push_back(other);
        }
      piece.clusters.starts.push_back(static_cast<Index>(piece.clusters.neighbors.size()));
      piece.clusters.unknown.push_back(c);
    }
    return piece;
  }

  void dissect(Piece piece, std::span<Index> out, unsigned threads) {
    const Index count = piece.clusters.size();
    if (context_.cancelled()) {
      for (std::size_t k = 0; k < out.size(); ++k) out[k] = graph_.unknown[at(piece.members[k])];
      return;
    }
    if (static_cast<Index>(piece.members.size()) <= least_vertices_ || count < 40) return finish(piece, out, threads);
    std::vector<Index> part, visited;
    const Index parts = Dissection::components(piece.clusters, part, visited);
    if (parts > 1) {
      std::vector<Piece> pieces = split(piece, part, parts);
      piece = Piece();
      for (Piece& each : pieces) {
        const std::size_t size = each.members.size();
        dissect(std::move(each), out.first(size), threads);
        out = out.subspan(size);
      }
      return;
    }
    std::vector<char> side;
    if (!inner_.bisect(piece.clusters, visited.back(), side)) return finish(piece, out, threads);

    // The band of vertices: the separating clusters and those around them.
    std::vector<char> in_band(at(count), 0);
    for (Index c = 0; c < count; ++c)
      if (side[at(c)] == 2) {
        in_band[at(c)] = 1;
        for (const Index d : piece.clusters.around(c)) in_band[at(d)] = 1;
      }
    std::vector<Index> members;
    std::array<Index, 2> outside_band{};
    for (Index c = 0; c < count; ++c)
      for (const Index v : piece.of(c)) {
        if (in_band[at(c)]) {
          local_[at(v)] = static_cast<Index>(members.size());
          members.push_back(v);
        } else {
          local_[at(v)] = side[at(c)] == 0 ? first : second;
          ++outside_band[side[at(c)] == 0 ? 0 : 1];
        }
      }
    DissectionBand band;
    for (const Index v : members) {
      char touches = 0;
      for (const Index u : graph_.around(v)) {
        if (u >= graph_.size() || local_[at(u)] == separated) continue;
        if (local_[at(u)] >= 0)
          band.neighbors.push_back(local_[at(u)]);
        else
          touches = static_cast<char>(touches | (local_[at(u)] == first ? 1 : 2));
      }
      band.touches.push_back(touches);
      band.starts.push_back(static_cast<Index>(band.neighbors.size()));
    }
    VertexCut cut(band);
    cut.maximize();
    const std::vector<char> found = cut.separate(outside_band[0], outside_band[1]);
    std::array<Index, 3> total{outside_band[0], outside_band[1], 0};
    for (const char each : found) ++total[static_cast<std::size_t>(each)];
    if (total[0] == 0 || total[1] == 0) return finish(piece, out, threads);

    std::array<Piece, 2> halves;
    std::array<std::vector<Index>, 2> number{std::vector<Index>(at(count), no_index),
                                             std::vector<Index>(at(count), no_index)};
    std::size_t last = out.size() - at(total[2]);
    for (Index c = 0; c < count; ++c) {
      for (const Index v : piece.of(c)) {
        const int s = in_band[at(c)] ? found[at(local_[at(v)])] : side[at(c)];
        if (s == 2)
          out[last++] = graph_.unknown[at(v)];
        else
          halves[static_cast<std::size_t>(s)].members.push_back(v);
      }
      for (std::size_t s = 0; s < 2; ++s) {
        Piece& half = halves[s];
        if (at(half.starts.back()) == half.members.size()) continue;
        number[s][at(c)] = half.clusters.size();
        half.starts.push_back(static_cast<Index>(half.members.size()));
        half.clusters.unknown.push_back(c);
        half.clusters.place.push_back(piece.clusters.place[at(c)]);
      }
    }
    for (const Index v : members)
      if (found[at(local_[at(v)])] == 2) local_[at(v)] = separated;
    for (std::size_t s = 0; s < 2; ++s) {
      Piece& half = halves[s];
      half.clusters.age = piece.clusters.age;
      for (const Index c : half.clusters.unknown) {
        for (const Index d : piece.clusters.around(c))
          if (number[s][at(d)] != no_index) half.clusters.neighbors.push_back(number[s][at(d)]);
        half.clusters.starts.push_back(static_cast<Index>(half.clusters.neighbors.size()));
      }
    }
    piece = Piece();
    const std::span<Index> left = out.first(at(total[0])), right = out.subspan(at(total[0]), at(total[1]));
    if (threads > 1 && out.size() > 20000) {
      side_by_side([&] { dissect(std::move(halves[0]), left, threads - threads / 2); },
                   [&] { dissect(std::move(halves[1]), right, threads / 2); });
    } else {
      dissect(std::move(halves[0]), left, 1);
      dissect(std::move(halves[1]), right, 1);
    }
  }

  static std::vector<Piece> split(const Piece& piece, std::span<const Index> part, Index parts) {
    std::vector<DissectionPiece> graphs = Dissection::split(piece.clusters, part, parts);
    std::vector<Piece> pieces(at(parts));
    for (Index c = 0; c < piece.clusters.size(); ++c) {
      Piece& own = pieces[at(part[at(c)])];
      own.members.insert(own.members.end(), piece.of(c).begin(), piece.of(c).end());
      own.starts.push_back(static_cast<Index>(own.members.size()));
    }
    for (std::size_t p = 0; p < pieces.size(); ++p) pieces[p].clusters = std::move(graphs[p]);
    return pieces;
  }

  // The vertices of a piece without clusters.
  void finish(const Piece& piece, std::span<Index> out, unsigned threads) {
    DissectionPiece own;
    for (std::size_t k = 0; k < piece.members.size(); ++k) local_[at(piece.members[k])] = static_cast<Index>(k);
    std::vector<Index> beyond;
    const auto outside = [&](Index u) { return u >= graph_.size() || local_[at(u)] == separated; };
    for (const Index v : piece.members)
      for (const Index u : graph_.around(v))
        if (outside(u)) beyond.push_back(u);
    std::sort(beyond.begin(), beyond.end());
    beyond.erase(std::unique(beyond.begin(), beyond.end()), beyond.end());
    own.outside = static_cast<Index>(beyond.size());
    const auto size = static_cast<Index>(piece.members.size());
    for (const Index v : piece.members) {
      own.unknown.push_back(graph_.unknown[at(v)]);
      for (const Index u : graph_.around(v))
        own.neighbors.push_back(
            outside(u) ? size + static_cast<Index>(std::lower_bound(beyond.begin(), beyond.end(), u) - beyond.begin())
                       : local_[at(u)]);
      own.starts.push_back(static_cast<Index>(own.neighbors.size()));
    }
    inner_.order(std::move(own), out, threads);
  }

  const DissectionPiece& graph_;
  const Context& context_;
  Dissection inner_;
  Index cluster_size_, least_vertices_;
  // Number of each vertex in what is being worked on, or what became of it. Pieces side by side touch no common entry:
  // between them lie vertices that are separated, and those are written before the pieces part.
  std::vector<Index> local_;
};

}  // namespace detail

QUADRIG_INLINE std::vector<Index> nested_dissection(Index size, std::span<const Index> column_starts,
                                                    std::span<const Index> rows, const DissectionOptions& given,
                                                    Context& context) {
  const auto n = static_cast<std::size_t>(size);
  const bool large = size > detail::large_system;
  DissectionOptions options = given;
  if (options.leaf == 0) options.leaf = large ? 3000 : 160;
  // Larger clusters cost less, and their cuts are straighter.
  const Index cluster_size = large ? 16 : 8;
  // Both triangles without the diagonal.
  std::vector<Index> starts(n + 1, 0);
  const auto for_each_edge = [&](auto&& body) {
    for (std::size_t j = 0; j < n; ++j)
      for (auto e = static_cast<std::size_t>(column_starts[j]); e < static_cast<std::size_t>(column_starts[j + 1]); ++e)
        if (rows[e] != static_cast<Index>(j)) body(static_cast<std::size_t>(rows[e]), j);
  };
  for_each_edge([&](std::size_t i, std::size_t j) {
    ++starts[i + 1];
    ++starts[j + 1];
  });
  std::vector<Index> order(n);
  std::iota(order.begin(), order.end(), 0);
  if (context.cancelled()) return order;
  // Rows that touch a large share of the unknowns hide every separator: they go last.
  const auto dense = static_cast<Index>(std::max(16.0, 10 * std::sqrt(static_cast<double>(n))));
  detail::DissectionPiece piece;
  std::vector<Index> local(n);
  std::size_t last = n;
  for (std::size_t v = n; v-- > 0;)
    if (starts[v + 1] > dense) order[--last] = static_cast<Index>(v);
  Index outside = static_cast<Index>(last);
  for (std::size_t v = 0; v < n; ++v)
    if (starts[v + 1] > dense) {
      local[v] = outside++;
    } else {
      local[v] = piece.size();
      piece.unknown.push_back(static_cast<Index>(v));
    }
  if (context.cancelled()) return order;
  for (std::size_t v = 0; v < n; ++v) starts[v + 1] += starts[v];
  std::vector<Index> both(static_cast<std::size_t>(starts[n]));
  std::vector<Index> next(starts.begin(), starts.end() - 1);
  for_each_edge([&](std::size_t i, std::size_t j) {
    both[static_cast<std::size_t>(next[i]++)] = local[j];
    both[static_cast<std::size_t>(next[j]++)] = local[i];
  });
  if (context.cancelled()) return order;
  if (last == n) {
    piece.starts = std::move(starts);
    piece.neighbors = std::move(both);
  } else {
    for (const Index v : piece.unknown) {
      const auto u = static_cast<std::size_t>(v);
      piece.neighbors.insert(piece.neighbors.end(), both.begin() + starts[u], both.begin() + starts[u + 1]);
      piece.starts.push_back(static_cast<Index>(piece.neighbors.size()));
    }
  }
  piece.outside = static_cast<Index>(n - last);
  const std::span<Index> out = std::span(order).first(last);
  if (piece.size() < 3000)
    detail::Dissection(options, context).order(std::move(piece), out, context.thread_count());
  else
    detail::ClusteredDissection(piece, options, cluster_size, context).order(out, context.thread_count());
  return order;
}

}  // namespace quadrig
