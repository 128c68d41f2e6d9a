// The document back into files.
#include <set>

#include "document.hpp"
#include "io/scan.hpp"

namespace quadrig {
namespace gltf {
namespace {

void put_word(std::string& bytes, std::size_t value) {
  for (std::size_t k = 0; k < 4; ++k) bytes += static_cast<char>(value >> (8 * k) & 0xffU);
}

void put_chunk(std::string& bytes, std::uint32_t type, std::string_view contents, char padding) {
  const std::size_t padded = (contents.size() + 3) / 4 * 4;
  put_word(bytes, padded);
  put_word(bytes, type);
  bytes += contents;
  bytes.append(padded - contents.size(), padding);
}

/// As stored: chunks whose length is no multiple of 4 stay so.
void put_stored(std::string& bytes, std::uint32_t type, std::string_view contents) {
  put_word(bytes, contents.size());
  put_word(bytes, type);
  bytes += contents;
}

Expected<std::string> glb_bytes(State& state, bool untouched) {
  std::string bytes = "glTF";
  put_word(bytes, 2);
  put_word(bytes, 0);
  if (untouched) {
    for (const Chunk& chunk : state.chunks)
      put_stored(bytes, chunk.type, chunk.is_buffer ? state.buffers[0].bytes : chunk.bytes);
  } else {
    put_chunk(bytes, json_chunk, state.json.dump(), ' ');
    if (!state.buffers.empty() && state.buffers[0].embedded)
      put_chunk(bytes, binary_chunk, state.buffers[0].bytes, '\0');
    for (std::size_t i = 1; i < state.chunks.size(); ++i)
      if (!state.chunks[i].is_buffer) put_stored(bytes, state.chunks[i].type, state.chunks[i].bytes);
  }
  if (bytes.size() > 0xffffffffU)
    return state.unsupported("file", "is larger than the 4 GiB that a .glb can be", "write a .gltf file");
  std::string length;
  put_word(length, bytes.size());
  bytes.replace(8, 4, length);
  return bytes;
}

/// The files that the JSON names and that belong to it, as URIs.
std::set<std::string> named_files(const Json& json, const char* array) {
  std::set<std::string> names;
  for (const Json& one : array_of(json, array))
    if (const Json* uri = member(one, "uri"); uri && uri->is_string())
      if (const auto& text = uri->get_ref<const std::string&>(); !is_data_uri(text) && !has_scheme(text))
        names.insert(text);
  return names;
}

/// A name beside the document that none of its other files has, and is remembered among them.
std::filesystem::path free_name(const std::filesystem::path& place, std::set<std::filesystem::path>& taken) {
  for (std::size_t i = 0;; ++i) {
    std::filesystem::path name = place.stem();
    if (i > 0) name += "_" + std::to_string(i);
    name += ".bin";
    if (taken.insert(name).second) return name;
  }
}

/// Puts buffers that were made here into the binary chunk, so that the file stays in one piece.
void fold_last_buffers(State& state) {
  while (state.buffers.size() > 1 && state.buffers[0].embedded && state.buffers.back().embedded) {
    const std::size_t last = state.buffers.size() - 1;
    std::string& first = state.buffers[0].bytes;
    first.append((4 - first.size() % 4) % 4, '\0');
    for (Json& view : state.json["bufferViews"])
      if (const Json* buffer = member(view, "buffer"); buffer && whole(*buffer) == last) {
        const Json* offset = member(view, "byteOffset");
        const std::size_t own = offset ? whole(*offset).value_or(0) : 0;
        view["buffer"] = 0;
        view["byteOffset"] = first.size() + own;
      }
    first += state.buffers[last].bytes;
    state.json["buffers"][0]["byteLength"] = first.size();
    dismantle(state.json["buffers"][last]);
    state.json["buffers"].erase(last);
    state.buffers.pop_back();
  }
}

}  // namespace

Status embed_first_buffer(State& state) {
  if (state.buffers.empty() || state.buffers[0].embedded) return {};
  const Expected<std::string_view> bytes = buffer_bytes(state, 0);
  if (!bytes) return bytes.error();
  state.json["buffers"][0].erase("uri");
  state.buffers[0].bytes.resize(bytes->size());
  state.buffers[0].embedded = true;
  state.edited = true;
  return {};
}

namespace {

/// The whole document as a .glb; edits it on the way.
Expected<std::string> as_glb(State& state, bool untouched) {
  if (!untouched) {
    if (Status status = embed_first_buffer(state); !status) return status.error();
    fold_last_buffers(state);
  }
  for (std::size_t i = 1; i < state.buffers.size(); ++i)
    if (state.buffers[i].embedded) {
      std::string uri = "data:application/octet-stream;base64,";
      uri += encode_base64(state.buffers[i].bytes);
      state.json["buffers"][i]["uri"] = std::move(uri);
    }
  return glb_bytes(state, untouched);
}

}  // namespace
}  // namespace gltf

Expected<std::string> GltfDocument::glb() const {
  State copy = *state_;
  return gltf::as_glb(copy, !state_->edited && state_->container == GltfContainer::binary);
}

namespace gltf {
namespace {

/// Whether the document that is at `place` has a buffer of this name: then the file is of that document alone.
bool names_buffer(const std::filesystem::path& place, const std::filesystem::path& name) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(place, ignored)) return false;
  Context quiet;
  const Expected<GltfDocument> document = GltfDocument::read(place, {}, quiet);
  if (!document) return false;
  const std::set<std::string> buffers = named_files(document->state().json, "buffers");
  return std::any_of(buffers.begin(), buffers.end(), [&](const std::string& uri) {
    return std::filesystem::path(percent_decoded(uri)).lexically_normal() == name;
  });
}

std::filesystem::path folder_of(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::weakly_canonical(path.parent_path().empty() ? "." : path.parent_path(), ignored);
}

/// Buffers without a name become files beside the document.
Status add_buffers(State& state, FileSet& files, const std::filesystem::path& place,
                   std::set<std::filesystem::path> taken) {
  for (std::size_t i = 0; i < state.buffers.size(); ++i) {
    if (!state.buffers[i].embedded) continue;
    const std::filesystem::path name = free_name(place, taken);
    const Expected<std::string_view> bytes = buffer_bytes(state, i);
    if (!bytes) return bytes.error();
    const bool own = names_buffer(place, name);
    if (Status status = own ? files.add(place.parent_path() / name, std::string(*bytes))
                            : files.add_beside(place, name, std::string(*bytes));
        !status)
      return status;
    state.json["buffers"][i]["uri"] = percent_encoded(name.string());
  }
  return {};
}

/// The files that the document names go with it into another folder. Without a buffer the copy would be broken; without
/// an image that is not there it looks as before.
Status add_named(State& state, FileSet& files, const std::filesystem::path& place, const std::set<std::string>& buffers,
                 const std::set<std::string>& images, Context& context) {
  const std::filesystem::path from = folder_of(state.name);
  if (from == folder_of(place)) return {};
  std::map<std::filesystem::path, bool> sources;  // and whether it is to be an image
  for (const std::string& name : buffers) {
    const Expected<std::filesystem::path> source = relative_file(state, name, io::shown(name));
    if (!source) return source.error();
    sources.emplace(*source, false);
  }
  for (const std::string& name : images) {
    const Expected<std::filesystem::path> source = relative_file(state, name, io::shown(name));
    std::error_code ignored;
    if (!source && source.error().code == ErrorCode::bad_file) return source.error();
    if (source && std::filesystem::exists(*source, ignored))
      sources.emplace(*source, true);
    else
      context.warn("gltf", "an image does not go with the file: " +
                               (source ? source->string() + " is not there" : source.error().message()));
  }
  for (const auto& [source, image] : sources) {
    Expected<std::string> bytes = io::read_file(source, {.bytes = state.limits.bytes});
    if (!bytes) return bytes.error();
    if (image && !is_image(*bytes))
      return state.bad(source.string(), "is named as an image and is none", "leave it out of the file");
    if (Status status = files.add_beside(place, source.lexically_relative(from), std::move(*bytes)); !status)
      return status;
  }
  return {};
}

}  // namespace
}  // namespace gltf

Status GltfDocument::declare(FileSet& files, const std::filesystem::path& place) const {
  if (Status status = files.reads(state_->name); !status) return status;
  for (const std::filesystem::path& file : named_files())
    if (Status status = files.reads(file); !status) return status;
  FileSet trial = files.trial();
  Context quiet;
  return add_to(trial, place, quiet);
}

Status GltfDocument::add_to(FileSet& files, const std::filesystem::path& place, Context& context) const {
  const Expected<GltfContainer> wanted = gltf_container(place);
  if (!wanted) return wanted.error();
  const bool untouched = !state_->edited && *wanted == state_->container;
  State copy = *state_;

  if (*wanted == GltfContainer::binary) {
    Expected<std::string> bytes = gltf::as_glb(copy, untouched);
    if (!bytes) return bytes.error();
    if (Status status = files.add(place, std::move(*bytes)); !status) return status;
  }
  const std::set<std::string> buffers = gltf::named_files(copy.json, "buffers"),
                              images = gltf::named_files(copy.json, "images");
  if (*wanted == GltfContainer::json) {
    std::set<std::filesystem::path> taken;
    for (const auto* names : {&buffers, &images})
      for (const std::string& uri : *names)
        taken.insert(std::filesystem::path(gltf::percent_decoded(uri)).lexically_normal());
    if (Status status = gltf::add_buffers(copy, files, place, std::move(taken)); !status) return status;
    for (const gltf::Chunk& chunk : copy.chunks)
      if (!chunk.is_buffer && chunk.type != gltf::json_chunk) {
        context.warn("gltf", "chunks of a .glb that are neither JSON nor its buffer have no place in a .gltf file");
        break;
      }
    if (Status status = files.add(place, untouched ? copy.text : copy.json.dump(2) + "\n"); !status) return status;
  }
  return gltf::add_named(copy, files, place, buffers, images, context);
}

}  // namespace quadrig
