// Definitions of subdivision.hpp.
#pragma once

#include "quadrig/subdivision.hpp"

#if defined(QUADRIG_WITH_OPENSUBDIV)
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#endif

namespace quadrig {

QUADRIG_INLINE Status SubdivisionOptions::validate() const {
  if (levels < 1 || levels > 6)
    return Error{ErrorCode::bad_option, "out of range", "subdivision.levels", "give 1 to 6"};
  return {};
}

#if defined(QUADRIG_WITH_OPENSUBDIV)

namespace detail {

/// What OpenSubdiv interpolates: not values but the sums themselves.
struct Stencil {
  std::vector<std::pair<Index, double>> terms;

  void Clear() { terms.clear(); }  // names that OpenSubdiv asks for
  void AddWithWeight(const Stencil& other, double weight) {
    for (const auto& [vertex, share] : other.terms) terms.emplace_back(vertex, weight * share);
  }
};
/// Rows as a matrix, on values of `columns` vertices.
inline Eigen::SparseMatrix<double, Eigen::RowMajor, Index> as_matrix(const std::vector<Stencil>& rows, Index columns) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const auto& [vertex, share] : rows[i].terms) entries.emplace_back(static_cast<Index>(i), vertex, share);
  Eigen::SparseMatrix<double, Eigen::RowMajor, Index> matrix(static_cast<Eigen::Index>(rows.size()), columns);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace detail

QUADRIG_INLINE bool can_subdivide() { return true; }

QUADRIG_INLINE Expected<Subdivision> subdivide(const Quads& quads, Index vertex_count,
                                               const SubdivisionOptions& options) {
  namespace Far = OpenSubdiv::Far;
  using detail::at;
  if (Status status = options.validate(); !status.ok()) return status.error();
  std::vector<int> sizes(at(static_cast<Index>(quads.rows())), 4), corners;
  for (Eigen::Index q = 0; q < quads.rows(); ++q)
    for (int i = 0; i < 4; ++i) corners.push_back(quads(q, i));
  std::vector<int> crease_ends;
  for (const std::array<Index, 2>& edge : options.creases)
    crease_ends.insert(crease_ends.end(), edge.begin(), edge.end());
  std::vector<float> sharpness(options.creases.size(), OpenSubdiv::Sdc::Crease::SHARPNESS_INFINITE);

  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = vertex_count;
  descriptor.numFaces = static_cast<int>(quads.rows());
  descriptor.numVertsPerFace = sizes.data();
  descriptor.vertIndicesPerFace = corners.data();
  descriptor.numCreases = static_cast<int>(options.creases.size());
  descriptor.creaseVertexIndexPairs = crease_ends.data();
  descriptor.creaseWeights = sharpness.data();
  OpenSubdiv::Sdc::Options rules;
  rules.SetVtxBoundaryInterpolation(OpenSubdiv::Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER);
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  const std::unique_ptr<Far::TopologyRefiner> refiner(
      Factory::Create(descriptor, Factory::Options(OpenSubdiv::Sdc::SCHEME_CATMARK, rules)));
  if (!refiner) return Error{ErrorCode::bad_input, "OpenSubdiv rejects the quads", "subdivision", "give a manifold"};
  Far::TopologyRefiner::UniformOptions uniform(options.levels);
  uniform.fullTopologyInLastLevel = true;
  refiner->RefineUniform(uniform);

  Subdivision result;
  const Far::PrimvarRefinerReal<double> primvars(*refiner);
  const auto each_itself = [](int count) {
    std::vector<detail::Stencil> rows(at(Index(count)));
    for (Index v = 0; v < count; ++v) rows[at(v)].terms.emplace_back(v, 1.0);
    return rows;
  };
  result.stencils.resize(vertex_count, vertex_count);
  result.stencils.setIdentity();
  std::vector<Index> parent(at(static_cast<Index>(quads.rows()))), vertex(at(vertex_count));
  for (std::size_t q = 0; q < parent.size(); ++q) parent[q] = static_cast<Index>(q);
  for (std::size_t v = 0; v < vertex.size(); ++v) vertex[v] = static_cast<Index>(v);
  const auto multiply = [&](const std::vector<detail::Stencil>& rows, int columns) {
    result.stencils =
        Eigen::SparseMatrix<double, Eigen::RowMajor, Index>(detail::as_matrix(rows, columns) * result.stencils);
  };
  for (int level = 1; level <= options.levels; ++level) {
    const Far::TopologyLevel coarse = refiner->GetLevel(level - 1), fine = refiner->GetLevel(level);
    std::vector<detail::Stencil> from = each_itself(coarse.GetNumVertices()), to(at(Index(fine.GetNumVertices())));
    primvars.Interpolate(level, from, to);
    multiply(to, coarse.GetNumVertices());
    std::vector<Index> parent_before(at(Index(fine.GetNumFaces())));
    for (Index f = 0; f < fine.GetNumFaces(); ++f) parent_before[at(f)] = parent[at(Index(fine.GetFaceParentFace(f)))];
    parent = std::move(parent_before);
    for (Index& v : vertex) v = coarse.GetVertexChildVertex(v);
  }
  const Far::TopologyLevel last = refiner->GetLevel(options.levels);
  if (options.limit) {
    std::vector<detail::Stencil> from = each_itself(last.GetNumVertices()), to(from.size());
    primvars.Limit(from, to);
    multiply(to, last.GetNumVertices());
  }
  result.quads.resize(last.GetNumFaces(), 4);
  for (Index f = 0; f < last.GetNumFaces(); ++f)
    for (int i = 0; i < 4; ++i) result.quads(f, i) = last.GetFaceVertices(f)[i];
  result.parent = std::move(parent);
  result.vertex = std::move(vertex);
  return result;
}

#else

QUADRIG_INLINE bool can_subdivide() { return false; }

QUADRIG_INLINE Expected<Subdivision> subdivide(const Quads& /*quads*/, Index /*vertex_count*/,
                                               const SubdivisionOptions& /*options*/) {
  return Error{ErrorCode::unsupported, "this build cannot subdivide", "subdivision",
               "install OpenSubdiv (Debian: libosd-dev) and build with QUADRIG_WITH_OPENSUBDIV"};
}

#endif

}  // namespace quadrig
