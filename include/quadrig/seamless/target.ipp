#pragma once

#include "quadrig/seamless/target.hpp"

namespace quadrig {

QUADRIG_INLINE Expected<CorrectedTarget> correct_log_scale(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                           const std::vector<Index>& index,
                                                           const LogScaleOptions& options, TargetEdges target,
                                                           Context& context) {
  using detail::at;
  const Index m = mesh.face_count(), n = mesh.vertex_count();
  const auto variable = [&](Index corner, int component) {
    const Index v = mesh.origin(corner);
    const bool merged = (index[at(v)] & 1) != 0 && !mesh.on_boundary(v);
    return merged ? 2 * v : 2 * v + ((component + cut.corner_rotation[at(corner)]) & 1);
  };
  // Per face and component: mean |component of the gradient|², for weights relative to the wanted size.
  std::vector<std::array<double, 2>> strength(at(m), {0, 0});
  for (Index f = 0; f < m; ++f)
    for (int c = 0; c < 2; ++c) {
      double sum = 0;
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        const double d = c == 0 ? target[at(h)].real() : target[at(h)].imag();
        sum += d * d / std::max(static_cast<double>(mesh.edge_vector(h).squaredNorm()), 1e-300);
      }
      strength[at(f)][static_cast<std::size_t>(c)] = std::max(2 * sum / 3, 1e-300);
    }
  const double total_area = mesh.total_area();
  const RowTerm curl{
      "curl", [&](EmitRow<double> emit) {
        for (Index h = 0; h < mesh.halfedge_count(); ++h) {
          const Index g = mesh.twin(h);
          if (g < h) continue;
          const Index f = h / 3, k = g / 3;
          const Complex across = -rotated(target[at(g)], -cut.rotation[at(h)]);
          for (int c = 0; c < 2; ++c) {
            const int d = (c + cut.rotation[at(h)]) & 1;
            const double p = c == 0 ? target[at(h)].real() : target[at(h)].imag();
            const double q = c == 0 ? across.real() : across.imag();
            const double scale =
                (strength[at(f)][static_cast<std::size_t>(c)] + strength[at(k)][static_cast<std::size_t>(d)]) / 2;
            const double mean = (p + q) / 6;
            const std::array<Index, 6> where{variable(3 * f, c), variable(3 * f + 1, c), variable(3 * f + 2, c),
                                             variable(3 * k, d), variable(3 * k + 1, d), variable(3 * k + 2, d)};
            const std::array<double, 6> factor{mean, mean, mean, -mean, -mean, -mean};
            emit({where, factor, q - p, 1.5 / ((mesh.area(f) + mesh.area(k)) * scale)});
          }
        }
      }};
  const RowTerm smooth{"smoothness", [&](EmitRow<double> emit) {
                         for (Index f = 0; f < m; ++f) {
                           const double area = mesh.area(f);
                           const double longest = std::max({mesh.edge_vector(3 * f).squaredNorm(),
                                                            mesh.edge_vector(3 * f + 1).squaredNorm(),
                                                            mesh.edge_vector(3 * f + 2).squaredNorm()});
                           for (int i = 0; i < 3; ++i) {
                             const Index h = 3 * f + i;
                             const double cot = -mesh.edge_vector(mesh.next(h)).dot(mesh.edge_vector(mesh.prev(h))) /
                                                std::max(2 * area, 1e-4 * longest);
                             for (int c = 0; c < 2; ++c) {
                               const std::array<Index, 2> where{variable(h, c), variable(mesh.next(h), c)};
                               const std::array<double, 2> factor{1, -1};
                               emit({where, factor, 0, options.smoothness * cot / 2});
                             }
                           }
                         }
                       }};
  const RowTerm fidelity{
      "fidelity", [&](EmitRow<double> emit) {
        std::vector<double> mass(at(n), 0);
        for (Index h = 0; h < mesh.halfedge_count(); ++h) mass[at(mesh.origin(h))] += mesh.area(h / 3) / 3;
        for (Index v = 0; v < 2 * n; ++v) {
          const std::array<Index, 1> where{v};
          const std::array<double, 1> factor{1};
          emit({where, factor, 0, std::max(options.fidelity * mass[at(v / 2)], 1e-12 * total_area) / total_area});
        }
      }};
  QuadraticForm<double> form(2 * n);
  if (Status status = form.assemble(context, curl, smooth, fidelity); !status.ok()) return status.error();
  Expected<AnySolver<double>> solver = options.solver();
  if (!solver) return solver.error();
  if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status.ok())
    return status.error();
  std::vector<double> x(at(2 * n));
  if (SolveInfo info = solver->solve(form.rhs(), x, context); !info.status.ok()) return info.status.error();

  if (context.cancelled()) return cancelled_error("seamless map");
  std::vector<std::array<double, 2>> correction(at(m));
  std::vector<double> all;
  all.reserve(at(2 * m));
  for (Index f = 0; f < m; ++f)
    for (int c = 0; c < 2; ++c) {
      double mean = 0;
      for (Index h = 3 * f; h < 3 * f + 3; ++h) mean += x[at(variable(h, c))] / 3;
      correction[at(f)][static_cast<std::size_t>(c)] = mean;
      all.push_back(mean);
    }
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
  if (context.cancelled()) return cancelled_error("seamless map");
  const double median = all[all.size() / 2], bound = std::log(options.largest);
  for (Index h = 0; h < 3 * m; ++h) {
    const auto& [a, b] = correction[at(h / 3)];
    target[at(h)] = {target[at(h)].real() * std::exp(std::clamp(a - median, -bound, bound)),
                     target[at(h)].imag() * std::exp(std::clamp(b - median, -bound, bound))};
  }
  if (context.cancelled()) return cancelled_error("seamless map");
  return CorrectedTarget{std::move(target), solver->description()};
}

}  // namespace quadrig
