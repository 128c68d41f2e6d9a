// Definitions of field/systems.hpp.
#pragma once

#include "quadrig/field/systems.hpp"

namespace quadrig {

namespace detail {

// The double numbers of callers beside the K of systems.
template <class K>
[[nodiscard]] std::vector<Complex> widened(std::vector<K> values) {
  if constexpr (std::is_same_v<K, Complex>)
    return values;
  else
    return {values.begin(), values.end()};
}
template <class K>
[[nodiscard]] std::vector<K> free_part(const QuadraticForm<K>& form, std::span<const Complex> all) {
  if constexpr (std::is_same_v<K, Complex>)
    return form.restrict_to_free(all);
  else
    return form.restrict_to_free(std::vector<K>(all.begin(), all.end()));
}

}  // namespace detail

template <class Scalar>
Expected<BasicFieldSolver<Scalar>> BasicFieldSolver<Scalar>::create(const TriangleMesh<Scalar>& mesh,
                                                                    const Connection<Scalar>& connection,
                                                                    SolverFactory<K> factory) {
  if (auto first = factory(); !first) return first.error();
  return BasicFieldSolver(mesh, connection, std::move(factory));
}

template <class Scalar>
Status BasicFieldSolver<Scalar>::assemble(Slot& slot, const System& system, const Context& context) {
  std::vector<char> held(static_cast<std::size_t>(mesh_->face_count()), 0);
  for (const typename System::Fixed& fixed : system.fixed) {
    held[static_cast<std::size_t>(fixed.face)] = 1;
    slot.form.fix(fixed.face, K(fixed.value));
  }
  for (Index f = 0; f < mesh_->face_count(); ++f)
    if (!held[static_cast<std::size_t>(f)]) slot.form.release(f);

  const Smoothness<Scalar> smoothness(*mesh_, *connection_, system.power, system.smoothness);
  std::vector<TermRef<K>> terms{smoothness};
  for (const AnyTerm<K>& own : system.own_terms) terms.emplace_back(own);
  // Without its targets, which may change alone. A face that no row reaches has its place in the matrix all the same.
  if (Status status = slot.form.assemble(std::span<const TermRef<K>>(terms), &context); !status.ok()) return status;
  const std::span<const K> rhs = slot.form.rhs();
  slot.rhs.assign(rhs.begin(), rhs.end());
  slot.diagonal.resize(rhs.size());
  for (std::size_t i = 0, f = 0; f < held.size(); ++f) {
    if (held[f]) continue;
    slot.diagonal[i] = slot.form.diagonal(static_cast<Index>(i));
    if (!system.shrink.empty()) slot.diagonal[i] += static_cast<Scalar>(system.shrink[f]);
    if (!std::isfinite(slot.diagonal[i++]))
      return Error{ErrorCode::bad_input, "a number is not finite", "term orthogonality, row " + std::to_string(f),
                   "check the term with quadrig/laws.hpp"};
  }
  if (Status status = add_targets(slot, system.target, system.target_weight); !status.ok()) return status;

  // A component that nothing pins is singular, or as good as: a shift far below its first eigenvalue mends that.
  if (!system.unpinned.empty()) {
    constexpr double shift = std::max(1e-8, 16.0 * std::numeric_limits<Scalar>::epsilon());
    const auto A = slot.form.matrix();
    double mean = 0;
    for (Index j = 0; j < A.size; ++j)
      mean += static_cast<double>(
                  std::real(A.values[static_cast<std::size_t>(A.column_starts[static_cast<std::size_t>(j)])])) /
              A.size;
    Index unknown = 0;
    for (std::size_t f = 0; f < held.size(); ++f) {
      if (held[f]) continue;
      if (system.unpinned[f] != no_index)
        slot.form.add_to_diagonal(unknown, static_cast<Scalar>(mean > 0 ? shift * mean : 1));
      ++unknown;
    }
  }
  return {};
}

template <class Scalar>
Status BasicFieldSolver<Scalar>::add_targets(Slot& slot, std::span<const Complex> target,
                                             std::span<const double> weight) {
  Index unknown = 0;
  for (Index f = 0; f < mesh_->face_count(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    if (!std::isfinite(weight[i]) || !std::isfinite(std::norm(target[i])))
      return Error{ErrorCode::bad_input, "a number is not finite", "term alignment, row " + std::to_string(f),
                   "check the term with quadrig/laws.hpp"};
    if (slot.form.is_fixed(f)) continue;
    const auto j = static_cast<std::size_t>(unknown);
    slot.form.set_diagonal(unknown++, slot.diagonal[j] + static_cast<Scalar>(weight[i]),
                           slot.rhs[j] + K(weight[i] * target[i]));
  }
  return {};
}

// The order of the last analysis among the free faces, those that were not free before it first: with their few
// neighbours they fill little. Empty where there is none that is worth keeping.
template <class Scalar>
std::vector<Index> BasicFieldSolver<Scalar>::lasting_order(const QuadraticForm<K>& form) const {
  std::vector<Index> unknown(static_cast<std::size_t>(mesh_->face_count()), no_index), order;
  Index count = 0;
  for (Index f = 0; f < mesh_->face_count(); ++f)
    if (!form.is_fixed(f)) unknown[static_cast<std::size_t>(f)] = count++;
  for (const Index f : face_order_)
    if (const Index u = unknown[static_cast<std::size_t>(f)]; u != no_index) order.push_back(u);
  const std::size_t fresh = static_cast<std::size_t>(count) - order.size();
  if (fresh * 50 > order.size()) return {};
  for (const Index f : face_order_) unknown[static_cast<std::size_t>(f)] = no_index;
  std::vector<Index> first;
  for (const Index u : unknown)
    if (u != no_index) first.push_back(u);
  order.insert(order.begin(), first.begin(), first.end());
  return order;
}

template <class Scalar>
Status BasicFieldSolver<Scalar>::analyze(Slot& slot, Context& context) {
  if (slot.solver && slot.version == slot.form.pattern_version()) return {};
  const auto A = slot.form.matrix();
  const bool same =
      analyzed_ && std::ranges::equal(A.column_starts, column_starts_) && std::ranges::equal(A.rows, rows_);
  if (!same) {
    auto fresh = factory_();
    if (!fresh) return fresh.error();
    analyzed_ = std::move(*fresh);
    const std::vector<Index> order = lasting_order(slot.form);
    if (Status status = analyzed_->analyze(A, order, context); !status.ok()) return status;
    if (order.empty()) {
      std::vector<Index> faces;
      for (Index f = 0; f < mesh_->face_count(); ++f)
        if (!slot.form.is_fixed(f)) faces.push_back(f);
      face_order_.clear();
      for (const Index u : analyzed_->elimination_order()) face_order_.push_back(faces[static_cast<std::size_t>(u)]);
    }
    ++report_.analyses;
    report_.backend = analyzed_->description();
    column_starts_.assign(A.column_starts.begin(), A.column_starts.end());
    rows_.assign(A.rows.begin(), A.rows.end());
  }
  if (analyzed_->can_clone())
    slot.solver = analyzed_->clone();
  else
    slot.solver = std::exchange(analyzed_, std::nullopt);
  slot.version = slot.form.pattern_version();
  return {};
}

namespace detail {

// Inverse iteration on every unpinned component at once; each is normalized by itself.
template <class Scalar>
Expected<Index> smallest_eigenvectors(const BasicFieldSystem<Scalar>& system,
                                      const QuadraticForm<std::complex<Scalar>>& form,
                                      AnySolver<std::complex<Scalar>>& solver, std::vector<Complex>& z,
                                      Context& context) {
  using K = std::complex<Scalar>;
  constexpr double epsilon = std::numeric_limits<Scalar>::epsilon();
  constexpr double settled_change = std::max(1e-16, 64 * epsilon * epsilon);
  Index components = 0;
  for (const Index component : system.unpinned) components = std::max(components, component + 1);
  std::vector<double> square(static_cast<std::size_t>(components)), mass(square.size()), change(square.size());
  for (std::size_t f = 0; f < z.size(); ++f)
    if (system.unpinned[f] != no_index) mass[static_cast<std::size_t>(system.unpinned[f])] += system.mass[f];
  const auto normalize = [&](std::vector<Complex>& values) {
    std::fill(square.begin(), square.end(), 0.0);
    for (std::size_t f = 0; f < values.size(); ++f)
      if (system.unpinned[f] != no_index)
        square[static_cast<std::size_t>(system.unpinned[f])] += system.mass[f] * std::norm(values[f]);
    for (std::size_t f = 0; f < values.size(); ++f) {
      if (system.unpinned[f] == no_index) continue;
      const auto c = static_cast<std::size_t>(system.unpinned[f]);
      values[f] = square[c] > 0 ? values[f] * std::sqrt(mass[c] / square[c]) : system.start[f];
    }
  };

  std::vector<Complex> iterate(z.size());
  for (std::size_t f = 0; f < z.size(); ++f)
    if (system.unpinned[f] != no_index) iterate[f] = system.start[f];
  normalize(iterate);
  std::vector<Complex> right(z.size());
  std::vector<K> x(form.rhs().size());
  double moved = 1;  // mean square, of the component that moved most
  Index iteration = 0;
  for (constexpr Index limit = 100; iteration < limit; ++iteration) {
    if (context.cancelled()) return cancelled_error("field");
    for (std::size_t f = 0; f < z.size(); ++f)
      right[f] = system.unpinned[f] == no_index ? Complex{} : system.mass[f] * iterate[f];
    const std::vector<K> b = free_part(form, right);
    // From the last x, to a hundredth of what the last step moved.
    const double tolerance = std::max(1e-10, 1e-2 * std::sqrt(moved));
    if (const SolveInfo info = solver.improve(b, x, tolerance, context); !info.status.ok()) return info.status.error();
    std::vector<Complex> next = widened(form.expand(x));
    for (std::size_t f = 0; f < z.size(); ++f)
      if (system.unpinned[f] == no_index) next[f] = 0;
    normalize(next);
    std::fill(change.begin(), change.end(), 0.0);
    for (std::size_t f = 0; f < z.size(); ++f)
      if (system.unpinned[f] != no_index)
        change[static_cast<std::size_t>(system.unpinned[f])] += system.mass[f] * std::norm(next[f] - iterate[f]);
    iterate = std::move(next);
    moved = 0;
    for (std::size_t c = 0; c < change.size(); ++c) moved = std::max(moved, change[c] / mass[c]);
    if (moved <= settled_change) break;
  }
  for (std::size_t f = 0; f < z.size(); ++f)
    if (system.unpinned[f] != no_index) z[f] = iterate[f];
  return iteration;
}

}  // namespace detail

// Body(k, context of its own) for each system, side by side: callbacks are for the caller's thread.
template <class Scalar>
template <class Body>
void BasicFieldSolver<Scalar>::each_of(std::size_t count, Context& context, Body&& body) {
  const unsigned threads =
      std::max(1u, context.thread_count() / static_cast<unsigned>(std::max<std::size_t>(count, 1)));
  context.parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      Context own = context.quiet(threads);
      body(k, own);
    }
  });
}

template <class Scalar>
Status BasicFieldSolver<Scalar>::prepare(std::span<const System> systems, Context& context) {
  while (slots_.size() < systems.size()) slots_.push_back({QuadraticForm<K>(mesh_->face_count()), {}, 0, {}, {}});
  for (std::size_t k = 0; k < systems.size(); ++k) {
    const Stopwatch assembly;
    if (Status status = assemble(slots_[k], systems[k], context); !status.ok()) return status;
    report_.assembly_seconds += assembly.seconds();
    const Stopwatch analysis;
    if (Status status = analyze(slots_[k], context); !status.ok()) return status;
    report_.analysis_seconds += analysis.seconds();
    if (context.cancelled()) return cancelled_error("field");
  }
  std::vector<Status> statuses(systems.size());
  std::vector<double> seconds(systems.size(), 0.0);
  each_of(systems.size(), context, [&](std::size_t k, Context& own) {
    const auto A = slots_[k].form.matrix();
    if (A.size == 0) return;
    const Stopwatch factorization;
    statuses[k] = slots_[k].solver->factorize(A, own);
    if (statuses[k].ok() && own.cancelled()) statuses[k] = cancelled_error("field");
    seconds[k] = factorization.seconds();
  });
  for (std::size_t k = 0; k < systems.size(); ++k) {
    if (!statuses[k].ok()) return statuses[k];
    report_.factorization_seconds += seconds[k];
  }
  return {};
}

template <class Scalar>
Expected<std::vector<std::vector<Complex>>> BasicFieldSolver<Scalar>::minimize(std::span<const System> systems,
                                                                               Context& context) {
  if (Status status = prepare(systems, context); !status.ok()) return status.error();
  struct Outcome {
    std::optional<Error> error;
    std::vector<Complex> z;
    double seconds = 0, residual = 0;
    Index iterations = 0;
  };
  std::vector<Outcome> outcomes(systems.size());
  each_of(systems.size(), context, [&](std::size_t k, Context& own) {
    Outcome& outcome = outcomes[k];
    Slot& slot = slots_[k];
    std::vector<K> x(slot.form.rhs().size());
    const Stopwatch solve;
    if (!x.empty()) {
      const SolveInfo info = slot.solver->solve(slot.form.rhs(), x, own);
      if (!info.status.ok()) {
        outcome.error = info.status.error();
        return;
      }
      outcome.residual = std::isnan(info.residual) ? 0 : info.residual;
    }
    outcome.z = detail::widened(slot.form.expand(x));
    if (!systems[k].unpinned.empty()) {
      auto iterations = detail::smallest_eigenvectors<Scalar>(systems[k], slot.form, *slot.solver, outcome.z, own);
      if (!iterations) {
        outcome.error = iterations.error();
        return;
      }
      outcome.iterations = *iterations;
    }
    outcome.seconds = solve.seconds();
  });

  std::vector<std::vector<Complex>> results;
  for (Outcome& outcome : outcomes) {
    if (outcome.error) return *outcome.error;
    report_.solve_seconds += outcome.seconds;
    report_.residual = std::max(report_.residual, outcome.residual);
    report_.inverse_iterations = std::max(report_.inverse_iterations, outcome.iterations);
    results.push_back(std::move(outcome.z));
  }
  return results;
}

template <class Scalar>
Expected<std::vector<Complex>> BasicFieldSolver<Scalar>::update(std::size_t k, std::span<const Complex> target,
                                                                std::span<const double> target_weight,
                                                                Context& context) {
  Slot& slot = slots_[k];
  const Stopwatch assembly;
  if (Status status = add_targets(slot, target, target_weight); !status.ok()) return status.error();
  report_.assembly_seconds += assembly.seconds();
  std::vector<K> x(slot.form.rhs().size());
  if (!x.empty()) {
    const Stopwatch factorization;
    if (Status status = slot.solver->factorize(slot.form.matrix(), context); !status.ok()) return status.error();
    report_.factorization_seconds += factorization.seconds();
    const Stopwatch solve;
    const SolveInfo info = slot.solver->solve(slot.form.rhs(), x, context);
    if (!info.status.ok()) return info.status.error();
    report_.solve_seconds += solve.seconds();
    if (!std::isnan(info.residual)) report_.residual = std::max(report_.residual, info.residual);
  }
  return detail::widened(slot.form.expand(x));
}

template <class Scalar>
Status BasicFieldSolver<Scalar>::improve(std::size_t k, std::span<const Complex> added_rhs, double tolerance,
                                         std::vector<Complex>& z, Context& context) {
  if (context.cancelled()) return cancelled_error("field");
  const Stopwatch clock;
  Slot& slot = slots_[k];
  const std::span<const K> right = slot.form.rhs();
  rhs_.resize(right.size());
  unknowns_.resize(right.size());
  const auto for_each_free = [&](auto&& body) {
    if (slot.form.free_count() == mesh_->face_count())
      return parallel_each(&context, rhs_.size(), [&](std::size_t f) { body(f, f); });
    std::size_t unknown = 0;
    for (Index f = 0; f < mesh_->face_count(); ++f)
      if (!slot.form.is_fixed(f)) body(unknown++, static_cast<std::size_t>(f));
  };
  for_each_free([&](std::size_t i, std::size_t f) {
    rhs_[i] = right[i] + static_cast<K>(added_rhs[f]);
    unknowns_[i] = static_cast<K>(z[f]);
  });
  if (!rhs_.empty())
    if (const SolveInfo info = slot.solver->improve(rhs_, unknowns_, tolerance, context); !info.status.ok())
      return info.status;
  for_each_free([&](std::size_t i, std::size_t f) { z[f] = static_cast<Complex>(unknowns_[i]); });
  report_.solve_seconds += clock.seconds();
  return {};
}

}  // namespace quadrig
