// What the map should look like: wanted edge vectors per face, made more nearly integrable by correcting lengths.
#pragma once

#include "quadrig/connection.hpp"
#include "quadrig/energy.hpp"
#include "quadrig/seamless/curl.hpp"
#include "quadrig/seamless/poisson.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// Per half-edge the wanted parameter vector in the combed chart of its face, from densities u, v per face (|u| lines
/// a unit length: one quad is u/|u|² by v/|v|²). \pre v counter-clockwise of u, neither zero
[[nodiscard]] inline TargetEdges target_edges(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                              const CutGraph& cut, const std::vector<Complex>& u,
                                              const std::vector<Complex>& v) {
  using detail::at;
  TargetEdges target(at(mesh.halfedge_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const std::array<Complex, 4> direction{u[at(f)], v[at(f)], -u[at(f)], -v[at(f)]};
    const auto turn = static_cast<std::size_t>(cut.combing[at(f)]);
    Complex a = direction[turn], b = direction[(turn + 1) % 4];
    a /= std::norm(a);
    b /= std::norm(b);
    const double area = cross(a, b);
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      const Complex e = connection.to_complex(f, mesh.edge_vector(h));
      target[at(h)] = {cross(e, b) / area, cross(a, e) / area};
    }
  }
  return target;
}

/// Number of quads that a target asks for: its area.
[[nodiscard]] inline double target_area(const TargetEdges& target) {
  double area = 0;
  for (std::size_t h = 0; h + 2 < target.size(); h += 3) area += cross(target[h], target[h + 1]) / 2;
  return area;
}

/// Σ over interior edges of the squared mismatch of the two sides, relative to their length.
[[nodiscard]] inline double target_curl(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                        const TargetEdges& target) {
  using detail::at;
  double total = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index g = mesh.twin(h);
    if (g < h) continue;
    const Complex across = -rotated(target[at(g)], -cut.rotation[at(h)]);
    total += std::norm(target[at(h)] - across) / std::max(std::norm(target[at(h)] + across) / 4, 1e-300);
  }
  return total;
}

struct LogScaleOptions {
  double fidelity = 4;       ///< λ: resistance to leaving the wanted sizes
  double smoothness = 0.01;  ///< μ
  double largest = 4;        ///< corrections are clipped to [1/largest, largest]
  SolverFactory<double> solver = solver_factory<double>();
};
struct CorrectedTarget {
  TargetEdges target;
  std::string backend;  ///< what solved, in words
};

/// Scales the two parameters of each face by e^a, e^b so that neighbours agree better along their common edge: one
/// symmetric positive definite solve for log lengths on the vertices, where charts that differ by an odd turn swap
/// a and b and a vertex of odd holonomy has a = b.
/// \cost one factorization with at most 2 n unknowns.
[[nodiscard]] inline Expected<CorrectedTarget> correct_log_scale(const TriangleMesh<double>& mesh, const CutGraph& cut,
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
  const double total_area = mesh.total_area();
  const auto rotation = [&](Index h) { return cut.rotation[at(h)]; };
  // curl(e^a g) = 0, relative to |g|: ∇a × g / |g| = −curl g / |g|.
  const auto emit_curl = [&](EmitRow<double> emit) {
    detail::for_each_curl(mesh, target, rotation, [&](Index f, int component, const detail::CurlSample& sample) {
      const Eigen::Vector2d& g = sample.gradient;
      const double size = std::max(g.norm(), 1e-300);
      std::array<Index, 3> where;
      std::array<double, 3> factor;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector2d& hat = sample.hats[at(i)];
        where[at(i)] = variable(3 * f + i, component);
        factor[at(i)] = (hat.x() * g.y() - hat.y() * g.x()) / size;
      }
      const double noise = 4 / std::sqrt(mesh.area(f));  // a turn over less than a triangle: of needles
      emit({where, factor, -std::clamp(sample.curl / size, -noise, noise), static_cast<double>(mesh.area(f))});
    });
  };
  const RowTerm curl{"curl", emit_curl};
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
