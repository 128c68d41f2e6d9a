// Weights as files have them, mended.
#include <algorithm>
#include <numeric>

#include "gather.hpp"

namespace quadrig {

std::vector<std::string> GltfRepairs::sentences() const {
  std::vector<std::string> all;
  const auto tell = [&](Index count, const std::string& what) {
    if (count > 0) all.push_back(std::to_string(count) + " " + what);
  };
  tell(bad_weights, "weights that are no weights of a joint of the skin, left out");
  tell(unweighted, "vertices without weights, which follow their neighbours");
  tell(rescaled, "vertices whose weights did not sum to 1, rescaled");
  tell(singular_binds, "inverse bind matrices that cannot be inverted, taken from the nodes");
  tell(bind_rows, "inverse bind matrices whose last row is not 0 0 0 1, set so");
  tell(loose_roots, "trees of joints without a common root in the scenes of the skin, given one");
  return all;
}

namespace gltf {

VertexWeights mend_weights(RawWeights raw, const Triangles& triangles, const Points<double>& positions, Index joints,
                           GltfRepairs& repairs) {
  const std::size_t count = raw.rows.size();
  std::vector<std::size_t> bare;
  for (std::size_t v = 0; v < count; ++v) {
    auto& row = raw.rows[v];
    const std::size_t had = row.size();
    std::erase_if(row, [joints](const auto& entry) {
      return !(entry.second > 0) || !std::isfinite(entry.second) || entry.first < 0 || entry.first >= joints;
    });
    repairs.bad_weights += static_cast<Index>(had - row.size());
    double sum = 0;
    for (const auto& entry : row) sum += entry.second;
    if (!(sum > 0)) {
      bare.push_back(v);
      row.clear();
      continue;
    }
    if (std::abs(sum - 1) > 1e-3) ++repairs.rescaled;
    for (auto& entry : row) entry.second /= sum;
  }
  if (!bare.empty()) {
    repairs.unweighted += static_cast<Index>(bare.size());
    // Steps along triangles, and between vertices at one position, from what has weights to what has none.
    std::vector<std::size_t> by_place(count);
    std::iota(by_place.begin(), by_place.end(), std::size_t{0});
    const auto place = [&](std::size_t v) { return positions.row(static_cast<Eigen::Index>(v)); };
    const auto before = [&](std::size_t a, std::size_t b) {
      for (int k = 0; k < 3; ++k)
        if (place(a)[k] != place(b)[k]) return place(a)[k] < place(b)[k];
      return false;
    };
    std::stable_sort(by_place.begin(), by_place.end(), before);
    std::vector<std::size_t> point(count);
    std::size_t points = 0;
    for (std::size_t k = 0; k < count; ++k) {
      if (k > 0 && before(by_place[k - 1], by_place[k])) ++points;
      point[by_place[k]] = points;
    }
    points += count > 0 ? 1 : 0;
    std::vector<std::vector<std::size_t>> beside(points);
    for (Index t = 0; t < triangles.rows(); ++t)
      for (int i = 0; i < 3; ++i) {
        const std::size_t a = point[at(triangles(t, i))], b = point[at(triangles(t, (i + 1) % 3))];
        beside[a].push_back(b);
        beside[b].push_back(a);
      }
    constexpr std::size_t nobody = static_cast<std::size_t>(-1);
    std::vector<std::size_t> giver(points, nobody), queue;  // a vertex whose weights the point takes
    for (std::size_t v = 0; v < count; ++v)
      if (!raw.rows[v].empty() && giver[point[v]] == nobody) {
        giver[point[v]] = v;
        queue.push_back(point[v]);
      }
    for (std::size_t k = 0; k < queue.size(); ++k)
      for (const std::size_t next : beside[queue[k]])
        if (giver[next] == nobody) {
          giver[next] = giver[queue[k]];
          queue.push_back(next);
        }
    for (const std::size_t v : bare) {
      const std::size_t from = giver[point[v]];
      if (from == nobody)
        raw.rows[v].emplace_back(0, 1.0);  // a shell without any weights follows the first joint
      else
        raw.rows[v] = raw.rows[from];
    }
  }
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t v = 0; v < count; ++v)
    for (const auto& [joint, weight] : raw.rows[v]) entries.emplace_back(static_cast<Index>(v), joint, weight);
  VertexWeights weights(static_cast<Index>(count), joints);
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

}  // namespace gltf
}  // namespace quadrig
