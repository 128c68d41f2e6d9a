// Sheets that lie over other shells: brows, lashes, decals, straps keep their side of what lies below.
#pragma once

#include "shells.hpp"

namespace quadrig::gltf {

/// Moves vertices of open shells that in the input lie close to another shell of the surface, so that they stay on
/// their side of it at a share of their distance: at rest, and in each morph target in which the input does. Shells
/// keep their quads; what is moved is in `Shell::moved`, or in the places and displacements of a field's quads. Returns
/// how many vertices moved. \cost O(states · vertices near others · log faces). \fails never; invalid once cancelled
Index keep_layers(const Gathered& gathered, Shells& shells, const Context& context);

}  // namespace quadrig::gltf
