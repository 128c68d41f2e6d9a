#pragma once

#include <numbers>

#include "quadrig/field/surgery.hpp"
#include "quadrig/pipeline/alignment.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/map_stage.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/pipeline/shares.hpp"
#include "quadrig/simplify.hpp"

namespace quadrig::detail {

/// Barycentric coordinates of a point in the plane of a face, clamped into it.
inline SurfacePoint point_in_face(const TriangleMesh<double>& mesh, Index face, const Vector3& p) {
  const Vector3 a = mesh.position(mesh.faces()(face, 0)), b = mesh.position(mesh.faces()(face, 1)),
                c = mesh.position(mesh.faces()(face, 2));
  const SurfaceHit hit = closest_on_triangle(p, a, b, c);
  return {face, hit.barycentric};
}

/// Keeps no longer the edges at the corners of these faces. Returns whether there were any.
inline bool let_go(const TriangleMesh<double>& mesh, std::span<const Index> faces, EdgeMarks& kept) {
  if (kept.empty()) return false;
  std::vector<char> near(at(mesh.vertex_count()), 0);
  for (const Index f : faces)
    for (int i = 0; i < 3; ++i) near[at(mesh.faces()(f, i))] = 1;
  bool any = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (kept[at(h)] && (near[at(mesh.origin(h))] || near[at(mesh.target(h))])) kept[at(h)] = 0, any = true;
  return any;
}

inline double least_jacobian(const QuadMesh& quads) {
  double least = 1;
  for (Index q = 0; q < quads.quad_count(); ++q)
    least = std::min(least, scaled_jacobian(quads.positions, quads.quads.row(q)));
  return least;
}

/// Takes every vertex to its source, but for those on which a quad would be inverted: how many.
inline Index onto_surface(const TriangleMesh<double>& mesh, QuadMesh& quads) {
  const Points<double> beside = quads.positions;
  std::vector<char> moved(at(quads.vertex_count()), 0);
  Index left = 0;
  for (Index v = 0; v < quads.vertex_count(); ++v) {
    const Vector3 p = position(mesh, quads.source[at(v)]);
    if (!((p - beside.row(v).transpose()).norm() > 1e-9 * mesh.diagonal())) continue;
    quads.positions.row(v) = p.transpose();
    moved[at(v)] = 1;
  }
  for (bool again = true; again;) {
    again = false;
    for (Index q = 0; q < quads.quad_count(); ++q) {
      if (scaled_jacobian(quads.positions, quads.quads.row(q)) > 0) continue;
      for (int i = 0; i < 4; ++i) {
        const Index v = quads.quads(q, i);
        if (!std::exchange(moved[at(v)], char{0})) continue;
        quads.positions.row(v) = beside.row(v);
        ++left;
        again = true;
      }
    }
  }
  return left;
}

class ComponentRemesher {
 public:
  ComponentRemesher(const RemeshShared& shared, std::span<const Index> faces, double quads, const Context& outer)
      : shared_(shared), options_(shared.options), faces_(faces), quads_(quads), context_(outer) {
    context_.warnings.clear();
  }

  [[nodiscard]] Expected<ComponentResult> run() {
    if (context_.cancelled()) return cancelled_error("remesh");
    result_.report.faces = static_cast<Index>(faces_.size());
    result_.report.asked = quads_;
    original_ = make_piece(shared_.asset, faces_, context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    area_ = original_.asset.mesh.total_area();
    edge_ = std::sqrt(area_ / quads_);
    original_.kept = marks_of(shared_.kept, faces_);
    if (options_.group_borders && original_.asset.rig) keep_group_borders(original_, 4 * edge_);
    if (!original_.kept.empty()) result_.report.kept_length = EdgeCurves(original_.asset.mesh, original_.kept).length();
    // That many triangles a quad carry a map as well as any number; where quads are many, fewer do.
    stand_in_faces_ = std::max<Index>(4000, static_cast<Index>(std::min(20 * quads_, 40'000 + 4 * quads_)));
    // For the maps of all attempts, of which the first and a stand-in are never without: several times what a surface
    // takes whose first field can be mapped.
    const std::int64_t all_mapping =
        1'500'000 + 10 * std::int64_t{stand_in_faces_} + 20 * std::int64_t{original_.asset.mesh.face_count()};
    mapping_ = all_mapping;

    // Crumbs: a map of each would take longer than that of a surface as large as all of them.
    constexpr std::size_t many_parts = 500;
    if (shared_.parts > many_parts && quads_ <= least_quads) return split();

    bool first = true, kept_last = false;
    int poor = 0;  // attempts begun since there were quads that are valid but poor
    double begun = 0;
    for (const Attempt& attempt : ladder()) {
      if (context_.cancelled()) return cancelled_error("remesh");
      if (std::exchange(kept_last, attempt.keeps) && !attempt.keeps && !best_) {
        // Without what was to be kept, as if it had never been asked for.
        left_ = {};
        mapping_ = all_mapping;
        dear_ = false;
        flat_ = 0;
        first = true;
      }
      const bool spent = flat_ > most_flat || left_.integers <= 0;
      if (spent && attempt.keeps) continue;
      if (spent || (best_ && ++poor > 1)) break;
      if (attempt.longest_edge > 0 && (dear_ || attempt.longest_edge <= endless_)) continue;
      const ProgressPart progress(context_, begun, (1 + begun) / 2);  // how many there will be is not known
      begun = (1 + begun) / 2;
      const Expected<bool> good = climb(attempt, std::exchange(first, false));
      if (!good) return good.error();
      if (*good) break;
    }
    return best_ ? settle() : split();
  }

 private:
  static constexpr int most_flat = 3;  // attempts that end where there is nothing to mend

  struct Attempt {
    double smoothing;     // singularities closer than this many quads merge
    double longest_edge;  // of the triangles, in quad edges; 0: on a stand-in for the surface
    bool keeps = false;   // creases and features
  };
  // The best so far of quads that are valid but poor, with the surface that they lie on.
  struct Best {
    QuadMesh quads;
    double least;
    TriangleMesh<double> surface;
    EdgeMarks kept;
    std::vector<Index> parent;
    Rung rung;
    Index singularities;
    FieldReport field;
  };

  [[nodiscard]] std::vector<Attempt> ladder() const {
    const TriangleMesh<double>& mesh = original_.asset.mesh;
    std::vector<Attempt> attempts{{0.5, 1.5}, {1, 1.0}, {1, 0}, {2, 0.7}, {4, 0}};
    bool noise = false;  // edges that no quad will ever see
    for (Index h = 0; h < mesh.halfedge_count() && !noise; ++h) noise = mesh.edge_vector(h).norm() < 1e-5 * edge_;
    if (noise || mesh.face_count() > std::max(20'000.0, std::min(40 * quads_, 2.5 * stand_in_faces_)))
      attempts.insert(attempts.begin(), Attempt{0.5, 0});
    if (!original_.kept.empty()) {  // the first three with them, then all without
      std::vector<Attempt> keeping(attempts.begin(), attempts.begin() + 3);
      for (Attempt& attempt : keeping) attempt.keeps = true;
      attempts.insert(attempts.begin(), keeping.begin(), keeping.end());
    }
    return attempts;
  }

  void lap(double& into) {
    into += watch_.seconds();
    watch_ = {};
  }
  void leave(const Attempt& attempt, const std::string& reason) {
    result_.report.reasons.push_back("smoothing over " + std::to_string(attempt.smoothing).substr(0, 3) +
                                     " quads: " + reason);
  }

  /// Whether the attempt ended with good quads. \fails cancelled, bad_option
  [[nodiscard]] Expected<bool> climb(const Attempt& attempt, bool first) {
    watch_ = {};
    context_.progress("triangles", 0);
    std::optional<Piece> piece = ground(attempt);
    lap(result_.seconds.pieces);
    if (!piece) return false;
    const TriangleMesh<double>& mesh = piece->asset.mesh;
    // Enough for every scaling of the first attempt's first field where none makes headway, else for one.
    const std::int64_t least_share = (first ? 27 : 12) * std::int64_t{mesh.face_count()};
    if (!first && attempt.longest_edge > 0 && least_share > mapping_) {
      leave(attempt, "maps on so many triangles would take more work than is left");
      return false;
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    context_.progress("field", 0.1);
    const Connection<double> connection(mesh, &context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    Expected<FieldResult> field =
        design_field(piece->asset, connection, field_options(attempt, *piece, connection), context_);
    if (!field) {
      if (field.error().code == ErrorCode::cancelled || field.error().code == ErrorCode::bad_option)
        return field.error();
      leave(attempt, "field: " + field.error().message());
      return false;
    }
    if (context_.cancelled()) return cancelled_error("remesh");
    result_.backends.field = field->report.solve.backend;
    FieldSurgery surgery(mesh, field->frames, field->matching, field->singularities, field->pull, edge_, real_solver_);
    if (Status status = clean_up(*piece, *field, surgery); !status.ok()) return status.error();
    lap(result_.seconds.field);
    const std::int64_t share = std::max(mapping_ / 2, least_share);
    left_.mapping = share;
    const Expected<bool> good = map(attempt, *piece, connection, *field, surgery);
    mapping_ -= share - left_.mapping;
    dear_ = dear_ || (left_.mapping <= 0 && attempt.longest_edge > 0);
    return good;
  }

  /// The triangles of an attempt: the component's own, refined where they are longer than asked for, or fewer that
  /// stand in for them. None where they cannot be had.
  [[nodiscard]] std::optional<Piece> ground(const Attempt& attempt) {
    Piece piece;
    if (attempt.longest_edge == 0) {
      if (!stand_in_) {
        Expected<Piece> made = stand_in_piece(original_, stand_in_faces_, context_);
        if (!made) {
          leave(attempt, "stand-in: " + made.error().message());
          return std::nullopt;
        }
        stand_in_ = std::move(*made);
      }
      piece = *stand_in_;
      if (!attempt.keeps) piece.kept.clear();
      return piece;
    }
    piece = original_;
    if (!attempt.keeps) piece.kept.clear();
    // What is all needles has no end.
    const auto most = static_cast<Index>(20'000 + std::min({100 * quads_, std::max(4e5, 20 * quads_), 2e6}));
    if (Status status = refine_piece(piece, attempt.longest_edge * edge_, most, context_); !status.ok()) {
      leave(attempt, status.error().message());
      endless_ = attempt.longest_edge;
      return std::nullopt;
    }
    for (std::optional<Refinement> freed; (freed = border_freed(piece.asset.mesh, piece.kept));) {
      replace_mesh(piece, std::move(*freed));
      if (piece.kept.empty()) break;
    }
    return piece;
  }

  [[nodiscard]] FieldOptions field_options(const Attempt& attempt, const Piece& piece,
                                           const Connection<double>& connection) const {
    FieldOptions field;
    field.preset = options_.preset;
    field.quad_edge = edge_;
    field.merge_quads = attempt.smoothing;
    field.solver = options_.solver.name;
    field.own_solver = options_.solver.own_complex;
    field.own_real_solver = options_.solver.own_real;
    field.bone_weight = options_.directions.bones;
    field.curvature_weight = options_.directions.curvature;
    field.bone_density = shared_.sizing.density == DensitySource::field;
    field.crease_angle_radians = std::numbers::pi;
    for (Index h = 0; h < static_cast<Index>(piece.kept.size()); ++h)
      if (piece.kept[at(h)]) field.features.push_back(h);
    if (!shared_.metric || !(options_.directions.posed > 0)) return field;
    PolyVectorTargets targets = PolyVectorTargets::none(piece.asset.mesh.face_count());
    for (Index f = 0; f < piece.asset.mesh.face_count(); ++f) {
      const auto p = at(piece.parent[at(f)]);
      const Complex d =
          connection.to_complex(f, shared_.connection.to_vector(piece.parent[at(f)], shared_.metric->direction[p]));
      targets.x0[at(f)] = -integer_power(d / std::abs(d), 4);
      targets.weight[at(f)] = options_.directions.posed * shared_.metric->alignment[p];
    }
    field.targets = std::move(targets);
    return field;
  }

  /// Singularities that no quads can have, or that too few quads would share.
  [[nodiscard]] Status clean_up(const Piece& piece, const FieldResult& field, FieldSurgery& surgery) {
    surgery.split_extremes(0.75 * edge_, context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    // Farther ones shape limbs, and go only where each singularity would have few quads to itself.
    surgery.cancel_pairs(0.75 * edge_, 2 * edge_, quads_ / 20);
    if (context_.cancelled()) return cancelled_error("remesh");
    // Nobody asked for these directions: what does not even out sizes goes.
    const DirectionOptions& asked = options_.directions;
    if (field.report.preset == FieldPreset::flat && !asked.bones && !asked.curvature && !(asked.posed > 0) &&
        piece.kept.empty() && shared_.sizing.density == DensitySource::uniform)
      surgery.cancel_needless(std::min(4 * edge_, 0.07 * std::sqrt(area_)), context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    return {};
  }

  /// Why no map of the field is tried; empty where one is.
  [[nodiscard]] std::string unmappable(const TriangleMesh<double>& mesh, const std::vector<Index>& index) const {
    Index extreme = 0, first = no_index;
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      if (index[at(v)] > 1 || index[at(v)] < (mesh.on_boundary(v) ? -2 : -3)) {
        ++extreme;
        if (first == no_index) first = v;
      }
    if (extreme > 0)
      return "field: " + std::to_string(extreme) + (extreme == 1 ? " vertex" : " vertices") +
             " of too few or too many quads, one of " +
             std::to_string((mesh.on_boundary(first) ? 2 : 4) - index[at(first)]) +
             (mesh.on_boundary(first) ? " on the border" : "");
    const auto corners = std::count_if(index.begin(), index.end(), [](Index i) { return i != 0; });
    if (static_cast<double>(corners) > std::max(60.0, quads_ / 2))
      return std::to_string(corners) + " singularities and corners, too many for so few quads";
    return {};
  }

  /// The map, and where it fails the field again with the pair of singularities next to the failure cancelled.
  /// Returns whether there are good quads.
  [[nodiscard]] Expected<bool> map(const Attempt& attempt, Piece& piece, const Connection<double>& connection,
                                   FieldResult& field, FieldSurgery& surgery) {
    const TriangleMesh<double>& mesh = piece.asset.mesh;
    const std::vector<Index>& index = field.singularities.index4;
    std::vector<char> held(at(mesh.face_count()), 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (mesh.twin(h) == no_index || (!piece.kept.empty() && piece.kept[at(h)])) held[at(h / 3)] = 1;
    std::size_t troubled = std::numeric_limits<std::size_t>::max();
    static constexpr int max_operations = 3;
    for (int operation = 0; operation <= max_operations; ++operation) {
      if (Status status = surgery.apply(held, context_); !status.ok()) {
        leave(attempt, "field: " + status.error().message());
        return false;
      }
      if (!surgery.backend().empty()) result_.backends.surgery = surgery.backend();
      lap(result_.seconds.field);
      if (const std::string reason = unmappable(mesh, index); !reason.empty()) {
        leave(attempt, reason);
        return false;
      }
      std::vector<Index> trouble;
      Expected<MapOutput> mapped = map_once(attempt, piece, connection, field, trouble);
      if (context_.cancelled()) return cancelled_error("remesh");
      watch_ = {};  // the map has its own
      if (mapped && attempt.keeps && mapped->quads.quad_count() > 1.5 * quads_) {
        leave(attempt, "creases and features need " + std::to_string(mapped->quads.quad_count()) + " quads");
        return false;
      }
      if (mapped) {
        for (const std::string& reason : mapped->reasons) leave(attempt, reason);
        const double least = mapped->least;
        if (!best_ || least > best_->least) keep_best(attempt, piece, field, std::move(*mapped));
        if (least > fine_enough) return true;
        leave(attempt, "least scaled Jacobian " + std::to_string(least).substr(0, 4));
        return false;
      }
      if (mapped.error().code == ErrorCode::cancelled) return mapped.error();
      leave(attempt, mapped.error().what);
      if (best_) return false;
      // What is wrong all over is no matter of single edges.
      if (attempt.keeps && trouble.size() > std::max<std::size_t>(300, at(mesh.face_count()) / 50)) {
        flat_ = most_flat + 1;
        return false;
      }
      if (left_.mapping > 0 && let_go(mesh, trouble, piece.kept)) continue;
      flat_ += trouble.empty();
      // Where many triangles are in trouble and fewer pairs do not help, no single pair will.
      const bool hopeless = trouble.size() > 300 || (trouble.size() > 30 && trouble.size() >= troubled);
      troubled = trouble.size();
      if (left_.mapping <= 0) {
        leave(attempt, "maps on these triangles have taken their share of the work");
        return false;
      }
      if (trouble.empty() || hopeless || !surgery.cancel_near(trouble)) return false;
      surgery.split_extremes(0.75 * edge_, context_);
    }
    return false;
  }

  /// \param trouble faces at which no valid map was found, where that was the reason
  [[nodiscard]] Expected<MapOutput> map_once(const Attempt& attempt, const Piece& piece,
                                             const Connection<double>& connection, const FieldResult& field,
                                             std::vector<Index>& trouble) {
    const TriangleMesh<double>& mesh = piece.asset.mesh;
    context_.progress("map", 0.2);
    FrameField frames = field.frames;
    if (shared_.sizes)
      if (Status status = apply_sizes(mesh, connection, *shared_.sizes, shared_.connection, piece.parent, quads_, area_,
                                      field.matching, frames, context_, real_solver_);
          !status.ok())
        return map_error("sizes: " + status.error().message());
    if (context_.cancelled()) return cancelled_error("remesh");
    std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
    for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(field.matching.r[h] & 3);
    const std::vector<Index>& index = field.singularities.index4;
    const CutGraph cut = make_cut_graph(mesh, rotation, index, &context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    const Alignment alignment(mesh, connection, cut, field, frames, piece.kept);
    if (context_.cancelled()) return cancelled_error("remesh");
    const TargetEdges target = target_edges(mesh, connection, cut, frames.u, frames.v);
    if (context_.cancelled()) return cancelled_error("remesh");
    const TriangleMesh<double>& surface = surface_of(piece);
    const EdgeMarks& surface_kept = kept_on_surface(attempt, piece);
    std::optional<OntoSurface> projection;
    if (!piece.source.empty()) projection.emplace(mesh, piece.source, piece.kept, surface, surface_kept);
    const auto onto = [&](const SurfacePoint& point) { return projection ? (*projection)(point) : point; };
    if (context_.cancelled()) return cancelled_error("remesh");
    const MapInput input{mesh,    connection,   cut,  index, alignment.aligned, target, quads_,
                         surface, surface_kept, onto, left_};
    lap(result_.seconds.map);
    return alignment.any ? MapStage<double>(input, options_, result_.seconds, result_.backends).run(trouble, context_)
                         : MapStage<Complex>(input, options_, result_.seconds, result_.backends).run(trouble, context_);
  }

  // Where the quads go: the triangles of the attempt, or what they stand for.
  [[nodiscard]] const TriangleMesh<double>& surface_of(const Piece& piece) const {
    return piece.source.empty() ? piece.asset.mesh : original_.asset.mesh;
  }
  [[nodiscard]] const EdgeMarks& kept_on_surface(const Attempt& attempt, const Piece& piece) const {
    return piece.source.empty() || !attempt.keeps ? piece.kept : original_.kept;
  }
  void keep_best(const Attempt& attempt, const Piece& piece, const FieldResult& field, MapOutput mapped) {
    best_ = Best{std::move(mapped.quads),
                 mapped.least,
                 surface_of(piece),
                 kept_on_surface(attempt, piece),
                 piece.source.empty() ? piece.parent : original_.parent,
                 mapped.rung,
                 field.singularities.plus + field.singularities.minus,
                 field.report};
  }

  [[nodiscard]] Expected<ComponentResult> settle() {
    QuadMesh& found = best_->quads;
    Kept kept = measure_kept(best_->surface, best_->kept, found);
    for (Index v = 0; v < found.vertex_count(); ++v) {
      SurfacePoint& s = found.source[at(v)];
      s = point_in_face(shared_.asset.mesh, best_->parent[at(s.face)], position(best_->surface, s));
      found.positions.row(v) = position(shared_.asset.mesh, s).transpose();
    }
    if (!(least_jacobian(found) > 0)) {
      result_.report.reasons.push_back("a quad is inverted where it lies on the surface's own triangles");
      return split();
    }
    result_.held = std::move(kept.vertex);
    result_.report.kept_as_quads = kept.as_quads;
    result_.report.rung = best_->rung;
    result_.report.singularities = best_->singularities;
    result_.field = std::move(best_->field);
    return finished(std::move(found));
  }

  [[nodiscard]] Expected<ComponentResult> split() {
    const TriangleMesh<double>& mesh = original_.asset.mesh;
    SplitOptions split_options;
    split_options.quads = std::max<Index>(1, static_cast<Index>(std::lround(quads_)));
    split_options.polish = options_.polish;
    Expected<SplitQuads> made = split_quads(mesh, split_options, context_);
    if (!made) return made.error();
    if (const Index beside = onto_surface(mesh, made->mesh); beside > 0)
      context_.warn("remesh", count_of(beside, "quad corner") + " beside the surface: on it a quad would be inverted");
    for (SurfacePoint& s : made->mesh.source) s.face = original_.parent[at(s.face)];
    result_.report.rung = Rung::split;
    return finished(std::move(made->mesh));
  }

  [[nodiscard]] ComponentResult finished(QuadMesh quads) {
    result_.report.quads = quads.quad_count();
    result_.report.irregular = quad_topology(quads.quads, quads.vertex_count()).irregular;
    result_.mesh = std::move(quads);
    result_.warnings = std::move(context_.warnings);
    return std::move(result_);
  }

  const RemeshShared& shared_;
  const RemeshOptions& options_;
  const std::span<const Index> faces_;
  const double quads_;
  Context context_;
  const SolverFactory<double> real_solver_ = options_.solver.factory<double>();
  ComponentResult result_;
  Piece original_;
  double area_ = 0, edge_ = 0;  // of the surface, and of a square quad
  Index stand_in_faces_ = 0;
  std::optional<Piece> stand_in_;
  std::optional<Best> best_;
  WorkLeft left_;
  std::int64_t mapping_ = 0;  // what is left for the maps of all attempts
  bool dear_ = false;         // the surface's own triangles took their share: those of a stand-in are left
  double endless_ = 0;        // length to which the triangles cannot be refined
  int flat_ = 0;              // valid maps whose quads would lie flat in space: another field seldom helps
  Stopwatch watch_;
};

QUADRIG_INLINE Expected<ComponentResult> remesh_component(const RemeshShared& shared, std::span<const Index> faces,
                                                          double quads, const Context& context) {
  return ComponentRemesher(shared, faces, quads, context).run();
}

}  // namespace quadrig::detail
