// Nested dissection vertex by vertex: cuts of a piece of a graph, and orders of its leaves.
#pragma once

#include <bit>
#include <numeric>

#include "quadrig/solver/dissection.hpp"
#include "quadrig/solver/minimum_degree.hpp"
#include "quadrig/solver/separator.hpp"

namespace quadrig::detail {

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
      detail::side_by_side([&] { order(std::move(pieces[0]), out.subspan(0, first), threads - threads / 2); },
                           [&] { order(std::move(pieces[1]), out.subspan(first, second), threads / 2); });
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
    const double slack = std::min(0.25, options_.slack * std::sqrt(std::sqrt(1e4 / n)));
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
    std::vector<Index> starts{0}, rows;
    for (Index v = 0; v < n; ++v) {
      rows.push_back(v);
      for (const Index u : piece.around(v))
        if (u > v) rows.push_back(u);
      std::sort(rows.begin() + starts.back(), rows.end());
      starts.push_back(static_cast<Index>(rows.size()));
    }
    for (Index u = n; u < all; ++u) {
      rows.push_back(u);
      starts.push_back(static_cast<Index>(rows.size()));
    }
    std::size_t k = 0;
    for (const Index v : minimum_degree(all, starts, rows))
      if (v < n) out[k++] = piece.unknown[at(v)];
  }

  const DissectionOptions& options_;
  const Context& context_;
};

}  // namespace quadrig::detail
