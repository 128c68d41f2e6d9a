// A small rigged glTF file made by code: a closed tube along y, bent by two joints, with a seam in its texture
// coordinates, two materials and a clip.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

namespace quadrig::test {

struct Tube {
  int sides = 12, rings = 16;
  bool two_materials = true, nan_weights = false, cycle = false, as_json = false;
  bool skinned = true;         ///< else a mesh alone
  bool crate = false;          ///< a box that no skin moves, mesh "crate" of node "prop"
  bool parted = false;         ///< the upper half is a mesh of its own, with a skin of the same joints and matrices
  bool hung = false;           ///< the box hangs on the upper joint
  bool broken = false;         ///< a second skin "bad" whose mesh "broken" has a position that is not finite
  bool speck = false;          ///< instead a tiny triangle, and its bind matrices end in 0.99999994
  bool needle = false;         ///< one more primitive: a triangle 5e7 times as long as it is high
  bool morph_normals = false;  ///< the morph target has normals
  bool tangents = false;       ///< vertices and the morph target have some, none of them right
  bool loose = false;          ///< the upper joint is no child of the lower, and no scene has it
  bool normals = false;        ///< smooth along the sides, parted at the caps
  bool upward = false;         ///< all its normals are y
  bool dense_top = false;      ///< the attribute _DENSITY is 9 above the middle, else 1
  bool spots = false;          ///< two cells of the wall, on opposite sides, are a primitive of their own
  bool coloured = false;       ///< the morph target changes texture coordinates, by height
};

namespace detail {

template <class T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

}  // namespace detail

[[nodiscard]] inline std::string glb_of(const std::string& json, const std::string& binary) {
  const auto padded = [](std::string text, char with) {
    text.append((4 - text.size() % 4) % 4, with);
    return text;
  };
  const std::string first = padded(json, ' '), second = padded(binary, '\0');
  std::string file = "glTF";
  detail::put<std::uint32_t>(file, 2);
  detail::put<std::uint32_t>(file, static_cast<std::uint32_t>(28 + first.size() + second.size()));
  detail::put<std::uint32_t>(file, static_cast<std::uint32_t>(first.size()));
  file += "JSON" + first;
  detail::put<std::uint32_t>(file, static_cast<std::uint32_t>(second.size()));
  file += std::string("BIN\0", 4) + second;
  return file;
}

[[nodiscard]] inline std::string base64_of(const std::string& bytes) {
  const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[three >> (18 - 6 * k) & 63U];
  }
  return text;
}

/// Height 2, radius 0.25; the seam runs up at angle 0, the caps have texture coordinates of their own.
[[nodiscard]] inline std::string tube_file(const Tube& tube = {}) {
  struct Vertex {
    float x, y, z, u, v;
  };
  std::vector<Vertex> vertices;
  std::vector<std::uint16_t> lower, upper, spots;
  const int n = tube.sides, m = tube.rings;
  for (int r = 0; r <= m; ++r)
    for (int s = 0; s <= n; ++s) {
      const double a = 2 * std::numbers::pi * (s % n) / n;
      vertices.push_back({static_cast<float>(0.25 * std::cos(a)), static_cast<float>(2.0 * r / m),
                          static_cast<float>(0.25 * std::sin(a)), static_cast<float>(s) / static_cast<float>(n),
                          static_cast<float>(r) / static_cast<float>(m)});
    }
  const auto triangle = [&](std::vector<std::uint16_t>& to, int a, int b, int c) {
    for (const int v : {a, b, c}) to.push_back(static_cast<std::uint16_t>(v));
  };
  for (int r = 0; r < m; ++r)
    for (int s = 0; s < n; ++s) {
      const int a = r * (n + 1) + s, b = a + 1, c = b + n + 1, d = a + n + 1;
      const bool spot = tube.spots && r == m / 4 && s % (n / 2) == 1;
      auto& to = spot ? spots : tube.two_materials && 2 * r >= m ? upper : lower;
      triangle(to, a, c, b);
      triangle(to, a, d, c);
    }
  for (const bool top : {false, true}) {
    const int first = static_cast<int>(vertices.size());
    auto& to = tube.two_materials && top ? upper : lower;
    vertices.push_back({0, top ? 2.0F : 0.0F, 0, 0.5F, 0.5F});
    for (int s = 0; s < n; ++s) {
      const double a = 2 * std::numbers::pi * s / n;
      vertices.push_back({static_cast<float>(0.25 * std::cos(a)), top ? 2.0F : 0.0F,
                          static_cast<float>(0.25 * std::sin(a)), static_cast<float>(0.5 + 0.5 * std::cos(a)),
                          static_cast<float>(0.5 + 0.5 * std::sin(a))});
    }
    for (int s = 0; s < n; ++s) {
      const int a = first + 1 + s, b = first + 1 + (s + 1) % n;
      top ? triangle(to, first, b, a) : triangle(to, first, a, b);
    }
  }

  std::string bin, views, accessors;
  int view_count = 0;
  const auto add = [&](const std::string& bytes, std::size_t count, const std::string& type, int component,
                       const std::string& more = {}) {
    bin.append((4 - bin.size() % 4) % 4, '\0');
    views += std::string(views.empty() ? "" : ",") + "{\"buffer\":0,\"byteOffset\":" + std::to_string(bin.size()) +
             ",\"byteLength\":" + std::to_string(bytes.size()) + "}";
    accessors += std::string(accessors.empty() ? "" : ",") + "{\"bufferView\":" + std::to_string(view_count) +
                 ",\"componentType\":" + std::to_string(component) + ",\"count\":" + std::to_string(count) +
                 ",\"type\":\"" + type + "\"" + more + "}";
    bin += bytes;
    return view_count++;
  };
  std::string positions, uvs, joints, weights, binds, times, turns, moved;
  for (const Vertex& p : vertices) {
    for (const float x : {p.x, p.y, p.z}) detail::put(positions, x);
    for (const float x : {p.u, p.v}) detail::put(uvs, x);
    for (const int j : {0, 1, 0, 0}) detail::put(joints, static_cast<std::uint8_t>(j));
    const double upper_share = std::min(1.0, std::max(0.0, 2.0 * (p.y - 0.75)));
    float w[4] = {static_cast<float>(1 - upper_share), static_cast<float>(upper_share), 0, 0};
    if (tube.nan_weights && &p - vertices.data() < 3) w[0] = w[1] = std::nanf("");
    for (const float x : w) detail::put(weights, x);
    for (const float x : {0.0F, 0.1F * p.y, 0.0F}) detail::put(moved, x);
  }
  const std::size_t count = vertices.size();
  const int at_position = add(positions, count, "VEC3", 5126, ",\"min\":[-0.25,0,-0.25],\"max\":[0.25,2,0.25]");
  const int at_uv = add(uvs, count, "VEC2", 5126), at_joints = add(joints, count, "VEC4", 5121);
  const int at_weights = add(weights, count, "VEC4", 5126);
  const int at_moved = add(moved, count, "VEC3", 5126, ",\"min\":[0,0,0],\"max\":[0,0.2,0]");
  std::string tilts;
  for (std::size_t v = 0; v < count; ++v)
    for (const float x : {0.0F, 0.5F, 0.0F}) detail::put(tilts, x);
  const int at_tilts = tube.morph_normals || tube.tangents ? add(tilts, count, "VEC3", 5126) : 0;
  std::string wrong, shifts;
  for (const Vertex& vertex : vertices) {
    for (const float x : {0.6F, 0.8F, 0.0F, -1.0F}) detail::put(wrong, x);
    for (const float x : {0.25F * vertex.y, 0.5F}) detail::put(shifts, x);
  }
  std::string normals;
  for (std::size_t v = 0; v < count; ++v) {
    const Vertex& p = vertices[v];
    const bool side = v < static_cast<std::size_t>((m + 1) * (n + 1)) && !tube.upward;
    for (const float x :
         {side ? 4 * p.x : 0.0F, side ? 0.0F : (p.y > 1 || tube.upward ? 1.0F : -1.0F), side ? 4 * p.z : 0.0F})
      detail::put(normals, x);
  }
  const bool with_normals = tube.normals || tube.upward;
  const int at_normals = with_normals ? add(normals, count, "VEC3", 5126) : 0;
  std::string density;
  for (const Vertex& p : vertices) detail::put(density, p.y > 1 ? 9.0F : 1.0F);
  const int at_density = tube.dense_top ? add(density, count, "SCALAR", 5126) : 0;
  const int at_wrong = tube.tangents ? add(wrong, count, "VEC4", 5126) : 0;
  const int at_shifts = tube.coloured ? add(shifts, count, "VEC2", 5126) : 0;
  std::string both[2];
  for (const auto* list : {&lower, &upper, &spots}) {
    if (list->empty()) continue;
    std::string& primitives = both[tube.parted && list == &upper ? 1 : 0];
    std::string bytes;
    for (const std::uint16_t v : *list) detail::put(bytes, v);
    const int indices = add(bytes, list->size(), "SCALAR", 5123);
    primitives +=
        std::string(primitives.empty() ? "" : ",") + "{\"attributes\":{\"POSITION\":" + std::to_string(at_position) +
        ",\"TEXCOORD_0\":" + std::to_string(at_uv) +
        (tube.skinned ? ",\"JOINTS_0\":" + std::to_string(at_joints) + ",\"WEIGHTS_0\":" + std::to_string(at_weights)
                      : std::string()) +
        (tube.tangents ? ",\"TANGENT\":" + std::to_string(at_wrong) : std::string()) +
        (tube.dense_top ? ",\"_DENSITY\":" + std::to_string(at_density) : std::string()) +
        (with_normals ? ",\"NORMAL\":" + std::to_string(at_normals) : std::string()) +
        "},\"indices\":" + std::to_string(indices) + ",\"material\":" + (list == &lower ? "0" : "1") +
        ",\"targets\":[{\"POSITION\":" + std::to_string(at_moved) +
        (tube.morph_normals ? ",\"NORMAL\":" + std::to_string(at_tilts) : std::string()) +
        (tube.tangents ? ",\"TANGENT\":" + std::to_string(at_tilts) : std::string()) +
        (tube.coloured ? ",\"TEXCOORD_0\":" + std::to_string(at_shifts) : std::string()) + "}]}";
  }
  std::string& primitives = both[0];
  if (tube.needle) {
    std::string corners, joint, weight;
    for (const float x : {1.0F, 0.0F, 0.0F, 2.0F, 0.0F, 0.0F, 1.5F, 2e-8F, 0.0F}) detail::put(corners, x);
    for (int v = 0; v < 3; ++v)
      for (int k = 0; k < 4; ++k) {
        detail::put(joint, std::uint8_t{0});
        detail::put(weight, k == 0 ? 1.0F : 0.0F);
      }
    const int at_corners = add(corners, 3, "VEC3", 5126, ",\"min\":[1,0,0],\"max\":[2,2e-8,0]"),
              at_joint = add(joint, 3, "VEC4", 5121), at_weight = add(weight, 3, "VEC4", 5126);
    primitives += ",{\"attributes\":{\"POSITION\":" + std::to_string(at_corners) +
                  ",\"JOINTS_0\":" + std::to_string(at_joint) + ",\"WEIGHTS_0\":" + std::to_string(at_weight) + "}}";
  }
  std::string more_meshes, more_nodes, more_skins, roots = tube.skinned ? "0,1" : "0";
  if (tube.parted) {
    more_meshes += ",{\"name\":\"above\",\"primitives\":[" + both[1] + "],\"weights\":[0.0]}";
    more_nodes += ",{\"name\":\"rest\",\"mesh\":1,\"skin\":1}";
    roots += ",3";
  }
  if (tube.crate) {
    std::string corners, sides;
    for (int v = 0; v < 8; ++v)
      for (int k = 0; k < 3; ++k) detail::put(corners, (v >> k & 1) ? 1.0F : 0.0F);
    for (const int v :
         {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
      detail::put(sides, static_cast<std::uint16_t>(v));
    const int at_corners = add(corners, 8, "VEC3", 5126, ",\"min\":[0,0,0],\"max\":[1,1,1]"),
              at_sides = add(sides, 36, "SCALAR", 5123);
    more_meshes += ",{\"name\":\"crate\",\"primitives\":[{\"attributes\":{\"POSITION\":" + std::to_string(at_corners) +
                   "},\"indices\":" + std::to_string(at_sides) + "}]}";
    more_nodes += ",{\"name\":\"prop\",\"mesh\":1,\"scale\":[2,2,2]}";
    if (!tube.hung) roots += ",3";
  }
  if (tube.broken || tube.speck) {
    std::string corners, joint, weight;
    for (int k = 0; k < 9; ++k)
      detail::put(corners, tube.speck ? 0.001F * static_cast<float>(k % 4)
                           : k == 4   ? std::nanf("")
                                      : static_cast<float>(k % 4));
    for (int v = 0; v < 3; ++v)
      for (int k = 0; k < 4; ++k) {
        detail::put(joint, std::uint8_t{0});
        detail::put(weight, k == 0 ? 1.0F : 0.0F);
      }
    const int at_corners =
                  add(corners, 3, "VEC3", 5126, tube.speck ? ",\"min\":[0,0,0],\"max\":[0.003,0.003,0.003]" : ""),
              at_joint = add(joint, 3, "VEC4", 5121), at_weight = add(weight, 3, "VEC4", 5126);
    more_meshes += ",{\"name\":\"broken\",\"primitives\":[{\"attributes\":{\"POSITION\":" + std::to_string(at_corners) +
                   ",\"JOINTS_0\":" + std::to_string(at_joint) + ",\"WEIGHTS_0\":" + std::to_string(at_weight) + "}}]}";
    more_nodes += std::string(",{\"name\":\"torn\",\"mesh\":") + (tube.crate ? "2" : "1") + ",\"skin\":1}";
    std::string off;
    for (int matrix = 0; matrix < 2; ++matrix)
      for (int k = 0; k < 16; ++k) detail::put(off, k == 15 ? 0.99999994F : k % 5 == 0 ? 1.0F : 0.0F);
    const int at_off = add(off, 2, "MAT4", 5126);
    more_skins = ",{\"name\":\"bad\",\"joints\":[1,2]" +
                 (tube.speck ? ",\"inverseBindMatrices\":" + std::to_string(at_off) : std::string()) + "}";
    roots += tube.crate ? ",4" : ",3";
  }
  for (const float y : {0.0F, -1.0F})
    for (int k = 0; k < 16; ++k) detail::put(binds, k % 5 == 0 ? 1.0F : k == 13 ? y : 0.0F);
  const int at_binds = add(binds, 2, "MAT4", 5126);
  if (tube.parted) more_skins += ",{\"joints\":[1,2],\"inverseBindMatrices\":" + std::to_string(at_binds) + "}";
  for (const float t : {0.0F, 0.5F, 1.0F}) detail::put(times, t);
  for (const double angle : {0.0, 0.7, 0.0})
    for (const double x : {0.0, 0.0, std::sin(angle / 2), std::cos(angle / 2)})
      detail::put(turns, static_cast<float>(x));
  const int at_times = add(times, 3, "SCALAR", 5126, ",\"min\":[0],\"max\":[1]"),
            at_turns = add(turns, 3, "VEC4", 5126);
  const std::string uri =
      tube.as_json ? ",\"uri\":\"data:application/octet-stream;base64," + base64_of(bin) + "\"" : std::string();
  const std::string json =
      "{\"asset\":{\"version\":\"2.0\",\"generator\":\"a test\"},\"scene\":0,\"scenes\":[{\"nodes\":[" + roots +
      "]}],"
      "\"nodes\":[{\"name\":\"body\",\"mesh\":0" +
      (tube.skinned ? ",\"skin\":0" : "") + "},{\"name\":\"lower\"" +
      std::string(tube.loose ? "" : ",\"children\":[2]") +
      "},"
      "{\"name\":\"upper\",\"translation\":[0,1.0,0]" +
      std::string(tube.cycle  ? ",\"children\":[1]"
                  : tube.hung ? ",\"children\":[3]"
                              : "") +
      "}" + more_nodes + "],\"meshes\":[{\"name\":\"tube\",\"primitives\":[" + primitives + "],\"weights\":[0.0]}" +
      more_meshes +
      "],\"materials\":[{\"name\":\"red\"},{\"name\":\"blue\"}],"
      "\"skins\":[{\"joints\":[1,2],\"inverseBindMatrices\":" +
      std::to_string(at_binds) + "}" + more_skins +
      "],\"animations\":[{\"name\":\"bow\",\"channels\":[{\"sampler\":0,\"target\":{\"node\":2,\"path\":\"rotation\"}}"
      "],"
      "\"samplers\":[{\"input\":" +
      std::to_string(at_times) + ",\"output\":" + std::to_string(at_turns) + "}]}],\"accessors\":[" + accessors +
      "],\"bufferViews\":[" + views + "],\"buffers\":[{\"byteLength\":" + std::to_string(bin.size()) + uri +
      "}],\"extras\":{\"huge\":1e-30,\"kept\":0.1}}";
  return tube.as_json ? json : glb_of(json, bin);
}

}  // namespace quadrig::test
