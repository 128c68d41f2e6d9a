// What the input surface carries, brought onto the quads: skin weights and attributes, by where each vertex lies.
#pragma once

#include "quadrig/quads.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig {

/// Skin weights at points of the surface: the corners' weights by the barycentric coordinates, then the `influences`
/// strongest (ties by the lower bone), rescaled to sum 1 within 1e-12. One row a point.
/// \pre weights has one row a vertex of `surface`; the points lie on faces of `surface`
/// \fails bad_option when influences < 1; bad_input when the weights have another number of rows or vanish at a point
[[nodiscard]] Expected<SkinWeights> transfer_weights(const TriangleMesh<double>& surface, const SkinWeights& weights,
                                                     std::span<const SurfacePoint> points, Index influences = 4);

/// Values given a vertex of the surface (n×k: colours, morph offsets, ...) at the points: p×k, interpolated linearly.
/// \pre values has one row a vertex of `surface`
[[nodiscard]] Eigen::MatrixXd transfer_vertex_values(const TriangleMesh<double>& surface, const Eigen::MatrixXd& values,
                                                     std::span<const SurfacePoint> points);

/// Values given a corner of the surface (3m×k, row 3 f + i: texture coordinates, which may jump at a seam), at the
/// points: p×k, interpolated within each point's own face. \pre values has 3 rows a face
[[nodiscard]] Eigen::MatrixXd transfer_corner_values(const Eigen::MatrixXd& values,
                                                     std::span<const SurfacePoint> points);

/// Labels given a face of the surface (materials, groups), on each quad: that of most of its corners, of equals the
/// lowest. \pre labels has one entry a face of the source surface
[[nodiscard]] std::vector<Index> transfer_face_labels(std::span<const Index> labels, const QuadMesh& quads);

// Definitions ------------------------------------------------------------------------------------------------------

inline Expected<SkinWeights> transfer_weights(const TriangleMesh<double>& surface, const SkinWeights& weights,
                                              std::span<const SurfacePoint> points, Index influences) {
  if (influences < 1)
    return Error{ErrorCode::bad_option, "a vertex needs at least one influence", "influences", "ask for 1 or more"};
  if (weights.rows() != surface.vertex_count())
    return Error{
        ErrorCode::bad_input,
        std::to_string(weights.rows()) + " rows of weights for " + std::to_string(surface.vertex_count()) + " vertices",
        "skin weights", "give one row a vertex"};
  struct Influence {
    Index bone;
    double weight;
  };
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(points.size() * static_cast<std::size_t>(influences));
  std::vector<Influence> found;
  for (std::size_t k = 0; k < points.size(); ++k) {
    found.clear();
    for (int i = 0; i < 3; ++i) {
      const double share = points[k].barycentric[i];
      if (!(share > 0)) continue;
      for (SkinWeights::InnerIterator it(weights, surface.faces()(points[k].face, i)); it; ++it) {
        const Index bone = static_cast<Index>(it.col());
        const auto known =
            std::find_if(found.begin(), found.end(), [bone](const Influence& x) { return x.bone == bone; });
        if (known == found.end())
          found.push_back({bone, share * it.value()});
        else
          known->weight += share * it.value();
      }
    }
    std::sort(found.begin(), found.end(), [](const Influence& a, const Influence& b) {
      return a.weight != b.weight ? a.weight > b.weight : a.bone < b.bone;
    });
    if (found.size() > static_cast<std::size_t>(influences)) found.resize(static_cast<std::size_t>(influences));
    while (!found.empty() && !(found.back().weight > 0)) found.pop_back();
    double sum = 0;
    for (const Influence& x : found) sum += x.weight;
    if (!(sum > 0))
      return Error{ErrorCode::bad_input, "no bone holds the surface here", "face " + std::to_string(points[k].face),
                   "give every vertex weights that sum to 1"};
    for (const Influence& x : found) entries.emplace_back(static_cast<Index>(k), x.bone, x.weight / sum);
  }
  SkinWeights result(static_cast<Index>(points.size()), weights.cols());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

inline Eigen::MatrixXd transfer_vertex_values(const TriangleMesh<double>& surface, const Eigen::MatrixXd& values,
                                              std::span<const SurfacePoint> points) {
  assert(values.rows() == surface.vertex_count());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(points.size()), values.cols());
  for (std::size_t k = 0; k < points.size(); ++k)
    for (int i = 0; i < 3; ++i)
      result.row(static_cast<Eigen::Index>(k)) +=
          points[k].barycentric[i] * values.row(surface.faces()(points[k].face, i));
  return result;
}

inline Eigen::MatrixXd transfer_corner_values(const Eigen::MatrixXd& values, std::span<const SurfacePoint> points) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(points.size()), values.cols());
  for (std::size_t k = 0; k < points.size(); ++k)
    for (int i = 0; i < 3; ++i)
      result.row(static_cast<Eigen::Index>(k)) += points[k].barycentric[i] * values.row(3 * points[k].face + i);
  return result;
}

inline std::vector<Index> transfer_face_labels(std::span<const Index> labels, const QuadMesh& quads) {
  std::vector<Index> result(static_cast<std::size_t>(quads.quad_count()));
  for (Index q = 0; q < quads.quad_count(); ++q) {
    std::array<Index, 4> own{};
    for (int i = 0; i < 4; ++i)
      own[static_cast<std::size_t>(i)] =
          labels[static_cast<std::size_t>(quads.source[static_cast<std::size_t>(quads.quads(q, i))].face)];
    std::sort(own.begin(), own.end());
    std::ptrdiff_t most = 0;
    for (const Index label : own)
      if (const auto n = std::count(own.begin(), own.end(), label); n > most)
        most = n, result[static_cast<std::size_t>(q)] = label;
  }
  return result;
}

}  // namespace quadrig
