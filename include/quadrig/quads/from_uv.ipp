#pragma once

#include <cstdio>

#include "quadrig/quads/from_uv.hpp"

namespace quadrig {

QUADRIG_INLINE Status UvQuadsOptions::validate(const TriangleMesh<double>& mesh) const {
  if (Status status = uv.validate(mesh); !status.ok()) return status;
  IntegerOptions integers;
  if (quads != 0) integers.quads = quads;
  integers.tolerance = tolerance;
  return integers.validate();
}

namespace detail {

/// Rounds what has to be whole of a map, and names the first that is not.
class GridRounder {
 public:
  GridRounder(const TriangleMesh<double>& mesh, const SeamlessMap& map, double tolerance)
      : mesh_(mesh), map_(map), tolerance_(tolerance) {}

  template <class K>
  [[nodiscard]] Expected<GridMap> run(const MapUnknowns<K>& unknowns) const {
    IntegerSolution<K> whole;
    whole.branch.resize(at(map_.cut.branch_count));
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      const Index b = map_.cut.branch[at(h)];
      if (b == no_index || !map_.cut.forward[at(h)]) continue;
      const Complex t = map_.z[at(mesh_.next(mesh_.twin(h)))] - rotated(map_.z[at(h)], map_.cut.rotation[at(h)]);
      whole.branch[at(b)] = rounded(t);
      if (!near(t, {true, true}))
        return not_whole("the map shifts by " + text(t) + " across it",
                         "edge " + std::to_string(mesh_.origin(h)) + " - " + std::to_string(mesh_.target(h)));
    }
    using Kind = typename MapUnknowns<K>::Kind;
    constexpr int components = MapUnknowns<K>::components;
    whole.set.assign(at(mesh_.vertex_count()), {false, false});
    whole.vertex.assign(at(mesh_.vertex_count()), Gaussian{});
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      const Index start = mesh_.outgoing(v);
      if (start == no_index) continue;
      for (int c = 0; c < 2; ++c)
        whole.set[at(v)][static_cast<std::size_t>(c)] =
            unknowns.elimination().kind(components * v + (components == 2 ? c : 0)) == Kind::integer;
      if (!whole.set[at(v)][0] && !whole.set[at(v)][1]) continue;
      Gaussian shift;
      for (const auto& term : map_.cut.corner_translation[at(start)])
        shift += term.coefficient * whole.branch[at(term.variable)];
      const Complex own = rotated(map_.z[at(start)] - to_field(shift), -map_.cut.corner_rotation[at(start)]);
      whole.vertex[at(v)] = rounded(own);
      if (!near(own, whole.set[at(v)]))
        return not_whole((map_.index4[at(v)] != 0 ? "a cone lies at " : "a grid line runs at ") + text(own),
                         "vertex " + std::to_string(v));
    }
    Expected<GridMap> grid = fixed_point_map<K>(mesh_, map_.cut, whole, map_.z);
    if (grid && !grid_map_exact(*grid)) return not_whole("the whole numbers contradict each other", "map");
    return grid;
  }

 private:
  [[nodiscard]] static Gaussian rounded(Complex z) { return {std::llround(z.real()), std::llround(z.imag())}; }
  [[nodiscard]] bool near(Complex z, const std::array<bool, 2>& which) const {
    const Complex off = z - to_field(rounded(z));
    return (!which[0] || std::abs(off.real()) <= tolerance_) && (!which[1] || std::abs(off.imag()) <= tolerance_);
  }
  [[nodiscard]] static std::string text(Complex z) {
    const auto thousandths = [](double x) {
      const auto whole = static_cast<long long>(std::llround(1000 * x));
      const std::string digits = std::to_string(1000 + std::abs(whole) % 1000).substr(1);
      return (whole < 0 ? "-" : "") + std::to_string(std::abs(whole) / 1000) + "." + digits;
    };
    return "(" + thousandths(z.real()) + ", " + thousandths(z.imag()) + ")";
  }
  [[nodiscard]] static Error not_whole(std::string what, std::string where) {
    return {ErrorCode::bad_input, std::move(what) + ", not at whole numbers", "integer grid, " + std::move(where),
            "round the map, or ask for a count so that integers are found for it"};
  }

  const TriangleMesh<double>& mesh_;
  const SeamlessMap& map_;
  double tolerance_;
};

}  // namespace detail

QUADRIG_INLINE Expected<GridMap> whole_grid(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                            double tolerance) {
  const detail::GridRounder rounder(mesh, map, tolerance);
  return std::visit([&](const auto& unknowns) { return rounder.run(unknowns); }, map.unknowns);
}

QUADRIG_INLINE Expected<UvQuads> quads_from_uv(const TriangleMesh<double>& mesh, const CornerUv& uv,
                                               const UvQuadsOptions& options, Context& context) {
  if (Status status = options.validate(mesh); !status.ok()) return status.error();
  if (const Index parts = face_components(mesh).count; parts != 1)
    return Error{ErrorCode::bad_input, "the mesh is in " + std::to_string(parts) + " parts", "mesh",
                 "give one connected surface at a time"};
  const Expected<SeamlessMap> map = seamless_from_uv(mesh, uv, options.uv, context);
  if (!map) return map.error();
  const double area = map_area(map->z);
  if (!(options.quads > 0))
    if (const Expected<GridMap> grid = whole_grid(mesh, *map)) {
      Expected<ExtractedQuads> quads = extract_fine(mesh, *grid, area, context);
      if (!quads) return quads.error();
      return UvQuads{quad_mesh(mesh, std::move(*quads)), true};
    }
  IntegerOptions integers;
  integers.quads = options.quads > 0 ? options.quads : std::max(1.0, area);
  integers.tolerance = options.tolerance;
  integers.solver = options.uv.solver;
  const Expected<IntegerMap> whole = integer_map(mesh, *map, integers, context);
  if (!whole) return whole.error();
  Expected<ExtractedQuads> quads = extract(mesh, *map, *whole, context);
  if (!quads) return quads.error();
  return UvQuads{quad_mesh(mesh, std::move(*quads)), false};
}

QUADRIG_INLINE Expected<UvQuads> quads_from_uv(const Eigen::MatrixXd& vertices, const Eigen::MatrixXi& faces,
                                               const Eigen::MatrixXd& uv, const Eigen::MatrixXi& face_uv,
                                               const UvQuadsOptions& options, Context& context) {
  if (vertices.cols() != 3 || faces.cols() != 3)
    return Error{
        ErrorCode::bad_input,
        std::to_string(vertices.cols()) + " columns of vertices, " + std::to_string(faces.cols()) + " of faces", "mesh",
        "give three each"};
  if (face_uv.rows() != faces.rows())
    return Error{ErrorCode::bad_input,
                 std::to_string(face_uv.rows()) + " faces for " + std::to_string(faces.rows()) + " triangles",
                 "texture coordinates", "give the corners of every triangle"};
  Expected<TriangleMesh<double>> mesh = TriangleMesh<double>::create(vertices, faces);
  if (!mesh) return mesh.error();
  const Expected<CornerUv> corners = corner_uv(uv, face_uv);
  if (!corners) return corners.error();
  return quads_from_uv(*mesh, *corners, options, context);
}

}  // namespace quadrig
