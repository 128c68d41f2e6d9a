#include "command.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "io/estimate.hpp"

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

Status Session::commit(FileSet& files) const {
  if (Status status = files.commit(); !status) return status;
  if (done) done->store(in_part ? 9 : 0, std::memory_order_relaxed);
  return {};
}

void Session::say(const std::string& text) const {
  if (quiet) return;
  clear_progress();
  print(text + "\n");
}

void Session::print(const std::string& bytes) const { std::fwrite(bytes.data(), 1, bytes.size(), stdout); }

Status Session::printed() const {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return {};
  if (errno == EPIPE) return {};
  return Error{ErrorCode::bad_file,
               std::string("cannot be written") + (errno ? ": " : "") + (errno ? std::strerror(errno) : ""),
               "standard output", "check where it goes"};
}

void add_input(CLI::App& verb, Input& input, const std::string& formats) {
  verb.add_option("MESH", input.files.mesh, "Surface: " + formats)->required()->type_name("");
  auto* rig = verb.add_option("--rig", input.files.rig, "Bones: .tgf")->type_name("FILE");
  auto* weights = verb.add_option("--weights", input.files.weights, "Skin weights, a column a bone: .dmat");
  weights->type_name("FILE");
  weights->needs(rig);
  verb.add_option_function<std::string>(
          "--bind",
          [&input](const std::string& name) {
            input.load.bind.emplace();
            for (const BindMethod method :
                 {BindMethod::nearest_bone, BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic})
              if (name == bind_method_name(method)) input.load.bind->method = method;
          },
          "Make the weights of a rig that comes without")
      ->check(CLI::IsMember({"voxel", "biharmonic", "nearest"}))
      ->needs(rig)
      ->excludes(weights)
      ->option_text("voxel|biharmonic|nearest (needs --rig, excludes --weights)");
  const std::string group = "Input repair";
  verb.add_flag("--strict", input.load.prepare.strict, "Refuse an input that needs repair")->group(group);
  verb.add_option("--weld", input.load.prepare.weld, "Which vertices at one position become one")
      ->transform(CLI::CheckedTransformer(
          std::vector<std::pair<std::string, Weld>>{{"never", Weld::never}, {"seams", Weld::seams}, {"all", Weld::all}},
          CLI::ignore_case))
      ->option_text("never|seams|all = seams")
      ->group(group);
  verb.add_option("--weld-distance", input.load.prepare.weld_distance, "Positions at most this far apart are one")
      ->type_name("LENGTH")
      ->group(group);
  verb.add_option("--weight-tolerance", input.load.prepare.weight_tolerance,
                  "Weights whose sum is off by at most this are rescaled")
      ->type_name("SHARE")
      ->capture_default_str()
      ->group(group);
}

Expected<LoadedAsset> load(const Input& input, Session& session) {
  session.context.progress("read", 0);
  session.expect(std::array{input.files.mesh, input.files.rig, input.files.weights}, input.quads);
  return load_asset(input.files, input.load, session.context);
}

Json report_head(std::string_view verb, const Input& input, const LoadedAsset& loaded) {
  Json report;
  report["quadrig"] = QUADRIG_VERSION;
  report["verb"] = verb;
  Json& in = report["input"];
  in["mesh"] = input.files.mesh.string();
  if (!input.files.rig.empty()) {
    in["rig"] = input.files.rig.string();
    if (input.load.bind)
      in["bind"] = bind_method_name(input.load.bind->method);
    else
      in["weights"] = input.files.weights.string();
  }
  in["vertices"] = loaded.asset.mesh.vertex_count();
  in["faces"] = loaded.asset.mesh.face_count();
  in["bones"] = loaded.asset.rig ? loaded.asset.rig->skeleton.bone_count() : 0;
  in["components"] = loaded.report.components;
  in["closed"] = loaded.asset.mesh.closed();
  in["doubled_vertices"] = loaded.report.doubled_vertices;
  in["repairs"] = loaded.report.repairs();
  return report;
}

std::string report_text(const Json& report) {
  return report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";  // names of files may be any bytes
}

Json warnings_json(std::span<const Warning> warnings) {
  Json list = Json::array();
  for (const Warning& warning : warnings) list.push_back(warning.stage + ": " + warning.text);
  return list;
}

Status declare(FileSet& files, const Input& input, std::initializer_list<std::filesystem::path> outputs) {
  for (const auto& path : {input.files.mesh, input.files.rig, input.files.weights})
    if (Status status = files.reads(path); !status) return status;
  for (const auto& path : outputs)
    if (!path.empty())
      if (Status status = files.writes(path); !status) return status;
  return {};
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
