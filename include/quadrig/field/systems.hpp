// The linear systems of fields: one unknown a face, one pattern, one analysis for all of them.
#pragma once

#include "quadrig/field/frames.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// The energy of one complex number a face that transforms like the `power`-th power of a direction:
/// Σ_e smoothness |z_f ē_f^n − z_g ē_g^n|² + Σ_f target_weight |z − target|² + Σ_f shrink |z|² + own terms.
/// Targets, weights and results are double whatever the Scalar of the mesh, the matrices and the factors.
/// \pre spans outlive the call; smoothness has one entry a half-edge, the others one a face; shrink may be empty.
template <class Scalar>
struct BasicFieldSystem {
  int power = 4;
  std::span<const double> smoothness;
  std::span<const Complex> target;
  std::span<const double> target_weight;
  std::span<const double> shrink = {};
  std::span<const AnyTerm<std::complex<Scalar>>> own_terms = {};

  /// Faces held, and their values.
  struct Fixed {
    Index face;
    Complex value;
  };
  std::span<const Fixed> fixed = {};

  /// Components (numbers ≥ 0, one a face, no_index elsewhere) that nothing pins: there z is the eigenvector of the
  /// smallest eigenvalue of the smoothness against `mass`, by inverse iteration from `start`, its mean square 1.
  std::span<const Index> unpinned = {};
  std::span<const double> mass = {};
  std::span<const Complex> start = {};
};
using FieldSystem = BasicFieldSystem<double>;

/// Sums over all calls.
struct FieldSolverReport {
  double assembly_seconds = 0, analysis_seconds = 0, factorization_seconds = 0, solve_seconds = 0;
  double residual = 0;  ///< largest relative residual of the systems
  Index inverse_iterations = 0;
  Index analyses = 0;
  std::string backend;  ///< what the backend chose at its last analysis: "supernodal, minimum degree"
};

/// Solves field systems on one mesh. The analysis lasts as long as the pattern does (the same fixed faces, the same
/// own terms), over all systems and calls: new weights and targets cost a refill and a factorization. Where other faces
/// are fixed the order of elimination lasts, and what follows from it is found anew.
/// Scalar is float or double: float halves the memory of matrices and factors and leaves about five digits.
/// \pre mesh and connection outlive the solver.
template <class Scalar>
class BasicFieldSolver {
 public:
  using K = std::complex<Scalar>;
  using System = BasicFieldSystem<Scalar>;

  /// \fails as the factory does
  [[nodiscard]] static Expected<BasicFieldSolver> create(const TriangleMesh<Scalar>& mesh,
                                                         const Connection<Scalar>& connection,
                                                         SolverFactory<K> factory = solver_factory<K>());

  /// Minimizes each system; the k-th result belongs to the k-th system. Systems are factored side by side where the
  /// context allows more than one thread; the bits of the results do not depend on that.
  /// \cost O(m) to refill, a sparse factorization each. \fails numeric where a system is singular; cancelled.
  [[nodiscard]] Expected<std::vector<std::vector<Complex>>> minimize(std::span<const System> systems, Context& context);

  /// The k-th system of the last `minimize` with other targets and weights, one a face: what an artist's brush calls.
  /// The result is that of a whole `minimize`, bit for bit; systems with unpinned components are not for this.
  /// \pre that call succeeded, and what update was given before has too. \cost O(m), a factorization and a solve: no
  /// assembly, no analysis. \fails numeric where the system becomes singular; cancelled.
  [[nodiscard]] Expected<std::vector<Complex>> update(std::size_t k, std::span<const Complex> target,
                                                      std::span<const double> target_weight, Context& context);

  /// `minimize` up to its solutions: for `improve`. \fails and \cost as minimize
  [[nodiscard]] Status prepare(std::span<const System> systems, Context& context);

  /// The k-th system of the last `minimize`, `prepare` or `update` with numbers added to its right-hand side, one a
  /// face, no assembly and no factorization: from the z given until the residual is within `tolerance` where the
  /// backend iterates, else the solution. \pre that call succeeded; fixed faces have their values in z. \cost one
  /// solve. \fails numeric; cancelled.
  [[nodiscard]] Status improve(std::size_t k, std::span<const Complex> added_rhs, double tolerance,
                               std::vector<Complex>& z, Context& context);

  [[nodiscard]] const FieldSolverReport& report() const { return report_; }

 private:
  struct Slot {
    QuadraticForm<K> form;
    std::optional<AnySolver<K>> solver;
    std::uint64_t version = 0;
    // Of the free unknowns without their targets.
    std::vector<Scalar> diagonal;
    std::vector<K> rhs;
  };

  BasicFieldSolver(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection, SolverFactory<K> factory)
      : mesh_(&mesh), connection_(&connection), factory_(std::move(factory)) {}

  Status assemble(Slot& slot, const System& system, const Context& context);
  [[nodiscard]] Status add_targets(Slot& slot, std::span<const Complex> target, std::span<const double> weight);
  [[nodiscard]] std::vector<Index> lasting_order(const QuadraticForm<K>& form) const;
  Status analyze(Slot& slot, Context& context);
  template <class Body>
  static void each_of(std::size_t count, Context& context, Body&& body);

  const TriangleMesh<Scalar>* mesh_;
  const Connection<Scalar>* connection_;
  SolverFactory<K> factory_;
  std::vector<Slot> slots_;
  std::vector<Index> face_order_;  // in which the backend eliminated them, if it provides that
  // The pattern of the last analysis, and a solver that holds it, unfactored.
  std::vector<Index> column_starts_, rows_;
  std::optional<AnySolver<K>> analyzed_;
  std::vector<K> rhs_, unknowns_;  // of `improve`, kept for the next
  FieldSolverReport report_;
};
using FieldSolver = BasicFieldSolver<double>;

#if defined(QUADRIG_COMPILED)
extern template class BasicFieldSolver<float>;
extern template class BasicFieldSolver<double>;
#endif

}  // namespace quadrig
