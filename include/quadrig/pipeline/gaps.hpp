// Gaps of an asset that are smaller than a quad: bridged before quads are made, cut into these after.
#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/prepare/gaps.hpp"

namespace quadrig::detail {

/// An asset without its small gaps, and the options for it.
struct WithoutGaps {
  Asset asset;
  RemeshOptions options;
  std::vector<Bridged::Hole> holes;  ///< that the quads are to have again
  GapReport report;
  Index left_open = 0;
};

/// Nothing where the asset has no such gap, where borders are followed exactly, or once cancelled. \cost as bridge_gaps
[[nodiscard]] QUADRIG_INLINE std::optional<WithoutGaps> without_gaps(const Asset& asset, const RemeshOptions& options,
                                                                     const Context& context);

/// Quads of the asset, by those of the one without gaps. \fails as remesh
[[nodiscard]] QUADRIG_INLINE Expected<RemeshResult> remesh_without_gaps(const Asset& asset,
                                                                        const RemeshOptions& options,
                                                                        const WithoutGaps& without, Context& context);

/// Cuts holes into quads: one quad is left out, its corners drawn together to the length around the hole; where a
/// border or another hole is beside it, four quads in place of one leave a hole between them.
/// \param surface that the quads lie on
/// \return how many there was room for
/// \cost O(m log m) and, of each hole, the quads near
[[nodiscard]] QUADRIG_INLINE Index cut_holes(const TriangleMesh<double>& surface, std::vector<Bridged::Hole> holes,
                                             UnfittedQuads& quads);

}  // namespace quadrig::detail
