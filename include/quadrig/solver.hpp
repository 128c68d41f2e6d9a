// Solvers of Hermitian positive definite systems, by name.
#pragma once

#include <functional>

#include "quadrig/solver/automatic.hpp"
#include "quadrig/solver/backend.hpp"
#include "quadrig/solver/simplicial.hpp"
#if defined(QUADRIG_WITH_CHOLMOD)
#include "quadrig/solver/cholmod.hpp"
#endif

namespace quadrig {

inline constexpr std::string_view default_solver_name = "automatic";

/// Every backend this version knows, built or not. The names of direct ones may be followed by the ordering that they
/// are to use: "supernodal", "supernodal-mixed" and "eigen" by "/minimum-degree" or "/dissection", else chosen by the
/// pattern; CHOLMOD's by "/metis", else its minimum degree.
[[nodiscard]] constexpr std::array<std::string_view, 7> solver_names() {
  return {"automatic",
          "supernodal",
          "supernodal-mixed",
          "eigen",
          "multigrid",
          "cholmod-simplicial-lgpl",
          "cholmod-supernodal-gpl"};
}

/// Whether a backend is part of this build, for systems of K.
template <SparseScalar K>
[[nodiscard]] constexpr bool solver_built(std::string_view name) {
  if (name == "automatic" || name == "supernodal" || name == "supernodal-mixed" || name == "eigen" ||
      name == "multigrid")
    return true;
#if defined(QUADRIG_WITH_CHOLMOD)
  if constexpr (std::is_same_v<real_of<K>, double>) {
    if (name == "cholmod-simplicial-lgpl") return true;
#if defined(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL)
    if (name == "cholmod-supernodal-gpl") return true;
#endif
  }
#endif
  return false;
}

/// Makes new backends: how users pass a backend of their own to a stage.
template <SparseScalar K>
using SolverFactory = std::function<Expected<AnySolver<K>>()>;

/// A fresh backend of the given name.
/// \fails bad_option on a name that no version knows; unsupported on a backend that is not in this build: never
///   another backend in its place.
template <SparseScalar K>
[[nodiscard]] Expected<AnySolver<K>> make_solver(std::string_view name = default_solver_name) {
  if (name == "automatic") return AnySolver<K>(AutomaticSolver<K>());
  if (name == "multigrid") return AnySolver<K>(MultigridCg<K>());
  const std::string_view backend = name.substr(0, name.find('/'));
  const std::string_view order = name.substr(backend.size());
  if (backend == "supernodal" || backend == "supernodal-mixed" || backend == "eigen") {
    std::optional<Ordering> ordering;
    if (order.empty()) ordering = Ordering::automatic;
    if (order == "/minimum-degree") ordering = Ordering::minimum_degree;
    if (order == "/dissection") ordering = Ordering::nested_dissection;
    if (!ordering)
      return Error{ErrorCode::bad_option, "there is no such ordering", "solver " + std::string(name),
                   "one of: /minimum-degree, /dissection, or none"};
    if (backend == "supernodal") return AnySolver<K>(SupernodalCholesky<K>(*ordering));
    if (backend == "supernodal-mixed") return AnySolver<K>(MixedCholesky<K>({.ordering = *ordering}));
    return AnySolver<K>(SimplicialLdlt<K>(*ordering));
  }
#if defined(QUADRIG_WITH_CHOLMOD)
  if constexpr (std::is_same_v<real_of<K>, double>) {
    const int ordering = order == "/metis" ? CHOLMOD_METIS : CHOLMOD_AMD;
    const bool ordered = order.empty() || order == "/metis";
    if (ordered && backend == "cholmod-simplicial-lgpl") return AnySolver<K>(CholmodSimplicialLgpl<K>(ordering));
#if defined(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL)
    if (ordered && backend == "cholmod-supernodal-gpl") return AnySolver<K>(CholmodSupernodalGpl<K>(ordering));
#endif
  }
#endif
  if (name == "petsc")
    return Error{ErrorCode::unsupported,
                 "PETSc's solver is not made from a name: it needs a communicator, one thread, and the same calls in "
                 "the same order on every process",
                 "solver petsc", "pass PetscCg of quadrig/solver/petsc.hpp as your own solver"};
  std::string known;
  for (const std::string_view each : solver_names()) {
    if (each == name)
      return Error{ErrorCode::unsupported, "the solver is not part of this build for this number type",
                   "solver " + std::string(name),
                   "configure with QUADRIG_WITH_CHOLMOD=ON (and _SUPERNODAL_GPL), use double, or choose automatic"};
    known += (known.empty() ? "" : ", ") + std::string(each);
  }
  return Error{ErrorCode::bad_option, "there is no such solver", "solver " + std::string(name), "one of: " + known};
}

/// The factory of a backend by name; the first call returns its error, if any.
template <SparseScalar K>
[[nodiscard]] SolverFactory<K> solver_factory(std::string_view name = default_solver_name) {
  return [name = std::string(name)] { return make_solver<K>(name); };
}

/// The solver of a job's systems, complex and real: a backend by name, or the caller's own.
struct SolverChoice {
  std::string name{default_solver_name};
  /// Used in place of `name` where set, for systems of that number type.
  SolverFactory<Complex> own_complex{};
  SolverFactory<double> own_real{};

  SolverChoice() = default;
  SolverChoice(std::string_view backend) : name(backend) {}
  SolverChoice(const std::string& backend) : name(backend) {}
  SolverChoice(const char* backend) : name(backend) {}

  template <SparseScalar K>
  [[nodiscard]] SolverFactory<K> factory() const {
    if constexpr (std::is_same_v<K, double>) {
      if (own_real) return own_real;
    } else if constexpr (std::is_same_v<K, Complex>) {
      if (own_complex) return own_complex;
    }
    return solver_factory<K>(name);
  }
};

#if defined(QUADRIG_COMPILED)
// The factorizations are costly to compile; the library has them.
extern template Expected<AnySolver<float>> make_solver<float>(std::string_view);
extern template Expected<AnySolver<std::complex<float>>> make_solver<std::complex<float>>(std::string_view);
extern template Expected<AnySolver<double>> make_solver<double>(std::string_view);
extern template Expected<AnySolver<Complex>> make_solver<Complex>(std::string_view);
#endif

}  // namespace quadrig
