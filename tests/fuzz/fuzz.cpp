// One of the targets for libFuzzer: QUADRIG_FUZZ_TARGET names it.
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const quadrig::test::FuzzTarget* const target = [] {
    for (const quadrig::test::FuzzTarget& one : quadrig::test::fuzz_targets())
      if (std::strcmp(one.name, QUADRIG_FUZZ_TARGET) == 0) return &one;
    std::abort();
  }();
  static_cast<void>(target->run({reinterpret_cast<const char*>(data), size}));
  return 0;
}
