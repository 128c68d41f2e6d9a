// A seamless map on few triangles: flips and collapses that keep the flat metric, until little more than the cones is
// left. What is quantized is this map, and quads can be extracted from it alone.
#pragma once

#include "quadrig/seamless/poisson.hpp"

namespace quadrig {

/// Triangles of a flat cone metric over vertices of the fine mesh. Half-edge h = 3 f + i as in TriangleMesh.
struct CoarseMap {
  std::vector<Index> origin;          ///< fine vertex
  std::vector<Index> twin;            ///< no_index on the border
  std::vector<std::int8_t> rotation;  ///< to the chart of the twin's face
  std::vector<Complex> vector;        ///< z(target) − z(origin), in the chart of the face
  std::vector<Aligned> aligned;       ///< border and crease edges
  std::vector<double> direction;      ///< angle of the edge at its origin, counter-clockwise from the fine mesh's
                                      ///< outgoing(origin), measured in the map
  std::vector<LinearExpression<Gaussian>> expression;  ///< `vector` over vertex and branch variables

  [[nodiscard]] Index face_count() const { return static_cast<Index>(origin.size() / 3); }
  [[nodiscard]] Index halfedge_count() const { return static_cast<Index>(origin.size()); }
};

/// \pre the map is valid (check_map), z its corner parameters.
/// \cost about O(m log m). Empty once the context, where there is one, is cancelled.
[[nodiscard]] QUADRIG_INLINE CoarseMap decimate_map(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                    const std::vector<Index>& index,
                                                    const std::vector<Aligned>& aligned, const std::vector<Complex>& z,
                                                    const Context* context = nullptr);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quantize/coarse_map.ipp"
#endif
