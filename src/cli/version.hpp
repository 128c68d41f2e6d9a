// What --version prints.
#pragma once

#include <string>

namespace quadrig::cli {

/// Version, commit where it is known, and the optional parts of this build: a line each.
[[nodiscard]] std::string version_text();

}  // namespace quadrig::cli
