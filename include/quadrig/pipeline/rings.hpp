// Which openings get rings of quads.
#pragma once

#include "quadrig/pipeline/component.hpp"

namespace quadrig::detail {

inline constexpr double beside_rings = 0.75;  // edges of quads on either side of the rings of a rim

/// Quads round an opening that show its shape.
[[nodiscard]] inline double least_around(RimKind kind) { return kind == RimKind::mouth ? 16 : 12; }

/// Rings that would take more than a share of the quads are let go.
inline void let_go_without_room(Index quads, std::vector<RimReport>& rims) {
  constexpr double most_of = 0.6, with_slope = 2;  // between the quads of the band and those of the rest
  double all = 0;
  for (const RimReport& rim : rims)
    if (rim.wanted > 0) all += with_slope * least_around(rim.rim.kind) * (rim.wanted + 2 * beside_rings);
  if (all <= most_of * quads) return;
  const auto room = static_cast<Index>(100 * std::ceil(all / most_of / 100));
  for (RimReport& rim : rims)
    if (rim.wanted > 0) rim.quads_for = room;
}

/// The rims that are there, those of them that get rings, and how large the quads beside these are to be.
[[nodiscard]] inline std::vector<RimRings> plan_rings(const Asset& asset, const RemeshOptions& options,
                                                      const MirrorPlane* plane, Context& context,
                                                      std::vector<RimReport>& all) {
  constexpr double likely = 0.5, possible = 0.4;
  const RimOptions& wanted = options.rims;
  if (options.preset == FieldPreset::thesis || (wanted.rings < 1 && wanted.face_density == 1)) return {};
  std::vector<RimKind> kinds;
  if (wanted.kinds)
    kinds = *wanted.kinds;
  else if (asset.rig)
    kinds = {RimKind::eye, RimKind::mouth};
  if (kinds.empty() && wanted.own.empty() && wanted.face_density == 1) return {};
  const double mean_edge = std::sqrt(asset.mesh.total_area() / options.quads);
  for (Rim& rim : wanted.own.empty() ? find_rims(asset.mesh, asset.rig ? &*asset.rig : nullptr, plane, context)
                                     : std::vector<Rim>(wanted.own)) {
    RimReport& report = all.emplace_back();
    const bool asked = !wanted.own.empty() ||
                       (rim.score >= (wanted.kinds ? possible : likely) && std::ranges::count(kinds, rim.kind) > 0);
    report.wanted = asked ? wanted.rings : 0;
    report.edge = std::min(rim.length / least_around(rim.kind), mean_edge);
    report.rim = std::move(rim);
  }
  let_go_without_room(options.quads, all);
  std::vector<RimRings> rings;
  for (const RimReport& rim : all)
    if (rim.wanted > 0 && rim.quads_for == 0)
      rings.push_back({rim.rim, rim.edge, (rim.wanted / 2.0 + beside_rings) * rim.edge});
  return rings;
}

}  // namespace quadrig::detail
