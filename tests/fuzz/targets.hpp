// What is fuzzed: every reader of files, each as a function of bytes, with seeds made by the project's own writers.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace quadrig::test {

struct FuzzTarget {
  const char* name;
  /// Reads the bytes; whether they were taken. Anything else than an answer is a bug.
  bool (*run)(std::string_view bytes);
  /// Inputs that are taken.
  std::vector<std::string> (*seeds)();
};

[[nodiscard]] std::span<const FuzzTarget> fuzz_targets();
/// Those of them that read compressed streams, where this build has the decoders.
[[nodiscard]] std::vector<FuzzTarget> compressed_targets();

}  // namespace quadrig::test
