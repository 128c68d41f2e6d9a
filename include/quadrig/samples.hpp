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

/// pear (2 bones end to end), box_torus (4 bones in a square), humanoid (21 bones), head (4 bones), wing (4 bones side
/// by side).
[[nodiscard]] std::span<const SampleInfo> sample_infos();

/// A closed surface of about `triangles` well-shaped triangles with a skeleton and smooth weights, the same bits at
/// every call. The surface is the zero of a smooth union of limbs, remeshed to even edge lengths; weights are the
/// equilibrium of heat between the bones and the surface (Baran and Popović 2007, eq. 2), each vertex drawn to the
/// bone of the limb it lies on, so that no limb pulls at its neighbour. The count is met within 10 % from 1000 on.
/// \fails bad_option on an unknown name or a count outside [500, 4 000 000]; cancelled.
/// \cost Linear in the triangles; about 10 s for a million.
[[nodiscard]] Expected<Asset> make_sample(std::string_view name, Index triangles, Context& context);

/// The sample as a binary glTF file: the same surface with a skin. `head` is a character there: the skin ends in open
/// borders at the neck, where a body of another skin meets it, and further down; eyes behind lids, brows and lashes as
/// sheets over the face, hair cards, spectacles that hang on the head's joint; texture islands and images; six
/// materials; the morph targets blink_left, blink_right, jaw_open, smile, brow_up and pucker; a clip. Skin and sheets
/// are their own images in x = 0. \fails as make_sample
[[nodiscard]] Expected<std::string> make_sample_glb(std::string_view name, Index triangles, Context& context);

}  // namespace quadrig
