// How far what is written of each primitive is from what was read.
#pragma once

#include "assemble.hpp"

namespace quadrig::gltf {

/// Each primitive that is written anew, at rest and in each morph target that moves it.
/// \cost O(states · triangles · log triangles). \fails cancelled
[[nodiscard]] Expected<std::vector<GltfPrimitive>> primitive_distances(const State& state, const Job& job,
                                                                       Context& context);

}  // namespace quadrig::gltf
