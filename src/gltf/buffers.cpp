// Buffers and their views.
#include "document.hpp"
#include "io/scan.hpp"

namespace quadrig::gltf {

Expected<std::string_view> buffer_bytes(State& state, std::size_t i) {
  const std::string where = numbered("buffers", i);
  const Expected<const Json*> json = entry(state, "buffers", i, where);
  if (!json) return json.error();
  const Expected<std::size_t> length = whole_member(state, **json, "byteLength", where);
  if (!length) return length.error();
  Buffer& buffer = state.buffers[i];
  if (!buffer.loaded) {
    const Json* uri = member(**json, "uri");
    if (!uri || !uri->is_string()) return state.bad(where, "has neither a name nor a binary chunk");
    const auto& text = uri->get_ref<const std::string&>();
    if (is_data_uri(text)) {
      Expected<std::string> bytes = decode_data_uri(state, text, where);
      if (!bytes) return bytes.error();
      buffer.bytes = std::move(*bytes);
    } else {
      const Expected<std::filesystem::path> file = relative_file(state, text, where + ".uri");
      if (!file) return file.error();
      if (++state.times_read[*file] > 16)
        return state.bad(where + ".uri", "is the file of more than 16 buffers", "let them be one buffer");
      Expected<std::string> bytes = io::read_file(*file, {.bytes = state.limits.bytes});
      if (!bytes) return bytes.error();
      buffer.bytes = std::move(*bytes);
    }
    buffer.loaded = true;
    state.bytes += buffer.bytes.size();
  }
  if (buffer.bytes.size() < *length)
    return state.bad(where, "holds " + std::to_string(buffer.bytes.size()) + " bytes of the " +
                                std::to_string(*length) + " it announces");
  return std::string_view(buffer.bytes).substr(0, *length);
}

Expected<std::string_view> view_bytes(State& state, std::size_t i, std::size_t& stride) {
  const std::string where = numbered("bufferViews", i);
  const Expected<const Json*> json = entry(state, "bufferViews", i, where);
  if (!json) return json.error();
  if (std::string name; compression_of(**json, name)) return unpacked_view(state, i, stride);
  const Expected<std::size_t> buffer = whole_member(state, **json, "buffer", where);
  if (!buffer) return buffer.error();
  const Expected<std::size_t> offset = whole_member(state, **json, "byteOffset", where, 0);
  if (!offset) return offset.error();
  const Expected<std::size_t> length = whole_member(state, **json, "byteLength", where);
  if (!length) return length.error();
  const Expected<std::size_t> step = whole_member(state, **json, "byteStride", where, 0);
  if (!step) return step.error();
  const Expected<std::string_view> bytes = buffer_bytes(state, *buffer);
  if (!bytes) return bytes.error();
  if (*offset > bytes->size() || *length > bytes->size() - *offset)
    return state.bad(
        where, "reaches beyond the " + std::to_string(bytes->size()) + " bytes of " + numbered("buffers", *buffer));
  stride = *step;
  return bytes->substr(*offset, *length);
}

}  // namespace quadrig::gltf
