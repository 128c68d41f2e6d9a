// Fewer triangles by meshoptimizer's simplifier.
#pragma once

#include "polygons.hpp"

namespace quadrig::gltf {

/// About as many of the shell's triangles as wanted, on vertices that were there; open borders stay. Empty where the
/// build has no meshoptimizer. \param positions of all vertices of the surface \cost O(n log n)
[[nodiscard]] std::vector<Polygon> simplified(std::span<const Polygon> triangles, const Points<double>& positions,
                                              Index wanted);

}  // namespace quadrig::gltf
