// Joints that hang together: glTF wants one root above all joints of a skin, in every scene that shows the skin.
#pragma once

#include "nodes.hpp"

namespace quadrig::gltf {

/// How many trees of joints lack a common root, or a scene that shows the skin; 0 where all is as it should be.
[[nodiscard]] Index loose_roots(const State& state, const NodeTree& tree, std::size_t skin);

/// Puts a node above the trees where they are several, and their root into the scenes that show the skin. No joint
/// moves. \pre the skin was read without an error
void join_roots(State& state, const NodeTree& tree, std::size_t skin);

}  // namespace quadrig::gltf
