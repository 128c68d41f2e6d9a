// The one instantiation of the solvers in single precision.
#include "quadrig/solver.hpp"

namespace quadrig {

template Expected<AnySolver<float>> make_solver<float>(std::string_view);
template Expected<AnySolver<std::complex<float>>> make_solver<std::complex<float>>(std::string_view);

}  // namespace quadrig
