// The ladder: which attempts a component goes through, as data. Facts about a surface in, attempts out; what became of
// the attempts so far in, the next one out. Nothing here has a state.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "quadrig/budget.hpp"

namespace quadrig {

/// What the ladder of a component depends on.
struct SurfaceFacts {
  Index faces = 0;
  double quads = 0;           ///< wanted
  bool tiny_edges = false;    ///< some far shorter than any quad will ever show
  bool has_features = false;  ///< edges that are to become edges of quads
  bool unasked = false;       ///< features that nobody asked for: creases of flat sides
};

/// So many attempts lay rings round openings; where none of them gave quads the rest go without.
inline constexpr std::size_t attempts_with_rings = 2;

/// Faces of a stand-in for a surface: 20 triangles a quad carry a map as well as any number; above 2500 quads, 4 a quad
/// and 40 000 do.
[[nodiscard]] inline Index proxy_faces(double quads) {
  constexpr double least = 4000, few = 20, many = 4, many_base = 40'000;
  return std::max(static_cast<Index>(least), static_cast<Index>(std::min(few * quads, many_base + many * quads)));
}

/// More triangles than this are no better for a map of so many quads than a stand-in.
[[nodiscard]] inline double enough_triangles(double quads) {
  constexpr double plenty = 20'000, a_quad = 40, stand_ins = 2.5;
  return std::max(plenty, std::min(a_quad * quads, stand_ins * proxy_faces(quads)));
}

/// One way to map a component.
struct Attempt {
  double merge_quads;   ///< singularities closer than this many quads merge
  double longest_edge;  ///< of the triangles, in edges of quads; 0: on a stand-in for the surface
  bool keeps_features = false;
  bool unasked = false;  ///< features that may be let go for better quads

  [[nodiscard]] bool on_stand_in() const { return longest_edge == 0; }
  friend bool operator==(const Attempt&, const Attempt&) = default;
};

/// What became of an attempt.
enum class Outcome : std::uint8_t {
  good,                   ///< quads, none of them poor
  poor,                   ///< quads, some poor
  uncovered,              ///< quads that leave out some of the surface
  triangles_unavailable,  ///< the surface could not be refined or decimated as the attempt asks
  too_many_triangles,     ///< one map on them would take more work than is left
  field_failed,           ///< no field
  unmappable,             ///< the field has cones that no quads have, or too many
  noisy,                  ///< no valid map, with defects all over
  tangled,                ///< no valid map, with defects that other singularities did not mend
  flat,                   ///< a valid map, but no integers, or quads that would lie flat in space
  features_too_dense,     ///< quads, but far more than wanted for the sake of features
  budget_spent,           ///< no valid map within the attempt's share of the work
};
[[nodiscard]] constexpr bool has_quads(Outcome outcome) {
  return outcome == Outcome::good || outcome == Outcome::poor || outcome == Outcome::uncovered;
}
[[nodiscard]] constexpr std::string_view outcome_name(Outcome outcome) {
  constexpr std::array<std::string_view, 12> names{
      "good",  "poor",    "uncovered", "triangles-unavailable", "too-many-triangles", "field-failed", "unmappable",
      "noisy", "tangled", "flat",      "features-too-dense",    "budget-spent"};
  return names[static_cast<std::size_t>(outcome)];
}

/// An attempt that was made.
struct Tried {
  std::size_t attempt = 0;  ///< which of the ladder
  Outcome outcome = Outcome::good;
  /// What was left after it: of its share of the maps, of the search for integers in all.
  std::int64_t share_left = 1, search_left = 1;
};

/// The attempts for a surface, in order: on its own triangles, ever finer with a smoother field, and on a stand-in in
/// between; on a stand-in first where there are far more triangles than a map needs, or edges that carry none. With
/// features the first three keep them, of features that nobody asked for the first two; then all go without.
[[nodiscard]] inline std::vector<Attempt> ladder(const SurfaceFacts& facts) {
  std::vector<Attempt> attempts{{0.5, 1.5}, {1, 1.0}, {1, 0}, {2, 0.7}, {4, 0}};
  if (facts.tiny_edges || facts.faces > enough_triangles(facts.quads))
    attempts.insert(attempts.begin(), Attempt{0.5, 0});
  if (facts.has_features) {
    const std::ptrdiff_t keeping = facts.unasked ? 2 : 3;
    std::vector<Attempt> first(attempts.begin(), attempts.begin() + keeping);
    for (Attempt& attempt : first) attempt.keeps_features = true, attempt.unasked = facts.unasked;
    attempts.insert(attempts.begin(), first.begin(), first.end());
  }
  return attempts;
}

namespace detail {

/// The attempts that share a budget with this one: those that keep features, or those that do not, as if features had
/// never been asked for; all where some of the former, asked for, gave quads.
[[nodiscard]] inline std::vector<Tried> same_budget(const std::vector<Attempt>& attempts,
                                                    std::span<const Tried> history, std::size_t number) {
  const auto keeps = [&](std::size_t attempt) { return attempts[attempt].keeps_features; };
  const bool one = std::ranges::any_of(history, [&](const Tried& tried) {
    return keeps(tried.attempt) && !attempts[tried.attempt].unasked && has_quads(tried.outcome);
  });
  std::vector<Tried> result;
  for (const Tried& tried : history)
    if (one || keeps(tried.attempt) == keeps(number)) result.push_back(tried);
  return result;
}

}  // namespace detail

/// Whether an attempt begins with a full budget: the first, and the first without features unless there are quads with
/// features that were asked for.
[[nodiscard]] inline bool begins_afresh(const std::vector<Attempt>& attempts, std::span<const Tried> history,
                                        std::size_t number) {
  return detail::same_budget(attempts, history, number).empty();
}

/// The next attempt of a ladder, or none:
/// - after good quads none, after poor ones one more, and the better wins; after poor ones with features that
///   nobody asked for the first without them;
/// - where the search for integers is spent, or four valid maps led to no quads, none on that budget: no field helps;
/// - where features leave defects all over, none that keeps them;
/// - on the surface's own triangles only while these have not taken their share of the work, and not finer than they
///   could be refined.
[[nodiscard]] inline std::optional<std::size_t> next_attempt(const std::vector<Attempt>& attempts,
                                                             std::span<const Tried> history) {
  constexpr std::ptrdiff_t most_flat = 3;
  std::size_t begin = history.empty() ? 0 : history.back().attempt + 1, end = attempts.size();
  for (const Tried& tried : history) {
    if (tried.outcome == Outcome::good) return std::nullopt;
    if (tried.outcome != Outcome::poor && tried.outcome != Outcome::uncovered) continue;
    std::size_t other = tried.attempt + 1;
    while (tried.outcome == Outcome::poor && attempts[tried.attempt].unasked && other < end &&
           attempts[other].keeps_features)
      ++other;
    begin = std::max(begin, other);
    end = std::min(end, other + 1);
  }
  double unreachable_edge = 0;
  for (const Tried& tried : history)
    if (tried.outcome == Outcome::triangles_unavailable)
      unreachable_edge = std::max(unreachable_edge, attempts[tried.attempt].longest_edge);
  for (std::size_t k = begin; k < end; ++k) {
    const Attempt& attempt = attempts[k];
    const std::vector<Tried> before = detail::same_budget(attempts, history, k);
    const auto has = [&](auto&& property) { return std::ranges::any_of(before, property); };
    const bool exhausted =
        std::ranges::count(before, Outcome::flat, &Tried::outcome) > most_flat ||
        (!before.empty() && before.back().search_left <= 0) ||
        has([&](const Tried& t) { return t.outcome == Outcome::noisy && attempts[t.attempt].keeps_features; });
    if (exhausted && attempt.keeps_features) continue;
    if (exhausted) return std::nullopt;
    if (!attempt.on_stand_in()) {
      if (attempt.longest_edge <= unreachable_edge) continue;
      if (has([&](const Tried& t) { return t.share_left <= 0 && !attempts[t.attempt].on_stand_in(); })) continue;
    }
    return k;
  }
  return std::nullopt;
}

/// Solves a triangle that an attempt is granted whatever is left: every scaling of the first field where none makes
/// headway, else one.
[[nodiscard]] constexpr std::int64_t granted_solves(bool afresh) { return afresh ? 27 : 12; }

}  // namespace quadrig
