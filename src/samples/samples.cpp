// The four shapes and their skeletons.
#include "quadrig/samples.hpp"

#include "head.hpp"

namespace quadrig {
namespace samples {
namespace {

/// A limb: the points within a radius of a segment, the radius passing smoothly from one end's to the other's.
struct Limb {
  Index bone;
  Vector3 a, b;
  double radius_a, radius_b;

  [[nodiscard]] double distance(const Vector3& p, Vector3& gradient) const {
    const Vector3 axis = b - a;
    const double squared = axis.squaredNorm();
    const double t = squared > 0 ? std::clamp((p - a).dot(axis) / squared, 0.0, 1.0) : 0.0;
    const Vector3 away = p - a - t * axis;
    const double length = away.norm();
    gradient = length > 0 ? Vector3(away / length) : Vector3::UnitX();
    if (t > 0 && t < 1) gradient -= (radius_b - radius_a) * 6 * t * (1 - t) / squared * axis;
    return length - radius_a - (radius_b - radius_a) * t * t * (3 - 2 * t);
  }
};

/// The smooth union −k log Σ exp(−d/k).
Distance smooth_union(std::vector<Limb> limbs, double k) {
  return [limbs = std::move(limbs), k](const Vector3& p, Vector3& gradient) {
    double least = std::numeric_limits<double>::infinity(), sum = 0;
    Vector3 each, total = Vector3::Zero();
    for (const Limb& limb : limbs) {
      const double d = limb.distance(p, each);
      if (d < least) {  // sums are kept relative to the least distance so far: nothing overflows
        const double scale = elementary::exp((d - least) / k);
        sum *= scale;
        total *= scale;
        least = d;
      }
      const double share = elementary::exp((least - d) / k);
      sum += share;
      total += share * each;
    }
    gradient = total / sum;
    return least - k * elementary::log(sum);
  };
}

Distance by_differences(std::function<double(const Vector3&)> f, double step) {
  return [f = std::move(f), step](const Vector3& p, Vector3& gradient) {
    for (int i = 0; i < 3; ++i)
      gradient[i] = (f(p + step * Vector3::Unit(i)) - f(p - step * Vector3::Unit(i))) / (2 * step);
    return f(p);
  };
}

void add_bone(Skeleton& skeleton, const std::string& name, const Vector3& head, const Vector3& tail, Index parent) {
  Bone bone;
  bone.head = head;
  bone.tail = tail;
  bone.parent = parent;
  bone.name = name;
  skeleton.bones.push_back(std::move(bone));
}

double segment_distance(const Bone& bone, const Vector3& p) {
  Vector3 ignored;
  return Limb{0, bone.head, bone.tail, 0, 0}.distance(p, ignored);
}

/// Limbs of bones, in a box around them.
Shape limbed(std::vector<Limb> limbs, double k, double cell, Skeleton skeleton) {
  Shape shape;
  Eigen::AlignedBox3d box;
  for (const Limb& limb : limbs) {
    const Vector3 reach = Vector3::Constant(std::max(limb.radius_a, limb.radius_b) + 4 * k);
    for (const Vector3& end : {limb.a, limb.b}) box.extend(end - reach).extend(end + reach);
  }
  shape.low = box.min();
  shape.high = box.max();
  shape.cell = cell;
  shape.skeleton = std::move(skeleton);
  shape.limb_distance = [limbs](Index bone, const Vector3& p) {
    double least = std::numeric_limits<double>::infinity();
    Vector3 ignored;
    for (const Limb& limb : limbs)
      if (limb.bone == bone) least = std::min(least, limb.distance(p, ignored));
    return least;
  };
  shape.distance = smooth_union(std::move(limbs), k);
  return shape;
}

Shape pear() {
  Skeleton skeleton;
  add_bone(skeleton, "body", {0, 0.25, 0}, {0, 1.15, 0}, no_index);
  add_bone(skeleton, "neck", {0, 1.15, 0}, {0, 1.95, 0}, 0);
  Shape shape = limbed({{0, {0, 0.7, 0}, {0, 1.8, 0}, 0.7, 0.3}}, 0.01, 0.06, skeleton);
  shape.limb_distance = [skeleton](Index bone, const Vector3& p) {
    return segment_distance(skeleton.bones[static_cast<std::size_t>(bone)], p);
  };
  return shape;
}

Shape box_torus() {
  constexpr double ring = 1, half = 0.35, round = 0.12, blend = 0.03;
  Skeleton skeleton;
  const Vector3 corner[4] = {{-ring, 0, -ring}, {ring, 0, -ring}, {ring, 0, ring}, {-ring, 0, ring}};
  for (Index i = 0; i < 4; ++i) add_bone(skeleton, "side" + std::to_string(i), corner[i], corner[(i + 1) % 4], i - 1);
  Shape shape;
  shape.low = Vector3(-ring - half, -half, -ring - half);
  shape.high = -shape.low;
  shape.cell = 0.04;
  shape.distance = by_differences(
      [](const Vector3& p) {
        // Off the square's middle line, then a rounded square section; the mitred corners are softened alike.
        const double x = std::abs(p.x()), z = std::abs(p.z()), far = std::max(x, z);
        const double off =
            far + blend * elementary::log(elementary::exp((x - far) / blend) + elementary::exp((z - far) / blend)) -
            ring;
        const double u = std::abs(off) - half + round, v = std::abs(p.y()) - half + round;
        return std::hypot(std::max(u, 0.0), std::max(v, 0.0)) + std::min(std::max(u, v), 0.0) - round;
      },
      1e-5);
  shape.limb_distance = [skeleton](Index bone, const Vector3& p) {
    return segment_distance(skeleton.bones[static_cast<std::size_t>(bone)], p);
  };
  shape.skeleton = std::move(skeleton);
  return shape;
}

Shape wing() {
  Skeleton skeleton;
  std::vector<Limb> limbs;
  constexpr double span[4] = {2.4, 2.25, 2.05, 1.8};
  for (Index i = 0; i < 4; ++i) {
    const double z = 0.22 * i;
    const Vector3 root(0, 0, z), tip(span[i], 0, z);
    add_bone(skeleton, "feather" + std::to_string(i), root, tip, no_index);
    limbs.push_back({i, root, tip, 0.14, 0.09});
  }
  return limbed(limbs, 0.06, 0.03, skeleton);
}

Shape humanoid() {
  Skeleton skeleton;
  std::vector<Limb> limbs;
  const Vector3 root(0, 0.96, 0), waist(0, 1.08, 0), ribs(0, 1.22, 0), collar(0, 1.43, 0), skull(0, 1.53, 0);
  add_bone(skeleton, "pelvis", root, waist, no_index);
  add_bone(skeleton, "spine", waist, ribs, 0);
  add_bone(skeleton, "chest", ribs, collar, 1);
  add_bone(skeleton, "neck", collar, skull, 2);
  add_bone(skeleton, "head", skull, {0, 1.78, 0.01}, 3);
  limbs.push_back({0, {-0.07, 0.99, 0}, {0.07, 0.99, 0}, 0.104, 0.104});
  for (const double x : {-0.06, 0.06}) limbs.push_back({1, {x, 1.07, 0}, {1.1 * x, 1.27, 0}, 0.092, 0.098});
  limbs.push_back({2, {-0.085, 1.32, 0}, {0.085, 1.32, 0}, 0.105, 0.105});
  limbs.push_back({3, collar, {0, 1.55, 0}, 0.06, 0.052});
  limbs.push_back({4, {0, 1.61, 0.01}, {0, 1.69, 0.01}, 0.085, 0.095});
  limbs.push_back({4, {0, 1.58, 0.04}, {0, 1.6, 0.045}, 0.055, 0.06});
  for (const double side : {1.0, -1.0}) {
    const std::string end = side > 0 ? "_l" : "_r";
    const auto at = [side](double x, double y, double z) { return Vector3(side * x, y, z); };
    const auto first = skeleton.bone_count();
    const Vector3 shoulder = at(0.18, 1.42, -0.005), elbow = at(0.41, 1.26, -0.015), wrist = at(0.62, 1.1, 0.015);
    const Vector3 fingers = at(0.76, 0.99, 0.04);
    add_bone(skeleton, "clavicle" + end, collar, shoulder, 2);
    add_bone(skeleton, "upper_arm" + end, shoulder, elbow, first);
    add_bone(skeleton, "forearm" + end, elbow, wrist, first + 1);
    add_bone(skeleton, "hand" + end, wrist, fingers, first + 2);
    limbs.push_back({first, at(0.07, 1.4, 0), shoulder, 0.07, 0.065});
    limbs.push_back({first + 1, shoulder, elbow, 0.058, 0.042});
    limbs.push_back({first + 2, elbow, wrist, 0.046, 0.031});
    limbs.push_back({first + 3, wrist, at(0.73, 1.01, 0.03), 0.032, 0.03});
    limbs.push_back({first + 3, at(0.67, 1.06, 0.035), at(0.72, 1.02, 0.055), 0.026, 0.024});
    const Vector3 hip = at(0.1, 0.9, 0), knee = at(0.115, 0.5, 0.015), ankle = at(0.125, 0.085, -0.015);
    const Vector3 toes = at(0.14, 0.035, 0.17);
    add_bone(skeleton, "hip" + end, root, hip, no_index);
    add_bone(skeleton, "thigh" + end, hip, knee, first + 4);
    add_bone(skeleton, "shin" + end, knee, ankle, first + 5);
    add_bone(skeleton, "foot" + end, ankle, toes, first + 6);
    limbs.push_back({first + 4, at(0.07, 0.92, 0), at(0.1, 0.9, -0.01), 0.095, 0.095});
    limbs.push_back({first + 5, hip, knee, 0.086, 0.058});
    limbs.push_back({first + 6, knee, ankle, 0.057, 0.037});
    limbs.push_back({first + 6, at(0.117, 0.42, -0.015), at(0.12, 0.3, -0.02), 0.05, 0.045});
    limbs.push_back({first + 7, at(0.125, 0.055, -0.04), toes, 0.042, 0.03});
  }
  return limbed(limbs, 0.012, 0.016, skeleton);
}

Eigen::MatrixXd given_weights(const Shape& shape, const TriangleMesh<double>& mesh) {
  Eigen::MatrixXd weights(mesh.vertex_count(), shape.skeleton.bone_count());
  if (!shape.weights) return weights;
  for (Index v = 0; v < mesh.vertex_count(); ++v) weights.row(v) = shape.weights(mesh.position(v));
  return weights;
}

constexpr SampleInfo known[] = {
    {"pear", "a body of revolution with two bones end to end", 2},
    {"box_torus", "a square ring of square section with a bone along each side", 4},
    {"humanoid", "a standing figure, arms half lowered", 21},
    {"head", "a head on a bust: lids, lips, inner mouth, ears", 4},
    {"wing", "a flat sheet of ridges over four bones side by side", 4},
};

}  // namespace
}  // namespace samples

std::span<const SampleInfo> sample_infos() { return samples::known; }

namespace samples {
namespace {

Expected<Shape> shape_of(std::string_view name) {
  if (name == "pear") return pear();
  if (name == "box_torus") return box_torus();
  if (name == "humanoid") return humanoid();
  if (name == "wing") return wing();
  if (name == "head") return head::shape();
  std::string names;
  for (const SampleInfo& info : known) names += (names.empty() ? "" : ", ") + std::string(info.name);
  return Error{ErrorCode::bad_option, "no sample is called '" + std::string(name) + "'", "sample",
               "name one of " + names};
}

/// The asset as a character of one part.
Character plain_character(std::string_view name, const Asset& asset) {
  Character made;
  made.name = name;
  made.skeleton = asset.rig->skeleton;
  made.materials = {{std::string(name), {0.8, 0.7, 0.6, 1}}};
  Part part;
  part.positions = asset.mesh.positions();
  part.faces = asset.mesh.faces();
  part.normals = vertex_normals(part.positions, part.faces);
  part.weights = Eigen::MatrixXd(asset.rig->weights);
  CharacterMesh mesh{made.name, {std::move(part)}, {}, no_index, {}};
  for (Index b = 0; b < made.skeleton.bone_count(); ++b) mesh.joints.push_back(b);
  made.meshes.push_back(std::move(mesh));
  return made;
}

}  // namespace
}  // namespace samples

Expected<std::string> make_sample_glb(std::string_view name, Index triangles, Context& context) {
  const Expected<Asset> asset = make_sample(name, triangles, context);
  if (!asset) return asset.error();
  if (name != "head") return samples::character_glb(samples::plain_character(name, *asset));
  return samples::character_glb(samples::head::character(samples::head::shape(), asset->mesh));
}

Expected<Asset> make_sample(std::string_view name, Index triangles, Context& context) {
  using namespace samples;
  constexpr Index least = 500, most = 4'000'000, base = 20'000;
  if (triangles < least || triangles > most)
    return Error{ErrorCode::bad_option, std::to_string(triangles) + " triangles are outside [500, 4000000]", "sample",
                 "ask for a number in that range"};
  Expected<Shape> known_shape = shape_of(name);
  if (!known_shape) return known_shape.error();
  Shape& shape = *known_shape;
  Index coarse = triangles;
  while (coarse > base) coarse /= 4;  // large ones are subdivided from a mesh a quarter as large, and so on
  context.progress("sample", 0);
  Expected<TriangleMesh<double>> mesh = surface_mesh(shape, coarse, context);
  if (!mesh) return mesh.error();
  context.progress("sample", 0.3);
  Expected<Eigen::MatrixXd> weights = given_weights(shape, *mesh);
  if (!shape.weights) weights = heat_weights(shape, *mesh, context);
  if (!weights) return weights.error();
  for (; coarse * 4 <= triangles; coarse *= 4) {
    mesh = subdivide(shape, *mesh, *weights, context);
    if (!mesh) return mesh.error();
  }
  // What hardly weighs goes, smoothly: subtracted, not cut off.
  constexpr double faint = 2e-3;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Eigen::Index v = 0; v < weights->rows(); ++v) {
    weights->row(v) = (weights->row(v).array() - faint).cwiseMax(0.0).matrix();
    weights->row(v) /= weights->row(v).sum();
    for (Eigen::Index b = 0; b < weights->cols(); ++b)
      if ((*weights)(v, b) > 0) entries.emplace_back(static_cast<Index>(v), static_cast<Index>(b), (*weights)(v, b));
  }
  SkinWeights sparse(weights->rows(), weights->cols());
  sparse.setFromTriplets(entries.begin(), entries.end());
  context.progress("sample", 1);
  Asset asset;
  asset.mesh = std::move(*mesh);
  asset.rig = Rig{std::move(shape.skeleton), std::move(sparse), {}};
  return asset;
}

}  // namespace quadrig
