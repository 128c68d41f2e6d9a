// Edges that quads must keep: creases, the caller's edges, and borders of vertex groups.
#pragma once

#include <map>

#include "quadrig/constraints/features.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/piece.hpp"

namespace quadrig::detail {

/// Whether the caller named edges to keep, or an angle.
[[nodiscard]] inline bool asks_for_features(const RemeshOptions& options) {
  return options.crease_angle_radians || !options.features.empty() || options.group_borders;
}

/// A surface is made of flat sides where its edges are sharp or hardly bend: of the length of those that bend visibly
/// at least `share` bends by more than `crease`. Solids and parts of machines have 0.8 to 1, animals and people,
/// however coarse, up to 0.6.
struct FlatSides {
  static constexpr double visible_radians = 15 * std::numbers::pi / 180, crease_radians = 40 * std::numbers::pi / 180;
  static constexpr double share = 0.8;
};

/// A flag a component. \cost O(m)
[[nodiscard]] inline std::vector<char> made_of_flats(const TriangleMesh<double>& mesh, const Components& components) {
  std::vector<double> visible(at(components.count), 0.0), sharp = visible;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const double bend = dihedral_angle(mesh, h);
    if (!(bend > FlatSides::visible_radians)) continue;
    const std::size_t c = at(components.of_face[at(h / 3)]);
    const double length = mesh.edge_vector(h).norm();
    visible[c] += length;
    if (bend > FlatSides::crease_radians) sharp[c] += length;
  }
  std::vector<char> flats;
  for (std::size_t c = 0; c < visible.size(); ++c) flats.push_back(sharp[c] > FlatSides::share * visible[c]);
  return flats;
}

/// Of connected half-edges those sets of which at least half the length is sharp: creases that fade out, but no facets.
inline void keep_mostly_sharp(const TriangleMesh<double>& mesh, std::vector<Index>& halfedges) {
  DisjointSets connected(at(mesh.vertex_count()));
  for (const Index h : halfedges) connected.join(mesh.origin(h), mesh.target(h));
  std::vector<double> surplus(connected.size(), 0.0);  // of sharp length over the rest
  const auto of = [&](Index h) -> double& { return surplus[at(connected.find(mesh.origin(h)))]; };
  for (const Index h : halfedges)
    of(h) += (dihedral_angle(mesh, h) > FlatSides::crease_radians ? 1 : -1) * mesh.edge_vector(h).norm();
  std::erase_if(halfedges, [&](Index h) { return of(h) < 0; });
}

/// Creases and the caller's edges as marks of the asset's mesh; empty where there are none.
[[nodiscard]] inline EdgeMarks kept_edges(const Asset& asset, const RemeshOptions& options) {
  const TriangleMesh<double>& mesh = asset.mesh;
  std::vector<Index> halfedges = options.features;
  const bool automatic = !options.crease_angle_radians;
  const double crease =
      automatic ? asset.rig ? std::numbers::pi : FlatSides::visible_radians : *options.crease_angle_radians;
  if (crease < std::numbers::pi) {
    // A noisy scan bends sharply at many single edges; a crease runs on.
    const Components components = face_components(mesh);
    const std::vector<char> flats = automatic ? made_of_flats(mesh, components) : std::vector<char>{};
    std::vector<double> least(at(components.count), 0.0);
    for (Index f = 0; f < mesh.face_count(); ++f) least[at(components.of_face[at(f)])] += mesh.area(f);
    for (std::size_t c = 0; c < least.size(); ++c)
      least[c] = automatic && !flats[c] ? std::numeric_limits<double>::infinity() : 0.5 * std::sqrt(least[c]);
    const auto least_at = [&](Index f) { return least[at(components.of_face[at(f)])]; };
    std::vector<Index> creases = crease_halfedges(mesh, crease, function_ref<double(Index)>(least_at));
    if (automatic) keep_mostly_sharp(mesh, creases);
    halfedges.insert(halfedges.end(), creases.begin(), creases.end());
  }
  EdgeMarks marks;
  for (const Index h : halfedges) {
    if (mesh.twin(h) == no_index) continue;  // the border is kept without being asked
    marks.resize(at(mesh.halfedge_count()), 0);
    marks[at(h)] = marks[at(mesh.twin(h))] = 1;
  }
  return marks;
}

/// Those of a piece's faces.
[[nodiscard]] inline EdgeMarks marks_of(const EdgeMarks& marks, std::span<const Index> faces) {
  if (marks.empty()) return {};
  EdgeMarks result;
  bool any = false;
  for (const Index f : faces)
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      result.push_back(marks[at(h)]);
      any = any || marks[at(h)];
    }
  return any ? result : EdgeMarks{};
}

/// Unmarks connected sets of edges whose total length is below the limit.
inline void drop_short(const TriangleMesh<double>& mesh, double least_length, EdgeMarks& marks) {
  std::vector<double> length(at(mesh.vertex_count()), -1);
  std::vector<Index> open;
  for (Index seed = 0; seed < mesh.halfedge_count(); ++seed) {
    if (!marks[at(seed)] || length[at(mesh.origin(seed))] >= 0) continue;
    double sum = 0;
    open.assign(1, mesh.origin(seed));
    length[at(open[0])] = 0;
    for (std::size_t k = 0; k < open.size(); ++k) {
      Index h = mesh.outgoing(open[k]);
      const Index start = h;
      do {
        // The incoming edge at the end of a fan is visited from its other end.
        if (marks[at(h)]) {
          sum += mesh.edge_vector(h).norm() / 2;
          if (const Index w = mesh.target(h); length[at(w)] < 0) {
            length[at(w)] = 0;
            open.push_back(w);
          }
        }
        h = mesh.next_around(h);
      } while (h != no_index && h != start);
    }
    for (const Index v : open) length[at(v)] = sum;
  }
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (marks[at(h)] && length[at(mesh.origin(h))] < least_length) marks[at(h)] = 0;
}

/// Cuts the piece where the vertex group of largest weight changes and marks the cuts, except around islands whose
/// border is shorter than `least_length`. \pre it has a rig
inline void keep_group_borders(Piece& piece, double least_length) {
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  const SkinWeights& weights = piece.asset.rig->weights;
  std::vector<Index> group(at(mesh.vertex_count()), 0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    double most = 0;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      if (it.value() > most) {
        most = it.value();
        group[at(v)] = static_cast<Index>(it.col());
      }
  }
  std::vector<char> cut(at(mesh.halfedge_count()), 0);
  bool any = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (group[at(mesh.origin(h))] != group[at(mesh.target(h))]) cut[at(h)] = 1, any = true;
  if (!any) return;
  const auto share = [&](Index h) {
    const Index v = mesh.origin(h), w = mesh.target(h), a = group[at(v)], b = group[at(w)];
    const double here = weights.coeff(v, a) - weights.coeff(v, b), there = weights.coeff(w, b) - weights.coeff(w, a);
    return here + there > 0 ? std::clamp(here / (here + there), 0.05, 0.95) : 0.5;  // no slivers
  };
  Refinement finer = split_edges(mesh, cut, share);
  EdgeMarks kept = carried_marks(mesh, piece.kept, finer), borders(at(finer.mesh.halfedge_count()), 0);
  const Index old = mesh.vertex_count();
  for (Index g = 0; g < finer.mesh.halfedge_count(); ++g) {
    const Index a = finer.mesh.origin(g), b = finer.mesh.target(g);
    if (a < old || b < old) continue;
    // Where three groups meet, the borders do at one of the cuts, that which is lowest: the edge across is none.
    const Index across = finer.mesh.twin(g), third = finer.mesh.target(finer.mesh.next(g)),
                other = across == no_index ? no_index : finer.mesh.target(finer.mesh.next(across));
    if ((third >= old && third < std::min(a, b)) || (other >= old && other < std::min(a, b))) continue;
    borders[at(g)] = 1;
  }
  drop_short(finer.mesh, least_length, borders);
  replace_mesh(piece, std::move(finer));
  piece.kept = joined_marks(std::move(borders), kept);
}

/// Unmarks both sides of sectors between kept edges, or these and the border, that are too acute for the corner of a
/// quad, from their tip as far as `reach`, an edge of a quad, and on to where they are half of it apart. \cost O(m)
inline void release_acute(const TriangleMesh<double>& mesh, double reach, EdgeMarks& kept) {
  constexpr double least_radians = 40 * std::numbers::pi / 180;
  if (kept.empty()) return;
  const auto line = [&](Index h) { return mesh.twin(h) == no_index || kept[at(h)]; };
  const auto angle = [&](Index h) {  // of its face at its origin
    const Vector3 u = mesh.edge_vector(h), w = -mesh.edge_vector(mesh.next(mesh.next(h)));
    return elementary::atan2(u.cross(w).norm(), u.dot(w));
  };
  constexpr double room = 0.5;                    // edges of quads that lines must be apart where they end
  std::vector<std::pair<Index, double>> leaving;  // kept half-edges away from tips, and how far they are let go
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    if (!line(h)) continue;
    // Around the origin from h to the next line.
    double sector = 0;
    Index g = h;
    do {
      sector += angle(g);
      g = mesh.next(mesh.next(g));  // into the origin
      if (line(g) || mesh.twin(g) == h) break;
      g = mesh.twin(g);
    } while (sector < least_radians);
    if (!(sector < least_radians) || !line(g)) continue;
    const double far = reach * std::max(1.0, room / std::max(sector, 1e-3));
    if (kept[at(h)]) leaving.emplace_back(h, far);
    if (mesh.twin(g) != no_index) leaving.emplace_back(mesh.twin(g), far);
  }
  const EdgeMarks before = kept;
  for (const auto& [first, far] : leaving) {
    double left = far;
    for (Index h = first; left > 0 && before[at(h)];) {
      kept[at(h)] = kept[at(mesh.twin(h))] = 0;
      left -= mesh.edge_vector(h).norm();
      // Straight on, where one other kept edge goes on.
      Index onward = no_index, count = 0, g = mesh.twin(h);
      const Index start = g;
      do {
        if (g != start && before[at(g)]) onward = g, ++count;
        g = mesh.next_around(g);
      } while (g != no_index && g != start);
      if (count != 1 || g == no_index) break;
      h = onward;
    }
  }
}

/// What kept edges enclose that is smaller than half a quad has no room for one: it is joined to the patch against
/// which it bends least, whose edges with it are let go. \param edge of a quad \cost O(m) for each round of joins
inline void release_small_patches(const TriangleMesh<double>& mesh, double edge, EdgeMarks& kept) {
  constexpr double room = 0.5;
  constexpr int rounds = 16;  // patches of patches of patches
  if (kept.empty()) return;
  DisjointSets patches(at(mesh.face_count()));
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (const Index g = mesh.twin(h); g != no_index && !kept[at(h)]) patches.join(h / 3, g / 3);
  for (int round = 0; round < rounds; ++round) {
    std::vector<double> area(at(mesh.face_count()), 0.0);
    for (Index f = 0; f < mesh.face_count(); ++f) area[at(patches.find(f))] += mesh.area(f);
    struct Bend {
      double turned = 0, length = 0;
    };
    std::map<std::pair<Index, Index>, Bend> between;  // a small patch and another
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      if (!kept[at(h)] || mesh.twin(h) == no_index) continue;
      const Index own = patches.find(h / 3), other = patches.find(mesh.twin(h) / 3);
      if (own == other || !(area[at(own)] < room * edge * edge)) continue;
      Bend& bend = between[{own, other}];
      bend.turned += mesh.edge_vector(h).norm() * dihedral_angle(mesh, h);
      bend.length += mesh.edge_vector(h).norm();
    }
    if (between.empty()) return;
    std::map<Index, std::pair<double, Index>> least;  // of each small patch: mean bend, other patch
    for (const auto& [pair, bend] : between) {
      const double mean = bend.length > 0 ? bend.turned / bend.length : 0;
      const auto [place, is_new] = least.try_emplace(pair.first, mean, pair.second);
      if (!is_new) place->second = std::min(place->second, std::pair{mean, pair.second});
    }
    std::vector<Index> before;
    for (Index f = 0; f < mesh.face_count(); ++f) before.push_back(patches.find(f));
    for (const auto& [small, join] : least) patches.join(small, join.second);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)  // creases that fade out within a patch stay
      if (const Index g = mesh.twin(h);
          g != no_index && before[at(h / 3)] != before[at(g / 3)] && patches.find(h / 3) == patches.find(g / 3))
        kept[at(h)] = 0;
  }
}

/// How much of the kept edges became edges of quads.
struct Kept {
  std::vector<char> vertex;  ///< of the quads: lies on one
  double as_quads = 0;       ///< length of those that edges of quads run along
};
[[nodiscard]] inline Kept measure_kept(const TriangleMesh<double>& mesh, const EdgeMarks& marks,
                                       const QuadMesh& quads) {
  Kept result;
  if (marks.empty()) return result;
  constexpr double near = 1e-6;
  const EdgeCurves curves(mesh, marks);
  for (Index v = 0; v < quads.vertex_count(); ++v)
    result.vertex.push_back(curves.under(quads.source[at(v)], near) != no_index);
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Index v = quads.quads(q, i), w = quads.quads(q, (i + 1) % 4);
      if (!result.vertex[at(v)] || !result.vertex[at(w)]) continue;
      const double straight = (quads.positions.row(v) - quads.positions.row(w)).norm();
      if (const auto along = curves.distance(quads.source[at(v)], quads.source[at(w)], near);
          along && *along < 1.5 * straight)
        result.as_quads += *along / 2;  // both its quads count it
    }
  return result;
}

}  // namespace quadrig::detail
