// What a shell could become, and which of it lies nearest.
#include <algorithm>
#include <map>
#include <set>

#include "quadrig/disjoint_sets.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/quality/distance.hpp"
#include "quadrig/skinning.hpp"
#include "seams.hpp"
#include "shells.hpp"
#include "simplified.hpp"

namespace quadrig::gltf {
namespace {

/// An error of one part alone: the rest of the file can go on.
bool of_the_part(const Error& error) {
  return error.code == ErrorCode::stage_failed || error.code == ErrorCode::numeric ||
         error.code == ErrorCode::bad_input || error.code == ErrorCode::unsupported;
}

/// The poses and morph targets that change a shell most, and its places in each.
class ShellPoses {
  static constexpr std::size_t most_bones = 4, most_targets = 6;

 public:
  ShellPoses(const Gathered& gathered, const Shells& shells, const Shell& shell)
      : gathered_(gathered), shells_(shells) {
    const Asset& asset = gathered.surface.asset;
    std::vector<char> used(at(asset.mesh.vertex_count()), 0);
    for (const Index f : shell.faces)
      for (int i = 0; i < 3; ++i) {
        const Index v = asset.mesh.faces()(f, i);
        if (std::exchange(used[at(v)], char{1})) continue;
        vertices_.push_back(v);
        sources_.push_back(gathered.corner_vertex[at(3 * f + i)]);
      }
    if (asset.rig && shell.bends) choose_poses(*asset.rig);
    choose_targets();
    points_.weight.assign(1, 1.0);
    points_.bends = poses_.size();
    points_.weight.insert(points_.weight.end(), poses_.size(),
                          1.0 / static_cast<double>(std::max<std::size_t>(1, poses_.size())));
    points_.weight.insert(points_.weight.end(), targets_.size(),
                          1.0 / static_cast<double>(std::max<std::size_t>(1, targets_.size())));
    points_.places.assign(points_.weight.size(), asset.mesh.positions());
    for (std::size_t k = 0; k < poses_.size(); ++k)
      for (const Index v : vertices_)
        points_.places[1 + k].row(v) = posed(asset.mesh.position(v), asset.rig->weights, v, k);
    for (std::size_t k = 0; k < targets_.size(); ++k)
      for (std::size_t i = 0; i < vertices_.size(); ++i)
        points_.places[1 + poses_.size() + k].row(vertices_[i]) +=
            gathered.values.row(sources_[i]).segment<3>(targets_[k]);
  }

  [[nodiscard]] const PosedPoints& points() const { return points_; }

  /// Places of a field's quads in the same poses.
  [[nodiscard]] std::vector<Points<double>> of(const FieldQuads& field) const {
    const QuadMesh& quads = field.result.mesh;
    std::vector<Points<double>> places(points_.weight.size(), quads.positions);
    for (std::size_t k = 0; k < poses_.size(); ++k)
      for (Index v = 0; v < quads.vertex_count(); ++v)
        places[1 + k].row(v) = posed(quads.positions.row(v).transpose(), *field.result.weights, v, k);
    for (std::size_t k = 0; k < targets_.size(); ++k)
      for (Index v = 0; v < quads.vertex_count(); ++v) {
        const SurfacePoint& point = quads.source[at(v)];
        for (int i = 0; i < 3; ++i)
          places[1 + poses_.size() + k].row(v) +=
              point.barycentric[i] *
              gathered_.values.row(gathered_.corner_vertex[at(3 * field.faces[at(point.face)] + i)])
                  .segment<3>(targets_[k]);
      }
    return places;
  }

 private:
  /// Of the bones that share the shell's vertices most with others, one pose each.
  void choose_poses(const Rig& rig) {
    std::vector<double> shared(at(rig.skeleton.bone_count()), 0.0);
    for (const Index v : vertices_)
      for (SkinWeights::InnerIterator it(rig.weights, v); it; ++it)
        shared[at(static_cast<Index>(it.col()))] += it.value() * (1 - it.value());
    std::vector<Index> order;
    for (std::size_t b = 0; b < shared.size(); ++b)
      if (shared[b] > 1e-6) order.push_back(static_cast<Index>(b));
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return shared[at(a)] > shared[at(b)]; });
    if (order.size() > most_bones) order.resize(most_bones);
    const std::size_t bones = shared.size();
    if (shells_.poses.size() == 4 * bones) {
      for (std::size_t k = 0; k < order.size(); ++k) poses_.push_back(&shells_.poses[4 * at(order[k]) + k % 4]);
    } else {
      const std::size_t count = std::min(most_bones, shells_.poses.size());
      for (std::size_t k = 0; k < count; ++k) poses_.push_back(&shells_.poses[k * shells_.poses.size() / count]);
    }
  }

  void choose_targets() {
    std::vector<std::pair<double, Eigen::Index>> moved;
    for (const Attribute& a : gathered_.attributes) {
      if (a.target == Attribute::no_target || a.name != "POSITION") continue;
      double sum = 0;
      for (const Index source : sources_) sum += gathered_.values.row(source).segment<3>(a.first).squaredNorm();
      if (sum > 0) moved.emplace_back(-sum, a.first);
    }
    std::sort(moved.begin(), moved.end());
    if (moved.size() > most_targets) moved.resize(most_targets);
    for (const auto& [sum, first] : moved) targets_.push_back(first);
  }

  [[nodiscard]] Eigen::RowVector3d posed(const Vector3& p, const SkinWeights& weights, Index row, std::size_t k) const {
    Vector3 sum = Vector3::Zero();
    double total = 0;
    for (SkinWeights::InnerIterator it(weights, row); it; ++it) {
      sum += it.value() * ((*poses_[k])[at(static_cast<Index>(it.col()))] * p);
      total += it.value();
    }
    return (total > 0 ? sum : p).transpose();
  }

  const Gathered& gathered_;
  const Shells& shells_;
  std::vector<Index> vertices_, sources_;  // of the shell; a gathered one of each
  std::vector<const Pose*> poses_;
  std::vector<Eigen::Index> targets_;  // first columns
  PosedPoints points_;
};

/// Options of the field that go for this surface.
RemeshOptions field_options(const Gathered& gathered, const Shells& shells, const GltfRemeshOptions& options) {
  RemeshOptions own = options.remesh;
  const bool rigged = gathered.surface.asset.rig.has_value();
  if (!rigged && own.preset == FieldPreset::thesis) own.preset = FieldPreset::flat;
  if (!rigged) own.group_borders = false;
  // Normals that part tell which edges are sharp.
  if (!own.crease_angle_radians) own.crease_angle_radians = std::numbers::pi;
  if (options.pose_source == GltfPoses::clips && rigged && !gathered.surface.asset.rig->clips.empty())
    own.poses = shells.poses;
  if (options.clip_directions && rigged)
    own.directions.bone_poses = clip_poses(gathered.surface.asset.rig->clips, options.most_poses);
  own.symmetry = shells.mirror ? mirror_choice(options.remesh, rigged) : SymmetryChoice::none;
  own.mirror_plane = shells.mirror;
  return own;
}

/// Takes out edges that hang together with others to less than a length.
void drop_short(const TriangleMesh<double>& mesh, std::vector<Index>& edges, double least_length) {
  DisjointSets sets(at(mesh.vertex_count()));
  for (const Index h : edges) sets.join(mesh.origin(h), mesh.target(h));
  std::map<Index, double> length;
  for (const Index h : edges) length[sets.find(mesh.origin(h))] += mesh.edge_vector(h).norm();
  std::erase_if(edges, [&](Index h) { return length[sets.find(mesh.origin(h))] < least_length; });
}

Index material_of(const Gathered& gathered, Index primitive) {
  const std::optional<std::size_t>& material = gathered.primitives[at(primitive)].material;
  return material ? static_cast<Index>(*material) : no_index;
}

/// Half-edges of a part that are to be edges of quads: where primitives meet or normals part, and what was asked for.
std::vector<Index> lines_of(const Gathered& gathered, const Shells& shells, const TriangleMesh<double>& part,
                            const std::vector<Index>& faces, const GltfRemeshOptions& options, bool sharp,
                            double quads) {
  const Regions regions(gathered, part, faces);
  const bool flat = shells.wedges->flat(shells.components.of_face[at(faces.front())]);
  // Of the length of all edges of `quads` quads, at most these shares may be bound to lines that were not asked for.
  constexpr double borders_worth = 0.2, sharp_worth = 0.1;
  constexpr double worth_edges = 3;  // edges that hang together are worth a line from so many edges of quads on
  const auto material = [&](Index h) {
    return material_of(gathered, gathered.surface.source_primitive[at(faces[at(h / 3)])]);
  };
  std::vector<Index> lines, borders, bends;
  double border_length = 0, bend_length = 0;
  for (Index h = 0; h < part.halfedge_count(); ++h) {
    const Index across = part.twin(h);
    if (across == no_index || h > across) continue;
    const bool primitives = regions.parts_primitives(h), seam = regions.is_seam(h);
    const double length = part.edge_vector(h).norm();
    if (primitives ? options.keep_materials : options.keep_textures && seam) {
      lines.push_back(h);
    } else if (primitives && material(h) != material(across)) {  // one that is not seen needs no line
      borders.push_back(h);
      border_length += length;
    } else if (!flat && shells.wedges->is_hard(3 * faces[at(h / 3)] + h % 3)) {
      bends.push_back(h);
    }
  }
  const double all = 2 * std::sqrt(quads * part.total_area());
  if (2 * quads > part.face_count()) bends.clear();  // made denser, it has mostly edges of that kind
  drop_short(part, bends, worth_edges * std::sqrt(part.total_area() / quads));
  for (const Index h : bends) bend_length += part.edge_vector(h).norm();
  if (sharp && border_length <= borders_worth * all) lines.insert(lines.end(), borders.begin(), borders.end());
  if (sharp && bend_length <= sharp_worth * all) lines.insert(lines.end(), bends.begin(), bends.end());
  std::sort(lines.begin(), lines.end());
  return lines;
}

/// Islands of a material that are smaller than a few quads ask for more of them there. \param factors one a face, or
/// empty: all 1
void densify_islands(const Gathered& gathered, const TriangleMesh<double>& part, const std::vector<Index>& faces,
                     double quads, std::vector<double>& factors) {
  constexpr double few = 4, most = 16;
  const auto material = [&](Index f) {
    return material_of(gathered, gathered.surface.source_primitive[at(faces[at(f)])]);
  };
  DisjointSets islands(at(part.face_count()));
  bool several = false;
  for (Index h = 0; h < part.halfedge_count(); ++h) {
    if (part.twin(h) == no_index) continue;
    const Index f = h / 3, g = part.twin(h) / 3;
    if (material(f) == material(g))
      islands.join(f, g);
    else
      several = true;
  }
  if (!several) return;
  std::vector<double> area(at(part.face_count()), 0.0);
  for (Index f = 0; f < part.face_count(); ++f) area[at(islands.find(f))] += part.area(f);
  const double wanted = few * part.total_area() / quads;
  if (factors.empty()) factors.assign(area.size(), 1.0);
  for (Index f = 0; f < part.face_count(); ++f)
    if (const double here = area[at(islands.find(f))]; here > 0 && here < wanted)
      factors[at(f)] = std::min(factors[at(f)] * std::min(wanted / here, most), largest_density_factor);
}

/// \param sharp borders of primitives and edges where normals part are lines of quads
Expected<FieldQuads> make_field(const Gathered& gathered, const Shells& shells, const Shell& shell, bool sharp,
                                const GltfRemeshOptions& options, Context& context) {
  FieldQuads made;
  made.faces = shell.faces;
  const Asset part = quadrig::detail::make_piece(gathered.surface.asset, made.faces).asset;
  RemeshOptions own = field_options(gathered, shells, options);
  own.quads = std::max<Index>(6, static_cast<Index>(std::lround(shell.due / 2)));
  own.features = lines_of(gathered, shells, part.mesh, made.faces, options, sharp, own.quads);
  own.morphs = morphs_of(gathered, part.mesh, made.faces);
  if (!shells.density.empty() && own.preset != FieldPreset::thesis)
    for (const Index f : made.faces) own.density_factors.push_back(shells.density[at(f)]);
  if (own.preset != FieldPreset::thesis)
    densify_islands(gathered, part.mesh, made.faces, own.quads, own.density_factors);
  if (options.on_part) options.on_part(part, made.faces, own);
  Expected<UnfittedQuads> unfitted = remesh_unfitted(part, own, context);
  if (!unfitted) return unfitted.error();
  Regions regions(gathered, part.mesh, made.faces);
  std::set<Index> primitives;
  for (const Index f : made.faces) primitives.insert(gathered.surface.source_primitive[at(f)]);
  if (primitives.size() > 1) regions.claim_for_islands(unfitted->mesh);
  if (options.snap_seams) {
    const Stopwatch watch;
    const SeamFigures figures =
        snap_to_seams(part.mesh, regions, options.least_at_seams, unfitted->on_features, unfitted->mesh, context);
    made.seam_edges = figures.edges;
    made.snapped_edges = figures.on_seams;
    const bool leaves_surface = own.fit.method == FitMethod::surface || own.fit.method == FitMethod::subdivision;
    if (leaves_surface && figures.on_seams > 0) {  // what lies on a seam is fitted to it
      unfitted->kept.resize(at(part.mesh.halfedge_count()), 0);
      for (Index h = 0; h < part.mesh.halfedge_count(); ++h)
        if (regions.is_seam(h)) unfitted->kept[at(h)] = 1;
    } else {
      for (std::size_t v = 0; v < figures.placed.size(); ++v)
        unfitted->held[v] = unfitted->held[v] || figures.placed[v];
    }
    unfitted->report.seconds.polish += watch.seconds();
    unfitted->report.seconds.total += watch.seconds();
  }
  Expected<RemeshResult> result = fit_and_skin(part, own, std::move(*unfitted), context);
  if (!result) return result.error();
  made.result = std::move(*result);
  count_rings(made.result.mesh, made.result.report.rims);
  // Shells have figures and warnings of their own.
  std::erase_if(made.result.report.warnings,
                [](const Warning& warning) { return warning.stage == "coverage" || warning.stage == "count"; });
  // No primitive may vanish.
  if (primitives.size() > 1) {
    regions.claim_for_islands(made.result.mesh);
    for (Index q = 0; q < made.result.mesh.quad_count(); ++q)
      primitives.erase(made.primitive.emplace_back(regions.of_quad(made.result.mesh, q).primitive));
    if (!primitives.empty()) {
      const Primitive& first = gathered.primitives[at(*primitives.begin())];
      return Error{ErrorCode::stage_failed,
                   numbered("meshes", first.mesh) + "." + numbered("primitives", first.number) +
                       " has no quad of its own: there are fewer quads than primitives",
                   gathered.surface.label(), "ask for more quads"};
    }
  }
  made.claims = regions.claims();
  return made;
}

/// Whether none of the primitives is lost, and the triangles are those of a surface: no side is twice there.
bool stand_for(std::span<const Polygon> few, std::span<const Polygon> all) {
  std::set<Index> primitives;
  std::set<std::pair<Index, Index>> sides;
  for (const Polygon& p : all) primitives.insert(p.primitive);
  for (const Polygon& p : few) {
    primitives.erase(p.primitive);
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = p.vertex[i], b = p.vertex[(i + 1) % 3];
      if (a == b || !sides.emplace(a, b).second) return false;
    }
  }
  return primitives.empty() && !few.empty();
}

/// Of each of the polygons' triangles.
std::vector<Index> materials_of(const Gathered& gathered, std::span<const Polygon> polygons) {
  std::vector<Index> materials;
  for (const Polygon& p : polygons) materials.insert(materials.end(), p.size() - 2, material_of(gathered, p.primitive));
  return materials;
}
/// Of each of the quads' triangles.
std::vector<Index> materials_of(const Gathered& gathered, const FieldQuads& field) {
  std::vector<Index> materials;
  for (const Index p : field.primitive) materials.insert(materials.end(), 2, material_of(gathered, p));
  if (field.primitive.empty()) materials.assign(at(2 * field.result.mesh.quad_count()), no_index);
  return materials;
}

/// The quads among polygons, over all vertices of the surface.
QuadMesh quads_of(const TriangleMesh<double>& mesh, const std::vector<Polygon>& polygons) {
  QuadMesh quads;
  quads.positions = mesh.positions();
  quads.quads.resize(std::ranges::count(polygons, std::size_t{4}, &Polygon::size), 4);
  Eigen::Index row = 0;
  for (const Polygon& p : polygons)
    if (p.size() == 4) quads.quads.row(row++) << p.vertex[0], p.vertex[1], p.vertex[2], p.vertex[3];
  return quads;
}

}  // namespace

Status make_shell(const Gathered& gathered, const Shells& shells, Shell& shell, const GltfRemeshOptions& options,
                  Context& context) {
  // Of candidates that are as near as each other the first is taken; simplified triangles must be nearer by this.
  constexpr double simplified_must_gain = 0.9;
  constexpr double most_rows_gone = 5;  // times as many triangles, and rows are no match for a field
  // A modelled surface: most of its triangles are halves of quads, most vertices inside have four edges.
  constexpr double modelled_quads = 0.85, modelled_irregular = 0.4;
  const TriangleMesh<double>& mesh = gathered.surface.asset.mesh;
  const bool competition = options.topology == GltfTopology::best;
  const std::vector<Polygon> triangles = triangles_of(gathered, *shells.wedges, shell.faces);
  std::vector<Index> order;
  for (const Index f : shell.faces) order.push_back(gathered.surface.source_triangle[at(f)]);
  shell.make = GltfMake::kept;
  const bool field = wants_field(shell, options);
  const SpanTimer span(context, "shell", std::to_string(shell.own()) + " triangles, due " + std::to_string(shell.due));
  if (competition || !field) shell.polygons = competition ? paired(mesh.positions(), triangles, order) : triangles;
  if (!field && (!competition || due_its_own(shell))) return {};

  const ShellPoses poses(gathered, shells, shell);
  Measure measure(as_triangles(triangles), poses.points(), materials_of(gathered, triangles));
  const auto wanted = static_cast<Index>(std::lround(shell.due));
  double best = std::numeric_limits<double>::infinity();
  const auto tell = [&](std::string_view name, Index count, const Apart& apart) {
    if (!context.on_log) return;
    context.log(shell_label(gathered, shells, shell) + ", due " + std::to_string(wanted) + ": " + std::string(name) +
                " " + std::to_string(count) + " triangles, rms " +
                std::to_string(1e4 * apart.rms / measure.diagonal()) + "e-4 of its diagonal, with colours " +
                std::to_string(1e4 * apart.seen / measure.diagonal()) + "e-4");
  };
  if (field) {
    Expected<FieldQuads> made = make_field(gathered, shells, shell, competition, options, context);
    if (!made && competition && of_the_part(made.error()))
      made = make_field(gathered, shells, shell, false, options, context);
    if (made) {
      const SpanTimer measuring(context, "measure");
      shell.apart =
          measure.apart(fan_triangles(to_polygons(made->result.mesh)), poses.of(*made), materials_of(gathered, *made));
      best = shell.apart.seen;
      tell("field", 2 * made->result.mesh.quad_count(), shell.apart);
      shell.field = std::move(*made);
      shell.make = GltfMake::field;
    } else if (!of_the_part(made.error()) || options.prepare.strict) {
      Error error = made.error();
      error.where = gathered.surface.label() + (error.where.empty() ? "" : ", " + error.where);
      return error;
    } else {
      shell.failure = made.error();
    }
  }
  if (!competition || shell.due > shell.own()) {
    if (shell.field)
      shell.polygons.clear();
    else if (!competition)
      shell.polygons = triangles;
    return {};
  }
  const std::vector<Polygon> own = std::move(shell.polygons);
  shell.polygons = own;
  Index quads = 0, irregular = 0;
  for (const Polygon& p : own) quads += p.size() == 4;
  const double share = irregular_share(own, irregular);
  const bool modelled = 2 * quads >= modelled_quads * shell.own() && share <= modelled_irregular;
  // Quads that are split from simplified triangles follow no field either, and those that lose a part are none to ship.
  constexpr double lost_edges = 2;
  const double edge = std::sqrt(2 * shell.area(mesh) / shell.due);
  const bool no_field =
      !shell.field || shell.apart.largest_unbent > lost_edges * edge ||
      std::ranges::any_of(shell.field->result.report.components, [](const auto& c) { return c.rung == Rung::split; });
  // No topology to keep, or no room for one.
  const bool free = !shell.bends || no_field || shell.due < 2 * options.least_bending_quads;
  // Rings round eyes and mouth are what rows that go would cut.
  std::vector<RimReport> rims = shell.field ? shell.field->result.report.rims : std::vector<RimReport>{};
  std::erase_if(rims, [](const RimReport& rim) { return rim.wanted == 0 || rim.loops < rim.wanted; });
  const auto cuts_rings = [&](const std::vector<Polygon>& made) {
    if (rims.empty()) return false;
    count_rings(quads_of(mesh, made), rims);
    return std::ranges::any_of(rims, [](const RimReport& rim) { return rim.loops < rim.wanted; });
  };
  const auto compete = [&](std::vector<Polygon> made, GltfMake make, double handicap) {
    if (triangle_count(made) > std::max(1.05 * shell.due, shell.due + 2) && std::isfinite(best)) return;
    const Apart apart = measure.apart(as_triangles(made), poses.points().places, materials_of(gathered, made));
    tell(gltf_make_name(make), triangle_count(made), apart);
    if (!(apart.seen < handicap * best) || cuts_rings(made)) return;
    if (shell.field && !no_field && apart.largest_unbent > lost_edges * edge) return;
    best = apart.seen;
    shell.apart = apart;
    shell.polygons = std::move(made);
    shell.make = make;
    shell.field.reset();
  };
  // Of rows that went four times out of five no more is left than a field has.
  const bool few_go = shell.due * most_rows_gone > shell.own();
  if ((modelled && (few_go || no_field)) || free) {
    const SpanTimer rows(context, "rows");
    compete(coarsened(own, *shells.wedges, poses.points(), {wanted, true, 0.5}, {}, context), GltfMake::rows, 1);
  }
  // Where neither holds the shape, loops are worth less than it.
  constexpr double unlike_edges = 0.2, unlike_must_gain = 1.0 / 3;
  const bool unlike = best > unlike_edges * edge;
  if (free || unlike) {
    const SpanTimer span_of_these(context, "simplified");
    const double handicap = free ? simplified_must_gain : unlike_must_gain;
    std::vector<Polygon> few = coarsened(triangles, *shells.wedges, poses.points(), {wanted, false, 0}, {}, context);
    compete(paired(mesh.positions(), std::move(few), {}), GltfMake::simplified, handicap);
    // The best of two is left; against each other they have none.
    few = simplified(triangles, mesh.positions(), wanted);
    if (stand_for(few, triangles))
      compete(paired(mesh.positions(), std::move(few), {}), GltfMake::simplified,
              shell.make == GltfMake::simplified ? 1 : handicap);
  }
  if (shell.field) shell.polygons.clear();
  if (context.cancelled()) return cancelled_error("gltf");
  if (shell.make != GltfMake::kept) shell.failure.reset();
  return {};
}

}  // namespace quadrig::gltf
