// What the sources of the glTF layer share: the document's insides and checked access to its JSON.
#pragma once

#include <map>
#include <set>

#include "io/json.hpp"

#include "quadrig/gltf/document.hpp"

namespace quadrig {
namespace gltf {

using Json = nlohmann::ordered_json;

// The library's destructor takes memory where it may not throw, for all but empty and single values: where there is
// none the process ends. Values that are let go are emptied first.

/// Empties the value without taking memory.
void dismantle(Json& json) noexcept;
/// For local variables.
class LocalJson : public Json {
 public:
  LocalJson(Json json) noexcept : Json(std::move(json)) {}
  LocalJson(const LocalJson&) = delete;
  LocalJson& operator=(const LocalJson&) = delete;
  ~LocalJson() { dismantle(*this); }
};
/// Puts a value in the place of another.
inline void replace(Json& place, Json&& value) {
  dismantle(place);
  place = std::move(value);
}
/// An object; the values are single ones.
[[nodiscard]] Json object_of(std::initializer_list<std::pair<const char*, Json>> members);

struct Chunk {
  std::uint32_t type = 0;
  std::string bytes;       ///< as stored, with padding
  bool is_buffer = false;  ///< its bytes are those of the first buffer
};

struct Buffer {
  std::string bytes;
  bool loaded = false;
  bool embedded = false;  ///< has no name of its own: the binary chunk, or made here
};

inline constexpr std::uint32_t json_chunk = 0x4E4F534A, binary_chunk = 0x004E4942;

}  // namespace gltf

struct GltfDocument::State {
  State() = default;
  State(const State&) = default;
  State& operator=(const State&) = delete;
  ~State() { gltf::dismantle(json); }

  GltfContainer container = GltfContainer::json;
  std::filesystem::path name;
  GltfLimits limits;
  std::string text;  ///< JSON as read
  gltf::Json json;
  std::vector<gltf::Chunk> chunks;  ///< of a .glb, in order, the JSON among them
  std::vector<gltf::Buffer> buffers;
  std::map<std::size_t, std::string> unpacked;  ///< bytes of views that are stored compressed, once asked for
  std::size_t bytes = 0;                        ///< of the file and the buffers that were read
  std::size_t unpacked_bytes = 0;
  std::map<std::filesystem::path, int> times_read;  ///< of each file, as a buffer
  bool edited = false;

  [[nodiscard]] Error bad(std::string where, std::string what, std::string remedy = "export the file again") const {
    return {ErrorCode::bad_input, std::move(what), name.string() + ": " + where, std::move(remedy)};
  }
  [[nodiscard]] Error unsupported(std::string where, std::string what, std::string remedy) const {
    return {ErrorCode::unsupported, std::move(what), name.string() + ": " + where, std::move(remedy)};
  }
};

namespace gltf {

using State = GltfDocument::State;

using quadrig::detail::at;
[[nodiscard]] inline std::string numbered(std::string_view array, std::size_t i) {
  return std::string(array) + "[" + std::to_string(i) + "]";
}

/// The member, or null where it is absent or `object` is none.
[[nodiscard]] inline const Json* member(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}
/// A member that is an array, or an empty array.
[[nodiscard]] const Json& array_of(const Json& object, const char* key);
/// A whole number from 0, written as an integer or as 3.0.
[[nodiscard]] std::optional<std::size_t> whole(const Json& value);

/// The member as a whole number. \fails bad_input where it is something else; `fallback` where it is absent
[[nodiscard]] Expected<std::size_t> whole_member(const State& state, const Json& object, const char* key,
                                                 const std::string& where, std::optional<std::size_t> fallback = {});
/// An entry of an array of the document (`accessors`, `nodes`, ...). \fails bad_input where there is none
[[nodiscard]] Expected<const Json*> entry(const State& state, const char* array, std::size_t i,
                                          const std::string& where);
/// `count` numbers of an array member. \fails bad_input; nothing where it is absent
[[nodiscard]] Expected<std::optional<std::vector<double>>> number_array(const State& state, const Json& object,
                                                                        const char* key, std::size_t count,
                                                                        const std::string& where);

// uri.cpp
[[nodiscard]] Expected<std::string> decode_data_uri(const State& state, std::string_view uri, const std::string& where);
[[nodiscard]] std::string encode_base64(std::string_view bytes);
/// A relative reference and the name it stands for. What means anything in a URI, and what is no ASCII, is encoded.
[[nodiscard]] std::string percent_decoded(std::string_view text);
[[nodiscard]] std::string percent_encoded(std::string_view name);
/// The file that a relative name stands for. \fails bad_input where it has a scheme, is absolute or leaves the folder;
/// bad_file where it is hidden, or is there and is no regular file
[[nodiscard]] Expected<std::filesystem::path> relative_file(const State& state, std::string_view uri,
                                                            const std::string& where);
/// Whether the bytes begin as those of an image do.
[[nodiscard]] bool is_image(std::string_view bytes);
[[nodiscard]] inline bool is_data_uri(std::string_view uri) { return uri.starts_with("data:"); }
[[nodiscard]] inline bool has_scheme(std::string_view uri) {
  const auto colon = uri.find(':');
  return colon != std::string_view::npos && uri.find('/') > colon;
}

// buffers.cpp
/// The bytes of a buffer, loaded at first. \fails bad_input, bad_file
[[nodiscard]] Expected<std::string_view> buffer_bytes(State& state, std::size_t i);
/// The bytes of a buffer view. \fails bad_input where it is not within its buffer; unsupported where it is compressed
[[nodiscard]] Expected<std::string_view> view_bytes(State& state, std::size_t i, std::size_t& stride);

// compressed.cpp
/// The extension that compresses the view, or null, with its name.
[[nodiscard]] const Json* compression_of(const Json& view, std::string& name);
/// The bytes of a compressed view as they are without compression. \fails bad_input; unsupported in a build without
/// meshoptimizer
[[nodiscard]] Expected<std::string_view> unpacked_view(State& state, std::size_t i, std::size_t& stride);

// accessor.cpp
/// What one request has taken, in numbers of 8 bytes. It may take so many for every byte of the file, and some more:
/// what shares accessors, or has no bytes behind them, is not to cost more than a file that is as large as it pretends.
struct Budget {
  std::size_t spare = std::size_t{1} << 24, used = 0;
  static constexpr std::size_t numbers_a_byte = 16, numbers_an_unpacked_byte = 2, numbers_a_triangle = 48;
};
/// Takes rows × each numbers. \fails bad_input where that is more than the file's bytes, or the limit, allow
[[nodiscard]] Status charge(const State& state, Budget& budget, std::size_t rows, std::size_t each,
                            const std::string& where);
struct AccessorShape {
  std::size_t count = 0, components = 0, component_bytes = 0;
  int component_type = 0;
  bool normalized = false;
};
[[nodiscard]] Expected<AccessorShape> accessor_shape(const State& state, std::size_t i);
/// What a normalized integer of a component type stands for.
[[nodiscard]] double normalized_component(double value, int type);
using Values = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
/// count × components, normalized integers as numbers in [−1, 1]. \fails bad_input, unsupported
[[nodiscard]] Expected<Values> read_accessor(State& state, std::size_t i, Budget& budget);
/// Accessors that several primitives or samplers share, read once.
using Cache = std::vector<std::shared_ptr<const Values>>;
[[nodiscard]] Expected<std::shared_ptr<const Values>> read_cached(State& state, std::size_t i, Budget& budget,
                                                                  Cache& cache);

// edit.cpp
/// Appends one accessor with its view and bytes and returns its number; never sparse, aligned, bounds where asked.
struct NewAccessor {
  const char* type = "SCALAR";
  int component_type = 5126;
  std::size_t count = 0;
  std::string_view bytes;
  std::size_t row_bytes = 0;  ///< the view's stride, for vertex attributes
  int target = 0;             ///< 34962 attributes, 34963 indices, 0 neither
  std::vector<double> low, high;
};
[[nodiscard]] std::size_t append_accessor(State& state, const NewAccessor& made);
/// Every whole number within extensions and extras: what it means is unknown, so it may be any entry's.
void collect_foreign(const Json& json, bool foreign, std::set<std::size_t>& numbers);
/// The accessors that meshes, skins and animations refer to.
[[nodiscard]] std::set<std::size_t> referred_accessors(State& state);
/// Puts accessors from `first_new` on into the places of those in `before` that nothing refers to any more, so that no
/// accessor of the old surface is left; the others keep their numbers. Places left over hold a single zero.
void reuse_accessors(State& state, std::size_t first_new, const std::set<std::size_t>& before);

// compact.cpp
/// The buffer views that accessors and images refer to.
[[nodiscard]] std::set<std::size_t> referred_views(State& state);
/// Takes the bytes out that only views in `before` covered and nothing refers to any more, of buffers within the file;
/// views from `first_new` on move into their places. Where an extension refers to places of a buffer, nothing is done.
void drop_unused_bytes(State& state, std::size_t first_new, const std::set<std::size_t>& before);

/// Readies the document for a container: into a .glb the first buffer is embedded. \fails as buffer_bytes
[[nodiscard]] Status embed_first_buffer(State& state);

}  // namespace gltf
}  // namespace quadrig
