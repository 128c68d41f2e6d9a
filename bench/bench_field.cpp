// The whole field call, preset by preset.
#include "bench.hpp"
#include "quadrig/field.hpp"

namespace {

using namespace quadrig;

void run(benchmark::State& state, FieldPreset preset, const std::string& mesh, Index faces) {
  const Asset& asset = bench::sample(mesh, faces);
  FieldOptions options;
  options.preset = preset;
  Context context;
  context.threads = 1;
  double residual = 0;
  for (auto _ : state) {
    const Connection<double> connection(asset.mesh);
    const auto field = design_field(asset, connection, options, context);
    if (!field) return state.SkipWithError(field.error().message().c_str());
    residual = field->report.solve.residual;
  }
  if (!(residual < 1e-9)) return state.SkipWithError("the residual is above 1e-9");
  state.counters["residual"] = residual;
}

}  // namespace

int main(int argc, char** argv) {
  for (const std::string mesh : {"humanoid", "box_torus"})
    for (const Index faces : {5'000, 20'000, 80'000})
      for (const FieldPreset preset : {FieldPreset::standard, FieldPreset::thesis, FieldPreset::flat}) {
        const std::string verb = "field_" + std::string(field_preset_name(preset));
        benchmark::RegisterBenchmark(bench::run_name(verb, "eigen", mesh, faces).c_str(), [=](benchmark::State& state) {
          run(state, preset, mesh, faces);
        })->Unit(benchmark::kMillisecond);
      }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
