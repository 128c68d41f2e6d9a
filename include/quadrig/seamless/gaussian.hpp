// Gaussian integers Z[i]: rotations by right angles and integer translations of charts, exactly.
#pragma once

#include "quadrig/core.hpp"

namespace quadrig {

struct Gaussian {
  std::int64_t re = 0, im = 0;

  friend bool operator==(const Gaussian&, const Gaussian&) = default;
  friend Gaussian operator+(Gaussian a, Gaussian b) { return {a.re + b.re, a.im + b.im}; }
  friend Gaussian operator-(Gaussian a, Gaussian b) { return {a.re - b.re, a.im - b.im}; }
  friend Gaussian operator*(Gaussian a, Gaussian b) { return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
  Gaussian operator-() const { return {-re, -im}; }
  Gaussian& operator+=(Gaussian b) { return *this = *this + b; }
  Gaussian& operator-=(Gaussian b) { return *this = *this - b; }
};

/// i^k z for any integer k, in one step.
[[nodiscard]] inline Gaussian rotated(Gaussian z, int k) {
  switch (k & 3) {
    case 0:
      return z;
    case 1:
      return {-z.im, z.re};
    case 2:
      return {-z.re, -z.im};
    default:
      return {z.im, -z.re};
  }
}
[[nodiscard]] inline Complex rotated(Complex z, int k) {
  switch (k & 3) {
    case 0:
      return z;
    case 1:
      return {-z.imag(), z.real()};
    case 2:
      return -z;
    default:
      return {z.imag(), -z.real()};
  }
}

/// a.re b.im − a.im b.re: twice the signed area that two edge vectors span.
[[nodiscard]] inline std::int64_t cross(Gaussian a, Gaussian b) { return a.re * b.im - a.im * b.re; }
[[nodiscard]] inline double cross(Complex a, Complex b) { return a.real() * b.imag() - a.imag() * b.real(); }

// What the elimination asks of a Euclidean ring, for Z and Z[i].
[[nodiscard]] inline std::int64_t ring_norm(std::int64_t a) { return a < 0 ? -a : a; }
[[nodiscard]] inline std::int64_t ring_norm(Gaussian a) { return a.re * a.re + a.im * a.im; }
[[nodiscard]] inline bool ring_zero(std::int64_t a) { return a == 0; }
[[nodiscard]] inline bool ring_zero(Gaussian a) { return a.re == 0 && a.im == 0; }
[[nodiscard]] inline bool ring_unit(std::int64_t a) { return a == 1 || a == -1; }
[[nodiscard]] inline bool ring_unit(Gaussian a) { return ring_norm(a) == 1; }
[[nodiscard]] inline std::int64_t one_of(std::int64_t) { return 1; }
[[nodiscard]] inline Gaussian one_of(Gaussian) { return {1, 0}; }
/// Inverse of a unit.
[[nodiscard]] inline std::int64_t unit_inverse(std::int64_t a) { return a; }
[[nodiscard]] inline Gaussian unit_inverse(Gaussian a) { return {a.re, -a.im}; }

/// Quotient whose remainder a − q b has a smaller norm than b. \pre b is not zero
[[nodiscard]] inline std::int64_t ring_quotient(std::int64_t a, std::int64_t b) {
  const std::int64_t q = a / b, r = a % b;
  return 2 * ring_norm(r) > ring_norm(b) ? q + ((r < 0) == (b < 0) ? 1 : -1) : q;
}
[[nodiscard]] inline Gaussian ring_quotient(Gaussian a, Gaussian b) {
  const Gaussian p = a * Gaussian{b.re, -b.im};
  const std::int64_t n = ring_norm(b);
  return {ring_quotient(p.re, n), ring_quotient(p.im, n)};
}
template <class R>
[[nodiscard]] R ring_gcd(R a, R b) {
  while (!ring_zero(b)) {
    const R r = a - ring_quotient(a, b) * b;
    a = b;
    b = r;
  }
  return a;
}

[[nodiscard]] inline double to_field(std::int64_t a) { return static_cast<double>(a); }
[[nodiscard]] inline Complex to_field(Gaussian a) { return {static_cast<double>(a.re), static_cast<double>(a.im)}; }

}  // namespace quadrig
