// JSON for the sources of quadrig::io and of the command.
#pragma once

#include <new>

namespace quadrig::io {
[[noreturn]] inline void json_without_memory() { throw std::bad_alloc(); }
}  // namespace quadrig::io

// What does not hold where memory ran out within the library: its destructors are not to follow a null.
#define JSON_ASSERT(condition) ((condition) ? static_cast<void>(0) : quadrig::io::json_without_memory())
#include <nlohmann/json.hpp>
