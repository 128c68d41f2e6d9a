// PETSc's answers beside the others', for `mpirun`; the exit code says whether all held. With `--measure NAME LEVELS`:
// one system of a sample, spread over the processes from the start of the solve, and what it took.
#include <cstdio>
#include <cstring>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "quadrig/field.hpp"
#include "quadrig/laws.hpp"
#include "quadrig/samples.hpp"
#include "quadrig/solver/petsc.hpp"

namespace {

using namespace quadrig;

int failed = 0, rank = 0;

void check(bool held, const char* what) {
  int all = held;
  MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_MIN, PETSC_COMM_WORLD);
  if (rank == 0) std::printf("%s: %s\n", all ? "held" : "FAILED", what);
  failed += all == 0;
}

double difference(std::span<const Complex> a, std::span<const Complex> b) {
  double most = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(a[i] - b[i]));
    largest = std::max(largest, std::abs(b[i]));
  }
  return most / largest;
}

/// Smooth crosses, drawn weakly to a number: one unknown a face.
QuadraticForm<Complex> cross_system(const TriangleMesh<double>& mesh) {
  const Connection<double> connection(mesh);
  const std::vector<double> smoothness = dirichlet_weights(mesh);
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const std::vector<Complex> targets(m, 1.0);
  std::vector<double> weights(m);
  for (std::size_t f = 0; f < m; ++f) weights[f] = 1e3 * mesh.area(static_cast<Index>(f)) / mesh.total_area();
  QuadraticForm<Complex> form(mesh.face_count());
  if (!form.assemble(Smoothness<>(mesh, connection, 4, smoothness), Alignment<>(targets, weights)).ok()) ++failed;
  return form;
}

void test() {
  Context context;
  context.threads = 1;
  const Status laws =
      check_solver_backend<Complex>([] { return PetscCg(PETSC_COMM_WORLD, {.tolerance = 1e-14}); }, context, 1e-10);
  if (!laws.ok() && rank == 0) std::printf("%s\n", laws.error().message().c_str());
  check(laws.ok(), "the laws of a solver backend");

  const Asset asset = make_sample("humanoid", 20'000, context).value();
  const QuadraticForm<Complex> form = cross_system(asset.mesh);
  const auto A = form.matrix();
  std::vector<Complex> x(form.rhs().size()), wanted(x.size());
  auto direct = make_solver<Complex>("supernodal").value();
  check(direct.analyze(A, {}, context).ok() && direct.factorize(A, context).ok() &&
            direct.solve(form.rhs(), wanted, context).status.ok(),
        "a direct solution to compare with");
  PetscCg petsc(PETSC_COMM_WORLD);
  check(petsc.analyze(A, {}, context).ok() && petsc.factorize(A, context).ok(), "20,000 faces are taken");
  const SolveInfo info = petsc.solve(form.rhs(), x, context);
  if (rank == 0)
    std::printf("%s: %d iterations, residual %.1e, difference %.1e\n", petsc.description().c_str(),
                static_cast<int>(info.iterations), info.residual, difference(x, wanted));
  check(info.status.ok() && info.residual < 1e-11, "the residual is small");
  check(difference(x, wanted) < 1e-9, "the solution is the direct one, on every process");
  check(info.iterations > 2 && info.iterations < 60, "the iterations are few");

  FieldOptions options;
  options.own_solver = []() -> Expected<AnySolver<Complex>> { return AnySolver<Complex>(PetscCg(PETSC_COMM_WORLD)); };
  const Connection<double> connection(asset.mesh);
  const auto field = design_field(asset, connection, options, context);
  const auto exact = design_field(asset, connection, {}, context);
  check(field && exact && difference(field->polynomial.x0, exact->polynomial.x0) < 1e-6 &&
            field->singularities.index4 == exact->singularities.index4,
        "a whole field is that of the default solver");
}

int measure(const char* name, int faces) {
  Context context;
  context.threads = 1;
  PetscRows own;
  std::vector<Complex> right;
  PetscCg petsc(PETSC_COMM_WORLD);
  {
    const Asset asset = make_sample(name, faces, context).value();
    const QuadraticForm<Complex> form = cross_system(asset.mesh);
    const detail::SparseRows<Complex> full = detail::full_rows(form.matrix());
    const auto [first, last] = petsc.range(form.matrix().size);
    own.size = form.matrix().size;
    own.first = first;
    for (PetscInt i = first; i < last; ++i) {
      for (std::size_t e = full.starts[detail::to_size(i)]; e < full.starts[detail::to_size(i) + 1]; ++e) {
        own.columns.push_back(full.columns[e]);
        own.values.push_back(full.values[e]);
      }
      own.starts.push_back(static_cast<PetscInt>(own.columns.size()));
      right.push_back(form.rhs()[detail::to_size(i)]);
    }
  }
  std::vector<Complex> x(right.size());
  PetscLogDouble before = 0, memory = 0;
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
  PetscMemoryGetCurrentUsage(&before);
  const Stopwatch setup;
  const Status status = petsc.factorize_rows(own, context);
  const double setup_seconds = setup.seconds();
  const Stopwatch solve;
  const SolveInfo info = petsc.solve_rows(right, x, context);
  const double solve_seconds = solve.seconds();
  PetscMemoryGetCurrentUsage(&memory);
  memory -= before;
  MPI_Allreduce(MPI_IN_PLACE, &memory, 1, MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  if (rank == 0)
    std::printf("%s %d faces, %s: setup %.2f s, solve %.2f s, %d iterations, residual %.1e, %.0f bytes a face\n", name,
                static_cast<int>(own.size), petsc.description().c_str(), setup_seconds, solve_seconds,
                static_cast<int>(info.iterations), info.residual, memory / own.size);
  return status.ok() && info.status.ok() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (PetscInitialize(&argc, &argv, nullptr, nullptr) != 0) return 1;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (argc >= 4 && std::strcmp(argv[1], "--measure") == 0) {
    failed += measure(argv[2], std::atoi(argv[3]));
  } else {
    test();
    if (rank == 0) std::printf("%d failed\n", failed);
  }
  PetscFinalize();
  return failed;
}
