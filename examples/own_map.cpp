// A map of one's own to quads: vertices, faces and texture coordinates that another program made, checked, completed to
// whole numbers and extracted.
#include <cstdio>

#include "quadrig/quads/from_uv.hpp"

using namespace quadrig;

int main() {
  // A paper cone, three quarters of a disc: its flat sector is a seamless map with one singular vertex of valence 3,
  // the tip, and a seam across which coordinates turn by a quarter. The outside is a square with a corner missing.
  constexpr Index n = 12;  // triangles along a side
  Eigen::MatrixXd v(1, 3), uv(0, 2);
  Eigen::MatrixXi f(6 * n * n, 3), f_uv(6 * n * n, 3);
  v.row(0).setZero();
  const auto vertex = [&](int side, Index i, Index j) -> Index {  // three squares around the tip, i and j from it
    if (i == 0 && j == 0) return 0;
    if (i == 0) return 1 + (side + 1) % 3 * n * (n + 1) + j - 1;  // the next one's edge
    return 1 + side * n * (n + 1) + j * n + i - 1;
  };
  v.resize(1 + 3 * n * (n + 1), 3);
  v.row(0) << 0, 0, 1;
  for (int side = 0; side < 3; ++side)
    for (Index j = 0; j <= n; ++j)
      for (Index i = 1; i <= n; ++i) {
        const double angle = (side + std::atan2(j, i) / (std::numbers::pi / 2)) * 2 * std::numbers::pi / 3;
        const double radius = std::hypot(i, j) / n;
        v.row(vertex(side, i, j)) << radius * std::cos(angle), radius * std::sin(angle), 1 - 0.6 * radius;
      }
  Index face = 0;
  for (int side = 0; side < 3; ++side)
    for (Index j = 0; j < n; ++j)
      for (Index i = 0; i < n; ++i) {
        const std::array<std::array<Index, 2>, 4> corner{{{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}};
        uv.conservativeResize(uv.rows() + 4, 2);
        for (Index k = 0; k < 4; ++k)
          uv.row(uv.rows() - 4 + k) << 7.3 * corner[static_cast<std::size_t>(k)][0] / n,
              7.3 * corner[static_cast<std::size_t>(k)][1] / n;
        for (const std::array<Index, 3> triangle : {std::array<Index, 3>{0, 1, 2}, {0, 2, 3}}) {
          for (int k = 0; k < 3; ++k) {
            const auto& [a, b] = corner[static_cast<std::size_t>(triangle[static_cast<std::size_t>(k)])];
            f(face, k) = vertex(side, a, b);
            f_uv(face, k) = static_cast<Index>(uv.rows()) - 4 + triangle[static_cast<std::size_t>(k)];
          }
          ++face;
        }
      }

  Context context;
  const auto quads = quads_from_uv(v, f, uv, f_uv, UvQuadsOptions{}, context);  // 7.3 a side: integers are found
  if (!quads) return std::fprintf(stderr, "%s\n", quads.error().message().c_str()), 1;
  std::printf("%d quads, %s\n", quads->mesh.quad_count(), quads->own_grid ? "the map's own" : "integers found");

  uv.row(f_uv(5, 0)) += Eigen::RowVector2d(0.2, 0);  // no longer seamless
  const auto refused = quads_from_uv(v, f, uv, f_uv, UvQuadsOptions{}, context);
  if (refused) return 1;
  std::printf("refused: %s\n", refused.error().message().c_str());
  return std::abs(quads->mesh.quad_count() - 3 * 7.3 * 7.3) < 16 ? 0 : 1;
}
