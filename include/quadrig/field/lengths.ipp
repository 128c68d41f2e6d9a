// Definitions of field/lengths.hpp.
#pragma once

#include "quadrig/field/lengths.hpp"

namespace quadrig {

template <class Scalar>
Expected<DensityTargets> smooth_log_densities(const TriangleMesh<Scalar>& mesh, const Matching& matching,
                                              const DensityTargets& targets, double smoothing_length, Context& context,
                                              const SolverFactory<Scalar>& factory) {
  if (!(smoothing_length > 0))
    return Error{ErrorCode::bad_option, "a length is positive", "densities, smoothing_length", "use an edge length"};
  const double total = static_cast<double>(mesh.total_area());
  const std::vector<double> weights = dirichlet_weights(mesh);
  const auto length = [&](Index f) {
    return targets.length.empty() ? smoothing_length : targets.length[static_cast<std::size_t>(f)];
  };
  const RowTerm smoothness{"density smoothness", [&](EmitRow<Scalar> emit) {
                             constexpr std::array<Scalar, 2> difference{1, -1};
                             for (Index h = 0; h < mesh.halfedge_count(); ++h) {
                               const Index twin = mesh.twin(h);
                               if (twin == no_index || twin < h) continue;
                               const Index odd = matching.r[static_cast<std::size_t>(h)] & 1;
                               const double factor = length(h / 3) * length(twin / 3) / total;
                               for (Index k = 0; k < 2; ++k) {
                                 const std::array<Index, 2> at{2 * (h / 3) + k, 2 * (twin / 3) + (k ^ odd)};
                                 emit(Row<Scalar>{at, difference, 0, factor * weights[static_cast<std::size_t>(h)]});
                               }
                             }
                           }};
  const RowTerm alignment{
      "density targets", [&](EmitRow<Scalar> emit) {
        constexpr std::array<Scalar, 1> one{1};
        for (Index f = 0; f < mesh.face_count(); ++f) {
          const auto i = static_cast<std::size_t>(f);
          const double share = static_cast<double>(mesh.area(f)) / total;
          for (Index k = 0; k < 2; ++k) {
            const std::array<Index, 1> at{2 * f + k};
            emit(Row<Scalar>{at, one, static_cast<Scalar>(k == 0 ? targets.log_u[i] : targets.log_v[i]),
                             share * targets.weight[i]});
            emit(Row<Scalar>{at, one, 0, 1e-6 * share});  // holds components without targets at 0
          }
        }
      }};
  QuadraticForm<Scalar> form(2 * mesh.face_count());
  if (Status status = form.assemble(context, smoothness, alignment); !status.ok()) return status.error();
  auto solver = factory();
  if (!solver) return solver.error();
  if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status.ok())
    return status.error();
  std::vector<Scalar> x(form.rhs().size());
  if (const SolveInfo info = solver->solve(form.rhs(), x, context); !info.status.ok()) return info.status.error();
  DensityTargets result = targets;
  for (std::size_t f = 0; f < result.log_u.size(); ++f) {
    result.log_u[f] = static_cast<double>(x[2 * f]);
    result.log_v[f] = static_cast<double>(x[2 * f + 1]);
  }
  return result;
}

}  // namespace quadrig
