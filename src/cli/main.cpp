// The command: parses, runs one verb, and turns an Error into one line and an exit code.
#include <sys/time.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <new>

#include "command.hpp"
#include "profile.hpp"
#include "version.hpp"

namespace {

std::atomic<bool> interrupted = false, expired = false;
std::atomic<int> done = -1;  // Session::done

// The first of these signals asks the running stage to stop; the second ends the process as usual.
extern "C" void on_interrupt(int signal) {
  interrupted.store(true, std::memory_order_relaxed);
  std::signal(signal, SIG_DFL);
}

constexpr unsigned grace_seconds = 5;

// The time limit asks likewise, and ends the process itself where nothing has stopped after some more seconds. Nothing
// is on the disk then: while files are put in place the signal waits.
extern "C" void on_time_limit(int) {
  if (expired.exchange(true)) {
    constexpr std::string_view text = "quadrig: the time limit is over; raise --time-limit\n";
    if (write(STDERR_FILENO, text.data(), text.size()) < 0) _exit(quadrig::cli::time_limit_exit_code);
    _exit(quadrig::cli::time_limit_exit_code);
  }
  interrupted.store(true, std::memory_order_relaxed);
  alarm(grace_seconds);
}

// Libraries in use allocate where they may not throw, which ends the process by std::terminate: with the same code and
// sentence as elsewhere, where it was memory that there was not. Nothing is on the disk then.
constexpr std::string_view no_memory_text =
    "quadrig: out of memory; use a smaller mesh, ask for fewer quads or raise --memory\n";
[[noreturn]] void end_without_memory() {
  if (done >= 0) _exit(done);  // the files are in place: what is not said of them is no failure
  if (write(STDERR_FILENO, no_memory_text.data(), no_memory_text.size()) < 0)
    _exit(quadrig::cli::out_of_memory_exit_code);
  _exit(quadrig::cli::out_of_memory_exit_code);
}
void on_terminate() {
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    end_without_memory();
  } catch (...) {
  }
  std::abort();
}
__attribute__((constructor(101))) void before_all() {
  std::set_terminate(on_terminate);
}  // CLI11 allocates before main

void handle_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, on_interrupt);
  // Writing fails then, which is an error with a sentence of its own.
  for (const int signal : {SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_IGN);
}

void limit_time(double seconds) {
  std::signal(SIGALRM, on_time_limit);
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(seconds);
  timer.it_value.tv_usec = static_cast<suseconds_t>(1e6 * (seconds - std::floor(seconds)));
  setitimer(ITIMER_REAL, &timer, nullptr);
}

constexpr const char* examples = R"(Examples:
  quadrig sample humanoid -o demo
      writes demo/humanoid.obj, .tgf and .dmat: a rigged mesh to play with
  quadrig remesh arm.obj --rig arm.tgf --weights arm.dmat --quads 2000 -o quads.obj
      quads that follow the bones, with --weights-out W.dmat their skin weights too
  quadrig remesh bunny.off --quads 5000 -o quads.obj --report report.json
      without a rig: smooth quads along the curvature, and the figures as JSON
  quadrig stats quads.obj --input arm.obj
      counts, shapes, and the distance to the surface they stand for
  quadrig field arm.obj --rig arm.tgf --weights arm.dmat -o crosses.obj
      the directions alone
  quadrig pose quads.obj --rig arm.tgf --weights quads.dmat --bone bone1 --axis z --angle 60 -o bent.obj
      the quads bent, to look at

Exit codes: 0 done, 1 internal error, 2 bad option, 3 file not readable or writable, 4 unusable input,
5 not supported, 6 numeric failure, 7 a stage found no valid result, 8 cancelled, 9 done, but parts of a glTF
file stay as they were or stray too far, or its count is missed, 10 out of memory or above --memory,
12 above --time-limit.
Nothing is written unless everything is, but for a report of the error where --report asks for one.)";

/// Names like those that were given and do not exist: options of the verb, or verbs. Empty where there are none.
std::string meant(CLI::App& app, int argc, char** argv) {
  using namespace quadrig;
  std::vector<std::string> options, verbs;
  const auto add = [&](const CLI::App& one) {
    for (const CLI::Option* option : one.get_options())
      for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
  };
  add(app);
  for (const CLI::App* verb : app.get_subcommands()) add(*verb);
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; }))
    verbs.push_back(verb->get_name());
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    if (word.starts_with("--")) {
      word = word.substr(0, word.find('='));
      if (std::find(options.begin(), options.end(), word) != options.end()) continue;
      if (const std::string near = near_misses(word, options); !near.empty()) return near;
    } else if (i == 1 && app.get_subcommands().empty()) {
      return near_misses(word, verbs);
    }
  }
  return {};
}

/// Whether a file that is written beside what the verb declares may be: where there is none, or one that begins like
/// it.
bool may_replace(const std::filesystem::path& path, std::string_view begins) {
  std::error_code ignored;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path, ignored))) return true;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  std::string there(begins.size(), '\0');
  std::ifstream file(path, std::ios::binary);
  return file.read(there.data(), static_cast<std::streamsize>(there.size())) && there == begins;
}

/// Where a report was asked for, it tells of the failure. Nothing is replaced by it but a report: the run may have
/// failed before it was known which files are inputs.
void report_failure(const std::filesystem::path& path, const std::string& text) {
  if (path == "-") std::fwrite(text.data(), 1, text.size(), stdout);
  if (path.empty() || path == "-" || !may_replace(path, "{\n  \"quadrig\": ")) return;
  (void)quadrig::write_file(path, text);  // the failure itself is told already
}

/// What became of the verb, and of its profile where one was asked for: that is written whatever became of the verb,
/// and, since it may be named like an input or an output, over nothing but a profile.
std::pair<quadrig::Status, quadrig::Status> run_verb(const quadrig::cli::Run& verb, quadrig::cli::Session& session,
                                                     const std::filesystem::path& profile_path) {
  using namespace quadrig;
  if (Status status = cli::take_standard_input({}); !status) return {status, {}};
  if (profile_path.empty()) return {verb(session), {}};
  const auto refused = [&] {
    return Error{ErrorCode::bad_option, "is there, and is no profile", "--profile " + profile_path.string(),
                 "name another file"};
  };
  constexpr std::string_view begins = "{\n \"traceEvents\": ";
  if (!may_replace(profile_path, begins)) return {refused(), {}};
  FileSet files;
  if (Status status = files.writes(profile_path); !status) return {status, {}};
  cli::Profile profile;
  profile.watch(session.context);
  Status status;
  {
    const SpanTimer all(session.context, "command");
    status = verb(session);
  }
  session.context.on_span = {};
  session.say(profile.table());
  if (!may_replace(profile_path, begins)) return {status, refused()};
  if (Status added = files.add(profile_path, profile.trace()); !added) return {status, added};
  return {status, files.commit()};
}

int run(int argc, char** argv) {
  using namespace quadrig;
  CLI::App app("Rigged triangle meshes to animation-ready quads.", "quadrig");
  app.footer(examples);
  app.require_subcommand(1);
  app.fallthrough();
  app.set_version_flag("--version", cli::version_text());
  cli::Session session;
  session.done = &done;
  session.arguments.assign(argv, argv + argc);
  auto* quiet = app.add_flag("-q,--quiet", session.quiet, "Say nothing but errors");
  app.add_flag("-v,--verbose", session.verbose, "Say what each stage found too")->excludes(quiet);
  app.add_option("--threads", session.threads, "Most threads used; 0: all the machine has. Results do not depend on it")
      ->check(CLI::Range(0, 4096))
      ->type_name("N");
  double time_limit_seconds = 0;
  app.add_option("--memory", session.memory_megabytes,
                 "Most memory that may be taken; more is exit code 10. Where it is not given, by the size of the files")
      ->check(CLI::Range(16.0, 1e9))
      ->type_name("MB");
  app.add_option("--time-limit", time_limit_seconds, "Longest run; more is exit code 12")
      ->check(CLI::Range(0.001, 1e9))
      ->type_name("SECONDS");
  std::filesystem::path profile_path;
  app.add_option("--profile", profile_path,
                 "Where the time went, as trace events that Perfetto shows; a table of it goes to standard output")
      ->type_name("FILE");
  cli::Run verb;
  cli::add_remesh(app, verb);
  cli::add_field(app, verb);
  cli::add_dominance(app, verb);
  cli::add_rims(app, verb);
  cli::add_stats(app, verb);
  cli::add_pose(app, verb);
  cli::add_bind(app, verb);
  cli::add_copy(app, verb);
  cli::add_sample(app, verb);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help and --version
    std::string line = error.what();
    for (char& c : line) c = c == '\n' ? ' ' : c;
    const auto verbs = app.get_subcommands();
    if (const std::string near = meant(app, argc, argv); !near.empty()) line += "; did you mean " + near + "?";
    std::fprintf(stderr, "quadrig: %s; see quadrig%s --help\n", line.c_str(),
                 verbs.empty() ? "" : (" " + verbs.front()->get_name()).c_str());
    return cli::exit_code(ErrorCode::bad_option);
  }
  handle_signals();
  if (session.memory_megabytes > 0) cli::limit_memory(1e6 * session.memory_megabytes);
  if (time_limit_seconds > 0) limit_time(time_limit_seconds);
  session.begin(interrupted);
  const auto [status, profiled] = run_verb(verb, session, profile_path);
  session.clear_progress();
  if (!session.quiet)
    for (const Warning& warning : session.context.warnings)
      std::fprintf(stderr, "quadrig: warning: %s: %s\n", warning.stage.c_str(),
                   cli::with_stream_names(warning.text).c_str());
  if (!profiled) std::fprintf(stderr, "quadrig: warning: profile: %s\n", profiled.error().message().c_str());
  if (status) {
    // All is done: what cannot be said of it is told, and no failure.
    if (const Status printed = session.printed(); !printed)
      std::fprintf(stderr, "quadrig: warning: %s\n", printed.error().message().c_str());
    return session.in_part ? 9 : 0;
  }
  Error error = status.error();
  int code = cli::exit_code(error.code);
  if (expired && error.code == ErrorCode::cancelled) {
    error = {ErrorCode::cancelled, "the time limit is over", "", "raise --time-limit"};
    code = cli::time_limit_exit_code;
  }
  std::fprintf(stderr, "quadrig: %s\n", cli::with_stream_names(error.message()).c_str());
  const bool stopped = error.code == ErrorCode::cancelled && !expired;  // by the user, who asked for no more
  if (error.code != ErrorCode::bad_option && !stopped)
    report_failure(cli::report_path(app), cli::failure_text(error, code, session));
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    end_without_memory();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "quadrig: internal error: %s\n", error.what());
  }
  return 1;
}
