#pragma once

#include "quadrig/field/surgery.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/map_stage.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/simplify.hpp"

namespace quadrig::detail {

/// Barycentric coordinates of a point in the plane of a face, clamped into it.
inline SurfacePoint point_in_face(const TriangleMesh<double>& mesh, Index face, const Vector3& p) {
  const Vector3 a = mesh.position(mesh.faces()(face, 0)), b = mesh.position(mesh.faces()(face, 1)),
                c = mesh.position(mesh.faces()(face, 2));
  const SurfaceHit hit = closest_on_triangle(p, a, b, c);
  return {face, hit.barycentric};
}

/// Which parameter is constant along the edges of the border and along kept edges that the field follows.
class Alignment {
 public:
  Alignment(const TriangleMesh<double>& mesh, const Connection<double>& connection, const CutGraph& cut,
            const FieldResult& field, const FrameField& frames, const EdgeMarks& kept)
      : mesh_(mesh), connection_(connection), cut_(cut), frames_(frames) {
    aligned.assign(at(mesh.halfedge_count()), Aligned::none);
    deviation_.assign(kept.empty() ? 0 : aligned.size(), 0.0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      double here = 0, there = 0;
      if (mesh.twin(h) == no_index) {
        aligned[at(h)] = label(h, here);
      } else if (!kept.empty() && kept[at(h)]) {
        const Aligned mine = label(h, here);
        (void)label(mesh.twin(h), there);
        if (here > 0.05 || there > 0.05) continue;
        aligned[at(h)] = mine;
        deviation_[at(h)] = std::max(here, there);
      }
    }
    for (Index v = 0; !kept.empty() && v < mesh.vertex_count(); ++v)
      while (open_sector(v, field.matching)) continue;
    any = std::any_of(aligned.begin(), aligned.end(), [](Aligned a) { return a != Aligned::none; });
  }

  std::vector<Aligned> aligned;  ///< a half-edge
  bool any = false;

 private:
  [[nodiscard]] Aligned label(Index h, double& deviation) const {
    const auto f = at(h / 3);
    const std::array<Complex, 4> d{frames_.u[f], frames_.v[f], -frames_.u[f], -frames_.v[f]};
    const auto turn = static_cast<std::size_t>(cut_.combing[f]);
    const Complex e = connection_.edge(h);
    const double along_u = std::abs((e * std::conj(d[turn])).real()) / std::abs(d[turn]);
    const double along_v = std::abs((e * std::conj(d[(turn + 1) % 4])).real()) / std::abs(d[(turn + 1) % 4]);
    deviation = std::acos(std::min(1.0, std::max(along_u, along_v)));
    return along_u >= along_v ? Aligned::v_constant : Aligned::u_constant;
  }

  /// Where the field does not turn from one aligned edge to the next around the vertex, no quad would be between them:
  /// that one is let go which it follows worse. Returns whether there was such a place.
  bool open_sector(Index v, const Matching& matching) {
    Index h = mesh_.outgoing(v);
    if (h == no_index) return false;
    const Index start = h;
    struct Spoke {
      Index halfedge;
      double angle;
    };
    std::vector<Spoke> spokes;
    double turned = 0;
    do {
      if (aligned[at(h)] != Aligned::none) spokes.push_back({h, turned});
      turned += mesh_.corner_angle(h) + matching.rho[at(mesh_.prev(h))];
      const Index in = mesh_.prev(h);
      h = mesh_.next_around(h);
      if (h == no_index) spokes.push_back({in, turned});  // the other end of the border
    } while (h != no_index && h != start);
    if (spokes.size() < 2) return false;
    if (h == start) spokes.push_back({spokes.front().halfedge, spokes.front().angle + turned});
    for (std::size_t k = 0; k + 1 < spokes.size(); ++k) {
      if (spokes[k + 1].angle - spokes[k].angle > 0.78539816339744831) continue;
      const Index a = spokes[k].halfedge, b = spokes[k + 1].halfedge;
      const auto inside = [&](Index e) { return mesh_.twin(e) != no_index; };
      if (!inside(a) && !inside(b)) return false;
      const Index less = !inside(b) || (inside(a) && deviation_[at(a)] >= deviation_[at(b)]) ? a : b;
      aligned[at(less)] = aligned[at(mesh_.twin(less))] = Aligned::none;
      return true;
    }
    return false;
  }

  const TriangleMesh<double>& mesh_;
  const Connection<double>& connection_;
  const CutGraph& cut_;
  const FrameField& frames_;
  std::vector<double> deviation_;
};

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

QUADRIG_INLINE Expected<ComponentResult> remesh_component(const RemeshShared& shared, std::span<const Index> faces,
                                                          double quads, const Context& outer) {
  const RemeshOptions& options = shared.options;
  Context context = outer;
  context.warnings.clear();
  if (context.cancelled()) return cancelled_error("remesh");
  ComponentResult result;
  result.report.faces = static_cast<Index>(faces.size());
  result.report.asked = quads;

  Piece original = make_piece(shared.asset, faces, context);
  if (context.cancelled()) return cancelled_error("remesh");
  const double area = original.asset.mesh.total_area();
  const double edge = std::sqrt(area / quads);
  original.kept = marks_of(shared.kept, faces);
  if (options.group_borders && original.asset.rig) keep_group_borders(original, 4 * edge);
  if (!original.kept.empty()) result.report.kept_length = EdgeCurves(original.asset.mesh, original.kept).length();
  const auto finish = [&](QuadMesh quad_mesh) {
    result.report.quads = quad_mesh.quad_count();
    result.report.irregular = quad_topology(quad_mesh.quads, quad_mesh.vertex_count()).irregular;
    result.mesh = std::move(quad_mesh);
    result.warnings = std::move(context.warnings);
  };

  struct Attempt {
    double smoothing;     // singularities closer than this many quads merge
    double longest_edge;  // of the triangles, in quad edges; 0: on a stand-in for the surface
    bool keeps = false;   // creases and features
  };
  // That many triangles a quad carry a map as well as any number; where quads are many, fewer do.
  const auto stand_in_faces = std::max<Index>(4000, static_cast<Index>(std::min(20 * quads, 40'000 + 4 * quads)));
  std::vector<Attempt> attempts{{0.5, 1.5}, {1, 1.0}, {1, 0}, {2, 0.7}, {4, 0}};
  bool noise = false;  // edges that no quad will ever see
  for (Index h = 0; h < original.asset.mesh.halfedge_count() && !noise; ++h)
    noise = original.asset.mesh.edge_vector(h).norm() < 1e-5 * edge;
  if (noise || original.asset.mesh.face_count() > std::max(20'000.0, 40 * quads))
    attempts.insert(attempts.begin(), Attempt{0.5, 0});
  if (!original.kept.empty()) {  // the first three with them, then all without
    std::vector<Attempt> keeping(attempts.begin(), attempts.begin() + 3);
    for (Attempt& attempt : keeping) attempt.keeps = true;
    attempts.insert(attempts.begin(), keeping.begin(), keeping.end());
  }
  const auto split = [&]() -> Expected<ComponentResult> {
    const TriangleMesh<double>& mesh = original.asset.mesh;
    SplitOptions split_options;
    split_options.quads = std::max<Index>(1, static_cast<Index>(std::lround(quads)));
    split_options.polish = options.polish;
    Expected<SplitQuads> made = split_quads(mesh, split_options, context);
    if (!made) return made.error();
    if (const Index beside = onto_surface(mesh, made->mesh); beside > 0)
      context.warn("remesh", count_of(beside, "quad corner") + " beside the surface: on it a quad would be inverted");
    for (SurfacePoint& s : made->mesh.source) s.face = original.parent[at(s.face)];
    result.report.rung = Rung::split;
    finish(std::move(made->mesh));
    return std::move(result);
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
  std::optional<Best> best;
  int poor = 0;  // attempts begun since
  const auto settle = [&]() -> Expected<ComponentResult> {
    QuadMesh& found = best->quads;
    Kept kept = measure_kept(best->surface, best->kept, found);
    for (Index v = 0; v < found.vertex_count(); ++v) {
      SurfacePoint& s = found.source[at(v)];
      s = point_in_face(shared.asset.mesh, best->parent[at(s.face)], position(best->surface, s));
      found.positions.row(v) = position(shared.asset.mesh, s).transpose();
    }
    if (!(least_jacobian(found) > 0)) {
      result.report.reasons.push_back("a quad is inverted where it lies on the surface's own triangles");
      return split();
    }
    result.held = std::move(kept.vertex);
    result.report.kept_as_quads = kept.as_quads;
    result.report.rung = best->rung;
    result.report.singularities = best->singularities;
    result.field = std::move(best->field);
    finish(std::move(found));
    return std::move(result);
  };
  WorkLeft left;
  // For the maps of all attempts, of which the first and a stand-in are never without: several times what a surface
  // takes whose first field can be mapped.
  const std::int64_t all_mapping =
      1'500'000 + 10 * std::int64_t{stand_in_faces} + 20 * std::int64_t{original.asset.mesh.face_count()};
  std::int64_t mapping = all_mapping;
  bool dear = false;  // the surface's own triangles took their share: those of a stand-in are left
  std::optional<Piece> stand_in;
  int flat = 0;  // valid maps whose quads would lie flat in space: another field seldom helps
  bool kept_last = false;
  static constexpr int max_operations = 3;
  for (const Attempt& attempt : attempts) {
    if (context.cancelled()) return cancelled_error("remesh");
    const bool anew = std::exchange(kept_last, attempt.keeps) && !attempt.keeps && !best;
    if (anew) {  // without what was to be kept, as if it had never been asked for
      left = {};
      mapping = all_mapping;
      dear = false;
      flat = 0;
    }
    const bool spent = flat > 3 || left.integers <= 0;
    if (spent && attempt.keeps) continue;
    if (spent || (best && ++poor > 1)) break;
    if (dear && attempt.longest_edge > 0) continue;
    const auto leave = [&](const std::string& reason) {
      result.report.reasons.push_back("smoothing over " + std::to_string(attempt.smoothing).substr(0, 3) +
                                      " quads: " + reason);
    };
    Piece piece;
    if (attempt.longest_edge == 0) {
      if (!stand_in) {
        Expected<Piece> made = stand_in_piece(original, stand_in_faces, context);
        if (!made) {
          leave("stand-in: " + made.error().message());
          continue;
        }
        stand_in = std::move(*made);
      }
      piece = *stand_in;
      if (!attempt.keeps) piece.kept.clear();
    } else {
      piece = original;
      if (!attempt.keeps) piece.kept.clear();
      // What is all needles has no end.
      const auto most = static_cast<Index>(20'000 + std::min({100 * quads, std::max(4e5, 20 * quads), 2e6}));
      if (Status status = refine_piece(piece, attempt.longest_edge * edge, most, context); !status.ok()) {
        leave(status.error().message());
        continue;
      }
      for (std::optional<Refinement> freed; (freed = border_freed(piece.asset.mesh, piece.kept));) {
        replace_mesh(piece, std::move(*freed));
        if (piece.kept.empty()) break;
      }
    }
    const TriangleMesh<double>& mesh = piece.asset.mesh;
    // Enough for every scaling of the first attempt's first field where none makes headway, else for one.
    const bool foremost = anew || &attempt == attempts.data();
    const std::int64_t least_share = (foremost ? 27 : 12) * std::int64_t{mesh.face_count()};
    if (!foremost && attempt.longest_edge > 0 && least_share > mapping) {
      leave("maps on so many triangles would take more work than is left");
      continue;
    }
    const std::int64_t share = std::max(mapping / 2, least_share);
    const TriangleMesh<double>& surface = piece.source.empty() ? mesh : original.asset.mesh;
    const std::vector<Index>& surface_parent = piece.source.empty() ? piece.parent : original.parent;
    std::optional<OntoSurface> projection;
    const EdgeMarks& surface_kept = piece.source.empty() || !attempt.keeps ? piece.kept : original.kept;
    if (!piece.source.empty()) projection.emplace(mesh, piece.source, piece.kept, surface, surface_kept);
    const auto onto = [&](const SurfacePoint& point) { return projection ? (*projection)(point) : point; };
    if (context.cancelled()) return cancelled_error("remesh");
    const Connection<double> connection(mesh);
    if (context.cancelled()) return cancelled_error("remesh");

    FieldOptions field_options;
    field_options.preset = options.preset;
    field_options.quad_edge = edge;
    field_options.merge_quads = attempt.smoothing;
    field_options.solver = options.solver.name;
    field_options.own_solver = options.solver.own_complex;
    field_options.own_real_solver = options.solver.own_real;
    field_options.bone_weight = options.directions.bones;
    field_options.curvature_weight = options.directions.curvature;
    field_options.bone_density = shared.sizing.density == DensitySource::field;
    field_options.crease_angle_radians = 3.14159265358979323846;
    for (Index h = 0; h < static_cast<Index>(piece.kept.size()); ++h)
      if (piece.kept[at(h)]) field_options.features.push_back(h);
    if (shared.metric && options.directions.posed > 0) {
      PolyVectorTargets targets = PolyVectorTargets::none(mesh.face_count());
      for (Index f = 0; f < mesh.face_count(); ++f) {
        const auto p = at(piece.parent[at(f)]);
        const Complex d =
            connection.to_complex(f, shared.connection.to_vector(piece.parent[at(f)], shared.metric->direction[p]));
        targets.x0[at(f)] = -integer_power(d / std::abs(d), 4);
        targets.weight[at(f)] = options.directions.posed * shared.metric->alignment[p];
      }
      field_options.targets = std::move(targets);
    }
    Expected<FieldResult> field = design_field(piece.asset, connection, field_options, context);
    if (!field) {
      if (field.error().code == ErrorCode::cancelled || field.error().code == ErrorCode::bad_option)
        return field.error();
      leave("field: " + field.error().message());
      continue;
    }
    if (context.cancelled()) return cancelled_error("remesh");
    result.seconds.field += field->report.seconds;
    result.backends.field = field->report.solve.backend;
    const SolverFactory<double> real_solver = options.solver.factory<double>();
    const std::vector<Index>& index = field->singularities.index4;
    FieldSurgery surgery(mesh, field->frames, field->matching, field->singularities, field->pull, edge, real_solver);
    std::vector<char> held(at(mesh.face_count()), 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (mesh.twin(h) == no_index || (!piece.kept.empty() && piece.kept[at(h)])) held[at(h / 3)] = 1;
    surgery.split_extremes(0.75 * edge, context);
    if (context.cancelled()) return cancelled_error("remesh");
    // Farther ones shape limbs, and go only where each singularity would have few quads to itself.
    surgery.cancel_pairs(0.75 * edge, 2 * edge, quads / 20);
    if (context.cancelled()) return cancelled_error("remesh");
    // Nobody asked for these directions: what does not even out sizes goes.
    const DirectionOptions& asked = options.directions;
    if (field->report.preset == FieldPreset::flat && !asked.bones && !asked.curvature && !(asked.posed > 0) &&
        piece.kept.empty() && shared.sizing.density == DensitySource::uniform)
      surgery.cancel_needless(std::min(4 * edge, 0.07 * std::sqrt(area)), context);
    if (context.cancelled()) return cancelled_error("remesh");

    left.mapping = share;
    // The map, and where it fails the field again with the pair of singularities next to the failure cancelled.
    std::size_t troubled = std::numeric_limits<std::size_t>::max();
    for (int operation = 0; operation <= max_operations; ++operation) {
      if (Status status = surgery.apply(held, context); !status.ok()) {
        leave("field: " + status.error().message());
        break;
      }
      if (!surgery.backend().empty()) result.backends.surgery = surgery.backend();
      Index extreme = 0, first = no_index;
      for (Index v = 0; v < mesh.vertex_count(); ++v)
        if (index[at(v)] > 1 || index[at(v)] < (mesh.on_boundary(v) ? -2 : -3)) {
          ++extreme;
          if (first == no_index) first = v;
        }
      if (extreme > 0) {
        leave("field: " + std::to_string(extreme) + (extreme == 1 ? " vertex" : " vertices") +
              " of too few or too many quads, one of " +
              std::to_string((mesh.on_boundary(first) ? 2 : 4) - index[at(first)]) +
              (mesh.on_boundary(first) ? " on the border" : ""));
        break;
      }
      const auto corners = std::count_if(index.begin(), index.end(), [](Index i) { return i != 0; });
      if (static_cast<double>(corners) > std::max(60.0, quads / 2)) {
        leave(std::to_string(corners) + " singularities and corners, too many for so few quads");
        break;
      }
      FrameField frames = field->frames;
      if (shared.sizes) {
        if (Status status = apply_sizes(mesh, connection, *shared.sizes, shared.connection, piece.parent, quads, area,
                                        field->matching, frames, context, real_solver);
            !status.ok()) {
          leave("sizes: " + status.error().message());
          break;
        }
      }
      if (context.cancelled()) return cancelled_error("remesh");
      std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
      for (std::size_t h = 0; h < rotation.size(); ++h)
        rotation[h] = static_cast<std::int8_t>(field->matching.r[h] & 3);
      const CutGraph cut = make_cut_graph(mesh, rotation, index, &context);
      if (context.cancelled()) return cancelled_error("remesh");
      const Alignment alignment(mesh, connection, cut, *field, frames, piece.kept);
      if (context.cancelled()) return cancelled_error("remesh");
      const TargetEdges target = target_edges(mesh, connection, cut, frames.u, frames.v);
      if (context.cancelled()) return cancelled_error("remesh");
      const MapInput input{mesh,    connection,   cut,  index, alignment.aligned, target, quads,
                           surface, surface_kept, onto, left};
      std::vector<Index> trouble;
      Expected<MapOutput> mapped =
          alignment.any ? MapStage<double>(input, options, result.seconds, result.backends).run(trouble, context)
                        : MapStage<Complex>(input, options, result.seconds, result.backends).run(trouble, context);
      if (context.cancelled()) return cancelled_error("remesh");
      if (mapped && attempt.keeps && mapped->quads.quad_count() > 1.5 * quads) {
        leave("creases and features need " + std::to_string(mapped->quads.quad_count()) + " quads");
        break;
      }
      if (mapped) {
        const bool good = mapped->least > fine_enough;
        if (!best || mapped->least > best->least) {
          best = Best{std::move(mapped->quads),
                      mapped->least,
                      projection ? original.asset.mesh : mesh,
                      surface_kept,
                      surface_parent,
                      mapped->rung,
                      field->singularities.plus + field->singularities.minus,
                      field->report};
        }
        for (const std::string& reason : mapped->reasons) leave(reason);
        if (good) return settle();
        leave("least scaled Jacobian " + std::to_string(mapped->least).substr(0, 4));
        break;
      }
      if (mapped.error().code == ErrorCode::cancelled) return mapped.error();
      leave(mapped.error().what);
      if (best) break;
      if (let_go(mesh, trouble, piece.kept)) continue;
      flat += trouble.empty();
      // Where many triangles are in trouble and fewer pairs do not help, no single pair will.
      const bool hopeless = trouble.size() > 300 || (trouble.size() > 30 && trouble.size() >= troubled);
      troubled = trouble.size();
      if (left.mapping <= 0) {
        leave("maps on these triangles have taken their share of the work");
        break;
      }
      if (trouble.empty() || hopeless || !surgery.cancel_near(trouble)) break;
      surgery.split_extremes(0.75 * edge, context);
    }
    mapping -= share - left.mapping;
    dear = dear || (left.mapping <= 0 && attempt.longest_edge > 0);
  }

  return best ? settle() : split();
}

}  // namespace quadrig::detail
