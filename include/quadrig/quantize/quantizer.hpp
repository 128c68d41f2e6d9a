// Moves on the integers of a coarse map that add or take one row of quads.
#pragma once

#include <numeric>

#include "quadrig/quantize/integer_edges.hpp"

namespace quadrig::detail {

class Quantizer : public IntegerEdges {
 public:
  /// \param rings of the map, which the energy asks to close: near_rings
  /// \param most effort that may be spent; beyond it every search gives up
  Quantizer(const CoarseMap& map, const std::vector<Index>& index, const std::vector<char>& on_border,
            const std::vector<Ring>& rings, double scale, std::int64_t most)
      : IntegerEdges(map, index, on_border, rings, scale), most_(most) {
    reached_.resize(at(4 * map.halfedge_count()));
  }

  /// Rounds at `sigma` times the wanted size and closes every triangle. False where that is not possible.
  bool start(double sigma, const Context& context) {
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
        if (stop(context) || !route_defect(f)) return false;
    return true;
  }

  /// Moves until no triangle is inverted, no move helps, or the work limit is reached.
  bool repair(const Context& context) {
    const std::int64_t enough = work_ + 2'000'000;
    for (int pass = 0; pass < 50; ++pass) {
      std::vector<Index> bad;
      for (Index f = 0; f < map_.face_count(); ++f)
        if (area(f) <= 0) bad.push_back(f);
      if (bad.empty()) return cones_right();
      bool improved = false;
      for (const Index f : bad) {
        if (area(f) > 0) continue;
        for (Index h = 3 * f; h < 3 * f + 3 && area(f) <= 0; ++h)
          for (int a = 0; a < 4 && area(f) <= 0; ++a) {
            if (work_ > enough || stop(context)) return false;
            improved = try_strip(h, a, Aim::repair) || improved;
          }
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
        if (work_ > enough || stop(context)) return moves + accepted;
        for (int a = 0; a < 4; ++a)
          while (change(h, a) < -1e-12 && try_strip(h, a, Aim::energy)) ++accepted;
      }
      moves += accepted;
      if (accepted == 0) break;
    }
    return moves;
  }

  /// Moves the rows that close rings where that is worth what it bends, those first that the map closes itself, and
  /// descends from there. \pre valid
  int close_rings(const Context& context) {
    std::vector<std::size_t> order(rings_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const bool one = rings_[a].closed(), other = rings_[b].closed();
      return one != other ? one : one && rings_[a].length > rings_[b].length;
    });
    int moves = 0;
    const std::int64_t enough = work_ + 3'000'000;
    for (int pass = 0; pass < 6; ++pass) {
      int accepted = 0;
      for (const std::size_t ring : order)
        for (int guard = 0; guard < 4 && pitch(ring) != 0; ++guard) {
          if (work_ > enough || stop(context)) return moves + accepted;
          if (!close_ring(ring, true) && !close_ring(ring, false) && !close_by_detour(ring)) break;
          ++accepted;
        }
      if (accepted == 0) break;
      moves += accepted + descend(context);
    }
    return moves;
  }

  /// Adds or takes the rows that bring the count nearer to the target for the least energy a quad, until it is within
  /// the tolerance or none does. \pre valid
  int steer(double target, double tolerance, const Context& context) {
    int moves = 0;
    const std::int64_t enough = work_ + 8'000'000;
    std::vector<char> taken;
    const auto missed = [&] {
      missing_ = target - quads();
      return std::abs(missing_) > tolerance * target;
    };
    for (int before = -1; before != moves && work_ < enough && missed();) {
      before = moves;
      offers_.clear();
      for (Index h = 0; h < map_.halfedge_count(); ++h) {
        if (stop(context)) return moves;
        if (map_.twin[at(h)] != no_index && map_.twin[at(h)] < h) continue;
        for (int a = 0; a < 4; ++a) {
          const Gaussian w = omega_[at(h)], d = axis(a);
          const std::int64_t longer = w.re * d.re + w.im * d.im;
          if (longer != 0 && (longer > 0) == (missing_ > 0)) try_strip(h, a, Aim::count);
        }
      }
      if (offers_.empty()) break;
      // Cheapest first; strips that share no vertex leave each other's price as it is.
      taken.assign(on_border_.size(), 0);
      for (const Offer& offer : offers_) {
        const auto vertices = [&](auto&& visit) {
          for (const Index f : offer.faces)
            for (Index h = 3 * f; h < 3 * f + 3; ++h) visit(taken[at(map_.origin[at(h)])]);
        };
        bool free = true;
        vertices([&](char& vertex) { free = free && !vertex; });
        if (!free || !(std::abs(missing_ - offer.quads) < std::abs(missing_) - 0.5)) continue;
        for (const auto& [h, delta] : offer.changes) set(h, omega_[at(h)] + delta);
        vertices([](char& vertex) { vertex = 1; });
        ++moves;
        if (!missed()) break;
      }
    }
    return moves;
  }

  /// Takes integers that were found before. \pre valid
  void resume(const std::vector<Gaussian>& edges) { omega_ = edges; }

  /// All integers with one row more through one of these faces, those first that cost least. \pre valid
  [[nodiscard]] std::vector<std::vector<Gaussian>> rows_through(std::span<const Index> faces, const Context& context) {
    missing_ = 1e9;
    offers_.clear();
    for (const Index f : faces)
      for (Index h = 3 * f; h < 3 * f + 3; ++h)
        for (int a = 0; a < 4; ++a)
          if (!stop(context)) try_strip(h, a, Aim::count);
    std::stable_sort(offers_.begin(), offers_.end(),
                     [](const Offer& x, const Offer& y) { return x.price * x.quads < y.price * y.quads; });
    const std::vector<Gaussian> before = omega_;
    std::vector<std::vector<Gaussian>> found;
    for (const Offer& offer : offers_) {
      for (const auto& [h, delta] : offer.changes) set(h, omega_[at(h)] + delta);
      found.push_back(std::exchange(omega_, before));
    }
    return found;
  }

  /// Nodes searched so far.
  [[nodiscard]] std::int64_t work() const { return work_; }
  /// Search nodes plus equivalent bookkeeping work.
  [[nodiscard]] std::int64_t effort() const { return work_ + beside_; }
  /// From now on up to this effort.
  void allow(std::int64_t most) { most_ = most; }

 private:
  static constexpr double broken = 1e6;  // dwarfs any energy
  /// What a strip is tried for. For the count it is only offered, for a detour whatever it costs taken.
  enum class Aim : std::uint8_t { repair, energy, count, detour };
  struct Strip {
    double price;
    std::vector<std::pair<Index, Gaussian>> changes;
  };
  struct Offer {
    double price, quads;  // energy a quad, and how many more quads
    std::vector<Index> faces;
    std::vector<std::pair<Index, Gaussian>> changes;
  };

  /// Keeps the strip at hand among the cheapest, once however often it is found.
  void offer(double price, double quads) {
    constexpr std::size_t most = 64;
    if (offers_.size() == most && !(price < offers_.back().price)) return;
    const auto same = std::find_if(offers_.begin(), offers_.end(), [&](const Offer& o) { return o.faces == touched_; });
    if (same != offers_.end()) {
      if (!(price < same->price)) return;
      offers_.erase(same);
    } else if (offers_.size() == most) {
      offers_.pop_back();
    }
    const auto place = std::upper_bound(offers_.begin(), offers_.end(), price,
                                        [](double value, const Offer& o) { return value < o.price; });
    offers_.insert(place, Offer{price, quads, touched_, changes_});
  }

  [[nodiscard]] bool stop(const Context& context) const { return effort() > most_ || context.cancelled(); }
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
        if (!forbidden(exit, b)) leave(exit, b, reached_[at(node)].price + passage(h, exit, b), node);
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
      expand(node / 4, node % 4, reached_[at(node)].price, node);
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
        expand(node / 4, node % 4, reached_[at(node)].price, node);
      }
      if (end == no_index) return false;
      spent = reached_[at(end)].price;
      gather_path(end);
    }
    return apply_if_better(aim);
  }

  /// Cheapest closed strips that change the pitch of a ring to 0, or by one towards it: the first that makes things
  /// better is kept. A search over pairs of state and change so far.
  bool close_ring(std::size_t ring, bool tolled) {
    const Index states = 4 * map_.halfedge_count();
    const std::int8_t* const effect = ring_effect_.data() + ring * at(states);
    const std::int64_t off = pitch(ring);
    const int sign = off > 0 ? -1 : 1;
    const int all = static_cast<int>(std::min<std::int64_t>(std::abs(off), 3));
    constexpr int most = 3, levels = 2 * most + 1;
    // Rings that are closed are not to be opened: crossing them costs what that would, though a strip may cross twice.
    std::vector<double> toll(at(states), 0);
    for (std::size_t other = 0; tolled && other < rings_.size(); ++other)
      if (other != ring && pitch(other) == 0)
        for (const auto& [node, crossings] : ring_crossings_[other]) toll[at(node)] += ring_weight_[other] * crossings;
    beside_ += static_cast<std::int64_t>(toll.size() * rings_.size() / 16);
    ring_reached_.resize(at(levels * states));
    std::vector<Strip> strips;
    // No dearer than what it can gain, nor much dearer than others.
    double budget = std::min(broken / 2, ring_weight_[ring] * static_cast<double>(off * off));
    for (const auto& step : rings_[ring].walk)
      for (int a = 0; a < 4; ++a) {
        const Index root = 4 * step.first + a;
        if (effect[root] * sign <= 0 || forbidden(step.first, a) || map_.twin[at(step.first)] == no_index) continue;
        if (effort() > most_) break;
        beside_ += levels * std::int64_t{states} / 32;
        begin_search();
        const auto expand = [&](Index node, int level, double so_far, Index key) {
          const Index entry = node / 4;
          for (const Index exit : {next(entry), prev(entry)}) {
            const Index g = map_.twin[at(exit)];
            if (g == no_index || forbidden(exit, node % 4)) continue;
            const Index reached = 4 * g + ((node + map_.rotation[at(exit)]) & 3);
            const double price = so_far + passage(entry, exit, node % 4) + toll[at(reached)];
            const int there = level + (reached == root ? 0 : effect[reached]);
            if (price > budget || there < -most || there > most) continue;
            const Index slot = (there + most) * states + reached;
            reach(ring_reached_, slot, price, key);
          }
        };
        expand(root, effect[root], 0, no_index);
        int wanted = all > 1 ? 2 : 1;
        while (wanted > 0) {
          const Index key = pop(ring_reached_);
          if (key == no_index) break;
          const double price = ring_reached_[at(key)].price;
          const Index node = key % states;
          const int level = static_cast<int>(key / states) - most;
          if (node != root) {
            expand(node, level, price, key);
          } else if (level == sign || level == sign * all) {
            --wanted;
            Strip strip{price, {}};
            for (Index k = key; k != no_index; k = ring_reached_[at(k)].from)
              strip.changes.push_back({k % states / 4, axis(k % states % 4)});
            budget = std::min(budget, 2 * price + 0.1);
            strips.push_back(std::move(strip));
          }
        }
      }
    std::stable_sort(strips.begin(), strips.end(), [](const Strip& x, const Strip& y) { return x.price < y.price; });
    for (Strip& strip : strips) {
      changes_ = strip.changes;
      if (apply_if_better(Aim::energy)) return true;
    }
    detours_ = std::move(strips);
    return false;
  }

  /// Closes a ring that the map closes by a strip that opens others, and these again.
  /// \pre close_ring found no way for it, crossing others freely
  bool close_by_detour(std::size_t ring) {
    if (!rings_[ring].closed()) return false;
    constexpr std::size_t most = 4;
    const std::vector<Gaussian> before = omega_;
    const double energy_before = whole_energy();
    std::vector<Strip> ways = std::exchange(detours_, {});
    for (std::size_t way = 0; way < std::min(most, ways.size()); ++way) {
      changes_ = ways[way].changes;
      if (!apply_if_better(Aim::detour)) continue;
      for (bool again = true; again && effort() <= most_;) {
        again = false;
        for (std::size_t other = 0; other < rings_.size(); ++other)
          if (rings_[other].closed() && other != ring && pitch(other) != 0)
            again = close_ring(other, true) || close_ring(other, false) || again;
      }
      if (whole_energy() < energy_before - 1e-9) return true;
      omega_ = before;
    }
    return false;
  }
  [[nodiscard]] double whole_energy() const {
    double total = spirals();
    for (Index h = 0; h < map_.halfedge_count(); ++h) total += cost(h, omega_[at(h)]);
    return total;
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
  struct Reached {
    double price = 0;
    Index from = no_index;
    std::uint32_t search = 0;  // the last that came here
  };
  void begin_search() {
    ++search_;
    queue_.clear();
  }
  void reach(std::vector<Reached>& reached, Index node, double price, Index from) {
    Reached& there = reached[at(node)];
    if (there.search == search_ && there.price <= price) return;
    there = {price, from, search_};
    queue_.emplace_back(price, node);
    std::push_heap(queue_.begin(), queue_.end(), std::greater<>());
  }
  /// The cheapest node that is left; no_index at the end.
  [[nodiscard]] Index pop(const std::vector<Reached>& reached) {
    while (!queue_.empty()) {
      std::pop_heap(queue_.begin(), queue_.end(), std::greater<>());
      const auto [price, node] = queue_.back();
      queue_.pop_back();
      ++work_;
      if (price <= reached[at(node)].price) return node;
    }
    return no_index;
  }
  void leave(Index exit, int a, double price, Index node) {
    const Index g = map_.twin[at(exit)];
    const Index reached = g == no_index ? 4 * exit + ((a + 2) & 3) : 4 * g + ((a + map_.rotation[at(exit)]) & 3);
    reach(reached_, reached, price, node);
  }
  [[nodiscard]] Index pop() { return pop(reached_); }
  [[nodiscard]] bool open_end(Index node) const { return map_.twin[at(node / 4)] == no_index; }

  void gather_path(Index end) {
    for (Index node = end; node != no_index; node = reached_[at(node)].from)
      changes_.push_back({node / 4, axis(node % 4)});
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
    beside_ += static_cast<std::int64_t>(touched_.size() + rings_.size());
    const auto bad = [&] {
      return std::count_if(touched_.begin(), touched_.end(), [&](Index f) { return area(f) <= 0; });
    };
    const auto energy_of_touched = [&] {
      double total = 0;
      for (const Index f : touched_)
        for (Index h = 3 * f; h < 3 * f + 3; ++h) total += cost(h, omega_[at(h)]);
      return total + spirals();
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
    double price = 0, more = 0;
    bool good = bad_after < bad_before;
    if (aim == Aim::detour) good = bad_after == 0;
    if (aim == Aim::energy) good = bad_after == 0 && energy_of_touched() < before - 1e-9;
    if (aim == Aim::count) {
      more = area_of_touched() - area_before;
      const double gained = std::abs(missing_) - std::abs(missing_ - more);
      price = (energy_of_touched() - before) / gained;
      good = bad_after == 0 && gained > 0.5;
    }
    if (good && aim != Aim::repair)
      for (const Index f : touched_)
        for (Index h = 3 * f; h < 3 * f + 3 && good; ++h) good = cone_right(h);
    if (good && aim == Aim::count) {
      offer(price, more);
    } else if (good) {
      return true;
    }
    std::size_t k = 0;
    for (const Index f : touched_)
      for (Index h = 3 * f; h < 3 * f + 3; ++h) omega_[at(h)] = saved_[k++];
    return false;
  }

  std::vector<Reached> reached_, ring_reached_;  // per search node; per level and search node
  std::vector<Gaussian> saved_;
  std::vector<Index> touched_;
  std::uint32_t search_ = 0;
  int border_known_ = 0;
  std::vector<std::pair<Index, Gaussian>> changes_;
  std::vector<Strip> detours_;  // the last that closed their ring but were not worth it
  std::vector<Offer> offers_;   // the cheapest first
  double missing_ = 0;          // quads
  std::int64_t work_ = 0;       // nodes searched, which bounds what a map of very many cones may cost
  std::int64_t beside_ = 0, most_;
  std::vector<std::pair<double, Index>> queue_;  // price and node, a heap with the cheapest first
};

}  // namespace quadrig::detail
