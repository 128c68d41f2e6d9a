#include "command.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

#include "io/estimate.hpp"
#include "version.hpp"

namespace quadrig::cli {

void Session::begin(const std::atomic<bool>& interrupted) {
  context.threads = threads;
  context.cancel_flag = &interrupted;
  if (verbose)
    context.on_log = [this](std::string_view line) {
      clear_progress();
      std::fprintf(stderr, "quadrig: %.*s\n", static_cast<int>(line.size()), line.data());
    };
  if (quiet || !isatty(STDERR_FILENO)) return;
  context.on_progress = [](std::string_view stage, double fraction) {
    std::fprintf(stderr, "\r\033[K%3d %%  %.*s", static_cast<int>(100 * fraction), static_cast<int>(stage.size()),
                 stage.data());
    std::fflush(stderr);
  };
}

namespace {

/// What comes in by standard input, in a file without a name that goes with the process.
struct StreamFile {
  std::FILE* file = nullptr;
  std::string name;
};
StreamFile& stream_file() {
  static StreamFile one;
  return one;
}

}  // namespace

CLI::Validator standard_input() {
  return CLI::Validator(
      [](std::string& value) -> std::string {
        if (value != "-") return {};
        StreamFile& stream = stream_file();
        if (stream.file) return "standard input (-) can be read only once";
        stream.file = std::tmpfile();
        if (!stream.file) return "no temporary file can be made for standard input";
        stream.name = "/dev/fd/" + std::to_string(fileno(stream.file));
        value = stream.name;
        return {};
      },
      "");
}

Status take_standard_input(const FileLimits& limits) {
  StreamFile& stream = stream_file();
  if (!stream.file) return {};
  const auto fail = [](std::string what, std::string remedy) {
    return Error{ErrorCode::bad_file, std::move(what), "standard input", std::move(remedy)};
  };
  std::vector<char> bytes(std::size_t{1} << 20);
  std::size_t total = 0;
  errno = 0;
  while (const std::size_t got = std::fread(bytes.data(), 1, bytes.size(), stdin)) {
    total += got;
    if (total > limits.bytes)
      return fail("is more than the limit of " + std::to_string(limits.bytes) + " bytes", "give less");
    if (std::fwrite(bytes.data(), 1, got, stream.file) != got)
      return fail(std::string("cannot be kept: ") + std::strerror(errno), "check the space for temporary files");
  }
  if (std::ferror(stdin))
    return fail(std::string("cannot be read: ") + std::strerror(errno), "check where it comes from");
  if (std::fflush(stream.file) != 0)
    return fail(std::string("cannot be kept: ") + std::strerror(errno), "check the space for temporary files");
  if (total == 0) return fail("is empty", "give a mesh");
  return {};
}

std::string with_stream_names(std::string text) {
  const std::string& name = stream_file().name;
  if (name.empty()) return text;
  for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos;) {
    const std::size_t end = at + name.size();
    if (end < text.size() && text[end] >= '0' && text[end] <= '9') {
      at = end;
      continue;
    }
    text.replace(at, name.size(), "standard input");
  }
  return text;
}

void limit_memory(double bytes) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which take what they like
  rlimit limit{};
  if (getrlimit(RLIMIT_DATA, &limit) != 0) return;
  limit.rlim_cur = static_cast<rlim_t>(std::min(bytes, static_cast<double>(limit.rlim_max)));
  setrlimit(RLIMIT_DATA, &limit);
#else
  static_cast<void>(bytes);
#endif
}

void Session::expect(std::span<const std::filesystem::path> files, double quads) const {
  if (memory_megabytes > 0) return;
  double bytes = 0;
  for (const std::filesystem::path& file : files) {
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    if (!error)
      bytes += static_cast<double>(size);
    else if (std::filesystem::exists(file, error))
      return;  // a pipe: who knows
  }
  constexpr double stack_bytes = 16e6;  // of a thread
  limit_memory(io::run_bytes(bytes, quads) + stack_bytes * context.thread_count());
}

void Session::clear_progress() const {
  if (context.on_progress) std::fputs("\r\033[K", stderr);
}

Status Session::commit(FileSet& files) {
  output_taken = output_taken || files.uses_standard_output();
  if (Status status = files.commit(); !status) return status;
  if (done) done->store(in_part ? 9 : 0, std::memory_order_relaxed);
  return {};
}

void Session::say(const std::string& text) const {
  if (quiet) return;
  clear_progress();
  if (!output_taken) return print(text + "\n");
  const std::string line = with_stream_names(text) + "\n";
  std::fwrite(line.data(), 1, line.size(), stderr);
}

// Nobody reads on: no fault of the work that is done, and none that the next call is to find.
void Session::print(const std::string& bytes) const {
  const std::string text = with_stream_names(bytes);
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stdout) < text.size() && errno == EPIPE) std::clearerr(stdout);
}

Status Session::printed() const {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return {};
  if (errno == EPIPE) {
    std::clearerr(stdout);
    return {};
  }
  return Error{ErrorCode::bad_file,
               std::string("cannot be written") + (errno ? ": " : "") + (errno ? std::strerror(errno) : ""),
               "standard output", "check where it goes"};
}

namespace {

std::string_view error_code_name(ErrorCode code) {
  switch (code) {
    case ErrorCode::bad_option:
      return "bad_option";
    case ErrorCode::bad_file:
      return "bad_file";
    case ErrorCode::bad_input:
      return "bad_input";
    case ErrorCode::unsupported:
      return "unsupported";
    case ErrorCode::numeric:
      return "numeric";
    case ErrorCode::stage_failed:
      return "stage_failed";
    case ErrorCode::cancelled:
      return "cancelled";
  }
  return {};
}

Json run_json(const Session& session) {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  Json run;
  run["arguments"] = session.arguments;
  run["build"] = version_lines();
  run["threads"] = session.context.thread_count();
  run["wall_seconds"] = session.watch.seconds();
  run["cpu_seconds"] = seconds(used.ru_utime) + seconds(used.ru_stime);
  run["peak_megabytes"] = static_cast<double>(used.ru_maxrss) / 1024;
  return run;
}

}  // namespace

std::filesystem::path report_path(const CLI::App& app) {
  const auto verbs = app.get_subcommands();
  if (verbs.empty()) return {};
  const CLI::Option* option = verbs.front()->get_option_no_throw("--report");
  return option && option->count() > 0 ? std::filesystem::path(option->results().back()) : std::filesystem::path();
}

std::string failure_text(const Error& error, int exit_code, const Session& session) {
  Json report;
  report["quadrig"] = QUADRIG_VERSION;
  report["error"] = {{"code", error_code_name(error.code)},
                     {"exit_code", exit_code},
                     {"what", error.what},
                     {"where", error.where},
                     {"remedy", error.remedy},
                     {"message", error.message()}};
  report["warnings"] = warnings_json(session.context.warnings);
  return report_text(std::move(report), session);
}

std::string report_text(Json report, const Session& session) {
  report["run"] = run_json(session);
  // Names of files may be any bytes.
  return with_stream_names(report.dump(2, ' ', false, Json::error_handler_t::replace)) + "\n";
}

Json warnings_json(std::span<const Warning> warnings) {
  Json list = Json::array();
  for (const Warning& warning : warnings) list.push_back(warning.stage + ": " + warning.text);
  return list;
}

void add_force(CLI::App& verb, bool& force) {
  verb.add_flag("--force", force,
                "Replace files beside the output that only the glTF file names: its buffers and images");
}

std::string decimals(double value, int digits) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::bad_option:
      return 2;
    case ErrorCode::bad_file:
      return 3;
    case ErrorCode::bad_input:
      return 4;
    case ErrorCode::unsupported:
      return 5;
    case ErrorCode::numeric:
      return 6;
    case ErrorCode::stage_failed:
      return 7;
    case ErrorCode::cancelled:
      return 8;
  }
  return 1;
}

}  // namespace quadrig::cli
