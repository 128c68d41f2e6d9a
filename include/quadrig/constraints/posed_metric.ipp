// Definitions of constraints/posed_metric.hpp.
#pragma once

#include <numbers>

#include "quadrig/constraints/posed_metric.hpp"

namespace quadrig {

QUADRIG_INLINE Status PosedForms::Options::validate() const {
  const auto bad = [](const char* what, const char* where, const char* remedy) {
    return Status(Error{ErrorCode::bad_option, what, where, remedy});
  };
  for (const double w : pose_weights)
    if (!(w >= 0) || !std::isfinite(w)) return bad("a pose has a negative weight", "pose_weights", "give weights ≥ 0");
  if (!(rest_weight >= 0) || !std::isfinite(rest_weight))
    return bad("negative weight", "rest_weight", "give 0 or more");
  if (smoothing < 0 || smoothing > 100) return bad("out of range", "smoothing", "give 0 to 100 rounds");
  if (!(rigid_tolerance >= 0 && rigid_tolerance < 1)) return bad("out of range", "rigid_tolerance", "give 0 to 1");
  if (!(least_area_ratio >= 0 && least_area_ratio <= 1)) return bad("out of range", "least_area_ratio", "give 0 to 1");
  return {};
}

QUADRIG_INLINE Status PosedMetricOptions::validate() const {
  const auto bad = [](const char* where, const char* remedy) {
    return Status(Error{ErrorCode::bad_option, "out of range", where, remedy});
  };
  if (!(largest_aspect >= 1 && largest_aspect <= 100)) return bad("largest_aspect", "give 1 to 100");
  if (!(joint_weight > 0 && joint_weight <= 1e6)) return bad("joint_weight", "give more than 0, at most 1e6");
  if (!(least_density >= 0 && least_density < 1)) return bad("least_density", "give 0 to below 1");
  if (!(largest_density > 1)) return bad("largest_density", "give more than 1");
  return {};
}

namespace detail {

/// Vertex neighbours, each vertex's in a row: ends of its edges, by half-edge.
struct VertexRings {
  std::vector<std::size_t> first;
  std::vector<Index> neighbour;
  std::vector<std::size_t> first_face;
  std::vector<Index> face;

  explicit VertexRings(const TriangleMesh<double>& mesh)
      : first(static_cast<std::size_t>(mesh.vertex_count()) + 1, 0), first_face(first) {
    const auto pass = [&](auto&& edge, auto&& corner) {
      for (Index h = 0; h < mesh.halfedge_count(); ++h) {
        edge(mesh.origin(h), mesh.target(h));
        if (mesh.twin(h) == no_index) edge(mesh.target(h), mesh.origin(h));
        corner(mesh.origin(h), h / 3);
      }
    };
    pass([&](Index v, Index) { ++first[static_cast<std::size_t>(v) + 1]; },
         [&](Index v, Index) { ++first_face[static_cast<std::size_t>(v) + 1]; });
    for (std::size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1], first_face[v] += first_face[v - 1];
    neighbour.resize(first.back());
    face.resize(first_face.back());
    std::vector<std::size_t> next(first.begin(), first.end() - 1), next_face(first_face.begin(), first_face.end() - 1);
    pass([&](Index v, Index u) { neighbour[next[static_cast<std::size_t>(v)]++] = u; },
         [&](Index v, Index f) { face[next_face[static_cast<std::size_t>(v)]++] = f; });
  }
  [[nodiscard]] std::span<const Index> around(Index v) const {
    const auto i = static_cast<std::size_t>(v);
    return {neighbour.data() + first[i], first[i + 1] - first[i]};
  }
  [[nodiscard]] std::span<const Index> faces_at(Index v) const {
    const auto i = static_cast<std::size_t>(v);
    return {face.data() + first_face[i], first_face[i + 1] - first_face[i]};
  }
};

/// Second fundamental forms of the surface in one pose, around the vertices where it does not move as a rigid body.
/// One object serves many poses in turn: its arrays are as long as the mesh, its work is not.
class FormEvaluator {
 public:
  /// `run` polls `context`, where there is one, and returns early once it is cancelled: the result is invalid then.
  FormEvaluator(const TriangleMesh<double>& mesh, const Connection<double>& connection, const VertexRings& rings,
                Index smoothing, const Context* context = nullptr)
      : mesh_(mesh),
        connection_(connection),
        rings_(rings),
        smoothing_(smoothing),
        context_(context),
        level_(static_cast<std::size_t>(mesh.vertex_count()), no_index),
        slot_(level_.size(), no_index),
        face_seen_(static_cast<std::size_t>(mesh.face_count()), 0),
        normals_(static_cast<std::size_t>(mesh.vertex_count())),
        smoothed_(normals_) {}

  /// Calls found(face, form) for each face with a corner in `seeds` grown by the reach of the normals, faces ascending.
  /// `place(vertices)` gives the posed positions of these vertices, a row each.
  template <class Place, class Found>
  void run(std::span<const Index> seeds, double least_area_ratio, Place&& place, Found&& found) {
    grow(seeds);
    const Points<double> posed = place(std::span<const Index>(order_));
    const auto at = [&](Index v) { return Vector3(posed.row(slot_[static_cast<std::size_t>(v)]).transpose()); };

    // Normals of all but the outermost ring, which is there for their faces only.
    const std::size_t rings = ring_end_.size();
    for (std::size_t k = 0; k < ring_end_[rings - 2]; ++k) {
      if (cancelled(k)) return;
      const Index v = order_[k];
      Vector3 sum = Vector3::Zero();
      for (const Index f : rings_.faces_at(v)) {
        const auto t = mesh_.faces().row(f);
        const Vector3 a = at(t[0]);
        sum += (at(t[1]) - a).cross(at(t[2]) - a);
      }
      normals_[static_cast<std::size_t>(v)] = unit(sum);
    }
    for (Index round = 0; round < smoothing_; ++round) {
      const std::size_t end = ring_end_[rings - 3 - static_cast<std::size_t>(round)];
      for (std::size_t k = 0; k < end; ++k) {
        if (cancelled(k)) return;
        const Index v = order_[k];
        Vector3 sum = Vector3::Zero();
        for (const Index u : rings_.around(v)) sum += normals_[static_cast<std::size_t>(u)];
        const double count = static_cast<double>(std::max<std::size_t>(1, rings_.around(v).size()));
        smoothed_[static_cast<std::size_t>(v)] = unit(normals_[static_cast<std::size_t>(v)] + sum / count);
      }
      for (std::size_t k = 0; k < end; ++k)
        normals_[static_cast<std::size_t>(order_[k])] = smoothed_[static_cast<std::size_t>(order_[k])];
    }
    std::size_t done = 0;
    for (const Index f : faces_) {
      if (cancelled(done++)) return;
      const auto t = mesh_.faces().row(f);
      // D carries a tangent vector of the rest face to coefficients of its two first edges.
      const Complex e1 = connection_.to_complex(f, mesh_.edge_vector(3 * f));
      const Complex e2 = connection_.to_complex(f, -mesh_.edge_vector(3 * f + 2));
      Eigen::Matrix2d edges;
      edges << e1.real(), e2.real(), e1.imag(), e2.imag();
      const Eigen::Matrix2d d = edges.inverse();
      Eigen::Matrix<double, 3, 2> span, turn;
      span << at(t[1]) - at(t[0]), at(t[2]) - at(t[0]);
      turn << normal(t[1]) - normal(t[0]), normal(t[2]) - normal(t[0]);
      const Eigen::Matrix<double, 3, 2> gradient = span * d;
      const Eigen::Matrix2d form = -(gradient.transpose() * (turn * d));
      double scale = 1;
      if (least_area_ratio > 0) scale = std::min(1.0, gradient.col(0).cross(gradient.col(1)).norm() / least_area_ratio);
      found(f, PosedForms::Form{scale * form(0, 0), scale * 0.5 * (form(0, 1) + form(1, 0)), scale * form(1, 1), 0});
    }
    for (const Index v : order_) level_[static_cast<std::size_t>(v)] = slot_[static_cast<std::size_t>(v)] = no_index;
    for (const Index f : faces_) face_seen_[static_cast<std::size_t>(f)] = 0;
  }

 private:
  static Vector3 unit(const Vector3& v) {
    const double length = v.norm();
    return length > 0 ? Vector3(v / length) : Vector3::Zero();
  }
  [[nodiscard]] bool cancelled(std::size_t k) const { return k % 4096 == 0 && context_ && context_->cancelled(); }
  [[nodiscard]] const Vector3& normal(Index v) const { return normals_[static_cast<std::size_t>(v)]; }

  // Rings about the seeds. A normal that differs from a rigid body's has a seed within `smoothing` edges; faces with
  // such a corner are wanted, their normals need as many rings again, and those their faces' corners.
  void grow(std::span<const Index> seeds) {
    order_.assign(seeds.begin(), seeds.end());
    std::sort(order_.begin(), order_.end());
    for (const Index v : order_) level_[static_cast<std::size_t>(v)] = 0;
    ring_end_.assign(1, order_.size());
    const auto add_ring = [&] {
      const std::size_t begin = ring_end_.size() > 1 ? ring_end_[ring_end_.size() - 2] : 0, end = order_.size();
      for (std::size_t k = begin; k < end; ++k)
        for (const Index u : rings_.around(order_[k]))
          if (level_[static_cast<std::size_t>(u)] == no_index) {
            level_[static_cast<std::size_t>(u)] = 0;
            order_.push_back(u);
          }
      ring_end_.push_back(order_.size());
    };
    for (Index k = 0; k < smoothing_; ++k) add_ring();
    faces_.clear();
    for (const Index v : order_)
      for (const Index f : rings_.faces_at(v))
        if (!face_seen_[static_cast<std::size_t>(f)]) {
          face_seen_[static_cast<std::size_t>(f)] = 1;
          faces_.push_back(f);
        }
    std::sort(faces_.begin(), faces_.end());
    for (Index k = 0; k <= smoothing_ + 1; ++k) add_ring();
    for (std::size_t k = 0; k < order_.size(); ++k) slot_[static_cast<std::size_t>(order_[k])] = static_cast<Index>(k);
  }

  const TriangleMesh<double>& mesh_;
  const Connection<double>& connection_;
  const VertexRings& rings_;
  Index smoothing_;
  const Context* context_;
  std::vector<Index> level_, slot_, order_, faces_;
  std::vector<std::size_t> ring_end_;  // order_[0, ring_end_[k]) are the vertices within k edges of the seeds
  std::vector<char> face_seen_;
  std::vector<Vector3> normals_, smoothed_;
};

/// Vertices that the pose does not carry along with all their neighbours as one rigid body.
inline std::vector<Index> bending_vertices(const VertexRings& rings, const SkinWeights& weights, const Pose& pose,
                                           double tolerance) {
  std::vector<Index> group = rigid_groups(pose);
  for (std::size_t b = 0; b < pose.size(); ++b) {
    const Eigen::Matrix3d m = pose[b].linear();
    const bool rigid = (m.transpose() * m - Eigen::Matrix3d::Identity()).norm() < 1e-6 && m.determinant() > 0;
    if (!rigid) group[b] = no_index;
  }
  const auto n = static_cast<std::size_t>(weights.rows());
  std::vector<Index> holder(n, no_index);  // the one body that holds the vertex
  std::vector<double> share(pose.size(), 0);
  for (std::size_t v = 0; v < n; ++v) {
    double sum = 0, most = 0;
    Index best = no_index;
    for (SkinWeights::InnerIterator it(weights, static_cast<Index>(v)); it; ++it) {
      sum += it.value();
      const Index g = group[static_cast<std::size_t>(it.col())];
      if (g == no_index) continue;
      double& s = share[static_cast<std::size_t>(g)];
      s += it.value();
      if (s > most) most = s, best = g;
    }
    for (SkinWeights::InnerIterator it(weights, static_cast<Index>(v)); it; ++it)
      if (const Index g = group[static_cast<std::size_t>(it.col())]; g != no_index)
        share[static_cast<std::size_t>(g)] = 0;
    if (sum - most <= tolerance) holder[v] = best;
  }
  std::vector<Index> bending;
  for (std::size_t v = 0; v < n; ++v) {
    bool bends = holder[v] == no_index;
    for (const Index u : rings.around(static_cast<Index>(v)))
      bends = bends || holder[static_cast<std::size_t>(u)] != holder[v];
    if (bends) bending.push_back(static_cast<Index>(v));
  }
  return bending;
}

/// Vertices that a morph target moves apart from a neighbour.
inline std::vector<Index> moved_vertices(const TriangleMesh<double>& mesh, const VertexRings& rings,
                                         const Points<double>& morph) {
  constexpr double still = 1e-3;  // of an edge
  std::vector<Index> moved;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (std::ranges::any_of(rings.around(v), [&](Index u) {
          return (morph.row(v) - morph.row(u)).norm() >
                 still * (mesh.positions().row(v) - mesh.positions().row(u)).norm();
        }))
      moved.push_back(v);
  return moved;
}

inline std::vector<Index> all_vertices(const TriangleMesh<double>& mesh) {
  std::vector<Index> all(static_cast<std::size_t>(mesh.vertex_count()));
  for (std::size_t v = 0; v < all.size(); ++v) all[v] = static_cast<Index>(v);
  return all;
}

/// The form of each face at rest, of weight 1; invalid once the context is cancelled.
inline std::vector<PosedForms::Form> rest_forms(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                                const VertexRings& rings, Index smoothing, const Context* context) {
  std::vector<PosedForms::Form> forms(static_cast<std::size_t>(mesh.face_count()));
  FormEvaluator(mesh, connection, rings, smoothing, context)
      .run(
          all_vertices(mesh), 0,
          [&](std::span<const Index> vertices) {
            Points<double> points(static_cast<Eigen::Index>(vertices.size()), 3);
            for (std::size_t k = 0; k < vertices.size(); ++k)
              points.row(static_cast<Eigen::Index>(k)) = mesh.positions().row(vertices[k]);
            return points;
          },
          [&](Index f, PosedForms::Form form) {
            form.weight = 1;
            forms[static_cast<std::size_t>(f)] = form;
          });
  return forms;
}

}  // namespace detail

QUADRIG_INLINE PosedForms PosedForms::at_rest(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                              Index smoothing) {
  PosedForms result;
  result.forms_ = detail::rest_forms(mesh, connection, detail::VertexRings(mesh), smoothing, nullptr);
  result.first_.resize(static_cast<std::size_t>(mesh.face_count()) + 1);
  for (std::size_t f = 0; f < result.first_.size(); ++f) result.first_[f] = f;
  return result;
}

QUADRIG_INLINE Expected<PosedForms> PosedForms::create(const TriangleMesh<double>& mesh,
                                                       const Connection<double>& connection, const SkinWeights& weights,
                                                       std::span<const Pose> poses, const Options& options,
                                                       Context& context) {
  if (const Status valid = options.validate(); !valid) return valid.error();
  const auto misfit = [](std::string what, std::string where) {
    return Error{ErrorCode::bad_input, std::move(what), std::move(where), "give a rig that fits the mesh"};
  };
  if (!poses.empty() && weights.rows() != mesh.vertex_count())
    return misfit(std::to_string(weights.rows()) + " rows for " + std::to_string(mesh.vertex_count()) + " vertices",
                  "skin weights");
  for (std::size_t p = 0; p < poses.size(); ++p)
    if (static_cast<Eigen::Index>(poses[p].size()) != weights.cols())
      return misfit(std::to_string(poses[p].size()) + " transforms for " + std::to_string(weights.cols()) + " bones",
                    "pose " + std::to_string(p));
  if (!options.pose_weights.empty() && options.pose_weights.size() != poses.size())
    return Error{
        ErrorCode::bad_option,
        std::to_string(options.pose_weights.size()) + " weights for " + std::to_string(poses.size()) + " poses",
        "pose_weights", "give one weight a pose"};
  for (std::size_t k = 0; k < options.morphs.size(); ++k)
    if (options.morphs[k].rows() != mesh.vertex_count())
      return misfit("not one row a vertex", "morph " + std::to_string(k));
  const std::size_t all = poses.size() + options.morphs.size();
  const auto pose_weight = [&](std::size_t p) {
    return options.pose_weights.empty() || p >= poses.size() ? 1.0 : options.pose_weights[p];
  };
  double total = options.rest_weight;
  for (std::size_t p = 0; p < all; ++p) total += pose_weight(p);
  if (!(total > 0))
    return Error{ErrorCode::bad_option, "all poses weigh nothing", "rest_weight, pose_weights",
                 "give one of them weight"};

  if (context.cancelled()) return cancelled_error("posed curvature");
  const detail::VertexRings rings(mesh);
  const std::vector<Form> rest = detail::rest_forms(mesh, connection, rings, options.smoothing, &context);
  if (context.cancelled()) return cancelled_error("posed curvature");
  struct Moved {
    Index face;
    Form form;
  };
  std::vector<std::vector<Moved>> moved(all);
  context.parallel_for(all, 4, [&](std::size_t begin, std::size_t end) {
    detail::FormEvaluator evaluator(mesh, connection, rings, options.smoothing, &context);
    for (std::size_t p = begin; p < end; ++p) {
      if (context.cancelled() || pose_weight(p) == 0) continue;
      const Points<double>* morph = p < poses.size() ? nullptr : &options.morphs[p - poses.size()];
      const std::vector<Index> seeds =
          morph ? detail::moved_vertices(mesh, rings, *morph)
                : detail::bending_vertices(rings, weights, poses[p], options.rigid_tolerance);
      if (seeds.empty() || context.cancelled()) continue;
      const auto place = [&](std::span<const Index> vertices) {
        Points<double> points(static_cast<Eigen::Index>(vertices.size()), 3);
        for (std::size_t k = 0; k < vertices.size(); ++k) {
          points.row(static_cast<Eigen::Index>(k)) = mesh.positions().row(vertices[k]);
          if (morph) points.row(static_cast<Eigen::Index>(k)) += morph->row(vertices[k]);
        }
        return morph ? points : skin(points, rows_of(weights, vertices), poses[p], options.skinning);
      };
      evaluator.run(seeds, options.least_area_ratio, place, [&](Index f, Form form) {
        form.weight = pose_weight(p) / total;
        moved[p].push_back({f, form});
      });
    }
  });
  if (context.cancelled()) return cancelled_error("posed curvature");

  PosedForms result;
  result.first_.assign(static_cast<std::size_t>(mesh.face_count()) + 1, 1);
  result.first_[0] = 0;
  for (const auto& list : moved)
    for (const Moved& m : list) ++result.first_[static_cast<std::size_t>(m.face) + 1];
  for (std::size_t f = 1; f < result.first_.size(); ++f) result.first_[f] += result.first_[f - 1];
  if (context.cancelled()) return cancelled_error("posed curvature");
  result.forms_.reserve(result.first_.back());
  while (result.forms_.size() < result.first_.back()) {  // so much memory is not had at once
    if (context.cancelled()) return cancelled_error("posed curvature");
    result.forms_.resize(std::min(result.first_.back(), result.forms_.size() + 262'144));
  }
  std::vector<std::size_t> next(result.first_.begin(), result.first_.end() - 1);
  for (std::size_t f = 0; f < next.size(); ++f) {
    result.forms_[next[f]] = rest[f];
    ++next[f];
  }
  for (auto& list : moved) {
    if (context.cancelled()) return cancelled_error("posed curvature");
    for (const Moved& m : std::exchange(list, {})) {
      result.forms_[next[static_cast<std::size_t>(m.face)]++] = m.form;
      result.forms_[result.first_[static_cast<std::size_t>(m.face)]].weight -= m.form.weight;
    }
  }
  for (std::size_t f = 0; f < next.size(); ++f) {  // what is left is the share of rest and of rigid motion
    double& left = result.forms_[result.first_[f]].weight;
    left = std::max(left, 0.0);
  }
  return result;
}

QUADRIG_INLINE double PosedForms::mean_square_error(Index face, Complex a, Complex b) const {
  double sum = 0;
  for (const Form& form : of_face(face)) {
    const double aa = form.at(a), bb = form.at(b), ab = 0.5 * (form.at(a + b) - aa - bb);
    sum += form.weight * (3 * aa * aa + 3 * bb * bb + 5 * aa * bb + 4 * ab * ab) / 360;
  }
  return sum;
}

namespace detail {

/// E at unit area for edges along z and i z, at the aspect |a| / |b| that is best for this direction.
struct BestAspect {
  double error = 0;
  double aspect = 1;
};

inline BestAspect best_aspect(std::span<const PosedForms::Form> forms, Complex z, double largest) {
  double s11 = 0, s22 = 0, fixed = 0;  // Σ A², Σ B², and what the aspect does not change, all at aspect 1
  const double xx = z.real() * z.real(), xy = z.real() * z.imag(), yy = z.imag() * z.imag();
  for (const PosedForms::Form& form : forms) {
    const double a = form.xx * xx + 2 * form.xy * xy + form.yy * yy;
    const double b = form.xx * yy - 2 * form.xy * xy + form.yy * xx;
    s11 += form.weight * a * a;
    s22 += form.weight * b * b;
    const double m = form.xy * (xx - yy) + (form.yy - form.xx) * xy;
    fixed += form.weight * (5 * a * b + 4 * m * m);
  }
  // E = (3 ρ² s11 + 3 s22 / ρ² + fixed) / 360, least at ρ⁴ = s22 / s11, and monotone on either side of it
  double square = s11 > 0 ? std::sqrt(s22 / s11) : s22 > 0 ? largest * largest : 1.0;
  square = std::clamp(square, 1 / (largest * largest), largest * largest);
  const double changing = square * s11 + s22 / square;
  return {std::max(0.0, (3 * changing + fixed) / 360), std::sqrt(square)};
}

}  // namespace detail

QUADRIG_INLINE Expected<PosedMetric> posed_metric(const TriangleMesh<double>& mesh, const PosedForms& forms,
                                                  std::span<const double> omega1, const PosedMetricOptions& options,
                                                  Context& context) {
  if (const Status valid = options.validate(); !valid) return valid.error();
  const auto m = static_cast<std::size_t>(mesh.face_count());
  if (forms.face_count() != mesh.face_count() || (!omega1.empty() && omega1.size() != m))
    return Error{ErrorCode::bad_input, "another number of faces than the mesh has", "posed metric",
                 "give forms and dominance of this mesh"};
  PosedMetric metric;
  metric.direction.assign(m, Complex(1));
  metric.aspect.assign(m, 1);
  metric.alignment.assign(m, 0);
  metric.error.assign(m, 0);
  metric.density.assign(m, 1);
  std::vector<double> error_at_45(m, 0);

  constexpr int scan = 18;  // 5° apart over a right angle
  constexpr double step = std::numbers::pi / 2 / scan;
  context.parallel_for(m, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      if (f % 256 == 0 && context.cancelled()) return;
      const auto of_face = forms.of_face(static_cast<Index>(f));
      const auto at = [&](double angle) {
        return detail::best_aspect(of_face, elementary::polar(1.0, angle), options.largest_aspect);
      };
      double errors[scan];
      int best = 0;
      for (int k = 0; k < scan; ++k) {
        errors[k] = at(k * step).error;
        if (errors[k] < errors[best]) best = k;
      }
      // Two steps of parabolic descent from the least of the scan, kept only while they descend.
      double angle = best * step, reach = step;
      double here = errors[best], left = errors[(best + scan - 1) % scan], right = errors[(best + 1) % scan];
      for (int round = 0; round < 3; ++round) {
        const double bend = left - 2 * here + right;
        if (!(bend > 0)) break;
        const double to = angle + std::clamp(0.5 * (left - right) / bend, -1.0, 1.0) * reach;
        if (const double there = at(to).error; there < here) here = there, angle = to;
        reach /= 4;
        left = at(angle - reach).error;
        right = at(angle + reach).error;
        if (left < here) here = left, angle -= reach, right = at(angle + reach).error, left = at(angle - reach).error;
        if (right < here) here = right, angle += reach, left = at(angle - reach).error, right = at(angle + reach).error;
      }
      const detail::BestAspect found = at(angle);
      const bool long_first = found.aspect >= 1;
      metric.direction[f] = elementary::polar(1.0, long_first ? angle : angle + std::numbers::pi / 2);
      metric.aspect[f] = long_first ? found.aspect : 1 / found.aspect;
      metric.error[f] = found.error;
      error_at_45[f] = at(angle + std::numbers::pi / 4).error;
    }
  });
  if (context.cancelled()) return cancelled_error("posed curvature");

  // Densities with mean 1 between the bounds: scale and clamp until the mean stays.
  double area = 0, mean = 0;
  for (std::size_t f = 0; f < m; ++f) {
    const double joint = omega1.empty() ? 1 : 1 + (options.joint_weight - 1) * std::clamp(1 - omega1[f], 0.0, 1.0);
    metric.density[f] = elementary::cbrt(joint * metric.error[f]);
    area += mesh.area(static_cast<Index>(f));
    mean += mesh.area(static_cast<Index>(f)) * metric.density[f];
  }
  mean /= area;
  const double flat = options.least_density * mean;  // of (j E)^{1/3}: below it, curvature does not set the density
  if (!(mean > 0)) {
    metric.density.assign(m, 1);
    return metric;
  }
  std::vector<double> bounded(m);
  double scale = 1 / mean;
  for (int round = 0; round < 60; ++round) {
    double sum = 0;
    for (std::size_t f = 0; f < m; ++f) {
      bounded[f] = std::clamp(scale * metric.density[f], options.least_density, options.largest_density);
      sum += mesh.area(static_cast<Index>(f)) * bounded[f];
    }
    scale *= area / sum;
    if (std::abs(area / sum - 1) < 1e-12) break;
  }
  double sum = 0;
  for (std::size_t f = 0; f < m; ++f) sum += mesh.area(static_cast<Index>(f)) * bounded[f];
  for (std::size_t f = 0; f < m; ++f) metric.density[f] = bounded[f] * (area / sum);

  // The cost of turning by 45°. Noise on flat parts, where the error is a small share of the whole, is left out.
  const double noise = 0.1 * flat * flat * flat;
  for (std::size_t f = 0; f < m; ++f)
    if (error_at_45[f] > 0)
      metric.alignment[f] =
          std::clamp(1 - metric.error[f] / error_at_45[f], 0.0, 1.0) * error_at_45[f] / (error_at_45[f] + noise);
  return metric;
}

}  // namespace quadrig
