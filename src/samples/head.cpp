// The head as a character: skins, texture islands, morph targets.
#include "head.hpp"

#include <map>

namespace quadrig::samples::head {
namespace {

enum Island : int { front, back, ear_left, ear_right, mouth, pocket_left, pocket_right };

Island island_of(const Vector3& p) {
  const bool left = p.x() > 0;
  if (in_pocket(p)) return std::abs(p.y() - mouth_y) < 0.03 ? mouth : left ? pocket_left : pocket_right;
  if (std::abs(p.x()) > 0.0695 &&
      (Vector3(std::abs(p.x()), p.y(), p.z()) - Vector3(0.076, -0.004, -0.014)).norm() < 0.037)
    return left ? ear_left : ear_right;
  return p.z() > seam_z ? front : back;
}

/// From 0 to 1 within the island.
Eigen::Vector2d unrolled(Island island, const Vector3& p) {
  const double height = (p.y() - bottom_y) / (0.135 - bottom_y);
  switch (island) {
    case front:
      return {0.5 + elementary::atan2(p.x(), std::max(p.z() - seam_z, 0.0)) / pi, height};
    case back:
      return {0.5 - elementary::atan2(p.x(), std::max(seam_z - p.z(), 0.0)) / pi, height};
    case ear_left:
    case ear_right:
      return {0.5 + (p.z() + 0.014) / 0.08, 0.5 + (p.y() + 0.004) / 0.08};
    case mouth:
      return {0.5 + p.x() / 0.07, 0.5 + elementary::atan2(p.y() - mouth_y, 0.05 - p.z()) / (2 * pi)};
    default:
      return {0.5 + (std::abs(p.x()) - eye_x) / 0.036,
              0.5 + elementary::atan2(p.y() - eye_y, eye_z - p.z()) / (2 * pi)};
  }
}

struct Place {
  double u, v, width, height;
};
constexpr std::array<Place, 7> places{{{0.01, 0.31, 0.58, 0.68},
                                       {0.61, 0.31, 0.38, 0.68},
                                       {0.01, 0.01, 0.23, 0.28},
                                       {0.26, 0.01, 0.23, 0.28},
                                       {0.51, 0.01, 0.23, 0.28},
                                       {0.76, 0.01, 0.11, 0.28},
                                       {0.88, 0.01, 0.11, 0.28}}};

Eigen::Vector2d texture_place(Island island, const Vector3& p) {
  const Place& place = places[static_cast<std::size_t>(island)];
  const Eigen::Vector2d at = unrolled(island, p).cwiseMax(0.0).cwiseMin(1.0);
  return {place.u + place.width * at[0], 1 - place.v - place.height * at[1]};
}

double falling(double x) { return elementary::exp(-x * x); }

/// Colours of the skin, drawn in the islands.
Picture skin_picture() {
  constexpr int side = 256;
  Picture made{side, side, {}};
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const double u = (column + 0.5) / side, v = 1 - (row + 0.5) / side;
      Eigen::Array3d color(226, 178, 152);
      const Place& place = places[front];
      if (v < 0.3) {
        if (u > 0.5) color = {150, 70, 66};
      } else if (u < 0.6) {
        const double turn = pi * ((u - place.u) / place.width - 0.5);
        const double y = bottom_y + (0.135 - bottom_y) * (v - place.v) / place.height;
        const double lips = std::clamp(6 - 5 * std::hypot(turn / 0.2, (y - mouth_y) / 0.0125), 0.0, 1.0);
        const double blush = 0.5 * falling(std::hypot((std::abs(turn) - 0.42) / 0.16, (y + 0.028) / 0.02));
        color += lips * (Eigen::Array3d(176, 86, 84) - color);
        color += blush * (Eigen::Array3d(222, 132, 116) - color);
      }
      for (int i = 0; i < 3; ++i) made.rgb += static_cast<char>(static_cast<int>(std::lround(color[i])));
    }
  return made;
}

/// Rows from the front of the eyeball to its back.
Picture eye_picture() {
  constexpr int width = 16, height = 64;
  Picture made{width, height, {}};
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const double polar = 180 * (row + 0.5) / height;
      const double streak = 8 * elementary::sin(column * pi * 4 / width);
      const Eigen::Array3d color = polar < 12   ? Eigen::Array3d(14, 12, 12)
                                   : polar < 27 ? Eigen::Array3d(62 + streak, 96 + streak, 88 + streak)
                                   : polar < 30 ? Eigen::Array3d(36, 44, 42)
                                                : Eigen::Array3d(238, 234, 228);
      for (int i = 0; i < 3; ++i) made.rgb += static_cast<char>(static_cast<int>(std::lround(color[i])));
    }
  return made;
}

/// The faces of the body or of the head; vertices count once for each island.
Part skin_part(const Shape& shape, const TriangleMesh<double>& skin, bool body) {
  Part part;
  std::map<std::pair<Index, int>, Index> numbers;
  std::vector<std::pair<Index, Island>> vertices;
  std::vector<std::array<Index, 3>> faces;
  for (Index f = 0; f < skin.face_count(); ++f) {
    const Vector3 middle =
        (skin.position(skin.faces()(f, 0)) + skin.position(skin.faces()(f, 1)) + skin.position(skin.faces()(f, 2))) / 3;
    if (middle.y() < bottom_y || (middle.y() < neck_y) != body) continue;
    const Island island = island_of(middle);
    std::array<Index, 3> corners{};
    for (int i = 0; i < 3; ++i) {
      const auto [found, fresh] =
          numbers.emplace(std::pair(skin.faces()(f, i), int{island}), static_cast<Index>(vertices.size()));
      if (fresh) vertices.emplace_back(skin.faces()(f, i), island);
      corners[static_cast<std::size_t>(i)] = found->second;
    }
    faces.push_back(corners);
  }
  const auto count = static_cast<Eigen::Index>(vertices.size());
  part.positions.resize(count, 3);
  part.normals.resize(count, 3);
  part.texture.resize(count, 2);
  for (Eigen::Index v = 0; v < count; ++v) {
    const auto [vertex, island] = vertices[static_cast<std::size_t>(v)];
    const Vector3 p = skin.position(vertex);
    Vector3 gradient;
    (void)shape.distance(p, gradient);
    part.positions.row(v) = p.transpose();
    part.normals.row(v) = gradient.normalized().transpose();
    part.texture.row(v) = texture_place(island, p).transpose();
  }
  part.faces.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int i = 0; i < 3; ++i) part.faces(static_cast<Eigen::Index>(f), i) = faces[f][static_cast<std::size_t>(i)];
  part.material = body ? cloth_material : skin_material;
  return part;
}

void weigh(Part& part, Index joints) {
  part.weights = Eigen::MatrixXd::Zero(part.positions.rows(), joints);
  for (Eigen::Index v = 0; v < part.positions.rows(); ++v) {
    const Eigen::RowVector4d shares = weights(part.positions.row(v).transpose());
    part.weights.row(v).head(std::min<Index>(joints, 4)) = shares.head(std::min<Index>(joints, 4));
  }
}
void weigh_by(Part& part, Index joints, const std::function<Index(const Vector3&)>& joint) {
  part.weights = Eigen::MatrixXd::Zero(part.positions.rows(), joints);
  for (Eigen::Index v = 0; v < part.positions.rows(); ++v)
    part.weights(v, joint(part.positions.row(v).transpose())) = 1;
}

/// Sheets over the skin move with it; eyes stay.
void add_targets(Part& part, bool moves) {
  for (std::size_t morph = 0; morph < morph_names.size(); ++morph) {
    Points<double> target = Points<double>::Zero(part.positions.rows(), 3);
    const Points<double>& roots = part.roots.rows() > 0 ? part.roots : part.positions;
    if (moves)
      for (Eigen::Index v = 0; v < target.rows(); ++v)
        target.row(v) = displacement(morph, roots.row(v).transpose()).transpose();
    part.targets.push_back(std::move(target));
  }
}

std::vector<CharacterMaterial> materials() {
  std::vector<CharacterMaterial> made(6);
  made[skin_material] = {"skin", {1, 1, 1, 1}, false, 0.55, skin_picture()};
  made[hair_material] = {"hair", {0.09, 0.05, 0.03, 1}, true, 0.6};
  made[eye_material] = {"eyes", {1, 1, 1, 1}, false, 0.25, eye_picture()};
  made[frame_material] = {"frame", {0.03, 0.03, 0.04, 1}, false, 0.4};
  made[glass_material] = {"glass", {0.85, 0.93, 1, 0.12}, true, 0.1};
  made[cloth_material] = {"cloth", {0.16, 0.27, 0.38, 1}, false, 0.8};
  return made;
}

}  // namespace

Character character(const Shape& shape, const TriangleMesh<double>& skin) {
  Character made;
  made.name = "head";
  made.skeleton = shape.skeleton;
  for (const double side : {1.0, -1.0}) {
    Bone bone;
    bone.head = Vector3(side * eye_x, eye_y, eye_z);
    bone.tail = bone.head + Vector3(0, 0, eye_radius);
    bone.parent = skull;
    bone.name = side > 0 ? "eye_left" : "eye_right";
    made.skeleton.bones.push_back(std::move(bone));
  }
  made.materials = materials();

  const std::vector<Index> joints{chest, neck, skull, jaw, eye_l, eye_r};
  const auto all = static_cast<Index>(joints.size());
  CharacterMesh face{"head", {}, joints, no_index, {morph_names.begin(), morph_names.end()}};
  face.parts = {skin_part(shape, skin, false), eyes(), brows_and_lashes(shape)};
  weigh(face.parts[0], all);
  weigh_by(face.parts[1], all, [](const Vector3& p) { return p.x() > 0 ? eye_l : eye_r; });
  weigh_by(face.parts[2], all, [](const Vector3&) { return skull; });
  for (std::size_t i = 0; i < 3; ++i) add_targets(face.parts[i], i != 1);
  CharacterMesh body{"body", {skin_part(shape, skin, true)}, {chest, neck}, no_index, {}};
  weigh(body.parts[0], 2);
  CharacterMesh strands{"hair", {hair(shape)}, joints, no_index, {}};
  weigh_by(strands.parts[0], all, [](const Vector3&) { return skull; });
  CharacterMesh glasses{"spectacles", {spectacles(), lenses()}, {}, skull, {}};
  made.meshes = {std::move(face), std::move(body), std::move(strands), std::move(glasses)};

  const std::vector<double> seconds{0, 0.5, 1, 1.5, 2};
  made.clip = {{neck, Vector3::UnitY(), seconds, {0, 15, 0, -15, 0}},
               {skull, Vector3::UnitX(), seconds, {0, 10, -8, 10, 0}},
               {jaw, Vector3::UnitX(), seconds, {0, 0, 12, 0, 0}},
               {eye_l, Vector3::UnitY(), seconds, {0, -15, 0, 15, 0}},
               {eye_r, Vector3::UnitY(), seconds, {0, -15, 0, 15, 0}}};
  return made;
}

}  // namespace quadrig::samples::head
