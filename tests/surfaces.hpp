// Small surfaces with known shapes, for tests that need no samples.
#pragma once

#include <cmath>
#include <numbers>

#include "quadrig/mesh.hpp"

namespace quadrig::test {

/// A grid over [0, u) × [0, v), mapped to space: (columns + 1) × (rows + 1) vertices, or fewer where it wraps. Quads
/// are (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1), so the side u × v is the outside.
struct Grid {
  Index columns = 8, rows = 8;
  bool wrap_columns = false, wrap_rows = false;

  [[nodiscard]] Index across() const { return wrap_columns ? columns : columns + 1; }
  [[nodiscard]] Index vertex(Index i, Index j) const {
    return (wrap_columns ? i % columns : i) + (wrap_rows ? j % rows : j) * across();
  }
  [[nodiscard]] Index vertex_count() const { return across() * (wrap_rows ? rows : rows + 1); }

  template <class Map>
  [[nodiscard]] Points<double> positions(Map&& map) const {
    Points<double> points(vertex_count(), 3);
    for (Index j = 0; j < (wrap_rows ? rows : rows + 1); ++j)
      for (Index i = 0; i < across(); ++i) points.row(vertex(i, j)) = Vector3(map(i, j)).transpose();
    return points;
  }
  [[nodiscard]] Quads quads() const {
    Quads result(columns * rows, 4);
    for (Index j = 0; j < rows; ++j)
      for (Index i = 0; i < columns; ++i)
        result.row(i + j * columns) << vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1);
    return result;
  }
  [[nodiscard]] Triangles triangles() const {
    const Quads q = quads();
    Triangles result(2 * q.rows(), 3);
    for (Eigen::Index k = 0; k < q.rows(); ++k) {
      result.row(2 * k) << q(k, 0), q(k, 1), q(k, 2);
      result.row(2 * k + 1) << q(k, 0), q(k, 2), q(k, 3);
    }
    return result;
  }
};

[[nodiscard]] inline TriangleMesh<double> build(Points<double> positions, Triangles faces) {
  return TriangleMesh<double>::create(std::move(positions), std::move(faces)).value();
}

/// An open tube of radius `radius` about the x axis from 0 to `length`; columns run round it, rows along it.
[[nodiscard]] inline Points<double> tube_positions(const Grid& grid, double length, double radius) {
  return grid.positions([&](Index i, Index j) {
    const double angle = 2 * std::numbers::pi * i / grid.columns;
    return Vector3(length * j / grid.rows, radius * std::sin(angle), radius * std::cos(angle));
  });
}

/// A torus of the two radii about the z axis; columns run round the tube, rows round the axis.
[[nodiscard]] inline Points<double> torus_positions(const Grid& grid, double large, double small) {
  return grid.positions([&](Index i, Index j) {
    const double a = 2 * std::numbers::pi * i / grid.columns, b = 2 * std::numbers::pi * j / grid.rows;
    const double r = large + small * std::cos(a);
    return Vector3(r * std::cos(b), -r * std::sin(b), small * std::sin(a));
  });
}

}  // namespace quadrig::test
