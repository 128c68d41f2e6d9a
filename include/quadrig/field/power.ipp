// Definitions of field/power.hpp.
#pragma once

#include "quadrig/field/power.hpp"

namespace quadrig {

QUADRIG_INLINE Status PowerFieldOptions::validate(Index faces) const {
  const auto m = static_cast<std::size_t>(faces);
  const auto fail = [](std::string what, std::string field, std::string remedy) {
    return Status(Error{ErrorCode::bad_option, std::move(what), "power field, " + std::move(field), std::move(remedy)});
  };
  if (n < 1) return fail("directions are at least one", "n", "use 1, 2, 4 or 6");
  if (!(smoothing_length > 0)) return fail("a length is positive", "smoothing_length", "0.02 is usual");
  if (!target_directions.empty() && target_directions.size() != m)
    return fail("one direction a face is needed", "target_directions", "use 0 where there is none");
  if (!target_weights.empty() && target_weights.size() != m)
    return fail("one weight a face is needed", "target_weights", "use 0 where there is none");
  if (!target_weights.empty() && target_directions.empty())
    return fail("weights without directions", "target_weights", "give target_directions");
  for (const double weight : target_weights)
    if (!(weight >= 0 && std::isfinite(weight)))
      return fail("a weight is finite and not negative", "target_weights", "use 0 where there is none");
  for (const FixedDirection& each : fixed)
    if (each.face < 0 || each.face >= faces || !(std::abs(each.direction) > 0))
      return fail("a fixed direction needs a face and a length", "fixed", "drop face " + std::to_string(each.face));
  return {};
}

namespace detail {

template <class Scalar>
std::vector<Complex> eigenvector_start(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                                       int power) {
  // Summed from the areas' centre of each component: vectors outward from it, and the edges, turn with the surface.
  const Components components = face_components(mesh);
  std::vector<Vector3> centre(static_cast<std::size_t>(components.count), Vector3::Zero());
  std::vector<double> area(centre.size(), 0.0);
  const auto barycentre = [&](Index f) -> Vector3 {
    return ((mesh.position(mesh.faces()(f, 0)) + mesh.position(mesh.faces()(f, 1)) +
             mesh.position(mesh.faces()(f, 2))) /
            Scalar(3))
        .template cast<double>();
  };
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto c = static_cast<std::size_t>(components.of_face[static_cast<std::size_t>(f)]);
    centre[c] += mesh.area(f) * barycentre(f);
    area[c] += mesh.area(f);
  }
  for (std::size_t c = 0; c < centre.size(); ++c)
    if (area[c] > 0) centre[c] /= area[c];
  std::vector<Complex> start(static_cast<std::size_t>(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto c = static_cast<std::size_t>(components.of_face[static_cast<std::size_t>(f)]);
    const double size = std::sqrt(area[c]);
    const Complex outward = Complex(connection.to_complex(f, (barycentre(f) - centre[c]).template cast<Scalar>())) /
                            (size > 0 ? size : 1.0);
    Complex value = std::abs(outward) > 1e-6 ? integer_power(outward / std::abs(outward), power) : Complex{};
    Index longest = 3 * f;
    for (Index h = 3 * f + 1; h < 3 * f + 3; ++h)
      if (mesh.edge_vector(h).squaredNorm() > mesh.edge_vector(longest).squaredNorm()) longest = h;
    value += 0.1 * integer_power(Complex(connection.edge(longest)), power);
    start[static_cast<std::size_t>(f)] = value;
  }
  return start;
}

}  // namespace detail

template <class Scalar>
std::vector<Index> power_field_index(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                                     const PowerField& field) {
  std::vector<double> turning(static_cast<std::size_t>(mesh.vertex_count()), 0.0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index twin = mesh.twin(h);
    if (twin == no_index || twin < h) continue;
    const Complex here = field.power[static_cast<std::size_t>(h / 3)] * Complex(connection.transport(mesh, h, field.n));
    const double turn = elementary::arg(here * std::conj(field.power[static_cast<std::size_t>(twin / 3)]));
    turning[static_cast<std::size_t>(mesh.target(h))] += turn;
    turning[static_cast<std::size_t>(mesh.origin(h))] -= turn;
  }
  const auto defects = angle_defects(mesh);
  std::vector<Index> index(turning.size(), 0);
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.outgoing(v) != no_index && !mesh.on_boundary(v))
      index[static_cast<std::size_t>(v)] = static_cast<Index>(std::lround(
          (field.n * static_cast<double>(defects[v]) - turning[static_cast<std::size_t>(v)]) / (2 * std::numbers::pi)));
  return index;
}

template <class Scalar>
Expected<PowerFieldResult> design_power_field(const TriangleMesh<Scalar>& mesh, const Connection<Scalar>& connection,
                                              const PowerFieldOptions& options, Context& context) {
  const Stopwatch clock;
  if (Status status = options.validate(mesh.face_count()); !status.ok()) return status.error();
  const auto m = static_cast<std::size_t>(mesh.face_count());
  const Components components = face_components(mesh);
  std::vector<double> area(static_cast<std::size_t>(components.count), 0.0), pull(area.size(), 0.0);
  for (std::size_t f = 0; f < m; ++f)
    area[static_cast<std::size_t>(components.of_face[f])] += mesh.area(static_cast<Index>(f));

  std::vector<Complex> target(m);
  std::vector<double> weight(m, 0.0), mass(m);
  for (std::size_t f = 0; f < m; ++f) {
    const auto c = static_cast<std::size_t>(components.of_face[f]);
    mass[f] = mesh.area(static_cast<Index>(f)) / area[c];
    if (options.target_directions.empty() || !(std::abs(options.target_directions[f]) > 0)) continue;
    target[f] = integer_power(options.target_directions[f] / std::abs(options.target_directions[f]), options.n);
    weight[f] = mass[f] * (options.target_weights.empty() ? 1.0 : options.target_weights[f]);
    pull[c] += weight[f];
  }
  std::vector<typename BasicFieldSystem<Scalar>::Fixed> fixed;
  for (const FixedDirection& each : options.fixed) {
    fixed.push_back({each.face, integer_power(each.direction / std::abs(each.direction), options.n)});
    pull[static_cast<std::size_t>(components.of_face[static_cast<std::size_t>(each.face)])] += 1;
  }
  std::vector<Index> number(area.size(), no_index), unpinned;
  PowerFieldResult result;
  for (std::size_t c = 0; c < area.size(); ++c)
    if (pull[c] < 1e-6) number[c] = result.free_components++;
  std::vector<Complex> start;
  if (result.free_components > 0) {
    for (std::size_t f = 0; f < m; ++f) unpinned.push_back(number[static_cast<std::size_t>(components.of_face[f])]);
    start = detail::eigenvector_start(mesh, connection, options.n);
  }
  std::vector<double> smoothness = dirichlet_weights(mesh);
  for (double& each : smoothness) each *= options.smoothing_length * options.smoothing_length;

  auto solver = BasicFieldSolver<Scalar>::create(mesh, connection, options.solver.factory<std::complex<Scalar>>());
  if (!solver) return solver.error();
  const std::array<BasicFieldSystem<Scalar>, 1> system{BasicFieldSystem<Scalar>{.power = options.n,
                                                                                .smoothness = smoothness,
                                                                                .target = target,
                                                                                .target_weight = weight,
                                                                                .fixed = fixed,
                                                                                .unpinned = unpinned,
                                                                                .mass = mass,
                                                                                .start = start}};
  auto solved = solver->minimize(system, context);
  if (!solved) return solved.error();
  result.field = {options.n, std::move(solved->front())};
  result.index = power_field_index(mesh, connection, result.field);
  for (const Index index : result.index) result.index_sum += index;
  if (mesh.closed() && result.index_sum != options.n * euler_characteristic(mesh))
    return Error{ErrorCode::numeric,
                 "Poincaré–Hopf does not hold: index sum " + std::to_string(result.index_sum) + ", wanted " +
                     std::to_string(options.n * euler_characteristic(mesh)),
                 "power field", "run prepare() to remove degenerate faces"};
  result.seconds = clock.seconds();
  return result;
}

}  // namespace quadrig
