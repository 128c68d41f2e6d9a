// Line densities along the two directions of a frame field, smoothed along the surface.
#pragma once

#include "quadrig/field/matching.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// Logarithms of the wanted |u| and |v| a face, and how much each face insists (per unit of area; 0: no target).
struct DensityTargets {
  std::vector<double> log_u, log_v, weight;
  std::vector<double> length{};  ///< of smoothing, a face; empty: the same everywhere
};

/// Minimizes Σ_e length² w_e |Δ log density|² + Σ_f A_f weight_f |log density − target|², w_e Dirichlet weights: across
/// an edge the density of u continues as that of u or of v, as the matching says. Targets are carried about
/// `smoothing_length` (a length, not a fraction) far. Components without targets get 0.
/// \pre one entry a face. \cost a sparse factorization with two unknowns a face.
/// \fails bad_option on a length that is not positive; numeric; as the factory does.
template <class Scalar>
[[nodiscard]] Expected<DensityTargets> smooth_log_densities(
    const TriangleMesh<Scalar>& mesh, const Matching& matching, const DensityTargets& targets, double smoothing_length,
    Context& context, const SolverFactory<Scalar>& factory = solver_factory<Scalar>());

/// Gives every frame the magnitudes exp(log_u), exp(log_v), clamped to [least, most]. \pre 0 < least ≤ most
inline void apply_densities(FrameField& frames, const DensityTargets& densities, double least, double most,
                            const Context* context = nullptr) {
  parallel_each(context, frames.u.size(), [&](std::size_t f) {
    frames.u[f] *= std::clamp(elementary::exp(densities.log_u[f]), least, most) / std::abs(frames.u[f]);
    frames.v[f] *= std::clamp(elementary::exp(densities.log_v[f]), least, most) / std::abs(frames.v[f]);
  });
}

}  // namespace quadrig
