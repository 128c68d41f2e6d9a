// Measures what a map makes of the directions and sizes that it was asked for.
#pragma once

#include "quadrig/quantile.hpp"
#include "quadrig/seamless/strain.hpp"
#include "quadrig/seamless/target.hpp"

namespace quadrig {

/// \param wanted edge vectors in charts; z a half-edge, in the same charts, at any scale
/// \pre faces have area, the wanted map and z positive area everywhere. \cost O(m log m)
[[nodiscard]] inline MapStrain map_strain(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                          const TargetEdges& wanted, const std::vector<Complex>& z) {
  using detail::at;
  MapStrain strain;
  const FieldCurl curl = target_curl(mesh, rotation, wanted);
  const double quads = target_area(wanted), side = std::sqrt(mesh.total_area() / std::max(quads, 1e-300));
  strain.curl_mean = curl.mean * side;
  strain.curl_largest = curl.largest * side;
  std::vector<double> turned(at(mesh.face_count())), scaled(turned.size());
  double mean_scale = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    // The linear map e → a e + b ē of the two edges: a turns and scales, b shears.
    const Complex e0 = wanted[at(3 * f)], e1 = wanted[at(3 * f + 1)];
    const Complex d0 = z[at(3 * f + 1)] - z[at(3 * f)], d1 = z[at(3 * f + 2)] - z[at(3 * f + 1)];
    const Complex determinant = e0 * std::conj(e1) - e1 * std::conj(e0);
    const Complex a = (d0 * std::conj(e1) - d1 * std::conj(e0)) / determinant, b = (d1 * e0 - d0 * e1) / determinant;
    turned[at(f)] = std::abs(elementary::arg(a)) * 180 / std::numbers::pi;
    scaled[at(f)] = 0.5 * elementary::log(std::max(std::norm(a) - std::norm(b), 1e-300));
    mean_scale += mesh.area(f) * scaled[at(f)];
  }
  mean_scale /= mesh.total_area();
  for (Index f = 0; f < mesh.face_count(); ++f) {
    scaled[at(f)] = std::abs(scaled[at(f)] - mean_scale);
    strain.turned_mean_degrees += mesh.area(f) / mesh.total_area() * turned[at(f)];
    strain.scaled_mean += mesh.area(f) / mesh.total_area() * scaled[at(f)];
  }
  strain.turned_p95_degrees = quantile(std::move(turned), 0.95);
  strain.scaled_p95 = quantile(std::move(scaled), 0.95);
  return strain;
}

}  // namespace quadrig
