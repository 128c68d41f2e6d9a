#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "quadrig/elementary.hpp"

namespace quadrig::elementary {
namespace detail {

/// The sum of two numbers, the second far smaller: some 106 bits.
struct Pair {
  double high = 0, low = 0;
};
inline constexpr Pair pi{0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53},
    half_pi{0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54},
    ln2{0x1.62e42fefa3800p-1, 0x1.ef35793c76730p-45};  // its high part times an exponent is exact
inline constexpr double infinity = std::numeric_limits<double>::infinity();

inline Pair sum(double a, double b) {
  const double s = a + b, part = s - a;
  return {s, (a - (s - part)) + (b - part)};
}
/// \pre |a| >= |b|, or a is 0
inline Pair ordered_sum(double a, double b) {
  const double s = a + b;
  return {s, b - (s - a)};
}
inline Pair sum(const Pair& a, const Pair& b) {
  const Pair s = sum(a.high, b.high);
  return ordered_sum(s.high, s.low + (a.low + b.low));
}
inline Pair negative(const Pair& a) { return {-a.high, -a.low}; }
/// \pre no number is above 2^990
inline Pair product(double a, double b) {
  constexpr double halves = 134217729;  // 2^27 + 1
  const double p = a * b, wide_a = halves * a, wide_b = halves * b;
  const double a1 = wide_a - (wide_a - a), b1 = wide_b - (wide_b - b), a2 = a - a1, b2 = b - b1;
  return {p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2};
}
inline Pair product(const Pair& a, double b) {
  const Pair p = product(a.high, b);
  return ordered_sum(p.high, p.low + a.low * b);
}
inline Pair quotient(const Pair& a, const Pair& b) {
  const double inverse = 1 / b.high, q = a.high * inverse;
  const Pair back = product(q, b.high);
  return ordered_sum(q, ((a.high - back.high) - back.low + a.low - q * b.low) * inverse);
}

template <std::size_t n>
double polynomial(double x, const std::array<double, n>& coefficients) {
  double value = coefficients[n - 1];
  for (std::size_t k = n - 1; k-- > 0;) value = value * x + coefficients[k];
  return value;
}

/// The whole number nearest to x. \pre |x| < 2^51
inline double nearest(double x) {
  constexpr double shift = 6755399441055744;  // 1.5 · 2^52
  return (x + shift) - shift;
}
/// 2^e. \pre the exponent of a normal number
inline double power_of_two(int e) { return std::bit_cast<double>(static_cast<std::uint64_t>(e + 1023) << 52); }

/// 2^(j/32).
inline constexpr std::array<Pair, 32> powers{{{0x1.0000000000000p+0, 0x0.0p+0},
                                              {0x1.059b0d3158574p+0, 0x1.d73e2a475b465p-55},
                                              {0x1.0b5586cf9890fp+0, 0x1.8a62e4adc610bp-54},
                                              {0x1.11301d0125b51p+0, -0x1.6c51039449b3ap-54},
                                              {0x1.172b83c7d517bp+0, -0x1.19041b9d78a76p-55},
                                              {0x1.1d4873168b9aap+0, 0x1.e016e00a2643cp-54},
                                              {0x1.2387a6e756238p+0, 0x1.9b07eb6c70573p-54},
                                              {0x1.29e9df51fdee1p+0, 0x1.612e8afad1255p-55},
                                              {0x1.306fe0a31b715p+0, 0x1.6f46ad23182e4p-55},
                                              {0x1.371a7373aa9cbp+0, -0x1.63aeabf42eae2p-54},
                                              {0x1.3dea64c123422p+0, 0x1.ada0911f09ebcp-55},
                                              {0x1.44e086061892dp+0, 0x1.89b7a04ef80d0p-59},
                                              {0x1.4bfdad5362a27p+0, 0x1.d4397afec42e2p-56},
                                              {0x1.5342b569d4f82p+0, -0x1.07abe1db13cadp-55},
                                              {0x1.5ab07dd485429p+0, 0x1.6324c054647adp-54},
                                              {0x1.6247eb03a5585p+0, -0x1.383c17e40b497p-54},
                                              {0x1.6a09e667f3bcdp+0, -0x1.bdd3413b26456p-54},
                                              {0x1.71f75e8ec5f74p+0, -0x1.16e4786887a99p-55},
                                              {0x1.7a11473eb0187p+0, -0x1.41577ee04992fp-55},
                                              {0x1.82589994cce13p+0, -0x1.d4c1dd41532d8p-54},
                                              {0x1.8ace5422aa0dbp+0, 0x1.6e9f156864b27p-54},
                                              {0x1.93737b0cdc5e5p+0, -0x1.75fc781b57ebcp-57},
                                              {0x1.9c49182a3f090p+0, 0x1.c7c46b071f2bep-56},
                                              {0x1.a5503b23e255dp+0, -0x1.d2f6edb8d41e1p-54},
                                              {0x1.ae89f995ad3adp+0, 0x1.7a1cd345dcc81p-54},
                                              {0x1.b7f76f2fb5e47p+0, -0x1.5584f7e54ac3bp-56},
                                              {0x1.c199bdd85529cp+0, 0x1.11065895048ddp-55},
                                              {0x1.cb720dcef9069p+0, 0x1.503cbd1e949dbp-56},
                                              {0x1.d5818dcfba487p+0, 0x1.2ed02d75b3707p-55},
                                              {0x1.dfc97337b9b5fp+0, -0x1.1a5cd4f184b5cp-54},
                                              {0x1.ea4afa2a490dap+0, -0x1.e9c23179c2893p-54},
                                              {0x1.f50765b6e4540p+0, 0x1.9d3e12dd8a18bp-54}}};
/// e^(x.high + x.low).
inline double exp(const Pair& x) {
  if (!(x.high < 709.79)) return x.high < infinity ? infinity : x.high;
  if (x.high < -745.14) return 0;
  // x = (32 m + j) ln 2 / 32 + r
  constexpr double per_step = 0x1.71547652b82fep+5, step_high = 0x1.62e42fefa0000p-6, step_low = 0x1.cf79abc9e3b3ap-45;
  const double k = nearest(x.high * per_step);
  const int whole = static_cast<int>(k), m = whole >> 5;
  const Pair r = sum(x.high - k * step_high, x.low - k * step_low);
  constexpr std::array<double, 5> coefficients{0x1.0000000000000p-1, 0x1.555555554d865p-3, 0x1.555555554b2bcp-5,
                                               0x1.111150cbf1c34p-7, 0x1.6c171aae26628p-10};
  const double rest = r.high + (r.low + r.high * r.high * polynomial(r.high, coefficients));
  const Pair& power = powers[static_cast<std::size_t>(whole & 31)];
  const double value = power.high + (power.low + power.high * rest);
  // In two steps, which neither overflow nor lose bits before the last.
  return value * power_of_two(m / 2) * power_of_two(m - m / 2);
}

/// Of j from 45 on.
struct Logarithm {
  double factor = 0;  ///< the multiple of 1/1024 nearest to 64/j
  Pair less;          ///< −log of it
};
inline constexpr std::array<Logarithm, 47> logarithms{
    {{0x1.6c00000000000p+0, {-0x1.686c81e9b14afp-2, 0x1.ddea0f7f58e3dp-57}},
     {0x1.6440000000000p+0, {-0x1.5262deeb98879p-2, -0x1.823ddad7fcfa1p-58}},
     {0x1.5c80000000000p+0, {-0x1.3bdd24eb14b6ap-2, -0x1.2da3c6449a7d0p-58}},
     {0x1.5540000000000p+0, {-0x1.26561f133862dp-2, -0x1.10cdf548bd15cp-57}},
     {0x1.4e40000000000p+0, {-0x1.111ce4003ee4dp-2, 0x1.1b84b5a5b5b2ap-57}},
     {0x1.47c0000000000p+0, {-0x1.fa01c3bb57cbcp-3, -0x1.1c0a3c50f47adp-59}},
     {0x1.4140000000000p+0, {-0x1.d0fb7f2255e51p-3, 0x1.4ac818ceca4c4p-57}},
     {0x1.3b00000000000p+0, {-0x1.a8becfc882f19p-3, 0x1.e8c37918c39ebp-58}},
     {0x1.3540000000000p+0, {-0x1.83040c91bcf2ep-3, 0x1.1c7233219bcc5p-57}},
     {0x1.2f80000000000p+0, {-0x1.5c940075972b9p-3, -0x1.adccb73379cc5p-58}},
     {0x1.2a00000000000p+0, {-0x1.371fc201e8f74p-3, -0x1.de6cb62af18a0p-58}},
     {0x1.2480000000000p+0, {-0x1.10f8e422539b1p-3, -0x1.8f798d39f1b7dp-58}},
     {0x1.1f80000000000p+0, {-0x1.db5270187d927p-4, -0x1.e15ab8607d2acp-58}},
     {0x1.1a80000000000p+0, {-0x1.9375e55595edep-4, 0x1.e463f9e4dd920p-59}},
     {0x1.15c0000000000p+0, {-0x1.4e01108a35ae6p-4, 0x1.81069d28db75bp-59}},
     {0x1.1100000000000p+0, {-0x1.075983598e471p-4, -0x1.80da5333c45b8p-59}},
     {0x1.0c80000000000p+0, {-0x1.868a83083f6cfp-5, 0x1.d09a5634943dbp-61}},
     {0x1.0840000000000p+0, {-0x1.03d5d85e73eefp-5, -0x1.2c1da539d60edp-61}},
     {0x1.0400000000000p+0, {-0x1.fc0a8b0fc03e4p-7, 0x1.83092c59642a1p-62}},
     {0x1.0000000000000p+0, {0x0.0p+0, 0x0.0p+0}},
     {0x1.f800000000000p-1, {0x1.0205658935847p-6, 0x1.27c8e8416e71fp-60}},
     {0x1.f080000000000p-1, {0x1.f7a9b16782856p-6, -0x1.36c720c147756p-60}},
     {0x1.e900000000000p-1, {0x1.788595a3577bap-5, 0x1.e5ef898b67923p-59}},
     {0x1.e200000000000p-1, {0x1.eea31c006b87cp-5, -0x1.3e4fc93b7b66cp-59}},
     {0x1.db00000000000p-1, {0x1.333d7f8183f4bp-4, 0x1.a92afc8ef70b1p-58}},
     {0x1.d400000000000p-1, {0x1.700d30aeac0e1p-4, -0x1.72566212cdd05p-61}},
     {0x1.cd80000000000p-1, {0x1.a956d3ecade63p-4, 0x1.e5300b12bd55ep-58}},
     {0x1.c700000000000p-1, {0x1.e3707ee30487bp-4, 0x1.09ccecd579d99p-58}},
     {0x1.c100000000000p-1, {0x1.0ce7ecdccc28dp-3, -0x1.692a0055dc959p-57}},
     {0x1.bb00000000000p-1, {0x1.28753bc11aba5p-3, -0x1.6394d9fa33311p-57}},
     {0x1.b500000000000p-1, {0x1.4462b9dc9b3dcp-3, -0x1.629c46c186385p-58}},
     {0x1.af00000000000p-1, {0x1.60b3100b09476p-3, -0x1.5b2623e05016bp-58}},
     {0x1.a980000000000p-1, {0x1.7b0091651528cp-3, 0x1.4069f303518c8p-57}},
     {0x1.a400000000000p-1, {0x1.95a5adcf7017fp-3, 0x1.142c507fb7a3dp-58}},
     {0x1.9f00000000000p-1, {0x1.ae2ca6f672bd4p-3, 0x1.ab5ca9eaa088ap-57}},
     {0x1.9980000000000p-1, {0x1.c97f8079d44ecp-3, 0x1.61a8c6e6c4ee7p-57}},
     {0x1.9480000000000p-1, {0x1.e2a877a6b2c12p-3, -0x1.fa21e3df99430p-58}},
     {0x1.8f80000000000p-1, {0x1.fc218be620a5ep-3, -0x1.6e438c258187fp-58}},
     {0x1.8b00000000000p-1, {0x1.09aa572e6c6d4p-2, 0x1.43c2e68684d53p-57}},
     {0x1.8600000000000p-1, {0x1.16b5ccbacfb73p-2, 0x1.66fbd28b40935p-56}},
     {0x1.8180000000000p-1, {0x1.22981fbef797bp-2, -0x1.0b04ac06cebe0p-59}},
     {0x1.7d00000000000p-1, {0x1.2e9e2bce12286p-2, 0x1.8251a3b83d97ap-62}},
     {0x1.7880000000000p-1, {0x1.3ac8ca38e5c5fp-2, -0x1.f7de015f253eep-56}},
     {0x1.7480000000000p-1, {0x1.45b8c0a17df13p-2, 0x1.dbe305eaf5a20p-56}},
     {0x1.7000000000000p-1, {0x1.522ae0738a3d8p-2, -0x1.8f7e9b38a6979p-57}},
     {0x1.6c00000000000p-1, {0x1.5d5bddf595f30p-2, -0x1.6541148cbb8a2p-56}},
     {0x1.6800000000000p-1, {0x1.68ac83e9c6a14p-2, 0x1.a64eadd740178p-58}}}};
/// \pre x is positive and finite
inline Pair log(double x) {
  int exponent = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= power_of_two(54);
    exponent = -54;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  exponent += static_cast<int>(bits >> 52) - 1023;
  double f = std::bit_cast<double>((bits & 0xfffffffffffff) | 0x3ff0000000000000);
  if (f > std::numbers::sqrt2) {
    f /= 2;
    ++exponent;
  }
  const Logarithm& near = logarithms[static_cast<std::size_t>(nearest(f * 64)) - 45];
  const Pair scaled = product(f, near.factor);
  const Pair r = ordered_sum(scaled.high - 1, scaled.low);
  // log(1 + r) = r − r²/2 + r³ (…)
  constexpr std::array<double, 8> coefficients{0x1.5555555555555p-2,  -0x1.0000000000000p-2, 0x1.999999999acf8p-3,
                                               -0x1.555555555862dp-3, 0x1.249248a2d86a4p-3,  -0x1.fffffe6b93addp-4,
                                               0x1.c73f32ad52fecp-4,  -0x1.99c16d800d0e9p-4};
  Pair square = product(r.high, r.high);
  square.low += 2 * r.high * r.low;
  const Pair head = sum(r, {-square.high / 2, -square.low / 2});
  const Pair small = ordered_sum(head.high, head.low + r.high * square.high * polynomial(r.high, coefficients));
  const Pair coarse = sum({exponent * ln2.high, exponent * ln2.low}, near.less);
  return sum(coarse, small);
}

/// Less a multiple of π/2, and that multiple modulo 4.
struct Reduced {
  Pair x;
  int quarter = 0;
};
/// \pre x is finite
inline Reduced reduced(double x) {
  constexpr double exact = 1 << 20;
  if (std::abs(x) <= 0.78539816339744830962) return {{x, 0}, 0};
  if (std::abs(x) > exact) x = std::fmod(x, pi.high * 2);  // exact, of a period that is off by half a last place
  constexpr double first = 0x1.921fb54400000p+0, second = 0x1.0b4611a600000p-34,
                   third = 0x1.3198a2e037073p-69;  // of π/2: 33 bits, 33 bits, the rest
  const double k = nearest(x * 0x1.45f306dc9c883p-1);
  const Pair a = sum(x - k * first, -(k * second));
  return {ordered_sum(a.high, a.low - k * third), static_cast<int>(static_cast<std::int64_t>(k) & 3)};
}
/// \pre |x| is at most π/4
inline double sin(const Pair& x) {
  constexpr std::array<double, 6> coefficients{-0x1.5555555555555p-3, 0x1.1111111110b25p-7,   -0x1.a01a019e6278dp-13,
                                               0x1.71de376be13d8p-19, -0x1.ae5fdef6f4ad2p-26, 0x1.5dfb61e792206p-33};
  const double z = x.high * x.high;
  return x.high + (x.high * z * polynomial(z, coefficients) + x.low * (1 - z / 2));
}
inline double cos(const Pair& x) {
  constexpr std::array<double, 6> coefficients{0x1.5555555555555p-5,   -0x1.6c16c16c16920p-10, 0x1.a01a019f3e0fap-16,
                                               -0x1.27e4fa027ca7cp-22, 0x1.1eeb52da84d55p-29,  -0x1.906de5469ad23p-37};
  const double z = x.high * x.high, head = 1 - z / 2;
  return head + (((1 - head) - z / 2) + (z * z * polynomial(z, coefficients) - x.high * x.low));
}

/// atan(k/8).
inline constexpr std::array<Pair, 9> arctangents{{{0x0.0p+0, 0x0.0p+0},
                                                  {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
                                                  {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                                  {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
                                                  {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                                  {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
                                                  {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                                  {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
                                                  {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}}};
/// atan(y/x). \pre 0 <= y <= x, and x is within [1e-200, 1e200]
inline Pair arctangent(const Pair& y, const Pair& x) {
  const double slope = y.high / x.high;
  // atan(y/x) = atan c + atan((y − c x) / (x + c y))
  const double k = nearest(8 * slope), c = k / 8;
  const Pair z = k == 0 ? quotient(y, x) : quotient(sum(y, product(x, -c)), sum(x, product(y, c)));
  constexpr std::array<double, 5> coefficients{-0x1.5555555555551p-2, 0x1.9999999980993p-3, -0x1.24924873beae2p-3,
                                               0x1.c71906069dc6ep-4, -0x1.70e70a891efb9p-4};
  const double square = z.high * z.high;
  const Pair rest = ordered_sum(z.high, z.low + z.high * square * polynomial(square, coefficients));
  return sum(arctangents[static_cast<std::size_t>(k)], rest);
}
/// The angle of a direction; what its signs say. \pre y and x are finite, not both 0, and the larger is as for
/// arctangent
inline double angle(const Pair& y, const Pair& x) {
  const Pair up = std::signbit(y.high) ? negative(y) : y, right = std::signbit(x.high) ? negative(x) : x;
  Pair a = up.high > right.high ? sum(half_pi, negative(arctangent(right, up))) : arctangent(up, right);
  if (std::signbit(x.high)) a = sum(pi, negative(a));
  return std::copysign(a.high + a.low, y.high);
}

/// √(1 − x²). \pre |x| <= 1
inline Pair other_leg(double x) {
  const Pair less = sum(1, -x), more = sum(1, x);
  Pair square = product(less.high, more.high);
  square.low += less.high * more.low + less.low * more.high;
  const double root = std::sqrt(square.high);
  if (root == 0) return {};
  const Pair back = product(root, root);
  return ordered_sum(root, ((square.high - back.high) - back.low + square.low) / (2 * root));
}

}  // namespace detail

QUADRIG_INLINE double exp(double x) { return detail::exp(detail::Pair{x, 0}); }

QUADRIG_INLINE double log(double x) {
  if (!(x > 0)) return x == 0 ? -detail::infinity : std::numeric_limits<double>::quiet_NaN();
  return x < detail::infinity ? detail::log(x).high : x;
}

QUADRIG_INLINE double pow(double base, double exponent) {
  if (exponent == 0 || base == 1 || (base == -1 && std::isinf(exponent))) return 1;
  if (std::isnan(base) || std::isnan(exponent)) return base + exponent;
  const double size = std::abs(base);
  const bool whole = std::floor(exponent) == exponent, odd = whole && std::fmod(exponent, 2) != 0;
  double sign = 1;
  if (std::signbit(base) && odd) sign = -1;
  if (base < 0 && base > -detail::infinity && !whole) return std::numeric_limits<double>::quiet_NaN();
  if (size == 1) return sign;
  if (std::isinf(exponent)) return (size > 1) == (exponent > 0) ? detail::infinity : 0;
  if (size == 0 || size == detail::infinity) return sign * ((size == 0) == (exponent > 0) ? 0.0 : detail::infinity);
  const detail::Pair log = detail::log(size);
  const double about = log.high * exponent;
  if (!(std::abs(about) < 800)) return sign * (about > 0 ? detail::infinity : 0);
  if (std::abs(exponent) < 1e-200) return sign;
  return sign * detail::exp(detail::product(log, exponent));
}

QUADRIG_INLINE double cbrt(double x) {
  if (x == 0 || !(std::abs(x) < detail::infinity)) return x;
  const detail::Pair third = detail::quotient(detail::log(std::abs(x)), {3, 0});
  return std::copysign(detail::exp(third), x);
}

QUADRIG_INLINE SinCos sincos(double x) {
  if (!(std::abs(x) < detail::infinity)) return {x - x, x - x};
  if (std::abs(x) < 0x1p-28) return {x, 1};
  const detail::Reduced r = detail::reduced(x);
  const double s = detail::sin(r.x), c = detail::cos(r.x);
  switch (r.quarter) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}
QUADRIG_INLINE double sin(double x) { return sincos(x).sin; }
QUADRIG_INLINE double cos(double x) { return sincos(x).cos; }

QUADRIG_INLINE double asin(double x) {
  if (!(std::abs(x) <= 1)) return std::numeric_limits<double>::quiet_NaN();
  if (std::abs(x) < 0x1p-500) return x;
  return detail::angle({x, 0}, detail::other_leg(x));
}
QUADRIG_INLINE double acos(double x) {
  if (!(std::abs(x) <= 1)) return std::numeric_limits<double>::quiet_NaN();
  return detail::angle(detail::other_leg(x), {x, 0});
}

QUADRIG_INLINE double atan2(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double most = std::max(std::abs(y), std::abs(x));
  if (most == detail::infinity) {
    y = std::copysign(std::isinf(y) ? 1.0 : 0.0, y);
    x = std::copysign(std::isinf(x) ? 1.0 : 0.0, x);
  } else if (most == 0) {
    x = std::copysign(1.0, x);
  } else if (const double least = std::min(std::abs(y), std::abs(x)); least < most * 0x1p-80) {
    if (std::abs(y) == most) return std::copysign(detail::half_pi.high, y);
    return std::signbit(x) ? std::copysign(detail::pi.high, y) : y / x;
  } else if (most > 1e150 || most < 1e-150) {
    const double scale = most > 1 ? 0x1p-600 : 0x1p600;
    y *= scale, x *= scale;
  }
  return detail::angle({y, 0}, {x, 0});
}

}  // namespace quadrig::elementary
