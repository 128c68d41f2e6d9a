// An artist's stroke and a painted density to quads: directions on some faces, and how many quads go where.
#include <cstdio>

#include "quadrig/pipeline.hpp"

using namespace quadrig;

int main() {
  // A hilly sheet over [0, 1]².
  constexpr Index n = 40;
  Points<double> points((n + 1) * (n + 1), 3);
  Triangles faces(2 * n * n, 3);
  for (Index j = 0; j <= n; ++j)
    for (Index i = 0; i <= n; ++i) {
      const double x = 1.0 * i / n, y = 1.0 * j / n;
      points.row(i + j * (n + 1)) << x, y, 0.1 * std::sin(5 * x) * std::sin(4 * y);
      if (i == n || j == n) continue;
      const Index k = i + j * (n + 1);
      faces.row(2 * (i + j * n)) << k, k + 1, k + n + 2;
      faces.row(2 * (i + j * n) + 1) << k, k + n + 2, k + n + 1;
    }
  const Asset asset{TriangleMesh<double>::create(std::move(points), std::move(faces)).value(), {}};

  RemeshOptions options;
  options.quads = 600;
  options.preset = FieldPreset::flat;
  options.fit.method = FitMethod::none;
  // The stroke: a diagonal across the middle, on the faces under it, exactly so.
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const Vector3 p = asset.mesh.position(asset.mesh.faces()(f, 0));
    if (std::abs(p.x() - p.y()) < 0.06 && std::abs(p.x() - 0.5) < 0.2)
      options.directions.own.push_back({f, Vector3(1, 1, 0), std::numeric_limits<double>::infinity()});
  }
  // The density: one value a vertex, four times as many quads on the right.
  SizingOptions sizing;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v)
    sizing.own_density.push_back(asset.mesh.position(v).x() > 0.7 ? 4 : 1);
  options.sizing = sizing;

  Context context;
  const auto result = remesh(asset, options, context);
  if (!result) return std::fprintf(stderr, "%s\n", result.error().message().c_str()), 1;
  const QuadMesh& quads = result->mesh;
  int left = 0, right = 0, near = 0, along = 0;
  for (Index q = 0; q < quads.quad_count(); ++q) {
    Vector3 center = Vector3::Zero();
    for (int i = 0; i < 4; ++i) center += quads.positions.row(quads.quads(q, i)).transpose() / 4;
    left += center.x() < 0.3;
    right += center.x() > 0.7;
    if (std::abs(center.x() - center.y()) > 0.03 || std::abs(center.x() - 0.5) > 0.15) continue;
    for (int i = 0; i < 4; ++i) {
      Vector3 edge =
          (quads.positions.row(quads.quads(q, (i + 1) % 4)) - quads.positions.row(quads.quads(q, i))).transpose();
      edge.z() = 0;
      ++near;
      along += std::abs(std::abs(edge.normalized().x()) - std::sqrt(0.5)) < 0.2;  // within about 17° of a diagonal
    }
  }
  std::printf("%d quads: %d on the left, %d on the right; %d of %d edges under the stroke follow it\n",
              quads.quad_count(), left, right, along, near);
  return right > 2 * left && 10 * along > 8 * near ? 0 : 1;
}
