// How many quads each component is asked for.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "quadrig/core.hpp"

namespace quadrig::detail {

/// Fewer close no surface: a box. A sheet is one quad if need be.
inline constexpr double least_quads = 6, least_of_sheet = 1;

/// Quads due to each component in proportion to `share`. The smallest components get more than their share; the others
/// give up to half of theirs for it.
/// \param least of each component: `least_quads`, or `least_of_sheet` \pre shares are positive
[[nodiscard]] inline std::vector<double> quads_due(const std::vector<double>& share, double quads,
                                                   const std::vector<double>& least) {
  std::vector<double> due(share.size());
  double left = quads, rest = 0;
  for (const double s : share) rest += s;
  const double total = rest;
  for (bool again = true; again;) {
    again = false;
    for (std::size_t c = 0; c < share.size(); ++c) {
      if (due[c] > 0 || !(left * share[c] < least[c] * rest)) continue;
      due[c] = least[c];
      left -= due[c];
      rest -= share[c];
      again = left > 0;
    }
  }
  left = std::max(left, 0.5 * quads * rest / total);
  for (std::size_t c = 0; c < share.size(); ++c)
    if (!(due[c] > 0)) due[c] = std::max(1.0, left * share[c] / rest);
  return due;
}

/// Small components can only change by whole strips, so their counts are coarse. If many err in the same direction,
/// some are requested again with a count that errs the other way: those that are off the most, enough of them to bring
/// `missed`, the surplus over all components, within `tolerated`.
[[nodiscard]] inline std::vector<std::pair<std::size_t, double>> asked_again(const std::vector<double>& due,
                                                                             const std::vector<Index>& got,
                                                                             const std::vector<double>& least,
                                                                             double missed, double tolerated) {
  constexpr double small = 40;
  std::vector<std::pair<std::size_t, double>> again;
  if (std::abs(missed) <= tolerated) return again;
  const auto off = [&](std::size_t c) { return static_cast<double>(got[c]) - due[c]; };
  std::vector<std::size_t> candidates;
  for (std::size_t c = 0; c < due.size(); ++c)
    if (due[c] < small && off(c) * missed > 0 && due[c] - 2 * off(c) >= least[c]) candidates.push_back(c);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [&](std::size_t a, std::size_t b) { return std::abs(off(a)) > std::abs(off(b)); });
  double left = std::abs(missed);
  for (const std::size_t c : candidates) {
    if (left <= tolerated) break;
    again.emplace_back(c, due[c] - 2 * off(c));
    left -= 2 * std::abs(off(c));
  }
  return again;
}

}  // namespace quadrig::detail
