// Integers that cannot collapse: edge vectors in Z[i] on the coarse map, every triangle positive and every cone right.
#pragma once

#include "quadrig/quantize/coarse_map.hpp"

namespace quadrig {

struct QuantizeOptions {
  double target_quads = 2000;
  double tolerance = 0.05;  ///< of the count
  int rounds = 9;           ///< rescalings towards the count; the closest is kept
};

/// Integer edge vectors on a coarse map: opposite-consistent, closed over every triangle, positively oriented.
struct Quantization {
  std::vector<Gaussian> edge;  ///< per coarse half-edge, in the chart of its face
  double quads = 0;            ///< Σ det / 2: exact count of the quads to come
  double start_scale = 1;      ///< factor at which rounding became valid
  double energy = 0;           ///< Σ |ω − d|² / |d|²
  int moves = 0;
};

namespace detail {

/// The state of one quantization: integer vectors, and moves that add or take one row of quads.
class Quantizer {
 public:
  Quantizer(const CoarseMap& map, const std::vector<Index>& index, const std::vector<char>& on_border, double scale)
      : map_(map), index_(index), on_border_(on_border) {
    const Index n = map.halfedge_count();
    wanted_.resize(at(n));
    weight_.resize(at(n));
    omega_.assign(at(n), Gaussian{});
    for (Index h = 0; h < n; ++h) {
      wanted_[at(h)] = scale * map.vector[at(h)];
      weight_[at(h)].fill(relative(h));
    }
    weigh_shear();
    distance_.assign(at(4 * n), 0);
    from_.assign(at(4 * n), no_index);
    stamp_.assign(at(4 * n), 0);
  }

  /// Rounds at `sigma` times the wanted size and closes every triangle. False where that is not possible.
  bool start(double sigma) {
    for (Index h = 0; h < map_.halfedge_count(); ++h) {
      if (map_.twin[at(h)] != no_index && map_.twin[at(h)] < h) continue;
      const Complex d = sigma * wanted_[at(h)];
      Gaussian w{std::llround(d.real()), std::llround(d.imag())};
      if (map_.aligned[at(h)] == Aligned::v_constant) w.im = 0;
      if (map_.aligned[at(h)] == Aligned::u_constant) w.re = 0;
      if (ring_zero(w)) {
        if (std::abs(d.real()) >= std::abs(d.imag()))
          w = {d.real() < 0 ? -1 : 1, 0};
        else
          w = {0, d.imag() < 0 ? -1 : 1};
      }
      set(h, w);
    }
    for (Index f = 0; f < map_.face_count(); ++f)
      while (!ring_zero(sum(f)))
        if (!route_defect(f)) return false;
    return true;
  }

  /// Moves until no triangle is inverted, or none helps.
  bool repair() {
    for (int pass = 0; pass < 50; ++pass) {
      std::vector<Index> bad;
      for (Index f = 0; f < map_.face_count(); ++f)
        if (area(f) <= 0) bad.push_back(f);
      if (bad.empty()) return cones_right();
      bool improved = false;
      for (const Index f : bad) {
        if (area(f) > 0) continue;
        for (Index h = 3 * f; h < 3 * f + 3 && area(f) <= 0; ++h)
          for (int a = 0; a < 4 && area(f) <= 0; ++a) improved = try_strip(h, a, Aim::repair) || improved;
      }
      if (!improved) return false;
    }
    return false;
  }

  /// Adds and takes rows while the energy falls. \pre valid
  int descend(const Context& context) {
    int moves = 0;
    const std::int64_t enough = work_ + 8'000'000;
    for (int pass = 0; pass < 200; ++pass) {
      int accepted = 0;
      for (Index h = 0; h < map_.halfedge_count(); ++h) {
        if (context.cancelled() || work_ > enough) return moves + accepted;
        for (int a = 0; a < 4; ++a)
          while (change(h, a) < -1e-12 && try_strip(h, a, Aim::energy)) ++accepted;
      }
      moves += accepted;
      if (accepted == 0) break;
    }
    return moves;
  }

  /// Adds or takes the rows that bring the count nearer to the target for the least energy a quad, until it is within
  /// the tolerance or none does. \pre valid
  int steer(double target, double tolerance, const Context& context) {
    int moves = 0;
    const std::int64_t enough = work_ + 8'000'000;
    for (; moves < 24 && work_ < enough && std::abs(quads() / target - 1) > tolerance; ++moves) {
      missing_ = target - quads();
      best_price_ = std::numeric_limits<double>::infinity();
      best_changes_.clear();
      for (Index h = 0; h < map_.halfedge_count(); ++h) {
        if (context.cancelled()) return moves;
        if (map_.twin[at(h)] != no_index && map_.twin[at(h)] < h) continue;
        for (int a = 0; a < 4; ++a) {
          const Gaussian w = omega_[at(h)], d = axis(a);
          const std::int64_t longer = w.re * d.re + w.im * d.im;
          if (longer != 0 && (longer > 0) == (missing_ > 0)) try_strip(h, a, Aim::count);
        }
      }
      if (best_changes_.empty()) break;
      for (const auto& [h, delta] : best_changes_) set(h, omega_[at(h)] + delta);
    }
    return moves;
  }

  [[nodiscard]] bool cones_right() const {
    for (Index h = 0; h < map_.halfedge_count(); ++h)
      if (!cone_right(h)) return false;
    return true;
  }
  [[nodiscard]] double quads() const {
    double total = 0;
    for (Index f = 0; f < map_.face_count(); ++f) total += static_cast<double>(area(f));
    return total / 2;
  }
  /// Σ of the squared relative errors alone.
  [[nodiscard]] double energy() const {
    double total = 0;
    for (Index h = 0; h < map_.halfedge_count(); ++h)
      if (map_.twin[at(h)] == no_index || map_.twin[at(h)] > h)
        total += relative(h) * std::norm(to_field(omega_[at(h)]) - wanted_[at(h)]);
    return total;
  }
  /// Dirichlet energy of the change over all triangles, what turns edges counted more. No matter of the size of quads.
  [[nodiscard]] double distortion() const {
    double total = 0;
    for (Index f = 0; f < map_.face_count(); ++f) {
      const Complex a = wanted_[at(3 * f)], b = wanted_[at(3 * f + 1)];
      const double det = cross(a, b);
      if (!(det > 1e-9)) continue;
      const Complex ea = to_field(omega_[at(3 * f)]) - a, eb = to_field(omega_[at(3 * f + 1)]) - b;
      const auto slope = [&](double along_a, double along_b) {
        return std::pair{(along_a * b.imag() - along_b * a.imag()) / det,
                         (along_b * a.real() - along_a * b.real()) / det};
      };
      const auto [xx, xy] = slope(ea.real(), eb.real());
      const auto [yx, yy] = slope(ea.imag(), eb.imag());
      total += det / 2 * (xx * xx + yy * yy + turning * (xy * xy + yx * yx));
    }
    return total;
  }
  /// Nodes searched so far.
  [[nodiscard]] std::int64_t work() const { return work_; }
  [[nodiscard]] const std::vector<Gaussian>& edges() const { return omega_; }

 private:
  static constexpr double broken = 1e6;  // dwarfs any energy
  static constexpr double turning = 4;   // what turns edges against what stretches them
  /// What a strip is tried for. For the count it is only remembered where it is the best so far.
  enum class Aim : std::uint8_t { repair, energy, count };

  [[nodiscard]] static Gaussian axis(int a) { return rotated(Gaussian{1, 0}, a); }
  [[nodiscard]] static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  [[nodiscard]] static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }

  [[nodiscard]] double relative(Index h) const { return 1 / std::max(std::norm(wanted_[at(h)]), 1e-4); }
  /// Next to the relative error of each edge a part of the Dirichlet energy of the change. There what turns the edges
  /// of quads counts more than what stretches them: where the ends of a limb's long edges are off by one row, its rings
  /// become spirals.
  void weigh_shear() {
    constexpr double part = 0.05;
    std::vector<std::array<double, 2>> cotangent(weight_.size(), {0, 0});
    for (Index h = 0; h < map_.halfedge_count(); ++h) {
      const Complex a = -wanted_[at(next(h))], b = wanted_[at(prev(h))];
      const double area = 2 * std::max(std::abs(cross(a, b)), 1e-9);
      const double x = a.real() * b.real() / area, y = a.imag() * b.imag() / area;
      const std::array<double, 2> own{turning * x + y, x + turning * y};
      cotangent[at(h)][0] += own[0];
      cotangent[at(h)][1] += own[1];
      if (const Index g = map_.twin[at(h)]; g != no_index) {
        const bool odd = (map_.rotation[at(h)] & 1) != 0;
        cotangent[at(g)][0] += own[odd];
        cotangent[at(g)][1] += own[!odd];
      }
    }
    for (std::size_t h = 0; h < weight_.size(); ++h)
      for (int c = 0; c < 2; ++c) weight_[h][c] += part * std::clamp(cotangent[h][c], 0.05, 3 * turning);
  }

  void set(Index h, Gaussian w) {
    omega_[at(h)] = w;
    if (const Index g = map_.twin[at(h)]; g != no_index) omega_[at(g)] = -rotated(w, map_.rotation[at(h)]);
  }
  [[nodiscard]] Gaussian sum(Index f) const {
    return omega_[at(3 * f)] + omega_[at(3 * f + 1)] + omega_[at(3 * f + 2)];
  }
  [[nodiscard]] std::int64_t area(Index f) const { return cross(omega_[at(3 * f)], omega_[at(3 * f + 1)]); }
  [[nodiscard]] double cost(Index h, Gaussian w) const {
    const Complex off = to_field(w) - wanted_[at(h)];
    const auto& [x, y] = weight_[at(h)];
    return x * off.real() * off.real() + y * off.imag() * off.imag();
  }
  /// Energy that ω_h + i^a adds.
  [[nodiscard]] double change(Index h, int a) const {
    return cost(h, omega_[at(h)] + axis(a)) - cost(h, omega_[at(h)]);
  }
  [[nodiscard]] bool forbidden(Index h, int a) const {
    const Aligned aligned = map_.aligned[at(h)];
    if (aligned == Aligned::none) return false;
    return (aligned == Aligned::v_constant) == ((a & 1) != 0);
  }
  [[nodiscard]] bool cone_right(Index h) const {
    constexpr double half_pi = 1.57079632679489661923;
    const Index v = map_.origin[at(h)];
    Index start = h;
    if (on_border_[at(v)])
      while (map_.twin[at(start)] != no_index) start = next(map_.twin[at(start)]);
    double total = 0;
    Index e = start;
    do {
      total += std::arg(to_field(-omega_[at(prev(e))]) * std::conj(to_field(omega_[at(e)])));
      e = map_.twin[at(prev(e))];
    } while (e != no_index && e != start);
    const double wanted = (on_border_[at(v)] ? 2 : 4) - index_[at(v)];
    return std::abs(total / half_pi - wanted) < 0.5;
  }

  /// Price of passing through a face: +i^a on `entry`, −i^a on `exit`.
  [[nodiscard]] double passage(Index entry, Index exit, int a) const {
    const Gaussian in = omega_[at(entry)] + axis(a), out = omega_[at(exit)] - axis(a);
    if (ring_zero(out)) return 10 * broken;
    // `exit` is next or previous; two of the three vectors give the area of a closed triangle.
    const std::int64_t after = exit == next(entry) ? cross(in, out) : cross(out, in);
    double price = std::max(0.0, cost(exit, out) - cost(exit, omega_[at(exit)]));
    if (after <= 0 && area(entry / 3) > 0) price += broken;
    return price + 1e-9;
  }

  /// Sends one unit of the defect of face f to a face where it cancels.
  bool route_defect(Index f) {
    const Gaussian defect = sum(f);
    const int a = defect.re != 0 ? (defect.re > 0 ? 0 : 2) : (defect.im > 0 ? 1 : 3);
    begin_search();
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      if (forbidden(h, a)) continue;
      const Gaussian out = omega_[at(h)] - axis(a);
      leave(h, a, ring_zero(out) ? 10 * broken : std::max(0.0, cost(h, out) - cost(h, omega_[at(h)])), no_index);
    }
    for (Index node = pop(); node != no_index; node = pop()) {
      const Index h = node / 4, g = h / 3;
      const int b = node % 4;
      const Gaussian there = g == f ? sum(g) - axis(a) : sum(g);
      if (open_end(node) || rotated(there, -b).re < 0) {
        apply_path(node);
        return true;
      }
      for (const Index exit : {next(h), prev(h)})
        if (!forbidden(exit, b)) leave(exit, b, distance_[at(node)] + passage(h, exit, b), node);
    }
    return false;
  }

  /// Cheapest closed (or border to border) strip through +i^a on h; kept when it makes things better.
  bool try_strip(Index h, int a, Aim aim) {
    if (forbidden(h, a)) return false;
    const Index goal = 4 * h + a;
    const double start_change = change(h, a);
    const double budget = aim == Aim::repair   ? std::numeric_limits<double>::infinity()
                          : aim == Aim::energy ? std::min(broken / 2, -3 * start_change)
                                               : broken / 2;
    begin_search();
    // Forward from the face of h; on the border the strip is completed on the other side afterwards.
    const auto expand = [&](Index entry, int b, double so_far, Index node) {
      for (const Index exit : {next(entry), prev(entry)}) {
        if (forbidden(exit, b)) continue;
        const double price = so_far + passage(entry, exit, b);
        if (price > budget) continue;
        leave(exit, b, price, node);
      }
    };
    const bool border_start = map_.twin[at(h)] == no_index;
    expand(h, a, 0, no_index);
    Index end = no_index;
    for (Index node = pop(); node != no_index; node = pop()) {
      if (node == goal || (border_start && open_end(node))) {
        end = node;
        break;
      }
      if (open_end(node)) continue;
      expand(node / 4, node % 4, distance_[at(node)], node);
    }
    if (end == no_index && !border_start && has_border()) return try_open_strip(h, a, aim, budget);
    if (end == no_index) return false;
    changes_.clear();
    if (border_start) changes_.push_back({h, axis(a)});
    gather_path(end);
    return apply_if_better(aim);
  }

  /// A strip through h whose two ends lie on the border: forward from h, then forward from its twin.
  bool try_open_strip(Index h, int a, Aim aim, double budget) {
    changes_.clear();
    changes_.push_back({h, axis(a)});
    const Index g = map_.twin[at(h)];
    const int b = (a + 2 + map_.rotation[at(h)]) & 3;  // what the twin receives: −i^r i^a
    double spent = 0;
    for (const auto& [entry, direction] : {std::pair{h, a}, std::pair{g, b}}) {
      begin_search();
      const auto expand = [&](Index in, int c, double so_far, Index node) {
        for (const Index exit : {next(in), prev(in)}) {
          if (forbidden(exit, c)) continue;
          const double price = so_far + passage(in, exit, c);
          if (price <= budget) leave(exit, c, price, node);
        }
      };
      expand(entry, direction, spent, no_index);
      Index end = no_index;
      for (Index node = pop(); node != no_index; node = pop()) {
        if (open_end(node)) {
          end = node;
          break;
        }
        expand(node / 4, node % 4, distance_[at(node)], node);
      }
      if (end == no_index) return false;
      spent = distance_[at(end)];
      gather_path(end);
    }
    return apply_if_better(aim);
  }

  [[nodiscard]] bool has_border() {
    if (border_known_ == 0) {
      border_known_ = 1;
      for (const Index g : map_.twin)
        if (g == no_index) border_known_ = 2;
    }
    return border_known_ == 2;
  }

  // Search nodes are 4 t + a: ω_t has just received +i^a from across. An exit through the border is the node of the
  // border half-edge itself, marked by `leave` with the direction reversed.
  void begin_search() {
    ++search_;
    queue_ = {};
  }
  void leave(Index exit, int a, double price, Index node) {
    const Index g = map_.twin[at(exit)];
    const Index reached = g == no_index ? 4 * exit + ((a + 2) & 3) : 4 * g + ((a + map_.rotation[at(exit)]) & 3);
    if (stamp_[at(reached)] == search_ && distance_[at(reached)] <= price) return;
    stamp_[at(reached)] = search_;
    distance_[at(reached)] = price;
    from_[at(reached)] = node;
    queue_.push({price, reached});
  }
  [[nodiscard]] Index pop() {
    while (!queue_.empty()) {
      const auto [price, node] = queue_.top();
      queue_.pop();
      ++work_;
      if (price <= distance_[at(node)]) return node;
    }
    return no_index;
  }
  [[nodiscard]] bool open_end(Index node) const { return map_.twin[at(node / 4)] == no_index; }

  void gather_path(Index end) {
    for (Index node = end; node != no_index; node = from_[at(node)]) changes_.push_back({node / 4, axis(node % 4)});
  }
  void apply_path(Index end) {
    changes_.clear();
    gather_path(end);
    for (const auto& [h, delta] : changes_) set(h, omega_[at(h)] + delta);
  }

  bool apply_if_better(Aim aim) {
    // Several passes through one edge add up, so the true effect is known only after all are applied.
    touched_.clear();
    for (const auto& [h, delta] : changes_) {
      touched_.push_back(h / 3);
      if (const Index g = map_.twin[at(h)]; g != no_index) touched_.push_back(g / 3);
    }
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
    const auto bad = [&] {
      return std::count_if(touched_.begin(), touched_.end(), [&](Index f) { return area(f) <= 0; });
    };
    const auto energy_of_touched = [&] {
      double total = 0;
      for (const Index f : touched_)
        for (Index h = 3 * f; h < 3 * f + 3; ++h) total += cost(h, omega_[at(h)]);
      return total;
    };
    const auto area_of_touched = [&] {
      std::int64_t total = 0;
      for (const Index f : touched_) total += area(f);
      return static_cast<double>(total) / 2;
    };
    const auto bad_before = bad();
    const double before = energy_of_touched(), area_before = area_of_touched();
    saved_.clear();
    for (const Index f : touched_)
      for (Index h = 3 * f; h < 3 * f + 3; ++h) saved_.push_back(omega_[at(h)]);
    for (const auto& [h, delta] : changes_) set(h, omega_[at(h)] + delta);
    const auto bad_after = bad();
    double price = 0;
    bool good = bad_after < bad_before;
    if (aim == Aim::energy) good = bad_after == 0 && energy_of_touched() < before - 1e-9;
    if (aim == Aim::count) {
      const double gained = std::abs(missing_) - std::abs(missing_ - (area_of_touched() - area_before));
      price = (energy_of_touched() - before) / gained;
      good = bad_after == 0 && gained > 0.5 && price < best_price_;
    }
    if (good && aim != Aim::repair)
      for (const Index f : touched_)
        for (Index h = 3 * f; h < 3 * f + 3 && good; ++h) good = cone_right(h);
    if (good && aim == Aim::count) {
      best_price_ = price;
      best_changes_ = changes_;
    } else if (good) {
      return true;
    }
    std::size_t k = 0;
    for (const Index f : touched_)
      for (Index h = 3 * f; h < 3 * f + 3; ++h) omega_[at(h)] = saved_[k++];
    return false;
  }

  const CoarseMap& map_;
  const std::vector<Index>& index_;
  const std::vector<char>& on_border_;
  std::vector<Complex> wanted_;
  std::vector<std::array<double, 2>> weight_;  // of the squared error of both components
  std::vector<Gaussian> omega_, saved_;
  std::vector<double> distance_;
  std::vector<Index> from_, touched_;
  std::vector<std::uint32_t> stamp_;
  std::uint32_t search_ = 0;
  int border_known_ = 0;
  std::vector<std::pair<Index, Gaussian>> changes_, best_changes_;
  double missing_ = 0, best_price_ = 0;
  std::int64_t work_ = 0;  // nodes searched, which bounds what a map of very many cones may cost
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

}  // namespace detail

/// Quantizes a coarse map at the size that gives `target_quads`.
/// \fails stage_failed where no start is valid at any size tried.
/// \cost a Dijkstra search a row moved, on the coarse map only.
[[nodiscard]] inline Expected<Quantization> quantize(const CoarseMap& map, const std::vector<Index>& index,
                                                     const std::vector<char>& on_border, const QuantizeOptions& options,
                                                     Context& context) {
  double map_area = 0;
  for (Index f = 0; f < map.face_count(); ++f)
    map_area += cross(map.vector[detail::at(3 * f)], map.vector[detail::at(3 * f + 1)]) / 2;
  double scale = std::sqrt(options.target_quads / map_area);
  std::optional<Quantization> best;
  std::optional<detail::Quantizer> kept;
  std::pair<double, double> best_rank;
  double below = 0, above = 0;  // scales that gave too few and too many
  int waited = 0;
  for (int round = 0; round < options.rounds && waited < 4; ++round) {
    detail::Quantizer quantizer(map, index, on_border, scale);
    double sigma = 1;
    bool valid = false;
    // Other sizes near round otherwise; from one far off the rows that are taken again seldom lead back to rings.
    constexpr std::array<double, 8> near{1, 0.98, 1.02, 0.96, 1.04, 1.08, 1.13, 1.2};
    for (std::size_t k = 0; k < near.size() + 15 && !valid; ++k) {
      if (context.cancelled()) return cancelled_error("quantization");
      if (k > 0 && k < near.size() && quantizer.work() > 1'000'000) continue;  // each search is long: far off at once
      sigma = k < near.size() ? near[k] : sigma * 1.4142135623730951;
      valid = quantizer.start(sigma) && quantizer.repair();
    }

    if (!valid) {
      if (best) break;
      return Error{ErrorCode::stage_failed, "no valid integers found at any size", "quantization",
                   "ask for more quads"};
    }
    Quantization result;
    result.moves = quantizer.descend(context);
    result.quads = quantizer.quads();
    result.start_scale = sigma;
    const double quads = result.quads, miss = std::abs(quads / options.target_quads - 1);
    ++waited;
    // Of counts that are near enough the integers that bend the map the least, else the nearest count.
    const std::pair rank{miss > 0.6 * options.tolerance ? miss : 0.0, quantizer.distortion()};
    if (!best || rank < best_rank) {
      best = std::move(result);
      best_rank = rank;
      kept.emplace(std::move(quantizer));
      waited = 0;
    }
    if (miss < options.tolerance / 4) break;
    if (miss > 0.5 && waited > 1) break;  // the surface has its own mind about the count
    // Towards the count; halfway between two sizes that miss it on either side where that leads past one of them.
    (quads < options.target_quads ? below : above) = scale;
    const double low = std::min(below, above), high = std::max(below, above);
    if (low > 0 && high < 1.001 * low) break;
    scale *= std::sqrt(options.target_quads / quads);
    if (low > 0 && !(scale > 1.001 * low && 1.001 * scale < high)) scale = std::sqrt(low * high);
  }
  if (std::abs(best->quads / options.target_quads - 1) > options.tolerance / 2)
    best->moves += kept->steer(options.target_quads, options.tolerance / 2, context);
  best->edge = kept->edges();
  best->quads = kept->quads();
  best->energy = kept->energy();
  return *best;
}

}  // namespace quadrig
