// A frame a face, and the polynomial whose roots its vectors are.
#pragma once

#include <atomic>
#include <numbers>

#include "quadrig/terms.hpp"

namespace quadrig {

/// One frame a face, in the face's basis (Connection): the four vectors ±u, ±v, with v counter-clockwise of u by an
/// angle in (0, π). A magnitude is a density of lines, one over length up to a factor: the wanted quad edges are
/// u / |u|² and v / |v|².
struct FrameField {
  std::vector<Complex> u, v;
  [[nodiscard]] Index face_count() const { return static_cast<Index>(u.size()); }
};

/// P(z) = z⁴ + x1 z² + x0 a face, with roots ±u, ±v: x0 = u²v², x1 = −(u² + v²). Source: thesis 3.2, Diamanti et al.
/// 2014.
struct PolyVectorField {
  std::vector<Complex> x0, x1;
};

/// Angle from u to v, radians in (0, π) for a frame of a FrameField.
[[nodiscard]] inline double opening_angle(Complex u, Complex v) { return elementary::arg(v * std::conj(u)); }

/// β = arg u + ½ arg(v / u): the cross that bisects the frame, radians. 4β is the phase of x0. Source: design of
/// principal matching on frames that need not be orthogonal, Vaxman et al. 2016.
[[nodiscard]] inline double bisector_angle(Complex u, Complex v) {
  return elementary::arg(u) + opening_angle(u, v) / 2;
}

/// Bounds on frames: what lies outside is brought to the bound, the bisector cross kept.
struct FrameLimits {
  double least_angle_radians = 25 * std::numbers::pi / 180;  ///< between u and ±v
  double largest_ratio = 8;                                  ///< of |u| and |v|, either way
};

struct Frame {
  Complex u, v;
};

/// The vectors of one polynomial as they are: u² and v² are the roots t± of t² + x1 t + x0.
[[nodiscard]] inline Frame raw_roots(Complex x0, Complex x1) {
  const Complex root = std::sqrt(x1 * x1 - 4.0 * x0);
  return {std::sqrt((-x1 + root) / 2.0), std::sqrt((-x1 - root) / 2.0)};
}

/// Frames from roots, v turned to be counter-clockwise of u, within the limits.
struct Roots {
  FrameField frames;
  Index bounded = 0;  ///< faces that had to be brought within the limits
};

/// Threads: those of the context. \cost O(m). \fails never: where x0 = x1 = 0 the frame is the face's basis, its length
///   0 made 1.
[[nodiscard]] inline Roots roots(const PolyVectorField& field, const FrameLimits& limits = {},
                                 const Context* context = nullptr) {
  const std::size_t m = field.x0.size();
  Roots result;
  result.frames.u.resize(m);
  result.frames.v.resize(m);
  std::atomic<Index> bounded{0};
  parallel_each(context, m, [&](std::size_t f) {
    auto [u, v] = raw_roots(field.x0[f], field.x1[f]);
    double opening = opening_angle(u, v);
    if (opening < 0) {
      v = -v;
      opening += std::numbers::pi;
    }
    double length_u = std::abs(u), length_v = std::abs(v);
    const double largest = std::max(length_u, length_v);
    const double beta = elementary::arg(u) + opening / 2;
    const bool narrow = opening < limits.least_angle_radians || opening > std::numbers::pi - limits.least_angle_radians;
    const bool unequal = std::min(length_u, length_v) * limits.largest_ratio < largest;
    if (!(largest > 0)) {
      u = Complex(1, 0);
      v = Complex(0, 1);
      ++bounded;
    } else if (narrow || unequal) {
      // Of two nearly equal roots one sign of v gives a narrow frame and the other a wide one with the bisector a
      // quarter turn away: the same cross.
      length_u = std::max(length_u, largest / limits.largest_ratio);
      length_v = std::max(length_v, largest / limits.largest_ratio);
      opening = std::clamp(opening, limits.least_angle_radians, std::numbers::pi - limits.least_angle_radians);
      u = elementary::polar(length_u, beta - opening / 2);
      v = elementary::polar(length_v, beta + opening / 2);
      ++bounded;
    }
    result.frames.u[f] = u;
    result.frames.v[f] = v;
  });
  result.bounded = bounded;
  return result;
}

/// The polynomial of each frame. \cost O(m). \fails never
[[nodiscard]] inline PolyVectorField coefficients(const FrameField& frames) {
  PolyVectorField field;
  field.x0.reserve(frames.u.size());
  field.x1.reserve(frames.u.size());
  for (std::size_t f = 0; f < frames.u.size(); ++f) {
    const Complex u2 = frames.u[f] * frames.u[f], v2 = frames.v[f] * frames.v[f];
    field.x0.push_back(u2 * v2);
    field.x1.push_back(-(u2 + v2));
  }
  return field;
}

}  // namespace quadrig
