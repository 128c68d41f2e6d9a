// The solvers on the system of a smooth cross field: analysis, factorization and solve timed apart, residual checked.
#include "bench.hpp"
#include "quadrig/connection.hpp"
#include "quadrig/solver.hpp"
#include "quadrig/terms.hpp"

namespace {

using namespace quadrig;

/// Smoothness of fourth powers with Dirichlet weights, drawn weakly to 1: one complex unknown a face.
class System {
 public:
  System(const std::string& mesh_name, Index faces) : form_(0) {
    const TriangleMesh<double>& mesh = bench::sample(mesh_name, faces).mesh;
    const Connection<double> connection(mesh);
    const std::vector<double> smoothness = dirichlet_weights(mesh);
    const auto m = static_cast<std::size_t>(mesh.face_count());
    const std::vector<Complex> targets(m, 1.0);
    std::vector<double> weights(m);
    for (std::size_t f = 0; f < m; ++f) weights[f] = 1e3 * mesh.area(static_cast<Index>(f)) / mesh.total_area();
    form_ = QuadraticForm<Complex>(mesh.face_count());
    const Status status = form_.assemble(Smoothness<>(mesh, connection, 4, smoothness), Alignment<>(targets, weights));
    if (!status) throw std::runtime_error(status.error().message());
  }
  [[nodiscard]] HermitianView<Complex> matrix() const { return form_.matrix(); }
  [[nodiscard]] std::span<const Complex> rhs() const { return form_.rhs(); }

  static const System& get(const std::string& mesh, Index faces) {
    static std::map<std::pair<std::string, Index>, std::unique_ptr<System>> made;
    auto& system = made[{mesh, faces}];
    if (!system) system = std::make_unique<System>(mesh, faces);
    return *system;
  }

 private:
  QuadraticForm<Complex> form_;
};

enum class Step { analyze, factorize, solve };

void run(benchmark::State& state, Step step, const std::string& backend, const std::string& mesh, Index faces) {
  const System& system = System::get(mesh, faces);
  Context context;
  context.threads = 1;
  auto solver = make_solver<Complex>(backend);
  if (!solver) return state.SkipWithError(solver.error().message().c_str());
  std::vector<Complex> x(system.rhs().size());
  Status status = solver->analyze(system.matrix(), {}, context);
  if (status) status = solver->factorize(system.matrix(), context);
  if (status) status = solver->solve(system.rhs(), x, context).status;
  if (!status) return state.SkipWithError(status.error().message().c_str());
  for (auto _ : state) {
    if (step == Step::analyze) benchmark::DoNotOptimize(solver->analyze(system.matrix(), {}, context).ok());
    if (step == Step::factorize) benchmark::DoNotOptimize(solver->factorize(system.matrix(), context).ok());
    if (step == Step::solve) benchmark::DoNotOptimize(solver->solve(system.rhs(), x, context).status.ok());
  }
  const double residual = relative_residual<Complex>(system.matrix(), x, system.rhs());
  if (!(residual < 1e-9)) return state.SkipWithError("the residual is above 1e-9");
  state.counters["residual"] = residual;
  state.counters["unknowns"] = static_cast<double>(x.size());
  state.counters["ns_a_face"] = benchmark::Counter(
      static_cast<double>(x.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

}  // namespace

int main(int argc, char** argv) {
  for (const std::string mesh : {"humanoid", "box_torus"})
    for (const Index faces : {5'000, 20'000, 80'000})
      for (const std::string_view name : solver_names()) {
        if (!solver_built<Complex>(name)) continue;
        const std::string backend(name);
        for (const auto& [verb, step] :
             {std::pair{"analyze", Step::analyze}, {"factorize", Step::factorize}, {"solve", Step::solve}})
          benchmark::RegisterBenchmark(
              bench::run_name(verb, backend, mesh, faces).c_str(),
              [=, step = step](benchmark::State& state) { run(state, step, backend, mesh, faces); })
              ->Unit(benchmark::kMillisecond);
      }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
