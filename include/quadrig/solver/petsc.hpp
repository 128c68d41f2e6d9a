// PETSc's conjugate gradients and algebraic multigrid, for systems that outgrow one machine. Only with quadrig::petsc.
#pragma once

#include <petscksp.h>

#include "quadrig/solver/aggregation.hpp"
#include "quadrig/solver/backend.hpp"

namespace quadrig {

struct PetscOptions {
  double tolerance = 1e-12;  ///< of |A x − b| / |b|
  Index max_iterations = 500;
  Index direct = 1000;  ///< systems of at most this many unknowns are factored by every process for itself
};

/// Both triangles of the rows that this process has: rows [first, first + count) of a square matrix of `size` rows.
struct PetscRows {
  PetscInt size = 0, first = 0;
  std::vector<PetscInt> starts{0}, columns;
  std::vector<Complex> values;

  [[nodiscard]] PetscInt count() const { return static_cast<PetscInt>(starts.size()) - 1; }
};

/// Conjugate gradients preconditioned by PETSc's smoothed aggregation (GAMG), which is given the near-kernel: a vector
/// that is carried along the entries of the matrix, phase by phase, as the field is. Rows are spread over the processes
/// in ranges; unknowns that stand near each other should be neighbours.
///
/// As a SolverBackend every process calls with the whole system, and has the whole solution: one job, run alike on all
/// (`mpirun`). `factorize_rows` and `solve_rows` never gather: each process brings and takes its rows alone.
/// All calls are collective. \pre PETSc, in its complex build, is initialized; contexts allow one thread.
/// \cost memory and time O(nonzeros / processes). The last bits depend on the number of processes.
class PetscCg {
 public:
  using K = Complex;
  static_assert(std::is_same_v<PetscScalar, K>, "PETSc in its complex build is needed");

  explicit PetscCg(MPI_Comm processes, PetscOptions options = {}) : processes_(processes), options_(options) {}
  ~PetscCg() { clear(); }
  PetscCg(PetscCg&& other) noexcept
      : processes_(other.processes_),
        options_(other.options_),
        size_(other.size_),
        count_(other.count_),
        matrix_(std::exchange(other.matrix_, nullptr)),
        solver_(std::exchange(other.solver_, nullptr)),
        phases_(std::exchange(other.phases_, nullptr)) {}
  PetscCg(const PetscCg&) = delete;
  PetscCg& operator=(const PetscCg&) = delete;
  PetscCg& operator=(PetscCg&&) = delete;

  [[nodiscard]] static constexpr std::string_view name() { return "petsc"; }
  [[nodiscard]] std::string description() const {
    return std::string(name()) + ", " + std::to_string(process_count()) + " processes";
  }
  [[nodiscard]] int process_count() const {
    int count = 1;
    MPI_Comm_size(processes_, &count);
    return count;
  }

  /// Nothing lasts from the pattern alone. \fails bad_input where `order` is given and is not a permutation.
  Status analyze(const HermitianView<K>& A, std::span<const Index> order, Context&) {
    clear();
    return check_order(order, A.size, name());
  }

  Status factorize(const HermitianView<K>& A, Context& context) {
    const detail::SparseRows<K> full = detail::full_rows(A);
    PetscRows own;
    own.size = A.size;
    const auto [first, last] = range(A.size);
    own.first = first;
    for (PetscInt i = first; i < last; ++i) {
      const std::size_t begin = full.starts[detail::at(i)], end = full.starts[detail::at(i) + 1];
      own.columns.insert(own.columns.end(), full.columns.begin() + static_cast<std::ptrdiff_t>(begin),
                         full.columns.begin() + static_cast<std::ptrdiff_t>(end));
      own.values.insert(own.values.end(), full.values.begin() + static_cast<std::ptrdiff_t>(begin),
                        full.values.begin() + static_cast<std::ptrdiff_t>(end));
      own.starts.push_back(static_cast<PetscInt>(own.columns.size()));
    }
    return factorize_rows(own, context);
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    if (!solver_) return not_ready();
    const auto [first, last] = range(static_cast<Index>(b.size()));
    std::vector<K> own(detail::at(last - first));
    SolveInfo info = solve_rows(b.subspan(detail::at(first), own.size()), own, context);
    if (!info.status.ok()) return info;
    std::vector<int> counts(detail::at(process_count())), places(counts.size(), 0);
    const int mine = static_cast<int>(own.size());
    MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, processes_);
    for (std::size_t p = 1; p < counts.size(); ++p) places[p] = places[p - 1] + counts[p - 1];
    MPI_Allgatherv(own.data(), mine, MPI_C_DOUBLE_COMPLEX, x.data(), counts.data(), places.data(), MPI_C_DOUBLE_COMPLEX,
                   processes_);
    return info;
  }

  /// \fails bad_input where the ranges of the processes do not follow one another; numeric where a diagonal entry is
  ///   not positive, an entry is not finite, or PETSc fails; cancelled.
  Status factorize_rows(const PetscRows& rows, Context& context) {
    clear();
    if (context.cancelled()) return cancelled_error("solver petsc");
    const PetscInt begin = rows.first;
    std::array<int, 3> wrong{};  // out of place, not finite, not positive: on any process
    PetscInt before = 0;
    const PetscInt count = rows.count();
    MPI_Exscan(&count, &before, 1, MPIU_INT, MPI_SUM, processes_);
    wrong[0] = before != begin;
    for (PetscInt i = 0; i < count; ++i) {
      K diagonal{};
      for (auto e = detail::at(rows.starts[detail::at(i)]); e < detail::at(rows.starts[detail::at(i) + 1]); ++e) {
        if (!std::isfinite(std::norm(rows.values[e]))) wrong[1] = 1;
        if (rows.columns[e] == begin + i) diagonal = rows.values[e];
      }
      if (!(diagonal.real() > 0)) wrong[2] = 1;
    }
    MPI_Allreduce(MPI_IN_PLACE, wrong.data(), 3, MPI_INT, MPI_MAX, processes_);
    if (wrong[0])
      return Error{ErrorCode::bad_input, "the rows of the processes do not follow one another", "solver petsc",
                   "give process p the rows after those of process p − 1"};
    if (wrong[1] || wrong[2])
      return Error{ErrorCode::numeric, wrong[1] ? "the matrix is not finite" : "the matrix is not positive definite",
                   "solver petsc", "every unknown needs a term, or a fixed value in its component"};
    const Quiet quiet;
    size_ = rows.size;
    count_ = count;
    if (const PetscErrorCode code = set_up(rows); code != 0) {
      clear();
      return failure(code);
    }
    return {};
  }

  /// This process's part of the solution from its part of the right-hand side. \pre as many entries as it has rows
  /// \fails numeric where the iteration breaks down or does not end; cancelled.
  SolveInfo solve_rows(std::span<const K> b, std::span<K> x, Context& context) {
    if (!solver_) return not_ready();
    if (context.cancelled()) return {.status = cancelled_error("solver petsc")};
    const Quiet quiet;
    SolveInfo info;
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    if (const PetscErrorCode code = run(b, x, info, reason); code != 0) return {.status = failure(code)};
    if (std::isfinite(info.residual) && info.residual <= 1e3 * options_.tolerance) return info;
    const bool indefinite = reason == KSP_DIVERGED_INDEFINITE_MAT || reason == KSP_DIVERGED_INDEFINITE_PC;
    info.status = Error{ErrorCode::numeric,
                        indefinite ? std::string("the matrix is not positive definite")
                                   : "no convergence after " + std::to_string(info.iterations) +
                                         " iterations, residual " + std::to_string(info.residual),
                        "solver petsc", "use a direct solver"};
    return info;
  }

  /// The rows of this process where a whole system of that size is spread evenly.
  [[nodiscard]] std::pair<PetscInt, PetscInt> range(Index size) const {
    int rank = 0;
    MPI_Comm_rank(processes_, &rank);
    const auto cut = [&](int p) {
      return static_cast<PetscInt>(static_cast<std::int64_t>(size) * p / process_count());
    };
    return {cut(rank), cut(rank + 1)};
  }

 private:
  // PETSc's errors are values while one of these stands.
  struct Quiet {
    Quiet() { PetscPushErrorHandler(PetscReturnErrorHandler, nullptr); }
    ~Quiet() { PetscPopErrorHandler(); }
    Quiet(const Quiet&) = delete;
    Quiet& operator=(const Quiet&) = delete;
  };

  static SolveInfo not_ready() {
    return {.status = Error{ErrorCode::numeric, "solve without a successful factorization", "solver petsc", {}}};
  }
  static Error failure(PetscErrorCode code) {
    return {ErrorCode::numeric, "PETSc failed with code " + std::to_string(static_cast<int>(code)), "solver petsc",
            "check the matrix and the memory"};
  }

  void clear() {
    KSPDestroy(&solver_);
    MatDestroy(&matrix_);
    VecDestroy(&phases_);
  }

  PetscErrorCode set_up(const PetscRows& rows) {
    PetscCall(MatCreateMPIAIJWithArrays(processes_, count_, count_, size_, size_, rows.starts.data(),
                                        rows.columns.data(), rows.values.data(), &matrix_));
    PetscCall(MatSetOption(matrix_, MAT_HERMITIAN, PETSC_TRUE));
    PetscCall(KSPCreate(processes_, &solver_));
    PetscCall(KSPSetOperators(solver_, matrix_, matrix_));
    PetscCall(KSPSetType(solver_, KSPCG));
    PetscCall(KSPSetNormType(solver_, KSP_NORM_UNPRECONDITIONED));
    PetscCall(KSPSetTolerances(solver_, options_.tolerance, PETSC_DEFAULT, PETSC_DEFAULT, options_.max_iterations));
    PC preconditioner = nullptr;
    PetscCall(KSPGetPC(solver_, &preconditioner));
    if (size_ <= options_.direct) {
      PetscCall(PCSetType(preconditioner, PCREDUNDANT));
    } else {
      PetscCall(turn_unknowns(rows));
      PetscCall(PCSetType(preconditioner, PCGAMG));
      PetscCall(PCGAMGSetType(preconditioner, PCGAMGAGG));
      PetscCall(PCGAMGSetNSmooths(preconditioner, 0));  // smoothed ones would be complex
    }
    // The caller's own settings come first: -quadrig_ksp_view, -quadrig_pc_type, ….
    PetscCall(KSPSetOptionsPrefix(solver_, "quadrig_"));
    PetscBool chosen = PETSC_FALSE;
    PetscCall(PetscOptionsHasName(nullptr, "quadrig_", "-mg_levels_pc_type", &chosen));
    if (!chosen) PetscCall(PetscOptionsSetValue(nullptr, "-quadrig_mg_levels_pc_type", "sor"));
    PetscCall(KSPSetFromOptions(solver_));
    PetscCall(KSPSetUp(solver_));
    return 0;
  }

  // GAMG restricts by transposes, which are adjoints where its prolongations are real, and takes constants for smooth:
  // so the unknowns are turned, from row to row breadth first, by the phases of the entries between them.
  PetscErrorCode turn_unknowns(const PetscRows& rows) {
    PetscCall(MatCreateVecs(matrix_, &phases_, nullptr));
    K* value = nullptr;
    PetscCall(VecGetArray(phases_, &value));
    std::fill_n(value, count_, K{});
    std::vector<PetscInt> queue;
    for (PetscInt seed = 0; seed < count_; ++seed) {
      if (value[seed] != K{}) continue;
      value[seed] = 1;
      queue.assign(1, seed);
      for (std::size_t head = 0; head < queue.size(); ++head) {
        const PetscInt i = queue[head];
        for (auto e = detail::at(rows.starts[detail::at(i)]); e < detail::at(rows.starts[detail::at(i) + 1]); ++e) {
          const PetscInt j = rows.columns[e] - rows.first;
          const double size = std::abs(rows.values[e]);
          if (j < 0 || j >= count_ || value[j] != K{} || !(size > 0)) continue;
          value[j] = -std::conj(rows.values[e]) / size * value[i];
          queue.push_back(j);
        }
      }
    }
    PetscCall(VecRestoreArray(phases_, &value));

    // Where two ways round meet, and between processes, phases jump: sweeps of relaxation spread each jump out.
    Vec diagonal = nullptr, change = nullptr;
    PetscCall(VecDuplicate(phases_, &diagonal));
    PetscCall(VecDuplicate(phases_, &change));
    PetscCall(MatGetDiagonal(matrix_, diagonal));
    constexpr int sweeps = 60, unit_each = 10;
    for (int sweep = 1; sweep <= sweeps; ++sweep) {
      PetscCall(MatMult(matrix_, phases_, change));
      PetscCall(VecPointwiseDivide(change, change, diagonal));
      PetscCall(VecAXPY(phases_, -0.6, change));
      if (sweep % unit_each != 0) continue;
      PetscCall(VecGetArray(phases_, &value));
      for (PetscInt i = 0; i < count_; ++i) value[i] = std::abs(value[i]) > 0 ? value[i] / std::abs(value[i]) : K(1);
      PetscCall(VecRestoreArray(phases_, &value));
    }
    PetscCall(VecDestroy(&change));
    PetscCall(VecDestroy(&diagonal));
    Vec conjugates = nullptr;
    PetscCall(VecDuplicate(phases_, &conjugates));
    PetscCall(VecCopy(phases_, conjugates));
    PetscCall(VecConjugate(conjugates));
    PetscCall(MatDiagonalScale(matrix_, conjugates, phases_));
    PetscCall(VecDestroy(&conjugates));
    return 0;
  }

  PetscErrorCode run(std::span<const K> b, std::span<K> x, SolveInfo& info, KSPConvergedReason& reason) {
    Vec right = nullptr, solution = nullptr, product = nullptr;
    PetscCall(VecCreateMPIWithArray(processes_, 1, count_, size_, b.data(), &right));
    PetscCall(VecCreateMPIWithArray(processes_, 1, count_, size_, x.data(), &solution));
    PetscReal scale = 0, away = 0;
    PetscInt iterations = 0;
    if (phases_) {
      Vec turned = nullptr;
      PetscCall(VecDuplicate(right, &turned));
      PetscCall(VecCopy(phases_, turned));
      PetscCall(VecConjugate(turned));
      PetscCall(VecPointwiseMult(turned, turned, right));
      PetscCall(VecDestroy(&right));
      right = turned;
    }
    PetscCall(VecNorm(right, NORM_2, &scale));
    PetscCall(VecSet(solution, K{}));
    if (scale > 0) PetscCall(KSPSolve(solver_, right, solution));
    PetscCall(KSPGetConvergedReason(solver_, &reason));
    PetscCall(KSPGetIterationNumber(solver_, &iterations));
    PetscCall(VecDuplicate(right, &product));
    PetscCall(MatMult(matrix_, solution, product));
    PetscCall(VecAXPY(product, -1.0, right));
    PetscCall(VecNorm(product, NORM_2, &away));
    info.residual = scale > 0 ? away / scale : away;
    info.iterations = static_cast<Index>(iterations);
    if (phases_) PetscCall(VecPointwiseMult(solution, phases_, solution));
    PetscCall(VecDestroy(&product));
    PetscCall(VecDestroy(&solution));
    PetscCall(VecDestroy(&right));
    return 0;
  }

  MPI_Comm processes_;
  PetscOptions options_;
  PetscInt size_ = 0, count_ = 0;
  Mat matrix_ = nullptr;
  KSP solver_ = nullptr;
  Vec phases_ = nullptr;  // with which unknowns are turned so that neighbours agree; null on small systems
};

}  // namespace quadrig
