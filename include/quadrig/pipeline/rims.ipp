#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/rims/band.hpp"

namespace quadrig {

QUADRIG_INLINE void count_rings(const QuadMesh& quads, std::span<RimReport> rims) {
  constexpr double most_beside = 2;  // edges of quads on either side of the rings
  for (RimReport& rim : rims) rim.loops = rim.around = 0;
  if (rims.empty()) return;
  const Expected<detail::QuadFans> fans = detail::quad_fans(quads, SkinWeights(quads.vertex_count(), 0));
  if (!fans) return;
  const ClosestPoint closest(fans->mesh);
  detail::HingeCounter count(quads, fans->mesh);
  for (RimReport& rim : rims) {
    std::optional<FaceLoop> loop = rim_band(fans->mesh, closest, rim.rim, 0).loop;
    if (!loop) continue;
    const double reach = (std::max<Index>(rim.wanted, 1) / 2.0 + most_beside) * rim.edge;
    const HingeRings rings = count({no_index, std::move(*loop), rim.rim.length, reach});
    rim.loops = rings.loops;
    rim.around = rings.loops > 0 ? rings.around : 0;
  }
}

QUADRIG_INLINE std::optional<std::string> lacking_rings(std::span<const RimReport> rims) {
  std::string lacking;
  for (const RimReport& rim : rims) {
    if (rim.loops >= rim.wanted) continue;
    const Vector3 p = rim.rim.centre();
    char place[96];
    std::snprintf(place, sizeof place, " at (%.3g, %.3g, %.3g) ", p[0], p[1], p[2]);
    lacking += (lacking.empty() ? "" : ", ") + std::string(rim_kind_name(rim.rim.kind)) + place +
               std::to_string(rim.loops) + " of " + std::to_string(rim.wanted) +
               (rim.quads_for > 0 ? " (about " + std::to_string(rim.quads_for) + " quads have room for them)" : "");
  }
  return lacking.empty() ? std::nullopt : std::optional("fewer closed rings than wanted round openings: " + lacking);
}

}  // namespace quadrig
