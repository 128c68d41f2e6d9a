#pragma once

#include <numeric>

#include "quadrig/constraints/gradation.hpp"
#include "quadrig/dominance.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/shares.hpp"
#include "quadrig/quads/topology.hpp"

namespace quadrig {

QUADRIG_INLINE Status RemeshOptions::validate() const {
  const auto bad = [](std::string field, std::string what, std::string remedy) {
    return Error{ErrorCode::bad_option, std::move(what), std::move(field), std::move(remedy)};
  };
  if (quads < 6) return bad("quads", "too few to close a surface", "give 6 or more");
  if (quads > 50'000'000) return bad("quads", "too many", "give at most 50000000");
  if (influences < 1) return bad("influences", "a vertex needs at least one", "give 1 or more");
  if (!(count_tolerance > 0)) return bad("count_tolerance", "not positive", "give a fraction such as 0.05");
  if (!(bend_degrees > 0 && bend_degrees < 180))
    return bad("bend_degrees", "out of range", "give an angle in (0, 180)");
  if (!(crease_angle_radians > 0)) return bad("crease_angle_radians", "not positive", "give an angle in radians");
  if (!(directions.posed >= 0)) return bad("directions.posed", "negative", "give 0 or more");
  if (const Status status = fit.validate(); !status.ok()) return status;
  return sizing ? sizing->validate() : Status{};
}

namespace detail {

/// Sizes that a preset stands for.
inline SizingOptions preset_sizing(FieldPreset preset, bool rigged) {
  SizingOptions sizing;
  if (preset == FieldPreset::thesis)
    sizing.density = DensitySource::field;
  else if (preset == FieldPreset::standard && rigged)
    sizing.density = DensitySource::posed;
  else
    sizing.density = DensitySource::uniform;
  if (sizing.density == DensitySource::uniform) sizing.largest_aspect = 1;
  return sizing;
}

/// Of an error, by face: joint_weight where weights blend, 1 where one bone rules.
inline std::vector<double> joint_weights(std::span<const double> omega1, double joint_weight) {
  std::vector<double> weights;
  for (const double omega : omega1) weights.push_back(1 + (joint_weight - 1) * std::clamp(1 - omega, 0.0, 1.0));
  return weights;
}

/// That of the bone which rules a face all but alone; zero on the others.
inline std::vector<Vector3> ruling_directions(const Dominance& dominance, const Skeleton& skeleton) {
  constexpr double alone = 0.9;
  std::vector<Vector3> directions(at(dominance.face_count()), Vector3::Zero());
  for (Index f = 0; f < static_cast<Index>(directions.size()); ++f) {
    if (!(dominance.omega(f, 1) > alone)) continue;
    const Bone& bone = skeleton.bones[at(dominance.share(f, 1).bone)];
    if (bone.has_direction) directions[at(f)] = bone.direction();
  }
  return directions;
}

}  // namespace detail

QUADRIG_INLINE Expected<RemeshResult> remesh(const Asset& asset, const RemeshOptions& options, Context& context) {
  using detail::at;
  const Stopwatch total;
  if (Status status = options.validate(); !status.ok()) return status.error();
  // A solver that cannot be had is an error, no reason for another rung.
  if (const auto solver = options.solver.factory<Complex>()(); !solver) return solver.error();
  if (const auto solver = options.solver.factory<double>()(); !solver) return solver.error();
  const TriangleMesh<double>& mesh = asset.mesh;
  if (mesh.face_count() == 0) return Error{ErrorCode::bad_input, "the mesh has no faces", "mesh", "give a surface"};
  // A map of so many quads takes as long as that of a surface so fine, and such triangles have no more to say.
  if (const std::int64_t most = std::max<std::int64_t>(100'000, 100 * std::int64_t{mesh.face_count()});
      options.quads > most)
    return Error{
        ErrorCode::bad_option,
        std::to_string(options.quads) + " are too many for " + std::to_string(mesh.face_count()) + " triangles",
        "quads", "give at most " + std::to_string(most) + " and subdivide the quads"};
  for (const Index h : options.features)
    if (h < 0 || h >= mesh.halfedge_count())
      return Error{ErrorCode::bad_option, "half-edge " + std::to_string(h) + " is none of the mesh", "features",
                   "give half-edges in [0, " + std::to_string(mesh.halfedge_count()) + ")"};
  if (options.group_borders && !asset.rig)
    return Error{ErrorCode::bad_option, "vertex groups are the columns of skin weights", "group_borders", "give a rig"};
  if (options.preset == FieldPreset::thesis && !asset.rig)
    return Error{ErrorCode::bad_option, "the thesis preset needs a rig", "preset", "give a rig, or use static"};

  RemeshResult result;
  const SizingOptions sizing = options.sizing.value_or(detail::preset_sizing(options.preset, asset.rig.has_value()));
  if (context.cancelled()) return cancelled_error("remesh");
  const Connection<double> connection(mesh);
  if (context.cancelled()) return cancelled_error("remesh");
  context.progress("metric", 0);

  // Sizes and posed directions, once for the whole asset.
  Stopwatch watch;
  SizeField sizes;
  std::optional<PosedMetric> metric;
  FitTargets fit_targets;
  std::vector<double> omega1;
  if (asset.rig) {
    Expected<Dominance> dominance = Dominance::create(mesh, *asset.rig, &context);
    if (!dominance) return dominance.error();
    for (Index f = 0; f < mesh.face_count(); ++f) {
      if (f % 4096 == 0 && context.cancelled()) return cancelled_error("remesh");
      omega1.push_back(dominance->omega(f, 1));
    }
    if (options.preset != FieldPreset::flat) {
      fit_targets.weight = detail::joint_weights(omega1, sizing.joint_weight);
      if (options.directions.bones.value_or(1) > 0)
        fit_targets.direction = detail::ruling_directions(*dominance, asset.rig->skeleton);
    }
  }
  if (context.cancelled()) return cancelled_error("remesh");
  const bool posed = sizing.density == DensitySource::posed || options.directions.posed > 0;
  const bool curved = posed || sizing.density == DensitySource::rest;
  if (curved) {
    if (posed && asset.rig) {
      std::vector<Pose> bends;
      if (options.poses.empty()) bends = bend_poses(asset.rig->skeleton, options.bend_degrees);
      const std::vector<Pose>& poses = options.poses.empty() ? bends : options.poses;
      PosedForms::Options form_options;
      form_options.pose_weights = options.poses.empty() ? std::vector<double>{} : options.pose_weights;
      Expected<PosedForms> forms =
          PosedForms::create(mesh, connection, asset.rig->weights, poses, form_options, context);
      if (!forms) return forms.error();
      sizes.forms = std::move(*forms);
      if (options.fit.rounds > 0) fit_targets.set_bending(connection, sizes.forms, context);
    } else {
      sizes.forms = PosedForms::at_rest(mesh, connection);
    }
    PosedMetricOptions metric_options;
    metric_options.largest_aspect = sizing.largest_aspect;
    metric_options.joint_weight = sizing.joint_weight;
    metric_options.least_density = sizing.least_density;
    metric_options.largest_density = sizing.largest_density;
    Expected<PosedMetric> made = posed_metric(mesh, sizes.forms, omega1, metric_options, context);
    if (!made) return made.error();
    metric = std::move(*made);
  }
  sizes.largest_aspect = sizing.largest_aspect;
  switch (sizing.density) {
    case DensitySource::uniform:
      sizes.density.assign(at(mesh.face_count()), 1.0);
      break;
    case DensitySource::blend:
      sizes.density.resize(at(mesh.face_count()));
      for (std::size_t f = 0; f < sizes.density.size(); ++f)
        sizes.density[f] = omega1.empty() ? 1.0 : 1 + 3 * (1 - omega1[f]);
      break;
    case DensitySource::rest:
    case DensitySource::posed:
      sizes.density = metric->density;
      break;
    case DensitySource::field:
      break;
  }
  if (context.cancelled()) return cancelled_error("remesh");
  const bool sized = sizing.density != DensitySource::field;
  if (sized && sizing.density != DensitySource::uniform)
    sizes.density = graded_density(mesh, sizes.density, options.quads, sizing.gradation, context);
  if (context.cancelled()) return cancelled_error("remesh");
  result.report.seconds.metric = watch.seconds();

  // Components, each with its share.
  const Components components = face_components(mesh);
  std::vector<std::vector<Index>> faces(at(components.count));
  std::vector<double> share(at(components.count), 0.0);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (f % 4096 == 0 && context.cancelled()) return cancelled_error("remesh");
    const auto c = at(components.of_face[at(f)]);
    faces[c].push_back(f);
    share[c] += mesh.area(f) * (sized ? sizes.density[at(f)] : 1.0);
  }
  const std::vector<double> due = detail::quads_due(share, options.quads);
  if (context.cancelled()) return cancelled_error("remesh");
  const EdgeMarks kept = detail::kept_edges(mesh, options);
  const detail::RemeshShared shared{
      asset, connection, options, sizing, sized ? &sizes : nullptr, metric ? &*metric : nullptr, kept};
  std::vector<std::optional<Expected<detail::ComponentResult>>> parts(faces.size());
  context.progress("remesh", 0.1);
  const auto remesh_part = [&](std::size_t c, double asked) {
    return detail::remesh_component(shared, faces[c], asked, context.quiet(faces.size() > 1 ? 1 : context.threads));
  };
  context.parallel_for(faces.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) parts[c] = remesh_part(c, due[c]);
  });
  if (context.cancelled()) return cancelled_error("remesh");
  if (faces.size() > 1 && std::ranges::all_of(parts, [](const auto& part) { return part->has_value(); })) {
    std::vector<Index> got;
    for (const auto& part : parts) got.push_back((*part)->mesh.quad_count());
    double missed = static_cast<double>(std::accumulate(got.begin(), got.end(), Index{0})) - options.quads;
    const auto again = detail::asked_again(due, got, missed, 0.8 * options.count_tolerance * options.quads);
    std::vector<std::optional<Expected<detail::ComponentResult>>> others(again.size());
    context.parallel_for(again.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) others[k] = remesh_part(again[k].first, again[k].second);
    });
    if (context.cancelled()) return cancelled_error("remesh");
    for (std::size_t k = 0; k < again.size(); ++k) {
      auto& part = *parts[again[k].first];
      Expected<detail::ComponentResult>& other = *others[k];
      if (!other || other->report.rung != part->report.rung) continue;
      const double change = static_cast<double>(other->mesh.quad_count() - part->mesh.quad_count());
      if (!(std::abs(missed + change) < std::abs(missed))) continue;
      missed += change;
      part = std::move(other);
    }
  }

  // One mesh of all parts, in the order of the components.
  watch = {};
  Index vertices = 0, quads = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) {
    if (!*parts[c]) {
      Error error = parts[c]->error();
      error.where =
          "component " + std::to_string(c) + " (face " + std::to_string(faces[c].front()) + "), " + error.where;
      return error;
    }
    vertices += (*parts[c])->mesh.vertex_count();
    quads += (*parts[c])->mesh.quad_count();
  }
  QuadMesh& out = result.mesh;
  out.positions.resize(vertices, 3);
  out.quads.resize(quads, 4);
  Index first_vertex = 0, first_quad = 0, largest = -1;
  RemeshReport& report = result.report;
  std::vector<char> beside(at(vertices), 0);  // of parts that have vertices beside the surface
  std::vector<char> held(at(vertices), 0);    // on kept edges
  double kept_length = 0, kept_as_quads = 0;
  for (auto& slot : parts) {
    detail::ComponentResult& part = **slot;
    const Index n = part.mesh.vertex_count(), m = part.mesh.quad_count();
    if (part.report.rung == Rung::split) std::fill_n(beside.begin() + first_vertex, n, char{1});
    std::copy(part.held.begin(), part.held.end(), held.begin() + first_vertex);
    kept_length += part.report.kept_length;
    kept_as_quads += part.report.kept_as_quads;
    out.positions.middleRows(first_vertex, n) = part.mesh.positions;
    out.quads.middleRows(first_quad, m) = part.mesh.quads.array() + first_vertex;
    out.source.insert(out.source.end(), part.mesh.source.begin(), part.mesh.source.end());
    first_vertex += n;
    first_quad += m;
    report.irregular += part.report.irregular;
    for (auto member : {&StageSeconds::pieces, &StageSeconds::field, &StageSeconds::map, &StageSeconds::integers,
                        &StageSeconds::extraction, &StageSeconds::polish})
      report.seconds.*member += part.seconds.*member;
    for (Warning& warning : part.warnings) report.warnings.push_back(std::move(warning));
    if (part.report.faces > largest) {
      largest = part.report.faces;
      report.field = part.field;
      report.backends = part.backends;
    }
    report.components.push_back(std::move(part.report));
  }
  report.quads = quads;
  report.vertices = vertices;
  const double gathering = watch.seconds();

  watch = {};
  if (options.before_fit) {
    const std::vector<char> placed = options.before_fit(mesh, held, out);
    for (std::size_t v = 0; v < placed.size(); ++v) held[v] = held[v] || placed[v];
  }
  if (options.fit.rounds > 0) {
    for (std::size_t v = 0; v < held.size(); ++v) held[v] = held[v] || beside[v];
    (void)fit(mesh, fit_targets, std::move(held), options.fit, out, context);
  }
  if (context.cancelled()) return cancelled_error("fit");
  report.seconds.polish += watch.seconds();

  watch = {};
  if (asset.rig) {
    Expected<SkinWeights> weights = transfer_weights(mesh, asset.rig->weights, out.source, options.influences);
    if (!weights) return weights.error();
    result.weights = std::move(*weights);
  }
  report.seconds.transfer = gathering + watch.seconds();
  double sum = 0;
  report.scaled_jacobian_minimum = 1;
  for (Index q = 0; q < quads; ++q) {
    const double j = scaled_jacobian(out.positions, out.quads.row(q));
    sum += j;
    report.scaled_jacobian_minimum = std::min(report.scaled_jacobian_minimum, j);
  }
  report.scaled_jacobian_average = quads > 0 ? sum / quads : 0;
  if (quads > options.quads * (1 + options.count_tolerance)) report.minimum_count = quads;
  for (std::size_t c = 0; c < report.components.size(); ++c)
    if (report.components[c].rung == Rung::split)
      report.warnings.push_back(
          {"remesh", "component " + std::to_string(c) + ": no valid map, split from triangles (" +
                         (report.components[c].reasons.empty() ? std::string("no attempt")
                                                               : report.components[c].reasons.back()) +
                         ")"});
  if (kept_as_quads < 0.99 * kept_length)
    report.warnings.push_back(
        {"remesh", std::to_string(static_cast<int>(100 * (1 - kept_as_quads / kept_length) + 0.5)) +
                       " % of the length of creases and features are no edges of quads; more quads may help"});
  const QuadTopology topology = quad_topology(out.quads, vertices);
  report.valid = topology.defect.empty() && report.scaled_jacobian_minimum > 0;
  for (const Warning& warning : report.warnings) context.warnings.push_back(warning);
  report.seconds.total = total.seconds();
  if (!report.valid)
    return Error{ErrorCode::stage_failed, topology.defect.empty() ? "a quad stays inverted" : topology.defect,
                 "check of the result", "ask for another count or the static preset"};
  context.progress("done", 1);
  return result;
}

}  // namespace quadrig
