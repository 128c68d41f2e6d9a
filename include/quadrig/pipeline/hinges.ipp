#pragma once

#include "quadrig/pipeline.hpp"

namespace quadrig {

QUADRIG_INLINE std::optional<std::string> report_hinges(const QuadMesh& quads, const Skeleton& skeleton,
                                                        const SkinWeights& weights, const RemeshOptions& options,
                                                        RemeshReport& report) {
  constexpr Index named = 6;
  constexpr double least_around = 6;
  report.hinges.clear();
  std::string lacking;
  Index lacks = 0;
  for (const HingeRings& rings : hinge_rings(quads, skeleton, weights)) {
    HingeReport hinge{skeleton.bones[detail::at(rings.bone)].name, 0, rings, 0};
    if (options.preset == FieldPreset::standard) hinge.wanted = options.loops.of(hinge.joint);
    if (hinge.wanted > rings.loops) {
      // n loops are the lines between n + 1 rows.
      const double finer =
          std::max((hinge.wanted + 1) / std::max(rings.rows, 1e-3), least_around / std::max(rings.around, Index{1}));
      if (finer > 1)
        hinge.quads_for = static_cast<Index>(std::min(5e7, 100 * std::ceil(quads.quad_count() * finer * finer / 100)));
      if (++lacks <= named)
        lacking +=
            (lacking.empty() ? "" : ", ") + hinge.joint + " " + std::to_string(rings.loops) + " of " +
            std::to_string(hinge.wanted) +
            (hinge.quads_for > 0 ? " (about " + std::to_string(hinge.quads_for) + " quads have room for them)" : "");
    }
    report.hinges.push_back(std::move(hinge));
  }
  if (lacks == 0) return std::nullopt;
  if (lacks > named) lacking += " and " + std::to_string(lacks - named) + " more";
  return "fewer closed loops than wanted at " + std::to_string(lacks) + (lacks == 1 ? " joint: " : " joints: ") +
         lacking;
}

}  // namespace quadrig
