#pragma once

#include <queue>

#include "quadrig/field/surgery.hpp"

namespace quadrig {

QUADRIG_INLINE Status FieldSurgery::repair(const RepairOptions& options, const Context& context) {
  constexpr double apart = 0.75, crowded = 2, quads_each = 20;
  straight_ = options.straight;
  split_extremes(apart * options.edge, context);
  if (context.cancelled()) return cancelled_error("surgery");
  // Pairs farther apart shape the limbs: they are cancelled only where singularities are too many for the quads.
  cancel_pairs(apart * options.edge, crowded * options.edge, options.quads / quads_each);
  if (context.cancelled()) return cancelled_error("surgery");
  if (options.needless_reach > 0) cancel_needless(options.needless_reach, context);
  if (context.cancelled()) return cancelled_error("surgery");
  return {};
}

QUADRIG_INLINE bool FieldSurgery::repair_near(std::span<const Index> faces, double edge, const Context& context) {
  if (!cancel_near(faces)) return false;
  constexpr double apart = 0.75;
  split_extremes(apart * edge, context);
  return true;
}

QUADRIG_INLINE void FieldSurgery::move_unit(Index h) {
  constexpr double quarter = std::numbers::pi / 2;
  const Index g = mesh_.twin(h);
  ++field_.matching.r[at(h)];
  --field_.matching.r[at(g)];
  for (std::vector<double>* angle : {&field_.matching.rho, &change_}) {
    (*angle)[at(h)] -= quarter;
    (*angle)[at(g)] += quarter;
  }
  --field_.singularities.index4[at(mesh_.origin(h))];
  ++field_.singularities.index4[at(mesh_.target(h))];
  ++moves_;
}

QUADRIG_INLINE Index FieldSurgery::split_extremes(double spread, const Context& context) {
  Index split = 0;
  ScaleEnergy energy(mesh_, factory_, context);
  // Each is a few solves to place; so many are noise, wherever they go.
  constexpr Index most = 50;
  Index extreme = 0;
  for (Index v = 0; v < mesh_.vertex_count(); ++v) extreme += interior(v) && index(v) > 1;
  for (Index v = 0; v < mesh_.vertex_count(); ++v) {
    if (v % 1024 == 0 && context.cancelled()) break;
    if (mesh_.outgoing(v) == no_index) continue;
    if (mesh_.on_boundary(v)) {
      while (index(v) > (straight(v) ? 0 : 1) && relieve(v, spread)) ++split;
      while (index(v) < -2 && supply(v, spread)) ++split;
      continue;
    }
    if (index(v) > 1 && extreme <= most) split += scatter(v, spread, energy);
    if (index(v) > 2) {  // side by side they would be as much of a tip as before
      std::vector<Index> spokes = spokes_around(v, index(v));
      if (static_cast<Index>(spokes.size()) < index(v)) spokes.resize(std::min(spokes.size(), at(index(v) - 1)));
      for (const Index h : spokes) move_unit(h);
      split += static_cast<Index>(spokes.size());
    }
    for (int guard = 0; guard < 8 && index(v) > 1; ++guard, ++split) {
      const Index h = best_step(v, [&](Index w) { return index(w); });
      if (h == no_index) break;
      move_unit(h);
    }
    for (int guard = 0; guard < 8 && index(v) < -3; ++guard, ++split) {
      const Index h = best_step(v, [&](Index w) { return -index(w); });
      if (h == no_index) break;
      move_unit(mesh_.twin(h));
    }
  }
  return split;
}

QUADRIG_INLINE Index FieldSurgery::cancel_pairs(double length, double crowded, double enough) {
  Index cancelled = 0, singular = 0;
  for (Index v = 0; v < mesh_.vertex_count(); ++v) singular += interior(v) && index(v) != 0;
  const double reach = singular > enough ? std::max(length, crowded) : length;
  for (const Pair& pair : opposite_pairs(reach)) {
    if (pair.length >= length && singular <= enough) break;
    if (!(index(pair.plus) > 0 && index(pair.minus) < 0 && cancel(pair.plus, pair.minus))) continue;
    ++cancelled;
    singular -= (index(pair.plus) == 0) + (index(pair.minus) == 0);
  }
  return cancelled;
}

QUADRIG_INLINE Index FieldSurgery::cancel_needless(double reach, const Context& context) {
  constexpr std::int64_t most_work = 1'000'000;  // solves times vertices
  std::vector<Pair> pairs = opposite_pairs(reach);
  // E = ρᵀ G ρ: a cancelled pair adds a dipole to the load ρ, and all that takes is G between singularities.
  std::vector<Index> ends;
  const auto number = [&](Index v) {
    return static_cast<std::size_t>(std::find(ends.begin(), ends.end(), v) - ends.begin());
  };
  std::size_t kept = 0;
  for (; kept < pairs.size(); ++kept) {
    for (const Index v : {pairs[kept].plus, pairs[kept].minus})
      if (number(v) == ends.size()) ends.push_back(v);
    if (static_cast<std::int64_t>(ends.size()) * mesh_.vertex_count() > most_work) break;
  }
  pairs.resize(kept);
  if (pairs.empty()) return 0;
  ScaleEnergy energy(mesh_, factory_, context);
  const auto only_ends = [&](const std::vector<double>& whole) {
    std::vector<double> part;
    for (const Index v : ends) part.push_back(whole[at(v)]);
    return part;
  };
  std::vector<double> load = energy.load(field_.singularities.index4), response;
  if (!energy.respond(load, response)) return 0;
  std::vector<double> at_ends = only_ends(response);
  std::vector<std::vector<double>> between;
  for (const Index v : ends) {
    load.assign(load.size(), 0.0);
    load[at(v)] = 1;
    if (!energy.respond(load, response)) return 0;
    between.push_back(only_ends(response));
  }
  constexpr double quarter = std::numbers::pi / 2;
  for (Index cancelled = 0;; ++cancelled) {
    double least = 0;
    const Pair* best = nullptr;
    for (const Pair& pair : pairs) {
      if (!(index(pair.plus) > 0 && index(pair.minus) < 0)) continue;
      const std::size_t p = number(pair.plus), m = number(pair.minus);
      const double change = 2 * quarter * (at_ends[p] - at_ends[m]) +
                            quarter * quarter * (between[p][p] + between[m][m] - between[p][m] - between[m][p]);
      if (!(change < least)) continue;
      least = change;
      best = &pair;
    }
    if (!best || !cancel(best->plus, best->minus)) return cancelled;
    const std::size_t p = number(best->plus), m = number(best->minus);
    for (std::size_t k = 0; k < at_ends.size(); ++k) at_ends[k] += quarter * (between[p][k] - between[m][k]);
  }
}

QUADRIG_INLINE bool FieldSurgery::cancel_near(std::span<const Index> faces) {
  std::vector<Index> seeds;
  for (const Index f : faces)
    for (int i = 0; i < 3; ++i) seeds.push_back(mesh_.faces()(f, i));
  std::sort(seeds.begin(), seeds.end());
  seeds.erase(std::unique(seeds.begin(), seeds.end()), seeds.end());
  std::vector<Index> near;
  bool plus = false, minus = false;
  search(seeds, std::numeric_limits<double>::infinity(), [&](Index w, double) {
    if (interior(w) && index(w) != 0) {
      near.push_back(w);
      (index(w) > 0 ? plus : minus) = true;
    }
    return near.size() >= 8 && plus && minus;
  });
  if (!plus || !minus) return false;
  double closest = std::numeric_limits<double>::infinity();
  Index from = no_index, to = no_index;
  for (const Index v : near)
    if (index(v) > 0)
      search({v}, std::numeric_limits<double>::infinity(), [&](Index w, double d) {
        if (d >= closest) return true;
        if (interior(w) && index(w) < 0 && std::find(near.begin(), near.end(), w) != near.end()) {
          closest = d;
          from = v;
          to = w;
          return true;
        }
        return false;
      });
  return from != no_index && cancel(from, to);
}

QUADRIG_INLINE Status FieldSurgery::apply(const std::vector<char>& held, Context& context) {
  if (moves_ == 0) return {};
  moves_ = 0;
  const Index m = mesh_.face_count();
  QuadraticForm<double> form(m);
  bool pinned = false;
  for (Index f = 0; f < m; ++f)
    if (!held.empty() && held[at(f)]) {
      form.fix(f, 0.0);
      pinned = true;
    }
  if (turned_.empty()) turned_.assign(at(m), 0.0);
  const auto asked = [&](Index f) {
    return field_.pull.empty() ? 0.0 : field_.pull[at(f)] * mesh_.area(f) / (reach_ * reach_);
  };
  double asking = 0;
  for (Index f = 0; f < m; ++f) asking += asked(f);
  if (!pinned && !(asking > 1e-6)) form.fix(0, 0.0);
  const RowTerm turn{"turn", [&](EmitRow<double> emit) {
                       for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
                         const Index g = mesh_.twin(h);
                         if (g < h) continue;
                         const std::array<Index, 2> where{h / 3, g / 3};
                         const std::array<double, 2> factor{1, -1};
                         const double weight =
                             mesh_.edge_vector(h).squaredNorm() / (mesh_.area(h / 3) + mesh_.area(g / 3));
                         emit({where, factor, -change_[at(h)], std::clamp(weight, 1e-3, 1e3)});
                       }
                       const double one = 1;
                       for (Index f = 0; f < m; ++f)
                         emit({std::span(&f, 1), std::span(&one, 1), -turned_[at(f)], asked(f)});
                     }};
  if (Status status = form.assemble(context, turn); !status.ok()) return status;
  Expected<AnySolver<double>> solver = factory_();
  if (!solver) return solver.error();
  if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status.ok()) return status;
  std::vector<double> free_values(at(form.free_count()));
  backend_ = solver->description();
  if (SolveInfo info = solver->solve(form.rhs(), free_values, context); !info.status.ok()) return info.status;
  const std::vector<double> delta = form.expand(free_values);
  std::fill(change_.begin(), change_.end(), 0.0);
  for (Index f = 0; f < m; ++f) {
    turned_[at(f)] += delta[at(f)];
    const Complex rotation = elementary::polar(1.0, delta[at(f)]);
    field_.frames.u[at(f)] *= rotation;
    field_.frames.v[at(f)] *= rotation;
    if (field_.polynomial.x0.empty()) continue;
    const Complex squared = rotation * rotation;  // x1 = −(u² + v²), x0 = u² v²
    field_.polynomial.x1[at(f)] *= squared;
    field_.polynomial.x0[at(f)] *= squared * squared;
  }
  for (Index h = 0; h < mesh_.halfedge_count(); ++h)
    if (const Index g = mesh_.twin(h); g != no_index) field_.matching.rho[at(h)] += delta[at(h / 3)] - delta[at(g / 3)];
  field_.singularities.plus = field_.singularities.minus = 0;
  for (Index v = 0; v < mesh_.vertex_count(); ++v)
    if (interior(v) && index(v) != 0) ++(index(v) > 0 ? field_.singularities.plus : field_.singularities.minus);
  field_.singularities.boundary = 0;
  for (Index v = 0; v < mesh_.vertex_count(); ++v)
    field_.singularities.boundary += mesh_.outgoing(v) != no_index && mesh_.on_boundary(v) && index(v) != 0;
  FieldReport& report = field_.report;
  report.singularities_plus = field_.singularities.plus;
  report.singularities_minus = field_.singularities.minus;
  report.singularities_boundary = field_.singularities.boundary;
  return {};
}

QUADRIG_INLINE std::vector<FieldSurgery::Pair> FieldSurgery::opposite_pairs(double reach) {
  std::vector<Pair> pairs;
  for (Index v = 0; v < mesh_.vertex_count(); ++v)
    if (interior(v) && index(v) > 0)
      search({v}, reach, [&](Index w, double d) {
        if (interior(w) && index(w) < 0) pairs.push_back({d, v, w});
        return false;
      });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

QUADRIG_INLINE std::vector<Index> FieldSurgery::places(Index v, Index units, double spread) {
  const bool all = units > 2;
  if (!all) --units;
  // The narrowest ring with enough places, so that they lie evenly: else the charts around it are skewed.
  std::vector<std::pair<double, Index>> reached;
  search({v}, 3 * spread, [&](Index w, double d) {
    if (d >= 0.5 * spread && index(w) == 0) reached.push_back({d, w});
    return false;
  });
  std::vector<Index> around;
  std::vector<double> far;
  for (const auto& [low, high] : {std::pair{1.0, 1.05}, {1.0, 1.15}, {1.0, 1.5}, {0.75, 1.5}, {0.5, 2.0}, {0.5, 3.0}}) {
    around.clear();
    far.clear();
    for (const auto& [d, w] : reached)
      if (d >= low * spread && d <= high * spread) {
        around.push_back(w);
        far.push_back(d);
      }
    if (around.size() >= 12) break;
  }
  std::vector<Index> chosen;
  std::vector<double> nearest(around.size(), std::numeric_limits<double>::infinity());
  if (!all)
    for (std::size_t k = 0; k < around.size(); ++k) nearest[k] = (mesh_.position(around[k]) - mesh_.position(v)).norm();
  double nearest_far = std::numeric_limits<double>::infinity(), farthest = 0;
  while (static_cast<Index>(chosen.size()) < units && !around.empty()) {
    const auto best = static_cast<std::size_t>(std::max_element(nearest.begin(), nearest.end()) - nearest.begin());
    nearest_far = std::min(nearest_far, far[best]);
    farthest = std::max(farthest, far[best]);
    // Apart all around, not one behind the other along something thin.
    if (nearest[best] < std::max(0.4 * spread, farthest - nearest_far)) return {};
    chosen.push_back(around[best]);
    for (std::size_t k = 0; k < around.size(); ++k)
      nearest[k] = std::min(nearest[k], (mesh_.position(around[k]) - mesh_.position(around[best])).norm());
  }
  if (static_cast<Index>(chosen.size()) < units) return {};
  return chosen;
}

QUADRIG_INLINE std::vector<Index> FieldSurgery::roomiest(Index v, Index units, double spread, std::vector<Index> base,
                                                         ScaleEnergy& energy, double& least) {
  std::vector<Index> best;
  least = std::numeric_limits<double>::infinity();
  const double reach = std::sqrt(mesh_.total_area());
  for (double wider = spread; wider < reach; wider *= 1.5) {
    std::vector<Index> tried = places(v, units, wider);
    if (tried.empty()) break;
    const auto moved = static_cast<Index>(tried.size());
    base[at(v)] += units - moved;
    for (const Index w : tried) ++base[at(w)];
    const double here = energy(base);
    for (const Index w : tried) --base[at(w)];
    base[at(v)] -= units - moved;
    if (!best.empty() && !(here < least)) break;
    least = here;
    best = std::move(tried);
  }
  return best;
}

QUADRIG_INLINE Index FieldSurgery::scatter(Index v, double spread, ScaleEnergy& energy) {
  double least = 0;
  std::vector<Index> base = field_.singularities.index4;
  base[at(v)] = 0;
  const std::vector<Index> chosen = roomiest(v, index(v), spread, std::move(base), energy, least);
  for (const Index w : chosen) carry(v, w);
  return static_cast<Index>(chosen.size());
}

QUADRIG_INLINE bool FieldSurgery::relieve(Index v, double spread) {
  Index inside = no_index, wide = no_index;
  double most = 0.2, deepest = 0;
  search({v}, 2 * spread, [&](Index w, double d) {
    if (w != v && index(w) == 0 && (inside == no_index || deepest < spread)) {
      inside = w;
      deepest = d;
    }
    Index h = mesh_.outgoing(w);
    const Index start = h;
    if (w != v) do {
        const Index x = mesh_.target(h);
        if (x != v && mesh_.on_boundary(x) && index(x) <= (straight(x) ? -1 : 0) && mesh_.twin(h) != no_index) {
          const double lacking = 2 - index(x) - quarter_turns(x);
          if (lacking > most) {
            most = lacking;
            wide = x;
          }
        }
        h = mesh_.next_around(h);
      } while (h != no_index && h != start);
    return false;
  });
  if (wide == no_index && inside == no_index) return false;
  if (wide != no_index) {
    Index last = no_index;
    search({v}, std::numeric_limits<double>::infinity(), [&](Index w, double) {
      if (w == v) return false;
      Index h = mesh_.outgoing(w);
      const Index start = h;
      do {
        if (mesh_.target(h) == wide) last = h;
        h = mesh_.next_around(h);
      } while (last == no_index && h != no_index && h != start);
      return last != no_index;
    });
    if (last == no_index) return false;
    follow(v, mesh_.origin(last));
    move_unit(last);
    return true;
  }
  carry(v, inside);
  return true;
}

QUADRIG_INLINE bool FieldSurgery::supply(Index v, double spread) {
  Index inside = no_index;
  double deepest = -1;
  search({v}, 2 * spread, [&](Index w, double d) {
    if (w != v && index(w) == 0 && deepest < spread) {
      inside = w;
      deepest = d;
    }
    return deepest >= spread;
  });
  if (inside == no_index) return false;
  for (Index w = inside; w != v;) {
    const Index h = reached_[w].second;
    move_unit(mesh_.twin(h));
    w = mesh_.origin(h);
  }
  return true;
}

QUADRIG_INLINE double FieldSurgery::quarter_turns(Index v) const {
  double angle = 0;
  for (Index h = mesh_.outgoing(v); h != no_index; h = mesh_.next_around(h)) angle += mesh_.corner_angle(h);
  return angle / (std::numbers::pi / 2);
}

QUADRIG_INLINE void FieldSurgery::carry(Index from, Index to) {
  search({from}, std::numeric_limits<double>::infinity(), [&](Index w, double) { return w == to; });
  follow(from, to);
}

QUADRIG_INLINE void FieldSurgery::follow(Index from, Index to) {
  for (Index v = to; v != from;) {
    const Index h = reached_[v].second;
    move_unit(h);
    v = mesh_.origin(h);
  }
}

template <class Cost>
Index FieldSurgery::best_step(Index v, Cost&& cost) const {
  Index best = no_index, best_cost = 0;
  Index h = mesh_.outgoing(v);
  const Index start = h;
  do {
    const Index w = mesh_.target(h);
    if (interior(w) && (best == no_index || cost(w) < best_cost)) {
      best = h;
      best_cost = cost(w);
    }
    h = mesh_.next_around(h);
  } while (h != no_index && h != start);
  return best;
}

QUADRIG_INLINE std::vector<Index> FieldSurgery::spokes_around(Index v, Index count) const {
  struct Spoke {
    Index halfedge;
    double angle;
  };
  std::vector<Spoke> fan;
  double whole = 0;
  Index h = mesh_.outgoing(v);
  const Index start = h;
  do {
    if (interior(mesh_.target(h))) fan.push_back({h, whole});
    whole += mesh_.corner_angle(h);
    h = mesh_.next_around(h);
  } while (h != no_index && h != start);
  std::vector<Index> chosen;
  for (Index k = 0; k < count && !fan.empty(); ++k) {
    const double wanted = whole * k / count;
    const auto rank = [&](const Spoke& spoke) {
      const double off = std::abs(spoke.angle - wanted);
      return std::pair{index(mesh_.target(spoke.halfedge)), std::min(off, whole - off)};
    };
    const auto best = std::ranges::min_element(fan, {}, rank);
    chosen.push_back(best->halfedge);
    fan.erase(best);
  }
  return chosen;
}

template <class Visit>
void FieldSurgery::search(const std::vector<Index>& seeds, double limit, Visit&& visit) {
  reached_.clear();
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const Index v : seeds) {
    reached_[v] = {0, no_index};
    queue.push({0, v});
  }
  while (!queue.empty()) {
    const auto [d, v] = queue.top();
    queue.pop();
    if (d > reached_[v].first) continue;
    if (visit(v, d)) return;
    if (mesh_.outgoing(v) == no_index) continue;
    Index h = mesh_.outgoing(v);
    const Index start = h;
    do {
      const Index w = mesh_.target(h);
      const double next = d + mesh_.edge_vector(h).norm();
      if (next <= limit && interior(w)) {
        const auto known = reached_.find(w);
        if (known == reached_.end() || next < known->second.first) {
          reached_[w] = {next, h};
          queue.push({next, w});
        }
      }
      h = mesh_.next_around(h);
    } while (h != no_index && h != start);
  }
}

QUADRIG_INLINE bool FieldSurgery::cancel(Index plus, Index minus) {
  bool found = false;
  search({plus}, std::numeric_limits<double>::infinity(), [&](Index w, double) { return found = w == minus; });
  if (!found) return false;
  for (Index v = minus; v != plus;) {
    const Index h = reached_[v].second;
    move_unit(h);
    v = mesh_.origin(h);
  }
  return true;
}

QUADRIG_INLINE Expected<FieldResult> repair_singularities(const TriangleMesh<double>& mesh, FieldResult field,
                                                          const RepairOptions& options, Context& context) {
  FieldSurgery surgery(mesh, std::move(field), options.edge, options.solver);
  if (Status status = surgery.repair(options, context); !status.ok()) return status.error();
  std::vector<char> held = options.held;
  held.resize(detail::at(mesh.face_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) == no_index) held[detail::at(TriangleMesh<double>::face_of(h))] = 1;
  if (Status status = surgery.apply(held, context); !status.ok()) return status.error();
  return std::move(surgery).release();
}

}  // namespace quadrig
