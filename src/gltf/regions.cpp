// Values of quads, seam by seam.
#include "regions.hpp"

#include <numeric>

namespace quadrig::gltf {
namespace {

Vector3 centre_of(const QuadMesh& quads, Index quad) {
  Vector3 centre = Vector3::Zero();
  for (int i = 0; i < 4; ++i) centre += quads.positions.row(quads.quads(quad, i)).transpose() / 4;
  return centre;
}

}  // namespace

Regions::Regions(const Gathered& gathered, const TriangleMesh<double>& mesh, std::span<const Index> source_face)
    : gathered_(gathered), mesh_(mesh), source_face_(source_face) {
  for (const Attribute& a : gathered.attributes)
    if (a.makes_seams())
      for (Eigen::Index k = 0; k < a.width; ++k) {
        seam_columns_.push_back(a.first + k);
        if (a.name == "TEXCOORD_0") texture_columns_.push_back(a.first + k);
      }
  diagonal_ = (mesh.positions().colwise().maxCoeff() - mesh.positions().colwise().minCoeff()).norm();
  const auto corner = [&](Index h) { return gathered.corner_vertex[at(3 * source_face[at(h / 3)] + h % 3)]; };
  const auto same = [&](Index a, Index b) {
    if (a == b) return true;
    for (const Eigen::Index k : seam_columns_)
      if (!(std::abs(gathered.values(a, k) - gathered.values(b, k)) <= 1e-5)) return false;
    return true;
  };
  seam_.assign(at(mesh.halfedge_count()), 1);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index across = mesh.twin(h);
    if (across == no_index || primitive_of(h / 3) != primitive_of(across / 3)) continue;
    seam_[at(h)] = !(same(corner(h), corner(TriangleMesh<double>::next(across))) &&
                     same(corner(TriangleMesh<double>::next(h)), corner(across)));
  }
  for (Index f = 0; f < mesh.face_count(); ++f) {
    std::array<Vector3, 3> p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = mesh.position(mesh.faces()(f, static_cast<Eigen::Index>(i)));
    const Vector3 centre = (p[0] + p[1] + p[2]) / 3;
    double radius = 0;
    for (const Vector3& end : p) radius = std::max(radius, (end - centre).norm());
    ball_.emplace_back(centre[0], centre[1], centre[2], radius);
  }
  mark_.assign(at(mesh.face_count()), 0);
}

bool Regions::any_seam() const {
  for (Index h = 0; h < mesh_.halfedge_count(); ++h)
    if (is_seam(h)) return true;
  return false;
}

bool Regions::parts_primitives(Index halfedge) const {
  return is_seam(halfedge) && primitive_of(halfedge / 3) != primitive_of(mesh_.twin(halfedge) / 3);
}

bool Regions::alike(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
  for (const Eigen::Index k : seam_columns_)
    if (!(std::abs(a[k] - b[k]) <= 1e-5)) return false;
  return true;
}

SurfaceHit Regions::hit(Index face, const Vector3& p) const {
  SurfaceHit found =
      closest_on_triangle(p, mesh_.position(mesh_.faces()(face, 0)), mesh_.position(mesh_.faces()(face, 1)),
                          mesh_.position(mesh_.faces()(face, 2)));
  found.face = face;
  return found;
}

/// Whether a face is surely farther than that, by the ball around it.
bool Regions::farther(Index face, const Vector3& p, double squared_distance) const {
  const double apart = (p - ball_[at(face)].head<3>()).norm() - ball_[at(face)][3];
  return apart > 0 && apart * apart > squared_distance;
}

/// Faces within the radius of the centre that are joined to `face` there, without a seam between.
void Regions::spread(Index face, const Vector3& centre, double squared_radius) {
  ++current_;
  reached_.assign(1, face);
  mark_[at(face)] = current_;
  for (std::size_t k = 0; k < reached_.size(); ++k)
    for (Index h = 3 * reached_[k]; h < 3 * reached_[k] + 3; ++h) {
      if (seam_[at(h)]) continue;
      const Index across = mesh_.twin(h) / 3;
      if (mark_[at(across)] == current_ || farther(across, centre, squared_radius) ||
          hit(across, centre).squared_distance > squared_radius)
        continue;
      mark_[at(across)] = current_;
      reached_.push_back(across);
    }
}

/// The face below the centre of a quad.
Index Regions::below(const QuadMesh& quads, Index quad, const Vector3& centre, double squared_radius) const {
  SurfaceHit found;
  // What is close below the centre is it; else the walk from another corner may end on the right sheet.
  for (int i = 0; i < 4 && !(found.squared_distance < 1e-3 * squared_radius); ++i) {
    const SurfaceHit here = walk_closest(mesh_, centre, quads.source[at(quads.quads(quad, i))]);
    if (here.squared_distance < found.squared_distance) found = here;
  }
  return found.found() ? found.face : quads.source[at(quads.quads(quad, 0))].face;
}

Regions::QuadValues Regions::of_quad(const QuadMesh& quads, Index quad) {
  const Vector3 centre = centre_of(quads, quad);
  std::array<Vector3, 4> p;
  double radius = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    p[i] = quads.positions.row(quads.quads(quad, static_cast<Eigen::Index>(i))).transpose();
    radius = std::max(radius, (p[i] - centre).squaredNorm());
  }
  const auto claimed = claims_.find(quad);
  const Index face = claimed != claims_.end() ? claimed->second : below(quads, quad, centre, radius);
  spread(face, centre, 1.1 * radius);
  QuadValues result;
  result.primitive = primitive_of(face);
  for (std::size_t i = 0; i < 4; ++i) {
    const SurfacePoint& own = quads.source[at(quads.quads(quad, static_cast<Eigen::Index>(i)))];
    if (mark_[at(own.face)] == current_) {
      result.corners[i] = values_at(own);
      continue;
    }
    SurfaceHit nearest;
    for (const Index f : reached_)
      if (const SurfaceHit found = hit(f, p[i]); found.squared_distance < nearest.squared_distance) nearest = found;
    result.corners[i] = values_at(nearest.found() ? nearest : own);
  }
  return result;
}

Regions::QuadValues Regions::of_quad(const QuadMesh& quads, Index quad, double& misfit) {
  QuadValues values = of_quad(quads, quad);
  misfit = 0;
  Index face = reached_.front();
  constexpr int n = 3;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double u = (i + 0.5) / n, v = (j + 0.5) / n;
      const std::array<double, 4> share{(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v};
      Vector3 p = Vector3::Zero();
      for (std::size_t k = 0; k < 4; ++k)
        p += share[k] * quads.positions.row(quads.quads(quad, static_cast<Eigen::Index>(k))).transpose();
      SurfaceHit nearest = hit(face, p);
      for (const Index f : reached_) {
        if (f == face || farther(f, p, nearest.squared_distance)) continue;
        if (const SurfaceHit found = hit(f, p); found.squared_distance < nearest.squared_distance) nearest = found;
      }
      face = nearest.face;
      misfit += nearest.squared_distance / (n * n);
      for (const Eigen::Index column : texture_columns_) {
        double difference = 0;
        for (std::size_t k = 0; k < 4; ++k) difference += share[k] * values.corners[k][column];
        for (int k = 0; k < 3; ++k)
          difference -= nearest.barycentric[k] *
                        gathered_.values(gathered_.corner_vertex[at(3 * source_face_[at(nearest.face)] + k)], column);
        misfit += difference * difference * diagonal_ * diagonal_ / (n * n);
      }
    }
  return values;
}

/// \param of_face on return the island of each face
std::vector<Regions::Island> Regions::islands(std::vector<Index>& of_face) const {
  std::vector<Island> all;
  of_face.assign(at(mesh_.face_count()), no_index);
  for (Index first = 0; first < mesh_.face_count(); ++first) {
    if (of_face[at(first)] != no_index) continue;
    const auto number = static_cast<Index>(all.size());
    Island& island = all.emplace_back();
    island.primitive = primitive_of(first);
    island.faces.push_back(first);
    of_face[at(first)] = number;
    for (std::size_t k = 0; k < island.faces.size(); ++k) {
      const Index face = island.faces[k];
      const double area = mesh_.area(face);
      island.area += area;
      island.centre += area * ball_[at(face)].head<3>();
      for (Index h = 3 * face; h < 3 * face + 3; ++h) {
        const Index across = mesh_.twin(h) / 3;
        if (mesh_.twin(h) == no_index || of_face[at(across)] != no_index || primitive_of(across) != island.primitive)
          continue;
        of_face[at(across)] = number;
        island.faces.push_back(across);
      }
    }
    island.centre = island.area > 0 ? Vector3(island.centre / island.area) : Vector3(ball_[at(first)].head<3>());
  }
  return all;
}

void Regions::claim_for_islands(const QuadMesh& quads) {
  constexpr double seen_area = 0.125, few = 4, alike_area = 0.5;  // of a quad, quads, of an island
  std::vector<Index> island_of, own(at(quads.quad_count()));
  std::vector<Island> all = islands(island_of);
  const double quad = mesh_.total_area() / quads.quad_count();
  if (std::ranges::none_of(all, [&](const Island& island) { return island.area < few * quad; })) return;
  for (Index q = 0; q < quads.quad_count(); ++q) {
    static_cast<void>(of_quad(quads, q));
    own[at(q)] = island_of[at(reached_.front())];
    ++all[at(own[at(q)])].quads;
  }
  // The least island of each primitive that gets a quad.
  std::map<Index, double> least;
  std::map<Index, Index> quads_of;
  for (const Island& island : all) {
    const auto [known, is_new] = least.try_emplace(island.primitive, seen_area * quad);
    if (island.quads > 0) known->second = std::min(known->second, alike_area * island.area);
    quads_of[island.primitive] += island.quads;
  }
  std::vector<Index> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater{}, [&](Index i) { return all[at(i)].area; });
  for (const Index i : order) {
    Island& island = all[at(i)];
    const bool lost = quads_of[island.primitive] == 0;
    if (island.quads > 0 || (!lost && (island.area < least[island.primitive] || island.area > few * quad))) continue;
    Index nearest = no_index;
    double squared = std::numeric_limits<double>::infinity();
    for (Index q = 0; q < quads.quad_count(); ++q) {
      const double here = (centre_of(quads, q) - island.centre).squaredNorm();
      if (here < squared && all[at(own[at(q)])].quads > 1 && !claims_.contains(q)) squared = here, nearest = q;
    }
    if (nearest == no_index || (!lost && squared > few * quad)) continue;
    const Vector3 centre = centre_of(quads, nearest);
    claim(nearest,
          *std::ranges::min_element(island.faces, {}, [&](Index f) { return hit(f, centre).squared_distance; }));
    --all[at(own[at(nearest)])].quads;
    --quads_of[all[at(own[at(nearest)])].primitive];
    own[at(nearest)] = i;
    ++island.quads;
    ++quads_of[island.primitive];
    least[island.primitive] = std::min(least[island.primitive], alike_area * island.area);
  }
}

Eigen::VectorXd Regions::values_at(const SurfacePoint& point) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(gathered_.values.cols());
  for (int i = 0; i < 3; ++i)
    values += point.barycentric[i] *
              gathered_.values.row(gathered_.corner_vertex[at(3 * source_face_[at(point.face)] + i)]).transpose();
  return values;
}

}  // namespace quadrig::gltf
