// The inside of a surface as cells of a grid, and how far each is from a bone through the body.
#pragma once

#include <optional>
#include <queue>

#include "quadrig/rig.hpp"

namespace quadrig::detail {

/// Cells of equal cubes around a surface and its bones. A cell is body where the surface passes through it or where it
/// cannot be reached from outside; the rest is air.
class VoxelBody {
 public:
  /// \pre resolution ≥ 8, everything finite, the box not a point
  VoxelBody(const TriangleMesh<double>& mesh, const Skeleton& skeleton, Index resolution) {
    Eigen::AlignedBox3d box;
    for (Index v = 0; v < mesh.vertex_count(); ++v) box.extend(mesh.position(v));
    // A bone far away is not to make the cells as large as the body is.
    const Vector3 margin = Vector3::Constant(0.25 * box.diagonal().norm()), most = box.max() + margin,
                  least = box.min() - margin;
    for (const Bone& bone : skeleton.bones)
      for (const Vector3& end : {bone.head, bone.tail}) box.extend(Vector3(end.cwiseMax(least).cwiseMin(most)));
    side_ = box.sizes().maxCoeff() / resolution;
    low_ = box.min() - Vector3::Constant(1.5 * side_);  // a layer of air all around
    for (int k = 0; k < 3; ++k) size_[at(k)] = static_cast<Index>(std::ceil(box.sizes()[k] / side_)) + 4;
    body_.assign(cell_count(), 1);
    for (Index f = 0; f < mesh.face_count(); ++f)
      mark({mesh.position(mesh.faces()(f, 0)), mesh.position(mesh.faces()(f, 1)), mesh.position(mesh.faces()(f, 2))});
    close_holes(mesh);
    flood();
  }

  [[nodiscard]] double side() const { return side_; }
  [[nodiscard]] std::size_t cell_count() const {
    return static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) * static_cast<std::size_t>(size_[2]);
  }
  [[nodiscard]] std::size_t body_count() const {
    return body_.size() - static_cast<std::size_t>(std::count(body_.begin(), body_.end(), air));
  }
  [[nodiscard]] bool is_body(std::size_t cell) const { return body_[cell] != air; }
  [[nodiscard]] std::size_t cell_of(const Vector3& p) const {
    std::array<Index, 3> c{};
    for (int k = 0; k < 3; ++k)
      c[at(k)] = std::clamp(static_cast<Index>((p[k] - low_[k]) / side_), Index{0}, size_[at(k)] - 1);
    return number(c);
  }
  /// The part of a segment, from 0 at its head to 1, that lies in the grid; nothing where none does.
  [[nodiscard]] std::optional<std::pair<double, double>> part_inside(const Vector3& head, const Vector3& tail) const {
    double first = 0, last = 1;
    for (int k = 0; k < 3; ++k) {
      const double low = low_[k] - head[k], high = low + side_ * size_[at(k)], way = tail[k] - head[k];
      if (way == 0) {
        if (low > 0 || high < 0) return std::nullopt;
        continue;
      }
      first = std::max(first, std::min(low / way, high / way));
      last = std::min(last, std::max(low / way, high / way));
    }
    if (first > last) return std::nullopt;
    return std::pair{first, last};
  }
  [[nodiscard]] Vector3 centre(std::size_t cell) const {
    const std::array<Index, 3> c = place(cell);
    return low_ + side_ * Vector3(c[0] + 0.5, c[1] + 0.5, c[2] + 0.5);
  }

  /// Calls visit(cell, length of the step in sides) for the up to 26 neighbours.
  template <class Visit>
  void for_each_neighbour(std::size_t cell, Visit&& visit) const {
    static const std::array<double, 4> length{0, 1, std::sqrt(2.0), std::sqrt(3.0)};
    const std::array<Index, 3> c = place(cell);
    for (Index dz = -1; dz <= 1; ++dz)
      for (Index dy = -1; dy <= 1; ++dy)
        for (Index dx = -1; dx <= 1; ++dx) {
          const std::array<Index, 3> n{c[0] + dx, c[1] + dy, c[2] + dz};
          const auto steps = static_cast<std::size_t>(std::abs(dx) + std::abs(dy) + std::abs(dz));
          if (steps == 0 || !inside(n)) continue;
          visit(number(n), length[steps]);
        }
  }

  /// Calls visit(cell, share) for the eight cells whose centres surround p; the shares are trilinear and sum to 1.
  template <class Visit>
  void for_each_around(const Vector3& p, Visit&& visit) const {
    std::array<Index, 3> low{};
    Vector3 t;
    for (int k = 0; k < 3; ++k) {
      const double x = std::clamp((p[k] - low_[k]) / side_ - 0.5, 0.0, size_[at(k)] - 1.001);
      low[at(k)] = static_cast<Index>(x);
      t[k] = x - low[at(k)];
    }
    for (Index corner = 0; corner < 8; ++corner) {
      std::array<Index, 3> c = low;
      double share = 1;
      for (int k = 0; k < 3; ++k) {
        const Index up = corner >> k & 1;
        c[at(k)] += up;
        share *= up ? t[k] : 1 - t[k];
      }
      visit(number(c), share);
    }
  }

 private:
  static constexpr char unknown = 1, surface = 2, air = 0;

  [[nodiscard]] std::size_t number(const std::array<Index, 3>& c) const {
    return static_cast<std::size_t>(c[0]) +
           static_cast<std::size_t>(size_[0]) *
               (static_cast<std::size_t>(c[1]) + static_cast<std::size_t>(size_[1]) * static_cast<std::size_t>(c[2]));
  }
  [[nodiscard]] std::array<Index, 3> place(std::size_t cell) const {
    const auto nx = static_cast<std::size_t>(size_[0]), ny = static_cast<std::size_t>(size_[1]);
    return {static_cast<Index>(cell % nx), static_cast<Index>(cell / nx % ny), static_cast<Index>(cell / (nx * ny))};
  }
  [[nodiscard]] bool inside(const std::array<Index, 3>& c) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (c[k] < 0 || c[k] >= size_[k]) return false;
    return true;
  }

  // Cells that the triangle touches (Akenine-Möller 2001): its plane, its box, and the axes across both their edges.
  void mark(std::array<Vector3, 3> p) {
    for (Vector3& corner : p) corner = (corner - low_) / side_;
    const Vector3 normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const double reach = 0.5 * normal.cwiseAbs().sum() * (1 + 1e-9);
    std::array<Index, 3> first{}, last{};
    for (int k = 0; k < 3; ++k) {
      const double least = std::min({p[0][k], p[1][k], p[2][k]}), most = std::max({p[0][k], p[1][k], p[2][k]});
      first[at(k)] = std::clamp(static_cast<Index>(std::floor(least)), Index{0}, size_[at(k)] - 1);
      last[at(k)] = std::clamp(static_cast<Index>(std::floor(most)), Index{0}, size_[at(k)] - 1);
    }
    for (Index z = first[2]; z <= last[2]; ++z)
      for (Index y = first[1]; y <= last[1]; ++y)
        for (Index x = first[0]; x <= last[0]; ++x) {
          const Vector3 c(x + 0.5, y + 0.5, z + 0.5);
          if (std::abs(normal.dot(c - p[0])) > reach || !overlaps_edges(c, p)) continue;
          body_[number({x, y, z})] = surface;
        }
  }
  static bool overlaps_edges(const Vector3& c, const std::array<Vector3, 3>& p) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 edge = p[(i + 1) % 3] - p[i];
      for (int k = 0; k < 3; ++k) {
        const Vector3 axis = Vector3::Unit(k).cross(edge);
        const double a = axis.dot(p[i] - c), b = axis.dot(p[(i + 2) % 3] - c);
        const double reach = 0.5 * axis.cwiseAbs().sum() + 1e-9;
        if (std::min(a, b) > reach || std::max(a, b) < -reach) return false;
      }
    }
    return true;
  }
  // A fan over each border keeps the air out of a body whose surface is open at the neck, the sleeves, the eyes.
  void close_holes(const TriangleMesh<double>& mesh) {
    std::vector<char> seen(static_cast<std::size_t>(mesh.halfedge_count()), 0);
    std::vector<Index> loop;
    for (Index start = 0; start < mesh.halfedge_count(); ++start) {
      if (mesh.twin(start) != no_index || seen[static_cast<std::size_t>(start)]) continue;
      loop.clear();
      Vector3 centre = Vector3::Zero();
      // The border goes on with the half-edge without a twin that leaves the target: the first of its fan.
      for (Index h = start; !seen[static_cast<std::size_t>(h)]; h = mesh.outgoing(mesh.target(h))) {
        seen[static_cast<std::size_t>(h)] = 1;
        loop.push_back(h);
        centre += mesh.position(mesh.origin(h));
      }
      centre /= static_cast<double>(loop.size());
      for (const Index h : loop) mark({mesh.position(mesh.origin(h)), mesh.position(mesh.target(h)), centre});
    }
  }
  void flood() {
    std::vector<std::size_t> stack{0};
    body_[0] = air;
    while (!stack.empty()) {
      const std::size_t cell = stack.back();
      stack.pop_back();
      const std::array<Index, 3> c = place(cell);
      for (std::size_t k = 0; k < 3; ++k)
        for (const Index step : {-1, 1}) {
          std::array<Index, 3> n = c;
          n[k] += step;
          if (!inside(n)) continue;
          const std::size_t next = number(n);
          if (body_[next] != unknown) continue;
          body_[next] = air;
          stack.push_back(next);
        }
    }
  }

  std::array<Index, 3> size_{};
  Vector3 low_ = Vector3::Zero();
  double side_ = 0;
  std::vector<char> body_;
};

}  // namespace quadrig::detail
