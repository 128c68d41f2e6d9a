#include "quadrig/subdivision.hpp"

#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// The share of a vertex of the cage in a vertex of what it becomes.
double share(const Subdivision& subdivision, Index of, Index in) {
  return subdivision.stencils.coeff(subdivision.vertex[at(in)], of);
}
Subdivision subdivided(const Grid& grid, const SubdivisionOptions& options = {}) {
  Expected<Subdivision> made = subdivide(grid.quads(), grid.vertex_count(), options);
  REQUIRE(made);
  return std::move(*made);
}

}  // namespace

#define NEEDS_SUBDIVISION                      \
  if (!can_subdivide()) {                      \
    WARN("skipped: built without OpenSubdiv"); \
    return;                                    \
  }

TEST_CASE("subdivision: vertices of a regular cage have Catmull-Clark's limit", "[subdivision][fast]") {
  NEEDS_SUBDIVISION
  const Grid grid{6, 6};
  const Index v = grid.vertex(3, 3);
  for (const int levels : {1, 2, 3}) {
    const Subdivision s = subdivided(grid, {.levels = levels, .creases = {}});
    CHECK(s.quads.rows() == 36 << (2 * levels));
    CHECK(share(s, v, v) == Approx(16 / 36.0));
    CHECK(share(s, grid.vertex(2, 3), v) == Approx(4 / 36.0));
    CHECK(share(s, grid.vertex(2, 2), v) == Approx(1 / 36.0));
    for (Eigen::Index row = 0; row < s.stencils.rows(); ++row) CHECK(s.stencils.row(row).sum() == Approx(1));
  }
  // one step, not the limit: (9 v + 6/4 Σ edges + 1/4 Σ faces) / 16
  const Subdivision step = subdivided(grid, {.levels = 1, .limit = false, .creases = {}});
  CHECK(share(step, v, v) == Approx(9 / 16.0));
  CHECK(share(step, grid.vertex(2, 3), v) == Approx(1.5 / 16));
  CHECK(share(step, grid.vertex(2, 2), v) == Approx(0.25 / 16));
}

TEST_CASE("subdivision: borders and creases are splines of their own vertices, corners stay", "[subdivision][fast]") {
  NEEDS_SUBDIVISION
  const Grid grid{6, 6};
  std::vector<std::array<Index, 2>> crease;
  for (Index j = 0; j < 6; ++j) crease.push_back({grid.vertex(3, j), grid.vertex(3, j + 1)});
  const Subdivision s = subdivided(grid, {.creases = crease});
  CHECK(share(s, grid.vertex(0, 0), grid.vertex(0, 0)) == Approx(1));
  for (const auto& [v, before, after] : {std::array{grid.vertex(0, 3), grid.vertex(0, 2), grid.vertex(0, 4)},
                                         std::array{grid.vertex(3, 3), grid.vertex(3, 2), grid.vertex(3, 4)}}) {
    CHECK(share(s, v, v) == Approx(4 / 6.0));
    CHECK(share(s, before, v) == Approx(1 / 6.0));
    CHECK(share(s, after, v) == Approx(1 / 6.0));
  }
}

TEST_CASE("subdivision: parents cover their quads; a flat cage stays where it is", "[subdivision][fast]") {
  NEEDS_SUBDIVISION
  const Grid grid{3, 4};
  const Subdivision s = subdivided(grid);
  const Points<double> cage = grid.positions([](Index i, Index j) { return Vector3(double(i), 2.0 * j, 1); });
  const Points<double> points = s.stencils * cage;
  for (Eigen::Index q = 0; q < s.quads.rows(); ++q) {
    Vector3 least = Vector3::Constant(10), most = -least;
    for (int i = 0; i < 4; ++i) {
      const Vector3 p = cage.row(grid.quads()(s.parent[at(static_cast<Index>(q))], i)).transpose();
      least = least.cwiseMin(p), most = most.cwiseMax(p);
    }
    for (int i = 0; i < 4; ++i) {
      const Vector3 p = points.row(s.quads(q, i)).transpose();
      CHECK(p.z() == Approx(1));
      // The corners of the cage draw lines in at most a quarter of a quad.
      CHECK((p.array() >= least.array() - 0.51).all());
      CHECK((p.array() <= most.array() + 0.51).all());
    }
  }
  CHECK(subdivide(grid.quads(), grid.vertex_count(), {.levels = 0, .creases = {}}).error().code ==
        ErrorCode::bad_option);
}
