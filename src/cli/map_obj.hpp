// A map as an OBJ: triangles with the grid of the quads as texture coordinates.
#pragma once

#include <span>
#include <string>

#include "quadrig/pipeline.hpp"

namespace quadrig::cli {

/// Triangles `f v/vt …` with one coordinate unit a quad, cut edges as lines `l` and singular vertices as points `p`, in
/// groups by the quads around them.
[[nodiscard]] std::string map_obj_text(std::span<const ComponentMap> maps);

}  // namespace quadrig::cli
