// Shells chosen, remeshed, and left where they cannot be.
#include "shells.hpp"

#include "quadrig/pipeline/piece.hpp"
#include "seams.hpp"

namespace quadrig::gltf {

std::vector<Shells> choose_shells(const std::vector<Gathered>& all, const GltfRemeshOptions& options) {
  std::vector<Shells> result;
  double whole = 0;
  for (const Gathered& one : all) {
    const TriangleMesh<double>& mesh = one.surface.asset.mesh;
    Shells shells;
    shells.components = face_components(mesh);
    shells.area.assign(at(shells.components.count), 0.0);
    const double scale = one.surface.world_scale * one.surface.world_scale;
    for (Index f = 0; f < mesh.face_count(); ++f)
      shells.area[at(shells.components.of_face[at(f)])] += scale * mesh.area(f);
    for (const double area : shells.area) whole += area;
    shells.kept.assign(shells.area.size(), 0);
    result.push_back(std::move(shells));
  }
  Shells* largest_of = nullptr;
  std::size_t largest = 0;
  bool any = false;
  for (Shells& shells : result)
    for (std::size_t c = 0; c < shells.area.size(); ++c) {
      shells.kept[c] = options.remesh.quads * shells.area[c] >= options.least_shell_quads * whole;
      any = any || shells.kept[c];
      if (!largest_of || shells.area[c] > largest_of->area[largest]) largest_of = &shells, largest = c;
    }
  if (!any && largest_of) largest_of->kept[largest] = 1;
  for (Shells& shells : result)
    for (std::size_t c = 0; c < shells.area.size(); ++c)
      if (shells.kept[c]) shells.kept_area += shells.area[c];
  return result;
}

Asset kept_part(const GltfSurface& surface, const Shells& shells, std::vector<Index>& source_face) {
  for (Index f = 0; f < surface.asset.mesh.face_count(); ++f)
    if (shells.kept[at(shells.components.of_face[at(f)])]) source_face.push_back(f);
  return quadrig::detail::make_piece(surface.asset, source_face).asset;
}

namespace {

/// An error of one part alone: the rest of the file can go on.
bool of_the_part(const Error& error) {
  return error.code == ErrorCode::stage_failed || error.code == ErrorCode::numeric ||
         error.code == ErrorCode::bad_input || error.code == ErrorCode::unsupported;
}

/// "skins[0] 'body', shell 3 (meshes[1], 120 triangles)"
std::string shell_label(const Gathered& gathered, const Shells& shells, std::size_t shell) {
  Index triangles = 0, first = no_index;
  for (std::size_t f = 0; f < shells.components.of_face.size(); ++f)
    if (at(shells.components.of_face[f]) == shell) {
      if (first == no_index) first = static_cast<Index>(f);
      ++triangles;
    }
  const Primitive& primitive = gathered.primitives[at(gathered.surface.source_primitive[at(first)])];
  return gathered.surface.label() + ", shell " + std::to_string(shell) + " (" + numbered("meshes", primitive.mesh) +
         ", " + std::to_string(triangles) + " triangles)";
}

}  // namespace

Status remesh_shells(const Gathered& gathered, Shells& shells, double quads, const GltfRemeshOptions& options,
                     GltfRemeshed& done, std::vector<Index>& source_face, Context& context) {
  const GltfSurface& surface = gathered.surface;
  RemeshOptions own = options.remesh;
  const auto tell = [&](const std::string& text) { context.warn("gltf", surface.label() + ": " + text); };
  if (!surface.asset.rig && own.preset == FieldPreset::thesis) {
    own.preset = FieldPreset::flat;
    tell("has no rig, which the thesis preset needs: made by the static one");
  }
  if (!surface.asset.rig && own.group_borders) {
    own.group_borders = false;
    tell("has no rig, so no borders of vertex groups are kept");
  }
  if (options.pose_source == GltfPoses::clips && surface.asset.rig) {
    own.poses = clip_poses(surface.asset.rig->clips, options.most_poses);
    if (own.poses.empty()) tell("has no clips: every joint is bent instead");
  }
  bool told = false;
  const auto count = [](double wanted) { return std::max<Index>(6, static_cast<Index>(std::lround(wanted))); };
  const auto attempt = [&](const Shells& of, double wanted, Context& with) -> Expected<RemeshResult> {
    source_face.clear();
    Asset part = kept_part(surface, of, source_face);
    own.quads = count(wanted);
    if (options.keep_materials || options.keep_textures) {
      const Regions regions(gathered, part.mesh, source_face);
      own.features.clear();
      for (Index h = 0; h < part.mesh.halfedge_count(); ++h)
        if (regions.parts_primitives(h) ? options.keep_materials : options.keep_textures && regions.is_seam(h))
          own.features.push_back(h);
      if (own.features.empty() && !std::exchange(told, true))
        tell("has no borders of materials or textures, so none are kept");
    }
    if (options.on_part) options.on_part(part, source_face, own);
    Expected<UnfittedQuads> made = remesh_unfitted(part, own, with);
    if (made && options.snap_seams) {
      const Stopwatch watch;
      Regions regions(gathered, part.mesh, source_face);
      const SeamFigures figures =
          snap_to_seams(part.mesh, regions, options.least_at_seams, made->on_features, made->mesh, with);
      done.seam_edges = figures.edges;
      done.snapped_edges = figures.on_seams;
      for (std::size_t v = 0; v < figures.placed.size(); ++v) made->held[v] = made->held[v] || figures.placed[v];
      made->report.seconds.polish += watch.seconds();
      made->report.seconds.total += watch.seconds();
    }
    Expected<RemeshResult> result =
        made ? fit_and_skin(part, own, std::move(*made), with) : Expected<RemeshResult>(made.error());
    done.remeshed = std::move(part.mesh);
    return result;
  };
  const auto give_up = [&](std::size_t shell, const Error& reason) {
    shells.kept[shell] = 0;
    done.failures.push_back({shell_label(gathered, shells, shell), reason});
  };
  const double whole = shells.kept_area;
  for (int round = 0; shells.keeps_any(); ++round) {
    Expected<RemeshResult> result = attempt(shells, quads * shells.kept_area / whole, context);
    if (result) {
      done.result = std::move(*result);
      return {};
    }
    Error error = result.error();
    if (!of_the_part(error) || options.prepare.strict) {
      error.where = surface.label() + (error.where.empty() ? "" : ", " + error.where);
      return error;
    }
    std::vector<std::size_t> kept;
    for (std::size_t c = 0; c < shells.kept.size(); ++c)
      if (shells.kept[c]) kept.push_back(c);
    // Which shell was it? Each is tried alone, once; those that succeed are made again together.
    bool found = false;
    for (const std::size_t c : kept) {
      if (kept.size() == 1 || round > 0) {
        give_up(c, error);
        found = true;
        continue;
      }
      Shells alone = shells;
      alone.kept.assign(shells.kept.size(), 0);
      alone.kept[c] = 1;
      Context quiet = context.quiet(context.threads);
      const Expected<RemeshResult> one = attempt(alone, quads * shells.area[c] / whole, quiet);
      if (one) continue;
      if (!of_the_part(one.error())) return one.error();
      give_up(c, one.error());
      found = true;
    }
    if (!found)
      for (const std::size_t c : kept) give_up(c, error);
    shells.kept_area = 0;
    for (std::size_t c = 0; c < shells.kept.size(); ++c)
      if (shells.kept[c]) shells.kept_area += shells.area[c];
  }
  source_face.clear();
  done.remeshed = {};
  return {};
}

}  // namespace quadrig::gltf
