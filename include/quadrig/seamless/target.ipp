#pragma once

#include "quadrig/seamless/target.hpp"

namespace quadrig {

namespace detail {

/// The rows of correct_log_scale: two unknowns a vertex, the logarithms of the two lengths.
class LogScaleRows {
 public:
  LogScaleRows(const TriangleMesh<double>& mesh, const CutGraph& cut, const std::vector<Index>& index,
               const TargetEdges& target)
      : mesh_(mesh), cut_(cut), index_(index), target_(target) {}

  /// The unknown of a component in the chart of a corner's face.
  [[nodiscard]] Index variable(Index corner, int component) const {
    const Index v = mesh_.origin(corner);
    const bool merged = (index_[at(v)] & 1) != 0 && !mesh_.on_boundary(v);
    return merged ? 2 * v : 2 * v + ((component + cut_.corner_rotation[at(corner)]) & 1);
  }

  /// curl(e^a g) = 0, relative to |g|: ∇a × g / |g| = −curl g / |g|.
  void curl(EmitRow<double> emit) const {
    const auto rotation = [&](Index h) { return cut_.rotation[at(h)]; };
    for_each_curl(mesh_, target_, rotation, [&](Index f, int component, const CurlSample& sample) {
      const Eigen::Vector2d& g = sample.gradient;
      const double size = std::max(g.norm(), 1e-300);
      std::array<Index, 3> where;
      std::array<double, 3> factor;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector2d& hat = sample.hats[at(i)];
        where[at(i)] = variable(3 * f + i, component);
        factor[at(i)] = (hat.x() * g.y() - hat.y() * g.x()) / size;
      }
      const double noise = 4 / std::sqrt(mesh_.area(f));  // a turn over less than a triangle: of needles
      emit({where, factor, -std::clamp(sample.curl / size, -noise, noise), static_cast<double>(mesh_.area(f))});
    });
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
  const double median = all[all.size() / 2], bound = elementary::log(options.largest);
  for (Index h = 0; h < 3 * m; ++h) {
    const auto& [a, b] = correction[at(h / 3)];
    target[at(h)] = {target[at(h)].real() * elementary::exp(std::clamp(a - median, -bound, bound)),
                     target[at(h)].imag() * elementary::exp(std::clamp(b - median, -bound, bound))};
  }
  if (context.cancelled()) return cancelled_error("seamless map");
  return CorrectedTarget{std::move(target), solver->description()};
}

}  // namespace quadrig
