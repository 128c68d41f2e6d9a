#pragma once

#include "quadrig/seamless/target.hpp"

namespace quadrig {

namespace detail {

/// The rows of correct_log_scale: two unknowns a vertex, the logarithms of the two lengths.
class LogScaleRows {
 public:
  LogScaleRows(const TriangleMesh<double>& mesh, const CutGraph& cut, const std::vector<Index>& index,
               const TargetEdges& target)
      : mesh_(mesh), cut_(cut), index_(index), target_(target), strength_(at(mesh.face_count()), {0, 0}) {
    for (Index f = 0; f < mesh.face_count(); ++f)
      for (int c = 0; c < 2; ++c) {
        double sum = 0;
        for (Index h = 3 * f; h < 3 * f + 3; ++h) {
          const double d = c == 0 ? target[at(h)].real() : target[at(h)].imag();
          sum += d * d / std::max(static_cast<double>(mesh.edge_vector(h).squaredNorm()), 1e-300);
        }
        strength_[at(f)][static_cast<std::size_t>(c)] = std::max(2 * sum / 3, 1e-300);
      }
  }

  /// The unknown of a component in the chart of a corner's face.
  [[nodiscard]] Index variable(Index corner, int component) const {
    const Index v = mesh_.origin(corner);
    const bool merged = (index_[at(v)] & 1) != 0 && !mesh_.on_boundary(v);
    return merged ? 2 * v : 2 * v + ((component + cut_.corner_rotation[at(corner)]) & 1);
  }

  /// That both sides of an edge agree.
  void curl(EmitRow<double> emit) const {
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      const Index g = mesh_.twin(h);
      if (g < h) continue;
      const Index f = h / 3, k = g / 3;
      const Complex across = -rotated(target_[at(g)], -cut_.rotation[at(h)]);
      for (int c = 0; c < 2; ++c) {
        const int d = (c + cut_.rotation[at(h)]) & 1;
        const double p = c == 0 ? target_[at(h)].real() : target_[at(h)].imag();
        const double q = c == 0 ? across.real() : across.imag();
        const double scale =
            (strength_[at(f)][static_cast<std::size_t>(c)] + strength_[at(k)][static_cast<std::size_t>(d)]) / 2;
        const double mean = (p + q) / 6;
        const std::array<Index, 6> where{variable(3 * f, c), variable(3 * f + 1, c), variable(3 * f + 2, c),
                                         variable(3 * k, d), variable(3 * k + 1, d), variable(3 * k + 2, d)};
        const std::array<double, 6> factor{mean, mean, mean, -mean, -mean, -mean};
        emit({where, factor, q - p, 1.5 / ((mesh_.area(f) + mesh_.area(k)) * scale)});
      }
    }
  }

  void smoothness(EmitRow<double> emit, double weight) const {
    for (Index f = 0; f < mesh_.face_count(); ++f) {
      const double area = mesh_.area(f);
      const double longest =
          std::max({mesh_.edge_vector(3 * f).squaredNorm(), mesh_.edge_vector(3 * f + 1).squaredNorm(),
                    mesh_.edge_vector(3 * f + 2).squaredNorm()});
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        const double cot = -mesh_.edge_vector(mesh_.next(h)).dot(mesh_.edge_vector(mesh_.prev(h))) /
                           std::max(2 * area, 1e-4 * longest);
        for (int c = 0; c < 2; ++c) {
          const std::array<Index, 2> where{variable(h, c), variable(mesh_.next(h), c)};
          const std::array<double, 2> factor{1, -1};
          emit({where, factor, 0, weight * cot / 2});
        }
      }
    }
  }

  /// That lengths stay as wanted.
  void fidelity(EmitRow<double> emit, double weight) const {
    const Index n = mesh_.vertex_count();
    const double total_area = mesh_.total_area();
    std::vector<double> mass(at(n), 0);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) mass[at(mesh_.origin(h))] += mesh_.area(h / 3) / 3;
    for (Index v = 0; v < 2 * n; ++v) {
      const std::array<Index, 1> where{v};
      const std::array<double, 1> factor{1};
      emit({where, factor, 0, std::max(weight * mass[at(v / 2)], 1e-12 * total_area) / total_area});
    }
  }

 private:
  const TriangleMesh<double>& mesh_;
  const CutGraph& cut_;
  const std::vector<Index>& index_;
  const TargetEdges& target_;
  /// A face and component: mean |component of the gradient|², for weights relative to the wanted size.
  std::vector<std::array<double, 2>> strength_;
};

}  // namespace detail

QUADRIG_INLINE Expected<CorrectedTarget> correct_log_scale(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                           const std::vector<Index>& index,
                                                           const LogScaleOptions& options, TargetEdges target,
                                                           Context& context) {
  using detail::at;
  const Index m = mesh.face_count(), n = mesh.vertex_count();
  const detail::LogScaleRows rows(mesh, cut, index, target);
  const auto curl_rows = [&](EmitRow<double> emit) { rows.curl(emit); };
  const auto smooth_rows = [&](EmitRow<double> emit) { rows.smoothness(emit, options.smoothness); };
  const auto fidelity_rows = [&](EmitRow<double> emit) { rows.fidelity(emit, options.fidelity); };
  const RowTerm curl{"curl", curl_rows};
  const RowTerm smooth{"smoothness", smooth_rows};
  const RowTerm fidelity{"fidelity", fidelity_rows};
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
      for (Index h = 3 * f; h < 3 * f + 3; ++h) mean += x[at(rows.variable(h, c))] / 3;
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
