#pragma once

#include "quadrig/quantize.hpp"
#include "quadrig/quantize/quantizer.hpp"

namespace quadrig {

namespace detail {

inline constexpr double most_pitch = 1.5;  // quads beside its beginning that a ring may come back to be closed

[[nodiscard]] inline double area_of(const CoarseMap& map) {
  double area = 0;
  for (Index f = 0; f < map.face_count(); ++f) area += cross(map.vector[at(3 * f)], map.vector[at(3 * f + 1)]) / 2;
  return area;
}

}  // namespace detail

QUADRIG_INLINE Expected<Quantization> quantize(const CoarseMap& map, const std::vector<Index>& index,
                                               const std::vector<char>& on_border, const QuantizeOptions& options,
                                               Context& context, Budget& budget) {
  double scale = std::sqrt(options.target_quads / detail::area_of(map)), best_scale = scale;
  const std::vector<detail::Ring> rings = detail::near_rings(map, 1 / scale, detail::most_pitch);
  std::optional<Quantization> best;
  std::optional<detail::Quantizer> kept;
  std::pair<double, double> best_rank;
  double below = 0, above = 0;  // scales that gave too few and too many
  int waited = 0;
  std::int64_t left = budget.left(Work::search);
  const auto spend = [&](std::int64_t effort) {
    left -= effort;
    budget.spend(Work::search, effort);
  };
  for (int round = 0; round < options.rounds && waited < 4; ++round) {
    if (best && left <= 0) break;
    detail::Quantizer quantizer(map, index, on_border, rings, scale, left);
    double sigma = 1;
    bool valid = false;
    // Nearby scales round differently. Distant scales are tried last: removing the surplus strips afterwards rarely
    // restores closed rings.
    constexpr std::array<double, 8> near{1, 0.98, 1.02, 0.96, 1.04, 1.08, 1.13, 1.2};
    for (std::size_t k = 0; k < near.size() + 15 && !valid; ++k) {
      if (context.cancelled()) return cancelled_error("quantization");
      if (k > 0 && k < near.size() && quantizer.work() > 1'000'000) continue;  // each search is long: far off at once
      sigma = k < near.size() ? near[k] : sigma * 1.4142135623730951;
      if (quantizer.effort() > left) break;
      valid = quantizer.start(sigma, context) && quantizer.repair(context);
    }
    if (context.cancelled()) return cancelled_error("quantization");
    if (!valid) {
      spend(quantizer.effort());
      if (best) break;
      if (left <= 0)
        return Error{ErrorCode::stage_failed, "the search for integers takes too long", "quantization",
                     "ask for more quads, or give a surface with fewer holes and corners"};
      return Error{ErrorCode::stage_failed, "no valid integers found at any size", "quantization",
                   "ask for more quads"};
    }
    Quantization result;
    result.moves = quantizer.descend(context);
    result.moves += quantizer.close_rings(context);
    spend(quantizer.effort());
    result.quads = quantizer.quads();
    result.start_scale = sigma;
    const bool met = quantizer.demands_met();
    const double quads = result.quads, miss = std::abs(quads / options.target_quads - 1);
    ++waited;
    // Of counts that are near enough the integers that bend the map the least, else the nearest count.
    const std::pair rank{miss > 0.6 * options.tolerance ? miss : 0.0,
                         quantizer.distortion() + 10 * quantizer.spirals()};
    if (!best || rank < best_rank) {
      best = std::move(result);
      best_rank = rank;
      best_scale = scale;
      kept.emplace(std::move(quantizer));
      waited = 0;
    }
    if (miss < options.tolerance / 4 && met) break;
    if (miss > 0.5 && waited > 1) break;  // the topology forces a different count
    // Towards the count; halfway between two sizes that miss it on either side where that leads past one of them.
    (quads < options.target_quads ? below : above) = scale;
    const double low = std::min(below, above), high = std::max(below, above);
    if (low > 0 && high < 1.001 * low) break;
    scale *= std::sqrt(options.target_quads / quads);
    if (low > 0 && !(scale > 1.001 * low && 1.001 * scale < high)) scale = std::sqrt(low * high);
  }
  // A count outside the tolerance is steered to it by single strips; if that fails, from nearby scales too.
  constexpr std::int64_t reserve = 4'000'000;  // where all is spent
  const auto steer = [&](detail::Quantizer& quantizer) {
    const std::int64_t before = quantizer.effort();
    quantizer.allow(before + std::max(left, reserve));
    const int moves = quantizer.steer(options.target_quads, options.tolerance / 2, context);
    spend(quantizer.effort() - before);
    return moves;
  };
  const auto miss_of = [&](const detail::Quantizer& quantizer) {
    return std::abs(quantizer.quads() / options.target_quads - 1);
  };
  if (miss_of(*kept) > options.tolerance / (left > 0 ? 2 : 1)) best->moves += steer(*kept);
  for (const double beside : {0.98, 1.02, 0.96, 1.04, 0.94, 1.06}) {
    if (!(miss_of(*kept) > options.tolerance) || kept->effort() > 500'000 || left <= 0) break;
    detail::Quantizer quantizer(map, index, on_border, rings, beside * best_scale, left);
    const bool valid = quantizer.start(1, context) && quantizer.repair(context);
    if (context.cancelled()) return cancelled_error("quantization");
    int moves = valid ? quantizer.descend(context) : 0;
    spend(quantizer.effort());
    if (!valid) continue;
    moves += steer(quantizer);
    if (!(miss_of(quantizer) < miss_of(*kept))) continue;
    best->moves = moves;
    best->start_scale = 1;
    kept.emplace(std::move(quantizer));
  }
  best->edge = kept->edges();
  best->quads = kept->quads();
  best->energy = kept->energy();
  return *best;
}

QUADRIG_INLINE std::vector<Quantization> widened(const CoarseMap& map, const std::vector<Index>& index,
                                                 const std::vector<char>& on_border, const QuantizeOptions& options,
                                                 const Quantization& from, std::span<const Index> faces,
                                                 const Context& context, Budget& budget) {
  const double scale = std::sqrt(options.target_quads / detail::area_of(map));
  const std::vector<detail::Ring> rings = detail::near_rings(map, 1 / scale, detail::most_pitch);
  detail::Quantizer quantizer(map, index, on_border, rings, scale, budget.left(Work::search));
  quantizer.resume(from.edge);
  std::vector<Quantization> wider;
  for (std::vector<Gaussian>& edges : quantizer.rows_through(faces, context)) {
    quantizer.resume(edges);
    wider.push_back({std::move(edges), quantizer.quads(), from.start_scale, quantizer.energy(), from.moves + 1});
  }
  budget.spend(Work::search, quantizer.effort());
  return wider;
}

}  // namespace quadrig
