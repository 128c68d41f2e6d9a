#pragma once

#include <numeric>

#include "quadrig/constraints/gradation.hpp"
#include "quadrig/dominance.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/gaps.hpp"
#include "quadrig/pipeline/guides.hpp"
#include "quadrig/pipeline/halves.hpp"
#include "quadrig/pipeline/hinge_bands.hpp"
#include "quadrig/pipeline/mapped_quads.hpp"
#include "quadrig/pipeline/rings.hpp"
#include "quadrig/pipeline/shares.hpp"
#include "quadrig/pipeline/sizes.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/rims/band.hpp"

namespace quadrig {

QUADRIG_INLINE Status RemeshOptions::validate() const {
  const auto bad = [](std::string field, std::string what, std::string remedy) {
    return Error{ErrorCode::bad_option, std::move(what), std::move(field), std::move(remedy)};
  };
  if (quads < 6) return bad("quads", "too few to close a surface", "give 6 or more");
  if (quads > 50'000'000) return bad("quads", "too many", "give at most 50000000");
  if (influences < 1) return bad("influences", "a vertex needs at least one", "give 1 or more");
  if (curl_rounds < 0 || curl_rounds > 1000) return bad("curl_rounds", "out of range", "give 0 to 1000");
  if (loops.least < 0) return bad("loops.least", "negative", "give 0 or more");
  for (const LoopOptions::OfJoint& one : loops.of_joints)
    if (one.loops < 0 || one.name.empty())
      return bad("loops.of_joints", one.name.empty() ? "a joint without a name" : "negative for " + one.name,
                 "give a name and 0 or more");
  if (!(fill_holes >= 0) || !std::isfinite(fill_holes))
    return bad("fill_holes", "no length", "give 0 or more, in units of the mesh");
  if (!(count_tolerance > 0)) return bad("count_tolerance", "not positive", "give a fraction such as 0.05");
  if (!(bend_degrees > 0 && bend_degrees < 180))
    return bad("bend_degrees", "out of range", "give an angle in (0, 180)");
  if (crease_angle_radians && !(*crease_angle_radians > 0))
    return bad("crease_angle_radians", "not positive", "give an angle in radians");
  if (!(directions.posed >= 0)) return bad("directions.posed", "negative", "give 0 or more");
  if (const Status status = fit.validate(); !status.ok()) return status;
  if (const Status status = polish.validate(); !status.ok()) return status;
  if (rims.rings < 0) return bad("rims.rings", "negative", "give 0 or more");
  if (!(rims.face_density >= least_density_factor && rims.face_density <= largest_density_factor))
    return bad("rims.face_density", "is not from 1/64 to 64", "give a factor such as 2");
  for (const Rim& rim : rims.own)
    if (rim.points.size() < 3 || (!rim.normals.empty() && rim.normals.size() != rim.points.size()) ||
        !(rim.length > 0) || !std::ranges::all_of(rim.points, [](const Vector3& p) { return p.allFinite(); }))
      return bad("rims.own", "a curve of fewer than three points, or of none that are finite",
                 "give closed curves with their length");
  return sizing ? sizing->validate() : Status{};
}

namespace detail {

/// Sizes that a preset stands for.
inline SizingOptions preset_sizing(FieldPreset preset, bool rigged) {
  SizingOptions sizing;
  if (preset == FieldPreset::thesis)
    sizing.density = DensitySource::field;
  else
    sizing.density = preset == FieldPreset::standard && rigged ? DensitySource::posed : DensitySource::rest;
  return sizing;
}

/// Of an error, by face: joint_weight where weights blend, 1 where one bone rules.
inline std::vector<double> joint_weights(std::span<const double> omega1, double joint_weight) {
  std::vector<double> weights;
  for (const double omega : omega1) weights.push_back(1 + (joint_weight - 1) * std::clamp(1 - omega, 0.0, 1.0));
  return weights;
}

/// The direction of the bone that alone moves a face; zero where bones blend.
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

/// Factors of the density: as many as there are vertices, faces or bones, and within their range.
inline Status check_factors(const Asset& asset, const RemeshOptions& options) {
  const std::size_t n = options.density_factors.size(), bones = options.bone_density.size();
  if (n == 0 && bones == 0) return {};
  if (n > 0 && n != at(asset.mesh.vertex_count()) && n != at(asset.mesh.face_count()))
    return Error{ErrorCode::bad_option, std::to_string(n) + " values", "density_factors",
                 "give one a vertex, " + std::to_string(asset.mesh.vertex_count()) + ", or one a face, " +
                     std::to_string(asset.mesh.face_count())};
  if (bones > 0 && (!asset.rig || bones != asset.rig->skeleton.bones.size()))
    return Error{ErrorCode::bad_option, std::to_string(bones) + " values", "bone_density",
                 asset.rig ? "give one a bone, " + std::to_string(asset.rig->skeleton.bones.size()) : "give a rig"};
  for (const std::vector<double>* factors : {&options.density_factors, &options.bone_density})
    for (const double factor : *factors)
      if (!(factor >= least_density_factor && factor <= largest_density_factor))
        return Error{ErrorCode::bad_option, "a factor is not from 1/64 to 64",
                     factors == &options.bone_density ? "bone_density" : "density_factors", "give factors such as 2"};
  const SizingOptions sizing = options.sizing.value_or(preset_sizing(options.preset, asset.rig.has_value()));
  if (sizing.density == DensitySource::field)
    return Error{ErrorCode::bad_option, "the field's own densities take no factors", "density_factors",
                 "take another density, such as posed"};
  return {};
}

/// Checks of the options against the asset, which RemeshOptions::validate cannot make.
inline Status check_request(const Asset& asset, const RemeshOptions& options) {
  if (Status status = options.validate(); !status.ok()) return status;
  // A missing solver is an error of the request, not a reason to try another rung.
  if (const auto solver = options.solver.factory<Complex>()(); !solver) return solver.error();
  if (const auto solver = options.solver.factory<double>()(); !solver) return solver.error();
  const TriangleMesh<double>& mesh = asset.mesh;
  if (mesh.face_count() == 0) return Error{ErrorCode::bad_input, "the mesh has no faces", "mesh", "give a surface"};
  // More quads than this cost as much as a finer input and add no detail.
  if (const std::int64_t most = std::max<std::int64_t>(100'000, 100 * std::int64_t{mesh.face_count()});
      options.quads > most)
    return Error{
        ErrorCode::bad_option,
        std::to_string(options.quads) + " are too many for " + std::to_string(mesh.face_count()) + " triangles",
        "quads", "give at most " + std::to_string(most) + " and subdivide the quads"};
  for (const Index h : options.features)
    if (h < 0 || h >= mesh.halfedge_count())
      return Error{ErrorCode::bad_option, "half-edge " + std::to_string(h) + " does not exist", "features",
                   "give half-edges in [0, " + std::to_string(mesh.halfedge_count()) + ")"};
  for (std::size_t k = 0; k < options.guides.size(); ++k) {
    const Guide& guide = options.guides[k];
    const bool finite = std::ranges::all_of(guide.points, [](const Vector3& p) { return p.allFinite(); });
    if (guide.points.size() < 2 || !finite || !(guide.width >= 0) || !(guide.weight > 0))
      return Error{ErrorCode::bad_option, "has fewer than two points, or a number that cannot be",
                   "guides, " + std::to_string(k), "give points, a width of 0 or more and a weight above 0"};
  }
  for (const FaceDirection& each : options.directions.own)
    if (each.face < 0 || each.face >= mesh.face_count() || !(each.weight >= 0) || !each.direction.allFinite())
      return Error{ErrorCode::bad_option,
                   "face " + std::to_string(each.face) + " is not on the mesh, or its direction or weight no number",
                   "directions.own",
                   "give faces in [0, " + std::to_string(mesh.face_count()) + ") and weights of 0 or more"};
  if (options.sizing)
    if (const std::size_t n = options.sizing->own_density.size();
        n > 0 && n != at(mesh.face_count()) && n != at(mesh.vertex_count()))
      return Error{ErrorCode::bad_option, std::to_string(n) + " values", "sizing.own_density",
                   "give one a vertex, " + std::to_string(mesh.vertex_count()) + ", or one a face, " +
                       std::to_string(mesh.face_count())};
  if (Status status = check_factors(asset, options); !status.ok()) return status;
  if (options.preset == FieldPreset::thesis && !options.guides.empty())
    return Error{ErrorCode::bad_option, "the thesis preset takes no guides", "preset", "use default"};
  if (options.preset == FieldPreset::thesis && (!options.directions.own.empty() || options.directions.terms))
    return Error{ErrorCode::bad_option, "the thesis preset takes no directions of the caller's", "preset",
                 "use default"};
  for (const Pose& pose : options.directions.bone_poses)
    if (!asset.rig || pose.size() != asset.rig->skeleton.bones.size())
      return Error{ErrorCode::bad_option, std::to_string(pose.size()) + " transforms", "directions.bone_poses",
                   asset.rig ? "give one a bone, " + std::to_string(asset.rig->skeleton.bones.size()) : "give a rig"};
  if (options.group_borders && !asset.rig)
    return Error{ErrorCode::bad_option, "vertex groups are the columns of skin weights", "group_borders", "give a rig"};
  if (options.preset == FieldPreset::thesis && !asset.rig)
    return Error{ErrorCode::bad_option, "the thesis preset needs a rig", "preset", "give a rig, or use static"};
  return {};
}

/// The whole asset before the fit: sizes, each component by itself, and their quads together.
class Remesher {
 public:
  Remesher(const Asset& asset, const RemeshOptions& options, Context& context)
      : asset_(asset),
        mesh_(asset.mesh),
        options_(options),
        sizing_(options.sizing.value_or(preset_sizing(options.preset, asset.rig.has_value()))),
        context_(context) {}

  [[nodiscard]] Expected<UnfittedQuads> run() {
    const Stopwatch total;
    const SpanTimer span(context_, "quads", count_of(mesh_.face_count(), "triangle"));
    const ProgressPart whole(context_, 0, 1);
    if (context_.cancelled()) return cancelled_error("remesh");
    quads_.connection = std::make_shared<const Connection<double>>(mesh_, &context_);
    const Connection<double>& connection = *quads_.connection;
    if (context_.cancelled()) return cancelled_error("remesh");
    context_.progress("metric", 0);
    if (Status status = find_mirror(); !status.ok()) return status.error();
    quads_.kept = kept_edges(asset_, options_);
    rings_ = plan_rings(asset_, options_, plane(), context_, quads_.report.rims);
    if (context_.cancelled()) return cancelled_error("remesh");
    if (Status status = measure(connection); !status.ok()) return status.error();
    if (Status status = remesh_parts(connection); !status.ok()) return status.error();
    if (Status status = gather(); !status.ok()) return status.error();
    quads_.report.seconds.total = total.seconds();
    return std::move(quads_);
  }

 private:
  using Part = std::optional<Expected<ComponentResult>>;
  static constexpr double measured = 0.1;  // of the job

  [[nodiscard]] bool sized() const { return gives_sizes(sizing_); }
  [[nodiscard]] const MirrorPlane* plane() const {
    const auto& found = quads_.report.symmetry.plane;
    return found ? &*found : nullptr;
  }

  /// What pulls at directions beside bones and curvature: hinges, then guides, then the caller; later ones count.
  [[nodiscard]] OwnDirections own_directions() const {
    OwnDirections own;
    std::vector<FaceDirection> all;
    const auto edge = [&](const FaceLoop& loop) { return edge_along(mesh_, loop, sizes_, options_.quads); };
    if (asset_.rig && options_.preset == FieldPreset::standard)
      pull_along_hinges(mesh_, *asset_.rig, options_.loops, edge, all);
    pull_along_guides(mesh_, options_.guides, plane(), all);
    all.insert(all.end(), options_.directions.own.begin(), options_.directions.own.end());
    if (all.empty()) return own;
    own.direction.assign(at(mesh_.face_count()), Vector3::Zero());
    own.weight.assign(at(mesh_.face_count()), 0.0);
    for (const FaceDirection& each : all) {
      own.direction[at(each.face)] = each.direction;
      own.weight[at(each.face)] = each.weight;
    }
    return own;
  }

  /// Sizes and posed directions, once for the whole asset.
  [[nodiscard]] Status measure(const Connection<double>& connection) {
    const Stopwatch watch;
    const SpanTimer span(context_, "metric");
    std::vector<double> omega1;
    if (asset_.rig) {
      Expected<Dominance> dominance = Dominance::create(mesh_, *asset_.rig, &context_);
      if (!dominance) return dominance.error();
      for (Index f = 0; f < mesh_.face_count(); ++f) {
        if (f % 4096 == 0 && context_.cancelled()) return cancelled_error("remesh");
        omega1.push_back(dominance->omega(f, 1));
      }
      if (options_.preset != FieldPreset::flat) {
        quads_.targets.weight = joint_weights(omega1, sizing_.joint_weight);
        if (options_.directions.bones.value_or(1) > 0)
          quads_.targets.direction = ruling_directions(*dominance, asset_.rig->skeleton);
      }
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    const SizeMaker make(asset_, options_, sizing_, plane(), quads_.report.rims, rings_, context_);
    if (Status status = make(connection, omega1, quads_.kept, sizes_, metric_); !status.ok()) return status;
    if (options_.fit.method == FitMethod::slide && make.moves())
      quads_.targets.set_bending(connection, sizes_.forms, context_);
    if (!quads_.kept.empty() && !asks_for_features(options_)) {
      std::optional<PosedMetric> unused;
      rounded_.emplace();
      if (Status status = make(connection, omega1, {}, *rounded_, unused); !status.ok()) return status;
    }
    quads_.report.seconds.metric = watch.seconds();
    return {};
  }
  /// The mirror plane, where one is asked for and there is one.
  [[nodiscard]] Status find_mirror() {
    const SpanTimer span(context_, "symmetry");
    SymmetryReport& report = quads_.report.symmetry;
    report.choice = mirror_choice(options_, asset_.rig.has_value());
    if (report.choice == SymmetryChoice::none) return {};
    if (options_.mirror_plane) {
      report.plane = options_.mirror_plane;
      return {};
    }
    Expected<std::optional<MirrorPlane>> found = find_mirror_plane(asset_, report.choice, context_);
    if (!found) return found.error();
    report.plane = std::move(*found);
    if (!report.plane && report.choice != SymmetryChoice::automatic)
      quads_.report.warnings.push_back(
          {"symmetry", "no mirror plane across " + std::string(symmetry_choice_name(report.choice)) +
                           " was found: less than half of the surface lies near its image"});
    return {};
  }

  [[nodiscard]] double size_of(Index face) const { return sized() ? sizes_.density[at(face)] : 1.0; }

  /// Components, what the plane does to each, and the share of the count that each is due.
  [[nodiscard]] Status plan(const EdgeMarks& kept, std::vector<double>& due, std::vector<double>& least) {
    const Components components = face_components(mesh_);
    faces_.resize(at(components.count));
    for (Index f = 0; f < mesh_.face_count(); ++f) faces_[at(components.of_face[at(f)])].push_back(f);
    mirror_.resize(faces_.size());
    if (const auto& plane = quads_.report.symmetry.plane) {
      map_.emplace(asset_, *plane);
      mirror_ = mirror_parts(asset_, faces_, kept, *map_, context_);
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    std::vector<double> share(faces_.size(), 0.0);
    for (std::size_t c = 0; c < faces_.size(); ++c) {
      if (const auto& half = mirror_[c].half) {  // which stands for both
        for (Index f = 0; f < half->asset.mesh.face_count(); ++f)
          share[c] += 2 * half->asset.mesh.area(f) * size_of(half->parent[at(f)]);
        continue;
      }
      const auto from = mirror_[c].role == MirrorRole::second ? at(mirror_[c].other) : c;
      for (const Index f : faces_[from]) share[c] += mesh_.area(f) * size_of(f);
    }
    least.assign(share.size(), least_quads);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      if (mesh_.twin(h) == no_index) least[at(components.of_face[at(h / 3)])] = least_of_sheet;
    constexpr double of_triangle = 3;
    for (std::size_t c = 0; c < least.size(); ++c)
      if (faces_[c].size() == 1) least[c] = of_triangle;
    due = quads_due(share, options_.quads, least);
    return {};
  }

  /// Each component with its share of the count.
  [[nodiscard]] Status remesh_parts(const Connection<double>& connection) {
    const EdgeMarks& kept = quads_.kept;
    std::vector<double> due, least;
    if (Status status = plan(kept, due, least); !status.ok()) return status;
    const OwnDirections given = own_directions();
    const RemeshShared shared{asset_,
                              connection,
                              options_,
                              sizing_,
                              sized() ? &sizes_ : nullptr,
                              sized() && rounded_ ? &*rounded_ : nullptr,
                              metric_ ? &*metric_ : nullptr,
                              kept,
                              given.direction.empty() ? nullptr : &given,
                              faces_.size(),
                              quads_.report.symmetry.plane ? &*quads_.report.symmetry.plane : nullptr,
                              rings_};
    // Progress is for the caller's thread: that of the parts it remeshes, and the faces of those that are done.
    const std::thread::id caller = std::this_thread::get_id();
    std::atomic<Index> done{0};
    const ProgressPart progress(context_, measured, parts_done);
    const auto remesh_part = [&](std::size_t c, double asked) {
      Context own = context_.quiet(faces_.size() > 1 ? 1 : context_.threads);
      const auto faces = static_cast<Index>(faces_[c].size());
      if (std::this_thread::get_id() == caller)
        own.on_progress = [&, faces](std::string_view stage, double fraction) {
          context_.progress(stage, (done + fraction * faces) / mesh_.face_count());
        };
      const bool halved = mirror_[c].role == MirrorRole::halved;
      auto result =
          remesh_component(shared, faces_[c], halved ? asked / 2 : asked, own, halved ? &mirror_[c] : nullptr);
      done += faces;
      return result;
    };
    parts_.resize(faces_.size());
    context_.parallel_for(parts_.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = begin; c < end; ++c) {
        if (mirror_[c].role == MirrorRole::second) continue;
        parts_[c] = remesh_part(c, due[c]);
        if (mirror_[c].role != MirrorRole::halved || context_.cancelled()) continue;
        if (const std::string defect = mirror_half(c, kept); !defect.empty()) {
          mirror_[c].role = MirrorRole::whole;
          parts_[c] = remesh_part(c, due[c]);
          if (*parts_[c]) (*parts_[c])->report.reasons.push_back("not mirrored: " + defect);
        }
      }
    });
    context_.parallel_for(parts_.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = begin; c < end; ++c)
        if (mirror_[c].role == MirrorRole::second && !context_.cancelled() && !mirror_other(c, kept))
          parts_[c] = remesh_part(c, due[c]);
    });
    if (context_.cancelled()) return cancelled_error("remesh");
    for (std::size_t c = 0; c < parts_.size(); ++c)
      if (!*parts_[c]) {
        Error error = parts_[c]->error();
        error.where =
            "component " + std::to_string(c) + " (face " + std::to_string(faces_[c].front()) + "), " + error.where;
        return error;
      }

    std::vector<Index> got;
    for (const Part& part : parts_) got.push_back((*part)->mesh.quad_count());
    double missed = static_cast<double>(std::accumulate(got.begin(), got.end(), Index{0})) - options_.quads;
    if (parts_.size() == 1) return {};
    auto again = asked_again(due, got, least, missed, 0.8 * options_.count_tolerance * options_.quads);
    std::erase_if(again, [&](const auto& each) { return mirror_[each.first].role != MirrorRole::whole; });
    std::vector<Part> others(again.size());
    context_.parallel_for(again.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) others[k] = remesh_part(again[k].first, again[k].second);
    });
    if (context_.cancelled()) return cancelled_error("remesh");
    for (std::size_t k = 0; k < again.size(); ++k) {
      Expected<ComponentResult>&part = *parts_[again[k].first], &other = *others[k];
      if (!other || other->report.rung != part->report.rung) continue;
      const double change = static_cast<double>(other->mesh.quad_count() - part->mesh.quad_count());
      if (!(std::abs(missed + change) < std::abs(missed))) continue;
      missed += change;
      part = std::move(other);
    }
    return {};
  }

  /// The whole component in place of the quads of its half. Returns why that is not possible; empty where it is.
  [[nodiscard]] std::string mirror_half(std::size_t c, const EdgeMarks& kept) {
    if (!*parts_[c]) return parts_[c]->error().what;
    ComponentResult& part = **parts_[c];
    MirroredQuads all = mirrored_quads(part.mesh.quads, part.on_cut);
    if (std::string defect = mirror_defect(all, *mirror_[c].topology); !defect.empty()) return defect;
    const auto vertices = static_cast<Index>(all.twin.size());
    part.mesh.quads = std::move(all.quads);
    part.mesh.positions.conservativeResize(vertices, 3);
    part.mesh.source.resize(all.twin.size());
    place_images(mesh_, PartSurface(asset_, faces_[c]), *map_, std::span(all.twin).subspan(at(all.own)), all.own,
                 part.mesh);
    part.twin = std::move(all.twin);
    if (!part.landed.empty()) {
      part.landed.resize(part.twin.size());
      for (std::size_t v = at(all.own); v < part.twin.size(); ++v) part.landed[v] = part.landed[at(part.twin[v])];
    }
    settle_images(part, fine_enough, kept);
    if (!(least_jacobian(part.mesh) > 0)) return "a quad is inverted on the other side";
    mirror_held(part, all.own, kept);
    ComponentReport& report = part.report;
    report.asked *= 2;
    report.quads = part.mesh.quad_count();
    report.singularities *= 2;
    report.kept_length *= 2;
    report.kept_as_quads *= 2;
    report.irregular = quad_topology(part.mesh.quads, vertices).irregular;
    return {};
  }

  /// The quads of one of two components that mirror each other, on the other of them. False where they do not fit it.
  [[nodiscard]] bool mirror_other(std::size_t c, const EdgeMarks& kept) {
    const Part& first = parts_[at(mirror_[c].other)];
    const auto refused = [&] {
      mirror_[c].role = mirror_[at(mirror_[c].other)].role = MirrorRole::whole;
      return false;
    };
    if (!*first) return refused();
    ComponentResult part = **first;
    const Index vertices = part.mesh.vertex_count();
    std::vector<Index> all(at(vertices));
    std::iota(all.begin(), all.end(), Index{0});
    place_images(mesh_, PartSurface(asset_, faces_[c]), *map_, all, 0, part.mesh);
    part.mesh.quads.col(1).swap(part.mesh.quads.col(3));
    settle_images(part, fine_enough, kept);
    if (!(least_jacobian(part.mesh) > 0)) return refused();
    part.report.faces = static_cast<Index>(faces_[c].size());
    part.held.clear();
    mirror_held(part, 0, kept);
    part.map.reset();
    part.warnings.clear();
    parts_[c].emplace(std::move(part));
    return true;
  }

  void settle_images(ComponentResult& part, double wanted, const EdgeMarks& kept) {
    Context own = context_.quiet(1);
    even_out(mesh_, kept, options_.polish, wanted, part.mesh, own);
  }

  /// Which of the images lie on kept edges.
  void mirror_held(ComponentResult& part, Index first, const EdgeMarks& kept) const {
    constexpr double near = 1e-6;
    if (kept.empty()) return;
    const EdgeCurves curves(mesh_, kept);
    part.held.resize(at(part.mesh.vertex_count()), 0);
    for (Index v = first; v < part.mesh.vertex_count(); ++v)
      part.held[at(v)] = curves.under(part.mesh.source[at(v)], near) != no_index;
  }

  /// One mesh of all parts, in the order of the components.
  [[nodiscard]] Status gather() {
    const Stopwatch watch;
    RemeshReport& report = quads_.report;
    for (const Part& part : parts_) {
      report.vertices += (*part)->mesh.vertex_count();
      report.quads += (*part)->mesh.quad_count();
    }
    QuadMesh& out = quads_.mesh;
    out.positions.resize(report.vertices, 3);
    out.quads.resize(report.quads, 4);
    quads_.held.assign(at(report.vertices), 0);
    quads_.on_features.assign(at(report.vertices), 0);
    Index first_vertex = 0, first_quad = 0, largest = -1;
    std::vector<Index> first_of;  // vertex, of each part
    if (report.symmetry.plane) quads_.twin.assign(at(report.vertices), no_index);
    for (Part& slot : parts_) {
      if (context_.cancelled()) return cancelled_error("remesh");
      ComponentResult& part = **slot;
      const Index n = part.mesh.vertex_count(), m = part.mesh.quad_count();
      std::copy(part.held.begin(), part.held.end(), quads_.on_features.begin() + first_vertex);
      std::copy(part.landed.begin(), part.landed.end(), quads_.held.begin() + first_vertex);
      first_of.push_back(first_vertex);
      count_mirrored(first_of, part);
      out.positions.middleRows(first_vertex, n) = part.mesh.positions;
      out.quads.middleRows(first_quad, m) = part.mesh.quads.array() + first_vertex;
      out.source.insert(out.source.end(), part.mesh.source.begin(), part.mesh.source.end());
      first_vertex += n;
      first_quad += m;
      report.irregular += part.report.irregular;
      report.seconds += part.seconds;
      for (Warning& warning : part.warnings) report.warnings.push_back(std::move(warning));
      if (part.report.faces > largest) {
        largest = part.report.faces;
        report.field = part.field;
        report.backends = part.backends;
      }
      if (part.map) {
        part.map->rung = part.report.rung;
        part.map->component = static_cast<Index>(report.components.size());
        quads_.maps.push_back(std::move(*part.map));
      }
      log(report.components.size(), part.report);
      report.components.push_back(std::move(part.report));
    }
    report.seconds.transfer += watch.seconds();
    return {};
  }

  /// Notes the twins of a part that is about to be added.
  void count_mirrored(const std::vector<Index>& first_of, const ComponentResult& part) {
    SymmetryReport& report = quads_.report.symmetry;
    if (!report.plane) return;
    const std::size_t c = first_of.size() - 1;
    switch (mirror_[c].role) {
      case MirrorRole::whole:
        ++report.whole;
        return;
      case MirrorRole::halved:
        ++report.halved;
        for (std::size_t v = 0; v < part.twin.size(); ++v)
          quads_.twin[at(first_of[c]) + v] = first_of[c] + part.twin[v];
        return;
      case MirrorRole::first:
        ++report.paired;
        return;
      case MirrorRole::second:
        ++report.paired;
        for (Index v = 0; v < part.mesh.vertex_count(); ++v) {
          const Index other = first_of[at(mirror_[c].other)] + v;
          quads_.twin[at(first_of[c] + v)] = other;
          quads_.twin[at(other)] = first_of[c] + v;
        }
        return;
    }
  }

  void log(std::size_t number, const ComponentReport& part) const {
    if (!context_.on_log) return;
    std::string line = "component " + std::to_string(number) + " of " + std::to_string(part.faces) +
                       " triangles: " + std::to_string(part.quads) + " quads, " + std::to_string(part.irregular) +
                       " irregular vertices, " + std::string(rung_name(part.rung));
    for (const std::string& reason : part.reasons) line += "; " + reason;
    context_.log(line);
  }

  const Asset& asset_;
  const TriangleMesh<double>& mesh_;
  const RemeshOptions& options_;
  const SizingOptions sizing_;
  Context& context_;
  SizeField sizes_;
  std::optional<SizeField> rounded_;  // of quads that do not keep the creases that nobody asked for
  std::vector<RimRings> rings_;       // refer to the report's rims
  std::optional<PosedMetric> metric_;
  std::vector<std::vector<Index>> faces_;  // of each component
  std::vector<MirrorPart> mirror_;         // of each component
  std::optional<MirrorMap> map_;
  std::vector<Part> parts_;
  UnfittedQuads quads_;
};

}  // namespace detail

QUADRIG_INLINE Expected<UnfittedQuads> remesh_unfitted(const Asset& asset, const RemeshOptions& options,
                                                       Context& context) {
  if (Status status = detail::check_request(asset, options); !status.ok()) return status.error();
  return detail::Remesher(asset, options, context).run();
}

namespace detail {

inline Expected<RemeshResult> remesh_whole(const Asset& asset, const RemeshOptions& options, Context& context) {
  Expected<UnfittedQuads> quads = remesh_unfitted(asset, options, context);
  if (!quads) return quads.error();
  return fit_and_skin(asset, options, std::move(*quads), context);
}

}  // namespace detail

QUADRIG_INLINE Expected<RemeshResult> remesh(const Asset& asset, const RemeshOptions& options, Context& context) {
  if (Status status = options.validate(); !status.ok()) return status.error();
  const std::optional<detail::WithoutGaps> without = detail::without_gaps(asset, options, context);
  if (context.cancelled()) return cancelled_error("remesh");
  Expected<RemeshResult> result = without ? detail::remesh_without_gaps(asset, options, *without, context)
                                          : detail::remesh_whole(asset, options, context);
  if (result && result->weights)
    if (const std::optional<std::string> lacking =
            report_hinges(result->mesh, asset.rig->skeleton, *result->weights, options, result->report)) {
      result->report.warnings.push_back({"remesh", *lacking});
      context.warnings.push_back(result->report.warnings.back());
    }
  if (result) {
    count_rings(result->mesh, result->report.rims);
    if (const std::optional<std::string> lacking = lacking_rings(result->report.rims)) {
      result->report.warnings.push_back({"remesh", *lacking});
      context.warnings.push_back(result->report.warnings.back());
    }
  }
  return result;
}

}  // namespace quadrig
