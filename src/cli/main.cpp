// The command: parses, runs one verb, and turns an Error into one line and an exit code.
#include <csignal>
#include <cstdio>
#include <new>

#include "command.hpp"

namespace {

std::atomic<bool> interrupted = false;

// The first Ctrl-C asks the running stage to stop; the second ends the process as usual.
extern "C" void on_interrupt(int signal) {
  interrupted.store(true, std::memory_order_relaxed);
  std::signal(signal, SIG_DFL);
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

Exit codes: 0 done, 1 internal error or out of memory, 2 bad option, 3 file not readable or writable,
4 unusable input, 5 not supported, 6 numeric failure, 7 a stage found no valid result, 8 cancelled,
9 done, but parts of a glTF file stay as they were or stray too far, or its count is missed.
Nothing is written unless everything is.)";

int run(int argc, char** argv) {
  using namespace quadrig;
  CLI::App app("Rigged triangle meshes to animation-ready quads.", "quadrig");
  app.footer(examples);
  app.require_subcommand(1);
  app.fallthrough();
  app.set_version_flag("--version", "quadrig " QUADRIG_VERSION);
  cli::Session session;
  auto* quiet = app.add_flag("-q,--quiet", session.quiet, "Say nothing but errors");
  app.add_flag("-v,--verbose", session.verbose, "Say what each stage found too")->excludes(quiet);
  app.add_option("--threads", session.threads, "Most threads used; 0: all the machine has. Results do not depend on it")
      ->check(CLI::Range(0, 4096))
      ->type_name("N");
  cli::Run verb;
  cli::add_remesh(app, verb);
  cli::add_field(app, verb);
  cli::add_dominance(app, verb);
  cli::add_stats(app, verb);
  cli::add_copy(app, verb);
  cli::add_sample(app, verb);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help and --version
    std::string line = error.what();
    for (char& c : line) c = c == '\n' ? ' ' : c;
    const auto verbs = app.get_subcommands();
    std::fprintf(stderr, "quadrig: %s; see quadrig%s --help\n", line.c_str(),
                 verbs.empty() ? "" : (" " + verbs.front()->get_name()).c_str());
    return cli::exit_code(ErrorCode::bad_option);
  }
  std::signal(SIGINT, on_interrupt);
  session.begin(interrupted);
  const Status status = verb(session);
  session.clear_progress();
  if (!session.quiet)
    for (const Warning& warning : session.context.warnings)
      std::fprintf(stderr, "quadrig: warning: %s: %s\n", warning.stage.c_str(), warning.text.c_str());
  if (status) return session.in_part ? 9 : 0;
  std::fprintf(stderr, "quadrig: %s\n", status.error().message().c_str());
  return cli::exit_code(status.error().code);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("quadrig: out of memory; use a smaller mesh or ask for fewer quads\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "quadrig: internal error: %s\n", error.what());
  }
  return 1;
}
