// What the verbs of the command share.
#pragma once

#include <array>
#include <atomic>
#include <charconv>
#include <functional>

#include <CLI/CLI.hpp>
#include "io/json.hpp"
#include "quadrig/gltf/surface.hpp"
#include "quadrig/io.hpp"
#include "quadrig/seamless/strain.hpp"

namespace quadrig::cli {

using Json = nlohmann::ordered_json;

/// One run: the context with its progress on a terminal, and what was asked for all verbs.
struct Session {
  bool quiet = false, verbose = false;
  unsigned threads = 0;
  double memory_megabytes = 0;  ///< 0: not given
  Context context;
  std::vector<std::string> arguments;  ///< of the command line, with its name first
  Stopwatch watch;                     ///< since the process began
  /// Done, but for parts that failed and stay as they were: an exit code of its own.
  bool in_part = false;
  /// The exit code once the files are in place, whatever fails then; below 0 before.
  std::atomic<int>* done = nullptr;
  /// Standard output has what a verb made: text for people goes to standard error.
  bool output_taken = false;

  /// Connects the context to the terminal and to Ctrl-C. \pre options are parsed
  void begin(const std::atomic<bool>& interrupted);
  /// Limits the memory by what a run on these files may take, unless a limit was given.
  void expect(std::span<const std::filesystem::path> files, double quads) const;
  /// Removes the progress line.
  void clear_progress() const;
  /// Puts the files in place. \fails as FileSet::commit
  [[nodiscard]] Status commit(FileSet& files);
  /// Text for people, on standard output, or on standard error where that is taken.
  void say(const std::string& text) const;
  /// Bytes for programs, on standard output.
  void print(const std::string& bytes) const;
  /// Whether standard output took all of it. A reader that has closed its end has what it wanted. \fails bad_file
  [[nodiscard]] Status printed() const;
};

/// For options that name a file to read: `-` becomes a file of what comes in by standard input, once. Takes no bytes.
[[nodiscard]] CLI::Validator standard_input();
/// Takes the bytes, where an option asked for them; \fails bad_file
[[nodiscard]] Status take_standard_input(const FileLimits& limits);
/// That file called "standard input" in a text for people.
[[nodiscard]] std::string with_stream_names(std::string text);
/// Whether a name is of standard output, or has that extension.
[[nodiscard]] inline bool goes_to(const std::filesystem::path& path, std::string_view extension) {
  return path == "-" || path.extension() == extension;
}

/// Makes allocations fail beyond that, where the system can.
void limit_memory(double bytes);

/// Where the last verb's --report goes; empty where it has none.
[[nodiscard]] std::filesystem::path report_path(const CLI::App& app);
/// What main runs after the options are parsed: set by the verb that was named.
using Run = std::function<Status(Session&)>;

void add_copy(CLI::App& app, Run& run);
void add_sample(CLI::App& app, Run& run);
void add_stats(CLI::App& app, Run& run);
void add_dominance(CLI::App& app, Run& run);
void add_field(CLI::App& app, Run& run);
void add_remesh(CLI::App& app, Run& run);
void add_bind(CLI::App& app, Run& run);
void add_pose(CLI::App& app, Run& run);
void add_rims(CLI::App& app, Run& run);

/// By the extension, or by how it begins: "glTF" is a binary one whatever its name.
[[nodiscard]] bool is_gltf(const std::filesystem::path& path);
inline constexpr const char* all_formats = ".obj, .off, .ply or .stl, or a glTF file: .glb, .gltf or .vrm";

/// MESH, --rig, --weights and what the door does to them.
struct Input {
  AssetFiles files;
  LoadOptions load;
  GltfSelection selection;  ///< of a glTF file
  bool clips = false;       ///< of a glTF file: sample them
  double quads = 0;         ///< to be made of it
};
void add_input(CLI::App& verb, Input& input, const std::string& formats = all_formats);
/// An option that takes a method's name.
CLI::Option* add_bind_method(CLI::App& verb, const std::string& name, std::function<void(BindMethod)> set,
                             const std::string& text);
void add_selection(CLI::App& verb, GltfSelection& selection,
                   const std::string& text = "Of a glTF file: the mesh, node, material or skin; may be repeated",
                   const std::string& group = {});
/// The document; the files that it names are declared as inputs. \fails as GltfDocument::read and FileSet::reads
[[nodiscard]] Expected<GltfDocument> read_document(const std::filesystem::path& path, FileSet& files, Session& session);
/// Loads the asset; of a glTF file the largest surface chosen, and the files that it names are declared as inputs.
/// \fails as load_asset, gltf_surfaces and FileSet::reads
[[nodiscard]] Expected<LoadedAsset> load(const Input& input, FileSet& files, Session& session);

/// The head of every report: version, verb and input with its repairs.
[[nodiscard]] Json report_head(std::string_view verb, const Input& input, const LoadedAsset& loaded);
/// What is written and printed of a report: it, and `run`, what ran and what it took so far.
[[nodiscard]] std::string report_text(Json report, const Session& session);
/// What is written at the place of the report where the run ends by an error.
[[nodiscard]] std::string failure_text(const Error& error, int exit_code, const Session& session);
[[nodiscard]] Json warnings_json(std::span<const Warning> warnings);
[[nodiscard]] Json curl_json(const CurlReport& curl);

/// Declares the files of the input and those outputs that have a name. \fails as FileSet::writes
[[nodiscard]] Status declare(FileSet& files, const Input& input, std::initializer_list<std::filesystem::path> outputs);
/// The option that lets files be replaced which only a document names.
void add_force(CLI::App& verb, bool& force);

/// A space and the shortest digits that read back as the same number.
template <class Number>
void put_number(std::string& text, Number value) {
  std::array<char, 32> digits;
  text += ' ';
  text.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
}
inline void put_numbers(std::string& text, const Vector3& v) {
  for (int i = 0; i < 3; ++i) put_number(text, v[i]);
}

/// "1 234 567" style is for nobody's parser: plain digits, a fixed number of decimals.
[[nodiscard]] std::string decimals(double value, int digits);

/// Exit codes, documented in docs/command.md: 10 and above are quadrig_status of c.h.
inline constexpr int out_of_memory_exit_code = 10, time_limit_exit_code = 12;
[[nodiscard]] int exit_code(ErrorCode code);

}  // namespace quadrig::cli
