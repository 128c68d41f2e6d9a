// Rigged meshes made by code: what the tests, the demo and the documentation use. Part of the compiled target
// quadrig::io.
#pragma once

#include <span>
#include <string_view>

#include "quadrig/asset.hpp"

namespace quadrig {

/// A sample that make_sample knows.
struct SampleInfo {
  std::string_view name;
  std::string_view description;
  Index bones;
};

/// pear (2 bones end to end), box_torus (4 bones in a square), humanoid (21 bones), wing (4 bones side by side).
[[nodiscard]] std::span<const SampleInfo> sample_infos();

/// A closed surface of about `triangles` well-shaped triangles with a skeleton and smooth weights, the same bits at
/// every call. The surface is the zero of a smooth union of limbs, remeshed to even edge lengths; weights are the
/// equilibrium of heat between the bones and the surface (Baran and Popović 2007, eq. 2), each vertex drawn to the
/// bone of the limb it lies on, so that no limb pulls at its neighbour. The count is met within 10 % from 1000 on.
/// \fails bad_option on an unknown name or a count outside [500, 4 000 000]; cancelled.
/// \cost Linear in the triangles; about 10 s for a million.
[[nodiscard]] Expected<Asset> make_sample(std::string_view name, Index triangles, Context& context);

}  // namespace quadrig
