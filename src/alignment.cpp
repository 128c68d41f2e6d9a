// What programs of another alignment than the library's do not find; see core.hpp.
#include "quadrig/core.hpp"

namespace quadrig {

template <int bytes, int bytes_of_fixed_sizes, bool by_malloc>
void library_was_compiled_with_another_EIGEN_MAX_ALIGN_BYTES<bytes, bytes_of_fixed_sizes, by_malloc>::check() {}
template struct library_was_compiled_with_another_EIGEN_MAX_ALIGN_BYTES<
    EIGEN_DEFAULT_ALIGN_BYTES, EIGEN_MAX_STATIC_ALIGN_BYTES, EIGEN_MALLOC_ALREADY_ALIGNED != 0>;

}  // namespace quadrig
