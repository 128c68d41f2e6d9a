// What --version prints.
#pragma once

#include <string>
#include <vector>

namespace quadrig::cli {

/// The lines of version_text, one a part.
[[nodiscard]] std::vector<std::string> version_lines();
/// Version, commit where it is known, and the optional parts of this build: a line each.
[[nodiscard]] std::string version_text();

}  // namespace quadrig::cli
