// Density by hand: factors that an artist gives to bones, materials or colours, on top of what the error asks for.
#pragma once

#include <string>
#include <string_view>

#include "quadrig/rig.hpp"

namespace quadrig {

/// A factor for whatever has this name; `*` and `?` stand for any characters, and for any one.
struct NamedFactor {
  std::string name;
  double factor = 1;
};

/// Factors beyond these leave no room for the rest of a surface.
inline constexpr double least_density_factor = 1.0 / 64, largest_density_factor = 64;

/// Whether a pattern fits a name, small and capital letters alike. \cost O(length²)
[[nodiscard]] inline bool fits_name(std::string_view pattern, std::string_view name) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  std::size_t p = 0, n = 0, star = std::string_view::npos, mark = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      mark = n;
    } else if (p < pattern.size() && (pattern[p] == '?' || lower(pattern[p]) == lower(name[n]))) {
      ++p, ++n;
    } else if (star != std::string_view::npos) {
      p = star + 1;
      n = ++mark;
    } else {
      return false;
    }
  }
  while (p < pattern.size() && pattern[p] == '*') ++p;
  return p == pattern.size();
}

/// How many letters to change, add or leave out between two names, small and capital ones alike (Levenshtein 1966).
/// \cost O(product of the lengths)
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (lower(a[i - 1]) != lower(b[j - 1]));
      diagonal = std::exchange(row[j], std::min({change, row[j] + 1, row[j - 1] + 1}));
    }
  }
  return row.back();
}

/// The names nearest to one that does not exist, for a message: `"hed": "head"`; empty where none is like it.
[[nodiscard]] inline std::string near_misses(std::string_view name, std::span<const std::string> names) {
  constexpr std::size_t most = 3;
  std::vector<std::pair<std::size_t, std::string_view>> near;
  for (const std::string& other : names)
    if (const std::size_t off = edit_distance(name, other); off <= 1 + name.size() / 3) near.emplace_back(off, other);
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  std::string text;
  for (std::size_t k = 0; k < std::min(most, near.size()); ++k)
    text += (k > 0 ? ", " : "") + std::string(near[k].second);
  return text;
}

/// One factor a name, the product of those whose patterns fit it.
/// \param what they are the names of, in messages: "bone"
/// \fails bad_option where a factor is out of [1/64, 64], or a pattern fits no name: tells the nearest
[[nodiscard]] inline Expected<std::vector<double>> named_factors(std::span<const NamedFactor> factors,
                                                                 std::span<const std::string> names,
                                                                 const std::string& what) {
  std::vector<double> result(names.size(), 1.0);
  for (const NamedFactor& each : factors) {
    if (!(each.factor >= least_density_factor && each.factor <= largest_density_factor))
      return Error{ErrorCode::bad_option, "is no factor from 1/64 to 64", what + " " + each.name, "give one such as 2"};
    bool any = false;
    for (std::size_t k = 0; k < names.size(); ++k)
      if (fits_name(each.name, names[k])) result[k] *= each.factor, any = true;
    if (any) continue;
    const std::string near = near_misses(each.name, names);
    return Error{ErrorCode::bad_option, "no " + what + " has this name", each.name,
                 near.empty() ? "give the name of one; * stands for any letters" : "is it one of: " + near};
  }
  return result;
}

/// What colours say, as artists paint it: white, grey and black leave the density as it is, red asks for four times as
/// many quads, cyan for a quarter. \param color red, green and blue in [0, 1]
[[nodiscard]] inline double density_of_color(const Vector3& color) {
  constexpr double most = 4;
  const double warmth = color[0] - (color[1] + color[2]) / 2;
  return elementary::pow(most, std::clamp(warmth, -1.0, 1.0));
}

/// The factors of vertices from those of the bones that move them: the mean of their logarithms by weight.
[[nodiscard]] inline std::vector<double> vertex_factors(const SkinWeights& weights, std::span<const double> of_bone) {
  std::vector<double> result(detail::at(static_cast<Index>(weights.rows())), 0.0);
  for (std::size_t v = 0; v < result.size(); ++v) {
    for (SkinWeights::InnerIterator it(weights, static_cast<Index>(v)); it; ++it)
      result[v] += it.value() * elementary::log(of_bone[detail::at(static_cast<Index>(it.col()))]);
    result[v] = elementary::exp(result[v]);
  }
  return result;
}

}  // namespace quadrig
