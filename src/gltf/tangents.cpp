// Groups of corners, and the tangent of each.
#include "tangents.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>

#include "quadrig/elementary.hpp"

namespace quadrig::gltf {
namespace {

constexpr double least = std::numeric_limits<float>::min();

using quadrig::detail::at;
[[nodiscard]] std::size_t next(std::size_t corner) { return corner - corner % 3 + (corner + 1) % 3; }
[[nodiscard]] std::size_t previous(std::size_t corner) { return corner - corner % 3 + (corner + 2) % 3; }

/// Twice the signed area in the texture.
[[nodiscard]] double texture_area(const TangentGroups::Vertices& vertices, std::span<const Index> corners,
                                  std::size_t triangle) {
  const Eigen::Vector2d& origin = vertices.texture[at(corners[3 * triangle])];
  const Eigen::Vector2d a = vertices.texture[at(corners[3 * triangle + 1])] - origin,
                        b = vertices.texture[at(corners[3 * triangle + 2])] - origin;
  return a.x() * b.y() - a.y() * b.x();
}

/// Direction in which the first texture coordinate grows, of length 1 or 0.
[[nodiscard]] Vector3 along_texture(const TangentGroups::Vertices& vertices, std::span<const Index> corners,
                                    std::size_t triangle) {
  const std::array<std::size_t, 3> v{at(corners[3 * triangle]), at(corners[3 * triangle + 1]),
                                     at(corners[3 * triangle + 2])};
  const double a = vertices.texture[v[1]].y() - vertices.texture[v[0]].y(),
               b = vertices.texture[v[2]].y() - vertices.texture[v[0]].y();
  const Vector3 direction = b * (vertices.positions[v[1]] - vertices.positions[v[0]]) -
                            a * (vertices.positions[v[2]] - vertices.positions[v[0]]);
  const double length = direction.norm();
  if (!(length > least)) return Vector3::Zero();
  return direction * ((texture_area(vertices, corners, triangle) > 0 ? 1 : -1) / length);
}

/// The part of `v` that is orthogonal to the unit vector, of length 1 or 0.
[[nodiscard]] Vector3 in_plane(const Vector3& v, const Vector3& normal) {
  const Vector3 part = v - normal * normal.dot(v);
  const double length = part.norm();
  return length > least ? Vector3(part / length) : Vector3::Zero();
}

}  // namespace

void TangentGroups::weld(const Vertices& vertices) {
  // As floats, for that is how they are written.
  std::map<std::array<float, 8>, Index> known;
  std::vector<Index> number(vertices.positions.size(), no_index);
  for (const Index v : corners_) {
    if (number[at(v)] == no_index) {
      const Vector3 &p = vertices.positions[at(v)], &n = vertices.normals[at(v)];
      const Eigen::Vector2d& t = vertices.texture[at(v)];
      std::array<float, 8> key{};
      std::size_t k = 0;
      for (const double x : {p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), t.x(), t.y()}) key[k++] = static_cast<float>(x);
      number[at(v)] = known.try_emplace(key, static_cast<Index>(known.size())).first->second;
    }
    welded_.push_back(number[at(v)]);
  }
}

void TangentGroups::turn_quads(const Vertices& vertices, Index quads) {
  for (std::size_t t = 0; t < 2 * at(quads); t += 2) {
    quad_partner_[t] = static_cast<Index>(t + 1);
    quad_partner_[t + 1] = static_cast<Index>(t);
    const double first = std::abs(texture_area(vertices, corners_, t)),
                 second = std::abs(texture_area(vertices, corners_, t + 1));
    preserving_[t] = preserving_[t + 1] = first >= second ? preserving_[t] : preserving_[t + 1];
  }
}

void TangentGroups::grow(std::size_t corner, Index group, const std::vector<Index>& twin) {
  const Index vertex = welded_[corner];
  const char turned = preserving_[corner / 3];
  std::vector<std::size_t> open{corner / 3};
  while (!open.empty()) {
    const std::size_t t = open.back();
    open.pop_back();
    std::size_t here = 3 * t;
    while (here < 3 * t + 3 && welded_[here] != vertex) ++here;
    if (here == 3 * t + 3 || group_[here] != no_index) continue;
    if (flat_[t]) {
      // The first that comes says how a triangle without area in the texture is turned.
      const auto free = [&](std::size_t one) {
        return flat_[one] && group_[3 * one] == no_index && group_[3 * one + 1] == no_index &&
               group_[3 * one + 2] == no_index;
      };
      const Index partner = quad_partner_[t];
      if (free(t) && (partner == no_index || free(at(partner)))) {
        preserving_[t] = turned;
        if (partner != no_index) preserving_[at(partner)] = turned;
      }
    }
    if (preserving_[t] != turned) continue;
    group_[here] = group;
    for (const std::size_t side : {here, previous(here)})
      if (twin[side] != no_index) open.push_back(at(twin[side]) / 3);
  }
}

TangentGroups::TangentGroups(const Vertices& vertices, std::span<const Index> corners, Index quads)
    : corners_(corners),
      group_(corners.size(), no_index),
      preserving_(corners.size() / 3),
      flat_(corners.size() / 3),
      quad_partner_(corners.size() / 3, no_index) {
  weld(vertices);
  for (std::size_t t = 0; t < preserving_.size(); ++t) {
    const double area = texture_area(vertices, corners_, t);
    preserving_[t] = area > 0;
    flat_[t] = !(std::abs(area) > least) || along_texture(vertices, corners_, t).isZero();
  }
  turn_quads(vertices, quads);

  std::unordered_map<std::uint64_t, Index> side_of;
  const auto key = [&](std::size_t a, std::size_t b) {
    return static_cast<std::uint64_t>(welded_[a]) << 32 | static_cast<std::uint32_t>(welded_[b]);
  };
  for (std::size_t c = 0; c < corners_.size(); ++c) side_of.try_emplace(key(c, next(c)), static_cast<Index>(c));
  std::vector<Index> twin(corners_.size(), no_index);
  for (std::size_t c = 0; c < corners_.size(); ++c)
    if (const auto found = side_of.find(key(next(c), c)); found != side_of.end()) twin[c] = found->second;

  const auto add = [&](bool preserving) {
    sign_.push_back(preserving ? -1 : 1);
    return static_cast<Index>(sign_.size() - 1);
  };
  for (std::size_t c = 0; c < corners_.size(); ++c)
    if (!flat_[c / 3] && group_[c] == no_index) grow(c, add(preserving_[c / 3]), twin);
  // What no texture reaches.
  std::unordered_map<Index, Index> bare;
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    if (group_[c] != no_index) continue;
    const auto [place, is_new] = bare.try_emplace(welded_[c], 0);
    if (is_new) place->second = add(false);
    group_[c] = place->second;
  }
  for (std::size_t q = 0; q < at(quads); ++q) {  // both triangles of a quad: a b c, a c d
    group_[6 * q + 3] = group_[6 * q];
    group_[6 * q + 4] = group_[6 * q + 2];
  }
}

std::vector<Vector3> TangentGroups::directions(const Vertices& vertices) const {
  std::vector<Vector3> sum(sign_.size(), Vector3::Zero()), normal(sign_.size(), Vector3::UnitZ());
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    const std::size_t v = at(corners_[c]), g = at(group_[c]);
    const Vector3& n = normal[g] = vertices.normals[v];
    if (flat_[c / 3]) continue;
    const Vector3& p = vertices.positions[v];
    const Vector3 before = in_plane(vertices.positions[at(corners_[previous(c)])] - p, n),
                  after = in_plane(vertices.positions[at(corners_[next(c)])] - p, n);
    const double angle = elementary::acos(std::clamp(before.dot(after), -1.0, 1.0));
    sum[g] += angle * in_plane(along_texture(vertices, corners_, c / 3), n);
  }
  for (std::size_t g = 0; g < sum.size(); ++g) {
    const Vector3& n = normal[g];
    Vector3 direction = in_plane(sum[g], n);
    if (direction.isZero()) direction = in_plane(std::abs(n.x()) < 0.9 ? Vector3::UnitX() : Vector3::UnitY(), n);
    sum[g] = direction.isZero() ? Vector3::UnitX() : direction;
  }
  return sum;
}

}  // namespace quadrig::gltf
