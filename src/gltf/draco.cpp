// Draco streams.
#include "reader.hpp"

#if defined(QUADRIG_WITH_DRACO)
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#endif
#include <draco/compression/decode.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
#endif

namespace quadrig::gltf {

#if !defined(QUADRIG_WITH_DRACO)

Expected<DracoMesh> read_draco(State& state, const Json&, const std::string& where, Budget&) {
  return state.unsupported(where, std::string("is compressed with ") + draco_name + ", which this build does not read",
                           "decompress the file first, or build with Draco");
}

#else

Expected<DracoMesh> read_draco(State& state, const Json& extension, const std::string& where, Budget& budget) {
  const std::string there = where + ".extensions." + draco_name;
  const Expected<std::size_t> view = whole_member(state, extension, "bufferView", there);
  if (!view) return view.error();
  std::size_t stride = 0;
  const Expected<std::string_view> bytes = view_bytes(state, *view, stride);
  if (!bytes) return bytes.error();
  const Error too_large =
      state.bad(there, "asks for more numbers than the limit of " + std::to_string(state.limits.values),
                "use a smaller file or raise the limit");
  std::unique_ptr<draco::Mesh> mesh;
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes->data(), bytes->size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) return state.bad(there, "cannot be decompressed");
    mesh = std::move(decoded).value();
  } catch (const std::exception&) {
    return too_large;
  }
  DracoMesh result;
  result.vertices = mesh->num_points();
  const std::size_t corners = 3 * static_cast<std::size_t>(mesh->num_faces());
  state.unpacked_bytes += 4 * corners;
  if (Status status = charge(state, budget, corners, 1, there); !status) return status.error();
  for (draco::FaceIndex f(0); f < mesh->num_faces(); ++f)
    for (int i = 0; i < 3; ++i) {
      const std::size_t v = mesh->face(f)[static_cast<std::size_t>(i)].value();
      if (v >= result.vertices) return state.bad(there, "names a vertex that is not there");
      result.corners.push_back(v);
    }
  const Json* attributes = member(extension, "attributes");
  if (!attributes || !attributes->is_object()) return state.bad(there, "has no attributes");
  for (const auto& [name, number] : attributes->items()) {
    const auto id = whole(number);
    const draco::PointAttribute* attribute =
        id && *id <= 0xffffffffU ? mesh->GetAttributeByUniqueId(static_cast<std::uint32_t>(*id)) : nullptr;
    if (!attribute) return state.bad(there + "." + name, "is not in the stream");
    const int width = attribute->num_components();
    if (width < 1 || width > 4) return state.bad(there + "." + name, "is not of one to four numbers");
    state.unpacked_bytes += 4 * result.vertices;
    if (Status status = charge(state, budget, result.vertices, static_cast<std::size_t>(width), there); !status)
      return status.error();
    auto values = std::make_shared<Values>(static_cast<Eigen::Index>(result.vertices), width);
    for (draco::PointIndex p(0); p < mesh->num_points(); ++p) {
      std::array<float, 4> row{};
      if (!attribute->ConvertValue<float>(attribute->mapped_index(p), static_cast<std::int8_t>(width), row.data()))
        return state.bad(there + "." + name, "cannot be decompressed");
      for (int k = 0; k < width; ++k)
        (*values)(static_cast<Eigen::Index>(p.value()), k) = static_cast<double>(row[static_cast<std::size_t>(k)]);
    }
    if (!attribute->normalized()) result.as_stored.insert(name);
    result.attributes[name] = std::move(values);
  }
  return result;
}

#endif

}  // namespace quadrig::gltf
