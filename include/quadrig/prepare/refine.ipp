// Conforming longest-edge refinement with a map back to the source surface.
#pragma once

#include "quadrig/prepare.hpp"

namespace quadrig {

QUADRIG_INLINE Expected<Refinement> refine(const TriangleMesh<double>& mesh,
                                           function_ref<double(Index face)> target_length, const RefineOptions& options,
                                           Context& context) {
  if (Status status = options.validate(); !status) return status.error();
  std::vector<double> target(static_cast<std::size_t>(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    target[static_cast<std::size_t>(f)] = target_length(f);
    if (!(target[static_cast<std::size_t>(f)] > 0))
      return Error{ErrorCode::bad_option, "target length is not positive", "face " + std::to_string(f),
                   "give a length above 0"};
  }
  // Each part of a side belongs to one piece: a lower bound of their number rejects the hopeless cases early.
  double pieces_least = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    double longest = 0;
    for (Index h = 3 * f; h < 3 * f + 3; ++h) longest = std::max(longest, mesh.edge_vector(h).norm());
    pieces_least += std::max(1.0, longest / target[static_cast<std::size_t>(f)]);
  }
  const auto too_many = [&] {
    return Error{ErrorCode::unsupported, "refinement needs more than " + std::to_string(options.max_faces) + " faces",
                 "refine", "ask for longer edges or raise max_faces"};
  };
  if (pieces_least > options.max_faces + 1.0) return too_many();
  Refinement result;
  std::vector<Vector3> positions(static_cast<std::size_t>(mesh.vertex_count()));
  result.source.resize(positions.size());
  for (Index v = 0; v < mesh.vertex_count(); ++v) positions[static_cast<std::size_t>(v)] = mesh.position(v);
  for (Index corner = 3 * mesh.face_count() - 1; corner >= 0; --corner) {
    SurfacePoint& point = result.source[static_cast<std::size_t>(mesh.origin(corner))];
    point.face = corner / 3;
    point.barycentric = Vector3::Unit(corner % 3);
  }
  struct Piece {
    std::array<Index, 3> vertex;
    std::array<Vector3, 3> barycentric;  ///< of the corners, in the source face
    Index source;
  };
  std::vector<Piece> pieces(static_cast<std::size_t>(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    Piece& piece = pieces[static_cast<std::size_t>(f)];
    for (int i = 0; i < 3; ++i) {
      piece.vertex[static_cast<std::size_t>(i)] = mesh.faces()(f, i);
      piece.barycentric[static_cast<std::size_t>(i)] = Vector3::Unit(i);
    }
    piece.source = f;
  }
  std::vector<Index> twin(3 * pieces.size());
  for (Index h = 0; h < mesh.halfedge_count(); ++h) twin[static_cast<std::size_t>(h)] = mesh.twin(h);

  while (true) {
    if (context.cancelled()) return cancelled_error("refine");
    const std::size_t m = pieces.size();
    // The longest side of each face, ties by the vertices' numbers, so that both faces of an edge agree.
    std::vector<char> longest(m);
    std::vector<Index> middle(3 * m, no_index);
    std::vector<Index> queue;
    const auto squared_length = [&](std::size_t h) {
      const Piece& piece = pieces[h / 3];
      return (positions[static_cast<std::size_t>(piece.vertex[(h % 3 + 1) % 3])] -
              positions[static_cast<std::size_t>(piece.vertex[h % 3])])
          .squaredNorm();
    };
    constexpr Index marked = 0;
    const auto mark = [&](std::size_t h) {
      if (middle[h] != no_index) return;
      middle[h] = marked;
      queue.push_back(static_cast<Index>(h / 3));
      const Index across = twin[h];
      if (across == no_index) return;
      middle[static_cast<std::size_t>(across)] = marked;
      queue.push_back(across / 3);
    };
    for (std::size_t f = 0; f < m; ++f) {
      using Key = std::pair<double, std::array<Index, 2>>;
      Key best{-1, {}};
      const double limit = target[static_cast<std::size_t>(pieces[f].source)];
      for (std::size_t i = 0; i < 3; ++i) {
        const Index a = pieces[f].vertex[i], b = pieces[f].vertex[(i + 1) % 3];
        const Key key{squared_length(3 * f + i), {std::min(a, b), std::max(a, b)}};
        if (key > best) best = key, longest[f] = static_cast<char>(i);
        if (key.first > limit * limit) mark(3 * f + i);
      }
    }
    if (context.cancelled()) return cancelled_error("refine");
    if (queue.empty()) break;
    for (std::size_t next = 0; next < queue.size(); ++next) {  // a face that is cut is cut across its longest side
      const auto f = static_cast<std::size_t>(queue[next]);
      mark(3 * f + static_cast<std::size_t>(longest[f]));
    }
    std::size_t total = m;
    for (const Index mid : middle) total += mid != no_index;
    if (total > static_cast<std::size_t>(options.max_faces)) return too_many();

    for (std::size_t h = 0; h < 3 * m; ++h) {
      const Index across = twin[h];
      if (middle[h] == no_index || (across != no_index && static_cast<std::size_t>(across) < h)) continue;
      const Piece& piece = pieces[h / 3];
      const std::size_t i = h % 3, j = (i + 1) % 3;
      const auto v = static_cast<Index>(positions.size());
      positions.push_back((positions[static_cast<std::size_t>(piece.vertex[i])] +
                           positions[static_cast<std::size_t>(piece.vertex[j])]) /
                          2);
      result.source.push_back({piece.source, (piece.barycentric[i] + piece.barycentric[j]) / 2});
      middle[h] = v;
      if (across != no_index) middle[static_cast<std::size_t>(across)] = v;
    }
    std::vector<Piece> finer;
    finer.reserve(total);
    for (std::size_t f = 0; f < m; ++f) {
      const Piece& piece = pieces[f];
      const auto i = static_cast<std::size_t>(longest[f]), j = (i + 1) % 3, k = (i + 2) % 3;
      const auto mid_i = middle[3 * f + i], mid_j = middle[3 * f + j], mid_k = middle[3 * f + k];
      if (mid_i == no_index) {
        finer.push_back(piece);
        continue;
      }
      const auto between = [&](std::size_t a, std::size_t b) {
        return Vector3((piece.barycentric[a] + piece.barycentric[b]) / 2);
      };
      const auto add = [&](std::array<Index, 3> v, const Vector3& a, const Vector3& b, const Vector3& c) {
        finer.push_back({v, {a, b, c}, piece.source});
      };
      const Vector3 on_i = between(i, j);
      const auto half = [&](std::size_t a, std::size_t b, Index mid) {  // triangle middle, a, b; mid on a–b or none
        if (mid == no_index) {
          add({mid_i, piece.vertex[a], piece.vertex[b]}, on_i, piece.barycentric[a], piece.barycentric[b]);
        } else {
          add({mid_i, piece.vertex[a], mid}, on_i, piece.barycentric[a], between(a, b));
          add({mid_i, mid, piece.vertex[b]}, on_i, between(a, b), piece.barycentric[b]);
        }
      };
      half(j, k, mid_j);
      half(k, i, mid_k);
    }
    pieces = std::move(finer);
    if (context.cancelled()) return cancelled_error("refine");
    // Twins anew, by sorting: the pattern above would need a table of cases.
    const auto ends = [&](Index halfedge) {
      const auto h = static_cast<std::size_t>(halfedge);
      const Index a = pieces[h / 3].vertex[h % 3], b = pieces[h / 3].vertex[(h % 3 + 1) % 3];
      return detail::SortedSide{std::min(a, b), std::max(a, b), halfedge};
    };
    const std::vector<detail::SortedSide> sides =
        detail::sorted_by_edge(static_cast<Index>(positions.size()), static_cast<Index>(3 * pieces.size()), ends);
    twin.assign(3 * pieces.size(), no_index);
    for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
      if (!sides[s].same_edge(sides[s + 1])) continue;
      twin[static_cast<std::size_t>(sides[s].halfedge)] = sides[s + 1].halfedge;
      twin[static_cast<std::size_t>(sides[s + 1].halfedge)] = sides[s].halfedge;
    }
  }

  if (context.cancelled()) return cancelled_error("refine");
  Points<double> points(static_cast<Eigen::Index>(positions.size()), 3);
  for (std::size_t v = 0; v < positions.size(); ++v)
    points.row(static_cast<Eigen::Index>(v)) = positions[v].transpose();
  Triangles faces(static_cast<Eigen::Index>(pieces.size()), 3);
  result.source_face.resize(pieces.size());
  for (std::size_t f = 0; f < pieces.size(); ++f) {
    for (std::size_t i = 0; i < 3; ++i)
      faces(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(i)) = pieces[f].vertex[i];
    result.source_face[f] = pieces[f].source;
  }
  Expected<TriangleMesh<double>> finer = TriangleMesh<double>::create(std::move(points), std::move(faces));
  if (!finer) return finer.error();
  result.mesh = std::move(*finer);
  return result;
}

QUADRIG_INLINE VertexWeights interpolate(const TriangleMesh<double>& mesh, const VertexWeights& rows,
                                         std::span<const SurfacePoint> points) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (points[p].face == no_index) continue;  // a vertex of no face
    for (int i = 0; i < 3; ++i) {
      const double share = points[p].barycentric[i];
      if (share == 0) continue;
      for (VertexWeights::InnerIterator it(rows, mesh.faces()(points[p].face, i)); it; ++it)
        entries.emplace_back(static_cast<Index>(p), static_cast<Index>(it.col()), share * it.value());
    }
  }
  VertexWeights result(static_cast<Eigen::Index>(points.size()), rows.cols());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

}  // namespace quadrig
