// Regions of a surface.
#include "regions.hpp"

#include <numeric>

namespace quadrig::gltf {

Regions::Regions(const Gathered& gathered, const TriangleMesh<double>& mesh, std::span<const Index> source_face)
    : gathered_(gathered), mesh_(mesh), source_face_(source_face) {
  const Index count = mesh.face_count();
  std::vector<Index> seam_columns;
  for (const Attribute& a : gathered.attributes)
    if (a.makes_seams())
      for (Eigen::Index k = 0; k < a.width; ++k) seam_columns.push_back(static_cast<Index>(a.first + k));
  const auto corner = [&](Index f, Index i) { return gathered.corner_vertex[at(3 * source_face[at(f)] + i)]; };
  const auto primitive_of = [&](Index f) { return gathered.surface.source_primitive[at(source_face[at(f)])]; };
  const auto alike = [&](Index a, Index b) {
    if (a == b) return true;
    for (const Index k : seam_columns)
      if (!(std::abs(gathered.values(a, k) - gathered.values(b, k)) <= 1e-5)) return false;
    return true;
  };
  std::vector<Index> root(at(count));
  std::iota(root.begin(), root.end(), Index{0});
  const auto find = [&](Index f) {
    while (root[at(f)] != f) f = root[at(f)] = root[at(root[at(f)])];
    return f;
  };
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index across = mesh.twin(h);
    if (across == no_index || across < h) continue;
    const Index f = h / 3, g = across / 3;
    if (primitive_of(f) != primitive_of(g)) continue;
    if (!alike(corner(f, h % 3), corner(g, TriangleMesh<double>::next(across) % 3)) ||
        !alike(corner(f, TriangleMesh<double>::next(h) % 3), corner(g, across % 3)))
      continue;
    const Index a = find(f), b = find(g);
    root[at(std::max(a, b))] = std::min(a, b);
  }
  std::vector<Index> number(at(count), no_index);
  for (Index f = 0; f < count; ++f) {
    Index& own = number[at(find(f))];
    if (own == no_index) {
      own = static_cast<Index>(primitive_.size());
      primitive_.push_back(primitive_of(f));
      faces_.emplace_back();
    }
    of_face_.push_back(own);
    faces_[at(own)].push_back(f);
  }
}

Index Regions::of_quad(const QuadMesh& quads, Index quad) const {
  // Where all corners agree, that is it; else the surface is followed from a corner to below the centre.
  std::array<Index, 4> own{};
  Vector3 centre = Vector3::Zero();
  for (int i = 0; i < 4; ++i) {
    own[static_cast<std::size_t>(i)] = of_face(quads.source[at(quads.quads(quad, i))].face);
    centre += quads.positions.row(quads.quads(quad, i)).transpose() / 4;
  }
  if (own[0] == own[1] && own[1] == own[2] && own[2] == own[3]) return own[0];
  SurfaceHit best;
  for (int i = 0; i < 4; ++i) {
    const SurfaceHit hit = walk_closest(mesh_, centre, quads.source[at(quads.quads(quad, i))]);
    if (hit.squared_distance < best.squared_distance) best = hit;
  }
  return best.found() ? of_face(best.face) : own[0];
}

Eigen::VectorXd Regions::values_at(const SurfacePoint& point) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(gathered_.values.cols());
  for (int i = 0; i < 3; ++i)
    values += point.barycentric[i] *
              gathered_.values.row(gathered_.corner_vertex[at(3 * source_face_[at(point.face)] + i)]).transpose();
  return values;
}

Eigen::VectorXd Regions::values(const QuadMesh& quads, Index vertex, Index region) {
  const SurfacePoint& source = quads.source[at(vertex)];
  if (of_face(source.face) == region) return values_at(source);
  auto found = trees_.find(region);
  if (found == trees_.end()) {
    const std::vector<Index>& own = faces_[at(region)];
    Triangles faces(static_cast<Eigen::Index>(own.size()), 3);
    for (std::size_t k = 0; k < own.size(); ++k) faces.row(static_cast<Eigen::Index>(k)) = mesh_.faces().row(own[k]);
    found = trees_.emplace(region, ClosestPoint(mesh_.positions(), faces)).first;
  }
  SurfaceHit hit = found->second.closest(quads.positions.row(vertex).transpose());
  if (!hit.found()) return values_at(source);
  hit.face = faces_[at(region)][at(hit.face)];
  return values_at(hit);
}

}  // namespace quadrig::gltf
