#include "quadrig/elementary.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "test.hpp"

using namespace quadrig;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

/// In units of the last place of what is exact.
double off(double value, long double exact) {
  const double near = std::abs(static_cast<double>(exact));
  const double unit = std::max(std::nextafter(near, infinity) - near, std::numeric_limits<double>::denorm_min());
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) / static_cast<long double>(unit));
}

/// Numbers of either sign whose logarithms are spread evenly.
struct Spread {
  std::mt19937_64 random{7};
  double operator()(double least_power, double most_power) {
    const double power = std::uniform_real_distribution<double>(least_power, most_power)(random);
    return std::ldexp(1 + static_cast<double>(random() >> 12) * 0x1p-52, static_cast<int>(power)) *
           (random() % 2 ? 1 : -1);
  }
};

bool same(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) || std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace

TEST_CASE("elementary: errors stay below one unit in the last place", "[elementary][fast]") {
  Spread spread;
  double exp = 0, log = 0, pow = 0, cbrt = 0, sin = 0, cos = 0, asin = 0, acos = 0, atan2 = 0;
  for (int k = 0; k < 20'000; ++k) {
    const double any = spread(-1000, 1000), size = std::abs(any), some = spread(-30, 9), turn = spread(-30, 20),
                 share = spread(-40, -1), base = std::abs(spread(-8, 8)), power = spread(-9, 5), other = spread(-9, 9);
    exp = std::max(exp, off(elementary::exp(some), std::exp(static_cast<long double>(some))));
    log = std::max(log, off(elementary::log(size), std::log(static_cast<long double>(size))));
    log = std::max(log, off(elementary::log(1 + share), std::log(static_cast<long double>(1 + share))));
    pow = std::max(pow, off(elementary::pow(base, power), std::pow(static_cast<long double>(base), power)));
    cbrt = std::max(cbrt, off(elementary::cbrt(any), std::cbrt(static_cast<long double>(any))));
    sin = std::max(sin, off(elementary::sin(turn), std::sin(static_cast<long double>(turn))));
    cos = std::max(cos, off(elementary::cos(turn), std::cos(static_cast<long double>(turn))));
    for (const double x : {share, std::copysign(1 - std::abs(share), share)}) {
      asin = std::max(asin, off(elementary::asin(x), std::asin(static_cast<long double>(x))));
      acos = std::max(acos, off(elementary::acos(x), std::acos(static_cast<long double>(x))));
    }
    for (const double x : {other, any})
      atan2 = std::max(atan2, off(elementary::atan2(x, some), std::atan2(static_cast<long double>(x), some)));
  }
  for (const double worst : {exp, log, pow, cbrt, sin, cos, asin, acos, atan2}) {
    CHECK(worst < 1);
    CHECK(worst > 0.4);  // they are rounded, so that something was compared
  }
}

TEST_CASE("elementary: the same bits everywhere", "[elementary][fast]") {
  // Of the same arguments on any machine; what the C library gives differs by processor.
  std::uint64_t hash = 14695981039346656037U;
  const auto take = [&](double value) { hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 1099511628211U; };
  Spread spread;
  for (int k = 0; k < 2000; ++k) {
    const std::uint64_t bits = spread.random();
    const double x = static_cast<double>(bits >> 11) * 0x1p-53,
                 y = static_cast<double>(spread.random() >> 11) * 0x1p-51;
    take(elementary::exp(y - 3 * x));
    take(elementary::log(x + y));
    take(elementary::pow(x, y));
    take(elementary::cbrt(y));
    take(elementary::sin(9 * x)), take(elementary::cos(9 * x));
    take(elementary::asin(x)), take(elementary::acos(-x));
    take(elementary::atan2(y - 2, x));
  }
  CHECK(hash == 0xaabf337bce1cd26bU);
}

TEST_CASE("elementary: zeros, infinities and what is no number are as in the C library", "[elementary][fast]") {
  const double special[] = {0.0, -0.0, 1, -1, infinity, -infinity, no_number, 2, -2, 0.5, -0.5, 3, -3};
  for (const double x : special) {
    INFO(x);
    if (x == 0 || !std::isfinite(x)) {
      CHECK(same(elementary::exp(x), std::exp(x)));
      CHECK(same(elementary::log(x), std::log(x)));
      CHECK(same(elementary::cbrt(x), std::cbrt(x)));
      CHECK(same(elementary::sin(x), std::sin(x)));
      CHECK(same(elementary::cos(x), std::cos(x)));
      CHECK(same(elementary::asin(x), std::asin(x)));
      CHECK(same(elementary::acos(x), std::acos(x)));
    }
    for (const double y : special) {
      INFO(y);
      const double power = std::pow(x, y);
      if (power == 0 || std::abs(power) == 1 || !std::isfinite(power)) CHECK(same(elementary::pow(x, y), power));
      CHECK(same(elementary::atan2(y, x), std::atan2(y, x)));
    }
  }
  CHECK(elementary::exp(800) == infinity);
  CHECK(same(elementary::exp(-800), 0));
}

TEST_CASE("elementary: rotations keep lengths and add up", "[elementary][fast]") {
  const Vector3 axis = Vector3(1, -2, 0.5).normalized();
  const Eigen::Matrix3d third = elementary::rotation(2 * std::numbers::pi / 3, axis);
  CHECK((third * third.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-15);
  CHECK((third * third * third - Eigen::Matrix3d::Identity()).norm() < 1e-14);
  CHECK((third * axis - axis).norm() < 1e-15);
  CHECK((elementary::rotation(std::numbers::pi / 2, Vector3::UnitZ()) * Vector3::UnitX() - Vector3::UnitY()).norm() <
        1e-15);
  const Complex z = elementary::polar(2, 0.75);
  CHECK(elementary::arg(z) == Approx(0.75));
}
