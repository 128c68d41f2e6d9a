// What the verbs of the command share.
#pragma once

#include <atomic>
#include <functional>

#include <CLI/CLI.hpp>
#include "io/json.hpp"
#include "quadrig/io.hpp"

namespace quadrig::cli {

using Json = nlohmann::ordered_json;

/// One run: the context with its progress on a terminal, and what was asked for all verbs.
struct Session {
  bool quiet = false, verbose = false;
  unsigned threads = 0;
  double memory_megabytes = 0;  ///< 0: not given
  Context context;
  /// Done, but for parts that failed and stay as they were: an exit code of its own.
  bool in_part = false;
  /// The exit code once the files are in place, whatever fails then; below 0 before.
  std::atomic<int>* done = nullptr;

  /// Connects the context to the terminal and to Ctrl-C. \pre options are parsed
  void begin(const std::atomic<bool>& interrupted);
  /// Limits the memory by what a run on these files may take, unless a limit was given.
  void expect(std::span<const std::filesystem::path> files, double quads) const;
  /// Removes the progress line.
  void clear_progress() const;
  /// Puts the files in place. \fails as FileSet::commit
  [[nodiscard]] Status commit(FileSet& files) const;
  /// Text for people, on standard output.
  void say(const std::string& text) const;
  /// Bytes for programs, on standard output.
  void print(const std::string& bytes) const;
  /// Whether standard output took all of it. A reader that has closed its end has what it wanted. \fails bad_file
  [[nodiscard]] Status printed() const;
};

/// Makes allocations fail beyond that, where the system can.
void limit_memory(double bytes);

/// What main runs after the options are parsed: set by the verb that was named.
using Run = std::function<Status(Session&)>;

void add_copy(CLI::App& app, Run& run);
void add_sample(CLI::App& app, Run& run);
void add_stats(CLI::App& app, Run& run);
void add_dominance(CLI::App& app, Run& run);
void add_field(CLI::App& app, Run& run);
void add_remesh(CLI::App& app, Run& run);

/// MESH, --rig, --weights and what the door does to them.
struct Input {
  AssetFiles files;
  LoadOptions load;
  double quads = 0;  ///< to be made of it
};
void add_input(CLI::App& verb, Input& input, const std::string& formats = ".obj, .off, .ply or .stl");
/// Loads the asset. \fails as load_asset
[[nodiscard]] Expected<LoadedAsset> load(const Input& input, Session& session);

/// The head of every report: version, verb and input with its repairs.
[[nodiscard]] Json report_head(std::string_view verb, const Input& input, const LoadedAsset& loaded);
/// What is written and printed of a report.
[[nodiscard]] std::string report_text(const Json& report);
[[nodiscard]] Json warnings_json(std::span<const Warning> warnings);

/// Declares the files of the input and those outputs that have a name. \fails as FileSet::writes
[[nodiscard]] Status declare(FileSet& files, const Input& input, std::initializer_list<std::filesystem::path> outputs);
/// The option that lets files be replaced which only a document names.
void add_force(CLI::App& verb, bool& force);

/// "1 234 567" style is for nobody's parser: plain digits, a fixed number of decimals.
[[nodiscard]] std::string decimals(double value, int digits);

/// Exit codes, documented in docs/command.md: 10 and above are quadrig_status of c.h.
inline constexpr int out_of_memory_exit_code = 10, time_limit_exit_code = 12;
[[nodiscard]] int exit_code(ErrorCode code);

}  // namespace quadrig::cli
