// Vector instructions, chosen by what the processor has as the program runs.
#pragma once

#include "quadrig/sparse.hpp"

#if defined(__GNUC__)
#define QUADRIG_INTO_CALLER_LAMBDA __attribute__((always_inline))
#define QUADRIG_INTO_CALLER QUADRIG_INTO_CALLER_LAMBDA inline
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
#endif

/// Calls pass(VectorBytes), a lambda that is marked QUADRIG_INTO_CALLER_LAMBDA as all it calls is QUADRIG_INTO_CALLER,
/// compiled for the widest vectors there are. Products and sums are never fused, though AVX2 comes with that: every
/// processor gives the same bits.
template <class Pass>
void run_best(Pass pass) {
#if defined(__GNUC__) && defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return run_avx2(pass);
#endif
  run_anywhere(pass);
}

}  // namespace quadrig::detail
