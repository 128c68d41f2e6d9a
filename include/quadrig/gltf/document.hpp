// A glTF file kept whole: JSON with its members in order, chunks and buffers byte for byte.
#pragma once

#include <memory>

#include "quadrig/io.hpp"

namespace quadrig {

/// What a file may ask for at most. Every offset, count, stride and size is held against these, and against the bytes
/// that the file really has, before memory is taken.
struct GltfLimits {
  std::size_t bytes = std::size_t{4} << 30;         ///< of one file
  std::size_t json_bytes = std::size_t{256} << 20;  ///< of the JSON
  std::size_t nesting = 200;                        ///< levels of arrays and objects within one another
  std::size_t values = std::size_t{1} << 28;        ///< numbers read from accessors for one request
  std::size_t nodes = 1'000'000;
  std::size_t frames = 20'000;  ///< poses sampled from all clips of a skin together
};

enum class GltfContainer : std::uint8_t {
  json,    ///< .gltf: JSON, with buffers as data URIs or files beside it
  binary,  ///< .glb, .vrm: JSON and binary chunks in one file
};
/// By the extension, .gltf, .glb or .vrm in any case. \fails unsupported on another.
[[nodiscard]] Expected<GltfContainer> gltf_container(const std::filesystem::path& path);

/// A glTF file as it is: the JSON with its members in order, and every chunk and buffer byte for byte. What is not
/// edited is written as it was read. Buffers are read when they are first asked for; only data URIs and files in the
/// document's own folder (or below it) are followed.
class GltfDocument {
 public:
  /// \fails bad_file where it cannot be read; bad_input, naming the byte or member, where it is not a glTF 2 file or
  ///   asks for more than the limits.
  [[nodiscard]] static Expected<GltfDocument> read(const std::filesystem::path& path, const GltfLimits& limits,
                                                   Context& context);
  /// The same from memory. `name` stands for the file in messages, its folder is where other files are looked for;
  /// a name without a folder refuses other files.
  [[nodiscard]] static Expected<GltfDocument> parse(std::string bytes, const std::filesystem::path& name,
                                                    const GltfLimits& limits, Context& context);

  /// A document of its own: editing one leaves the other. (Assignment makes two names for one document.)
  [[nodiscard]] GltfDocument copy() const;

  [[nodiscard]] GltfContainer container() const;
  /// The JSON as text: as it was read, until something is edited.
  [[nodiscard]] std::string json() const;
  [[nodiscard]] bool edited() const;

  /// The files that the JSON names, wherever they are and whether they are there or not: buffers, images, and what
  /// extensions name. Data URIs and other schemes than `file` are none.
  [[nodiscard]] std::vector<std::filesystem::path> named_files() const;

  /// Declares in `files` that the document and what it names are read, and that it is written to `place`; finds out
  /// what add_to would refuse before any work is done. \fails as add_to
  [[nodiscard]] Status declare(FileSet& files, const std::filesystem::path& place) const;

  /// Adds the document to `files` at `place`, by its extension .glb or .gltf, with the buffer and image files that it
  /// names where `place` is in another folder. An unedited document in its own container is written byte for byte;
  /// into .glb the first buffer becomes the binary chunk; into .gltf buffers without a name become files beside it.
  /// An image that is not there, or not in the document's folder, is told as a warning and stays where it is.
  /// \fails bad_file, also where a file that it names is hidden or no regular file; bad_input where a buffer that it
  ///   names cannot be used, or an image is none by its first bytes; as FileSet::add_beside
  [[nodiscard]] Status add_to(FileSet& files, const std::filesystem::path& place, Context& context) const;

  /// The document as one .glb in memory: what add_to writes. Images, and buffers beyond the first, that are files stay
  /// names. \fails as add_to
  [[nodiscard]] Expected<std::string> glb() const;

  struct State;
  /// For the sources of quadrig::io alone.
  [[nodiscard]] State& state() const { return *state_; }

 private:
  explicit GltfDocument(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

}  // namespace quadrig
