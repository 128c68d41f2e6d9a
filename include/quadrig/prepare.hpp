// Input validation and repair: every defect of a raw mesh or its weights is either repaired or rejected with a named
// error. And refinement, for later stages.
#pragma once

#include <array>
#include <span>

#include <Eigen/SparseCore>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// n×b, one row a vertex: the type of SkinWeights (rig.hpp).
using VertexWeights = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

/// Polygons as a file or a modeller provides them, valid or not.
struct PolygonMesh {
  Points<double> positions;         ///< n×3
  std::vector<Index> corners;       ///< the vertices of all polygons, one polygon after another
  std::vector<Index> first_corner;  ///< p + 1 entries: polygon i has corners [first_corner[i], first_corner[i + 1])

  // What some files hold in addition to the surface; else empty.
  std::vector<Index> material;              ///< p, a number for each name
  std::vector<Index> texture;               ///< one a corner: alike where the texture coordinates are; no_index: none
  std::vector<std::array<Index, 2>> lines;  ///< vertices that a line is drawn between

  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(positions.rows()); }
  [[nodiscard]] Index polygon_count() const {
    return first_corner.empty() ? 0 : static_cast<Index>(first_corner.size()) - 1;
  }
  [[nodiscard]] std::span<const Index> polygon(Index i) const {
    const auto first = static_cast<std::size_t>(first_corner[static_cast<std::size_t>(i)]);
    const auto last = static_cast<std::size_t>(first_corner[static_cast<std::size_t>(i) + 1]);
    return std::span<const Index>(corners).subspan(first, last - first);
  }
  void add_polygon(std::span<const Index> polygon) {
    if (first_corner.empty()) first_corner.push_back(0);
    corners.insert(corners.end(), polygon.begin(), polygon.end());
    first_corner.push_back(static_cast<Index>(corners.size()));
  }
  /// The same triangles as polygons. \cost O(m)
  [[nodiscard]] static PolygonMesh from_triangles(Points<double> positions, const Triangles& faces);
  /// The same from other matrices. \fails bad_input where one has not 3 columns
  template <EigenMatrix V, EigenMatrix F>
  requires(RuntimeColumns<V> || RuntimeColumns<F>)
      [[nodiscard]] static Expected<PolygonMesh> from_triangles(const V& positions, const F& faces) {
    Expected<Points<double>> points = with_columns<3>(positions, "positions");
    if (!points) return points.error();
    const Expected<Triangles> triangles = with_columns<3>(faces, "faces");
    if (!triangles) return triangles.error();
    return from_triangles(std::move(*points), *triangles);
  }
};

/// Triangles that cover polygons.
struct Triangulation {
  Triangles faces;                ///< m×3, turning as their polygon
  std::vector<Index> polygon;     ///< m, the polygon each comes from
  Index degenerate_polygons = 0;  ///< fewer than three different corners: left out
};

/// Cuts polygons into triangles: quads along the diagonal that folds neither half over the other, the shorter where
/// both do; larger ones by cutting the ear with the largest least angle first (Meisters 1975), in the plane of
/// Newell's normal, so that concave and slightly bent polygons keep their outline.
/// \fails bad_input on a corner out of range or a position that is not finite, or a polygon of more than
///   `max_corners` corners (the cost of one is up to cubic in its corners): names the polygon.
/// \cost O(total corners) for triangles and quads.
[[nodiscard]] QUADRIG_INLINE Expected<Triangulation> triangulate(const PolygonMesh& polygons, Index max_corners = 1000);

/// Which vertices at one position become one vertex.
enum class Weld : std::uint8_t {
  never,  ///< none: seams stay open
  seams,  ///< those on open edges: seams and triangle soups close, shells that only touch stay apart
  all,    ///< every one
};

struct PrepareOptions {
  bool strict = false;  ///< every repair is an error
  Weld weld = Weld::seams;
  double weld_distance = 0;       ///< positions at most this far apart count as one; units of the mesh
  double flat_ratio = 1e-9;       ///< a face whose height is at most this share of its longest edge has no area
  double weight_tolerance = 0.1;  ///< largest |sum − 1|, and largest excess over [0, 1], that is repaired by rescaling
  bool orient_outward = true;     ///< closed parts are turned outward, cavities inward

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const;
};

/// The defects that were found and repaired: one count a kind.
struct PrepareReport {
  Index input_vertices = 0, input_polygons = 0, polygons_cut = 0;  ///< polygons_cut: polygons of more than 3 corners
  Index doubled_vertices = 0;       ///< used vertices that share their position with an earlier one, welded or not
  Index welded_vertices = 0;        ///< of these, joined with another
  Index contracted_edges = 0;       ///< edges of zero length, contracted
  Index degenerate_faces = 0;       ///< fewer than three different vertices: dropped
  Index repeated_faces = 0;         ///< same three vertices as another face, or half of two others, or a stray flap
  Index flat_faces = 0;             ///< no area: removed by an edge flip, or dropped at an open edge
  Index split_edges = 0;            ///< edges of three or more faces, cut apart
  Index split_vertices = 0;         ///< vertices whose faces formed several fans, doubled
  Index turned_faces = 0;           ///< faces whose orientation was reversed
  Index twisted_edges = 0;          ///< edges cut because no orientation can agree across them (Möbius bands)
  Index unreferenced_vertices = 0;  ///< vertices of no face, dropped
  Index rescaled_weights = 0;       ///< vertices whose weights did not sum to 1 within 1e-6, rescaled
  Index clipped_weights = 0;        ///< weights outside [0, 1], clipped
  Index merged_weights = 0;         ///< welded vertices whose weights differed, averaged
  Index components = 0, closed_components = 0;

  /// One sentence a kind of repair that was made; empty where the input needed none.
  [[nodiscard]] std::vector<std::string> repairs() const;
};

struct Prepared {
  TriangleMesh<double> mesh;
  std::optional<VertexWeights> weights;  ///< one row a vertex of `mesh`, rows sum to 1; where weights were given
  std::vector<Index> source_vertex;      ///< vertex of the input that each vertex stands for
  std::vector<Index> source_polygon;     ///< polygon of the input that each face is part of
  PrepareReport report;
};

/// Checks and repairs a mesh and, where given, its weights (one row a vertex of `input`), so that TriangleMesh's
/// conditions hold, no face is flat and weights are non-negative and sum to 1. Each kind of repair that was made is
/// counted in the report and added to the warnings of `context`.
///
/// Edges of more than two faces are paired around the edge so that the paired faces bound the same solid, else the
/// flattest pair first; vertices are then doubled so that each has one fan. Parts are oriented consistently, closed
/// ones outward unless they are cavities of another part, open ones as most of their area was.
///
/// \fails bad_input on an index out of range, a position or weight that is not finite, weights further from a
///   partition of unity than options.weight_tolerance, no face left, or, where options.strict, on the first kind of
///   repair that would be needed: names the vertex, face or edge. unsupported beyond 2^31 / 3 faces. bad_option.
/// \cost O(m log m) time.
[[nodiscard]] QUADRIG_INLINE Expected<Prepared> prepare(const PolygonMesh& input, const VertexWeights* weights,
                                                        const PrepareOptions& options, Context& context);

/// A finer triangulation of exactly the same surface.
struct Refinement {
  TriangleMesh<double> mesh;         ///< its first vertices are those of the source, in order
  std::vector<SurfacePoint> source;  ///< n, each vertex on the source surface
  std::vector<Index> source_face;    ///< m, the source face that each face is part of
};

struct RefineOptions {
  /// Upper bound of faces in the result; refused before memory is taken beyond it.
  Index max_faces = 50'000'000;

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const {
    if (max_faces >= 1) return {};
    return Error{ErrorCode::bad_option, "max_faces is out of range", "RefineOptions", "give 1 or more"};
  }
};

/// Bisects edges until none is longer than its target: `target_length(face)` of either source face beside it, in the
/// units of the mesh, > 0. Faces are cut from the midpoint of their longest edge (Rivara's 4-triangle pattern), so
/// angles stay bounded by those of the source; neighbours follow, so the mesh stays conforming.
/// \fails bad_option on a target that is not positive; unsupported beyond options.max_faces; cancelled.
/// \cost O(k) for k faces of the result, times the number of halvings.
[[nodiscard]] QUADRIG_INLINE Expected<Refinement> refine(const TriangleMesh<double>& mesh,
                                                         function_ref<double(Index face)> target_length,
                                                         const RefineOptions& options, Context& context);

/// Rows of a per-vertex matrix carried to points of the surface: one row a point, barycentric, exact for rows that are
/// linear on the source faces. \cost O(points · entries a row)
[[nodiscard]] QUADRIG_INLINE VertexWeights interpolate(const TriangleMesh<double>& mesh, const VertexWeights& rows,
                                                       std::span<const SurfacePoint> points);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/prepare/prepare.ipp"
#include "quadrig/prepare/refine.ipp"
#include "quadrig/prepare/repair.ipp"
#include "quadrig/prepare/triangulate.ipp"
#endif
