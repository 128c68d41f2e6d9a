// Sizes that change no faster along the surface than quads of them can follow.
#pragma once

#include <queue>

#include "quadrig/mesh.hpp"

namespace quadrig {

namespace detail {

/// Makes sizes grow by no more than a limit, on one mesh as often as wanted.
class SizeGrader {
 public:
  explicit SizeGrader(const TriangleMesh<double>& mesh) : mesh_(mesh), half_(at(mesh.halfedge_count())) {
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      const auto t = mesh.faces().row(h / 3);
      const Vector3 centre = (mesh.position(t[0]) + mesh.position(t[1]) + mesh.position(t[2])) / 3;
      half_[at(h)] = (centre - 0.5 * (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h)))).norm();
    }
  }

  /// The sizes are invalid once the context is cancelled.
  void grade(std::vector<double>& sizes, double limit, const Context* context) const {
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    const auto across = [&](Index f, auto&& visit) {
      for (Index h = 3 * f; h < 3 * f + 3; ++h)
        if (const Index twin = mesh_.twin(h); twin != no_index)
          visit(twin / 3, sizes[at(f)] + limit * (half_[at(h)] + half_[at(twin)]));
    };
    const auto cancelled = [&](Index step) { return step % 65536 == 0 && context && context->cancelled(); };
    // Only faces that hold a neighbour down start the search.
    for (Index f = 0; f < mesh_.face_count(); ++f) {
      if (cancelled(f)) return;
      bool holds = false;
      across(f, [&](Index g, double bound) { holds = holds || bound < sizes[at(g)]; });
      if (holds) queue.push({sizes[at(f)], f});
    }
    for (Index step = 0; !queue.empty(); step = (step + 1) % 65536) {
      if (cancelled(step)) return;
      const auto [size, f] = queue.top();
      queue.pop();
      if (size > sizes[at(f)]) continue;
      across(f, [&](Index g, double bound) {
        if (bound < sizes[at(g)]) {
          sizes[at(g)] = bound;
          queue.push({bound, g});
        }
      });
    }
  }

 private:
  const TriangleMesh<double>& mesh_;
  std::vector<double> half_;  // from the centre of a half-edge's face to the edge's middle
};

}  // namespace detail

/// Sizes that grow by at most `limit` of themselves over their own length: the largest field that nowhere exceeds
/// `sizes` (a length a face) and has |size_f − size_g| ≤ limit · distance, distances measured through edge midpoints.
/// \pre sizes > 0, limit > 0. \cost O(m log m) (Dijkstra). \fails never.
[[nodiscard]] inline std::vector<double> graded_sizes(const TriangleMesh<double>& mesh, std::vector<double> sizes,
                                                      double limit = 0.3) {
  assert(sizes.size() == static_cast<std::size_t>(mesh.face_count()));
  detail::SizeGrader(mesh).grade(sizes, limit, nullptr);
  return sizes;
}

/// The same for a relative density at `count` quads on the whole surface: returns relative densities with mean 1 whose
/// sizes √A are graded; invalid once cancelled. \pre density > 0, count > 0. \cost a few Dijkstra runs
[[nodiscard]] inline std::vector<double> graded_density(const TriangleMesh<double>& mesh,
                                                        const std::vector<double>& density, double count,
                                                        double limit = 0.3, const Context& context = {}) {
  const double area = mesh.total_area();
  const detail::SizeGrader grader(mesh);
  std::vector<double> graded(density.size());
  double factor = 1;
  // Grading only makes quads smaller, and smaller quads are graded more: a few rounds settle the count.
  for (int round = 0; round < 12; ++round) {
    if (round > 0 && context.cancelled()) break;
    for (std::size_t f = 0; f < density.size(); ++f) graded[f] = factor * std::sqrt(area / (count * density[f]));
    grader.grade(graded, limit, &context);
    double quads = 0;
    for (std::size_t f = 0; f < density.size(); ++f)
      quads += mesh.area(static_cast<Index>(f)) / (graded[f] * graded[f]);
    factor *= std::sqrt(quads / count);
    if (std::abs(quads / count - 1) < 1e-3) break;
  }
  double mean = 0;
  for (std::size_t f = 0; f < density.size(); ++f) {
    graded[f] = 1 / (graded[f] * graded[f]);
    mean += mesh.area(static_cast<Index>(f)) * graded[f];
  }
  for (double& d : graded) d *= area / mean;
  return graded;
}

}  // namespace quadrig
