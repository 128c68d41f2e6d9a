// Surfaces and fields from which the tests of the map, the integers and the quads start.
#pragma once

#include "corpus/synthetic.hpp"
#include "quadrig/field.hpp"
#include "quadrig/quads/grid_map.hpp"
#include "quadrig/quads/place.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/seamless.hpp"
#include "surfaces.hpp"

namespace quadrig::test {

[[nodiscard]] inline TriangleMesh<double> build(const Soup& soup) { return build(soup.positions(), soup.triangles()); }

/// Surfaces of genus 0 to 2, closed.
[[nodiscard]] inline TriangleMesh<double> closed_surface(int which) {
  using namespace synthetic;
  switch (which) {
    case 0:
      return build(bumpy(sphere(14), 0.3, 3, 5));
    case 1:
      return build(torus_mesh(28, 16, 1, 0.4));
    default:
      return build(level_set(any_of({torus({0, 0, 0}, 0.8, 0.3), torus({1.5, 0, 0}, 0.8, 0.3)}, 0.2),
                             Vector3(-1.3, -1.3, -0.6), Vector3(2.8, 1.3, 0.6), 0.22));
  }
}
/// Surfaces with borders: a bent square, an annulus, a ball with three holes.
[[nodiscard]] inline TriangleMesh<double> open_surface(int which) {
  using namespace synthetic;
  switch (which) {
    case 0:
      return build(sheet(10, 10, [](double s, double t) { return Vector3(s, t, 0.3 * s * t); }));
    case 1:
      return build(revolved(stepped({{0.4, 0}, {1, 0.3}}, 0.12), 24));
    default:
      return build(clipped(sphere(16), holes_in_ball(3, 0.45)));
  }
}

/// A field, its matching and the cut surface.
struct FieldCase {
  TriangleMesh<double> mesh;
  Connection<double> connection;
  FieldResult field;
  CutGraph cut;
  std::vector<Aligned> aligned;
  bool pinned = false;

  [[nodiscard]] const std::vector<Index>& index() const { return field.singularities.index4; }
  [[nodiscard]] std::vector<char> border() const {
    std::vector<char> on_border;
    for (Index v = 0; v < mesh.vertex_count(); ++v) on_border.push_back(mesh.on_boundary(v));
    return on_border;
  }
  [[nodiscard]] Index singular_count() const {
    return static_cast<Index>(std::count_if(index().begin(), index().end(), [](Index i) { return i != 0; }));
  }
};

/// A field on `mesh`: smooth for seed 0, else drawn to random directions on some faces.
[[nodiscard]] inline FieldCase field_case(TriangleMesh<double> mesh, std::uint64_t seed, double edge) {
  Connection<double> connection(mesh);
  FieldOptions options;
  options.preset = FieldPreset::flat;
  options.curvature_weight = seed == 0 ? 1.0 : 0.0;
  options.crease_angle_radians = std::numbers::pi;
  options.merge_rounds = seed == 0 ? 10 : 0;
  if (seed != 0) {
    Random random(seed);
    PolyVectorTargets targets = PolyVectorTargets::none(mesh.face_count());
    for (int k = 0; k < 12; ++k) {
      const auto f = static_cast<std::size_t>(random.number(0, mesh.face_count()));
      targets.x0[f] = std::polar(1.0, random.number(0, 6.28));
      targets.weight[f] = 30;
    }
    options.targets = std::move(targets);
  }
  Context context;
  FieldResult field = design_field(mesh, static_cast<const Rig*>(nullptr), connection, options, context).value();
  for (std::size_t f = 0; f < field.frames.u.size(); ++f) {  // squares of one size
    field.frames.u[f] /= std::abs(field.frames.u[f]) * edge;
    field.frames.v[f] = field.frames.u[f] * Complex(0, 1);
  }
  std::vector<std::int8_t> rotation(static_cast<std::size_t>(mesh.halfedge_count()));
  for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(field.matching.r[h] & 3);
  CutGraph cut = make_cut_graph(mesh, rotation, field.singularities.index4);
  std::vector<Aligned> aligned(static_cast<std::size_t>(mesh.halfedge_count()), Aligned::none);
  bool pinned = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    if (mesh.twin(h) != no_index) continue;
    const auto f = static_cast<std::size_t>(h / 3);
    const Complex u = rotated(field.frames.u[f], cut.combing[f]);
    const Complex e = connection.edge(h) / u;
    aligned[static_cast<std::size_t>(h)] =
        std::abs(e.real()) >= std::abs(e.imag()) ? Aligned::v_constant : Aligned::u_constant;
    pinned = true;
  }
  return {std::move(mesh), std::move(connection), std::move(field), std::move(cut), std::move(aligned), pinned};
}

/// The seamless map of a case; no value where it keeps a defect.
template <class K>
struct SeamlessCase {
  MapUnknowns<K> unknowns;
  TargetEdges target;
  std::vector<Complex> z;
  bool valid = false;
};
template <class K>
[[nodiscard]] SeamlessCase<K> seamless_case(const FieldCase& c) {
  Context context;
  SeamlessCase<K> out{MapUnknowns<K>::create(c.mesh, c.cut, c.index(), c.aligned).value(), {}, {}, false};
  out.target = target_edges(c.mesh, c.connection, c.cut, c.field.frames.u, c.field.frames.v);
  out.target = correct_log_scale(c.mesh, c.cut, c.index(), LogScaleOptions{}, out.target, context).value().target;
  PoissonMap<K> solved =
      solve_poisson<K>(c.mesh, out.unknowns, c.index(), out.target, PoissonOptions{}, context).value();
  out.z = std::move(solved.z);
  out.valid = solved.report.defects.valid();
  if (out.valid) return out;
  UntangledMap untangled =
      untangle(c.mesh, c.cut, c.index(), c.aligned, out.target, UntangleOptions{}, std::move(out.z), context).value();
  out.z = std::move(untangled.z);
  out.valid = untangled.report.defects.valid();
  return out;
}

/// No vertex that a quad mesh cannot have.
[[nodiscard]] inline bool mappable(const FieldCase& c) {
  for (Index v = 0; v < c.mesh.vertex_count(); ++v)
    if (c.index()[static_cast<std::size_t>(v)] > 1 || c.index()[static_cast<std::size_t>(v)] < -3) return false;
  return true;
}

}  // namespace quadrig::test
