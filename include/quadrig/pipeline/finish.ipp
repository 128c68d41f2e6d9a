#pragma once

#include <iomanip>
#include <sstream>

#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/quality/coverage.hpp"

namespace quadrig {

namespace detail {

/// From the quads of all components to the result: the fit, the weights, the report, and the check of it all.
class Finisher {
 public:
  Finisher(const Asset& asset, const RemeshOptions& options, UnfittedQuads quads, Context& context)
      : asset_(asset), mesh_(asset.mesh), options_(options), quads_(std::move(quads)), context_(context) {}

  [[nodiscard]] Expected<RemeshResult> run() {
    const Stopwatch total;
    const SpanTimer span(context_, "finish");
    const ProgressPart whole(context_, 0, 1);
    context_.progress("fit", parts_done);
    if (Status status = finish(); !status.ok()) return status.error();
    RemeshReport& report = quads_.report;
    measure_coverage(report);
    if (context_.cancelled()) return cancelled_error("check of the result");
    sum_up(report);
    for (const Warning& warning : report.warnings) context_.warnings.push_back(warning);
    report.seconds.total += total.seconds();
    SurfaceTopology topology(mesh_);
    topology.euler -= quads_.holes;
    topology.loops += quads_.holes;
    if (std::string defect = unlike(quad_topology(quads_.mesh.quads, report.vertices), topology);
        !defect.empty() || !(report.scaled_jacobian_minimum > 0))
      return Error{ErrorCode::stage_failed, defect.empty() ? "a quad stays inverted" : defect, "check of the result",
                   "ask for another count or the static preset"};
    context_.progress("done", 1);
    return RemeshResult{std::move(quads_.mesh), std::move(weights_),    std::move(morphs_),
                        std::move(report),      std::move(quads_.maps), std::move(quads_.twin)};
  }

 private:
  /// The fit, and weights of the vertices where they came to lie.
  [[nodiscard]] Status finish() {
    const Stopwatch watch;
    const SpanTimer span(context_, "fit");
    std::vector<char> held = quads_.held;
    // Lines of edges that are kept are smooth in a cage, as a renderer without creases of its own makes them. Flat
    // quads are fitted to those that are edges of the surface.
    if (options_.fit.method != FitMethod::subdivision) {
      const bool fitted = options_.fit.method == FitMethod::surface && !quads_.kept.empty();
      const std::optional<EdgeCurves> curves =
          fitted ? std::optional<EdgeCurves>(std::in_place, mesh_, quads_.kept) : std::nullopt;
      constexpr double near = 1e-6;
      for (std::size_t v = 0; v < held.size(); ++v)
        if (quads_.on_features[v] && !(curves && curves->under(quads_.mesh.source[v], near) != no_index)) held[v] = 1;
    }
    if (options_.fit.method == FitMethod::slide)
      (void)slide(mesh_, quads_.targets, beside_surface_held(held), options_.fit.slide, quads_.mesh, context_);
    if (context_.cancelled()) return cancelled_error("fit");
    FitMotion motion;
    SurfaceBends bends;
    const bool bent = asset_.rig && options_.poses.empty();
    if (bent) {
      bends = surface_bends(asset_.rig->skeleton, asset_.rig->weights, options_.bend_degrees);
      motion.weights = &bends.weights;
      motion.poses = bends.poses;
      motion.rest_weight += bends.still;
    } else if (asset_.rig) {
      motion.weights = &asset_.rig->weights;
      motion.poses = options_.poses;
      motion.pose_weights = options_.pose_weights;
    }
    motion.influences = options_.influences;
    motion.morphs = options_.morphs;
    Expected<FittedQuads> fitted = fit(mesh_, std::move(quads_.mesh), motion, std::move(held), options_.fit, context_,
                                       options_.solver.factory<double>(), quads_.kept);
    if (!fitted) return fitted.error();
    if (bent) fitted->weights = with_all_bones(*fitted->weights, bends);
    if (quads_.report.symmetry.plane && !quads_.twin.empty()) make_alike(*fitted);
    if (context_.cancelled()) return cancelled_error("fit");
    quads_.mesh = std::move(fitted->mesh);
    weights_ = std::move(fitted->weights);
    morphs_ = std::move(fitted->morphs);
    quads_.report.fit = fitted->report;
    quads_.report.seconds.fit += watch.seconds();
    return {};
  }

  /// Both sides of the mirror plane, where the surface is symmetric.
  void make_alike(FittedQuads& fitted) {
    SymmetryReport& symmetry = quads_.report.symmetry;
    const bool stays = options_.fit.method == FitMethod::slide || options_.fit.method == FitMethod::none;
    if (stays) mirror_along_surface(*symmetry.plane, fitted.mesh);
    const QuadMesh before = fitted.mesh;
    symmetry.vertices = symmetrize(mesh_, asset_.rig ? &asset_.rig->weights : nullptr, options_.morphs, *symmetry.plane,
                                   quads_.twin, quads_.held, options_.influences, fitted, context_);
    if (!stays) return;
    // What would leave the surface keeps its place.
    for (Index v = 0; v < before.vertex_count(); ++v) {
      const Index w = quads_.twin[at(v)];
      if (w == no_index || on_surface(fitted.mesh, v)) continue;
      for (const Index back : {v, w}) {
        fitted.mesh.positions.row(back) = before.positions.row(back);
        fitted.mesh.source[at(back)] = before.source[at(back)];
      }
      if (symmetry.vertices.exact > 0) --symmetry.vertices.exact;
    }
  }
  [[nodiscard]] bool on_surface(const QuadMesh& mesh, Index v) const {
    constexpr double close = 1e-13;
    const Vector3 off = position(mesh_, mesh.source[at(v)]) - mesh.positions.row(v).transpose();
    return off.norm() <= close * mesh_.diagonal();
  }
  /// Of each pair the second goes to the image of the first where that lies on the surface; those on the plane go to
  /// where it meets the surface.
  void mirror_along_surface(const MirrorPlane& plane, QuadMesh& mesh) const {
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      const Index w = quads_.twin[at(v)];
      if (w == no_index || w < v || mesh.source[at(v)].face == no_index) continue;
      Vector3 p = mesh.positions.row(v).transpose();
      SurfaceHit hit;
      static_cast<SurfacePoint&>(hit) = mesh.source[at(w)];
      const int turns = v == w ? 8 : 1;  // from the plane to the surface and back
      for (int turn = 0; turn < turns; ++turn) {
        p = v == w ? Vector3(p - plane.side(p) * plane.normal) : plane.mirrored(p);
        hit = walk_closest(mesh_, p, hit);
        if (v == w) p = hit.position;
      }
      if (v != w && (hit.position - p).norm() > 1e-9 * mesh_.diagonal()) continue;
      mesh.positions.row(w) = hit.position.transpose();
      mesh.source[at(w)] = hit;
    }
  }

  /// Weights of the bones that bend the surface, in the columns of all bones.
  [[nodiscard]] SkinWeights with_all_bones(const SkinWeights& weights, const SurfaceBends& bends) const {
    SkinWeights all(weights.rows(), asset_.rig->weights.cols());
    all.reserve(weights.nonZeros());
    for (Index v = 0; v < weights.rows(); ++v) {
      all.startVec(v);
      for (SkinWeights::InnerIterator it(weights, v); it; ++it)
        all.insertBack(v, bends.bones[at(static_cast<Index>(it.col()))]) = it.value();
    }
    all.finalize();
    return all;
  }
  /// Vertices that lie beside the surface, as some of split parts do, cannot slide along it: they are held too.
  [[nodiscard]] std::vector<char> beside_surface_held(std::vector<char> held) const {
    const double near = 1e-9 * mesh_.diagonal();
    for (Index v = 0; v < quads_.mesh.vertex_count(); ++v)
      if ((position(mesh_, quads_.mesh.source[at(v)]) - quads_.mesh.positions.row(v).transpose()).norm() > near)
        held[at(v)] = 1;
    return held;
  }

  /// What each component's quads, which lie one component after the other, leave out of it.
  void measure_coverage(RemeshReport& report) const {
    const Components components = face_components(mesh_);
    std::vector<std::vector<Index>> faces(at(components.count));
    for (Index f = 0; f < mesh_.face_count(); ++f) faces[at(components.of_face[at(f)])].push_back(f);
    std::vector<Index> first{0};
    for (const ComponentReport& part : report.components) first.push_back(first.back() + part.quads);
    const auto measure = [&](std::size_t c, const Context& context) {
      ComponentReport& part = report.components[c];
      const QuadMesh& quads = quads_.mesh;
      double area = 0, quad_area = 0;
      for (const Index f : faces[c]) area += mesh_.area(f);
      part.edge = std::sqrt(area / part.quads);
      const Quads own = quads.quads.middleRows(first[c], part.quads);
      for (Index q = 0; q < part.quads; ++q) {
        const auto corner = [&](int i) { return Vector3(quads.positions.row(own(q, i)).transpose()); };
        quad_area += (corner(2) - corner(0)).cross(corner(3) - corner(1)).norm() / 2;
      }
      const double bound = ComponentReport::most_edges_off * part.edge;
      const Coverage covered = coverage(mesh_, faces[c], quads.positions, own, bound, context);
      const Stray strays = stray(mesh_, faces[c], quads, first[c], part.quads, bound, context);
      const bool bulges = strays.farthest > covered.farthest;
      part.farthest = bulges ? strays.farthest : covered.farthest;
      part.farthest_place = bulges ? strays.place : covered.place;
      part.share_missed = covered.share_beyond;
      part.area_ratio = area > 0 ? quad_area / area : 1;
    };
    if (faces.size() == 1) return measure(0, context_);
    context_.parallel_for(faces.size(), 1, [&](std::size_t begin, std::size_t end) {
      const Context quiet = context_.quiet(1);
      for (std::size_t c = begin; c < end && !quiet.cancelled(); ++c) measure(c, quiet);
    });
  }

  static constexpr Index most_named = 20;  // components, of each fault

  /// Which parts lost something, where and how much.
  void warn_of_misses(RemeshReport& report) const {
    Index missing = 0;
    for (std::size_t c = 0; c < report.components.size(); ++c) {
      const ComponentReport& part = report.components[c];
      if (!part.misses() || ++missing > most_named) continue;
      const auto number = [](double x) {
        std::ostringstream text;
        text << std::setprecision(3) << x;
        return text.str();
      };
      const Vector3& p = part.farthest_place;
      report.warnings.push_back(
          {"coverage", "component " + std::to_string(c) + ": the surface at (" + number(p[0]) + ", " + number(p[1]) +
                           ", " + number(p[2]) + ") lies " + number(part.farthest / part.edge) +
                           " edges of a quad from the quads, and " + number(100 * part.share_missed) +
                           " % of its area more than one; ask for more quads"});
    }
    if (missing > most_named)
      report.warnings.push_back({"coverage", std::to_string(missing - most_named) +
                                                 " more components lie farther than an edge from the quads"});
  }

  /// Figures and warnings of the report.
  void sum_up(RemeshReport& report) const {
    double sum = 0;
    Index turned = 0;
    report.scaled_jacobian_minimum = 1;
    for (Index q = 0; q < report.quads; ++q) {
      const double j = scaled_jacobian(quads_.mesh.positions, quads_.mesh.quads.row(q));
      sum += j;
      report.scaled_jacobian_minimum = std::min(report.scaled_jacobian_minimum, j);
      turned += turned_over(mesh_, quads_.mesh, q);
    }
    report.scaled_jacobian_average = report.quads > 0 ? sum / report.quads : 0;
    if (report.quads > options_.quads * (1 + options_.count_tolerance)) {
      report.minimum_count = report.quads;
      report.warnings.push_back(
          {"count", std::to_string(report.quads) + " quads where " + std::to_string(options_.quads) +
                        " were asked for: fewer that fit this surface" +
                        (report.components.size() > 1 ? " of " + std::to_string(report.components.size()) + " parts"
                                                      : std::string()) +
                        " were not found"});
    }
    if (report.quads < options_.quads * (1 - options_.count_tolerance))
      report.warnings.push_back({"remesh", std::to_string(report.quads) + " quads where " +
                                               std::to_string(options_.quads) +
                                               " were asked for: more that fit this surface were not found"});
    if (turned > 0)
      report.warnings.push_back({"remesh", std::to_string(turned) + (turned == 1 ? " quad is" : " quads are") +
                                               " folded over on the surface; another count may help"});
    warn_of_misses(report);
    double kept_length = 0, kept_as_quads = 0;
    Index split = 0;
    for (std::size_t c = 0; c < report.components.size(); ++c) {
      const ComponentReport& part = report.components[c];
      kept_length += part.kept_length;
      kept_as_quads += part.kept_as_quads;
      if (part.rung == Rung::split && ++split <= most_named)
        report.warnings.push_back(
            {"remesh", "component " + std::to_string(c) + ": no valid map, split from triangles (" +
                           (part.reasons.empty() ? std::string("no attempt") : part.reasons.back()) + ")"});
    }
    if (split > most_named)
      report.warnings.push_back(
          {"remesh", std::to_string(split - most_named) + " more components were split from triangles"});
    // Of creases that nobody asked for only what is missed without them counts.
    if (asks_for_features(options_) && kept_as_quads < 0.99 * kept_length)
      report.warnings.push_back(
          {"remesh", std::to_string(static_cast<int>(100 * (1 - kept_as_quads / kept_length) + 0.5)) +
                         " % of the length of creases and features are no edges of quads; more quads may help"});
  }

  const Asset& asset_;
  const TriangleMesh<double>& mesh_;
  const RemeshOptions& options_;
  UnfittedQuads quads_;
  Context& context_;
  std::optional<SkinWeights> weights_;
  std::vector<Points<double>> morphs_;
};

}  // namespace detail

QUADRIG_INLINE Expected<RemeshResult> fit_and_skin(const Asset& asset, const RemeshOptions& options,
                                                   UnfittedQuads quads, Context& context) {
  return detail::Finisher(asset, options, std::move(quads), context).run();
}

}  // namespace quadrig
