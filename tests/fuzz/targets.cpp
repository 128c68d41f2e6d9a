#include "targets.hpp"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <unistd.h>

#include "gltf_tube.hpp"
#include "quadrig/gltf/surface.hpp"

namespace quadrig::test {
namespace {

constexpr GltfLimits gltf_limits{
    .bytes = 1 << 22, .json_bytes = 1 << 20, .values = 1 << 20, .nodes = 1000, .frames = 2000};
constexpr FileLimits file_limits{.bytes = 1 << 22, .vertices = 1 << 20, .polygons = 1 << 20, .bones = 1000};

/// Everything that reads a document, but not the remesh.
bool read_document(std::string bytes, const char* name) {
  Context context;
  const Expected<GltfDocument> document = GltfDocument::parse(std::move(bytes), name, gltf_limits, context);
  if (!document) return false;
  const bool surfaces = gltf_surfaces(*document, {}, {}, context, {.names = {}, .unskinned = true}).has_value();
  const bool vertices = gltf_vertices(*document, "_SOURCE", context).has_value();
  const bool written = document->glb().has_value();
  return surfaces && vertices && written;
}

bool run_glb(std::string_view bytes) { return read_document(std::string(bytes), "fuzz.glb"); }

Tube small_tube() {
  Tube tube;
  tube.sides = 5;
  tube.rings = 3;
  return tube;
}

/// The JSON of a file whose binary chunk stays as it is.
bool run_json(std::string_view json) {
  static const std::string file = tube_file(small_tube());
  std::uint32_t length = 0;
  std::memcpy(&length, file.data() + 12, 4);
  return read_document(glb_of(std::string(json), file.substr(20 + length + 8)), "fuzz.glb");
}

/// Bytes as choices: the members of accessors, views and a sparse part over a small buffer.
struct Choices {
  std::string_view bytes;
  std::size_t next = 0;
  std::uint64_t number(std::size_t width) {
    std::uint64_t value = 0;
    for (std::size_t k = 0; k < width; ++k)
      value = value << 8 | (next < bytes.size() ? static_cast<unsigned char>(bytes[next++]) : 0U);
    return value;
  }
  /// Mostly small, now and then anything.
  std::string count() {
    const std::uint64_t kind = number(1);
    if (kind < 224) return std::to_string(kind % 48);
    if (kind < 240) return std::to_string(number(4));
    return kind < 248 ? std::to_string(number(8)) : kind < 252 ? "-1" : kind < 254 ? "1.5" : "1e300";
  }
};

bool run_accessors(std::string_view bytes) {
  Choices choose{bytes};
  static const char* const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4", "VEC5"};
  static const int components[] = {5120, 5121, 5122, 5123, 5125, 5126, 5124, 0};
  std::string views, accessors;
  for (int i = 0; i < 4; ++i) {
    views += std::string(i > 0 ? "," : "") + "{\"buffer\":0,\"byteLength\":" + choose.count();
    if (choose.number(1) % 2) views += ",\"byteOffset\":" + choose.count();
    if (choose.number(1) % 2) views += ",\"byteStride\":" + choose.count();
    views += "}";
  }
  for (int i = 0; i < 4; ++i) {
    // The first is often what positions must be, so that the others are reached.
    const bool position = i == 0 && choose.number(1) % 4;
    accessors += std::string(i > 0 ? "," : "") + "{\"type\":\"" + (position ? "VEC3" : types[choose.number(1) % 8]);
    accessors += "\",\"componentType\":" + std::to_string(position ? 5126 : components[choose.number(1) % 8]);
    accessors += ",\"count\":" + choose.count();
    if (choose.number(1) % 4) accessors += ",\"bufferView\":" + choose.count();
    if (choose.number(1) % 2) accessors += ",\"byteOffset\":" + choose.count();
    if (choose.number(1) % 2) accessors += ",\"normalized\":true";
    if (choose.number(1) % 4 == 0) {
      accessors += ",\"sparse\":{\"count\":" + choose.count();
      accessors += ",\"indices\":{\"bufferView\":" + choose.count();
      accessors += ",\"componentType\":" + std::to_string(components[choose.number(1) % 8]);
      accessors += ",\"byteOffset\":" + choose.count();
      accessors += "},\"values\":{\"bufferView\":" + choose.count() + "}}";
    }
    accessors += "}";
  }
  const auto accessor = [&] { return std::to_string(choose.number(1) % 5); };
  std::string primitive = "{\"attributes\":{\"POSITION\":0,\"_SOURCE\":" + accessor();
  primitive += "},\"indices\":" + accessor();
  primitive += ",\"mode\":" + std::to_string(choose.number(1) % 8);
  primitive += ",\"targets\":[{\"NORMAL\":" + accessor() + "}]}";
  std::string buffer(bytes.substr(std::min(choose.next, bytes.size())));
  buffer.resize(std::max<std::size_t>(buffer.size(), 256), '\1');
  return read_document(
      glb_of("{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[" + primitive +
                 "]}],\"accessors\":[" + accessors + "],\"bufferViews\":[" + views +
                 "],\"buffers\":[{\"byteLength\":" + std::to_string(buffer.size()) + "}]}",
             buffer),
      "fuzz.glb");
}

/// A file with these bytes, the same each time.
const std::filesystem::path& file_of(std::string_view bytes) {
  static const std::filesystem::path path = [] {
    const char* memory = "/dev/shm";
    const std::filesystem::path folder =
        access(memory, W_OK) == 0 ? std::filesystem::path(memory) : std::filesystem::temp_directory_path();
    static const std::filesystem::path name = folder / ("quadrig-fuzz-" + std::to_string(getpid()));
    std::atexit([] { std::remove(name.c_str()); });
    return name;
  }();
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (!file) std::abort();
  std::fwrite(bytes.data(), 1, bytes.size(), file);
  std::fclose(file);
  return path;
}

bool run_surface(std::string_view bytes,
                 Expected<PolygonMesh> (*read)(const std::filesystem::path&, const FileLimits&, Context&)) {
  Context context;
  const Expected<PolygonMesh> mesh = read(file_of(bytes), file_limits, context);
  if (!mesh) return false;
  // What the reader lets through, the door must answer.
  return mesh->polygon_count() > 20000 || prepare(*mesh, nullptr, {}, context).has_value();
}
bool run_obj(std::string_view bytes) { return run_surface(bytes, read_obj); }
bool run_off(std::string_view bytes) { return run_surface(bytes, read_off); }
bool run_ply(std::string_view bytes) { return run_surface(bytes, read_ply); }
bool run_stl(std::string_view bytes) { return run_surface(bytes, read_stl); }
bool run_tgf(std::string_view bytes) {
  Context context;
  return read_tgf(file_of(bytes), file_limits, context).has_value();
}
bool run_dmat(std::string_view bytes) { return read_dmat(file_of(bytes), file_limits).has_value(); }

std::vector<std::string> glb_seeds() {
  std::vector<std::string> seeds;
  for (int k = 0; k < 6; ++k) {
    Tube tube = small_tube();
    tube.two_materials = k % 2 == 0;
    tube.as_json = k == 1 || k == 4;
    tube.skinned = k != 2;
    tube.crate = k == 3;
    tube.nan_weights = k == 4;
    tube.morph_normals = k == 5;
    seeds.push_back(tube_file(tube));
  }
  return seeds;
}

std::vector<std::string> json_seeds() {
  const std::string file = tube_file(small_tube());
  std::uint32_t length = 0;
  std::memcpy(&length, file.data() + 12, 4);
  return {file.substr(20, length)};
}

/// Choices that make three positions of floats, indices and an attribute.
std::vector<std::string> accessor_seeds() {
  std::string seed;
  const auto byte = [&](int value) { seed += static_cast<char>(value); };
  for (const int length : {36, 36, 3, 12}) {  // views: all begin with the buffer
    byte(length);
    byte(0);
    byte(0);
  }
  byte(1), byte(3), byte(1), byte(0), byte(0), byte(0), byte(1);           // 3 positions of view 0
  byte(2), byte(5), byte(3), byte(1), byte(1), byte(0), byte(0), byte(1);  // 3 vectors of floats of view 1
  byte(0), byte(1), byte(3), byte(1), byte(2), byte(0), byte(0), byte(1);  // 3 bytes of view 2
  byte(0), byte(5), byte(3), byte(1), byte(3), byte(0), byte(0), byte(1);  // 3 floats of view 3
  byte(1), byte(2), byte(4), byte(1);                                      // _SOURCE, indices, mode, target
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::string buffer(sizeof corners, '\0');
  std::memcpy(buffer.data(), corners, sizeof corners);
  // Indices are read from the first bytes of the same buffer: 0, 1 and 2 there make a tiny x of the first corner.
  buffer[0] = '\0', buffer[1] = '\1', buffer[2] = '\2';
  return {seed + buffer};
}

PolygonMesh cube() {
  PolygonMesh mesh;
  mesh.positions.resize(8, 3);
  for (Index v = 0; v < 8; ++v)
    for (int k = 0; k < 3; ++k) mesh.positions(v, k) = v >> k & 1;
  for (const std::array<Index, 4>& side :
       {std::array<Index, 4>{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}})
    mesh.add_polygon(side);
  return mesh;
}

std::vector<std::string> obj_seeds() {
  const PolygonMesh mesh = cube();
  QuadMesh quads;
  quads.positions = mesh.positions;
  quads.quads.resize(6, 4);
  for (Index q = 0; q < 6; ++q)
    for (int i = 0; i < 4; ++i) quads.quads(q, i) = mesh.corners[static_cast<std::size_t>(4 * q + i)];
  const std::string text = obj_text(quads);
  const std::string other =
      "# relative\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ng a\nusemtl b\nf -3/1/1 -2//1 -1/1\n";
  std::string wide = "\xFF\xFE", returns = "$ of a Mac\rf 1 2\r" + text;
  for (const char c : other) (wide += c) += '\0';
  std::replace(returns.begin(), returns.end(), '\n', '\r');
  return {text, other, wide, returns};
}

std::vector<std::string> off_seeds() {
  return {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
          "COFF # colours\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 1\n0 1 0 0 0 0 1\n0 0 1 0 0 0 1\n3 0 1 2\n3 0 3 1 9 9 "
          "9\n",
          "noff4 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n4 0 1\n2\n3\n",
          std::string("OFF BINARY\n\0\0\0\3\0\0\0\1\0\0\0\0", 23) + std::string(12, '\0') +
              std::string("\x3f\x80\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x3f\x80\0\0\0\0\0\0", 24) +
              std::string("\0\0\0\3\0\0\0\0\0\0\0\1\0\0\0\2\0\0\0\0", 20)};
}

std::vector<std::string> stl_seeds() {
  const std::string text =
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "endsolid s\n";
  std::string bytes("solid of bytes");
  bytes.resize(80, ' ');
  bytes += std::string("\1\0\0\0", 4) + std::string(12, '\0');
  for (const float x : {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F}) {
    std::string four(sizeof x, '\0');
    std::memcpy(four.data(), &x, sizeof x);
    bytes += four;
  }
  return {text, bytes + std::string(2, '\0')};
}

std::vector<std::string> ply_seeds() {
  const PolygonMesh mesh = cube();
  const std::string head =
      " 1.0\ncomment a cube\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n"
      "property list uchar int vertex_indices\nend_header\n";
  std::string text = "ply\nformat ascii" + head, little = "ply\nformat binary_little_endian" + head,
              big = "ply\nformat binary_big_endian" + head;
  const auto put = [&](auto value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    little += bytes;
    big.append(bytes.rbegin(), bytes.rend());
  };
  for (Index v = 0; v < 8; ++v) {
    for (int k = 0; k < 3; ++k) put(static_cast<float>(mesh.positions(v, k)));
    text += std::to_string(v & 1) + " " + std::to_string(v >> 1 & 1) + " " + std::to_string(v >> 2 & 1) + "\n";
  }
  for (Index q = 0; q < 6; ++q) {
    text += "4";
    put(std::uint8_t{4});
    for (const Index v : mesh.polygon(q)) {
      text += " " + std::to_string(v);
      put(v);
    }
    text += "\n";
  }
  const std::string strips =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
      "8 0 1 2 3 -1 3 1 0\n";
  return {text, little, big, strips};
}

std::vector<std::string> tgf_seeds() {
  Skeleton skeleton;
  for (int b = 0; b < 3; ++b) {
    Bone bone;
    bone.head = Vector3(0, b, 0);
    bone.tail = Vector3(0, b + 1, 0.5);
    bone.parent = b - 1;
    skeleton.bones.push_back(bone);
  }
  return {tgf_text(skeleton), "1 0 0 0\n2 1 0 0\n#\n1 2 0 0 0\n#\n"};
}

std::vector<std::string> dmat_seeds() {
  Eigen::MatrixXd matrix(3, 2);
  matrix << 1, 0, 0.25, 0.75, 0, 1;
  return {dmat_text(matrix), dmat_text(matrix, DmatFormat::binary)};
}

constexpr FuzzTarget plain[] = {
    {"glb", run_glb, glb_seeds}, {"json", run_json, json_seeds}, {"accessors", run_accessors, accessor_seeds},
    {"obj", run_obj, obj_seeds}, {"off", run_off, off_seeds},    {"ply", run_ply, ply_seeds},
    {"stl", run_stl, stl_seeds}, {"tgf", run_tgf, tgf_seeds},    {"dmat", run_dmat, dmat_seeds}};

}  // namespace

std::span<const FuzzTarget> fuzz_targets() {
  static const std::vector<FuzzTarget> all = [] {
    std::vector<FuzzTarget> targets(std::begin(plain), std::end(plain));
    for (const FuzzTarget& one : compressed_targets()) targets.push_back(one);
    return targets;
  }();
  return all;
}

}  // namespace quadrig::test
