// Elementary functions by sums and products of doubles alone: the same bits on every processor that has IEEE 754 and by
// every compiler that neither fuses nor reorders them. Those of the C library are chosen by the processor as the
// program runs, and their last bits differ; whatever decides a result uses these.
#pragma once

#include "quadrig/core.hpp"

namespace quadrig::elementary {

/// Errors stay below 1 unit in the last place. Zeros, infinities and what is no number are as in <cmath>.
/// \cost a call of the C library's, about
/// Source: Dekker 1971 (products in pairs), Cody and Waite 1980 and Tang 1991 (reductions); polynomials by Remez's
/// exchange.
[[nodiscard]] QUADRIG_INLINE double exp(double x);
[[nodiscard]] QUADRIG_INLINE double log(double x);
[[nodiscard]] QUADRIG_INLINE double pow(double base, double exponent);
[[nodiscard]] QUADRIG_INLINE double cbrt(double x);
/// Above 2^20 the sine and cosine of a number within the last place of x.
[[nodiscard]] QUADRIG_INLINE double sin(double x);
[[nodiscard]] QUADRIG_INLINE double cos(double x);
struct SinCos {
  double sin, cos;
};
[[nodiscard]] QUADRIG_INLINE SinCos sincos(double x);
[[nodiscard]] QUADRIG_INLINE double asin(double x);
[[nodiscard]] QUADRIG_INLINE double acos(double x);
[[nodiscard]] QUADRIG_INLINE double atan2(double y, double x);

[[nodiscard]] inline float atan2(float y, float x) {
  return static_cast<float>(atan2(static_cast<double>(y), static_cast<double>(x)));
}
[[nodiscard]] inline float acos(float x) { return static_cast<float>(acos(static_cast<double>(x))); }

/// Of a complex number, in [−π, π].
template <class Real>
[[nodiscard]] Real arg(const std::complex<Real>& z) {
  return atan2(z.imag(), z.real());
}
[[nodiscard]] inline Complex log(const Complex& z) { return {log(std::abs(z)), atan2(z.imag(), z.real())}; }
[[nodiscard]] inline Complex polar(double length, double angle) {
  const SinCos at = sincos(angle);
  return {length * at.cos, length * at.sin};
}

/// The rotation about an axis. \pre the axis has length 1
[[nodiscard]] inline Eigen::Matrix3d rotation(double radians, const Vector3& axis) {
  const SinCos turn = sincos(radians);
  const Vector3 s = turn.sin * axis, c = (1 - turn.cos) * axis;
  const double xy = c.x() * axis.y(), xz = c.x() * axis.z(), yz = c.y() * axis.z();
  Eigen::Matrix3d matrix;
  matrix << c.x() * axis.x() + turn.cos, xy - s.z(), xz + s.y(),  //
      xy + s.z(), c.y() * axis.y() + turn.cos, yz - s.x(),        //
      xz - s.y(), yz + s.x(), c.z() * axis.z() + turn.cos;
  return matrix;
}

}  // namespace quadrig::elementary

#if !defined(QUADRIG_COMPILED)
#include "quadrig/elementary/elementary.ipp"
#endif
