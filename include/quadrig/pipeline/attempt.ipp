#pragma once

#include "quadrig/field/loops.hpp"
#include "quadrig/field/surgery.hpp"
#include "quadrig/pipeline/attempt.hpp"
#include "quadrig/pipeline/landing.hpp"
#include "quadrig/rims/band.hpp"
#include "quadrig/seamless/reduce_curl.hpp"

namespace quadrig::detail {

/// Keeps no longer the edges at the corners of these faces. Returns whether there were any.
inline bool release_near(const TriangleMesh<double>& mesh, std::span<const Index> faces, EdgeMarks& kept) {
  if (kept.empty()) return false;
  const std::vector<char> near = corners_of(mesh, faces);
  bool any = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (kept[at(h)] && (near[at(mesh.origin(h))] || near[at(mesh.target(h))])) kept[at(h)] = 0, any = true;
  return any;
}

/// Why no map of a field is tried; empty where one is.
[[nodiscard]] inline std::string unmappable(const TriangleMesh<double>& mesh, const std::vector<Index>& index4,
                                            double quads) {
  Index extreme = 0, first = no_index;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (index4[at(v)] > 1 || index4[at(v)] < (mesh.on_boundary(v) ? -2 : -3)) {
      ++extreme;
      if (first == no_index) first = v;
    }
  if (extreme > 0)
    return "field: " + std::to_string(extreme) + (extreme == 1 ? " vertex" : " vertices") +
           " of too few or too many quads, one of " +
           std::to_string((mesh.on_boundary(first) ? 2 : 4) - index4[at(first)]) +
           (mesh.on_boundary(first) ? " on the border" : "");
  // Each corner has quads of its own: no map has as few as two a corner, however it is made.
  constexpr double few = 60, quads_a_corner = 2;
  const auto corners = std::count_if(index4.begin(), index4.end(), [](Index i) { return i != 0; });
  if (static_cast<double>(corners) > std::max(few, quads / quads_a_corner))
    return std::to_string(corners) + " singularities and corners, too many for so few quads";
  return {};
}

class AttemptRun {
 public:
  AttemptRun(const AttemptShared& shared, const Attempt& attempt, Piece piece, bool mend, Context& context)
      : shared_(shared),
        options_(shared.asset.options),
        attempt_(attempt),
        piece_(std::move(piece)),
        mesh_(piece_.asset.mesh),
        mend_(mend),
        context_(context) {}

  [[nodiscard]] Expected<AttemptResult> run(bool afresh, Budget& budget) {
    const std::int64_t granted = granted_solves(afresh) * mesh_.face_count();
    const std::int64_t left = budget.left(Work::maps);
    if (!afresh && !attempt_.on_stand_in() && granted > left) {
      leave("maps on so many triangles would take more work than is left");
      return ended(Outcome::too_many_triangles);
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    context_.progress("field", 0.1);
    lay_rings();
    SpanTimer span(context_, "field");
    const Connection<double> connection(mesh_, &context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    Expected<FieldResult> field = design_field(piece_.asset, connection, field_options(connection), context_);
    if (!field) {
      if (field.error().code == ErrorCode::cancelled || field.error().code == ErrorCode::bad_option)
        return field.error();
      leave("field: " + field.error().message());
      return ended(Outcome::field_failed);
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    result_.backends.field = field->report.solve.backend;
    const RepairOptions repair = repair_options(*field);
    FieldSurgery surgery(mesh_, std::move(*field), shared_.edge, real_solver_);
    if (!surgery.repair(repair, context_).ok()) return cancelled_error("remesh");
    find_loops();
    span.end();
    lap(result_.seconds.field);

    Budget share = budget.lend(Work::maps, std::max(left / 2, granted));
    const Expected<Outcome> outcome = map_field(connection, surgery, share);
    result_.share_left = share.left(Work::maps);
    budget.give_back(Work::maps, share);
    if (!outcome) return outcome.error();
    return ended(*outcome);
  }

 private:
  void lap(double& into) {
    into += watch_.seconds();
    watch_ = {};
  }
  void leave(const std::string& reason) { result_.reasons.push_back(reason); }
  [[nodiscard]] AttemptResult ended(Outcome outcome) {
    result_.outcome = outcome;
    return std::move(result_);
  }

  [[nodiscard]] FieldOptions field_options(const Connection<double>& connection) const;

  [[nodiscard]] RepairOptions repair_options(const FieldResult& field) const {
    RepairOptions repair;
    repair.edge = shared_.edge;
    repair.quads = shared_.quads;
    repair.straight = straight_border();
    // No direction was requested: pairs that do not make the sizes vary less are worth nothing.
    const DirectionOptions& asked = options_.directions;
    constexpr double near = 4, of_surface = 0.07;
    if (field.report.preset == FieldPreset::flat && !asked.bones && !asked.curvature && !(asked.posed > 0) &&
        piece_.kept.empty() && !shared_.asset.asks_for_directions() &&
        shared_.asset.sizing.density == DensitySource::uniform && shared_.asset.sizing.own_density.empty() &&
        options_.density_factors.empty() && options_.bone_density.empty())
      repair.needless_reach = std::min(near * shared_.edge, of_surface * std::sqrt(shared_.area));
    return repair;
  }

  /// Border vertices that are to be no corners: their mirror images close the surface around them.
  [[nodiscard]] std::vector<char> straight_border() const {
    std::vector<char> straight;
    if (!shared_.whole || piece_.mirror.empty()) return straight;
    straight.assign(at(mesh_.vertex_count()), 0);
    for (const bool mark : {true, false})
      for (Index h = 0; h < mesh_.halfedge_count(); ++h)
        if (mesh_.twin(h) == no_index && (piece_.mirror[at(h)] != 0) == mark)
          straight[at(mesh_.origin(h))] = straight[at(mesh_.target(h))] = mark;
    return straight;
  }

  /// Where the rims that get rings lie on these triangles.
  void lay_rings() {
    if (!shared_.lays_rings || shared_.asset.rings.empty()) return;
    const ClosestPoint closest(mesh_);
    for (const RimRings& ring : shared_.asset.rings) bands_.push_back(rim_band(mesh_, closest, ring.rim, ring.reach));
  }

  /// The loops that quads are to close along: round every opening, and every hinge that has some quads around.
  void find_loops() {
    constexpr double least_around = 5;
    for (const RimBand& band : bands_)
      if (band.loop) loops_.push_back(*band.loop);
    if (options_.preset != FieldPreset::standard || !piece_.asset.rig) return;
    for (Hinge& hinge : find_hinges(mesh_, *piece_.asset.rig)) {
      const std::string& joint = piece_.asset.rig->skeleton.bones[at(hinge.bone)].name;
      if (options_.loops.of(joint) > 0 && hinge.length > least_around * edge_along(hinge.loop))
        loops_.push_back(std::move(hinge.loop));
    }
  }
  /// Edge of the quads along a loop.
  [[nodiscard]] double edge_along(const FaceLoop& loop) const {
    if (!sizes()) return shared_.edge;
    double density = 0;
    for (const Index h : loop.crossed) density += sizes()->density[at(piece_.parent[at(h / 3)])];
    return shared_.edge / std::sqrt(density / static_cast<double>(loop.crossed.size()));
  }
  /// Quads need no longer close along the loops through the corners of these faces, where there is no trouble in the
  /// map but with its integers along none. Returns whether there were any.
  [[nodiscard]] bool release_loops(std::span<const Index> faces) {
    if (faces.empty()) return !std::exchange(loops_, {}).empty();
    const std::vector<char> corners = corners_of(mesh_, faces);
    return std::erase_if(loops_, [&](const FaceLoop& loop) { return passes(mesh_, loop, corners); }) > 0;
  }

  /// The map, and where it fails again of the field with the pair of singularities next to the failure cancelled, or
  /// with the features there released. \fails cancelled
  [[nodiscard]] Expected<Outcome> map_field(const Connection<double>& connection, FieldSurgery& surgery,
                                            Budget& budget) {
    std::vector<char> held(at(mesh_.face_count()), 0);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      if (mesh_.twin(h) == no_index || (!piece_.kept.empty() && piece_.kept[at(h)])) held[at(h / 3)] = 1;
    if (const OwnDirections* own = shared_.asset.own)
      for (std::size_t f = 0; f < held.size(); ++f)
        if (std::isinf(own->weight[at(piece_.parent[f])])) held[f] = 1;
    for (const RimBand& band : bands_)
      for (const BandFace& beside : band.faces) held[at(beside.face)] = 1;
    std::size_t troubled_before = std::numeric_limits<std::size_t>::max();
    constexpr int mends = 3;
    for (int mended = 0;; ++mended) {
      if (Status status = surgery.apply(held, context_); !status.ok()) {
        leave("field: " + status.error().message());
        return Outcome::field_failed;
      }
      if (!surgery.backend().empty()) result_.backends.surgery = surgery.backend();
      lap(result_.seconds.field);
      if (const std::string reason = unmappable(mesh_, surgery.field().singularities.index4, shared_.quads);
          !reason.empty()) {
        leave(reason);
        return Outcome::unmappable;
      }
      std::vector<Index> trouble, flat;
      Expected<MadeQuads> made = quads_of(connection, surgery.field(), trouble, flat, budget);
      if (context_.cancelled()) return cancelled_error("remesh");
      watch_ = {};  // those of the map are taken
      if (made) return judged(std::move(*made), surgery.field());
      if (made.error().code == ErrorCode::cancelled) return made.error();
      leave(made.error().what);
      if (!mend_) return Outcome::tangled;
      if (attempt_.keeps_features && is_noise(static_cast<Index>(trouble.size()), mesh_.face_count()))
        return Outcome::noisy;
      const bool last = mended == mends;
      if (!last && !budget.spent(Work::maps) && release_loops(trouble)) continue;
      if (!budget.spent(Work::maps) && release_near(mesh_, trouble, piece_.kept)) {
        if (last) return Outcome::tangled;
        continue;
      }
      if (!last && !budget.spent(Work::maps) && release_near(mesh_, flat, piece_.kept)) continue;
      const Outcome outcome = trouble.empty() ? Outcome::flat : Outcome::tangled;
      if (budget.spent(Work::maps)) {
        leave("maps on these triangles have taken their share of the work");
        return outcome == Outcome::flat ? outcome : Outcome::budget_spent;
      }
      if (outcome == Outcome::flat) return outcome;
      // Where many triangles are in trouble and fewer pairs do not help, no single pair will.
      constexpr std::size_t very_many = 300, many = 30;
      const bool hopeless = trouble.size() > very_many || (trouble.size() > many && trouble.size() >= troubled_before);
      troubled_before = trouble.size();
      if (last) return outcome;
      if (!hopeless && surgery.repair_near(trouble, shared_.edge, context_)) continue;
      if (std::exchange(loops_, {}).empty()) return outcome;
    }
  }

  /// Moves frames and matching towards those of a map.
  [[nodiscard]] Status reduce(const Connection<double>& connection, const Singularities& singularities,
                              FrameField& frames, Matching& matching, Budget& budget) {
    const SpanTimer span(context_, "curl");
    CurlOptions options;
    options.rounds = options_.curl_rounds;
    options.kept = piece_.kept;
    options.solver = options_.solver;
    Expected<ReducedField> reduced = reduce_curl(mesh_, connection, frames, matching, singularities, options, context_);
    if (!reduced) return map_error("curl: " + reduced.error().message());
    constexpr std::int64_t solves = 2;  // one factorization, and solves that cost little beside it
    budget.spend(Work::maps, solves * mesh_.face_count());
    frames = std::move(reduced->frames);
    matching = std::move(reduced->matching);
    curl_ = reduced->report.in_units_of(shared_.edge);
    return {};
  }

  /// \param trouble on return the faces at which no valid map was found, where that was the reason
  /// \param flat on return those at which edges that are kept hold quads flat, where that was the reason
  [[nodiscard]] Expected<MadeQuads> quads_of(const Connection<double>& connection, const FieldResult& field,
                                             std::vector<Index>& trouble, std::vector<Index>& flat, Budget& budget) {
    context_.progress("map", 0.2);
    SpanTimer span(context_, "map", count_of(mesh_.face_count(), "triangle"));
    FrameField frames = field.frames;
    const RemeshShared& asset = shared_.asset;
    if (sizes()) {
      Expected<FrameField> sized =
          apply_sizes(mesh_, connection, *sizes(), asset.connection, piece_.parent, shared_.quads, shared_.area,
                      field.matching, std::move(frames), context_, real_solver_);
      if (!sized) return map_error("sizes: " + sized.error().message());
      frames = std::move(*sized);
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    Matching matching = field.matching;
    if (options_.curl_rounds > 0)
      if (Status status = reduce(connection, field.singularities, frames, matching, budget); !status)
        return status.error();
    SeamlessOptions seamless;
    seamless.quads = shared_.quads;
    seamless.kept = piece_.kept;
    seamless.loops = loops_;
    seamless.accept_defects = true;
    seamless.solver = options_.solver;
    Expected<SeamlessMap> map =
        seamless_map(mesh_, connection, frames, matching, field.singularities, seamless, context_, budget);
    span.end();
    lap(result_.seconds.map);
    if (!map) return map.error();
    StageBackends& backends = result_.backends;
    backends.target = map->report.target_backend;
    backends.map = map->report.map_backend;
    if (!map->report.untangling_backend.empty()) backends.untangling = map->report.untangling_backend;
    if (!map->valid()) {
      trouble = map->report.trouble;
      return map_error(map->report.tries.back());
    }

    // What the map is not straight along holds no vertices of quads.
    for (std::size_t h = 0; h < piece_.kept.size(); ++h)
      if (map->aligned[h] == Aligned::none) piece_.kept[h] = 0;

    strain_ = map->report.strain;
    const TriangleMesh<double>& surface = surface_mesh();
    const EdgeMarks& surface_kept = surface_marks();
    std::optional<OntoSurface> projection;
    if (!piece_.source.empty()) projection.emplace(mesh_, piece_.source, piece_.kept, surface, surface_kept);
    if (context_.cancelled()) return cancelled_error("remesh");
    const auto onto = [&](const SurfacePoint& point) { return projection ? (*projection)(point) : point; };
    const QuadSurface target{surface, surface_kept, onto};
    MapQuads quads(mesh_, *map, target, shared_.quads, options_, context_, budget);
    Expected<MadeQuads> made = quads.run();
    result_.seconds += quads.seconds;
    if (!quads.untangling_backend.empty()) backends.untangling = quads.untangling_backend;
    flat = std::move(quads.flat);
    if (!made) return made;
    if (options_.keep_maps) {
      map_ = ComponentMap{mesh_, std::move(made->z), map->index4, EdgeMarks(map->cut.branch.size(), 0)};
      for (std::size_t h = 0; h < map_->cut.size(); ++h) map_->cut[h] = map->cut.branch[h] != no_index;
    }
    on_the_way_ = map->report.tries;
    on_the_way_.insert(on_the_way_.end(), quads.reasons.begin(), quads.reasons.end());
    return made;
  }

  [[nodiscard]] Outcome judged(MadeQuads made, const FieldResult& field) {
    constexpr double too_many = 1.5;
    if (attempt_.keeps_features && made.quads.quad_count() > too_many * shared_.quads) {
      leave("creases and features need " + std::to_string(made.quads.quad_count()) + " quads");
      return Outcome::features_too_dense;
    }
    const EdgeMarks& mirror = piece_.source.empty() ? piece_.mirror : shared_.original.mirror;
    if (shared_.whole)
      if (const std::string defect = mirror_defect(
              mirrored_quads(made.quads.quads, on_cut(surface_mesh(), mirror, made.quads)), *shared_.whole);
          !defect.empty()) {
        leave("mirrored: " + defect);
        return Outcome::unmappable;
      }
    for (const std::string& reason : on_the_way_) leave(reason);
    SpanTimer span(context_, "landing");
    Landing landing(surface_mesh(), surface_marks(), shared_.edge, options_.polish, context_);
    const Coverage covered = landing.run(made.quads, made.least);
    span.end();
    lap(result_.seconds.polish);
    const double least = made.least, average = average_jacobian(made.quads);
    const double farthest = covered.farthest / shared_.edge;
    result_.found = FoundQuads{std::move(made),
                               surface_mesh(),
                               surface_marks(),
                               mirror,
                               piece_.source.empty() ? piece_.parent : shared_.original.parent,
                               std::move(landing.landed),
                               farthest,
                               average,
                               field.singularities.plus + field.singularities.minus,
                               field.report,
                               strain_,
                               curl_,
                               std::move(map_)};
    if (farthest > covered_edges) {
      leave("a point " + std::to_string(farthest).substr(0, 4) + " edges of quads off them");
      return Outcome::uncovered;
    }
    if (least > fine_enough && attempt_.unasked && average < even_enough) {
      leave("creases make quads uneven: scaled Jacobian " + std::to_string(average).substr(0, 4) + " on average");
      return Outcome::poor;
    }
    if (least > fine_enough) return Outcome::good;
    leave("least scaled Jacobian " + std::to_string(least).substr(0, 4));
    return Outcome::poor;
  }

  [[nodiscard]] const SizeField* sizes() const {
    return shared_.asset.rounded && !attempt_.keeps_features ? shared_.asset.rounded : shared_.asset.sizes;
  }
  // Where the quads go: the triangles of the attempt, or what they stand for.
  [[nodiscard]] const TriangleMesh<double>& surface_mesh() const {
    return piece_.source.empty() ? mesh_ : shared_.original.asset.mesh;
  }
  [[nodiscard]] const EdgeMarks& surface_marks() const {
    return piece_.source.empty() || !attempt_.keeps_features ? piece_.kept : shared_.original.kept;
  }

  const AttemptShared& shared_;
  const RemeshOptions& options_;
  const Attempt& attempt_;
  Piece piece_;
  const TriangleMesh<double>& mesh_;
  const bool mend_;
  Context& context_;
  const SolverFactory<double> real_solver_ = options_.solver.factory<double>();
  AttemptResult result_;
  MapStrain strain_;             // of the map that came out
  CurlReport curl_;              // of the field that it was made of
  std::vector<RimBand> bands_;   // along rims that get rings
  std::vector<FaceLoop> loops_;  // that quads are to close along
  std::optional<ComponentMap> map_;
  std::vector<std::string> on_the_way_;  // what the map that came out was preceded by
  Stopwatch watch_;
};

QUADRIG_INLINE FieldOptions AttemptRun::field_options(const Connection<double>& connection) const {
  const RemeshShared& asset = shared_.asset;
  FieldOptions field;
  field.preset = options_.preset;
  field.quad_edge = shared_.edge;
  field.merge_quads = attempt_.merge_quads;
  field.solver = options_.solver.name;
  field.own_solver = options_.solver.own_complex;
  field.own_real_solver = options_.solver.own_real;
  field.bone_weight = options_.directions.bones;
  field.curvature_weight = options_.directions.curvature;
  field.bone_poses = options_.directions.bone_poses;
  field.bone_density = asset.sizing.density == DensitySource::field;
  field.crease_angle_radians = std::numbers::pi;
  for (Index h = 0; h < static_cast<Index>(piece_.kept.size()); ++h)
    if (piece_.kept[at(h)]) field.features.push_back(h);
  if (options_.directions.terms) {
    OwnTerms terms = options_.directions.terms(mesh_, connection, piece_.parent);
    field.own_terms_x0 = std::move(terms.x0);
    field.own_terms_x1 = std::move(terms.x1);
  }
  const bool posed = asset.metric && options_.directions.posed > 0;
  if (!posed && !asset.own && bands_.empty()) return field;
  PolyVectorTargets targets = PolyVectorTargets::none(mesh_.face_count());
  const auto cross_along = [](Complex d) { return -integer_power(d / std::abs(d), 4); };
  for (Index f = 0; f < mesh_.face_count(); ++f) {
    const auto p = at(piece_.parent[at(f)]);
    if (posed) {
      const Complex d =
          connection.to_complex(f, asset.connection.to_vector(piece_.parent[at(f)], asset.metric->direction[p]));
      targets.x0[at(f)] = cross_along(d);
      targets.weight[at(f)] = options_.directions.posed * asset.metric->alignment[p];
    }
    if (!asset.own || !(asset.own->weight[p] > 0)) continue;
    const Complex d = connection.to_complex(f, asset.own->direction[p]);
    if (!(std::abs(d) > 0)) continue;  // across a face that this one only stands for
    if (std::isinf(asset.own->weight[p])) {
      field.fixed.push_back({f, d});
      continue;
    }
    const double before = targets.weight[at(f)], own = asset.own->weight[p];
    targets.x0[at(f)] = (before * targets.x0[at(f)] + own * cross_along(d)) / (before + own);
    targets.weight[at(f)] = before + own;
  }
  // Beside rims nothing else counts. Not exactly so: at the corners of eyes and lips directions need some room.
  constexpr double beside_rims = 200;  // a bone pulls by 1
  for (const RimBand& band : bands_)
    for (const BandFace& beside : band.faces) {
      const Complex d = connection.to_complex(beside.face, beside.along);
      if (!(std::abs(d) > 0)) continue;
      targets.x0[at(beside.face)] = cross_along(d);
      targets.weight[at(beside.face)] = beside_rims;
    }
  field.targets = std::move(targets);
  return field;
}

QUADRIG_INLINE Expected<AttemptResult> run_attempt(const AttemptShared& shared, const Attempt& attempt, Piece piece,
                                                   bool afresh, bool mend, Context& context, Budget& budget) {
  return AttemptRun(shared, attempt, std::move(piece), mend, context).run(afresh, budget);
}

}  // namespace quadrig::detail
