// The whole way from an asset to quads, with the seconds of each stage as counters. `--full`: larger surfaces, and
// Eigen's solver beside the default.
#include "bench.hpp"
#include "quadrig/pipeline.hpp"

namespace {

using namespace quadrig;

void run(benchmark::State& state, const std::string& backend, const std::string& mesh, Index faces, Index quads) {
  const Asset& asset = bench::sample(mesh, faces);
  RemeshOptions options;
  options.quads = quads;
  options.solver = backend;
  StageSeconds seconds;
  for (auto _ : state) {
    Context context;
    context.threads = 1;
    const auto result = remesh(asset, options, context);
    if (!result) return state.SkipWithError(result.error().message().c_str());
    seconds = result->report.seconds;
    state.counters["quads"] = result->report.quads;
  }
  state.counters["s_metric"] = seconds.metric;
  state.counters["s_pieces"] = seconds.pieces;
  state.counters["s_field"] = seconds.field;
  state.counters["s_map"] = seconds.map;
  state.counters["s_integers"] = seconds.integers;
  state.counters["s_extraction"] = seconds.extraction;
  state.counters["s_polish"] = seconds.polish;
  state.counters["s_transfer"] = seconds.transfer;
}

}  // namespace

int main(int argc, char** argv) {
  const bool full = bench::take_flag(argc, argv, "--full");
  const std::vector<Index> sizes = full ? std::vector<Index>{20'000, 80'000} : std::vector<Index>{20'000};
  std::vector<std::string> backends{std::string(default_solver_name)};
  if (full) backends.push_back("eigen/minimum-degree");
  for (const std::string mesh : {"humanoid", "box_torus", "pear", "wing"})
    for (const Index faces : sizes)
      for (const Index quads : {2'000, 8'000})
        for (const std::string& backend : backends)
          benchmark::RegisterBenchmark(bench::run_name("remesh_" + std::to_string(quads), backend, mesh, faces).c_str(),
                                       [=](benchmark::State& state) { run(state, backend, mesh, faces, quads); })
              ->Unit(benchmark::kMillisecond);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
