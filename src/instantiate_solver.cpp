// The one instantiation of the solvers.
#include "quadrig/solver.hpp"

namespace quadrig {

template Expected<AnySolver<double>> make_solver<double>(std::string_view);
template Expected<AnySolver<Complex>> make_solver<Complex>(std::string_view);

}  // namespace quadrig
