// The question the project stands on: which directions and densities bend best? Remeshes assets by every variant at
// equal counts and prints the deformation errors of the quads, over poses that the metric was built from and poses
// that it was not, as a Markdown table.
//
//   bending_study [--quads 500,2000,8000] NAME [MESH RIG WEIGHTS] ...      a sample's name alone needs no files
#include <charconv>
#include <cstdio>
#include <numeric>

#include "quadrig/io.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/quality.hpp"
#include "quadrig/samples.hpp"

namespace {

using namespace quadrig;

struct Variant {
  const char* name;
  RemeshOptions options;
};

SizingOptions sizing(DensitySource density, double aspect, double joint_weight = 3) {
  SizingOptions s;
  s.density = density;
  s.largest_aspect = aspect;
  s.joint_weight = joint_weight;
  return s;
}

std::vector<Variant> variants() {
  std::vector<Variant> list;
  const auto add = [&](const char* name, FieldPreset preset, std::optional<SizingOptions> s) -> RemeshOptions& {
    list.push_back({name, {}});
    list.back().options.preset = preset;
    list.back().options.sizing = s;
    return list.back().options;
  };
  using enum DensitySource;
  add("static: curvature directions, uniform", FieldPreset::flat, std::nullopt);
  add("bone directions, uniform", FieldPreset::standard, sizing(uniform, 1));
  add("bone directions, densities of the thesis, clamped", FieldPreset::standard, sizing(field, 1));
  add("thesis: its directions and densities", FieldPreset::thesis, std::nullopt);
  add("bone directions, isotropic, more where weights blend", FieldPreset::standard, sizing(blend, 1));
  add("bone directions, isotropic, rest curvature", FieldPreset::standard, sizing(rest, 1));
  add("bone directions, aspect and density of rest curvature", FieldPreset::standard, sizing(rest, 4));
  for (const auto& [joints, name] :
       {std::pair{1.0, "posed metric (directions, aspect, density), joints 1"},
        std::pair{3.0, "posed metric, joints 3"}, std::pair{8.0, "posed metric, joints 8"}}) {
    RemeshOptions& o = add(name, FieldPreset::standard, sizing(posed, 4, joints));
    o.directions.bones = 0;
    o.directions.posed = 0.1;
  }
  for (const auto& [joints, name] : {std::pair{1.0, "bone directions, posed aspect and density, joints 1"},
                                     std::pair{3.0, "bone directions, posed sizes, joints 3"},
                                     std::pair{8.0, "bone directions, posed sizes, joints 8"}})
    add(name, FieldPreset::standard, sizing(posed, 4, joints));
  add("bone and posed directions, posed sizes, joints 3", FieldPreset::standard, sizing(posed, 4, 3)).directions.posed =
      0.05;
  add("thesis directions, posed sizes, joints 3", FieldPreset::thesis, sizing(posed, 4, 3));
  add("default", FieldPreset::standard, std::nullopt);
  add("default, not fitted", FieldPreset::standard, std::nullopt).fit.method = FitMethod::none;
  return list;
}

/// Bends that the metric never sees: other angles, about axes between its own, and twists about the bone.
std::vector<Pose> unseen_poses(const Skeleton& skeleton) {
  std::vector<Pose> poses;
  for (Index b = 0; b < skeleton.bone_count(); ++b) {
    const Vector3 d = skeleton.bones[static_cast<std::size_t>(b)].direction();
    if (!(d.norm() > 0)) continue;
    const Vector3 x = d.unitOrthogonal(), y = d.cross(x);
    for (const auto& [angle, degrees] :
         {std::pair{0.6, 35.0}, std::pair{2.2, 45.0}, std::pair{3.7, 80.0}, std::pair{5.3, 70.0}})
      poses.push_back(bend(skeleton, b, std::cos(angle) * x + std::sin(angle) * y, degrees * 0.017453292519943295));
    for (const double degrees : {-50.0, 50.0}) poses.push_back(bend(skeleton, b, d, degrees * 0.017453292519943295));
  }
  return poses;
}

PolygonMesh polygons(const QuadMesh& quads) {
  PolygonMesh mesh;
  mesh.positions = quads.positions;
  mesh.first_corner.push_back(0);
  for (Index q = 0; q < quads.quad_count(); ++q) {
    for (int i = 0; i < 4; ++i) mesh.corners.push_back(quads.quads(q, i));
    mesh.first_corner.push_back(4 * (q + 1));
  }
  return mesh;
}

int study(const std::string& name, const Asset& asset, const std::vector<Index>& counts) {
  const Rig& rig = *asset.rig;
  const std::vector<Pose> seen = bend_poses(rig.skeleton, 60), unseen = unseen_poses(rig.skeleton);
  DeformationOptions measure;
  measure.samples = 20000;
  for (const Index count : counts) {
    std::printf("\n### %s, %d quads asked\n\n", name.c_str(), count);
    std::printf(
        "| variant | quads | irregular | SJ avg / min | rung | to bones | rings | joints | all | normals "
        "| unseen: joints | all | normals |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (Variant& variant : variants()) {
      variant.options.quads = count;
      Context context;
      const Expected<RemeshResult> result = remesh(asset, variant.options, context);
      if (!result) {
        std::printf("| %s | %s |\n", variant.name, result.error().message().c_str());
        continue;
      }
      const PolygonMesh coarse = polygons(result->mesh);
      const auto first = deformation_error(asset.mesh, rig.weights, coarse, *result->weights, seen, measure, context);
      const auto second =
          deformation_error(asset.mesh, rig.weights, coarse, *result->weights, unseen, measure, context);
      const auto guidance = guidance_figures(asset.mesh, rig, result->mesh);
      if (!first || !second || !guidance) {
        std::fprintf(stderr, "%s: the result could not be measured\n", variant.name);
        return 1;
      }
      const Index rings = std::accumulate(guidance->hinge_loops.begin(), guidance->hinge_loops.end(), Index{0});
      const RemeshReport& r = result->report;
      std::printf("| %s | %d | %d | %.3f / %.2f | %s | %.1f° | %d | %.2f | %.2f | %.1f° | %.2f | %.2f | %.1f° |\n",
                  variant.name, r.quads, r.irregular, r.scaled_jacobian_average, r.scaled_jacobian_minimum,
                  std::string(rung_name(r.components.front().rung)).c_str(), guidance->bone_angle_mean_degrees, rings,
                  first->joints.rms, first->all.rms, first->all.normal_degrees, second->joints.rms, second->all.rms,
                  second->all.normal_degrees);
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<Index> counts{500, 2000, 8000};
  std::vector<std::string> words(argv + 1, argv + argc);
  for (std::size_t k = 0; k < words.size();) {
    if (words[k] == "--quads" && k + 1 < words.size()) {
      counts.clear();
      const char* at = words[k + 1].data();
      const char* end = at + words[k + 1].size();
      for (Index n = 0; at < end; at += at < end) {
        const auto [stop, error] = std::from_chars(at, end, n);
        if (error != std::errc() || n < 6) {
          std::fprintf(stderr, "--quads wants numbers such as 500,2000\n");
          return 2;
        }
        counts.push_back(n);
        at = stop;
      }
      k += 2;
      continue;
    }
    Context context;
    const auto samples = sample_infos();
    const bool sample = std::any_of(samples.begin(), samples.end(), [&](const auto& s) { return s.name == words[k]; });
    if (!sample && k + 3 >= words.size()) {
      std::fprintf(stderr, "%s is no sample: give NAME MESH RIG WEIGHTS\n", words[k].c_str());
      return 2;
    }
    Expected<Asset> asset = [&]() -> Expected<Asset> {
      if (sample) return make_sample(words[k], 20000, context);
      Expected<LoadedAsset> loaded = load_asset({words[k + 1], words[k + 2], words[k + 3]}, {}, context);
      if (!loaded) return loaded.error();
      return std::move(loaded->asset);
    }();
    if (!asset) {
      std::fprintf(stderr, "%s\n", asset.error().message().c_str());
      return 4;
    }
    if (const int status = study(words[k], *asset, counts)) return status;
    k += sample ? 1 : 4;
  }
  return 0;
}
