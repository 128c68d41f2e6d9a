// Percentiles of values.
#pragma once

#include <algorithm>
#include <vector>

namespace quadrig {

/// The value below which the share `q` in [0, 1] of the values lies, interpolated linearly; 0 of none. \cost O(n)
template <class Scalar>
[[nodiscard]] double quantile(std::vector<Scalar> values, double q) {
  if (values.empty()) return 0;
  const double at = q * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(low);
  std::nth_element(values.begin(), middle, values.end());
  const double below = static_cast<double>(*middle);
  if (low + 1 >= values.size()) return below;
  const double above = static_cast<double>(*std::min_element(middle + 1, values.end()));
  return below + (at - static_cast<double>(low)) * (above - below);
}

}  // namespace quadrig
