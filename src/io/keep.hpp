// Edges of a surface file that quads must keep.
#pragma once

#include "quadrig/io.hpp"

namespace quadrig::io {

/// Half-edges of `mesh`, both of a pair, ascending; what there is none of is told to `context`.
/// \param source_polygon one a face of `mesh`
[[nodiscard]] std::vector<Index> kept_halfedges(const PolygonMesh& input, const TriangleMesh<double>& mesh,
                                                const std::vector<Index>& source_polygon, const KeepOptions& options,
                                                const std::filesystem::path& path, Context& context);

}  // namespace quadrig::io
