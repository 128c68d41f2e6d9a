// Rows, single quads and edges that go.
#include "coarsen.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>

#include "quadrig/quads.hpp"
#include "quadrig/simplify/decimate.hpp"

namespace quadrig::gltf {
namespace {

using quadrig::detail::Quadric;
using quadrig::detail::triangle_quality;

class Coarsener {
  // Of the quadric's weights: what a vertex's own place is worth, a unit of area; lines, by the square of their length.
  static constexpr double place_weight = 3e-4, border_weight = 4, seam_weight = 1;
  static constexpr double least_cosine = 0.35;    // between a face's normals before and after
  static constexpr double least_jacobian = 0.15;  // of a quad, or 0.9 of what it was
  static constexpr double least_triangle = 0.05;  // triangle_quality, likewise
  static constexpr double straight_enough = 1.5;  // a row closes to one side as long as that costs no more than this

 public:
  Coarsener(std::span<const Polygon> polygons, const Wedges& wedges, const PosedPoints& points,
            const CoarsenOptions& options, const std::vector<char>& locked)
      : options_(options), of_(wedges), polygons_(polygons.begin(), polygons.end()), alive_(polygons.size(), 1) {
    std::map<Index, Index> number;
    for (Polygon& p : polygons_)
      for (std::size_t i = 0; i < p.size(); ++i) {
        const auto [place, is_new] = number.try_emplace(p.vertex[i], static_cast<Index>(global_.size()));
        if (is_new) global_.push_back(p.vertex[i]);
        p.vertex[i] = place->second;
      }
    const std::size_t n = global_.size();
    for (std::size_t k = 0; k < points.places.size(); ++k) {
      Points<double> own(static_cast<Eigen::Index>(n), 3);
      for (std::size_t v = 0; v < n; ++v) own.row(static_cast<Eigen::Index>(v)) = points.places[k].row(global_[v]);
      places_.push_back(std::move(own));
    }
    locked_.assign(n, 0);
    if (!locked.empty())
      for (std::size_t v = 0; v < n; ++v) locked_[v] = locked[at(global_[v])];
    around_.resize(n);
    line_.resize(n);
    dirty_.assign(n, 0);
    for (std::size_t p = 0; p < polygons_.size(); ++p)
      for (std::size_t i = 0; i < polygons_[p].size(); ++i)
        around_[at(polygons_[p].vertex[i])].push_back(static_cast<Index>(p));
    triangles_ = gltf::triangle_count(polygons_);
    find_sides();
    find_lines();
    make_quadrics(points.weight);
  }

  void run(const Context& context) {
    for (const Keeps keeps : {Keeps::normals, Keeps::seams, Keeps::primitives, Keeps::hardly_shapes}) {
      if (keeps != keeps_) {
        keeps_ = keeps;
        find_sides();
        find_lines();
      }
      reduce(context);
      if (triangles_ <= options_.triangles + std::max<Index>(2, options_.triangles / 30)) break;
    }
  }

  [[nodiscard]] std::vector<Polygon> result() const {
    std::vector<Polygon> list;
    for (std::size_t p = 0; p < polygons_.size(); ++p) {
      if (!alive_[p]) continue;
      Polygon& polygon = list.emplace_back(polygons_[p]);
      for (std::size_t i = 0; i < polygon.size(); ++i) polygon.vertex[i] = global_[at(polygon.vertex[i])];
    }
    return list;
  }

 private:
  /// Which lines no vertex leaves: all, those of seams and borders, those of borders alone.
  /// With the last, shapes are kept no better than valid.
  enum class Keeps : std::uint8_t { normals, seams, primitives, hardly_shapes };

  void reduce(const Context& context) {
    bool all = false;
    while (triangles_ > options_.triangles && !context.cancelled()) {
      find_sides();
      find_operations();
      std::stable_sort(operations_.begin(), operations_.end(),
                       [](const Operation& a, const Operation& b) { return a.cost < b.cost; });
      double limit = std::numeric_limits<double>::infinity(), gone = 0;
      const double wanted = 0.4 * (triangles_ - options_.triangles);
      if (!all)
        for (const Operation& o : operations_)
          if ((gone += o.removes) >= wanted) {
            limit = o.cost;
            break;
          }
      std::fill(dirty_.begin(), dirty_.end(), 0);
      Index applied = 0;
      for (const Operation& o : operations_) {
        if (o.cost > limit || triangles_ <= options_.triangles) break;
        if (o.removes > triangles_ - options_.triangles + std::max<Index>(1, options_.triangles / 50)) continue;
        applied += apply(o);
      }
      if (applied == 0 && all) break;
      all = applied == 0;
    }
  }

  struct Side {
    Index low, high, polygon;
    std::size_t corner;
  };
  struct Merge {
    Index from, to;
  };
  struct Operation {
    double cost;  // a triangle
    Index removes;
    std::size_t first, count;  // of merges_
  };

  [[nodiscard]] Vector3 point(Index v, std::size_t pose = 0) const { return places_[pose].row(v).transpose(); }
  [[nodiscard]] static Vector3 area_normal(const Polygon& p, const Points<double>& places) {
    const auto x = [&](std::size_t i) { return Vector3(places.row(p.vertex[i]).transpose()); };
    return p.size() == 3 ? Vector3((x(1) - x(0)).cross(x(2) - x(0)) / 2)
                         : Vector3((x(2) - x(0)).cross(x(3) - x(1)) / 2);
  }

  void find_sides() {
    sides_.clear();
    for (std::size_t p = 0; p < polygons_.size(); ++p) {
      if (!alive_[p]) continue;
      const Polygon& polygon = polygons_[p];
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const auto [low, high] = std::minmax(polygon.vertex[i], polygon.vertex[(i + 1) % polygon.size()]);
        sides_.push_back({low, high, static_cast<Index>(p), i});
      }
    }
    std::sort(sides_.begin(), sides_.end(), [](const Side& a, const Side& b) {
      return std::array{a.low, a.high, a.polygon} < std::array{b.low, b.high, b.polygon};
    });
    across_.assign(4 * polygons_.size(), no_index);
    for (std::size_t s = 0; s + 1 < sides_.size(); ++s) {
      const Side &a = sides_[s], &b = sides_[s + 1];
      if (a.low != b.low || a.high != b.high) continue;
      across_[4 * at(a.polygon) + a.corner] = 4 * b.polygon + static_cast<Index>(b.corner);
      across_[4 * at(b.polygon) + b.corner] = 4 * a.polygon + static_cast<Index>(a.corner);
    }
  }

  /// Across an edge: another primitive, other wedges, or nothing.
  [[nodiscard]] bool is_line(std::size_t p, std::size_t i) const {
    const Index other = across_[4 * p + i];
    if (other == no_index) return true;
    const Polygon &a = polygons_[p], &b = polygons_[at(other / 4)];
    const auto j = static_cast<std::size_t>(other % 4);
    if (a.primitive != b.primitive) return true;
    if (keeps_ >= Keeps::primitives) return false;
    const auto same = [&](Index one, Index two) {
      return one == two || (keeps_ == Keeps::seams && of_.joined(one, two));
    };
    return !same(a.wedge[i], b.wedge[(j + 1) % b.size()]) || !same(a.wedge[(i + 1) % a.size()], b.wedge[j]);
  }

  void find_lines() {
    for (std::vector<Index>& line : line_) line.clear();
    for (std::size_t p = 0; p < polygons_.size(); ++p)
      for (std::size_t i = 0; alive_[p] && i < polygons_[p].size(); ++i) {
        const Index a = polygons_[p].vertex[i], b = polygons_[p].vertex[(i + 1) % polygons_[p].size()];
        const Index other = across_[4 * p + i];
        if ((other != no_index && at(other / 4) < p) || !is_line(p, i)) continue;
        line_[at(a)].push_back(b);
        line_[at(b)].push_back(a);
      }
  }

  void make_quadrics(const std::vector<double>& weight) {
    quadrics_.assign(places_.size(), std::vector<Quadric>(global_.size()));
    for (std::size_t k = 0; k < places_.size(); ++k)
      for (std::size_t p = 0; p < polygons_.size(); ++p) {
        const Polygon& polygon = polygons_[p];
        const std::size_t size = polygon.size();
        const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
          const Vector3 x = point(polygon.vertex[a], k),
                        n = (point(polygon.vertex[b], k) - x).cross(point(polygon.vertex[c], k) - x);
          const double area = n.norm() / 2;
          if (!(area > 0)) return;
          for (const std::size_t i : {a, b, c}) {
            Quadric& q = quadrics_[k][at(polygon.vertex[i])];
            q.add_plane(n / (2 * area), x, weight[k] * area);
            q.add_point(point(polygon.vertex[i], k), weight[k] * area * place_weight);
          }
        };
        add(0, 1, 2);
        if (size == 4) add(0, 2, 3);
        const Vector3 n = area_normal(polygon, places_[k]);
        for (std::size_t i = 0; i < size; ++i) {
          if (!is_line(p, i)) continue;
          const Index v = polygon.vertex[i], w = polygon.vertex[(i + 1) % size];
          const Vector3 along = point(w, k) - point(v, k), side = along.cross(n);
          const double length = side.norm();
          if (!(length > 0)) continue;
          const double share =
              weight[k] * along.squaredNorm() * (across_[4 * p + i] == no_index ? border_weight : seam_weight);
          for (const Index end : {v, w}) quadrics_[k][at(end)].add_plane(side / length, point(v, k), share);
        }
      }
  }

  /// Whether the lines allow it: a vertex on one goes along it alone, and no line closes to two edges.
  [[nodiscard]] bool leaves_lines(Index from, Index to, bool along_edge) const {
    if (locked_[at(from)]) return false;
    const std::vector<Index>& line = line_[at(from)];
    if (line.empty()) return true;
    if (line.size() != 2 || !along_edge || (line[0] != to && line[1] != to)) return false;
    const Index other = line[0] == to ? line[1] : line[0];
    const std::vector<Index>& beyond = line_[at(to)];
    return other != to && std::find(beyond.begin(), beyond.end(), other) == beyond.end();
  }

  /// What the squared distances grow by, or infinity where a line does not let the vertex go.
  [[nodiscard]] double cost(Index from, Index to, bool along_edge) const {
    if (!leaves_lines(from, to, along_edge)) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const Quadric& q = quadrics_[k][at(from)];
      sum += std::max(0.0, q(point(to, k)) - q(point(from, k)));
    }
    return sum;
  }

  void find_operations() {
    operations_.clear();
    merges_.clear();
    if (options_.rows) {
      find_rows();
      find_single_quads();
    }
    find_edges();
  }

  void add_operation(double cost, Index removes, std::initializer_list<Merge> merges) {
    if (!(cost < std::numeric_limits<double>::infinity())) return;
    operations_.push_back({cost / removes, removes, merges_.size(), merges.size()});
    merges_.insert(merges_.end(), merges);
  }

  /// Rows of quads, from one border or triangle to another or round to where they began.
  void find_rows() {
    std::vector<char> seen(2 * polygons_.size(), 0);
    in_row_.assign(global_.size(), 0);
    Index row = 0;
    std::vector<std::array<Index, 2>> rungs;
    for (std::size_t p = 0; p < polygons_.size(); ++p) {
      if (!alive_[p] || polygons_[p].size() != 4) continue;
      for (std::size_t d = 0; d < 2; ++d) {
        if (seen[2 * p + d]) continue;
        ++row;
        rungs.clear();
        Index quads = 0, ends = 0;
        bool sound = true, closed = false;
        // Forward from side d + 2, then backward from side d; sides of a rung are kept on their side of the row.
        seen[2 * p + d] = 1;
        ++quads;
        for (const bool forward : {true, false}) {
          std::size_t side = forward ? d + 2 : d, q = p;
          while (true) {
            const Polygon& polygon = polygons_[q];
            const Index a = polygon.vertex[side], b = polygon.vertex[(side + 1) % 4];
            rungs.push_back(forward ? std::array{b, a} : std::array{a, b});
            const Index other = across_[4 * q + side];
            if (other == no_index) break;
            q = at(other / 4);
            if (polygons_[q].size() == 3) {
              ++ends;
              break;
            }
            const auto entered = static_cast<std::size_t>(other % 4);
            if (q == p && entered % 2 == d) {
              closed = true;
              break;
            }
            if (seen[2 * q + entered % 2]) {
              sound = false;
              break;
            }
            seen[2 * q + entered % 2] = 1;
            ++quads;
            side = (entered + 2) % 4;
          }
          if (closed || !sound) break;
        }
        if (sound) add_row(rungs, row, 2 * quads + ends);
      }
    }
  }

  void add_row(const std::vector<std::array<Index, 2>>& rungs, Index row, Index removes) {
    for (const auto& rung : rungs)
      for (const Index v : rung) {
        if (in_row_[at(v)] == row) return;  // it crosses itself or turns on a vertex
        in_row_[at(v)] = row;
      }
    double sum[2] = {0, 0}, mixed = 0;
    std::vector<char> way;
    for (const auto& [a, b] : rungs) {
      const double forth = cost(a, b, true), back = cost(b, a, true);
      sum[0] += forth;
      sum[1] += back;
      mixed += std::min(forth, back);
      way.push_back(forth <= back ? 0 : 1);
    }
    if (!(mixed < std::numeric_limits<double>::infinity())) return;
    const int better = sum[0] <= sum[1] ? 0 : 1;
    const bool straight = sum[better] <= straight_enough * mixed;
    operations_.push_back({(straight ? sum[better] : mixed) / removes, removes, merges_.size(), rungs.size()});
    for (std::size_t k = 0; k < rungs.size(); ++k) {
      const int w = straight ? better : way[k];
      merges_.push_back(w == 0 ? Merge{rungs[k][0], rungs[k][1]} : Merge{rungs[k][1], rungs[k][0]});
    }
  }

  /// Sides of polygons at a vertex less those that a regular one has.
  [[nodiscard]] Index excess(Index v) const {
    bool border = false;
    for (const Index p : around_[at(v)]) {
      const std::size_t size = polygons_[at(p)].size(), i = polygons_[at(p)].corner(v);
      border = border || across_[4 * at(p) + i] == no_index || across_[4 * at(p) + (i + size - 1) % size] == no_index;
    }
    return static_cast<Index>(around_[at(v)].size()) - (border ? 2 : 4);
  }

  /// Opposite corners of a quad meet.
  void find_single_quads() {
    for (std::size_t p = 0; p < polygons_.size(); ++p) {
      if (!alive_[p] || polygons_[p].size() != 4) continue;
      const std::array<Index, 4>& v = polygons_[p].vertex;
      Index e[4];
      for (std::size_t i = 0; i < 4; ++i) e[i] = excess(v[i]);
      for (std::size_t i = 0; i < 2; ++i) {
        const Index a = e[i], b = e[i + 1], c = e[i + 2], d = e[(i + 3) % 4];
        // Both ends together have two polygons less, and four less are due to them.
        const Index before = std::abs(a) + std::abs(b) + std::abs(c) + std::abs(d),
                    after = std::abs(a + c + 2) + std::abs(b - 1) + std::abs(d - 1);
        const double factor = 1 + options_.irregular_cost * std::max<Index>(0, after - before);
        const double forth = cost(v[i], v[i + 2], false), back = cost(v[i + 2], v[i], false);
        if (forth <= back)
          add_operation(factor * forth, 2, {{v[i], v[i + 2]}});
        else
          add_operation(factor * back, 2, {{v[i + 2], v[i]}});
      }
    }
  }

  /// Edges with triangles on all sides.
  void find_edges() {
    for (std::size_t p = 0; p < polygons_.size(); ++p) {
      if (!alive_[p] || polygons_[p].size() != 3) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        const Index other = across_[4 * p + i];
        if (other != no_index && (at(other / 4) < p || polygons_[at(other / 4)].size() != 3)) continue;
        const Index a = polygons_[p].vertex[i], b = polygons_[p].vertex[(i + 1) % 3];
        const double forth = cost(a, b, true), back = cost(b, a, true);
        const Index removes = other == no_index ? 1 : 2;
        if (forth <= back)
          add_operation(forth, removes, {{a, b}});
        else
          add_operation(back, removes, {{b, a}});
      }
    }
  }

  // What an operation changed, to undo it.
  struct Journal {
    std::map<Index, std::pair<Polygon, char>> polygons;
    std::map<Index, std::pair<std::vector<Index>, std::vector<Index>>> vertices;  // around, line
    std::map<Index, std::vector<Quadric>> quadrics;
    Index triangles = 0;
  };
  Polygon& change(Index p) {
    journal_.polygons.try_emplace(p, polygons_[at(p)], alive_[at(p)]);
    return polygons_[at(p)];
  }
  void change_vertex(Index v) { journal_.vertices.try_emplace(v, around_[at(v)], line_[at(v)]); }

  void drop(Index p) {
    Polygon& polygon = change(p);
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      change_vertex(polygon.vertex[i]);
      std::erase(around_[at(polygon.vertex[i])], p);
    }
    alive_[at(p)] = 0;
    triangles_ -= static_cast<Index>(polygon.size()) - 2;
  }

  /// Of the wedges at a vertex in the polygon's primitive the one most like another, or none.
  [[nodiscard]] Index likest(const Polygon& polygon, Index wedge, Index at_vertex) const {
    Index best = no_index;
    double least = std::numeric_limits<double>::infinity();
    for (const Index p : around_[at(at_vertex)]) {
      const Polygon& other = polygons_[at(p)];
      if (other.primitive != polygon.primitive) continue;
      const Index candidate = other.wedge[other.corner(at_vertex)];
      const double difference = of_.difference(candidate, wedge, polygon.primitive);
      if (difference < least) least = difference, best = candidate;
    }
    return best;
  }

  bool merge(Index from, Index to) {
    if (around_[at(from)].empty() || around_[at(to)].empty() || !leaves_lines(from, to, true)) return false;
    change_vertex(from);
    change_vertex(to);
    std::vector<std::array<Index, 2>> wedges;  // of `from`, of `to`
    for (const Index p : around_[at(from)]) {
      const Polygon& polygon = polygons_[at(p)];
      const std::size_t i = polygon.corner(from), j = polygon.corner(to);
      if (j == polygon.size()) continue;
      const std::array<Index, 2> pair{polygon.wedge[i], polygon.wedge[j]};
      for (const auto& known : wedges)
        if (known[0] == pair[0] && known[1] != pair[1] && keeps_ == Keeps::normals) return false;
      wedges.push_back(pair);
    }
    const std::vector<Index> old = around_[at(from)];
    for (const Index p : old) {
      Polygon& polygon = change(p);
      const std::size_t size = polygon.size(), i = polygon.corner(from), j = polygon.corner(to);
      if (j < size) {
        if (size == 3 || (i + 2) % 4 == j) {
          drop(p);
          continue;
        }
        for (std::size_t k = i; k + 1 < 4; ++k)
          polygon.vertex[k] = polygon.vertex[k + 1], polygon.wedge[k] = polygon.wedge[k + 1];
        polygon.vertex[3] = polygon.wedge[3] = no_index;
        --triangles_;
        continue;
      }
      const auto found =
          std::find_if(wedges.begin(), wedges.end(), [&](const auto& w) { return w[0] == polygon.wedge[i]; });
      const Index wedge = found != wedges.end() ? (*found)[1] : likest(polygon, polygon.wedge[i], to);
      if (wedge == no_index) return false;
      polygon.vertex[i] = to;
      polygon.wedge[i] = wedge;
      around_[at(to)].push_back(p);
    }
    around_[at(from)].clear();
    if (!line_[at(from)].empty()) {
      const Index other = line_[at(from)][0] == to ? line_[at(from)][1] : line_[at(from)][0];
      change_vertex(other);
      std::replace(line_[at(other)].begin(), line_[at(other)].end(), from, to);
      std::replace(line_[at(to)].begin(), line_[at(to)].end(), from, other);
      line_[at(from)].clear();
    }
    for (std::size_t k = 0; k < places_.size(); ++k) {
      std::vector<Quadric>& kept = journal_.quadrics[to];
      if (kept.size() <= k) kept.push_back(quadrics_[k][at(to)]);
      quadrics_[k][at(to)].add(quadrics_[k][at(from)]);
    }
    return true;
  }

  /// The polygons round a vertex are one fan, and inside there are three of them at least.
  [[nodiscard]] bool one_fan(Index v) const {
    const std::vector<Index>& own = around_[at(v)];
    if (own.empty()) return true;
    // Each polygon leaves v towards one neighbour and comes back from another.
    const auto out = [&](Index p) {
      const Polygon& polygon = polygons_[at(p)];
      return polygon.vertex[(polygon.corner(v) + 1) % polygon.size()];
    };
    const auto in = [&](Index p) {
      const Polygon& polygon = polygons_[at(p)];
      return polygon.vertex[(polygon.corner(v) + polygon.size() - 1) % polygon.size()];
    };
    Index first = own[0];
    for (const Index p : own) {
      bool preceded = false;
      for (const Index q : own) {
        preceded = preceded || in(q) == out(p);
        if (q != p && (out(q) == out(p) || in(q) == in(p))) return false;
      }
      if (!preceded) first = p;
    }
    Index now = first;
    for (std::size_t steps = 1; steps < own.size(); ++steps) {
      const auto next = std::find_if(own.begin(), own.end(), [&](Index q) { return out(q) == in(now); });
      if (next == own.end() || *next == first) return false;
      now = *next;
    }
    const bool closed = in(now) == out(first);
    return !closed || own.size() >= 3;
  }

  [[nodiscard]] bool sound(const Polygon& was, const Polygon& is) const {
    for (std::size_t i = 0; i < is.size(); ++i)
      for (std::size_t j = i + 1; j < is.size(); ++j)
        if (is.vertex[i] == is.vertex[j]) return false;
    const Vector3 before = area_normal(was, places_[0]), after = area_normal(is, places_[0]);
    const bool any_shape = keeps_ == Keeps::hardly_shapes;
    if (!(after.dot(before) > (any_shape ? 0 : least_cosine) * after.norm() * before.norm())) return false;
    if (is.size() == 3) {
      const auto quality = [&](const Polygon& t) {
        return triangle_quality(point(t.vertex[0]), point(t.vertex[1]), point(t.vertex[2]));
      };
      return quality(is) >= (any_shape         ? 1e-3
                             : was.size() == 3 ? std::min(least_triangle, 0.9 * quality(was))
                                               : least_triangle);
    }
    const auto jacobian = [&](const Polygon& q) {
      return scaled_jacobian(places_[0],
                             Eigen::Matrix<Index, 1, 4>(q.vertex[0], q.vertex[1], q.vertex[2], q.vertex[3]));
    };
    return jacobian(is) >= (any_shape ? 1e-2 : std::max(1e-3, std::min(least_jacobian, 0.9 * jacobian(was))));
  }

  bool apply(const Operation& o) {
    const std::span<const Merge> merges(merges_.data() + o.first, o.count);
    for (const Merge& m : merges)
      if (dirty_[at(m.from)] || dirty_[at(m.to)]) return false;
    journal_ = {};
    journal_.triangles = triangles_;
    bool good = true;
    for (const Merge& m : merges)
      if (!(good = merge(m.from, m.to))) break;
    for (auto it = journal_.polygons.begin(); good && it != journal_.polygons.end(); ++it) {
      if (!alive_[at(it->first)]) continue;
      good = sound(it->second.first, polygons_[at(it->first)]);
    }
    good = good && triangles_ >= 2;
    std::vector<Index> touched;
    if (good)
      for (const auto& [p, was] : journal_.polygons)
        for (std::size_t i = 0; i < was.first.size(); ++i) touched.push_back(was.first.vertex[i]);
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    for (std::size_t k = 0; good && k < touched.size(); ++k) good = one_fan(touched[k]);
    if (!good) {
      for (auto& [p, was] : journal_.polygons) polygons_[at(p)] = was.first, alive_[at(p)] = was.second;
      for (auto& [v, was] : journal_.vertices)
        around_[at(v)] = std::move(was.first), line_[at(v)] = std::move(was.second);
      for (auto& [v, was] : journal_.quadrics)
        for (std::size_t k = 0; k < was.size(); ++k) quadrics_[k][at(v)] = was[k];
      triangles_ = journal_.triangles;
      return false;
    }
    for (const Index v : touched) dirty_[at(v)] = 1;
    return true;
  }

  const CoarsenOptions& options_;
  const Wedges& of_;
  Keeps keeps_ = Keeps::normals;
  std::vector<Polygon> polygons_;  // their vertices numbered here
  std::vector<char> alive_;
  std::vector<Index> global_;  // of the surface, of each vertex
  std::vector<Points<double>> places_;
  std::vector<std::vector<Quadric>> quadrics_;  // a pose, a vertex
  std::vector<std::vector<Index>> around_;      // polygons of each vertex
  std::vector<std::vector<Index>> line_;        // neighbours along lines: none inside, two on a line
  std::vector<char> locked_, dirty_;
  std::vector<Index> in_row_;
  std::vector<Side> sides_;
  std::vector<Index> across_;  // 4 p + side: the same of the polygon across, or no_index
  std::vector<Operation> operations_;
  std::vector<Merge> merges_;
  Journal journal_;
  Index triangles_ = 0;
};

}  // namespace

std::vector<Polygon> coarsened(std::span<const Polygon> polygons, const Wedges& wedges, const PosedPoints& points,
                               const CoarsenOptions& options, const std::vector<char>& locked, const Context& context) {
  Coarsener coarsener(polygons, wedges, points, options, locked);
  coarsener.run(context);
  return coarsener.result();
}

}  // namespace quadrig::gltf
