#pragma once

#include "quadrig/quantize/coarse_map.hpp"

namespace quadrig {

namespace detail {

/// Expressions are shared by number; 0 is the empty one, which nearly every corner and edge has.
class ExpressionPool {
 public:
  ExpressionPool() : pool_(1) {}
  [[nodiscard]] const LinearExpression<Gaussian>& operator[](Index id) const { return pool_[at(id)]; }
  Index add(LinearExpression<Gaussian> e) {
    if (e.empty()) return 0;
    pool_.push_back(std::move(e));
    return static_cast<Index>(pool_.size() - 1);
  }
  /// a + i^k b, or a − i^k b.
  Index sum(Index a, Index b, int k, bool minus = false) {
    if (b == 0) return a;
    LinearExpression<Gaussian> e = pool_[at(a)];
    const Gaussian factor = rotated(Gaussian{minus ? -1 : 1, 0}, k);
    accumulate(e, LinearExpression<Gaussian>(pool_[at(b)]), factor);
    return add(std::move(e));
  }

 private:
  std::vector<LinearExpression<Gaussian>> pool_;
};

/// The mesh that is being decimated.
class MapDecimator {
 public:
  MapDecimator(const TriangleMesh<double>& mesh, const CutGraph& cut, const std::vector<Index>& index,
               const std::vector<Aligned>& aligned, const std::vector<Complex>& z, const Context* context)
      : face_count_(mesh.face_count()), context_(context) {
    const Index half_edges = mesh.halfedge_count(), n = mesh.vertex_count();
    origin_.resize(at(half_edges));
    twin_.resize(at(half_edges));
    vector_.resize(at(half_edges));
    direction_.assign(at(half_edges), 0.0);
    rotation_ = cut.rotation;
    aligned_ = aligned;
    corner_rotation_ = cut.corner_rotation;
    corner_translation_.resize(at(half_edges));
    translation_.assign(at(half_edges), 0);
    alive_.assign(at(face_count_), 1);
    outgoing_.resize(at(n));
    pinned_.assign(at(n), 0);
    on_border_.assign(at(n), 0);
    crease_.assign(at(n), 0);
    mark_.assign(at(n), 0);
    for (Index h = 0; h < half_edges; ++h) {
      if (cancelled(at(h))) return;
      origin_[at(h)] = mesh.origin(h);
      twin_[at(h)] = mesh.twin(h);
      vector_[at(h)] = z[at(mesh.next(h))] - z[at(h)];
      corner_translation_[at(h)] = pool_.add(cut.corner_translation[at(h)]);
      if (const Index b = cut.branch[at(h)]; b != no_index) {
        const Gaussian one = cut.forward[at(h)] ? Gaussian{1, 0} : -rotated(Gaussian{1, 0}, cut.rotation[at(h)]);
        translation_[at(h)] = pool_.add({{b, one}});
      }
      if (aligned_[at(h)] != Aligned::none) {
        crease_[at(mesh.origin(h))] = crease_[at(mesh.target(h))] = 1;
        // Straight by construction; rounding must not accumulate.
        if (aligned_[at(h)] == Aligned::v_constant)
          vector_[at(h)].imag(0);
        else
          vector_[at(h)].real(0);
      }
    }
    for (Index v = 0; v < n; ++v) {
      if (cancelled(at(v))) return;
      outgoing_[at(v)] = mesh.outgoing(v);
      pinned_[at(v)] = index[at(v)] != 0;
      if (mesh.outgoing(v) == no_index) {
        pinned_[at(v)] = 1;
        continue;
      }
      on_border_[at(v)] = mesh.on_boundary(v);
      double angle = 0;
      Index h = mesh.outgoing(v);
      const Index start = h;
      do {
        direction_[at(h)] = angle;
        angle += elementary::arg(-vector_[at(mesh.prev(h))] / vector_[at(h)]);
        h = mesh.next_around(h);
      } while (h != no_index && h != start);
    }
    pin_crease_ends();
  }

  CoarseMap run(Index vertex_variables) {
    for (int round = 0; round < 200 && !cancelled(0); ++round) {
      const bool flipped = flip_to_delaunay();
      const bool collapsed = collapse_round();
      if (!flipped && !collapsed) break;
    }
    return cancelled(0) ? CoarseMap{} : compact(vertex_variables);
  }

 private:
  [[nodiscard]] bool cancelled(std::size_t k) const { return k % 1024 == 0 && context_ && context_->cancelled(); }
  static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }
  [[nodiscard]] Index target(Index h) const { return origin_[at(next(h))]; }

  /// A vertex of a crease may only go where exactly two aligned edges meet in one straight line.
  void pin_crease_ends() {
    std::vector<std::int8_t> count(pinned_.size(), 0);
    std::vector<double> turn(pinned_.size(), 0);
    for (Index h = 0; h < 3 * face_count_; ++h) {
      if (aligned_[at(h)] == Aligned::none) continue;
      if (twin_[at(h)] == no_index || h < twin_[at(h)]) {
        ++count[at(origin_[at(h)])];
        ++count[at(target(h))];
      }
    }
    for (std::size_t v = 0; v < pinned_.size(); ++v)
      if (count[v] != 0 && count[v] != 2) pinned_[v] = 1;
    // A regular vertex inside a crease: its two edges must be opposite, that is half its angle apart.
    for (Index v = 0; v < static_cast<Index>(pinned_.size()); ++v) {
      if (count[at(v)] != 2 || pinned_[at(v)] || on_border_[at(v)]) continue;
      std::vector<double> directions;
      Index h = outgoing_[at(v)];
      const Index start = h;
      do {
        if (aligned_[at(h)] != Aligned::none) directions.push_back(direction_[at(h)]);
        h = twin_[at(prev(h))];
      } while (h != start);
      if (directions.size() != 2 || std::abs(std::abs(directions[1] - directions[0]) - 3.14159265358979) > 0.1)
        pinned_[at(v)] = 1;
    }
  }

  /// z' = i^k z + τ for one face.
  void rechart(Index f, int k, Index tau) {
    if ((k & 3) == 0 && tau == 0) return;
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      corner_rotation_[at(h)] = static_cast<std::int8_t>((corner_rotation_[at(h)] + k) & 3);
      corner_translation_[at(h)] = pool_.sum(tau, corner_translation_[at(h)], k);
      vector_[at(h)] = rotated(vector_[at(h)], k);
      if (aligned_[at(h)] != Aligned::none && (k & 1))
        aligned_[at(h)] = aligned_[at(h)] == Aligned::v_constant ? Aligned::u_constant : Aligned::v_constant;
      const Index g = twin_[at(h)];
      if (g == no_index) continue;
      const int r = (rotation_[at(h)] - k) & 3;
      set_transition(h, r, pool_.sum(translation_[at(h)], tau, r, true));
    }
  }
  void set_transition(Index h, int r, Index t) {
    const Index g = twin_[at(h)];
    rotation_[at(h)] = static_cast<std::int8_t>(r & 3);
    translation_[at(h)] = t;
    rotation_[at(g)] = static_cast<std::int8_t>(-r & 3);
    translation_[at(g)] = pool_.sum(0, t, -r, true);
  }
  /// Puts the face across h into the chart of h's own face.
  void rechart_across(Index h) {
    const Index g = twin_[at(h)];
    rechart(g / 3, rotation_[at(g)], translation_[at(g)]);
  }
  void glue(Index h, Index g) {
    if (h != no_index) twin_[at(h)] = g;
    if (g != no_index) twin_[at(g)] = h;
  }
  [[nodiscard]] bool adjacent(Index a, Index b) const {
    bool found = false;
    for_each_outgoing(a, [&](Index h) { found = found || target(h) == b || origin_[at(prev(h))] == b; });
    return found;
  }
  template <class Body>
  void for_each_outgoing(Index v, Body&& body) const {
    const Index start = outgoing_[at(v)];
    Index h = start;
    do {
      body(h);
      h = twin_[at(prev(h))];
    } while (h != no_index && h != start);
  }

  bool flip_to_delaunay() {
    bool any = false;
    std::vector<Index> queue;
    for (Index f = 0; f < face_count_; ++f)
      if (alive_[at(f)])
        for (Index h = 3 * f; h < 3 * f + 3; ++h)
          if (twin_[at(h)] > h) queue.push_back(h);
    std::size_t budget = 20 * queue.size() + 100;
    while (!queue.empty() && budget-- > 0 && !cancelled(budget)) {
      const Index h = queue.back();
      queue.pop_back();
      if (!alive_[at(h / 3)] || !try_flip(h)) continue;
      any = true;
      const Index f = h / 3, g = twin_[at(h)] / 3;
      for (const Index e : {f, g})
        for (Index k = 3 * e; k < 3 * e + 3; ++k)
          if (k != h && k != twin_[at(h)] && twin_[at(k)] != no_index) queue.push_back(k);
    }
    return any;
  }

  bool try_flip(Index h) {
    const Index g = twin_[at(h)];
    if (g == no_index || aligned_[at(h)] != Aligned::none || g / 3 == h / 3) return false;
    const Index hn = next(h), hp = prev(h), gn = next(g), gp = prev(g);
    const int back = -rotation_[at(h)];
    const Complex bc = vector_[at(hn)], ca = vector_[at(hp)];
    const Complex ad = rotated(vector_[at(gn)], back), db = rotated(vector_[at(gp)], back);
    const double area_f = cross(bc, ca), area_g = cross(ad, db);
    // Opposite angles sum to more than π exactly where the sum of cotangents is negative.
    const double cot = -(std::conj(bc) * ca).real() / area_f - (std::conj(ad) * db).real() / area_g;
    if (!(cot < -1e-9)) return false;
    const double new_f = cross(ca, ad), new_g = cross(db, bc);
    const double least = 1e-9 * (area_f + area_g);
    if (!(new_f > least) || !(new_g > least)) return false;
    const Index a = origin_[at(h)], b = origin_[at(g)], c = origin_[at(hp)], d = origin_[at(gp)];
    if (c == d || adjacent(c, d)) return false;

    rechart_across(h);
    // f = (c, a, d), g = (c, d, b); the half-edges keep their numbers where they can: h becomes d → c, g becomes c → d.
    const auto move = [&](Index from, Index to, Index vertex, std::int8_t k, Index tau) {
      origin_[at(to)] = vertex;
      corner_rotation_[at(to)] = k;
      corner_translation_[at(to)] = tau;
      vector_[at(to)] = moved_[at(from)].vector;
      aligned_[at(to)] = moved_[at(from)].aligned;
      direction_[at(to)] = moved_[at(from)].direction;
      rotation_[at(to)] = moved_[at(from)].rotation;
      translation_[at(to)] = moved_[at(from)].translation;
    };
    const std::array<Index, 6> all{h, hn, hp, g, gn, gp};
    std::array<Index, 6> twins{};
    std::array<std::int8_t, 6> ks{};
    std::array<Index, 6> taus{};
    for (std::size_t i = 0; i < 6; ++i) {
      const Index e = all[i];
      moved_[i] = {vector_[at(e)], aligned_[at(e)], direction_[at(e)], rotation_[at(e)], translation_[at(e)]};
      twins[i] = twin_[at(e)];
      ks[i] = corner_rotation_[at(e)];
      taus[i] = corner_translation_[at(e)];
    }
    // Slots: f = (hp: c→a, h_slot: ...). Rotate roles inside the faces: hp stays c→a, hn slot takes d→c, h slot a→d.
    const Complex cd = ca + ad;
    move(4, h, a, ks[0], taus[0]);  // a → d, from gn
    origin_[at(hn)] = d;            // d → c, new
    corner_rotation_[at(hn)] = ks[5];
    corner_translation_[at(hn)] = taus[5];
    vector_[at(hn)] = -cd;
    aligned_[at(hn)] = Aligned::none;
    direction_[at(hn)] = moved_[5].direction + elementary::arg(-cd / db);
    // hp: c → a stays.
    move(1, g, b, ks[3], taus[3]);  // b → c, from hn
    origin_[at(gn)] = c;            // c → d, new
    corner_rotation_[at(gn)] = ks[2];
    corner_translation_[at(gn)] = taus[2];
    vector_[at(gn)] = cd;
    aligned_[at(gn)] = Aligned::none;
    direction_[at(gn)] = moved_[2].direction + elementary::arg(cd / ca);
    // gp: d → b stays.
    glue(h, twins[4]);
    glue(g, twins[1]);
    glue(hn, gn);
    rotation_[at(hn)] = rotation_[at(gn)] = 0;
    translation_[at(hn)] = translation_[at(gn)] = 0;
    if (!on_border_[at(a)] || outgoing_[at(a)] == gn) outgoing_[at(a)] = h;
    if (!on_border_[at(b)] || outgoing_[at(b)] == hn) outgoing_[at(b)] = g;
    if (!on_border_[at(c)]) outgoing_[at(c)] = hp;
    if (!on_border_[at(d)]) outgoing_[at(d)] = gp;
    return true;
  }

  /// Collapses each removable vertex into the neighbour that leaves the best triangles.
  bool collapse_round() {
    std::vector<std::pair<double, Index>> order;
    for (Index v = 0; v < static_cast<Index>(outgoing_.size()); ++v) {
      if (pinned_[at(v)] || outgoing_[at(v)] == no_index) continue;
      double shortest = std::numeric_limits<double>::infinity();
      for_each_outgoing(v, [&](Index h) { shortest = std::min(shortest, std::norm(vector_[at(h)])); });
      order.push_back({shortest, v});
    }
    std::sort(order.begin(), order.end());
    bool any = false;
    std::size_t tried = 0;
    for (const auto& [length, v] : order) {
      if (cancelled(tried++)) break;
      any = try_collapse(v) || any;
    }
    return any;
  }

  bool try_collapse(Index v) {
    // The fan of v, counter-clockwise, in one chart.
    fan_.clear();
    for_each_outgoing(v, [&](Index h) { fan_.push_back(h); });
    const bool border = on_border_[at(v)] != 0;
    for (std::size_t i = 0; i + 1 < fan_.size(); ++i) rechart_across(prev(fan_[i]));

    double best_quality = 0;
    std::size_t best = fan_.size() + 1;
    const std::size_t spokes = fan_.size() + (border ? 1 : 0);
    const auto spoke_vector = [&](std::size_t s) {
      return s < fan_.size() ? vector_[at(fan_[s])] : -vector_[at(prev(fan_.back()))];
    };
    const auto spoke_target = [&](std::size_t s) {
      return s < fan_.size() ? target(fan_[s]) : origin_[at(prev(fan_.back()))];
    };
    const auto spoke_aligned = [&](std::size_t s) {
      return (s < fan_.size() ? aligned_[at(fan_[s])] : aligned_[at(prev(fan_.back()))]) != Aligned::none;
    };
    for (std::size_t s = 0; s < spokes; ++s) {
      if (border && s != 0 && s != fan_.size()) continue;
      if (crease_[at(v)] && !spoke_aligned(s)) continue;
      const Complex d = spoke_vector(s);
      double quality = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < fan_.size() && quality > best_quality; ++i) {
        if (i == s || (i + 1) % spokes == s) continue;
        const Complex wx = vector_[at(fan_[i])] - d, xy = vector_[at(next(fan_[i]))];
        const Complex yw = -wx - xy;
        const double area = cross(wx, xy);
        quality = std::min(quality, area / (std::norm(wx) + std::norm(xy) + std::norm(yw)));
      }
      if (quality > best_quality && quality > 1e-7 && link_allows(v, s, spoke_target(s), border)) {
        best_quality = quality;
        best = s;
      }
    }
    if (best > fan_.size()) return false;
    collapse(v, best, border);
    return true;
  }

  /// No vertex but the (one or two) opposite ones is adjacent to both ends; nothing degenerates.
  [[nodiscard]] bool link_allows(Index v, std::size_t s, Index w, bool border) {
    const std::size_t k = fan_.size();
    ring_.clear();
    for (std::size_t i = 0; i < k; ++i) ring_.push_back(target(fan_[i]));
    if (border) ring_.push_back(origin_[at(prev(fan_.back()))]);
    const std::size_t ring = ring_.size();
    const Index left = border ? (s + 1 < ring ? ring_[s + 1] : no_index) : ring_[(s + 1) % ring];
    const Index right = border ? (s > 0 ? ring_[s - 1] : no_index) : ring_[(s + ring - 1) % ring];
    ++stamp_;
    for (const Index x : ring_) {
      if (x == v || mark_[at(x)] == stamp_) return false;
      mark_[at(x)] = stamp_;
    }
    bool ok = true;
    for_each_outgoing(w, [&](Index h) {
      for (const Index x : {target(h), origin_[at(prev(h))]})
        if (x != v && x != left && x != right && mark_[at(x)] == stamp_) ok = false;
    });
    return ok && ring >= 3;
  }

  void collapse(Index v, std::size_t s, bool border) {
    const std::size_t k = fan_.size(), ring = k + (border ? 1 : 0);
    const bool last_spoke = s == k;  // the far border edge
    // The corner of w in the chart of the fan.
    const Index w_corner = last_spoke ? prev(fan_.back()) : next(fan_[s]);
    const Index w = origin_[at(w_corner)];
    const std::int8_t w_rotation = corner_rotation_[at(w_corner)];
    const Index w_translation = corner_translation_[at(w_corner)];
    const Complex d = last_spoke ? -vector_[at(prev(fan_.back()))] : vector_[at(fan_[s])];
    const auto face_left = [&]() -> std::size_t { return s < k ? s : k; };  // fan face whose first spoke is s
    const auto face_right = [&]() -> std::size_t { return border ? (s == 0 ? k : s - 1) : (s + k - 1) % k; };
    const std::size_t fl = face_left(), fr = face_right();

    // Half-edges at w just inside the two faces that go: their directions continue on the spokes that stay.
    double left_direction = 0, right_direction = 0;
    if (fl < k) left_direction = direction_[at(next(fan_[fl]))];  // w → c
    if (fr < k) {
      // Face (v, d, w): w → v leads, w → d follows by the corner's angle; as the twin's twin it is d → w reversed.
      const Index wv = prev(fan_[fr]);
      right_direction = direction_[at(wv)] + elementary::arg(-vector_[at(next(fan_[fr]))] / vector_[at(wv)]);
    }

    std::vector<Complex> old_in(k);
    for (std::size_t i = 0; i < k; ++i) old_in[i] = vector_[at(prev(fan_[i]))];

    for (std::size_t i = 0; i < k; ++i) {
      if (i == fl || i == fr) continue;
      const Index h = fan_[i], in = prev(h);
      origin_[at(h)] = w;
      corner_rotation_[at(h)] = w_rotation;
      corner_translation_[at(h)] = w_translation;
      const Complex in_before = vector_[at(in)];
      vector_[at(h)] -= d;
      vector_[at(in)] += d;
      if (aligned_[at(h)] == Aligned::v_constant) vector_[at(h)].imag(0);
      if (aligned_[at(h)] == Aligned::u_constant) vector_[at(h)].real(0);
      if (aligned_[at(in)] == Aligned::v_constant) vector_[at(in)].imag(0);
      if (aligned_[at(in)] == Aligned::u_constant) vector_[at(in)].real(0);
      direction_[at(in)] += elementary::arg(vector_[at(in)] / in_before);
    }
    // Directions of w → x: counter-clockwise from the left face, or (where there is none) clockwise from the right.
    if (fl < k) {
      double direction = left_direction;
      for (std::size_t step = 1; step < k; ++step) {
        const std::size_t i = (fl + step) % k;
        if (border && fl + step >= k) break;
        if (i == fr) break;
        const Index h = fan_[i];
        direction_[at(h)] = direction;
        direction += elementary::arg(-vector_[at(prev(h))] / vector_[at(h)]);
      }
    } else {
      double direction = right_direction;
      for (std::size_t i = fr; i-- > 0;) {
        const Index h = fan_[i];
        direction -= elementary::arg(-vector_[at(prev(h))] / vector_[at(h)]);
        direction_[at(h)] = direction;
      }
    }

    // Glue across the faces that go; everything is in one chart, so the outer transition carries over.
    const auto remove = [&](std::size_t i, bool left) {
      const Index h = fan_[i], outer = next(h), in = prev(h);
      Index inner, outside;
      // left face (v, w, c): its edge v–c is `in` (c → v), its edge w–c is `outer` (w → c).
      // right face (v, d, w): its edge v–d is `h` (v → d), its edge d–w is `outer` (d → w).
      inner = twin_[at(left ? in : h)];
      outside = twin_[at(outer)];
      const int r = rotation_[at(outer)];
      const Index t = translation_[at(outer)];
      const Aligned kept = aligned_[at(outer)] != Aligned::none ? aligned_[at(outer)] : aligned_[at(left ? in : h)];
      const Index far = left ? origin_[at(in)] : target(h);
      alive_[at(i < k ? h / 3 : 0)] = 0;
      if (inner != no_index) {
        twin_[at(inner)] = outside;
        if (outside != no_index) {
          twin_[at(outside)] = inner;
          set_transition(inner, r, t);
        }
        aligned_[at(inner)] = kept;
        if (outside != no_index && kept != Aligned::none)
          aligned_[at(outside)] =
              (r & 1) ? (kept == Aligned::v_constant ? Aligned::u_constant : Aligned::v_constant) : kept;
      } else if (outside != no_index) {
        twin_[at(outside)] = no_index;
        if (kept != Aligned::none)
          aligned_[at(outside)] =
              (r & 1) ? (kept == Aligned::v_constant ? Aligned::u_constant : Aligned::v_constant) : kept;
      }
      return std::array<Index, 3>{inner, outside, far};
    };
    std::array<Index, 3> left_result{no_index, no_index, no_index}, right_result = left_result;
    if (fl < k) left_result = remove(fl, true);
    if (fr < k) right_result = remove(fr, false);

    outgoing_[at(v)] = no_index;
    // Leaving half-edges of the vertices around, from faces that still live.
    const auto adopt = [&](Index vertex, Index halfedge) {
      if (halfedge == no_index || !alive_[at(halfedge / 3)]) return false;
      Index h = halfedge;
      assert(origin_[at(h)] == vertex);
      if (on_border_[at(vertex)]) {  // turn clockwise to the first of the fan
        for (;;) {
          const Index across = twin_[at(h)];
          if (across == no_index) break;
          h = next(across);
          if (h == halfedge) break;
        }
      }
      outgoing_[at(vertex)] = h;
      return true;
    };
    const auto leave = [&](Index h) { return h == no_index ? no_index : next(h); };
    // c: `inner` left runs w → c, so next(inner) leaves c; `outside` left runs c → w and leaves c itself.
    if (left_result[2] != no_index && !adopt(left_result[2], left_result[1]))
      adopt(left_result[2], leave(left_result[0]));
    // d: `inner` right runs d → w and leaves d; `outside` right runs w → d.
    if (right_result[2] != no_index && !adopt(right_result[2], right_result[0]))
      adopt(right_result[2], leave(right_result[1]));
    bool adopted = false;
    for (std::size_t i = 0; i < k && !adopted; ++i)
      if (i != fl && i != fr) adopted = adopt(w, fan_[i]);
    if (!adopted) adopted = adopt(w, leave(left_result[1]));
    if (!adopted) adopted = adopt(w, right_result[1]);
    assert(adopted);
    (void)ring;
    for (std::size_t i = 0; i < k; ++i)
      if (i != fl && i != fr) {
        const Index x = target(fan_[i]);
        if (outgoing_[at(x)] == no_index || !alive_[at(outgoing_[at(x)] / 3)]) adopt(x, next(fan_[i]));
      }
  }

  CoarseMap compact(Index vertex_variables) {
    std::vector<Index> number(at(face_count_), no_index);
    Index count = 0;
    for (Index f = 0; f < face_count_; ++f)
      if (alive_[at(f)]) number[at(f)] = count++;
    CoarseMap map;
    const auto reserve = at(3 * count);
    map.origin.reserve(reserve);
    for (Index f = 0; f < face_count_; ++f) {
      if (!alive_[at(f)]) continue;
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        map.origin.push_back(origin_[at(h)]);
        const Index g = twin_[at(h)];
        map.twin.push_back(g == no_index ? no_index : 3 * number[at(g / 3)] + g % 3);
        map.rotation.push_back(g == no_index ? std::int8_t{0} : rotation_[at(h)]);
        map.vector.push_back(vector_[at(h)]);
        map.aligned.push_back(aligned_[at(h)]);
        map.direction.push_back(direction_[at(h)]);
        LinearExpression<Gaussian> e = corner(next(h), vertex_variables);
        accumulate(e, corner(h, vertex_variables), Gaussian{-1, 0});
        map.expression.push_back(std::move(e));
      }
    }
    return map;
  }
  [[nodiscard]] LinearExpression<Gaussian> corner(Index h, Index vertex_variables) const {
    LinearExpression<Gaussian> e{{origin_[at(h)], rotated(Gaussian{1, 0}, corner_rotation_[at(h)])}};
    for (const auto& term : pool_[corner_translation_[at(h)]])
      e.push_back({vertex_variables + term.variable, term.coefficient});
    return e;
  }

  struct Moved {
    Complex vector;
    Aligned aligned;
    double direction;
    std::int8_t rotation;
    Index translation;
  };

  Index face_count_;
  const Context* context_;
  std::vector<Index> origin_, twin_, outgoing_, translation_, corner_translation_;
  std::vector<std::int8_t> rotation_, corner_rotation_;
  std::vector<Complex> vector_;
  std::vector<Aligned> aligned_;
  std::vector<double> direction_;
  std::vector<char> alive_, pinned_, on_border_, crease_;
  std::array<Moved, 6> moved_{};
  std::vector<Index> fan_, ring_;
  std::vector<std::uint32_t> mark_;
  std::uint32_t stamp_ = 0;
  ExpressionPool pool_;
};

}  // namespace detail

QUADRIG_INLINE CoarseMap decimate_map(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                      const std::vector<Index>& index, const std::vector<Aligned>& aligned,
                                      const std::vector<Complex>& z, const Context* context) {
  return detail::MapDecimator(mesh, cut, index, aligned, z, context).run(mesh.vertex_count());
}

}  // namespace quadrig
