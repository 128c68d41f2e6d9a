// What cones cost: how much the size of quads has to vary for them.
#pragma once

#include <numbers>

#include "quadrig/energy.hpp"
#include "quadrig/mesh.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// How much the size of quads has to vary for the cones of a field: the Dirichlet energy of the conformal factor that
/// flattens the surface to them. Factorizes one Laplacian at its first use.
class ScaleEnergy {
 public:
  explicit ScaleEnergy(const TriangleMesh<double>& mesh, SolverFactory<double> factory = solver_factory<double>(),
                       const Context& context = {})
      : mesh_(mesh), factory_(std::move(factory)), context_(context.quiet(context.threads)) {}

  /// \param index4 of every vertex. Infinity where the solve fails, or is cancelled.
  [[nodiscard]] double operator()(const std::vector<Index>& index4) {
    const std::vector<double> cones = load(index4);
    std::vector<double> factor;
    if (!respond(cones, factor)) return std::numeric_limits<double>::infinity();
    double energy = 0;
    for (std::size_t v = 1; v < factor.size(); ++v) energy += cones[v] * factor[v];
    return energy;
  }
  /// What every vertex is to be flattened by: its curvature less that of its cone.
  [[nodiscard]] std::vector<double> load(const std::vector<Index>& index4) {
    if (!ready_ && !prepare()) return {};
    std::vector<double> load = curvature_;
    double sum = 0;
    Index used = 0;
    for (std::size_t v = 0; v < load.size(); ++v) {
      if (mesh_.outgoing(static_cast<Index>(v)) == no_index) continue;
      load[v] -= index4[v] * std::numbers::pi / 2;
      sum += load[v];
      ++used;
    }
    for (double& l : load) l -= sum / used;  // rounding, and borders whose field is not aligned
    return load;
  }
  /// The logarithm of the size at every vertex for a load, 0 at the first vertex. False where the solve fails, or is
  /// cancelled.
  [[nodiscard]] bool respond(const std::vector<double>& load, std::vector<double>& response) {
    if ((!ready_ && !prepare()) || load.empty()) return false;
    const std::span<const double> free_load = std::span(load).subspan(1);
    response.assign(load.size(), 0.0);
    return solver_->solve(free_load, std::span(response).subspan(1), context_).status.ok();
  }

 private:
  bool prepare() {
    ready_ = true;
    const auto n = static_cast<std::size_t>(mesh_.vertex_count());
    curvature_.assign(n, 0.0);
    form_.emplace(mesh_.vertex_count());
    form_->fix(0, 0.0);
    for (Index v = 0; v < mesh_.vertex_count(); ++v)
      if (mesh_.outgoing(v) != no_index)
        curvature_[static_cast<std::size_t>(v)] = (mesh_.on_boundary(v) ? 1 : 2) * std::numbers::pi;
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      curvature_[static_cast<std::size_t>(mesh_.origin(h))] -= mesh_.corner_angle(h);
    const RowTerm laplacian{"laplacian", [&](EmitRow<double> emit) {
                              for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
                                const std::array<Index, 2> where{mesh_.origin(h), mesh_.target(h)};
                                const std::array<double, 2> factor{1, -1};
                                emit({where, factor, 0, half_cotangent(mesh_, h)});
                              }
                            }};
    Expected<AnySolver<double>> solver = factory_();
    if (!solver || !form_->assemble(context_, laplacian).ok()) return failed();
    solver_.emplace(std::move(*solver));
    return solver_->prepare(form_->matrix(), form_->pattern_version(), context_).ok() || failed();
  }
  bool failed() {
    ready_ = false;
    return false;
  }

  const TriangleMesh<double>& mesh_;
  SolverFactory<double> factory_;
  std::vector<double> curvature_;
  std::optional<QuadraticForm<double>> form_;
  std::optional<AnySolver<double>> solver_;
  Context context_;
  bool ready_ = false;
};

}  // namespace quadrig
