// The decoders of compressed glTF files: the stream is fuzzed, the file around it is sound.
#include "gltf_tube.hpp"
#include "quadrig/gltf/surface.hpp"
#include "targets.hpp"

#if defined(QUADRIG_WITH_MESHOPTIMIZER)
#include <meshoptimizer.h>
#endif
#if defined(QUADRIG_WITH_DRACO)
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#endif
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
#endif

namespace quadrig::test {
namespace {

[[maybe_unused]] bool read_around(const std::string& primitive, const std::string& accessors, const std::string& view,
                                  const std::string& stream) {
  Context context;
  constexpr GltfLimits limits{
      .bytes = 1 << 22, .json_bytes = 1 << 20, .values = 1 << 20, .nodes = 1000, .frames = 2000};
  const std::string json = "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[" +
                           primitive + "]}],\"accessors\":[" + accessors + "],\"bufferViews\":[" + view +
                           "],\"buffers\":[{\"byteLength\":" + std::to_string(stream.size()) + "}]}";
  const Expected<GltfDocument> document = GltfDocument::parse(glb_of(json, stream), "fuzz.glb", limits, context);
  return document && gltf_vertices(*document, "_SOURCE", context).has_value();
}

#if defined(QUADRIG_WITH_MESHOPTIMIZER)

constexpr std::size_t choices = 4;  // bytes before the stream

bool run_meshopt(std::string_view bytes) {
  if (bytes.size() < choices) return false;
  const auto byte = [&](std::size_t k) { return static_cast<unsigned>(static_cast<unsigned char>(bytes[k])); };
  static const char* const modes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
  static const char* const filters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
  const unsigned mode = byte(0) % 3, count = byte(3);
  const unsigned stride = mode > 0 ? (byte(2) % 2 ? 4 : 2) : 4 * (1 + byte(2) % 64);
  const std::string stream(bytes.substr(choices)), size = std::to_string(count * stride);
  const std::string view =
      "{\"buffer\":0,\"byteLength\":" + size +
      ",\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteLength\":" + std::to_string(stream.size()) +
      ",\"byteStride\":" + std::to_string(stride) + ",\"count\":" + std::to_string(count) + ",\"mode\":\"" +
      modes[mode] + "\",\"filter\":\"" + filters[byte(1) % 4] + "\"}}}";
  return read_around("{\"attributes\":{\"POSITION\":0,\"_SOURCE\":1}}",
                     "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":" + size +
                         "},{\"type\":\"SCALAR\",\"componentType\":5121,\"bufferView\":0,\"count\":" + size + "}",
                     view, stream);
}

std::vector<std::string> meshopt_seeds() {
  std::vector<std::string> seeds;
  const auto add = [&](std::initializer_list<int> head, const std::vector<unsigned char>& stream, std::size_t size) {
    std::string& seed = seeds.emplace_back();
    for (const int one : head) seed += static_cast<char>(one);
    seed.append(reinterpret_cast<const char*>(stream.data()), size);
  };
  constexpr std::size_t count = 24;
  std::vector<float> vertices(3 * count);
  for (std::size_t k = 0; k < vertices.size(); ++k) vertices[k] = static_cast<float>(k % 7) * 0.25F;
  std::vector<unsigned char> bytes(meshopt_encodeVertexBufferBound(count, 12));
  add({0, 0, 2, count}, bytes, meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), vertices.data(), count, 12));
  add({0, 3, 2, count}, bytes, meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), vertices.data(), count, 12));
  std::vector<unsigned int> indices;
  for (unsigned k = 0; k + 2 < count; ++k)
    for (unsigned i = 0; i < 3; ++i) indices.push_back(k + i);
  bytes.resize(meshopt_encodeIndexBufferBound(indices.size(), count));
  add({1, 0, 1, static_cast<int>(indices.size())}, bytes,
      meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices.data(), indices.size()));
  bytes.resize(meshopt_encodeIndexSequenceBound(indices.size(), count));
  add({2, 0, 1, static_cast<int>(indices.size())}, bytes,
      meshopt_encodeIndexSequence(bytes.data(), bytes.size(), indices.data(), indices.size()));
  return seeds;
}

#endif
#if defined(QUADRIG_WITH_DRACO)

bool run_draco(std::string_view bytes) {
  const std::string stream(bytes);
  return read_around(
      "{\"attributes\":{\"POSITION\":0},\"indices\":1,\"extensions\":{\"KHR_draco_mesh_compression\":{\"bufferView\":0,"
      "\"attributes\":{\"POSITION\":0}}}}",
      "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":8},{\"type\":\"SCALAR\",\"componentType\":5123,\"count\":"
      "36}",
      "{\"buffer\":0,\"byteLength\":" + std::to_string(stream.size()) + "}", stream);
}

std::vector<std::string> draco_seeds() {
  constexpr int sides = 8;
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(sides);
  const int positions = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  for (int k = 0; k < sides; ++k) {
    const auto point = [](int i) {
      const double angle = 2 * std::numbers::pi * i / sides;
      return std::array<float, 3>{static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0.0F};
    };
    const std::array<float, 3> tip{0, 0, 1}, a = point(k), b = point(k + 1);
    builder.SetAttributeValuesForFace(positions, draco::FaceIndex(static_cast<std::uint32_t>(k)), a.data(), b.data(),
                                      tip.data());
  }
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  std::vector<std::string> seeds;
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    draco::Encoder encoder;
    encoder.SetEncodingMethod(method);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 10);
    draco::EncoderBuffer buffer;
    if (encoder.EncodeMeshToBuffer(*mesh, &buffer).ok()) seeds.emplace_back(buffer.data(), buffer.size());
  }
  return seeds;
}

#endif

}  // namespace

std::vector<FuzzTarget> compressed_targets() {
  std::vector<FuzzTarget> all;
#if defined(QUADRIG_WITH_MESHOPTIMIZER)
  all.push_back({"meshopt", run_meshopt, meshopt_seeds});
#endif
#if defined(QUADRIG_WITH_DRACO)
  all.push_back({"draco", run_draco, draco_seeds});
#endif
  return all;
}

}  // namespace quadrig::test
