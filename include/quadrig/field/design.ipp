// Definitions of field.hpp.
#pragma once

#include "quadrig/field.hpp"
#include "quadrig/field/wanted.hpp"

namespace quadrig {

QUADRIG_INLINE Expected<FieldPreset> field_preset(std::string_view name) {
  if (name == "default") return FieldPreset::standard;
  if (name == "thesis") return FieldPreset::thesis;
  if (name == "static") return FieldPreset::flat;
  return Error{ErrorCode::bad_option, "there is no such preset", "preset " + std::string(name),
               "one of: default, thesis, static"};
}

QUADRIG_INLINE std::string_view field_preset_name(FieldPreset preset) {
  switch (preset) {
    case FieldPreset::thesis:
      return "thesis";
    case FieldPreset::flat:
      return "static";
    case FieldPreset::standard:
      break;
  }
  return "default";
}

template <class Scalar>
Status BasicFieldOptions<Scalar>::validate(Index faces) const {
  const auto m = static_cast<std::size_t>(faces);
  const auto fail = [](std::string what, std::string field, std::string remedy) {
    return Status(Error{ErrorCode::bad_option, std::move(what), "field, " + std::move(field), std::move(remedy)});
  };
  const auto not_negative = [](double x) { return x >= 0 && std::isfinite(x); };
  if (smoothing_length && !(*smoothing_length > 0 && *smoothing_length <= 1))
    return fail("a fraction in (0, 1] is needed", "smoothing_length", "0.01 is usual");
  if (!not_negative(quad_edge)) return fail("a length is not negative", "quad_edge", "0 for no quad");
  if (!not_negative(merge_quads)) return fail("a factor is not negative", "merge_quads", "0.5 is usual");
  if (bone_weight && !not_negative(*bone_weight)) return fail("a weight is not negative", "bone_weight", "0 for none");
  if (curvature_weight && !not_negative(*curvature_weight))
    return fail("a weight is not negative", "curvature_weight", "0 for none");
  if (merge_rounds < 0) return fail("a count is not negative", "merge_rounds", "0 for none");
  if (!(merge_length > 0 && merge_length <= 1))
    return fail("a fraction in (0, 1] is needed", "merge_length", "0.03 is usual");
  if (!(curvature_length > 0 && curvature_length <= 1))
    return fail("a fraction in (0, 1] is needed", "curvature_length", "0.015 is usual");
  if (crease_angle_radians && !(*crease_angle_radians > 0))
    return fail("an angle is positive", "crease_angle_radians", "π for no creases");
  if (!not_negative(crease_length)) return fail("a length is not negative", "crease_length", "0.5 is usual");
  if (!(limits.least_angle_radians >= 0 && limits.least_angle_radians < std::numbers::pi / 2))
    return fail("an angle in [0, π/2) is needed", "limits.least_angle_radians", "0.44 is usual");
  if (!(limits.largest_ratio >= 1)) return fail("a ratio is at least 1", "limits.largest_ratio", "8 is usual");
  if (targets) {
    if (targets->x0.size() != m || targets->x1.size() != m || targets->weight.size() != m)
      return fail("one entry a face is needed", "targets", "use weight 0 where there is none");
    for (std::size_t f = 0; f < m; ++f)
      if (!not_negative(targets->weight[f]) || !std::isfinite(std::norm(targets->x0[f])) ||
          !std::isfinite(std::norm(targets->x1[f])))
        return fail("a target is not finite or its weight is negative, face " + std::to_string(f), "targets",
                    "use weight 0 where there is none");
  }
  for (const FixedDirection& each : fixed)
    if (each.face < 0 || each.face >= faces || !(std::abs(each.direction) > 0) ||
        !std::isfinite(std::norm(each.direction)))
      return fail("a fixed direction needs a face and a length", "fixed", "drop face " + std::to_string(each.face));
  return {};
}

namespace detail {

template <class Scalar>
SolverFactory<std::complex<Scalar>> factory_of(const BasicFieldOptions<Scalar>& options) {
  using K = std::complex<Scalar>;
  if (options.own_solver) return options.own_solver;
  // A dozen solutions a factorization, most of them to few digits: mixed precision takes half the time. Two steps
  // leave 1e-10.
  if (options.solver == default_solver_name)
    return [] {
      return Expected<AnySolver<K>>(AutomaticSolver<K>({.mixed_from = large_system, .mixed_tolerance = 1e-9}));
    };
  return solver_factory<K>(options.solver);
}

template <class Scalar>
double smoothness_energy(const FieldProblem<Scalar>& problem, int power, std::span<const double> weights,
                         std::span<const Complex> z) {
  using K = std::complex<Scalar>;
  const Smoothness<Scalar> term(*problem.mesh, *problem.connection, power, weights);
  if constexpr (std::is_same_v<K, Complex>)
    return energy_of<Complex>(term, z);
  else
    return energy_of<K>(term, std::vector<K>(z.begin(), z.end()));
}

// \pre there is a value
QUADRIG_INLINE double median(std::span<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return values.size() % 2 ? *middle : (*std::max_element(values.begin(), middle) + *middle) / 2;
}

// |x| per face as numbers that do not depend on the bases.
QUADRIG_INLINE void describe_polynomial(const PolyVectorField& field, FieldReport& report, const Context& context) {
  std::vector<double> size(field.x0.size()), other(size.size());
  parallel_each(&context, size.size(), [&](std::size_t f) {
    size[f] = std::sqrt(std::norm(field.x0[f]));
    other[f] = std::sqrt(std::norm(field.x1[f]));
  });
  report.sum_abs_x0 = std::accumulate(size.begin(), size.end(), 0.0);
  report.sum_abs_x1 = std::accumulate(other.begin(), other.end(), 0.0);
  if (!size.empty()) report.median_abs_x0 = median(size);
}

template <class Scalar>
void describe_bones(const FieldProblem<Scalar>& problem, const PolyVectorField& field, FieldReport& report,
                    const Context& context) {
  if (!problem.dominance) return;
  constexpr double none = -1;
  std::vector<double> angles(field.x0.size(), none);
  parallel_each(&context, angles.size(), [&](std::size_t i) {
    const auto f = static_cast<Index>(i);
    if (!(problem.dominance->omega(f, 1) > 0.9)) return;
    const Complex bone = bone_on_face(*problem.connection, *problem.skeleton, problem.dominance->share(f, 1).bone, f);
    if (!(std::abs(bone) > 1e-12)) return;
    const auto [u, v] = raw_roots(field.x0[i], field.x1[i]);
    const auto cosine = [&](Complex z) {
      const double square = std::norm(z) * std::norm(bone);
      return square > 0 ? std::abs(std::real(z * std::conj(bone))) / std::sqrt(square) : 1.0;
    };
    angles[i] = elementary::acos(std::min(1.0, std::max(cosine(u), cosine(v)))) * 180 / std::numbers::pi;
  });
  for (Index f = 0; f < problem.mesh->face_count(); ++f) {
    const double omega1 = problem.dominance->omega(f, 1);
    report.sum_omega1 += omega1;
    report.sum_omega2 += problem.dominance->omega(f, 2);
    if (omega1 > 0.9) ++report.faces_omega1_above_0_9;
  }
  std::erase(angles, none);
  if (angles.empty()) return;
  for (const double angle : angles) report.mean_angle_to_bone_deg += angle / static_cast<double>(angles.size());
  report.median_angle_to_bone_deg = median(angles);
}

template <class Scalar>
Expected<FieldResult> finish_field(const FieldProblem<Scalar>& problem, PolyVectorField polynomial,
                                   const BasicFieldOptions<Scalar>& options, FieldReport report,
                                   const Context& context) {
  FieldResult result;
  if (context.cancelled()) return cancelled_error("field");
  describe_polynomial(polynomial, report, context);
  if (context.cancelled()) return cancelled_error("field");
  describe_bones(problem, polynomial, report, context);
  if (context.cancelled()) return cancelled_error("field");
  Roots found = roots(polynomial, options.limits, &context);
  report.bounded_frames = found.bounded;
  result.frames = std::move(found.frames);
  result.polynomial = std::move(polynomial);
  if (context.cancelled()) return cancelled_error("field");
  result.matching = match(*problem.mesh, *problem.connection, result.frames, &context);
  if (context.cancelled()) return cancelled_error("field");
  auto counted = singularities(*problem.mesh, result.matching, &context);
  if (!counted) return counted.error();
  result.singularities = std::move(*counted);
  report.singularities_plus = result.singularities.plus;
  report.singularities_minus = result.singularities.minus;
  report.singularities_boundary = result.singularities.boundary;
  if (context.cancelled()) return cancelled_error("field");
  report.index_sum = result.singularities.sum;
  report.euler_characteristic = euler_characteristic(*problem.mesh);
  result.report = std::move(report);
  return result;
}

/// Gives crosses that are held the lengths of what bones ask for there.
template <class Scalar>
void keep_lengths(HeldCrosses<Scalar>& held, const PolyVectorTargets& targets) {
  for (std::size_t k = 0; k < held.x0.size(); ++k) {
    const auto f = static_cast<std::size_t>(held.x0[k].face);
    if (!(targets.weight[f] > 0)) continue;
    const auto [first, second] = raw_roots(targets.x0[f], targets.x1[f]);
    // x0 = −d⁴ of the direction d that is held; of the roots the one nearer to it has its length.
    const Complex along = std::sqrt(std::sqrt(-held.x0[k].value));
    const auto nearness = [&](Complex root) {
      const Complex turned = root * std::conj(along);
      return std::abs(root) > 0 ? std::abs(turned.real()) / std::abs(root) : 0.0;
    };
    const bool swapped = nearness(second) > nearness(first);
    const Complex u = along * std::abs(swapped ? second : first),
                  v = Complex(0, 1) * along * std::abs(swapped ? first : second);
    held.x0[k].value = u * u * v * v;
    held.x1[k].value = -(u * u + v * v);
  }
}

// The energy of the thesis as it stands, errata mended: areas relative to the largest, weights α and β. Beside borders,
// creases and features, of which it knows nothing, crosses are held.
template <class Scalar>
Expected<FieldResult> design_thesis_field(const FieldProblem<Scalar>& problem, const BasicFieldOptions<Scalar>& options,
                                          FieldReport report, Context& context) {
  const TriangleMesh<Scalar>& mesh = *problem.mesh;
  const auto m = static_cast<std::size_t>(mesh.face_count());
  auto bones = bone_targets_of(problem, options.bone_poses, {.lengths = BoneTargetOptions::Lengths::thesis}, context);
  if (!bones) return bones.error();
  PolyVectorTargets targets = std::move(*bones);
  auto solver = BasicFieldSolver<Scalar>::create(mesh, *problem.connection, factory_of(options));
  if (!solver) return solver.error();
  const ComponentScales scales = component_scales(mesh, 0.01, 0);
  if (options.bone_weight)
    for (double& weight : targets.weight) weight *= *options.bone_weight;
  if (options.curvature_weight.value_or(0) > 0) {
    auto curved = curvature_targets(problem, scales, options.curvature_length, *solver, context);
    if (!curved) return curved.error();
    add_targets(targets, std::move(*curved), *options.curvature_weight, context);
  }
  if (options.targets) add_targets(targets, *options.targets, 1, context);
  HeldCrosses<Scalar> fixed = held_crosses(problem, options, false, scales, context);
  keep_lengths(fixed, targets);
  report.fixed_faces = static_cast<Index>(fixed.x0.size());
  const double largest = m > 0 ? static_cast<double>(mesh.areas().maxCoeff()) : 1.0;
  std::vector<double> orthogonality(m), smoothness(3 * m, 0.0), beta(m);
  for (std::size_t f = 0; f < m; ++f) {
    const double area = mesh.area(static_cast<Index>(f)) / largest;
    beta[f] = bone_beta(*problem.dominance, static_cast<Index>(f));
    targets.weight[f] *= area;
    orthogonality[f] = beta[f] * area;
  }
  const Components& components = scales.components;
  std::vector<double> pull(static_cast<std::size_t>(components.count), 0.0);
  for (std::size_t f = 0; f < m; ++f)
    pull[static_cast<std::size_t>(components.of_face[f])] += targets.weight[f] + (fixed.held[f] ? 1 : 0);
  for (std::size_t f = 0; f < m; ++f)
    if (!(pull[static_cast<std::size_t>(components.of_face[f])] > 0))
      return Error{ErrorCode::numeric, "no bone pulls this component: the exact energy has no field for it",
                   "field, component of face " + std::to_string(f), "use the default preset"};
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    if (mesh.twin(h) == no_index) continue;
    const auto f = static_cast<std::size_t>(h / 3), g = static_cast<std::size_t>(mesh.twin(h) / 3);
    const double areas = (mesh.area(h / 3) + mesh.area(mesh.twin(h) / 3)) / largest;
    smoothness[static_cast<std::size_t>(h)] = (beta[f] + beta[g]) / 2 * areas / 3;
  }

  const std::array<BasicFieldSystem<Scalar>, 2> systems{BasicFieldSystem<Scalar>{.power = 4,
                                                                                 .smoothness = smoothness,
                                                                                 .target = targets.x0,
                                                                                 .target_weight = targets.weight,
                                                                                 .own_terms = options.own_terms_x0,
                                                                                 .fixed = fixed.x0},
                                                        BasicFieldSystem<Scalar>{.power = 2,
                                                                                 .smoothness = smoothness,
                                                                                 .target = targets.x1,
                                                                                 .target_weight = targets.weight,
                                                                                 .shrink = orthogonality,
                                                                                 .own_terms = options.own_terms_x1,
                                                                                 .fixed = fixed.x1}};
  auto solved = solver->minimize(systems, context);
  if (!solved) return solved.error();
  PolyVectorField polynomial{std::move((*solved)[0]), std::move((*solved)[1])};
  report.solve = solver->report();
  const std::span<const Complex> x0 = polynomial.x0, x1 = polynomial.x1;
  report.energy_align = energy_of<Complex>(Alignment<>(targets.x0, targets.weight), x0) +
                        energy_of<Complex>(Alignment<>(targets.x1, targets.weight), x1);
  report.energy_smooth = smoothness_energy(problem, 4, smoothness, x0) + smoothness_energy(problem, 2, smoothness, x1);
  report.energy_orth = energy_of<Complex>(Orthogonality<>(orthogonality), x1);
  return finish_field(problem, std::move(polynomial), options, std::move(report), context);
}

// Where bones meet, the densities of the two-bone rule along the first bone and across it, within [1, 4].
template <class Scalar>
DensityTargets bone_densities(const FieldProblem<Scalar>& problem, const FrameField& frames) {
  const auto m = frames.u.size();
  DensityTargets targets{std::vector<double>(m, 0.0), std::vector<double>(m, 0.0), std::vector<double>(m, 1.0)};
  for (std::size_t f = 0; f < m; ++f) {
    const auto face = static_cast<Index>(f);
    const double omega1 = problem.dominance->omega(face, 1), omega2 = problem.dominance->omega(face, 2);
    const Complex bone =
        bone_on_face(*problem.connection, *problem.skeleton, problem.dominance->share(face, 1).bone, face);
    if (!(omega2 > 0) || !(std::abs(bone) > 1e-12)) continue;
    const BoneDensity density =
        two_bone_density(*problem.mesh, *problem.connection, *problem.skeleton, *problem.dominance, face);
    const double share = omega2 / (omega1 + omega2);
    const double along = share * elementary::log(std::clamp(density.along, 1.0, 4.0));
    const double across = share * elementary::log(std::clamp(density.across, 1.0, 4.0));
    const bool u_along = std::abs(std::real(frames.u[f] * std::conj(bone))) / std::abs(frames.u[f]) >=
                         std::abs(std::real(frames.v[f] * std::conj(bone))) / std::abs(frames.v[f]);
    targets.log_u[f] = u_along ? along : across;
    targets.log_v[f] = u_along ? across : along;
  }
  return targets;
}

// Unit crosses have an energy that grows with the distance between a pair of singularities, which the linear solution
// escapes by vanishing between them. Alternately smoothing over a length and taking every cross back to a unit makes
// such pairs approach and cancel; targets pull as much as they did. Source: Merriman, Bence and Osher's scheme for
// crosses, Viertel and Osting 2019.
template <class Scalar>
Expected<std::vector<Complex>> merge_singularities(BasicFieldSolver<Scalar>& solver, BasicFieldSystem<Scalar> system,
                                                   const ComponentScales& scales,
                                                   const BasicFieldOptions<Scalar>& options, std::vector<Complex> x0,
                                                   FieldReport& report, Context& context) {
  const std::size_t m = x0.size();
  std::vector<double> factor;
  for (std::size_t c = 0; c < scales.area.size(); ++c) {
    const double length = std::max(options.merge_length,
                                   std::min(0.25, options.merge_quads * options.quad_edge / std::sqrt(scales.area[c])));
    const double ratio = length / scales.average[c];
    factor.push_back(2 * ratio * ratio);
  }
  const auto factor_of = [&](std::size_t f) { return factor[static_cast<std::size_t>(scales.components.of_face[f])]; };
  std::vector<double> smoothness(system.smoothness.begin(), system.smoothness.end());
  std::vector<double> weight(system.target_weight.begin(), system.target_weight.end());
  parallel_each(&context, m, [&](std::size_t f) {
    for (std::size_t h = 3 * f; h < 3 * f + 3; ++h) smoothness[h] *= factor_of(f);
    weight[f] *= factor_of(f);
  });
  system.smoothness = smoothness;
  system.target_weight = weight;
  system.shrink = scales.share;  // |x − x̂|² without its linear part, which each round adds to the right-hand side
  system.unpinned = {};

  constexpr double merge_tolerance = 1e-5;  // the rounds end when they move crosses by some 300 times as much
  std::vector<Complex> pull(m), unit(m);
  const auto renew = [&](std::size_t f) {
    if (const double size = std::abs(x0[f]); size > 0) unit[f] = x0[f] / size;
  };
  std::vector<double> change(m);
  parallel_each(&context, m, [&](std::size_t f) {
    unit[f] = 1;
    renew(f);
  });
  for (Index round = 0; round < options.merge_rounds; ++round) {
    parallel_each(&context, m, [&](std::size_t f) { pull[f] = scales.share[f] * unit[f]; });
    if (round == 0)
      if (Status status = solver.prepare(std::span(&system, 1), context); !status.ok()) return status.error();
    if (Status status = solver.improve(0, pull, merge_tolerance, x0, context); !status.ok()) return status.error();
    parallel_each(&context, m, [&](std::size_t f) {
      const Complex before = unit[f];
      renew(f);
      change[f] = scales.share[f] * std::norm(unit[f] - before);
    });
    ++report.merge_rounds;
    if (std::accumulate(change.begin(), change.end(), 0.0) < 1e-5) break;
  }
  return x0;
}

template <class Scalar>
Expected<FieldResult> design_smooth_field(const FieldProblem<Scalar>& problem, const BasicFieldOptions<Scalar>& options,
                                          FieldReport report, Context& context) {
  const TriangleMesh<Scalar>& mesh = *problem.mesh;
  const Connection<Scalar>& connection = *problem.connection;
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const bool flat = report.preset == FieldPreset::flat;
  const ComponentScales scales = component_scales(mesh, options.smoothing_length.value_or(flat ? 0.05 : 0.01),
                                                  options.merge_quads * options.quad_edge);
  for (std::size_t c = 0; c < scales.area.size(); ++c)
    report.smoothing_length = std::max(report.smoothing_length, scales.average[c] * std::sqrt(scales.area[c]));
  if (context.cancelled()) return cancelled_error("field");
  auto solver = BasicFieldSolver<Scalar>::create(mesh, connection, factory_of(options));
  if (!solver) return solver.error();
  if (context.cancelled()) return cancelled_error("field");

  auto wanted = wanted_crosses(problem, options, flat, scales, *solver, context);
  if (!wanted) return wanted.error();
  // no structured binding: clang 14 does not capture one
  const auto& targets = wanted->targets;
  const std::vector<double>& beta = wanted->beta;
  if (context.cancelled()) return cancelled_error("field");
  const HeldCrosses<Scalar> fixed = held_crosses(problem, options, flat, scales, context);
  report.fixed_faces = static_cast<Index>(fixed.x0.size());

  if (context.cancelled()) return cancelled_error("field");
  // Energies are shares: divided by each component's area, lengths are fractions of its size.
  std::vector<double> pull(scales.area.size(), 0.0), align(m), orthogonality(m);
  const bool skewed =
      !options.own_terms_x1.empty() || std::ranges::any_of(targets.x1, [](Complex x) { return x != 0.0; });
  for (std::size_t f = 0; f < m; ++f) {
    const auto c = static_cast<std::size_t>(scales.components.of_face[f]);
    align[f] = scales.share[f] * targets.weight[f];
    orthogonality[f] = scales.share[f] * beta[f];
    pull[c] += align[f] + (fixed.held[f] ? 1.0 : 0.0);
  }
  std::vector<double> smoothness = dirichlet_weights(mesh, beta, &context);
  for (std::size_t h = 0; h < smoothness.size(); ++h) {
    const double fraction = scales.average[static_cast<std::size_t>(scales.components.of_face[h / 3])];
    smoothness[h] *= fraction * fraction;
  }
  std::vector<Index> number(scales.area.size(), no_index), unpinned;
  for (std::size_t c = 0; c < pull.size(); ++c)
    if (pull[c] < 1e-6) number[c] = report.free_components++;
  std::vector<Complex> start;
  if (report.free_components > 0) {
    for (std::size_t f = 0; f < m; ++f)
      unpinned.push_back(number[static_cast<std::size_t>(scales.components.of_face[f])]);
    start = eigenvector_start(mesh, connection, 4);
  }

  std::vector<BasicFieldSystem<Scalar>> systems{BasicFieldSystem<Scalar>{.power = 4,
                                                                         .smoothness = smoothness,
                                                                         .target = targets.x0,
                                                                         .target_weight = align,
                                                                         .own_terms = options.own_terms_x0,
                                                                         .fixed = fixed.x0,
                                                                         .unpinned = unpinned,
                                                                         .mass = scales.share,
                                                                         .start = start}};
  if (skewed)
    systems.push_back(BasicFieldSystem<Scalar>{.power = 2,
                                               .smoothness = smoothness,
                                               .target = targets.x1,
                                               .target_weight = align,
                                               .shrink = orthogonality,
                                               .own_terms = options.own_terms_x1,
                                               .fixed = fixed.x1});
  auto solved = solver->minimize(systems, context);
  if (!solved) return solved.error();
  PolyVectorField polynomial{std::move((*solved)[0]), skewed ? std::move((*solved)[1]) : std::vector<Complex>(m)};
  if (context.cancelled()) return cancelled_error("field");
  const std::span<const Complex> x0 = polynomial.x0, x1 = polynomial.x1;
  std::array<double, 5> energies{};  // without x1 the last three are 0
  context.parallel_for(skewed ? energies.size() : 2, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      energies[k] = k == 0   ? smoothness_energy(problem, 4, smoothness, x0)
                    : k == 1 ? energy_of<Complex>(Alignment<>(targets.x0, align), x0)
                    : k == 2 ? energy_of<Complex>(Alignment<>(targets.x1, align), x1)
                    : k == 3 ? energy_of<Complex>(Orthogonality<>(orthogonality), x1)
                             : smoothness_energy(problem, 2, smoothness, x1);
  });
  report.energy_align = energies[1] + energies[2];
  report.energy_smooth = energies[0] + energies[4];
  report.energy_orth = energies[3];

  if (context.cancelled()) return cancelled_error("field");
  if (options.merge_rounds > 0) {
    auto merged = merge_singularities(*solver, systems.front(), scales, options, polynomial.x0, report, context);
    if (!merged) return merged.error();
    polynomial.x0 = std::move(*merged);
  }
  report.solve = solver->report();

  const double length = report.smoothing_length;
  auto result = finish_field(problem, std::move(polynomial), options, std::move(report), context);
  if (!result) return result;
  result->pull.reserve(m);
  for (const double weight : targets.weight) result->pull.push_back(std::min(weight, 1.0));
  const std::vector<double> zero(m, 0.0);
  DensityTargets densities{zero, zero, zero};
  if (options.bone_density && problem.dominance) {
    auto smoothed = smooth_log_densities(
        mesh, result->matching, bone_densities(problem, result->frames), length, context,
        options.own_real_solver ? options.own_real_solver : solver_factory<Scalar>(options.solver));
    if (!smoothed) return smoothed.error();
    densities = std::move(*smoothed);
  }
  apply_densities(result->frames, densities, 1, 4, &context);
  return result;
}

}  // namespace detail

template <class Scalar>
Expected<FieldResult> design_field(const TriangleMesh<Scalar>& mesh, const Rig* rig,
                                   const Connection<Scalar>& connection,
                                   const std::type_identity_t<BasicFieldOptions<Scalar>>& options, Context& context) {
  const Stopwatch clock;
  if (Status status = options.validate(mesh.face_count()); !status.ok()) return status.error();
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (!(mesh.area(f) > 0))
      return Error{ErrorCode::bad_input, "the face has no area", "field, face " + std::to_string(f),
                   "run prepare() to remove degenerate faces"};
  detail::FieldProblem<Scalar> problem{&mesh, &connection, nullptr, {}, nullptr};
  FieldReport report;
  report.preset = options.preset;
  report.solver = options.own_solver ? "own" : options.solver;
  report.vertices = mesh.vertex_count();
  report.faces = mesh.face_count();
  report.interior_edges = mesh.interior_edge_count();
  if (rig) {
    auto dominance = Dominance::create(mesh, *rig, &context);
    if (!dominance) return dominance.error();
    problem.dominance = std::move(*dominance);
    problem.skeleton = &rig->skeleton;
    problem.weights = &rig->weights;
    for (const Pose& pose : options.bone_poses)
      if (pose.size() != rig->skeleton.bones.size())
        return Error{ErrorCode::bad_option, std::to_string(pose.size()) + " transforms", "field, bone_poses",
                     "give one a bone, " + std::to_string(rig->skeleton.bones.size())};
    if (context.cancelled()) return cancelled_error("field");
    report.bones = rig->skeleton.bone_count();
  } else if (options.preset == FieldPreset::thesis) {
    return Error{ErrorCode::bad_option, "the thesis preset needs a rig", "field, preset", "use default or static"};
  } else {
    report.preset = FieldPreset::flat;
  }
  auto result = options.preset == FieldPreset::thesis
                    ? detail::design_thesis_field(problem, options, std::move(report), context)
                    : detail::design_smooth_field(problem, options, std::move(report), context);
  if (!result) return result;
  FieldReport& made = result->report;
  made.seconds = clock.seconds();
  if (context.on_log)
    context.log("field of " + std::to_string(made.faces) + " triangles: " + std::to_string(made.singularities_plus) +
                " and " + std::to_string(made.singularities_minus) + " singularities, " +
                std::to_string(made.merge_rounds) + " rounds of merging, solved by " + made.solve.backend);
  return result;
}

}  // namespace quadrig
