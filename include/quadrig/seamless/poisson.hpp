// The seamless Poisson solve, repeated with stiffer faces until no triangle is flipped and every cone is right.
#pragma once

#include <numbers>

#include "quadrig/energy.hpp"
#include "quadrig/seamless/curl.hpp"
#include "quadrig/seamless/unknowns.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// What is wrong with a map; valid when nothing is.
struct MapDefects {
  Index flips = 0;        ///< triangles without positive area
  Index wrong_cones = 0;  ///< vertices whose cone angle is not 4 − I4 (on the border 2 − I4) quarter turns
  std::vector<Index> flipped_faces;
  std::vector<Index> wrong_vertices;
  [[nodiscard]] bool valid() const { return flips == 0 && wrong_cones == 0; }
};

namespace detail {

inline std::string count_of(Index n, const char* what) { return std::to_string(n) + " " + what + (n == 1 ? "" : "s"); }

inline std::string defects_text(const MapDefects& defects) {
  return count_of(defects.flips, "flipped triangle") + ", " + count_of(defects.wrong_cones, "wrong cone");
}
inline Index defect_count(const MapDefects& defects) { return defects.flips + defects.wrong_cones; }

/// Defects all over, which neither other sizes nor a few moves undo.
[[nodiscard]] inline bool is_noise(Index defects, Index faces) { return defects > std::max<Index>(300, faces / 50); }

}  // namespace detail

/// Both conditions are needed: a map with positive triangles can still wind twice around a vertex.
[[nodiscard]] inline MapDefects check_map(const TriangleMesh<double>& mesh, const std::vector<Index>& index,
                                          const std::vector<Complex>& z) {
  using detail::at;
  constexpr double half_pi = std::numbers::pi / 2;
  MapDefects defects;
  std::vector<double> cone(at(mesh.vertex_count()), 0.0);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const Complex a = z[at(3 * f)], b = z[at(3 * f + 1)], c = z[at(3 * f + 2)];
    const double area = cross(b - a, c - a);
    const double scale = std::max({std::norm(b - a), std::norm(c - b), std::norm(a - c)});
    if (!(area > 1e-12 * scale)) defects.flipped_faces.push_back(f);
    for (int i = 0; i < 3; ++i) {
      const Complex p = z[at(3 * f + i)], q = z[at(3 * f + (i + 1) % 3)], r = z[at(3 * f + (i + 2) % 3)];
      cone[at(mesh.faces()(f, i))] += elementary::arg((r - p) * std::conj(q - p));
    }
  }
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (mesh.outgoing(v) == no_index) continue;
    const double wanted = (mesh.on_boundary(v) ? 2 : 4) - index[at(v)];
    if (!(std::abs(cone[at(v)] / half_pi - wanted) < 0.5)) defects.wrong_vertices.push_back(v);
  }
  defects.flips = static_cast<Index>(defects.flipped_faces.size());
  defects.wrong_cones = static_cast<Index>(defects.wrong_vertices.size());
  return defects;
}

struct PoissonOptions {
  int max_iterations = 40;
  int patience = 5;             ///< iterations in a row that may pass without fewer defects
  int straightenings = 0;       ///< further solves of a valid map in which lengths give way to directions
  double stretching = 1.0 / 3;  ///< what stretches a wanted quad in them, against what turns its edges; in (0, 1]
  SolverChoice solver{};
};

/// Unknowns of a map that a solve holds at a value, in their order; empty: none.
template <class K>
struct HeldUnknowns {
  std::span<const char> held;
  std::span<const K> value;
};

struct PoissonReport {
  int iterations = 0;  ///< factorizations
  int straightenings = 0;
  std::string backend;  ///< what solved, in words; empty where no unknown was free
  MapDefects defects;
  double distortion = 0;  ///< area-weighted mean of |s1 − 1| + |s2 − 1| over the target metric
};

namespace detail {

/// Cotangents of the target triangles, bounded so that needles do not drown the rest.
[[nodiscard]] inline std::vector<double> bounded_cotangents(const TargetEdges& target) {
  std::vector<double> cotangent(target.size());
  for (std::size_t h = 0; h + 2 < target.size(); h += 3) {
    const double area = cross(target[h], target[h + 1]);
    const double longest = std::max({std::norm(target[h]), std::norm(target[h + 1]), std::norm(target[h + 2])});
    for (std::size_t i = 0; i < 3; ++i) {
      const Complex p = target[h + (i + 1) % 3], q = target[h + (i + 2) % 3];
      cotangent[h + i] = -(std::conj(p) * q).real() / std::max(area, 1e-4 * longest);
    }
  }
  return cotangent;
}

/// How far a map is from its target, by face.
struct Distortion {
  std::vector<double> delta;  ///< |s1 − 1| + |s2 − 1| of the signed singular values
  std::vector<char> thin;     ///< flipped or nearly so
  double mean = 0;            ///< of delta over the area of the target
};
[[nodiscard]] inline Distortion distortion_of(const TargetEdges& target, const std::vector<Complex>& z) {
  constexpr double nearly = 0.1;  // of the wanted area
  const std::size_t m = target.size() / 3;
  Distortion result{std::vector<double>(m, 0.0), std::vector<char>(m, 0), 0};
  double total = 0, sum = 0;
  for (std::size_t f = 0; f < m; ++f) {
    const std::size_t h = 3 * f;
    const Complex a = target[h], b = target[h + 1], p = z[h + 1] - z[h], q = z[h + 2] - z[h + 1];
    const double det = cross(a, b);
    if (!(det > 0)) continue;
    // J = α id + β conj: singular values |α| ± |β|.
    const Complex alpha = (p * std::conj(b) - q * std::conj(a)) / (a * std::conj(b) - std::conj(a) * b);
    const Complex beta = (q * a - p * b) / (a * std::conj(b) - std::conj(a) * b);
    const double s1 = std::abs(alpha) + std::abs(beta), s2 = std::abs(alpha) - std::abs(beta);
    result.delta[f] = std::abs(s1 - 1) + std::abs(s2 - 1);
    result.thin[f] = s1 * s2 < nearly;
    total += det;
    sum += det * result.delta[f];
  }
  result.mean = total > 0 ? sum / total : 0;
  return result;
}

/// Raises the weight of faces that distort more or less than their neighbours. Adding alone is too slow for the last
/// few flips: what is (nearly) flipped doubles.
inline void stiffen(const TriangleMesh<double>& mesh, const Distortion& distortion, std::vector<double>& weight) {
  constexpr double most = 5;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    double sum = 0;
    int count = 0;
    for (Index h = 3 * f; h < 3 * f + 3; ++h)
      if (mesh.twin(h) != no_index) {
        sum += distortion.delta[at(mesh.twin(h) / 3)];
        ++count;
      }
    if (count > 0)
      weight[at(f)] = (distortion.thin[at(f)] ? 2.0 : 1.0) * weight[at(f)] +
                      std::min(std::abs(sum / count - distortion.delta[at(f)]), most);
  }
}

/// The target with its lengths moved towards those of the map, each parameter by itself, by 1 − `stretching`.
inline void give_way(const TargetEdges& target, const std::vector<Complex>& z, double stretching, TargetEdges& wanted) {
  for (std::size_t h = 0; h + 2 < target.size(); h += 3) {
    const Complex a = target[h], b = target[h + 1], p = z[h + 1] - z[h], q = z[h + 2] - z[h + 1];
    const double det = cross(a, b);
    if (!(det > 0)) continue;
    const double u = (p.real() * b.imag() - q.real() * a.imag()) / det;
    const double v = (q.imag() * a.real() - p.imag() * b.real()) / det;
    const double along_u = std::clamp(stretching + (1 - stretching) * u, 0.5, 2.0);
    const double along_v = std::clamp(stretching + (1 - stretching) * v, 0.5, 2.0);
    for (std::size_t k = h; k < h + 3; ++k) wanted[k] = {along_u * target[k].real(), along_v * target[k].imag()};
  }
}

}  // namespace detail

template <class K>
struct PoissonMap {
  std::vector<K> x;        ///< the unknowns
  std::vector<Complex> z;  ///< a half-edge: the parameters of its origin in the chart of its face
  PoissonReport report;
};

/// Minimizes Σ_f w_f ∫ |Dz G⁻¹ − I|² over the target triangles, so that the error is relative to the wanted quad;
/// raises w where triangles flip or distort far more than their neighbours. Returns the solution with the fewest
/// defects.
/// A valid map is straightened: its own stretch along the wanted directions becomes part of what is wanted, by the
/// share that makes turning cost 1 / stretching times what stretching costs (local and global steps in turn). Where
/// that flips a triangle the map before stays. \cost one analysis, one factorization an iteration, one solve a
/// straightening.
/// \fails as the backend; cancelled. A map that keeps defects is no failure: the report has them.
template <class K>
[[nodiscard]] Expected<PoissonMap<K>> solve_poisson(const TriangleMesh<double>& mesh, const MapUnknowns<K>& unknowns,
                                                    const std::vector<Index>& index, const TargetEdges& target,
                                                    const PoissonOptions& options, Context& context,
                                                    const std::type_identity_t<HeldUnknowns<K>>& held = {}) {
  using detail::at;
  const Index m = mesh.face_count();
  if (context.cancelled()) return cancelled_error("seamless map");
  const std::vector<double> cotangent = detail::bounded_cotangents(target);
  QuadraticForm<K> form(unknowns.count());
  if (!held.held.empty())
    for (Index k = 0; k < unknowns.count(); ++k)
      if (held.held[at(k)]) form.fix(k, held.value[at(k)]);
  Expected<AnySolver<K>> solver = options.solver.factory<K>()();
  if (!solver) return solver.error();

  if (context.cancelled()) return cancelled_error("seamless map");
  std::vector<double> weight(at(m), 1.0);
  TargetEdges wanted = target;  // with lengths that gave way
  const RowTerm poisson{"poisson", [&](EmitRow<K> emit) {
                          for (Index h = 0; h < 3 * m; ++h)
                            for (int c = 0; c < MapUnknowns<K>::components; ++c) {
                              const auto row = unknowns.edge(h, c);
                              K rhs;
                              if constexpr (MapUnknowns<K>::components == 1)
                                rhs = wanted[at(h)];
                              else
                                rhs = c == 0 ? wanted[at(h)].real() : wanted[at(h)].imag();
                              emit({row.at, row.coefficient, rhs, 0.5 * weight[at(h / 3)] * cotangent[at(h)]});
                            }
                        }};
  PoissonReport report;
  PoissonReport best;
  std::vector<K> x, best_x;
  std::vector<Complex> z, best_z;
  Index fewest = std::numeric_limits<Index>::max();
  int waited = 0;
  // Assembles and solves; a straightening has the matrix of the iteration before.
  const auto solve = [&](bool factorized) -> Status {
    if (context.cancelled()) return cancelled_error("seamless map");
    if (Status status = form.assemble(context, poisson); !status.ok()) return status;
    std::vector<K> free_values(at(form.free_count()));
    if (form.free_count() > 0) {
      if (!factorized)
        if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status.ok())
          return status;
      if (SolveInfo info = solver->solve(form.rhs(), free_values, context); !info.status.ok()) return info.status;
      report.backend = solver->description();
    }
    if (context.cancelled()) return cancelled_error("seamless map");
    x = form.expand(free_values);
    z = unknowns.corners(x);
    if (context.cancelled()) return cancelled_error("seamless map");
    report.defects = check_map(mesh, index, z);
    if (context.cancelled()) return cancelled_error("seamless map");
    return {};
  };
  for (;;) {
    if (Status status = solve(false); !status.ok()) return status.error();
    ++report.iterations;

    const detail::Distortion distortion = detail::distortion_of(target, z);
    report.distortion = distortion.mean;
    const Index defects = report.defects.flips + report.defects.wrong_cones;
    waited = defects < fewest ? 0 : waited + 1;
    if (defects < fewest) {
      fewest = defects;
      best_x = x;
      best_z = z;
      best = report;
    }
    if (report.defects.valid() || report.iterations > options.max_iterations || waited >= options.patience ||
        form.free_count() == 0) {
      best.iterations = report.iterations;
      double stretching = options.stretching;
      for (int failures = 0; best.defects.valid() && failures < 2 && form.free_count() > 0;) {
        if (best.straightenings >= options.straightenings) break;
        detail::give_way(target, best_z, stretching, wanted);
        if (Status status = solve(true); !status.ok()) return status.error();
        if (!report.defects.valid()) {
          stretching = (1 + stretching) / 2;
          ++failures;
          continue;
        }
        ++best.straightenings;
        best_x = x;
        best_z = z;
      }
      return PoissonMap<K>{std::move(best_x), std::move(best_z), std::move(best)};
    }
    detail::stiffen(mesh, distortion, weight);
  }
}

}  // namespace quadrig
