// What a remesh may spend, counted in work and never in time, so that results are the same on every machine.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

#include "quadrig/core.hpp"

namespace quadrig {

/// The kinds of work that are limited.
enum class Work : std::uint8_t {
  maps,        ///< seamless maps
  untangling,  ///< local repair of flipped triangles
  search,      ///< integers
  strips,      ///< trials of wider strips where quads touch themselves
};

/// One row of the table in docs/map.md: how much of a kind of work one component may spend.
/// The unit is a node of the search for integers, about an eighth of a microsecond; the prices of the others are times
/// measured against it.
struct WorkLimit {
  Work work;
  std::string_view name, counted_in;
  std::int64_t price;           ///< units a count
  std::int64_t base;            ///< counts
  std::int64_t per_face;        ///< and so many for each triangle of the component
  std::int64_t per_proxy_face;  ///< and so many for each triangle of its stand-in
  std::string_view scope;       ///< what shares it

  /// \param parts components that share the base of a few
  [[nodiscard]] constexpr std::int64_t counts(std::int64_t faces, std::int64_t proxy_faces,
                                              std::size_t parts = 1) const {
    constexpr std::int64_t bases = 8;
    const auto sharing = static_cast<std::int64_t>(std::max<std::size_t>(parts, 1));
    return std::min(base, bases * base / sharing) + per_face * faces + per_proxy_face * proxy_faces;
  }
};
/// Several times what any surface needed whose first field can be mapped.
inline constexpr std::array<WorkLimit, 4> work_limits{{
    {Work::maps, "seamless maps", "triangles × solves", 50, 1'500'000, 20, 10, "all attempts of a component"},
    {Work::untangling, "untangling", "triangles × Newton steps", 40, 2'000'000, 0, 0, "a component"},
    {Work::search, "integers", "nodes searched", 1, 16'000'000, 0, 0, "a component"},
    {Work::strips, "wider strips", "quads extracted", 4, 1'000'000, 0, 0, "a map"},
}};
/// What all components share, so that many of them take no more than a few. Nothing below is felt by a dozen parts.
namespace of_all {
inline constexpr std::int64_t attempts = 240;  ///< of the ladder; each component has one at least
/// In more parts than this, those of the least quads are split from triangles at once: a map of each would take longer
/// than that of a surface as large as all of them.
inline constexpr std::size_t crumbs = 500;
/// In no more parts than this, a needle has one attempt, in which a tube may get quads; in more it is split at once.
inline constexpr std::size_t needles = 60;
/// The share of one of so many parts.
[[nodiscard]] constexpr std::int64_t share(std::int64_t all, std::size_t parts) {
  return std::max<std::int64_t>(1, all / static_cast<std::int64_t>(std::max<std::size_t>(parts, 1)));
}
}  // namespace of_all
[[nodiscard]] constexpr const WorkLimit& work_limit(Work work) { return work_limits[static_cast<std::size_t>(work)]; }

/// What is left of each kind of work. Handed down like the Context: stages take off what they spend, also where they
/// fail. Where nothing is left a stage ends with the best it has, or fails.
class Budget {
 public:
  /// Of a component. \param faces its triangles \param proxy_faces those of the stand-in that would be made of it
  /// \param parts components of the asset
  explicit constexpr Budget(std::int64_t faces = 0, std::int64_t proxy_faces = 0, std::size_t parts = 1) {
    for (const WorkLimit& limit : work_limits)
      units(limit.work) = limit.price * limit.counts(faces, proxy_faces, parts);
  }

  /// In the counts of that kind; at or below zero nothing is left.
  [[nodiscard]] constexpr std::int64_t left(Work work) const {
    const std::int64_t price = work_limit(work).price, units = left_[static_cast<std::size_t>(work)];
    return units >= 0 ? units / price : -((-units + price - 1) / price);
  }
  [[nodiscard]] constexpr bool spent(Work work) const { return left(work) <= 0; }
  constexpr void spend(Work work, std::int64_t counts) { units(work) -= work_limit(work).price * counts; }

  /// A budget in which `counts` of this work are left, taken off this one; `give_back` returns the rest.
  [[nodiscard]] constexpr Budget lend(Work work, std::int64_t counts) {
    Budget lent = *this;
    lent.units(work) = work_limit(work).price * counts;
    spend(work, counts);
    return lent;
  }
  /// Takes over what is left of a budget that was lent for `work`: all of that, and the other kinds as they are now.
  constexpr void give_back(Work work, const Budget& lent) {
    const std::int64_t own = left_[static_cast<std::size_t>(work)];
    left_ = lent.left_;
    units(work) += own;
  }

  friend constexpr bool operator==(const Budget&, const Budget&) = default;

 private:
  constexpr std::int64_t& units(Work work) { return left_[static_cast<std::size_t>(work)]; }

  std::array<std::int64_t, work_limits.size()> left_{};
};

}  // namespace quadrig
