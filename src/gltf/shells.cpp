// Shells, what they demand, and their shares.
#include "shells.hpp"

#include <algorithm>
#include <numeric>

#include "quadrig/constraints/posed_metric.hpp"
#include "quadrig/dominance.hpp"
#include "quadrig/pipeline/halves.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig::gltf {
namespace {

/// Fewer triangles close no shell that is worth looking at.
constexpr double least_triangles = 4;
/// From this many times its own triangles on, a file is made denser than it is.
constexpr double denser = 1.25;

/// At most `most` of the poses, evenly spread.
template <class T>
std::vector<T> some_of(std::vector<T> poses, std::size_t most) {
  if (poses.size() <= most) return poses;
  std::vector<T> some;
  for (std::size_t k = 0; k < most; ++k) some.push_back(std::move(poses[k * poses.size() / most]));
  return some;
}

}  // namespace

std::vector<Points<double>> morphs_of(const Gathered& gathered, const TriangleMesh<double>& part,
                                      std::span<const Index> faces) {
  std::vector<Points<double>> morphs;
  for (const Attribute& attribute : gathered.attributes) {
    if (attribute.target == Attribute::no_target || attribute.name != "POSITION") continue;
    Points<double>& morph = morphs.emplace_back(Points<double>::Zero(part.vertex_count(), 3));
    for (Index h = 0; h < part.halfedge_count(); ++h) {
      const Index vertex = gathered.corner_vertex[at(3 * faces[at(h / 3)] + h % 3)];
      morph.row(part.origin(h)) = gathered.values.row(vertex).segment<3>(attribute.first);
    }
  }
  return morphs;
}

Expected<Shells> find_shells(const Gathered& gathered, const GltfRemeshOptions& options, Context& context) {
  const Asset& asset = gathered.surface.asset;
  const TriangleMesh<double>& mesh = asset.mesh;
  Shells shells;
  shells.components = face_components(mesh);
  shells.wedges.emplace(gathered, shells.components);
  shells.list.resize(at(shells.components.count));
  for (Index f = 0; f < mesh.face_count(); ++f) shells.list[at(shells.components.of_face[at(f)])].faces.push_back(f);

  const SymmetryChoice symmetry = mirror_choice(options.remesh, asset.rig.has_value());
  if (symmetry != SymmetryChoice::none && options.remesh.mirror_plane) {
    shells.mirror = options.remesh.mirror_plane;
  } else if (symmetry != SymmetryChoice::none) {
    Expected<std::optional<MirrorPlane>> found = find_mirror_plane(asset, symmetry, context);
    if (!found) return found.error();
    shells.mirror = std::move(*found);
  }

  shells.density = density_factors(gathered, shells.mirror, options);
  const Connection<double> connection(mesh, &context);
  constexpr std::size_t most_posed = 12;
  std::vector<Index> all(at(mesh.face_count()));
  std::iota(all.begin(), all.end(), Index{0});
  const std::vector<Points<double>> morphs = some_of(morphs_of(gathered, mesh, all), most_posed);
  PosedForms::Options form_options;
  form_options.morphs = morphs;
  std::vector<Pose> few;
  std::vector<double> omega1;
  if (asset.rig) {
    if (options.pose_source == GltfPoses::clips) shells.poses = clip_poses(asset.rig->clips, options.most_poses);
    if (shells.poses.empty()) {
      const SurfaceBends bends = surface_bends(asset.rig->skeleton, asset.rig->weights, options.remesh.bend_degrees);
      for (const Pose& some : some_of(bends.poses, static_cast<std::size_t>(options.most_poses))) {
        Pose& pose = shells.poses.emplace_back(rest_pose(asset.rig->skeleton));
        for (std::size_t c = 0; c < bends.bones.size(); ++c) pose[at(bends.bones[c])] = some[c];
      }
    }
    few = some_of(shells.poses, most_posed);
  }
  const Expected<PosedForms> forms =
      PosedForms::create(mesh, connection, asset.rig ? asset.rig->weights : SkinWeights{}, few, form_options, context);
  if (!forms) return forms.error();
  Expected<PosedMetric> metric = posed_metric(mesh, *forms, omega1, {}, context);
  if (!metric) return metric.error();
  const double scale = gathered.surface.world_scale;
  for (Shell& shell : shells.list) {
    for (const Index f : shell.faces)
      shell.demand +=
          mesh.area(f) * elementary::cbrt(metric->error[at(f)]) * (shells.density.empty() ? 1 : shells.density[at(f)]);
    shell.demand *= elementary::pow(scale, 4.0 / 3);
    if (asset.rig) {
      Index first = no_index;
      for (const Index f : shell.faces)
        for (int i = 0; i < 3 && !shell.bends; ++i)
          for (SkinWeights::InnerIterator it(asset.rig->weights, mesh.faces()(f, i)); it; ++it) {
            if (it.value() < 0.02) continue;
            if (first == no_index) first = static_cast<Index>(it.col());
            shell.bends = shell.bends || first != it.col();
          }
    }
  }
  return shells;
}

void share_out(std::vector<Shells>& all, double triangles, const GltfRemeshOptions& options) {
  std::vector<Shell*> list;
  double own = 0, demand = 0;
  for (Shells& shells : all)
    for (Shell& shell : shells.list) {
      list.push_back(&shell);
      own += shell.own();
      demand += shell.demand;
    }
  const bool more = triangles > denser * own;
  const auto due = [&](const Shell& shell, double lambda) {
    const double wanted = lambda * shell.demand, least = std::min<double>(shell.own(), least_triangles);
    if (options.topology == GltfTopology::field)
      return wanted >= 2 * options.least_shell_quads ? wanted : static_cast<double>(shell.own());
    // Where all can have more, those that are due enough for a field do.
    if (more && wanted >= 2 * options.least_field_quads) return wanted;
    return std::clamp<double>(wanted, least, shell.own());
  };
  const auto sum = [&](double lambda) {
    double total = 0;
    for (const Shell* shell : list) total += due(*shell, lambda);
    return total;
  };
  double low = 0, high = demand > 0 ? triangles / demand : 1;
  for (int k = 0; k < 60 && sum(high) < triangles; ++k) high *= 2;
  // Shells too small for a field keep all that they have: the sum falls where one of them gets its first quads, and
  // rises in between. Of the rises the last is taken that begins below what there is, or else the one that begins
  // lowest.
  if (options.topology == GltfTopology::field) {
    std::vector<double> begins;
    for (const Shell* shell : list)
      if (shell->demand > 0) begins.push_back((1 + 1e-9) * 2 * options.least_shell_quads / shell->demand);
    std::sort(begins.begin(), begins.end(), std::greater<>());
    double lowest = std::numeric_limits<double>::infinity(), end = std::max(high, begins.empty() ? 0 : begins.front());
    for (const double begin : begins) {
      if (const double total = sum(begin); total < lowest) {
        lowest = total;
        low = begin;
        high = total < triangles ? std::max(begin, end) : begin;
      }
      if (lowest < triangles) break;
      end = begin * (1 - 1e-9);
    }
  }
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (sum(middle) < triangles ? low : high) = middle;
  }
  for (Shell* shell : list) shell->due = due(*shell, high);
  // Where none is due enough, the largest gets what the others leave.
  if ((more || options.topology == GltfTopology::field) && demand > 0 &&
      std::ranges::none_of(list, [&](const Shell* shell) { return wants_field(*shell, options); })) {
    Shell* largest = *std::ranges::max_element(list, {}, [](const Shell* shell) { return shell->demand; });
    double others = 0;
    for (const Shell* shell : list) others += shell == largest ? 0 : shell->due;
    largest->due = std::max(triangles - others, 2 * options.remesh.quads * largest->demand / demand);
    largest->alone = true;
  }
}

void join_twins(const Gathered& gathered, Shells& shells, const GltfRemeshOptions& options, const Context& context) {
  if (!shells.mirror || shells.list.size() < 2) return;
  std::vector<std::vector<Index>> faces;
  for (const Shell& shell : shells.list) faces.push_back(shell.faces);
  const Asset& asset = gathered.surface.asset;
  const quadrig::detail::MirrorMap map(asset, *shells.mirror);
  const auto roles = quadrig::detail::mirror_roles(asset, faces, map, context);
  std::vector<char> joined(shells.list.size(), 0);
  for (std::size_t c = 0; c < roles.size(); ++c) {
    if (roles[c].role != quadrig::detail::MirrorRole::first) continue;
    Shell &first = shells.list[c], &second = shells.list[at(roles[c].other)];
    if (!wants_field(first, options) || !wants_field(second, options)) continue;
    first.faces.insert(first.faces.end(), second.faces.begin(), second.faces.end());
    std::sort(first.faces.begin(), first.faces.end());
    first.demand += second.demand;
    first.due += second.due;
    first.bends = first.bends || second.bends;
    joined[at(roles[c].other)] = 1;
  }
  std::size_t kept = 0;
  for (std::size_t c = 0; c < joined.size(); ++c)
    if (!joined[c] && kept++ != c) shells.list[kept - 1] = std::move(shells.list[c]);
  shells.list.resize(kept);
}

bool wants_field(const Shell& shell, const GltfRemeshOptions& options) {
  if (shell.alone) return true;
  if (options.topology == GltfTopology::field) return shell.due >= 2 * options.least_shell_quads;
  return shell.due > shell.own() || (!due_its_own(shell) && shell.due >= 2 * options.least_field_quads);
}

bool due_its_own(const Shell& shell) {
  constexpr double nearly = 0.97;  // a few triangles fewer are not worth another surface
  return shell.due > std::min(nearly * shell.own(), shell.own() - 0.5);
}

std::string shell_label(const Gathered& gathered, const Shells& shells, const Shell& shell) {
  const auto number = shells.components.of_face[at(shell.faces.front())];
  const Primitive& primitive = gathered.primitives[at(gathered.surface.source_primitive[at(shell.faces.front())])];
  return gathered.surface.label() + ", shell " + std::to_string(number) + " (" + numbered("meshes", primitive.mesh) +
         ", " + std::to_string(shell.faces.size()) + " triangles)";
}

}  // namespace quadrig::gltf
