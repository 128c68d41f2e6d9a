// The one definition of the large functions of the field and of the orders of elimination.
#include "quadrig/field.hpp"
#include "quadrig/field/surgery.hpp"

#include "quadrig/field/design.ipp"
#include "quadrig/field/lengths.ipp"
#include "quadrig/field/power.ipp"
#include "quadrig/field/surgery.ipp"
#include "quadrig/field/systems.ipp"
#include "quadrig/solver/dissection.ipp"
#include "quadrig/solver/minimum_degree.ipp"
#include "quadrig/solver/ordering.ipp"

namespace quadrig {

template class BasicFieldSolver<double>;
template struct BasicFieldOptions<double>;
template Expected<FieldResult> design_field(const TriangleMesh<double>&, const Rig*, const Connection<double>&,
                                            const FieldOptions&, Context&);
template Expected<PowerFieldResult> design_power_field(const TriangleMesh<double>&, const Connection<double>&,
                                                       const PowerFieldOptions&, Context&);
template std::vector<Index> power_field_index(const TriangleMesh<double>&, const Connection<double>&,
                                              const PowerField&);
template Expected<DensityTargets> smooth_log_densities(const TriangleMesh<double>&, const Matching&,
                                                       const DensityTargets&, double, Context&,
                                                       const SolverFactory<double>&);

template class BasicFieldSolver<float>;
template struct BasicFieldOptions<float>;
template Expected<FieldResult> design_field(const TriangleMesh<float>&, const Rig*, const Connection<float>&,
                                            const BasicFieldOptions<float>&, Context&);
template Expected<PowerFieldResult> design_power_field(const TriangleMesh<float>&, const Connection<float>&,
                                                       const PowerFieldOptions&, Context&);
template std::vector<Index> power_field_index(const TriangleMesh<float>&, const Connection<float>&, const PowerField&);
template Expected<DensityTargets> smooth_log_densities(const TriangleMesh<float>&, const Matching&,
                                                       const DensityTargets&, double, Context&,
                                                       const SolverFactory<float>&);

}  // namespace quadrig
