#include <fstream>
#include <map>
#include <set>

#include "quadrig/io.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/guides.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A ring about the upright axis through a point of the axis.
Guide ring(double height, double radius, Index corners = 40) {
  Guide guide;
  guide.closed = true;
  for (Index k = 0; k < corners; ++k) {
    const double angle = 2 * std::numbers::pi * k / corners;
    guide.points.emplace_back(radius * std::cos(angle), height, radius * std::sin(angle));
  }
  return guide;
}
/// Closed walks straight on over vertices of four quads that stay within `near` of a height: loops of edges there.
Index rings_at(const QuadMesh& mesh, double height, double near) {
  std::map<std::pair<Index, Index>, std::pair<Index, Index>> right;  // edge: the quad and side that has it
  for (Index q = 0; q < mesh.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) right[{mesh.quads(q, i), mesh.quads(q, (i + 1) % 4)}] = {q, i};
  std::set<std::pair<Index, Index>> walked;
  Index rings = 0;
  for (const auto& [start, unused] : right) {
    if (walked.count(start)) continue;
    std::pair<Index, Index> edge = start;
    bool inside = true;
    do {
      walked.insert(edge);
      inside = inside && std::abs(mesh.positions(edge.second, 1) - height) < near;
      // Past two quads at the far end: the side after this one, across it, and the side after that.
      const auto [q, i] = right.at(edge);
      const std::pair<Index, Index> side{mesh.quads(q, (i + 1) % 4), mesh.quads(q, (i + 2) % 4)};
      const auto across = right.find({side.second, side.first});
      if (across == right.end()) {
        inside = false;
        break;
      }
      const auto [p, j] = across->second;
      edge = {mesh.quads(p, (j + 1) % 4), mesh.quads(p, (j + 2) % 4)};
    } while (inside && edge != start);
    rings += inside;
  }
  return rings / 2;  // each is walked both ways
}

}  // namespace

TEST_CASE("guides: a closed one becomes a loop of edges of quads", "[guides]") {
  Context context;
  const auto pear = make_sample("pear", 4000, context);
  REQUIRE(pear);
  const Points<double>& points = pear->mesh.positions();
  const double low = points.col(1).minCoeff(), high = points.col(1).maxCoeff(), height = low + 0.37 * (high - low);
  double radius = 0;
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    if (std::abs(points(v, 1) - height) < 0.03 * (high - low))
      radius = std::max(radius, std::hypot(points(v, 0), points(v, 2)));
  RemeshOptions options;
  options.quads = 600;
  options.symmetry = SymmetryChoice::none;
  options.guides = {ring(height, radius)};
  const auto result = remesh(*pear, options, context);
  REQUIRE(result);
  CHECK(result->report.components[0].kept_length > 0.9 * 2 * std::numbers::pi * radius);
  CHECK(result->report.components[0].kept_as_quads > 0.95 * result->report.components[0].kept_length);
  CHECK(rings_at(result->mesh, height, 0.02 * (high - low)) == 1);
  CHECK(result->report.scaled_jacobian_minimum > 0.2);
}

TEST_CASE("guides: a soft one turns the directions near it", "[guides]") {
  // A ball has no directions of its own: edges run along a slanted line where that pulls.
  Context context;
  const auto pear = make_sample("pear", 3000, context);
  REQUIRE(pear);
  Asset bare = *pear;
  bare.rig.reset();
  const Points<double>& points = bare.mesh.positions();
  const double low = points.col(1).minCoeff(), size = points.col(1).maxCoeff() - low;
  Guide guide;
  guide.width = 0.15 * size;
  guide.weight = 20;
  const quadrig::ClosestPoint closest(bare.mesh);
  for (int k = -5; k <= 5; ++k)
    guide.points.push_back(
        closest.closest({0.04 * size * k, low + 0.35 * size + 0.04 * size * k, 0.4 * size}).position);
  RemeshOptions options;
  options.quads = 800;
  const auto turn = [&](const RemeshResult& result) {
    // Mean angle between the guide and the nearer edge of the quads beside it, degrees.
    double sum = 0;
    Index count = 0;
    for (Index q = 0; q < result.mesh.quad_count(); ++q) {
      const auto corner = [&](int i) {
        return Vector3(result.mesh.positions.row(result.mesh.quads(q, i)).transpose());
      };
      const Vector3 centre = (corner(0) + corner(1) + corner(2) + corner(3)) / 4;
      for (std::size_t k = 1; k < guide.points.size(); ++k) {
        if ((centre - guide.points[k]).norm() > 0.06 * size) continue;
        const Vector3 along = (guide.points[k] - guide.points[k - 1]).normalized();
        const double cosine = std::max(std::abs(along.dot((corner(1) - corner(0)).normalized())),
                                       std::abs(along.dot((corner(2) - corner(1)).normalized())));
        sum += std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
        ++count;
        break;
      }
    }
    return count > 5 ? sum / count : 90.0;
  };
  const auto free = remesh(bare, options, context);
  REQUIRE(free);
  options.guides = {guide};
  const auto led = remesh(bare, options, context);
  REQUIRE(led);
  const double before = turn(*free), after = turn(*led);
  CHECK(after < 12);
  CHECK(after < 0.7 * before);
}

TEST_CASE("guides: bad ones are refused by number", "[guides][fast]") {
  Context context;
  const auto pear = make_sample("pear", 1000, context);
  REQUIRE(pear);
  RemeshOptions options;
  options.guides = {ring(0, 1), Guide{}};
  const auto refused = remesh(*pear, options, context);
  REQUIRE(!refused);
  CHECK(refused.error().where == "guides, 1");
}

TEST_CASE("guides: lines of an OBJ are joined to curves, closed ones too", "[guides][io][fast]") {
  const ScratchFolder folder("guides");
  std::ofstream(folder / "g.obj") << "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 1 2 0\nl 2 3\nl 1 2\nl 4 5 6 4\n";
  Context context;
  const auto lines = read_lines(folder / "g.obj", {}, context);
  REQUIRE(lines);
  REQUIRE(lines->size() == 2);
  CHECK(lines->front().points.size() == 3);
  CHECK(!lines->front().closed);
  CHECK(lines->back().points.size() == 3);
  CHECK(lines->back().closed);
  std::ofstream(folder / "none.obj") << "v 0 0 0\nv 1 0 0\n";
  CHECK(!read_lines(folder / "none.obj", {}, context));
}
