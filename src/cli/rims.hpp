// Openings of a surface, as options and in reports.
#pragma once

#include "command.hpp"
#include "quadrig/pipeline.hpp"

namespace quadrig::cli {

/// auto, none, kinds of openings, or an OBJ of closed lines. \fails bad_option; as read_lines
[[nodiscard]] Status read_rims(const std::string& text, const FileLimits& limits, Context& context, RimOptions& rims);
[[nodiscard]] Json rims_json(std::span<const RimReport> rims);

}  // namespace quadrig::cli
