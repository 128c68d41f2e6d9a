// The head: its surface, what its morph targets move, and the sheets that lie over it.
#pragma once

#include <numbers>

#include "character.hpp"
#include "shape.hpp"

namespace quadrig::samples::head {

// Metres; x to its left, y up, z forward, the origin between the ears. All of it is its own image in x = 0.
inline constexpr double eye_x = 0.0315, eye_y = 0.011, eye_z = 0.0665, eye_radius = 0.0122;
inline constexpr double mouth_y = -0.062, lips_z = 0.093;
inline constexpr double neck_y = -0.2;     ///< the head's skin ends here, the body's begins
inline constexpr double bottom_y = -0.32;  ///< the body's ends
inline constexpr double seam_z = -0.035;   ///< texture islands of front and back meet here

inline constexpr double pi = std::numbers::pi;
inline const Vector3 eye(eye_x, eye_y, eye_z);

enum Joint : Index { chest, neck, skull, jaw, eye_l, eye_r };

/// The closed surface of head and bust with lids, the pockets behind them, lips, inner mouth, nostrils and ears; bones
/// chest, neck, head and jaw.
[[nodiscard]] Shape shape();
/// Weights of a point of the skin: chest, neck, head, jaw.
[[nodiscard]] Eigen::RowVector4d weights(const Vector3& p);
/// Behind the lids or the lips.
[[nodiscard]] bool in_pocket(const Vector3& p);

inline constexpr std::array<const char*, 6> morph_names{"blink_left", "blink_right", "jaw_open",
                                                        "smile",      "brow_up",     "pucker"};
/// Where a target moves a point of the resting surface, or of what lies over it.
[[nodiscard]] Vector3 displacement(std::size_t morph, const Vector3& p);

/// Heights of the margins of the left eye's lids above its middle, u to the left of it.
[[nodiscard]] double upper_margin(double u);
[[nodiscard]] double lower_margin(double u);

/// The character on a mesh of its skin: head and body in skins of their own, eyes, brows, lashes, hair, spectacles.
[[nodiscard]] Character character(const Shape& shape, const TriangleMesh<double>& skin);

// Sheets and solids over the skin, in the order of the materials of the character.
enum Material : std::size_t {
  skin_material,
  hair_material,
  eye_material,
  frame_material,
  glass_material,
  cloth_material
};
[[nodiscard]] Part eyes();
[[nodiscard]] Part brows_and_lashes(const Shape& shape);
[[nodiscard]] Part hair(const Shape& shape);
[[nodiscard]] Part spectacles();
[[nodiscard]] Part lenses();

}  // namespace quadrig::samples::head
