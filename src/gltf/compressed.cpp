// Buffer views that EXT_meshopt_compression holds.
#include "document.hpp"

#if defined(QUADRIG_WITH_MESHOPTIMIZER)
#include <meshoptimizer.h>
#endif

namespace quadrig::gltf {

const Json* compression_of(const Json& view, std::string& name) {
  if (const Json* extensions = member(view, "extensions"))
    for (const char* known : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
      if (const Json* found = member(*extensions, known)) {
        name = known;
        return found;
      }
  return nullptr;
}

#if !defined(QUADRIG_WITH_MESHOPTIMIZER)

Expected<std::string_view> unpacked_view(State& state, std::size_t i, std::size_t&) {
  std::string name;
  static_cast<void>(compression_of(array_of(state.json, "bufferViews")[i], name));
  return state.unsupported(numbered("bufferViews", i),
                           "is compressed with " + name + ", which this build does not read",
                           "decompress the file first, or build with meshoptimizer");
}

#else

namespace {

/// A member that is one of the words. \return its place among them
Expected<std::size_t> word_of(const State& state, const Json& json, const char* key, const std::string& where,
                              std::initializer_list<const char*> words, std::optional<std::size_t> fallback) {
  const Json* value = member(json, key);
  if (!value && fallback) return *fallback;
  if (value && value->is_string()) {
    std::size_t place = 0;
    for (const char* word : words) {
      if (value->get_ref<const std::string&>() == word) return place;
      ++place;
    }
  }
  return state.bad(where + "." + key, "is none that is known");
}

}  // namespace

Expected<std::string_view> unpacked_view(State& state, std::size_t i, std::size_t& stride) {
  std::string name;
  const Json& view = array_of(state.json, "bufferViews")[i];
  const Json& json = *compression_of(view, name);
  const std::string where = numbered("bufferViews", i) + ".extensions." + name;
  const Expected<std::size_t> step = whole_member(state, json, "byteStride", where);
  if (!step) return step.error();
  if (const auto found = state.unpacked.find(i); found != state.unpacked.end()) {
    stride = member(view, "byteStride") ? *step : 0;
    return std::string_view(found->second);
  }
  const Expected<std::size_t> buffer = whole_member(state, json, "buffer", where);
  if (!buffer) return buffer.error();
  const Expected<std::size_t> offset = whole_member(state, json, "byteOffset", where, 0);
  if (!offset) return offset.error();
  const Expected<std::size_t> length = whole_member(state, json, "byteLength", where);
  if (!length) return length.error();
  const Expected<std::size_t> count = whole_member(state, json, "count", where);
  if (!count) return count.error();
  const Expected<std::size_t> mode =
      word_of(state, json, "mode", where, {"ATTRIBUTES", "TRIANGLES", "INDICES"}, std::nullopt);
  if (!mode) return mode.error();
  const Expected<std::size_t> filter =
      word_of(state, json, "filter", where, {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"}, 0);
  if (!filter) return filter.error();
  const bool indices = *mode > 0;
  if (indices ? *step != 2 && *step != 4 : *step == 0 || *step > 256 || *step % 4 != 0)
    return state.bad(where + ".byteStride", "is none that the mode allows");
  if (*mode == 1 && *count % 3 != 0) return state.bad(where + ".count", "is not by three");
  if (indices ? *filter != 0 : (*filter == 1 && *step != 4 && *step != 8) || (*filter == 2 && *step != 8))
    return state.bad(where + ".filter", "does not fit the stride");
  const Expected<std::string_view> bytes = buffer_bytes(state, *buffer);
  if (!bytes) return bytes.error();
  if (*offset > bytes->size() || *length > bytes->size() - *offset)
    return state.bad(where, "reaches beyond its buffer");
  // Two bits stand for 16 bytes at the best: more than that cannot be in there.
  if (*count > (64 * *length + 4096) / *step || *count > state.limits.bytes / *step)
    return state.bad(where + ".count", "is more than its bytes can hold");
  // Of one view; all together hold less, or are the same bytes over and over.
  if (state.unpacked_bytes + *count * *step > 16 * state.bytes + (std::size_t{1} << 24))
    return state.bad(where + ".count", "is more than the bytes of the file can hold, with other views");
  std::string result(*count * *step, '\0');
  const auto* source = reinterpret_cast<const unsigned char*>(bytes->data() + *offset);
  const int failed = *mode == 0   ? meshopt_decodeVertexBuffer(result.data(), *count, *step, source, *length)
                     : *mode == 1 ? meshopt_decodeIndexBuffer(result.data(), *count, *step, source, *length)
                                  : meshopt_decodeIndexSequence(result.data(), *count, *step, source, *length);
  if (failed != 0) return state.bad(where, "cannot be decompressed");
  if (*filter == 1) meshopt_decodeFilterOct(result.data(), *count, *step);
  if (*filter == 2) meshopt_decodeFilterQuat(result.data(), *count, *step);
  if (*filter == 3) meshopt_decodeFilterExp(result.data(), *count, *step);
  stride = member(view, "byteStride") ? *step : 0;
  state.unpacked_bytes += result.size();
  return std::string_view(state.unpacked[i] = std::move(result));
}

#endif

}  // namespace quadrig::gltf
