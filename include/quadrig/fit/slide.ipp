// One vertex at a time: a Newton step in the tangent plane on the error that the quads around it leave, kept where the
// error measured after it is less.
#pragma once

#include "quadrig/fit/slide.hpp"

namespace quadrig {

QUADRIG_INLINE Status SlideOptions::validate() const {
  const auto bad = [](const char* field, const char* remedy) {
    return Status(Error{ErrorCode::bad_option, "out of range", std::string("fit.slide.") + field, remedy});
  };
  if (rounds < 0) return bad("rounds", "give 0 or more");
  if (!(skew >= 0)) return bad("skew", "give 0 or more");
  if (!(turn >= 0)) return bad("turn", "give 0 or more");
  if (!(stray >= 0)) return bad("stray", "give 0 or more");
  if (!(accepted >= 0 && accepted < 1)) return bad("accepted", "give 0 to below 1");
  return {};
}

QUADRIG_INLINE void SlideTargets::set_bending(const Connection<double>& bases, const PosedForms& forms,
                                              const Context& context) {
  connection = &bases;
  bending.assign(static_cast<std::size_t>(forms.face_count()), {});
  for (std::size_t f = 0; f < bending.size(); ++f) {
    if (f % 4096 == 0 && context.cancelled()) return;
    const std::span<const PosedForms::Form> of_face = forms.of_face(static_cast<Index>(f));
    for (const PosedForms::Form& form : of_face.subspan(1)) {
      const double xx = form.xx - of_face[0].xx, xy = form.xy - of_face[0].xy, yy = form.yy - of_face[0].yy;
      const std::array<double, 6> square{xx * xx, xx * xy, xx * yy, xy * xy, xy * yy, yy * yy};
      for (std::size_t k = 0; k < 6; ++k) bending[f][k] += form.weight * square[k];
    }
  }
}

namespace detail {

class Slider {
 public:
  Slider(const TriangleMesh<double>& mesh, const SlideTargets& targets, std::vector<char> held,
         const SlideOptions& options, QuadMesh& quads, const Context& context)
      : mesh_(mesh),
        targets_(targets),
        options_(options),
        quads_(quads),
        corners_(quads),
        before_(quads.positions),
        fixed_(std::move(held)) {
    const auto n = at(quads.vertex_count()), m = at(quads.quad_count());
    step_.assign(n, std::numeric_limits<double>::infinity());
    fixed_.resize(n, 0);
    for (std::size_t v = 0; v < n; ++v)
      if (corners_.at(static_cast<Index>(v)).empty()) fixed_[v] = 1;  // of no quad
    find_edges();
    color();

    weight_.assign(m, 1);
    direction_.assign(m, Vector3::Zero());
    centre_.resize(m);
    for (Index q = 0; q < quads.quad_count(); ++q) {
      if (q % 1024 == 0 && context.cancelled()) return;
      if (!targets.weight.empty()) {
        weight_[at(q)] = 0;
        for (int i = 0; i < 4; ++i) weight_[at(q)] += targets.weight[at(face(q, i))] / 4;
      }
      if (!targets.direction.empty()) direction_[at(q)] = common_direction(q);
      centre_[at(q)] = sample(centre(q), quads.source[at(quads.quads(q, 0))]);
      for (int i = 0; i < 4; ++i)
        middle_[at(edge_[at(4 * q + i)])] = sample(middle(q, i), quads.source[at(quads.quads(q, i))]);
    }
  }

  SlideReport run(Context& context) {
    SlideReport report;
    if (context.cancelled()) return report;
    double area = 0;
    for (Index q = 0; q < quads_.quad_count(); ++q) area += area_of(q);
    if (!(area > 0)) return report;
    const auto rms = [&] {
      double error = 0;
      for (Index q = 0; q < quads_.quad_count(); ++q) error += error_of(q);
      return std::sqrt(error / area);
    };
    report.before = rms();
    set_units();
    for (; report.rounds < options_.rounds && !context.cancelled(); ++report.rounds)
      for (const std::vector<Index>& vertices : colors_)
        context.parallel_for(vertices.size(), 512, [&](std::size_t begin, std::size_t end) {
          Scratch scratch;
          for (std::size_t k = begin; k < end; ++k) {
            if (k % 64 == 0 && context.cancelled()) return;
            const Index v = vertices[k];
            if (rests(v)) continue;
            step_[at(v)] = move(v, scratch);
          }
        });
    report.after = rms();
    return report;
  }

 private:
  /// A point of a quad and where it strays from the surface: by `off` along `normal`.
  struct Sample {
    SurfacePoint foot;
    Vector3 normal;
    double off = 0;
  };
  using Scratch = std::vector<Sample>;

  /// The mean square error of each component, beside which shape counts.
  void set_units() {
    constexpr double exact = 2e-3;  // of an edge: what strays less need not be bettered
    std::vector<Index> root(centre_.size()), first(middle_.size(), no_index);
    for (std::size_t q = 0; q < root.size(); ++q) root[q] = static_cast<Index>(q);
    const auto find = [&](Index q) {
      while (root[at(q)] != q) q = root[at(q)] = root[at(root[at(q)])];
      return q;
    };
    for (std::size_t side = 0; side < edge_.size(); ++side) {
      Index& other = first[at(edge_[side])];
      const auto q = static_cast<Index>(side / 4);
      if (other == no_index) other = q;
      const auto [low, high] = std::minmax({find(q), find(other)});  // a list: of values, not of references
      root[at(high)] = low;
    }
    struct Sum {
      double error = 0, area = 0, quads = 0;
    };
    std::vector<Sum> sums(root.size());
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      Sum& sum = sums[at(find(q))];
      sum.error += error_of(q);
      sum.area += area_of(q);
      sum.quads += 1;
    }
    for (Index q = 0; q < quads_.quad_count(); ++q)
      if (const Sum& sum = sums[at(find(q))]; sum.area > 0)
        unit_.push_back(std::max(sum.error / sum.area, exact * exact * sum.area / sum.quads));
      else
        unit_.push_back(0);
  }

  /// Numbers the edges; vertices of those that have one side stay.
  void find_edges() {
    std::vector<Index> sides(4 * at(quads_.quad_count()));
    for (std::size_t k = 0; k < sides.size(); ++k) sides[k] = static_cast<Index>(k);
    const auto end = [&](Index s, int i) { return quads_.quads(s / 4, (s % 4 + i) % 4); };
    const auto key = [&](Index s) { return std::pair(std::minmax({end(s, 0), end(s, 1)}), s); };
    std::sort(sides.begin(), sides.end(), [&](Index a, Index b) { return key(a) < key(b); });
    edge_.resize(sides.size());
    Index count = 0;
    for (std::size_t k = 0, last = 0; k < sides.size(); k = last, ++count) {
      while (last < sides.size() && key(sides[last]).first == key(sides[k]).first) edge_[at(sides[last++])] = count;
      if (last - k != 2) fixed_[at(end(sides[k], 0))] = fixed_[at(end(sides[k], 1))] = 1;
    }
    middle_.resize(at(count));
  }

  /// Vertices of one color share no quad, so that they can move at once.
  void color() {
    std::vector<std::size_t> of(at(quads_.vertex_count()), 0);  // from 1
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      if (fixed_[at(v)]) continue;
      std::vector<std::size_t> taken;
      for (const Index k : corners_.at(v))
        for (int i = 0; i < 4; ++i) taken.push_back(of[at(quads_.quads(k / 4, i))]);
      std::size_t color = 1;
      while (std::find(taken.begin(), taken.end(), color) != taken.end()) ++color;
      of[at(v)] = color;
      if (color > colors_.size()) colors_.resize(color);
      colors_[color - 1].push_back(v);
    }
  }

  /// The direction of all four corners' faces, in the plane of the quad; zero where they have none in common.
  [[nodiscard]] Vector3 common_direction(Index q) const {
    const Vector3& given = targets_.direction[at(face(q, 0))];
    Vector3 normal = Vector3::Zero();
    for (int i = 0; i < 4; ++i) {
      if (targets_.direction[at(face(q, i))] != given) return Vector3::Zero();
      normal += mesh_.normal(face(q, i));
    }
    if (!(normal.norm() > 1e-6)) return Vector3::Zero();
    normal.normalize();
    const Vector3 along = given - given.dot(normal) * normal;
    return along.norm() > 0.5 * given.norm() ? Vector3(along.normalized()) : Vector3::Zero();
  }

  /// A vertex that hardly moved, among others that hardly did.
  [[nodiscard]] bool rests(Index v) const {
    constexpr double still = 0.05;
    for (const Index k : corners_.at(v))
      for (int i = 0; i < 4; ++i)
        if (const auto w = at(quads_.quads(k / 4, i)); !fixed_[w] && step_[w] > still) return false;
    return true;
  }

  [[nodiscard]] Index face(Index q, int i) const { return quads_.source[at(quads_.quads(q, i))].face; }
  [[nodiscard]] Vector3 point(Index v) const { return quads_.positions.row(v).transpose(); }
  [[nodiscard]] Vector3 corner(Index q, int i) const { return point(quads_.quads(q, i % 4)); }
  [[nodiscard]] Vector3 centre(Index q) const {
    return (corner(q, 0) + corner(q, 1) + corner(q, 2) + corner(q, 3)) / 4;
  }
  [[nodiscard]] Vector3 middle(Index q, int i) const { return (corner(q, i) + corner(q, i + 1)) / 2; }
  [[nodiscard]] double area_of(Index q) const {
    return (corner(q, 2) - corner(q, 0)).cross(corner(q, 3) - corner(q, 1)).norm() / 2;
  }

  [[nodiscard]] Sample sample(const Vector3& p, const SurfacePoint& near) const {
    const SurfaceHit hit = walk_closest(mesh_, p, near);
    const double off = std::sqrt(hit.squared_distance);
    return {hit, off > 0 ? Vector3((p - hit.position) / off) : mesh_.normal(hit.face), off};
  }

  /// Mean square distance of a quad by Simpson's rule; its corners lie on the surface.
  [[nodiscard]] static double mean_square(double centre, const std::array<double, 4>& middles) {
    double sum = 4 * centre * centre;
    for (const double each : middles) sum += each * each;
    return sum / 9;
  }

  /// What the poses add to the mean square distance of quad q: QuadError::triangles of the change of the forms.
  [[nodiscard]] double bending(Index q) const {
    if (targets_.bending.empty()) return 0;
    const Vector3 a = (corner(q, 1) + corner(q, 2) - corner(q, 0) - corner(q, 3)) / 2;
    const Vector3 b = (corner(q, 2) + corner(q, 3) - corner(q, 0) - corner(q, 1)) / 2;
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
      const std::array<double, 6>& moment = targets_.bending[at(face(q, i))];
      if (!(moment[0] + moment[3] + moment[5] > 0)) continue;
      const Complex u = targets_.connection->to_complex(face(q, i), a),
                    v = targets_.connection->to_complex(face(q, i), b);
      // A form at (x, y) is linear in (xx, xy, yy); the mean of the product of two such is a product with the moments.
      const auto at_pair = [](const Complex& x, const Complex& y) {
        return Vector3(x.real() * y.real(), x.real() * y.imag() + x.imag() * y.real(), x.imag() * y.imag());
      };
      const Vector3 aa = at_pair(u, u), bb = at_pair(v, v), ab = at_pair(u, v);
      const auto mean = [&](const Vector3& s, const Vector3& t) {
        return moment[0] * s[0] * t[0] + moment[3] * s[1] * t[1] + moment[5] * s[2] * t[2] +
               moment[1] * (s[0] * t[1] + s[1] * t[0]) + moment[2] * (s[0] * t[2] + s[2] * t[0]) +
               moment[4] * (s[1] * t[2] + s[2] * t[1]);
      };
      sum += (3 * mean(aa, aa) + 3 * mean(bb, bb) + 5 * mean(aa, bb) + 4 * mean(ab, ab)) / 360;
    }
    return sum / 4;
  }

  [[nodiscard]] double error_of(Index q) const {
    std::array<double, 4> middles;
    for (int i = 0; i < 4; ++i) middles[at(i)] = middle_[at(edge_[at(4 * q + i)])].off;
    return area_of(q) * weight_[at(q)] * (mean_square(centre_[at(q)].off, middles) + bending(q));
  }

  /// What its shape costs quad q, in units of the mean error.
  [[nodiscard]] double shape(Index q) const {
    double skew = 0, turn = 0;
    const Vector3& along = direction_[at(q)];
    const bool given = along.squaredNorm() > 0;
    for (int i = 0; i < 4; ++i) {
      const Vector3 x = corner(q, i + 1) - corner(q, i), y = corner(q, i + 3) - corner(q, i);
      const double xx = x.squaredNorm(), yy = y.squaredNorm();
      if (!(xx > 0) || !(yy > 0)) continue;
      skew += x.dot(y) * x.dot(y) / (xx * yy);
      if (given) {
        const double square = x.dot(along) * x.dot(along) / xx;
        turn += square * (1 - square);
      } else {
        const Vector3 z = (before_.row(quads_.quads(q, (i + 1) % 4)) - before_.row(quads_.quads(q, i))).transpose();
        if (const double zz = z.squaredNorm(); zz > 0) turn += 1 - x.dot(z) * x.dot(z) / (xx * zz);
      }
    }
    return options_.skew * skew + (given ? options_.stray : options_.turn) * turn;
  }

  /// The error and shape around v once it is shifted, on the planes that the samples are off from now.
  [[nodiscard]] double forecast(Index v, const Vector3& shift) const {
    double sum = 0;
    for (const Index k : corners_.at(v)) {
      const Index q = k / 4;
      const int i = k % 4;
      const Sample& c = centre_[at(q)];
      std::array<double, 4> middles;
      for (int side = 0; side < 4; ++side) {
        const Sample& m = middle_[at(edge_[at(4 * q + side)])];
        middles[at(side)] = m.off + (side == i || side == (i + 3) % 4 ? m.normal.dot(shift) / 2 : 0);
      }
      const double error = mean_square(c.off + c.normal.dot(shift) / 4, middles) + bending(q);
      sum += area_of(q) * (weight_[at(q)] * error + unit_[at(q)] * shape(q));
    }
    return sum;
  }
  [[nodiscard]] double measured(Index v) const {
    double sum = 0;
    for (const Index k : corners_.at(v)) {
      const Index q = k / 4;
      sum += error_of(q) + unit_[at(q)] * area_of(q) * shape(q);
    }
    return sum;
  }
  [[nodiscard]] double least_jacobian(Index v) const {
    double least = 1;
    for (const Index k : corners_.at(v))
      least = std::min(least, scaled_jacobian(quads_.positions, quads_.quads.row(k / 4)));
    return least;
  }

  /// Takes the samples around v anew, or puts back those that `scratch` holds.
  void resample(Index v, Scratch& scratch) {
    scratch.clear();
    for_each_sample(v,
                    [&](Sample& own, const Vector3& p) { scratch.push_back(std::exchange(own, sample(p, own.foot))); });
  }
  void restore(Index v, const Scratch& scratch) {
    std::size_t k = 0;
    for_each_sample(v, [&](Sample& own, const Vector3&) { own = scratch[k++]; });
  }
  template <class Visit>
  void for_each_sample(Index v, Visit&& visit) {
    for (const Index k : corners_.at(v)) {
      const Index q = k / 4;
      const int i = k % 4;
      visit(centre_[at(q)], centre(q));
      visit(middle_[at(edge_[at(4 * q + i)])], middle(q, i));  // each edge at v begins there in one quad
    }
  }

  /// Returns how far the vertex went, relative to its edges.
  double move(Index v, Scratch& scratch) {
    const Vector3 here = point(v);
    const SurfacePoint source = quads_.source[at(v)];
    double edge = 0;
    for (const Index k : corners_.at(v)) edge += (corner(k / 4, k % 4 + 1) - here).norm();
    edge /= static_cast<double>(corners_.at(v).size());
    if (!(edge > 0)) return 0;

    const Vector3 normal = mesh_.normal(source.face), x = normal.unitOrthogonal(), y = normal.cross(x);
    const double h = 0.02 * edge;
    const auto shifted = [&](double along_x, double along_y) {
      const Vector3 shift = along_x * x + along_y * y;
      quads_.positions.row(v) = (here + shift).transpose();
      return forecast(v, shift);
    };
    const double now = shifted(0, 0), right = shifted(h, 0), left = shifted(-h, 0), up = shifted(0, h),
                 down = shifted(0, -h), both = shifted(h, h);
    quads_.positions.row(v) = here.transpose();
    const Eigen::Vector2d slope((right - left) / (2 * h), (up - down) / (2 * h));
    Eigen::Matrix2d bend;
    bend(0, 0) = (right - 2 * now + left) / (h * h);
    bend(1, 1) = (up - 2 * now + down) / (h * h);
    bend(0, 1) = bend(1, 0) = (both - right - up + now) / (h * h);
    const double trace = bend.trace();
    const bool convex = trace > 0 && bend.determinant() > 1e-6 * trace * trace;
    const Eigen::Vector2d way = convex ? Eigen::Vector2d(-bend.inverse() * slope) : Eigen::Vector2d(-slope);
    const double length = way.norm();
    double step = convex ? std::min(length, 0.25 * edge) : 0.1 * edge;
    if (!(length > 0) || step < 1e-3 * edge) return 0;

    const double allowed = std::min(least_jacobian(v), options_.accepted);
    for (int trial = 0; trial < 3; ++trial, step /= 2) {
      const Vector3 there = here + step / length * (way[0] * x + way[1] * y);
      const SurfaceHit hit = walk_closest(mesh_, there, source);
      quads_.positions.row(v) = hit.position.transpose();
      if (least_jacobian(v) < allowed) continue;
      quads_.source[at(v)] = hit;
      resample(v, scratch);
      if (measured(v) < now) return (hit.position - here).norm() / edge;
      restore(v, scratch);
      quads_.source[at(v)] = source;
    }
    quads_.positions.row(v) = here.transpose();
    return 0;
  }

  const TriangleMesh<double>& mesh_;
  const SlideTargets& targets_;
  const SlideOptions& options_;
  QuadMesh& quads_;
  const QuadCorners corners_;
  const Points<double> before_;
  std::vector<char> fixed_;
  std::vector<Index> edge_;              // of each side
  std::vector<Sample> centre_, middle_;  // of each quad, of each edge
  std::vector<double> unit_;             // of each quad: the mean square error of its component at the beginning
  std::vector<double> weight_;           // of each quad
  std::vector<Vector3> direction_;       // of each quad, or zero
  std::vector<double> step_;             // the last of each vertex
  std::vector<std::vector<Index>> colors_;
};

}  // namespace detail

QUADRIG_INLINE SlideReport slide(const TriangleMesh<double>& mesh, const SlideTargets& targets, std::vector<char> held,
                                 const SlideOptions& options, QuadMesh& quads, Context& context) {
  return detail::Slider(mesh, targets, std::move(held), options, quads, context).run(context);
}

}  // namespace quadrig
