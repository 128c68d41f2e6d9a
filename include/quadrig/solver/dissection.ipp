// Definitions of solver/dissection.hpp.
#pragma once

#include <bit>
#include <numeric>

#include <Eigen/OrderingMethods>

#include "quadrig/solver/dissection.hpp"
#include "quadrig/solver/separator.hpp"

namespace quadrig {

namespace detail {

class Dissection {
 public:
  Dissection(const DissectionOptions& options, const Context& context) : options_(options), context_(context) {}

  void order(DissectionPiece piece, std::span<Index> out, unsigned threads) const {
    const Index n = piece.size();
    if (context_.cancelled()) {  // any order will do
      std::copy(piece.unknown.begin(), piece.unknown.end(), out.begin());
      return;
    }
    if (n <= options_.leaf) return n <= 300 ? order_leaf(piece, out) : order_by_degree(piece, out);
    std::vector<Index> part, visited;
    const Index parts = components(piece, part, visited);
    if (parts > 1) {
      std::vector<DissectionPiece> pieces = split(piece, part, parts);
      release(piece);
      std::size_t begin = 0;
      for (DissectionPiece& each : pieces) {
        const auto size = static_cast<std::size_t>(each.size());
        order(std::move(each), out.subspan(begin, size), threads);
        begin += size;
      }
      return;
    }
    std::vector<char> side;
    if (!bisect(piece, visited.back(), side)) return order_by_degree(piece, out);
    Index separator = 0;
    for (Index v = 0; v < n; ++v) {
      part[at(v)] = side[at(v)] == 2 ? no_index : side[at(v)];
      separator += side[at(v)] == 2 ? 1 : 0;
    }
    std::size_t last = out.size() - at(separator);
    for (Index v = 0; v < n; ++v)
      if (side[at(v)] == 2) out[last++] = piece.unknown[at(v)];
    std::vector<DissectionPiece> pieces = split(piece, part, 2);
    release(piece);
    const auto first = static_cast<std::size_t>(pieces[0].size()), second = static_cast<std::size_t>(pieces[1].size());
    if (threads > 1 && n > 5000) {
      const std::jthread other([&] { order(std::move(pieces[1]), out.subspan(first, second), threads / 2); });
      order(std::move(pieces[0]), out.subspan(0, first), threads - threads / 2);
    } else {
      order(std::move(pieces[0]), out.subspan(0, first), 1);
      order(std::move(pieces[1]), out.subspan(first, second), 1);
    }
  }

  // Numbers connected components; `visited` lists all vertices, the last one far from the first of its component.
  static Index components(const DissectionPiece& piece, std::vector<Index>& part, std::vector<Index>& visited) {
    const Index n = piece.size();
    part.assign(at(n), no_index);
    visited.clear();
    visited.reserve(at(n));
    Index count = 0;
    for (Index root = 0; root < n; ++root) {
      if (part[at(root)] != no_index) continue;
      part[at(root)] = count;
      visited.push_back(root);
      for (std::size_t k = visited.size() - 1; k < visited.size(); ++k)
        for (const Index u : piece.around(visited[k]))
          if (u < n && part[at(u)] == no_index) {
            part[at(u)] = count;
            visited.push_back(u);
          }
      ++count;
    }
    return count;
  }

  // The induced pieces; part no_index goes outside.
  static std::vector<DissectionPiece> split(const DissectionPiece& piece, std::span<const Index> part, Index parts) {
    const Index n = piece.size();
    std::vector<DissectionPiece> pieces(at(parts));
    std::vector<Index> local(at(n), no_index);
    for (Index v = 0; v < n; ++v)
      if (part[at(v)] != no_index) {
        DissectionPiece& own = pieces[at(part[at(v)])];
        local[at(v)] = own.size();
        own.unknown.push_back(piece.unknown[at(v)]);
        if (!piece.place.empty()) own.place.push_back(piece.place[at(v)]);
      }
    for (DissectionPiece& own : pieces) own.age = piece.age;
    std::vector<Index> mark(at(n) + at(piece.outside), no_index);  // number among the outside of the piece at hand
    std::vector<Index> owner(mark.size(), no_index);
    for (Index v = 0; v < n; ++v) {
      const Index p = part[at(v)];
      if (p == no_index) continue;
      DissectionPiece& own = pieces[at(p)];
      for (const Index u : piece.around(v)) {
        if (u < n && part[at(u)] == p) {
          own.neighbors.push_back(local[at(u)]);
          continue;
        }
        if (owner[at(u)] != p) {
          owner[at(u)] = p;
          mark[at(u)] = own.size() + own.outside++;
        }
        own.neighbors.push_back(mark[at(u)]);
      }
      own.starts.push_back(static_cast<Index>(own.neighbors.size()));
    }
    return pieces;
  }

  // Differences of distances to two pairs of far vertices are coordinates; of the lines in four directions through the
  // middle the one that crosses fewest edges says where the band lies.
  bool bisect(DissectionPiece& piece, Index far, std::vector<char>& side) const {
    const Index n = piece.size();
    if (piece.place.empty() || ++piece.age > coordinates_last) find_places(piece, far);

    const auto along = [](const std::array<Index, 2>& place, int direction) {
      return direction == 0 ? place[0] : direction == 1 ? place[1] : place[0] + (direction == 2 ? place[1] : -place[1]);
    };
    std::vector<Index> values(at(n));
    std::array<Index, 4> median{};
    for (int direction = 0; direction < 4; ++direction) {
      for (std::size_t v = 0; v < values.size(); ++v) values[v] = along(piece.place[v], direction);
      std::nth_element(values.begin(), values.begin() + n / 2, values.end());
      median[static_cast<std::size_t>(direction)] = values[at(n / 2)];
    }
    // Bit d of a vertex: it lies beyond the middle in direction d.
    std::vector<unsigned char> beyond(at(n));
    for (std::size_t v = 0; v < beyond.size(); ++v) {
      unsigned bits = 0;
      for (int d = 0; d < 4; ++d)
        bits |= (along(piece.place[v], d) < median[static_cast<std::size_t>(d)] ? 0u : 1u) << d;
      beyond[v] = static_cast<unsigned char>(bits);
    }
    std::array<std::size_t, 16> crossing{};
    for (Index v = 0; v < n; ++v)
      for (const Index u : piece.around(v))
        if (u < v) ++crossing[static_cast<std::size_t>(beyond[at(u)] ^ beyond[at(v)])];
    int chosen = 0;
    std::size_t fewest = std::numeric_limits<std::size_t>::max();
    for (int d = 0; d < 4; ++d) {
      std::size_t cut = 0;
      for (std::size_t bits = 0; bits < 16; ++bits) cut += (bits >> d & 1u) != 0 ? crossing[bits] : 0;
      if (cut < fewest) {
        fewest = cut;
        chosen = d;
      }
    }
    // Ties go by number, so that the band has its size.
    std::vector<std::int64_t> ranked(at(n));
    for (std::size_t v = 0; v < ranked.size(); ++v)
      ranked[v] = static_cast<std::int64_t>(along(piece.place[v], chosen)) * (std::int64_t{1} << 32) +
                  static_cast<std::int64_t>(v);
    const double slack = std::min(0.25, options_.slack * std::pow(1e4 / n, 0.25));
    const auto low = static_cast<std::ptrdiff_t>((0.5 - slack) * n);
    const auto high = static_cast<std::ptrdiff_t>((0.5 + slack) * n);
    std::nth_element(ranked.begin(), ranked.begin() + low, ranked.end());
    std::nth_element(ranked.begin() + low, ranked.begin() + high, ranked.end());
    const auto number = [&](std::ptrdiff_t k) {
      return static_cast<std::size_t>(ranked[static_cast<std::size_t>(k)] & 0xffffffff);
    };
    constexpr char first = 0, second = 1, inside = 2;
    std::vector<char> zone(at(n), inside);
    for (std::ptrdiff_t k = 0; k < low; ++k) zone[number(k)] = first;
    for (std::ptrdiff_t k = high; k < n; ++k) zone[number(k)] = second;
    for (Index v = 0; v < n; ++v)
      if (zone[at(v)] == first)
        for (const Index u : piece.around(v))
          if (u < n && zone[at(u)] == second) zone[at(v)] = inside;

    std::vector<Index> members;
    for (Index v = 0; v < n; ++v)
      if (zone[at(v)] == inside) {
        values[at(v)] = static_cast<Index>(members.size());
        members.push_back(v);
      }
    DissectionBand band;
    for (const Index v : members) {
      char touches = 0;
      for (const Index u : piece.around(v)) {
        if (u >= n) continue;
        if (zone[at(u)] == inside)
          band.neighbors.push_back(values[at(u)]);
        else
          touches = static_cast<char>(touches | (zone[at(u)] == first ? 1 : 2));
      }
      band.touches.push_back(touches);
      band.starts.push_back(static_cast<Index>(band.neighbors.size()));
    }
    VertexCut cut(band);
    cut.maximize();
    std::array<Index, 3> count{};
    for (const char each : zone) ++count[static_cast<std::size_t>(each)];
    const std::vector<char> found = cut.separate(count[0], count[1]);
    side = std::move(zone);
    for (std::size_t k = 0; k < members.size(); ++k) side[at(members[k])] = found[k];
    count = {};
    for (const char each : side) ++count[static_cast<std::size_t>(each)];
    return count[0] > 0 && count[1] > 0;
  }

 private:
  static std::size_t at(Index v) { return static_cast<std::size_t>(v); }
  static void release(DissectionPiece& piece) { piece = DissectionPiece(); }

  static Index distances(const DissectionPiece& piece, Index root, std::vector<Index>& distance,
                         std::vector<Index>& queue) {
    distance.assign(at(piece.size()), no_index);
    queue.clear();
    queue.push_back(root);
    distance[at(root)] = 0;
    for (std::size_t k = 0; k < queue.size(); ++k) {
      const Index next = distance[at(queue[k])] + 1;
      for (const Index u : piece.around(queue[k]))
        if (u < piece.size() && distance[at(u)] == no_index) {
          distance[at(u)] = next;
          queue.push_back(u);
        }
    }
    return queue.back();
  }

  static constexpr int coordinates_last = 2;

  // Differences of distances to two pairs of far vertices, one pair across the other.
  static void find_places(DissectionPiece& piece, Index far) {
    const auto n = at(piece.size());
    std::vector<Index> queue, a, b;
    queue.reserve(n);
    const Index opposite = distances(piece, far, a, queue);
    distances(piece, opposite, b, queue);
    piece.place.resize(n);
    Index middle = far, best = -1;
    for (std::size_t v = 0; v < n; ++v) {
      piece.place[v][0] = a[v] - b[v];
      const Index reach = std::min(a[v], b[v]);
      if (reach > best) {
        best = reach;
        middle = static_cast<Index>(v);
      }
    }
    const Index across = distances(piece, middle, a, queue);
    distances(piece, across, b, queue);
    for (std::size_t v = 0; v < n; ++v) piece.place[v][1] = a[v] - b[v];
    piece.age = 0;
  }

  // Minimum degree on sets of bits, counting neighbours outside.
  static void order_leaf(const DissectionPiece& piece, std::span<Index> out) {
    const Index n = piece.size();
    const auto words = static_cast<std::size_t>(n + piece.outside + 63) / 64;
    std::vector<std::uint64_t> sets(at(n) * words, 0);
    std::vector<Index> degree(at(n));
    const auto row = [&](Index v) { return sets.data() + at(v) * words; };
    const auto count = [&](Index v) {
      int total = 0;
      for (std::size_t w = 0; w < words; ++w) total += std::popcount(row(v)[w]);
      return static_cast<Index>(total);
    };
    for (Index v = 0; v < n; ++v) {
      for (const Index u : piece.around(v)) row(v)[at(u) / 64] |= std::uint64_t{1} << (at(u) % 64);
      degree[at(v)] = count(v);
    }
    std::vector<Index> left(at(n));
    std::iota(left.begin(), left.end(), Index{0});
    const auto inner_words = static_cast<std::size_t>(n + 63) / 64;
    for (std::size_t k = 0; k < out.size(); ++k) {
      std::size_t best = 0;
      for (std::size_t i = 1; i < left.size(); ++i)
        if (degree[at(left[i])] < degree[at(left[best])]) best = i;
      const Index v = left[best];
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
      out[k] = piece.unknown[at(v)];
      const std::uint64_t* const own = row(v);
      for (std::size_t w = 0; w < inner_words; ++w)
        for (std::uint64_t bits = own[w]; bits != 0; bits &= bits - 1) {
          const auto u = static_cast<Index>(64 * w + at(std::countr_zero(bits)));
          if (u >= n) break;
          std::uint64_t* const other = row(u);
          for (std::size_t i = 0; i < words; ++i) other[i] |= own[i];
          other[at(u) / 64] &= ~(std::uint64_t{1} << (at(u) % 64));
          other[at(v) / 64] &= ~(std::uint64_t{1} << (at(v) % 64));
          degree[at(u)] = count(u);
        }
    }
  }

  // Approximate minimum degree, the vertices outside among them for the fill that they see.
  static void order_by_degree(const DissectionPiece& piece, std::span<Index> out) {
    const Index n = piece.size(), all = n + piece.outside;
    std::vector<std::pair<Index, Index>> outer;
    std::vector<Index> starts{0}, rows;
    for (Index v = 0; v < n; ++v) {
      rows.push_back(v);
      for (const Index u : piece.around(v)) {
        rows.push_back(u);
        if (u >= n) outer.emplace_back(u, v);
      }
      std::sort(rows.begin() + starts.back(), rows.end());
      starts.push_back(static_cast<Index>(rows.size()));
    }
    std::sort(outer.begin(), outer.end());
    for (auto [each, u] = std::pair(outer.begin(), n); u < all; ++u) {
      for (; each != outer.end() && each->first == u; ++each) rows.push_back(each->second);
      rows.push_back(u);
      starts.push_back(static_cast<Index>(rows.size()));
    }
    Eigen::SparseMatrix<float, Eigen::ColMajor, Index> pattern(all, all);
    pattern.resizeNonZeros(static_cast<Eigen::Index>(rows.size()));
    std::copy(starts.begin(), starts.end(), pattern.outerIndexPtr());
    std::copy(rows.begin(), rows.end(), pattern.innerIndexPtr());
    std::fill_n(pattern.valuePtr(), rows.size(), 1.0f);
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> elimination;
    Eigen::AMDOrdering<Index>()(pattern, elimination);
    std::size_t k = 0;
    for (Eigen::Index i = 0; i < all; ++i)
      if (const Index v = elimination.indices()[i]; v < n) out[k++] = piece.unknown[at(v)];
  }

  const DissectionOptions& options_;
  const Context& context_;
};

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
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }

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
      const std::jthread other([&] { dissect(std::move(halves[1]), right, threads / 2); });
      dissect(std::move(halves[0]), left, threads - threads / 2);
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
  const bool large = size > 300'000;
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
