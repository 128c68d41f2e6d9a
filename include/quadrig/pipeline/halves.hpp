// Components that a mirror plane takes to themselves are remeshed by half: cut along the plane, and their quads
// mirrored. Components that it takes to each other get the same quads.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/polish.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/symmetry/map.hpp"

namespace quadrig::detail {

/// What a plane does to a component.
enum class MirrorRole : std::uint8_t {
  whole,   ///< nothing: it is remeshed as it is
  halved,  ///< takes it to itself
  first,   ///< takes it to another one
  second,  ///< takes that one to it
};

struct MirrorPart {
  MirrorRole role = MirrorRole::whole;
  Index other = no_index;                   ///< of `first` and `second`: the other's number
  std::optional<Piece> half;                ///< of `halved`
  std::optional<SurfaceTopology> topology;  ///< of the whole component
};

/// A surface of some of an asset's faces, for closest points.
class PartSurface {
 public:
  PartSurface(const Asset& asset, std::span<const Index> faces) : asset_(asset), faces_(faces) {
    Triangles own(static_cast<Eigen::Index>(faces.size()), 3);
    for (std::size_t f = 0; f < faces.size(); ++f)
      own.row(static_cast<Eigen::Index>(f)) = asset.mesh.faces().row(faces[f]);
    closest_ = ClosestPoint(asset.mesh.positions(), own);
  }
  /// The nearest point to the mirror image of a point of the asset's surface, facing as the image does where any does.
  [[nodiscard]] SurfaceHit image(const MirrorMap& map, const SurfacePoint& point) const {
    ClosestFilter filter;
    filter.minimum_cosine = 0.3;
    const Vector3 p = map(asset_, point, &filter.normal);
    SurfaceHit hit = closest_.closest(p, filter);
    if (!hit.found()) hit = closest_.closest(p);
    hit.face = faces_[at(hit.face)];
    return hit;
  }

 private:
  const Asset& asset_;
  std::span<const Index> faces_;
  ClosestPoint closest_;
};

/// The side of each vertex; 0 on the plane, or so near to it that a cut beside it would leave a needle.
[[nodiscard]] inline std::vector<double> sides_of(const Asset& asset, const MirrorMap& map) {
  constexpr double needle = 0.1;  // of an edge
  const TriangleMesh<double>& mesh = asset.mesh;
  std::vector<double> side(at(mesh.vertex_count()));
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    side[at(v)] = map.side(mesh.position(v), asset.rig ? &asset.rig->weights : nullptr, v);
    if (std::abs(side[at(v)]) < 1e-3 * map.plane().tolerance) side[at(v)] = 0;
  }
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    double &a = side[at(mesh.origin(h))], &b = side[at(mesh.target(h))];
    if (!(a * b < 0)) continue;
    const double whole = std::abs(a) + std::abs(b);
    if (std::abs(a) < needle * whole)
      a = 0;
    else if (std::abs(b) < needle * whole)
      b = 0;
  }
  return side;
}

/// The faces of a piece that are flagged, as a piece of their own. Nothing where they are no manifold.
[[nodiscard]] inline std::optional<Piece> part_of(const Piece& piece, const std::vector<char>& flagged) {
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  std::vector<Index> faces;
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (flagged[at(f)]) faces.push_back(f);
  FacePatch patch = *face_patch(mesh, faces, Context{});
  const std::vector<Index>& vertices = patch.vertices;
  Expected<TriangleMesh<double>> made =
      TriangleMesh<double>::create(std::move(patch.positions), std::move(patch.triangles));
  if (!made) return std::nullopt;
  Piece part;
  part.asset.mesh = std::move(*made);
  for (const Index f : faces) part.parent.push_back(piece.parent[at(f)]);
  if (!piece.kept.empty())
    for (const Index f : faces)
      for (const Index h : mesh.halfedges_of(f)) part.kept.push_back(piece.kept[at(h)]);
  if (piece.asset.rig) {
    std::vector<SurfacePoint> points;
    for (const Index v : vertices) {
      const Index h = mesh.outgoing(v);
      points.push_back({h / 3, Vector3::Unit(h % 3)});
    }
    part.asset.rig = Rig{piece.asset.rig->skeleton, interpolate(mesh, piece.asset.rig->weights, points), {}};
  }
  // The border that the piece has not is the cut.
  part.mirror.assign(at(part.asset.mesh.halfedge_count()), 0);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (Index i = 0; i < 3; ++i) {
      const Index h = 3 * static_cast<Index>(f) + i;
      part.mirror[at(h)] = part.asset.mesh.twin(h) == no_index && mesh.twin(3 * faces[f] + i) != no_index;
    }
  return part;
}

/// The half of a component that lies on the plane's side, with the cut as its border `mirror`. Nothing where the plane
/// does not cut it into two connected halves.
[[nodiscard]] inline std::optional<Piece> half_of(Piece piece, const MirrorMap& map) {
  std::vector<double> side = sides_of(piece.asset, map);
  std::vector<char> cut(at(piece.asset.mesh.halfedge_count()), 0);
  bool any = false;
  const auto crosses = [&](Index h) {
    return side[at(piece.asset.mesh.origin(h))] * side[at(piece.asset.mesh.target(h))] < 0;
  };
  for (Index h = 0; h < piece.asset.mesh.halfedge_count(); ++h)
    if (crosses(h)) cut[at(h)] = 1, any = true;
  if (any)
    replace_mesh(piece, split_edges(piece.asset.mesh, cut, [&](Index h) {
                   const double a = side[at(piece.asset.mesh.origin(h))], b = side[at(piece.asset.mesh.target(h))];
                   return a / (a - b);
                 }));
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  side.resize(at(mesh.vertex_count()), 0.0);
  std::vector<char> here(at(mesh.face_count()), 0);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    double sum = 0;
    for (int i = 0; i < 3; ++i) sum += side[at(mesh.faces()(f, i))];
    if (sum == 0) sum = map.plane().side(position(mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)}));
    here[at(f)] = sum > 0;
  }
  // What a cut that grazes the surface leaves beside the half is dropped.
  std::vector<Index> of_face(here.size(), no_index), open;
  std::vector<double> area;
  for (Index seed = 0; seed < mesh.face_count(); ++seed) {
    if (!here[at(seed)] || of_face[at(seed)] != no_index) continue;
    const auto number = static_cast<Index>(area.size());
    area.push_back(0);
    of_face[at(seed)] = number;
    open.assign(1, seed);
    while (!open.empty()) {
      const Index f = open.back();
      open.pop_back();
      area.back() += mesh.area(f);
      for (const Index h : mesh.halfedges_of(f))
        if (const Index g = mesh.twin(h); g != no_index && here[at(g / 3)] && of_face[at(g / 3)] == no_index) {
          of_face[at(g / 3)] = number;
          open.push_back(g / 3);
        }
    }
  }
  if (area.empty()) return std::nullopt;
  const auto largest = std::ranges::max_element(area);
  constexpr double most_of = 0.97, least_share = 0.25;
  double all = 0;
  for (const double a : area) all += a;
  if (*largest < most_of * all || *largest < least_share * mesh.total_area() ||
      *largest > (1 - least_share) * mesh.total_area())
    return std::nullopt;
  for (std::size_t f = 0; f < here.size(); ++f) here[f] = of_face[f] == largest - area.begin();
  std::optional<Piece> half = part_of(piece, here);
  if (half && std::ranges::none_of(half->mirror, [](char c) { return c != 0; })) return std::nullopt;
  return half;
}

/// Vertices of quads of a half that lie on its cut.
[[nodiscard]] inline std::vector<char> on_cut(const TriangleMesh<double>& surface, const EdgeMarks& mirror,
                                              const QuadMesh& quads) {
  constexpr double near = 1e-6;
  const EdgeCurves curves(surface, mirror);
  std::vector<char> on(at(quads.vertex_count()), 0);
  for (Index v = 0; v < quads.vertex_count(); ++v) on[at(v)] = curves.under(quads.source[at(v)], near) != no_index;
  return on;
}

/// Quads and their mirror images, which share the vertices on the cut. Images follow, in the same order.
struct MirroredQuads {
  Quads quads;
  std::vector<Index> twin;  ///< of each vertex; itself on the cut
  Index own = 0;            ///< vertices of the half
};
[[nodiscard]] inline MirroredQuads mirrored_quads(const Quads& half, const std::vector<char>& on) {
  MirroredQuads all;
  all.own = static_cast<Index>(on.size());
  for (Index v = 0; v < all.own; ++v) all.twin.push_back(v);
  for (Index v = 0; v < all.own; ++v) {
    if (on[at(v)]) continue;
    all.twin[at(v)] = static_cast<Index>(all.twin.size());
    all.twin.push_back(v);
  }
  const Eigen::Index m = half.rows();
  all.quads.resize(2 * m, 4);
  all.quads.topRows(m) = half;
  for (Eigen::Index q = 0; q < m; ++q)
    for (int i = 0; i < 4; ++i) all.quads(m + q, i) = all.twin[at(half(q, (4 - i) % 4))];
  return all;
}

/// Why quads and their mirror images are no mesh like the whole component; empty where they are.
[[nodiscard]] inline std::string mirror_defect(const MirroredQuads& all, const SurfaceTopology& whole) {
  const auto vertices = static_cast<Index>(all.twin.size());
  if (std::string defect = unlike(quad_topology(all.quads, vertices), whole); !defect.empty()) return defect;
  std::vector<Index> corners(all.twin.size(), 0), border(all.twin.size(), 0);
  for (Index q = 0; q < static_cast<Index>(all.quads.rows()); ++q)
    for (int i = 0; i < 4; ++i) ++corners[at(all.quads(q, i))];
  const std::vector<SortedSide> sides = sorted_by_edge(vertices, all.quads);
  for_each_edge(std::span(sides), [&](std::span<const SortedSide> edge) {
    if (edge.size() == 1) border[at(edge[0].low)] = border[at(edge[0].high)] = 1;
  });
  for (std::size_t v = 0; v < corners.size(); ++v)
    if (corners[v] < 3 && !border[v]) return "two quads around a vertex on the plane";
  return {};
}

/// How well a plane takes a component to another, or to itself: the share of its area whose image lies near.
[[nodiscard]] inline double near_share(const TriangleMesh<double>& mesh, std::span<const Index> from,
                                       const PartSurface& to, const MirrorMap& map, double near) {
  constexpr std::size_t probes = 300;
  const std::size_t step = std::max<std::size_t>(1, from.size() / probes);
  double found = 0, all = 0;
  for (std::size_t k = 0; k < from.size(); k += step) {
    const SurfacePoint centre{from[k], Vector3::Constant(1.0 / 3)};
    all += mesh.area(from[k]);
    if (to.image(map, centre).squared_distance <= near * near) found += mesh.area(from[k]);
  }
  return all > 0 ? found / all : 0;
}

/// Which components the plane takes to themselves, and which to each other; none has its half yet.
/// \cost a closest point a sample
[[nodiscard]] inline std::vector<MirrorPart> mirror_roles(const Asset& asset,
                                                          const std::vector<std::vector<Index>>& faces,
                                                          const MirrorMap& map, const Context& context) {
  constexpr double alike = 0.8, of_size = 0.1, of_largest = 0.5;
  const TriangleMesh<double>& mesh = asset.mesh;
  const MirrorPlane& plane = map.plane();
  struct Facts {
    double area = 0, low = std::numeric_limits<double>::infinity(), high = -low;
    Vector3 centre = Vector3::Zero();
    [[nodiscard]] double near(const MirrorPlane& p) const {
      return std::min(20 * p.tolerance, of_size * std::sqrt(area));
    }
  };
  std::vector<Facts> facts(faces.size());
  for (std::size_t c = 0; c < faces.size(); ++c) {
    for (const Index f : faces[c]) {
      facts[c].area += mesh.area(f);
      facts[c].centre += mesh.area(f) * position(mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)});
      for (int i = 0; i < 3; ++i) {
        const double side = plane.side(mesh.position(mesh.faces()(f, i)));
        facts[c].low = std::min(facts[c].low, side);
        facts[c].high = std::max(facts[c].high, side);
      }
    }
    if (facts[c].area > 0) facts[c].centre /= facts[c].area;
  }
  const auto largest = std::ranges::max_element(facts, {}, &Facts::area);
  std::vector<MirrorPart> parts(faces.size());
  for (std::size_t c = 0; c < faces.size() && !context.cancelled(); ++c) {
    constexpr std::size_t least_faces = 8;
    if (parts[c].role != MirrorRole::whole || faces[c].size() < least_faces) continue;
    const Facts& own = facts[c];
    const double near = own.near(plane);
    const PartSurface surface(asset, faces[c]);
    // The largest is what the plane was found for: where it is lopsided its image lies farther off.
    const bool main = &own == &*largest;
    if (own.low < -plane.tolerance && own.high > plane.tolerance &&
        near_share(mesh, faces[c], surface, map, main ? 2 * near : near) >= (main ? of_largest : alike)) {
      parts[c].role = MirrorRole::halved;
      continue;
    }
    std::size_t best = faces.size();
    double least = std::max(near, of_size / 2 * std::sqrt(own.area));
    for (std::size_t d = c + 1; d < faces.size(); ++d) {
      if (parts[d].role != MirrorRole::whole || std::abs(facts[d].area - own.area) > of_size * own.area) continue;
      const double apart = (plane.mirrored(own.centre) - facts[d].centre).norm();
      if (apart < least) least = apart, best = d;
    }
    if (best == faces.size()) continue;
    const PartSurface other(asset, faces[best]);
    if (near_share(mesh, faces[c], other, map, near) < alike ||
        near_share(mesh, faces[best], surface, map, near) < alike)
      continue;
    parts[c].role = MirrorRole::first;
    parts[best].role = MirrorRole::second;
    parts[c].other = static_cast<Index>(best);
    parts[best].other = static_cast<Index>(c);
  }
  return parts;
}

/// The same with halves; what cannot be cut in two stays whole.
[[nodiscard]] inline std::vector<MirrorPart> mirror_parts(const Asset& asset,
                                                          const std::vector<std::vector<Index>>& faces,
                                                          const EdgeMarks& kept, const MirrorMap& map,
                                                          const Context& context) {
  std::vector<MirrorPart> parts = mirror_roles(asset, faces, map, context);
  for (std::size_t c = 0; c < faces.size() && !context.cancelled(); ++c) {
    if (parts[c].role != MirrorRole::halved) continue;
    Piece piece = make_piece(asset, faces[c], context);
    if (context.cancelled()) return parts;
    piece.kept = marks_of(kept, faces[c]);
    parts[c].topology.emplace(piece.asset.mesh);
    parts[c].half = half_of(std::move(piece), map);
    if (!parts[c].half) parts[c].role = MirrorRole::whole;
  }
  return parts;
}

/// Where the images of vertices lie: on the surface of the other side.
inline void place_images(const TriangleMesh<double>& mesh, const PartSurface& surface, const MirrorMap& map,
                         std::span<const Index> of, Index first, QuadMesh& quads) {
  for (std::size_t k = 0; k < of.size(); ++k) {
    const SurfaceHit hit = surface.image(map, quads.source[at(of[k])]);
    const auto v = first + static_cast<Index>(k);
    quads.source[at(v)] = hit;
    quads.positions.row(v) = position(mesh, hit).transpose();
  }
}

[[nodiscard]] inline double least_jacobian(const QuadMesh& quads) {
  double least = 1;
  for (Index q = 0; q < quads.quad_count(); ++q)
    least = std::min(least, scaled_jacobian(quads.positions, quads.quads.row(q)));
  return least;
}
[[nodiscard]] inline double average_jacobian(const QuadMesh& quads) {
  double average = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    average += scaled_jacobian(quads.positions, quads.quads.row(q)) / quads.quad_count();
  return average;
}

/// Even quads on the other side too, where that is not like this one.
inline void even_out(const TriangleMesh<double>& mesh, const EdgeMarks& kept, const PolishOptions& options,
                     double wanted, QuadMesh& quads, Context& context) {
  if (least_jacobian(quads) >= wanted) return;
  quads = polish(mesh, options, std::move(quads), context, kept).mesh;
}

}  // namespace quadrig::detail
