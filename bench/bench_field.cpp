// The whole field call, preset by preset, and an artist's brush: new weights on a field that stands. `--full`: larger
// surfaces, and other backends beside the default. `--threads N`: of each call (default 1); then look at the time by
// the clock.
#include "bench.hpp"
#include "quadrig/field.hpp"

namespace {

using namespace quadrig;

unsigned threads = 1;

void design(benchmark::State& state, FieldPreset preset, const std::string& backend, const std::string& mesh,
            Index faces) {
  const Asset& asset = bench::sample(mesh, faces);
  FieldOptions options;
  options.preset = preset;
  options.solver = backend;
  Context context;
  context.threads = threads;
  FieldSolverReport report;
  for (auto _ : state) {
    const Connection<double> connection(asset.mesh, &context);
    const auto field = design_field(asset, connection, options, context);
    if (!field) return state.SkipWithError(field.error().message().c_str());
    report = field->report.solve;
  }
  if (!(report.residual < 1e-9)) return state.SkipWithError("the residual is above 1e-9");
  state.SetLabel(report.backend);
  state.counters["residual"] = report.residual;
  state.counters["s_assembly"] = report.assembly_seconds;
  state.counters["s_analysis"] = report.analysis_seconds;
  state.counters["s_factorization"] = report.factorization_seconds;
  state.counters["s_solve"] = report.solve_seconds;
}

/// `fixed`: the brush holds other faces at each stroke, else it changes weights.
void brush(benchmark::State& state, bool fixed, const std::string& backend, const std::string& mesh_name, Index faces) {
  const TriangleMesh<double>& mesh = bench::sample(mesh_name, faces).mesh;
  const Connection<double> connection(mesh);
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const double area = mesh.total_area();
  const std::vector<Complex> target(m, 1.0);
  std::vector<double> smoothness = dirichlet_weights(mesh), weight(m);
  for (double& each : smoothness) each *= 1e-4;
  for (std::size_t f = 0; f < m; ++f) weight[f] = mesh.area(static_cast<Index>(f)) / area;
  Context context;
  context.threads = threads;
  auto solver = FieldSolver::create(mesh, connection, solver_factory<Complex>(backend));
  if (!solver) return state.SkipWithError(solver.error().message().c_str());
  std::vector<FieldSystem::Fixed> held;
  const auto minimize = [&] {
    const FieldSystem system{
        .power = 4, .smoothness = smoothness, .target = target, .target_weight = weight, .fixed = held};
    return solver->minimize(std::span(&system, 1), context).has_value();
  };
  bool sound = minimize();
  std::size_t stroke = 0;
  for (auto _ : state) {
    const std::size_t first = 997 * ++stroke % (m - 50);
    if (fixed) {
      held.clear();
      for (std::size_t f = first; f < first + 50; ++f) held.push_back({static_cast<Index>(f), Complex(0, 1)});
      sound = minimize() && sound;
    } else {
      for (std::size_t f = first; f < first + 50; ++f) weight[f] *= 1.5;
      sound = solver->update(0, target, weight, context).has_value() && sound;
    }
  }
  if (!sound || !(solver->report().residual < 1e-9)) return state.SkipWithError("a solution failed");
  state.SetLabel(solver->report().backend);
  state.counters["residual"] = solver->report().residual;
}

}  // namespace

int main(int argc, char** argv) {
  const bool full = bench::take_flag(argc, argv, "--full");
  threads =
      static_cast<unsigned>(std::max(1, std::atoi(bench::take_value(argc, argv, "--threads").value_or("1").c_str())));
  std::vector<Index> sizes{5'000, 20'000, 100'000};
  std::vector<std::string> backends{std::string(default_solver_name)};
  if (full) {
    sizes = {20'000, 86'000, 100'000, 346'000, 1'380'000};
    for (const char* other : {"eigen/minimum-degree", "cholmod-supernodal-gpl", "cholmod-supernodal-gpl/metis"})
      if (other != default_solver_name) backends.push_back(other);
  }
  for (const std::string mesh : {"humanoid", "pear"})
    for (const Index faces : sizes)
      for (const std::string& backend : backends) {
        if (!solver_built<Complex>(backend.substr(0, backend.find('/')))) continue;
        if (mesh != "humanoid" && faces == 100'000) continue;
        const auto limited = [&](benchmark::internal::Benchmark* each) {
          each->Unit(benchmark::kMillisecond);
          if (faces > 200'000) each->Iterations(1);
        };
        for (const FieldPreset preset : {FieldPreset::standard, FieldPreset::thesis, FieldPreset::flat})
          if (preset == FieldPreset::standard || (faces <= 20'000 && backend == default_solver_name))
            limited(benchmark::RegisterBenchmark(
                bench::run_name("field_" + std::string(field_preset_name(preset)), backend, mesh, faces).c_str(),
                [=](benchmark::State& state) { design(state, preset, backend, mesh, faces); }));
        for (const bool fixed : {false, true})
          if (faces <= 100'000)
            limited(benchmark::RegisterBenchmark(
                bench::run_name(fixed ? "hold" : "update", backend, mesh, faces).c_str(),
                [=](benchmark::State& state) { brush(state, fixed, backend, mesh, faces); }));
      }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
