#pragma once

#include <numbers>

#include "quadrig/pipeline/attempt.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/guides.hpp"
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

/// Whether a surface is so thin beside an edge of quads that none fits round it, and most of it is in triangles as
/// thin: maps of those seldom come out, and take long.
inline bool is_needle(const TriangleMesh<double>& mesh, double edge) {
  constexpr double thin = 0.125, sliver = 1000;  // edges of quads; longest side by height
  double slivers = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    double longest = 0;
    for (Index h = 3 * f; h < 3 * f + 3; ++h) longest = std::max(longest, mesh.edge_vector(h).squaredNorm());
    if (longest > 2 * sliver * mesh.area(f)) slivers += mesh.area(f);
  }
  if (!(slivers > 0.5 * mesh.total_area())) return false;
  const auto farthest = [&](const Vector3& from) {
    Index found = 0;
    (mesh.positions().rowwise() - from.transpose()).rowwise().squaredNorm().maxCoeff(&found);
    return mesh.position(found);
  };
  const Vector3 end = farthest(mesh.position(0)), axis = (farthest(end) - end).normalized();
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if ((mesh.position(v) - end).cross(axis).norm() > 2 * thin * edge) return false;
  return true;
}

/// One component up the ladder: attempts until there are good quads, else the best of them, else the split surface.
class ComponentRemesher {
 public:
  ComponentRemesher(const RemeshShared& shared, std::span<const Index> faces, double quads, const Context& outer,
                    const MirrorPart* mirrored)
      : shared_(shared), options_(shared.options), faces_(faces), quads_(quads), mirrored_(mirrored), context_(outer) {
    context_.warnings.clear();
  }

  [[nodiscard]] Expected<ComponentResult> run() {
    const SpanTimer span(context_, "component", std::to_string(faces_.size()) + " triangles");
    if (context_.cancelled()) return cancelled_error("remesh");
    if (Status status = cut_out(); !status.ok()) return status.error();
    if (std::optional<QuadMesh> few = few_triangles()) return finished(std::move(*few));
    if (shared_.parts > of_all::crumbs && quads_ <= least_quads) return split();
    const bool needle = is_needle(original_.asset.mesh, edge_);
    if (needle && shared_.parts > of_all::needles) return split();
    const std::vector<Attempt> attempts = ladder(facts());
    const Budget full(original_.asset.mesh.face_count(), proxy_faces(quads_), shared_.parts);
    const auto most_attempts = needle ? 1 : static_cast<std::size_t>(of_all::share(of_all::attempts, shared_.parts));
    Budget budget = full;
    std::vector<Tried> history;
    std::size_t made = 0;
    for (std::optional<std::size_t> next; made < most_attempts && (next = next_attempt(attempts, history));) {
      if (context_.cancelled()) return cancelled_error("remesh");
      const bool afresh = begins_afresh(attempts, history, *next);
      if (afresh) budget = full;
      const Expected<Tried> tried = climb(attempts[*next], afresh, history.size(), budget);
      if (!tried) return tried.error();
      history.push_back(*tried);
      history.back().attempt = *next;
      // A strip, round which no quads go, has its map on a stand-in as soon as on itself.
      made += original_.asset.mesh.closed() || tried->outcome != Outcome::triangles_unavailable;
    }
    return best_ ? settle() : split();
  }

 private:
  /// The component by itself, with its features.
  [[nodiscard]] Status cut_out() {
    result_.report.faces = static_cast<Index>(faces_.size());
    result_.report.asked = quads_;
    original_ = mirrored_ ? *mirrored_->half : make_piece(shared_.asset, faces_, context_);
    if (context_.cancelled()) return cancelled_error("remesh");
    area_ = original_.asset.mesh.total_area();
    edge_ = std::sqrt(area_ / quads_);
    if (!mirrored_) original_.kept = marks_of(shared_.kept, faces_);
    constexpr double least_island = 4;  // edges of quads around
    if (options_.group_borders && original_.asset.rig) keep_group_borders(original_, least_island * edge_);
    keep_guides(original_, options_.guides, mirrored_ ? shared_.plane : nullptr);
    if (!original_.kept.empty()) result_.report.kept_length = EdgeCurves(original_.asset.mesh, original_.kept).length();
    return {};
  }

  /// A triangle as the three quads between its corners and its centre, where not many more are asked for.
  [[nodiscard]] std::optional<QuadMesh> lone_triangle() const {
    constexpr double three = 5;  // six quads would be as far off
    if (quads_ > three) return std::nullopt;
    QuadMesh quads;
    quads.positions.resize(7, 3);
    quads.quads.resize(3, 4);
    quads.quads << 0, 3, 6, 5, 1, 4, 6, 3, 2, 5, 6, 4;  // corners, middles of the sides, centre
    const auto put = [&](Index v, const Vector3& barycentric) {
      quads.source.push_back({original_.parent[0], barycentric});
      quads.positions.row(v) = position(original_.asset.mesh, {0, barycentric}).transpose();
    };
    for (int i = 0; i < 3; ++i) put(i, Vector3::Unit(i));
    for (int i = 0; i < 3; ++i) put(3 + i, (Vector3::Unit(i) + Vector3::Unit((i + 1) % 3)) / 2);
    put(6, Vector3::Constant(1.0 / 3));
    if (!(least_jacobian(quads) > sound)) return std::nullopt;
    return quads;
  }

  /// One triangle, or two that make a quad, where not many more quads are asked for.
  [[nodiscard]] std::optional<QuadMesh> few_triangles() const {
    constexpr double one = 2.5;  // two quads would be as far off
    const TriangleMesh<double>& mesh = original_.asset.mesh;
    if (mesh.face_count() == 1) return lone_triangle();
    if (mesh.face_count() != 2 || mesh.vertex_count() != 4 || quads_ > one) return std::nullopt;
    Index h = 0;
    while (mesh.twin(h) == no_index) ++h;
    if (!original_.kept.empty()) return std::nullopt;
    QuadMesh quads;
    quads.positions = mesh.positions();
    quads.quads.resize(1, 4);
    quads.quads << mesh.origin(h), mesh.target(mesh.next(mesh.twin(h))), mesh.target(h), mesh.target(mesh.next(h));
    for (Index v = 0; v < 4; ++v) {
      const Index g = mesh.outgoing(v);
      quads.source.push_back({original_.parent[at(g / 3)], Vector3::Unit(g % 3)});
    }
    if (!(scaled_jacobian(quads.positions, quads.quads.row(0)) > fine_enough)) return std::nullopt;
    return quads;
  }

  [[nodiscard]] SurfaceFacts facts() const {
    const TriangleMesh<double>& mesh = original_.asset.mesh;
    constexpr double tiny = 1e-5;  // of a quad's edge
    bool tiny_edges = false;
    for (Index h = 0; h < mesh.halfedge_count() && !tiny_edges; ++h)
      tiny_edges = mesh.edge_vector(h).norm() < tiny * edge_;
    return {mesh.face_count(), quads_, tiny_edges, !original_.kept.empty(), !asks_for_features(options_)};
  }

  /// One attempt, with what it took and found taken over.
  [[nodiscard]] Expected<Tried> climb(const Attempt& attempt, bool afresh, std::size_t number, Budget& budget) {
    // How many attempts there will be is not known: each takes half of what is left.
    const double begun = 1 - std::ldexp(1.0, -static_cast<int>(number));
    const ProgressPart progress(context_, begun, (1 + begun) / 2);
    const SpanTimer all(context_, "attempt", std::to_string(number + 1));
    const Stopwatch watch;
    context_.progress("triangles", 0);
    SpanTimer span(context_, attempt.on_stand_in() ? "stand-in" : "refinement");
    Expected<Piece> piece = ground(attempt);
    span.end();
    result_.seconds.pieces += watch.seconds();
    if (!piece) {
      leave(attempt, piece.error().what);
      return Tried{0, Outcome::triangles_unavailable, 1, budget.left(Work::search)};
    }
    const AttemptShared shared{shared_,
                               original_,
                               quads_,
                               area_,
                               edge_,
                               mirrored_ ? &*mirrored_->topology : nullptr,
                               number < attempts_with_rings};
    // Where features that nobody asked for spoil quads, those without deserve as much work.
    const bool mend = !best_ || (best_unasked_ && !attempt.unasked);
    Expected<AttemptResult> made = run_attempt(shared, attempt, std::move(*piece), afresh, mend, context_, budget);
    if (!made) return made.error();
    for (const std::string& reason : made->reasons) leave(attempt, reason);
    result_.seconds += made->seconds;
    take_over(made->backends);
    if (made->found && (!best_ || worth(*made->found) > worth(*best_))) {
      best_ = std::move(made->found);
      best_unasked_ = attempt.unasked;
    }
    return Tried{0, made->outcome, made->share_left, budget.left(Work::search)};
  }

  /// Of quads, how near they are to being good: on all of the surface, which counts twice, and even.
  [[nodiscard]] static double worth(const FoundQuads& found) {
    return std::min(1.0, found.made.least / fine_enough) + std::min(1.0, found.average / even_enough) +
           2 * std::min(1.0, covered_edges / found.farthest);
  }

  void take_over(StageBackends& made) {
    for (const auto stage : {&StageBackends::field, &StageBackends::surgery, &StageBackends::target,
                             &StageBackends::map, &StageBackends::untangling})
      if (!(made.*stage).empty()) result_.backends.*stage = std::move(made.*stage);
  }

  void leave(const Attempt& attempt, const std::string& reason) {
    result_.report.reasons.push_back("smoothing over " + std::to_string(attempt.merge_quads).substr(0, 3) +
                                     " quads: " + reason);
  }

  /// The triangles of an attempt: the component's own, refined where they are longer than asked for, or fewer that
  /// stand in for them. \fails, with the reason as `what`, where they cannot be had
  [[nodiscard]] Expected<Piece> ground(const Attempt& attempt) {
    constexpr double acute_reach = 1;  // edges of quads
    const auto failed = [](std::string reason) { return Error{ErrorCode::unsupported, std::move(reason), {}, {}}; };
    Piece piece;
    if (attempt.on_stand_in()) {
      if (!stand_in_) {
        Expected<Piece> made = stand_in_piece(original_, proxy_faces(quads_), context_);
        if (!made) return failed("stand-in: " + made.error().message());
        stand_in_ = std::move(*made);
      }
      piece = *stand_in_;
      if (!attempt.keeps_features) piece.kept.clear();
      release_small_patches(piece.asset.mesh, edge_, piece.kept);
      release_acute(piece.asset.mesh, acute_reach * edge_, piece.kept);
      return piece;
    }
    piece = original_;
    if (!attempt.keeps_features) piece.kept.clear();
    // Needle triangles would be refined without end.
    constexpr double base = 20'000, a_quad = 100, many_base = 4e5, many = 20, most_of_all = 2e6;
    const auto most =
        static_cast<Index>(base + std::min({a_quad * quads_, std::max(many_base, many * quads_), most_of_all}));
    if (Status status = refine_piece(piece, attempt.longest_edge * edge_, most, context_); !status.ok())
      return failed(status.error().message());
    release_small_patches(piece.asset.mesh, edge_, piece.kept);
    release_acute(piece.asset.mesh, acute_reach * edge_, piece.kept);
    for (std::optional<Refinement> freed; (freed = border_freed(piece.asset.mesh, piece.kept));) {
      replace_mesh(piece, std::move(*freed));
      if (piece.kept.empty()) break;
    }
    return piece;
  }

  [[nodiscard]] Expected<ComponentResult> settle() {
    QuadMesh& found = best_->made.quads;
    Kept kept = measure_kept(best_->surface, best_->kept, found);
    if (mirrored_) result_.on_cut = on_cut(best_->surface, best_->mirror, found);
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
    result_.landed = std::move(best_->landed);
    result_.report.kept_as_quads = kept.as_quads;
    result_.report.rung = best_->made.rung;
    result_.report.singularities = best_->singularities;
    result_.report.strain = best_->strain;
    result_.report.curl = best_->curl;
    result_.field = std::move(best_->field);
    result_.map = std::move(best_->map);
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
    if (mirrored_) result_.on_cut = on_cut(mesh, original_.mirror, made->mesh);
    for (Index v = 0; v < made->mesh.vertex_count(); ++v) {
      SurfacePoint& s = made->mesh.source[at(v)];
      // A face of a half may be part of one of the asset's.
      s = mirrored_ ? point_in_face(shared_.asset.mesh, original_.parent[at(s.face)], position(mesh, s))
                    : SurfacePoint{original_.parent[at(s.face)], s.barycentric};
    }
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
  const MirrorPart* mirrored_;
  Context context_;
  ComponentResult result_;
  Piece original_;
  double area_ = 0, edge_ = 0;  // of the surface, and of a square quad
  std::optional<Piece> stand_in_;
  std::optional<FoundQuads> best_;
  bool best_unasked_ = false;  // with features that nobody asked for
};

QUADRIG_INLINE Expected<ComponentResult> remesh_component(const RemeshShared& shared, std::span<const Index> faces,
                                                          double quads, const Context& context,
                                                          const MirrorPart* mirrored) {
  return ComponentRemesher(shared, faces, quads, context, mirrored).run();
}

}  // namespace quadrig::detail
