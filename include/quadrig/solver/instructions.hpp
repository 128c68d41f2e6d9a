// Vector instructions, chosen by what the processor has as the program runs.
#pragma once

#include "quadrig/sparse.hpp"

#if defined(__GNUC__)
#define QUADRIG_INTO_CALLER_LAMBDA __attribute__((always_inline))
#define QUADRIG_INTO_CALLER QUADRIG_INTO_CALLER_LAMBDA inline
#if defined(__x86_64__)
#if defined(__clang__)
#define QUADRIG_FUSED __attribute__((target("avx2,fma")))
#else
#define QUADRIG_FUSED __attribute__((target("avx2,fma"), optimize("fp-contract=fast")))
#endif
#endif
#else
#define QUADRIG_INTO_CALLER_LAMBDA
#define QUADRIG_INTO_CALLER inline
#endif

namespace quadrig::detail {

/// The bytes of a vector, for templates.
template <int bytes>
using VectorBytes = std::integral_constant<int, bytes>;

template <class Pass>
void run_anywhere(Pass pass) {
  pass(VectorBytes<16>());
}
#if defined(__GNUC__) && defined(__x86_64__)
template <class Pass>
__attribute__((target("avx2"))) void run_avx2(Pass pass) {
  pass(VectorBytes<32>());
}
template <class Pass>
QUADRIG_FUSED void run_fused(Pass pass) {
  pass(VectorBytes<32>());
}
#endif

/// Calls pass(VectorBytes), a lambda that is marked QUADRIG_INTO_CALLER_LAMBDA as all it calls is QUADRIG_INTO_CALLER,
/// compiled for the best instructions there are. In single precision they may fuse products and sums: last bits then
/// depend on the processor. Double precision never fuses, and gives the same bits everywhere.
template <class Real, class Pass>
void run_best(Pass pass) {
#if defined(__GNUC__) && defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) {
    if constexpr (sizeof(Real) == sizeof(float))
      if (__builtin_cpu_supports("fma")) return run_fused(pass);
    return run_avx2(pass);
  }
#endif
  run_anywhere(pass);
}

}  // namespace quadrig::detail
