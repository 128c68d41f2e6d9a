#pragma once

#include "quadrig/seamless/from_uv.hpp"

namespace quadrig {

QUADRIG_INLINE Expected<CornerUv> corner_uv(const Eigen::MatrixXd& uv, const Eigen::MatrixXi& faces) {
  if (uv.cols() != 2 || faces.cols() != 3)
    return Error{ErrorCode::bad_input,
                 std::to_string(uv.cols()) + " columns of coordinates, " + std::to_string(faces.cols()) + " of corners",
                 "texture coordinates", "give two and three"};
  CornerUv corners(3 * faces.rows(), 2);
  for (Eigen::Index f = 0; f < faces.rows(); ++f)
    for (int i = 0; i < 3; ++i) {
      const Index k = faces(f, i);
      if (k < 0 || k >= uv.rows())
        return Error{ErrorCode::bad_input, "coordinate " + std::to_string(k) + " of " + std::to_string(uv.rows()),
                     "texture coordinates, face " + std::to_string(f), "number them from 0"};
      corners.row(3 * f + i) = uv.row(k);
    }
  return corners;
}

QUADRIG_INLINE Status UvOptions::validate(const TriangleMesh<double>& mesh) const {
  if (!(tolerance > 0 && tolerance < 0.1))
    return Error{ErrorCode::bad_option, "out of range", "uv.tolerance", "give a fraction in (0, 0.1)"};
  if (!kept.empty() && kept.size() != detail::at(mesh.halfedge_count()))
    return Error{ErrorCode::bad_option, "not one mark a half-edge", "uv.kept", "give three marks a face, or none"};
  return {};
}

namespace detail {

/// Derives from a parametrization what a field would give: transitions, cones and grid lines.
class UvReader {
 public:
  UvReader(const TriangleMesh<double>& mesh, const CornerUv& uv, const UvOptions& options)
      : mesh_(mesh), options_(options) {
    for (Eigen::Index h = 0; h < uv.rows(); ++h) z_.emplace_back(uv(h, 0), uv(h, 1));
  }

  [[nodiscard]] Status run() {
    if (z_.size() != at(mesh_.halfedge_count()))
      return bad(std::to_string(z_.size()) + " rows for " + std::to_string(mesh_.face_count()) + " triangles",
                 "texture coordinates", "give one row a corner, three a face");
    if (Status status = check_faces(); !status.ok()) return status;
    if (Status status = find_transitions(); !status.ok()) return status;
    if (Status status = find_cones(); !status.ok()) return status;
    return find_grid_lines();
  }

  [[nodiscard]] const std::vector<std::int8_t>& rotation() const { return rotation_; }
  [[nodiscard]] const std::vector<Index>& index4() const { return index4_; }
  /// Wanted edge vectors in the combed charts.
  [[nodiscard]] TargetEdges target(const CutGraph& cut) const {
    TargetEdges result(z_.size());
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      result[at(h)] = rotated(edge(h), -cut.combing[at(TriangleMesh<double>::face_of(h))]);
    return result;
  }
  [[nodiscard]] std::vector<Aligned> aligned(const CutGraph& cut) const {
    std::vector<Aligned> result = aligned_;
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      if (result[at(h)] != Aligned::none && (cut.combing[at(TriangleMesh<double>::face_of(h))] & 1))
        result[at(h)] = result[at(h)] == Aligned::v_constant ? Aligned::u_constant : Aligned::v_constant;
    return result;
  }

 private:
  [[nodiscard]] static Error bad(std::string what, std::string where, std::string remedy) {
    return {ErrorCode::bad_input, std::move(what), std::move(where), std::move(remedy)};
  }
  [[nodiscard]] Complex edge(Index h) const { return z_[at(mesh_.next(h))] - z_[at(h)]; }
  [[nodiscard]] std::string place(Index h) const {
    return "texture coordinates, face " + std::to_string(TriangleMesh<double>::face_of(h)) + ", edge " +
           std::to_string(mesh_.origin(h)) + " - " + std::to_string(mesh_.target(h));
  }

  [[nodiscard]] Status check_faces() {
    Index flipped = 0, first = no_index;
    for (Index f = 0; f < mesh_.face_count(); ++f) {
      const Complex a = edge(3 * f), b = edge(3 * f + 1);
      if (!std::isfinite(a.real() + a.imag() + b.real() + b.imag()))
        return bad("not finite", "texture coordinates, face " + std::to_string(f), "give numbers");
      if (cross(a, b) > 1e-12 * std::max({std::norm(a), std::norm(b), std::norm(a + b)})) continue;
      if (flipped++ == 0) first = f;
    }
    if (flipped == 0) return {};
    return bad(
        std::to_string(flipped) + " of " + std::to_string(mesh_.face_count()) +
            " triangles are flipped or have no area",
        "texture coordinates, face " + std::to_string(first),
        flipped == mesh_.face_count() ? "negate one coordinate: the map is mirrored" : "make the map without flips");
  }

  /// Quarter turns from each face to the next.
  [[nodiscard]] Status find_transitions() {
    rotation_.assign(z_.size(), 0);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      const Index g = mesh_.twin(h);
      if (g == no_index || g < h) continue;
      const Complex here = edge(h), there = -edge(g);
      const double turns = elementary::arg(there / here) / (std::numbers::pi / 2);
      const int quarter = static_cast<int>(std::lround(turns));
      if (!(std::abs(there - rotated(here, quarter)) <= options_.tolerance * std::abs(here)))
        return bad("the map turns by " + std::to_string(std::lround(turns * 90)) + "° and changes lengths by " +
                       std::to_string(std::lround(100 * (std::abs(there) / std::abs(here) - 1))) +
                       " % across it: no quarter turn and translation",
                   place(h), "make the map seamless, or raise the tolerance");
      rotation_[at(h)] = static_cast<std::int8_t>(quarter & 3);
      rotation_[at(g)] = static_cast<std::int8_t>(-quarter & 3);
    }
    return {};
  }

  [[nodiscard]] Status find_cones() {
    std::vector<double> angle(at(mesh_.vertex_count()), 0.0);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      angle[at(mesh_.origin(h))] += elementary::arg(-edge(mesh_.prev(h)) / edge(h));
    index4_.assign(angle.size(), 0);
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      if (mesh_.outgoing(v) == no_index) continue;
      const double quarters = angle[at(v)] / (std::numbers::pi / 2);
      const auto whole = static_cast<Index>(std::lround(quarters));
      if (whole < 1)
        return bad("the triangles around it take an angle of " + std::to_string(std::lround(quarters * 90)) + "°",
                   "texture coordinates, vertex " + std::to_string(v), "give every vertex at least a quarter turn");
      index4_[at(v)] = (mesh_.on_boundary(v) ? 2 : 4) - whole;
    }
    return {};
  }

  [[nodiscard]] Status find_grid_lines() {
    aligned_.assign(z_.size(), Aligned::none);
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      const bool border = mesh_.twin(h) == no_index;
      if (!border && (options_.kept.empty() || !options_.kept[at(h)])) continue;
      const Complex e = edge(h);
      const double off = std::min(std::abs(e.real()), std::abs(e.imag()));
      if (!(off <= options_.tolerance * std::abs(e)))
        return bad(std::string(border ? "a border edge" : "a kept edge") + " is " +
                       std::to_string(std::lround(elementary::asin(off / std::abs(e)) * 180 / std::numbers::pi)) +
                       "° off the grid",
                   place(h), "make one coordinate constant along it");
      aligned_[at(h)] = std::abs(e.real()) >= std::abs(e.imag()) ? Aligned::v_constant : Aligned::u_constant;
    }
    return {};
  }

  const TriangleMesh<double>& mesh_;
  const UvOptions& options_;
  std::vector<Complex> z_;
  std::vector<std::int8_t> rotation_;
  std::vector<Index> index4_;
  std::vector<Aligned> aligned_;
};

}  // namespace detail

QUADRIG_INLINE Expected<SeamlessMap> seamless_from_uv(const TriangleMesh<double>& mesh, const CornerUv& uv,
                                                      const UvOptions& options, Context& context) {
  if (Status status = options.validate(mesh); !status.ok()) return status.error();
  detail::UvReader reader(mesh, uv, options);
  if (Status status = reader.run(); !status.ok()) return status.error();
  if (context.cancelled()) return cancelled_error("seamless map");
  CutGraph cut = make_cut_graph(mesh, reader.rotation(), reader.index4(), &context);
  if (context.cancelled()) return cancelled_error("seamless map");
  std::vector<Aligned> aligned = reader.aligned(cut);
  TargetEdges target = reader.target(cut);

  // The nearest map that is seamless to the last bit.
  const auto projected = [&]<class K>(std::type_identity<K>) -> Expected<SeamlessMap> {
    Expected<MapUnknowns<K>> unknowns = MapUnknowns<K>::create(mesh, cut, reader.index4(), aligned, &context);
    if (!unknowns) return unknowns.error();
    PoissonOptions poisson;
    poisson.solver = options.solver;
    Expected<PoissonMap<K>> solved = solve_poisson<K>(mesh, *unknowns, reader.index4(), target, poisson, context);
    if (!solved) return solved.error();
    SeamlessReport report;
    report.map_backend = solved->report.backend;
    report.defects = std::move(solved->report.defects);
    return SeamlessMap{std::move(cut),       reader.index4(),      std::move(aligned), std::move(target),
                       std::move(solved->z), std::move(*unknowns), std::move(report)};
  };
  const bool pinned = std::any_of(aligned.begin(), aligned.end(), [](Aligned a) { return a != Aligned::none; });
  Expected<SeamlessMap> map =
      pinned ? projected(std::type_identity<double>{}) : projected(std::type_identity<Complex>{});
  if (!map || map->valid()) return map;
  const MapDefects& defects = map->report.defects;
  return Error{
      ErrorCode::stage_failed, detail::defects_text(defects) + " in the nearest map that is exactly seamless",
      "texture coordinates, " + (defects.flips > 0 ? "face " + std::to_string(defects.flipped_faces.front())
                                                   : "vertex " + std::to_string(defects.wrong_vertices.front())),
      "give coordinates with more digits, or a lower tolerance to find where they disagree"};
}

}  // namespace quadrig
