// Where normals part, and what they are.
#include "normals.hpp"

#include <algorithm>

#include "quadrig/closest.hpp"
#include "quadrig/disjoint_sets.hpp"

namespace quadrig::gltf {
namespace {

Vector3 unit_or(const Vector3& n, const Vector3& other) {
  const double length = n.norm();
  return length > 0 && std::isfinite(length) ? Vector3(n / length) : other;
}

std::optional<Vector3> file_normal(const Gathered& gathered, const Wedges& wedges, Index corner) {
  return wedges.normal(gathered.corner_vertex[at(corner)], gathered.surface.source_primitive[at(corner / 3)]);
}

/// The edges of a surface at which the file's normals part.
class HardEdges {
 public:
  HardEdges(const TriangleMesh<double>& mesh, const Wedges& wedges) : mesh_(mesh), mark_(at(mesh.face_count()), 0) {
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      hard_.push_back(wedges.is_hard(h));
      any_ = any_ || hard_.back();
    }
  }

  [[nodiscard]] bool any() const { return any_; }

  /// Whether one lies along the segment: near its middle, in its direction. \param near a place close to it
  [[nodiscard]] bool along(const Vector3& a, const Vector3& b, const SurfacePoint& near) {
    constexpr double reach = 0.3, least_cosine = 0.7;
    const Vector3 middle = (a + b) / 2;
    const double radius = reach * (b - a).norm();
    const SurfaceHit below = walk_closest(mesh_, middle, near);
    if (!below.found()) return false;
    // What lies off the surface is measured from the place below.
    const Vector3 centre = position(mesh_, below);
    const Vector3 direction = (b - a).normalized();
    ++current_;
    reached_.assign(1, below.face);
    mark_[at(below.face)] = current_;
    for (std::size_t k = 0; k < reached_.size(); ++k)
      for (Index h = 3 * reached_[k]; h < 3 * reached_[k] + 3; ++h) {
        const Vector3 from = mesh_.position(mesh_.origin(h)), to = mesh_.position(mesh_.target(h)), edge = to - from;
        const double t = std::clamp((centre - from).dot(edge) / std::max(edge.squaredNorm(), 1e-300), 0.0, 1.0);
        if ((from + t * edge - centre).norm() > radius) continue;
        if (hard_[at(h)] && std::abs(edge.normalized().dot(direction)) > least_cosine) return true;
        const Index across = mesh_.twin(h);
        if (across == no_index || mark_[at(across / 3)] == current_) continue;
        mark_[at(across / 3)] = current_;
        reached_.push_back(across / 3);
      }
    return false;
  }

 private:
  const TriangleMesh<double>& mesh_;
  std::vector<Index> reached_;
  std::vector<std::uint32_t> mark_;
  std::uint32_t current_ = 0;
  std::vector<char> hard_;
  bool any_ = false;
};

Vector3 place(const QuadMesh& quads, Index q, int i) { return quads.positions.row(quads.quads(q, i % 4)).transpose(); }

}  // namespace

std::vector<char> authored_normals(const Gathered& gathered, const Wedges& wedges, const Components& shells) {
  constexpr double least_degrees = 15;  // on average; those that an exporter made lie below 10
  const TriangleMesh<double>& mesh = gathered.surface.asset.mesh;
  std::vector<double> sum(at(shells.count), 0.0), area(at(shells.count), 0.0);
  std::vector<std::vector<Index>> corners(at(mesh.vertex_count()));
  for (Index c = 0; c < mesh.halfedge_count(); ++c) corners[at(mesh.origin(c))].push_back(c);
  for (const std::vector<Index>& there : corners)
    for (const Index c : there) {
      const auto own = file_normal(gathered, wedges, c);
      if (!own) continue;
      Vector3 made = Vector3::Zero();
      for (const Index d : there)
        if (const auto other = file_normal(gathered, wedges, d); other && other->dot(*own) > hard_cosine)
          made += mesh.corner_angle(TriangleMesh<double>::next(d)) * mesh.normal(d / 3);
      const auto shell = at(shells.of_face[at(c / 3)]);
      sum[shell] += mesh.area(c / 3) * elementary::acos(std::clamp(unit_or(made, *own).dot(*own), -1.0, 1.0));
      area[shell] += mesh.area(c / 3);
    }
  std::vector<char> authored;
  for (std::size_t s = 0; s < sum.size(); ++s)
    authored.push_back(sum[s] * 180 / std::numbers::pi > least_degrees * area[s]);
  return authored;
}

FieldNormals::FieldNormals(const Gathered& gathered, const Wedges& wedges, const Components& shells,
                           const QuadMesh& quads, const std::vector<char>& keep)
    : quads_(quads) {
  find_groups(gathered, wedges, shells);
  normals_ = anew(quads.positions);
  carry_over(gathered, wedges, shells, keep);
}

void FieldNormals::find_groups(const Gathered& gathered, const Wedges& wedges, const Components& shells) {
  constexpr double bent_cosine = 0.985;  // quads that meet flatter show no edge
  const Index n = quads_.quad_count();
  std::vector<std::array<Index, 3>> sides;
  for (Index q = 0; q < n; ++q)
    for (int i = 0; i < 4; ++i) {
      const auto [low, high] = std::minmax(quads_.quads(q, i), quads_.quads(q, (i + 1) % 4));
      sides.push_back({low, high, 4 * q + i});
    }
  std::sort(sides.begin(), sides.end());
  HardEdges hard(gathered.surface.asset.mesh, wedges);
  DisjointSets sets(4 * at(n));
  const auto quad_normal = [&](Index q) {
    return unit_or((place(quads_, q, 2) - place(quads_, q, 0)).cross(place(quads_, q, 3) - place(quads_, q, 1)),
                   Vector3::Zero());
  };
  for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
    if (sides[s][0] != sides[s + 1][0] || sides[s][1] != sides[s + 1][1]) continue;
    const Index a = sides[s][2], b = sides[s + 1][2];
    const SurfacePoint& near = quads_.source[at(sides[s][0])];
    if (wedges.flat(shells.of_face[at(near.face)])) continue;
    if (hard.any() && quad_normal(a / 4).dot(quad_normal(b / 4)) < bent_cosine &&
        hard.along(place(quads_, a / 4, a % 4), place(quads_, a / 4, a % 4 + 1),
                   quads_.source[at(quads_.quads(a / 4, a % 4))]))
      continue;
    sets.join(a, 4 * (b / 4) + (b + 1) % 4);  // they run against each other
    sets.join(4 * (a / 4) + (a + 1) % 4, b);
  }
  std::vector<Index> number(4 * at(n), no_index);
  group_.resize(4 * at(n));
  for (Index c = 0; c < 4 * n; ++c) {
    Index& own = number[at(sets.find(c))];
    if (own == no_index) own = count_++;
    group_[at(c)] = own;
  }
}

Points<double> FieldNormals::anew(const Points<double>& positions) const {
  Points<double> normals = Points<double>::Zero(count_, 3);
  for (Index q = 0; q < quads_.quad_count(); ++q) {
    Vector3 p[4];
    for (int i = 0; i < 4; ++i) p[i] = positions.row(quads_.quads(q, i)).transpose();
    const Vector3 n = (p[2] - p[0]).cross(p[3] - p[1]);
    for (int i = 0; i < 4; ++i) normals.row(of_corner(q, i)) += n.transpose();
  }
  for (Index v = 0; v < count_; ++v) normals.row(v) = unit_or(normals.row(v).transpose(), Vector3::UnitZ()).transpose();
  return normals;
}

void FieldNormals::carry_over(const Gathered& gathered, const Wedges& wedges, const Components& shells,
                              const std::vector<char>& keep) {
  constexpr double inside = 0.2;  // of the way to a quad's middle: on its side of an edge
  if (std::ranges::none_of(keep, [](char k) { return k; })) return;
  const TriangleMesh<double>& mesh = gathered.surface.asset.mesh;
  Points<double> sum = Points<double>::Zero(count_, 3);
  for (Index q = 0; q < quads_.quad_count(); ++q) {
    Vector3 middle = Vector3::Zero();
    for (int i = 0; i < 4; ++i) middle += place(quads_, q, i) / 4;
    for (int i = 0; i < 4; ++i) {
      const SurfacePoint& near = quads_.source[at(quads_.quads(q, i))];
      if (!keep[at(shells.of_face[at(near.face)])]) continue;
      const SurfaceHit below = walk_closest(mesh, (1 - inside) * place(quads_, q, i) + inside * middle, near);
      if (!below.found()) continue;
      for (int k = 0; k < 3; ++k)
        if (const auto n = file_normal(gathered, wedges, 3 * below.face + k))
          sum.row(of_corner(q, i)) += below.barycentric[k] * n->transpose();
    }
  }
  for (Index v = 0; v < count_; ++v) normals_.row(v) = unit_or(sum.row(v).transpose(), normal(v)).transpose();
}

}  // namespace quadrig::gltf
