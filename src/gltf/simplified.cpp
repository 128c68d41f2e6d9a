#include "simplified.hpp"

#if defined(QUADRIG_WITH_MESHOPTIMIZER)
#include <meshoptimizer.h>

#include <map>
#endif

namespace quadrig::gltf {

#if !defined(QUADRIG_WITH_MESHOPTIMIZER)

std::vector<Polygon> simplified(std::span<const Polygon>, const Points<double>&, Index) { return {}; }

#else

std::vector<Polygon> simplified(std::span<const Polygon> triangles, const Points<double>& positions, Index wanted) {
  // Corners that are alike are one vertex; others at one place make a seam for the simplifier, which keeps it.
  struct Corner {
    Index vertex, wedge, primitive;
  };
  std::map<std::array<Index, 3>, unsigned> number;
  std::vector<Corner> corners;
  std::vector<unsigned> indices;
  std::vector<float> places;
  const Eigen::RowVector3d middle =
      triangles.empty() ? Eigen::RowVector3d::Zero() : Eigen::RowVector3d(positions.row(triangles[0].vertex[0]));
  for (const Polygon& p : triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [known, is_new] =
          number.try_emplace(std::array{p.vertex[i], p.wedge[i], p.primitive}, static_cast<unsigned>(corners.size()));
      indices.push_back(known->second);
      if (!is_new) continue;
      corners.push_back({p.vertex[i], p.wedge[i], p.primitive});
      for (int k = 0; k < 3; ++k) places.push_back(static_cast<float>(positions(p.vertex[i], k) - middle[k]));
    }
  constexpr float any_error = 1;
  std::vector<unsigned> fewer(indices.size());
  fewer.resize(meshopt_simplify(fewer.data(), indices.data(), indices.size(), places.data(), corners.size(),
                                3 * sizeof(float), 3 * static_cast<std::size_t>(std::max<Index>(wanted, 1)), any_error,
                                meshopt_SimplifyLockBorder));
  std::vector<Polygon> result;
  for (std::size_t t = 0; t + 2 < fewer.size(); t += 3) {
    Polygon& p = result.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      p.vertex[i] = corners[fewer[t + i]].vertex;
      p.wedge[i] = corners[fewer[t + i]].wedge;
    }
    p.primitive = corners[fewer[t]].primitive;
  }
  return result;
}

#endif

}  // namespace quadrig::gltf
