#pragma once

#include <Eigen/Core>

#include <algorithm>

namespace quadrig {

/// Distance of a point from a segment, in the plane.
[[nodiscard]] inline double distance_to_segment(const Eigen::Vector2d& p, const Eigen::Vector2d& a,
                                                const Eigen::Vector2d& b) {
  const Eigen::Vector2d ab = b - a;
  const double squared = ab.squaredNorm(), t = squared > 0 ? std::clamp((p - a).dot(ab) / squared, 0.0, 1.0) : 0.0;
  return (p - a - t * ab).norm();
}

}  // namespace quadrig
