// The container: JSON text and chunks in.
#include <cstring>

#include "document.hpp"
#include "io/scan.hpp"

namespace quadrig {
namespace gltf {
namespace {

std::uint32_t word(std::string_view bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k)
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[offset + k])) << (8 * k);
  return value;
}

/// Holds the JSON against the limits before it is parsed: bytes, nesting, and members an object, because finding one
/// member among m costs m steps.
Status check_text(const State& state, std::string_view text) {
  const auto too = [&](const std::string& what, std::size_t i) {
    return state.bad("byte " + std::to_string(i) + " of the JSON", what, "use a simpler file or raise the limit");
  };
  if (text.size() > state.limits.json_bytes)
    return state.bad("JSON", "is larger than the limit of " + std::to_string(state.limits.json_bytes) + " bytes",
                     "use a smaller file or raise the limit");
  std::vector<double> members(1, 0.0);
  double steps = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        in_string = false;
      continue;
    }
    if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (members.size() > state.limits.nesting) return too("is nested too deeply", i);
      members.push_back(0);
    } else if (c == '}' || c == ']') {
      if (members.size() > 1) members.pop_back();
    } else if (c == ':') {
      steps += ++members.back();
      if (steps > 2e8) return too("has objects of too many members", i);
    }
  }
  return {};
}

Status read_chunks(State& state, std::string_view bytes, Context& context) {
  const Error cut = state.bad("header", "the file is cut short", "export or download the file again");
  if (bytes.size() < 20) return cut;
  if (word(bytes, 4) != 2)
    return state.unsupported("header", "is version " + std::to_string(word(bytes, 4)) + " of GLB", "convert it to 2.0");
  const std::size_t length = word(bytes, 8);
  if (length > bytes.size() || length < 20) return cut;
  if (length < bytes.size())
    context.warn("gltf", state.name.string() + ": " + std::to_string(bytes.size() - length) +
                             " bytes behind the announced length are left out");
  std::size_t offset = 12;
  while (offset < length) {
    if (length - offset < 8) return state.bad("byte " + std::to_string(offset), "a chunk is cut short");
    const std::size_t size = word(bytes, offset);
    if (size > length - offset - 8) return state.bad("byte " + std::to_string(offset), "a chunk is cut short");
    state.chunks.push_back({word(bytes, offset + 4), std::string(bytes.substr(offset + 8, size)), false});
    offset += 8 + size;
  }
  if (state.chunks.front().type != json_chunk) return state.bad("byte 12", "the first chunk is not JSON");
  return {};
}

Status read_json(State& state) {
  std::string_view text = state.text;
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  while (!text.empty() && text.back() == '\0') text.remove_suffix(1);  // padding of careless writers
  if (Status status = check_text(state, text); !status) return status;
  state.json = Json::parse(text, nullptr, false);
  if (state.json.is_discarded()) {
    // Parsed once more, only to learn where it breaks.
    std::size_t byte = 0;
    try {
      const LocalJson again = Json::parse(text);
    } catch (const Json::parse_error& error) {
      byte = error.byte;
    } catch (const Json::exception&) {
      byte = 0;
    }
    return state.bad(byte > 0 ? "byte " + std::to_string(byte) + " of the JSON" : "JSON", "is not JSON");
  }
  const Json* asset = member(state.json, "asset");
  const Json* version = asset ? member(*asset, "version") : nullptr;
  if (!version || !version->is_string()) return state.bad("asset.version", "is missing: not a glTF file");
  if (!version->get_ref<const std::string&>().starts_with("2."))
    return state.unsupported("asset.version", "is " + io::shown(version->get_ref<const std::string&>()),
                             "convert it to glTF 2.0");
  const std::size_t nodes = array_of(state.json, "nodes").size();
  if (nodes > state.limits.nodes)
    return state.bad("nodes",
                     std::to_string(nodes) + " are more than the limit of " + std::to_string(state.limits.nodes),
                     "raise the limit");
  return {};
}

}  // namespace
}  // namespace gltf

using gltf::Json;

Expected<GltfContainer> gltf_container(const std::filesystem::path& path) {
  if (path == "-") return GltfContainer::binary;  // standard output
  std::string extension = path.extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (extension == ".glb" || extension == ".vrm") return GltfContainer::binary;
  if (extension == ".gltf") return GltfContainer::json;
  return Error{ErrorCode::unsupported, io::shown(extension) + " is not a glTF file", path.string(),
               "name a .glb, .gltf or .vrm file"};
}

Expected<GltfDocument> GltfDocument::read(const std::filesystem::path& path, const GltfLimits& limits,
                                          Context& context) {
  Expected<std::string> bytes = io::read_file(path, {.bytes = limits.bytes});
  if (!bytes) return bytes.error();
  return parse(std::move(*bytes), path, limits, context);
}

Expected<GltfDocument> GltfDocument::parse(std::string bytes, const std::filesystem::path& name,
                                           const GltfLimits& limits, Context& context) {
  auto state = std::make_shared<State>();
  state->name = name;
  state->bytes = bytes.size();
  state->limits = limits;
  if (std::string_view(bytes).substr(0, 4) == "glTF") {
    state->container = GltfContainer::binary;
    if (Status status = gltf::read_chunks(*state, bytes, context); !status) return status.error();
    state->text = state->chunks.front().bytes;
    bytes.clear();
  } else {
    state->text = std::move(bytes);
  }
  if (Status status = gltf::read_json(*state); !status) return status.error();
  state->buffers.resize(gltf::array_of(state->json, "buffers").size());
  if (state->chunks.size() > 1 && state->chunks[1].type == gltf::binary_chunk && !state->buffers.empty() &&
      !gltf::member(gltf::array_of(state->json, "buffers")[0], "uri")) {
    state->chunks[1].is_buffer = true;
    state->buffers[0] = {std::move(state->chunks[1].bytes), true, true};
    state->chunks[1].bytes.clear();
  }
  return GltfDocument(std::move(state));
}

GltfDocument GltfDocument::copy() const { return GltfDocument(std::make_shared<State>(*state_)); }
GltfContainer GltfDocument::container() const { return state_->container; }
std::string GltfDocument::json() const { return state_->edited ? state_->json.dump() : state_->text; }
bool GltfDocument::edited() const { return state_->edited; }

}  // namespace quadrig
