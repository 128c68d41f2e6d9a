// The solvers on the system of a smooth cross field: ordering, analysis, factorization and solve timed apart, residual
// checked. `--full`: every size up to 1.38M faces; `--matrix FILE.mtx`: on that system instead; `--surface FILE`:
// orders of elimination on that surface, subdivided three times, too.
#include <filesystem>

#include "bench.hpp"
#include "matrix_market.hpp"
#include "quadrig/connection.hpp"
#include "quadrig/solver.hpp"
#include "quadrig/terms.hpp"
#if defined(QUADRIG_BENCH_METIS)
#include <metis.h>
#endif

namespace {

using namespace quadrig;

struct System {
  HermitianMatrix<Complex> matrix;
  std::vector<Complex> rhs;
};

/// Smoothness of fourth powers with Dirichlet weights, drawn weakly to 1: one complex unknown a face. The last is kept.
const System& field_system(const std::string& name, int levels) {
  static std::pair<std::string, int> kept_key;
  static std::unique_ptr<System> kept;
  if (kept && kept_key == std::pair(name, levels)) return *kept;
  kept.reset();
  const TriangleMesh<double>& mesh = bench::surface(name, levels);
  const Connection<double> connection(mesh);
  const std::vector<double> smoothness = dirichlet_weights(mesh);
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const double area = mesh.total_area();
  const std::vector<Complex> targets(m, 1.0);
  std::vector<double> weights(m);
  for (std::size_t f = 0; f < m; ++f) weights[f] = 1e3 * mesh.area(static_cast<Index>(f)) / area;
  QuadraticForm<Complex> form(mesh.face_count());
  const Status status = form.assemble(Smoothness<>(mesh, connection, 4, smoothness), Alignment<>(targets, weights));
  if (!status) throw std::runtime_error(status.error().message());
  const auto A = form.matrix();
  kept = std::make_unique<System>(System{{A.size,
                                          {A.column_starts.begin(), A.column_starts.end()},
                                          {A.rows.begin(), A.rows.end()},
                                          {A.values.begin(), A.values.end()}},
                                         {form.rhs().begin(), form.rhs().end()}});
  kept_key = {name, levels};
  return *kept;
}

enum class Step { analyze, factorize, solve };

/// The solver of the last run lasts for the next step, so that large systems are analyzed and factored once.
void run(benchmark::State& state, Step step, const std::string& backend, const System& system) {
  static std::string kept_name;
  static const Complex* kept_values = nullptr;
  static std::optional<AnySolver<Complex>> solver;
  static Step reached = Step::analyze;
  Context context;
  context.threads = 1;
  const HermitianView<Complex> A = system.matrix.view();
  std::vector<Complex> x(system.rhs.size());
  Status status;
  const bool kept = solver && kept_name == backend && kept_values == A.values.data();
  if (!kept || step == Step::analyze) {
    solver.reset();
    auto fresh = make_solver<Complex>(backend);
    if (!fresh) return state.SkipWithError(fresh.error().message().c_str());
    solver = std::move(*fresh);
    kept_name = backend;
    kept_values = A.values.data();
    if (step != Step::analyze) status = solver->analyze(A, {}, context);
    reached = Step::analyze;
  }
  if (step == Step::solve && status && reached == Step::analyze) status = solver->factorize(A, context);
  SolveInfo info;
  for (auto _ : state) {
    if (!status) break;
    if (step == Step::analyze) status = solver->analyze(A, {}, context);
    if (step == Step::factorize) status = solver->factorize(A, context);
    if (step == Step::solve) status = (info = solver->solve(system.rhs, x, context)).status;
  }
  if (status && step == Step::factorize) status = (info = solver->solve(system.rhs, x, context)).status;
  if (!status) return state.SkipWithError(status.error().message().c_str());
  reached = step;
  state.SetLabel(solver->description());
  state.counters["ns_a_face"] = benchmark::Counter(
      static_cast<double>(x.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  if (step == Step::analyze) return;
  const double residual = relative_residual<Complex>(A, x, system.rhs);
  if (!(residual < 1e-9)) return state.SkipWithError("the residual is above 1e-9");
  state.counters["residual"] = residual;
  state.counters["iterations"] = info.iterations;
}

/// The most memory that a first solution needs beside the matrix.
void memory(benchmark::State& state, const std::string& backend, const System& system) {
  Context context;
  context.threads = 1;
  const HermitianView<Complex> A = system.matrix.view();
  std::vector<Complex> x(system.rhs.size(), 1.0);
  auto solver = make_solver<Complex>(backend);
  if (!solver) return state.SkipWithError(solver.error().message().c_str());
  bool sound = true;
  double bytes = 0;
  for (auto _ : state)
    bytes = bench::peak_memory([&] {
      sound = solver->analyze(A, {}, context).ok() && solver->factorize(A, context).ok() &&
              solver->solve(system.rhs, x, context).status.ok();
    });
  if (!sound) return state.SkipWithError("a step failed");
  state.SetLabel(solver->description());
  state.counters["bytes_a_face"] = bytes / static_cast<double>(x.size());
}

/// Orders of elimination: seconds, and the multiplications and entries of a factor under each.
void order(benchmark::State& state, const std::string& method, const System& system) {
  const HermitianView<Complex> A = system.matrix.view();
  Context context;
  context.threads = 1;
  std::vector<Index> found;
  if (method == "metis") {
#if defined(QUADRIG_BENCH_METIS)
    const auto n = static_cast<std::size_t>(A.size);
    std::vector<std::vector<idx_t>> around(n);
    for (std::size_t j = 0; j < n; ++j)
      for (auto e = static_cast<std::size_t>(A.column_starts[j]); e < static_cast<std::size_t>(A.column_starts[j + 1]);
           ++e)
        if (A.rows[e] != static_cast<Index>(j)) {
          around[j].push_back(A.rows[e]);
          around[static_cast<std::size_t>(A.rows[e])].push_back(static_cast<idx_t>(j));
        }
    std::vector<idx_t> starts{0}, neighbors, permutation(n), inverse(n);
    for (const auto& each : around) {
      neighbors.insert(neighbors.end(), each.begin(), each.end());
      starts.push_back(static_cast<idx_t>(neighbors.size()));
    }
    auto size = static_cast<idx_t>(A.size);
    for (auto _ : state)
      METIS_NodeND(&size, starts.data(), neighbors.data(), nullptr, nullptr, permutation.data(), inverse.data());
    found.assign(permutation.begin(), permutation.end());
#endif
  } else {
    const Ordering ordering = method == "dissection" ? Ordering::nested_dissection : Ordering::minimum_degree;
    for (auto _ : state)
      found = ordering == Ordering::nested_dissection ? nested_dissection(A.size, A.column_starts, A.rows, {}, context)
                                                      : detail::minimum_degree(A.size, A.column_starts, A.rows);
  }
  detail::SymbolicBuilder builder(A.size, A.column_starts, A.rows);
  state.counters["multiplications"] = builder.multiplications(found);
  state.counters["entries"] = builder.entries();
}

struct Backend {
  const char* name;
  int largest;  // levels of subdivision
};

}  // namespace

int main(int argc, char** argv) {
  const bool full = bench::take_flag(argc, argv, "--full");
  const std::vector<Backend> backends{{"automatic", 4},
                                      {"supernodal/minimum-degree", 4},
                                      {"supernodal/dissection", 4},
                                      {"supernodal-mixed/dissection", 4},
                                      {"multigrid", 4},
                                      {"eigen/minimum-degree", 4},
                                      {"eigen/dissection", 3},
                                      {"cholmod-simplicial-lgpl", 3},
                                      {"cholmod-supernodal-gpl", 4},
                                      {"cholmod-supernodal-gpl/metis", 4}};
  const auto steps = {std::pair{"analyze", Step::analyze}, {"factorize", Step::factorize}, {"solve", Step::solve}};
  std::map<std::string, System> files;
  std::vector<std::string> surfaces;
  while (auto path = bench::take_value(argc, argv, "--surface")) surfaces.push_back(std::move(*path));
  while (const auto path = bench::take_value(argc, argv, "--matrix")) {
    auto matrix = bench::read_matrix_market(*path);
    if (!matrix) {
      std::fprintf(stderr, "%s\n", matrix.error().message().c_str());
      return 1;
    }
    const auto size = static_cast<std::size_t>(matrix->size);
    files[*path] = {std::move(*matrix), std::vector<Complex>(size, 1.0)};
  }
  const auto built = [](const Backend& backend) {
    const std::string_view name = backend.name;
    return solver_built<Complex>(name.substr(0, name.find('/')));
  };
  for (const auto& [path, system] : files)
    for (const Backend& backend : backends)
      for (const auto& [verb, step] : steps)
        if (built(backend))
          benchmark::RegisterBenchmark(
              bench::run_name(verb, backend.name, path, system.matrix.size).c_str(),
              [=, &system = system, step = step](benchmark::State& state) { run(state, step, backend.name, system); })
              ->Unit(benchmark::kMillisecond);

  std::vector<std::pair<std::string, std::vector<int>>> meshes{{"humanoid", {0, 2}}, {"pear", {0, 2}}};
  if (full) meshes = {{"pear", {0, 1, 2, 3, 4}}, {"humanoid", {3, 4}}, {"plate", {3}}, {"grid", {3}}};
  if (!files.empty()) meshes.clear();
  for (const std::string& surface : surfaces) meshes.push_back({surface, {3}});
  for (const auto& [mesh, sizes] : meshes)
    for (const int levels : sizes) {
      const Index faces = mesh.find('.') == std::string::npos ? (mesh == "plate" ? 3'328 : 5'400) << (2 * levels)
                                                              : bench::surface(mesh, levels).face_count();
      std::vector<std::string> methods{"minimum-degree", "dissection"};
#if defined(QUADRIG_BENCH_METIS)
      methods.push_back("metis");
#endif
      const auto limited = [&, levels = levels](benchmark::internal::Benchmark* each, int once_from) {
        each->Unit(benchmark::kMillisecond);
        if (levels >= once_from) each->Iterations(1);
      };
      for (const std::string& method : methods)
        limited(benchmark::RegisterBenchmark(
                    bench::run_name("order", method, std::filesystem::path(mesh).stem().string(), faces).c_str(),
                    [=, mesh = mesh](benchmark::State& state) { order(state, method, field_system(mesh, levels)); }),
                3);
      const bool orders_alone = mesh == "plate" || mesh == "grid" || mesh.find('.') != std::string::npos;
      for (const Backend& backend : backends)
        for (const auto& [verb, step] : steps)
          if (built(backend) && !orders_alone && levels <= backend.largest && (mesh == "pear" || levels < 4) &&
              (full || std::strchr(backend.name, '/') == nullptr ||
               std::strcmp(backend.name, "eigen/minimum-degree") == 0))
            limited(benchmark::RegisterBenchmark(bench::run_name(verb, backend.name, mesh, faces).c_str(),
                                                 [=, mesh = mesh, step = step](benchmark::State& state) {
                                                   run(state, step, backend.name, field_system(mesh, levels));
                                                 }),
                    step == Step::analyze ? 3 : 4);
    }
  if (full && files.empty())
    for (const int levels : {2, 3})
      for (const Backend& backend : backends)
        if (built(backend) && levels <= backend.largest)
          benchmark::RegisterBenchmark(
              bench::run_name("memory", backend.name, "pear", 5'400 << (2 * levels)).c_str(),
              [=](benchmark::State& state) { memory(state, backend.name, field_system("pear", levels)); })
              ->Unit(benchmark::kMillisecond)
              ->Iterations(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
