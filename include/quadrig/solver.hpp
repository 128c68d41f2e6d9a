// Solvers of Hermitian positive definite systems, by name.
#pragma once

#include <functional>

#include "quadrig/solver/backend.hpp"
#include "quadrig/solver/simplicial.hpp"
#if defined(QUADRIG_WITH_CHOLMOD)
#include "quadrig/solver/cholmod.hpp"
#endif

namespace quadrig {

inline constexpr std::string_view default_solver_name = "eigen";

/// Every backend this version knows, built or not.
[[nodiscard]] constexpr std::array<std::string_view, 3> solver_names() {
  return {"eigen", "cholmod-simplicial-lgpl", "cholmod-supernodal-gpl"};
}

/// Whether a backend is part of this build, for systems of K.
template <SparseScalar K>
[[nodiscard]] constexpr bool solver_built(std::string_view name) {
  if (name == "eigen") return true;
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

/// Makes fresh backends: what a stage takes where a user brings a backend of their own.
template <SparseScalar K>
using SolverFactory = std::function<Expected<AnySolver<K>>()>;

/// A fresh backend of the given name.
/// \fails bad_option on a name that no version knows; unsupported on a backend that is not in this build: never
///   another backend in its place.
template <SparseScalar K>
[[nodiscard]] Expected<AnySolver<K>> make_solver(std::string_view name = default_solver_name) {
  if (name == "eigen") return AnySolver<K>(SimplicialLdlt<K>());
#if defined(QUADRIG_WITH_CHOLMOD)
  if constexpr (std::is_same_v<real_of<K>, double>) {
    if (name == "cholmod-simplicial-lgpl") return AnySolver<K>(CholmodSimplicialLgpl<K>());
#if defined(QUADRIG_WITH_CHOLMOD_SUPERNODAL_GPL)
    if (name == "cholmod-supernodal-gpl") return AnySolver<K>(CholmodSupernodalGpl<K>());
#endif
  }
#endif
  std::string known;
  for (const std::string_view each : solver_names()) {
    if (each == name)
      return Error{ErrorCode::unsupported, "the solver is not part of this build for this number type",
                   "solver " + std::string(name),
                   "configure with QUADRIG_WITH_CHOLMOD=ON (and _SUPERNODAL_GPL), use double, or choose eigen"};
    known += (known.empty() ? "" : ", ") + std::string(each);
  }
  return Error{ErrorCode::bad_option, "there is no such solver", "solver " + std::string(name), "one of: " + known};
}

/// The factory of a backend by name; its error, if any, comes with the first call.
template <SparseScalar K>
[[nodiscard]] SolverFactory<K> solver_factory(std::string_view name = default_solver_name) {
  return [name = std::string(name)] { return make_solver<K>(name); };
}

}  // namespace quadrig
