// Density by hand in glTF files: joints, materials, colours, and the attribute _DENSITY.
#include "shells.hpp"

namespace quadrig::gltf {
namespace {

/// The product of the factors that fit a name.
double factor_of(const std::vector<NamedFactor>& factors, const std::string& name) {
  double product = 1;
  for (const NamedFactor& each : factors)
    if (fits_name(each.name, name)) product *= each.factor;
  return product;
}

double bounded(double factor) {
  return factor > 0 ? std::clamp(factor, least_density_factor, largest_density_factor) : 1;
}

}  // namespace

std::vector<double> density_factors(const Gathered& gathered, const std::optional<MirrorPlane>& mirror,
                                    const GltfRemeshOptions& options) {
  const Asset& asset = gathered.surface.asset;
  const TriangleMesh<double>& mesh = asset.mesh;
  std::vector<double> factors(at(mesh.face_count()), 1.0);
  bool any = false;
  // The product of what each corner has, to a third.
  const auto multiply = [&](Index h, double factor) {
    factors[at(h / 3)] *= elementary::cbrt(bounded(factor));
    any = true;
  };
  for (const Attribute& attribute : gathered.attributes) {
    if (attribute.target != Attribute::no_target) continue;
    const bool own = attribute.name == "_DENSITY" && attribute.width == 1;
    const bool color = options.density_colors && attribute.name == "COLOR_0" && attribute.width >= 3;
    if (!own && !color) continue;
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      const auto values = gathered.values.row(gathered.corner_vertex[at(h)]);
      multiply(h, own ? values[attribute.first] : density_of_color(values.segment<3>(attribute.first).transpose()));
    }
  }
  if (!options.material_density.empty())
    for (Index f = 0; f < mesh.face_count(); ++f) {
      const Primitive& primitive = gathered.primitives[at(gathered.surface.source_primitive[at(f)])];
      factors[at(f)] *= factor_of(options.material_density, primitive.material_name);
      any = true;
    }
  if (!options.bone_density.empty() && asset.rig) {
    std::vector<double> of_bone;
    for (const Bone& bone : asset.rig->skeleton.bones) of_bone.push_back(factor_of(options.bone_density, bone.name));
    if (mirror) even_factors(*mirror, of_bone);
    const std::vector<double> moved = vertex_factors(asset.rig->weights, of_bone);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) multiply(h, moved[at(mesh.origin(h))]);
  }
  if (!any) return {};
  for (double& factor : factors) factor = bounded(factor);
  return factors;
}

Status check_density(const std::vector<Gathered>& all, const GltfRemeshOptions& options) {
  std::vector<std::string> bones, materials;
  bool colors = false;
  for (const Gathered& one : all) {
    if (one.surface.asset.rig)
      for (const Bone& bone : one.surface.asset.rig->skeleton.bones) bones.push_back(bone.name);
    for (const Primitive& primitive : one.primitives) materials.push_back(primitive.material_name);
    for (const Attribute& attribute : one.attributes)
      colors = colors || (attribute.target == Attribute::no_target && attribute.name == "COLOR_0");
  }
  if (const auto found = named_factors(options.bone_density, bones, "bone"); !found) return found.error();
  if (const auto found = named_factors(options.material_density, materials, "material"); !found) return found.error();
  if (options.density_colors && !colors)
    return Error{ErrorCode::bad_option, "no surface has colours of vertices", "density_colors",
                 "leave it out, or give a file that has COLOR_0"};
  return {};
}

}  // namespace quadrig::gltf
