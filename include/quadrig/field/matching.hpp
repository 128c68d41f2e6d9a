// Which vector of a face continues which across an edge, and the singularities that follow from it.
#pragma once

#include "quadrig/field/frames.hpp"

namespace quadrig {

/// Per half-edge h from face f to face g: vector k of f (u, v, −u, −v counted from 0) continues as vector k + r_h of g,
/// after turning by ρ_h ∈ [−π/4, π/4] (radians) beyond parallel transport. Twins hold −r and −ρ; 0 on the boundary.
/// r is not reduced modulo 4.
struct Matching {
  std::vector<Index> r;
  std::vector<double> rho;
};

/// Principal matching by the bisector cross of each frame, which is exact for frames that are not orthogonal: the
/// principal effort is the phase of the ratio of x0. Computed for one half-edge of a pair, so twins cannot differ.
/// Threads: those of the context.
/// \pre one frame a face. \cost O(m). \fails never. Source: Diamanti et al. 2014, Vaxman et al. 2016.
template <class Scalar>
[[nodiscard]] Matching match(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                             const FrameField& frames, const Context* context = nullptr) {
  constexpr double quarter = std::numbers::pi / 2;
  Matching matching{std::vector<Index>(static_cast<std::size_t>(mesh.halfedge_count()), 0),
                    std::vector<double>(static_cast<std::size_t>(mesh.halfedge_count()), 0.0)};
  std::vector<double> beta(static_cast<std::size_t>(mesh.face_count()));
  parallel_each(context, beta.size(), [&](std::size_t f) { beta[f] = bisector_angle(frames.u[f], frames.v[f]); });
  parallel_each(context, matching.r.size(), [&](std::size_t a) {
    const auto h = static_cast<Index>(a);
    const Index twin = mesh.twin(h);
    if (twin == no_index || twin < h) return;
    const double alpha_f = elementary::arg(Complex(connection.edge(h))),
                 alpha_g = elementary::arg(-Complex(connection.edge(twin)));
    const double turn =
        (beta[static_cast<std::size_t>(h / 3)] - alpha_f) + alpha_g - beta[static_cast<std::size_t>(twin / 3)];
    const double r = std::round(turn / quarter);
    const auto b = static_cast<std::size_t>(twin);
    matching.r[a] = static_cast<Index>(r);
    matching.r[b] = -matching.r[a];
    matching.rho[a] = turn - r * quarter;
    matching.rho[b] = -matching.rho[a];
  });
  return matching;
}

/// Per vertex I4 = four times the index of the field: the quad mesh has valence 4 − I4 inside and, with a field that
/// follows the border, 3 − I4 on it.
struct Singularities {
  std::vector<Index> index4;
  Index plus = 0, minus = 0;  ///< vertices inside with I4 > 0, with I4 < 0
  Index boundary = 0;         ///< vertices on the boundary with I4 ≠ 0: corners of the border
  Index sum = 0;              ///< over all vertices: 4χ
};

/// Euler characteristic of the faces; vertices without faces do not count.
template <class Scalar>
[[nodiscard]] Index euler_characteristic(const TriangleMesh<Scalar>& mesh) {
  Index vertices = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) vertices += mesh.outgoing(v) != no_index;
  return vertices - mesh.edge_count() + mesh.face_count();
}

/// Inside, I4 = (2π − Σ angles − Σ ρ) / (π/2), rounded, over the half-edges that end at the vertex; on the boundary
/// (π − Σ angles − Σ ρ) / (π/2), whose sum over a border loop is whole for any field: it is rounded so that the sum is
/// kept. Threads: those of the context.
/// \cost O(m). \fails numeric where Gauss–Bonnet (Σ angle defects = 2πχ), Σ I4 ≡ Σ r mod 4 at a vertex, or
///   Poincaré–Hopf (Σ I4 = 4χ) does not hold: the matching is not of this mesh, or the mesh has degenerate faces.
/// Source: Gauss–Bonnet and Poincaré–Hopf; Ray et al. 2008.
template <class Scalar>
[[nodiscard]] Expected<Singularities> singularities(const TriangleMesh<Scalar>& mesh, const Matching& matching,
                                                    const Context* context = nullptr) {
  constexpr double quarter = std::numbers::pi / 2;
  constexpr double whole = std::is_same_v<Scalar, float> ? 1e-2 : 1e-6;  // numbers so near to whole ones are whole
  const auto fail = [](std::string what, std::string where) {
    return Error{ErrorCode::numeric, std::move(what), std::move(where), "run prepare() to remove degenerate faces"};
  };
  const auto n = static_cast<std::size_t>(mesh.vertex_count());
  const Eigen::VectorXd defects = angle_defects(mesh, context).template cast<double>();
  std::vector<double> turning(n, 0.0);
  std::vector<Index> steps(n, 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const auto end = static_cast<std::size_t>(mesh.target(h));
    turning[end] += matching.rho[static_cast<std::size_t>(h)];
    steps[end] += matching.r[static_cast<std::size_t>(h)];
  }
  Singularities result;
  result.index4.assign(n, 0);
  double total_defect = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    total_defect += defects[v];
    if (mesh.outgoing(v) == no_index || mesh.on_boundary(v)) continue;
    const auto i = static_cast<std::size_t>(v);
    const double exact = (defects[v] - turning[i]) / quarter;
    const double rounded = std::round(exact);
    if (!(std::abs(exact - rounded) < whole)) return fail("a vertex index is not whole", "vertex " + std::to_string(v));
    result.index4[i] = static_cast<Index>(rounded);
    if ((result.index4[i] - steps[i]) % 4 != 0)
      return fail("matching and index disagree", "vertex " + std::to_string(v));
  }

  std::vector<char> seen(n, 0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (!mesh.on_boundary(v) || seen[static_cast<std::size_t>(v)]) continue;
    struct Corner {
      Index vertex;
      double rounding;
    };
    std::vector<Corner> loop;
    double exact_sum = 0;
    Index rounded_sum = 0;
    for (Index w = v; !seen[static_cast<std::size_t>(w)]; w = mesh.target(mesh.outgoing(w))) {
      const auto i = static_cast<std::size_t>(w);
      seen[i] = 1;
      const double exact = (defects[w] - turning[i]) / quarter;
      result.index4[i] = static_cast<Index>(std::lround(exact));
      loop.push_back({w, exact - static_cast<double>(result.index4[i])});
      exact_sum += exact;
      rounded_sum += result.index4[i];
    }
    if (!(std::abs(exact_sum - std::round(exact_sum)) < whole))
      return fail("the index of a border loop is not whole", "vertex " + std::to_string(v));
    const Index missing = static_cast<Index>(std::lround(exact_sum)) - rounded_sum;
    const Index sign = missing < 0 ? -1 : 1;
    std::stable_sort(loop.begin(), loop.end(),
                     [&](const Corner& a, const Corner& b) { return sign * a.rounding > sign * b.rounding; });
    for (Index k = 0; k < sign * missing; ++k)
      result.index4[static_cast<std::size_t>(loop[static_cast<std::size_t>(k) % loop.size()].vertex)] += sign;
  }

  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const Index index = result.index4[static_cast<std::size_t>(v)];
    result.sum += index;
    if (mesh.outgoing(v) == no_index || index == 0) continue;
    if (mesh.on_boundary(v))
      ++result.boundary;
    else
      ++(index > 0 ? result.plus : result.minus);
  }
  const Index chi = euler_characteristic(mesh);
  const double total_tolerance =
      std::is_same_v<Scalar, float> ? 1e-6 * (1 + static_cast<double>(n)) : 1e-6 * (1 + std::abs(total_defect));
  if (!(std::abs(total_defect - 2 * std::numbers::pi * chi) < total_tolerance))
    return fail("Gauss–Bonnet does not hold: the angles of the mesh are not finite or not its own", "mesh");
  if (result.sum != 4 * chi)
    return fail(
        "Poincaré–Hopf does not hold: index sum " + std::to_string(result.sum) + ", wanted " + std::to_string(4 * chi),
        "field");
  return result;
}

}  // namespace quadrig
