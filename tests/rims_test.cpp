#include <map>

#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/rims/band.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A round pocket of a ball: about an axis, within an angle of it, so many radii of its opening deep.
struct Hollow {
  Vector3 axis;
  double angle = 0.25, depth = 2;

  [[nodiscard]] double length() const { return 2 * std::numbers::pi * std::sin(angle); }
  /// Where a point of the ball goes: half of the cap becomes the wall, the rest the floor.
  [[nodiscard]] Vector3 operator()(const Vector3& p) const {
    const Vector3 a = axis.normalized(), off = p - p.dot(a) * a;
    const double u = std::acos(std::clamp(p.dot(a), -1.0, 1.0)) / angle, radius = std::sin(angle);
    if (!(u < 1)) return p;
    const Vector3 side = off.norm() > 0 ? Vector3(radius * off.normalized()) : Vector3::Zero().eval();
    const double down = depth * radius * std::min(1.0, 2 - 2 * u);
    return (std::cos(angle) - down) * a + std::min(1.0, 2 * u) * side;
  }
};

/// A ball of radius 1 in 8 · 4^level triangles, with pockets.
TriangleMesh<double> ball(const std::vector<Hollow>& hollows, int level = 5) {
  std::vector<Vector3> points{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  std::vector<std::array<Index, 3>> faces{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                          {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int round = 0; round < level; ++round) {
    std::map<std::pair<Index, Index>, Index> middle;
    const auto between = [&](Index a, Index b) {
      const auto [place, is_new] = middle.try_emplace(std::minmax(a, b), static_cast<Index>(points.size()));
      if (is_new) points.push_back((points[at(a)] + points[at(b)]).normalized());
      return place->second;
    };
    std::vector<std::array<Index, 3>> finer;
    for (const auto& [a, b, c] : faces) {
      const Index x = between(a, b), y = between(b, c), z = between(c, a);
      for (const std::array<Index, 3>& f : {std::array{a, x, z}, {x, b, y}, {z, y, c}, {x, y, z}}) finer.push_back(f);
    }
    faces = std::move(finer);
  }
  Points<double> positions(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v) {
    Vector3 p = points[v];
    for (const Hollow& hollow : hollows) p = hollow(p);
    positions.row(static_cast<Eigen::Index>(v)) = p.transpose();
  }
  Triangles triangles(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    triangles.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
  return TriangleMesh<double>::create(std::move(positions), std::move(triangles)).value();
}

const std::vector<Hollow> face_hollows{{{-0.4, 0.3, 1}}, {{0.4, 0.3, 1}}, {{0, -0.45, 1}, 0.3}};

TriangleMesh<double> moved(const TriangleMesh<double>& mesh, const Eigen::Affine3d& by) {
  Points<double> positions = mesh.positions();
  for (Index v = 0; v < mesh.vertex_count(); ++v) positions.row(v) = (by * mesh.position(v)).transpose();
  return TriangleMesh<double>::create(std::move(positions), Triangles(mesh.faces())).value();
}

}  // namespace

TEST_CASE("rims: two pockets that mirror each other are eyes and one below them is a mouth, however they lie",
          "[rims][fast]") {
  const TriangleMesh<double> mesh = ball(face_hollows);
  Eigen::Affine3d turned = Eigen::Affine3d::Identity();
  turned.rotate(Eigen::AngleAxisd(1.1, Vector3(1, 2, -1).normalized())).scale(7).pretranslate(Vector3(3, -20, 5));
  for (const Eigen::Affine3d& by : {Eigen::Affine3d(Eigen::Affine3d::Identity()), turned}) {
    const double size = std::cbrt(by.linear().determinant());
    const std::vector<Rim> rims = find_rims(moved(mesh, by), nullptr, nullptr, Context{});
    REQUIRE(rims.size() == 3);
    const std::array kinds{RimKind::eye, RimKind::eye, RimKind::mouth};
    for (std::size_t k = 0; k < 3; ++k) {
      const Rim& rim = rims[k];
      CHECK(rim.kind == kinds[k]);
      CHECK(rim.score >= 0.5);
      CHECK(rims[at(rim.twin)].twin == static_cast<Index>(k));
      const Vector3 middle = by.inverse() * rim.centre();
      const auto nearest = std::ranges::min_element(face_hollows, {}, [&](const Hollow& hollow) {
        return (hollow.axis.normalized() * std::cos(hollow.angle) - middle).norm();
      });
      // On the wall, all curves of which are as short: above its middle.
      CHECK((nearest->axis.normalized() * std::cos(nearest->angle) - middle).norm() <
            nearest->depth / 2 * std::sin(nearest->angle));
      CHECK(rim.length == Approx(size * nearest->length()).epsilon(0.1));
      // It faces outwards.
      CHECK((by.linear().inverse() * rim.area()).normalized().dot(nearest->axis.normalized()) > 0.95);
    }
  }
}

TEST_CASE("rims: surfaces without pockets have none", "[rims][fast]") {
  CHECK(find_rims(ball({}, 4), nullptr, nullptr, Context{}).empty());
  CHECK(find_rims(ball({{{0, 0, 1}, 0.25, 0.2}}), nullptr, nullptr, Context{}).empty());  // a dent
  for (const char* name : {"humanoid", "pear", "box_torus"}) {
    Context context;
    const Expected<Asset> made = make_sample(name, 4000, context);
    REQUIRE(made);
    CHECK(find_rims(made->mesh, &*made->rig, nullptr, context).empty());
  }
}

TEST_CASE("rims: the head has two eyes and a mouth", "[rims][slow]") {
  Context context;
  const Expected<Asset> made = make_sample("head", 12000, context);
  REQUIRE(made);
  const std::vector<Rim> rims = find_rims(made->mesh, &*made->rig, nullptr, context);
  REQUIRE(rims.size() >= 3);
  CHECK(rims[0].kind == RimKind::eye);
  CHECK(rims[1].kind == RimKind::eye);
  CHECK(rims[2].kind == RimKind::mouth);
  CHECK(std::abs(rims[0].centre()[0] + rims[1].centre()[0]) < 0.003);
  CHECK(std::abs(rims[2].centre()[0]) < 0.003);
}

TEST_CASE("rims: openness is that of a hole, whatever else stands about", "[rims][fast]") {
  // From the middle of the floor the opening is the part sin² a of the cosine-weighted half space, tan a = 1 / depth.
  const Hollow hollow{{0, 0, 1}, 0.3, 1.5};
  const TriangleMesh<double> mesh = ball({hollow});
  const std::vector<double> open = openness(mesh, Context{});
  const double expected = 1 / (1 + hollow.depth * hollow.depth);
  CHECK(open[4] == Approx(expected).margin(0.03));  // vertex 4 is the pole
  CHECK(open[5] == Approx(1));
}

TEST_CASE("rims: the band of a rim keeps its distance, and its loop closes", "[rims][fast]") {
  const TriangleMesh<double> mesh = ball({});
  Rim rim;
  constexpr double height = 0.6, radius = 0.8, reach = 0.2;
  for (int k = 0; k < 50; ++k) {
    const double angle = 2 * std::numbers::pi * k / 50;
    rim.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), height);
  }
  rim.length = 2 * std::numbers::pi * radius;
  const RimBand band = rim_band(mesh, ClosestPoint(mesh), rim, reach);
  REQUIRE(band.loop);
  for (std::size_t k = 0; k < band.loop->crossed.size(); ++k) {
    const Index out = band.loop->crossed[k], in = band.loop->crossed[(k + 1) % band.loop->crossed.size()];
    CHECK(mesh.twin(out) / 3 == in / 3);
    CHECK(std::abs(crossing(mesh, *band.loop, k)[2] - height) < 0.05);
  }
  double area = 0;
  for (const BandFace& beside : band.faces) {
    const Vector3 p = position(mesh, SurfacePoint{beside.face, Vector3::Constant(1.0 / 3)});
    area += mesh.area(beside.face);
    CHECK(beside.distance <= reach);
    CHECK(std::abs(beside.along.dot(p.cross(Vector3::UnitZ()).normalized())) > 0.98);
  }
  CHECK(area == Approx(2 * std::numbers::pi * 2 * reach * radius).epsilon(0.1));  // a zone, nearly
  // Of half of the surface half of the band, and no loop.
  std::vector<Index> half;
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (position(mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)})[0] > 0) half.push_back(f);
  const Asset part = quadrig::detail::make_piece({mesh, {}}, half).asset;
  const RimBand arc = rim_band(part.mesh, ClosestPoint(part.mesh), rim, reach);
  CHECK_FALSE(arc.loop);
  CHECK(static_cast<double>(arc.faces.size()) == Approx(static_cast<double>(band.faces.size()) / 2).epsilon(0.15));
}

TEST_CASE("rims: rings close round openings, on whole surfaces and on mirrored ones", "[rims][slow]") {
  Context context;
  Asset asset{ball(face_hollows), {}};
  RemeshOptions options;
  options.quads = 3000;
  options.rims.kinds = {RimKind::eye, RimKind::mouth};
  for (const SymmetryChoice choice : {SymmetryChoice::none, SymmetryChoice::automatic}) {
    options.symmetry = choice;
    const Expected<RemeshResult> result = remesh(asset, options, context);
    REQUIRE(result);
    REQUIRE(result->report.rims.size() == 3);
    Index closed = 0;
    for (const RimReport& rim : result->report.rims) {
      CHECK(rim.wanted == 3);
      CHECK(rim.loops >= 2);  // rounding to whole rows may push one out of the band
      CHECK(rim.around >= 10);
      closed += std::min(rim.loops, rim.wanted);
    }
    CHECK(closed >= 8);
    CHECK(result->report.scaled_jacobian_minimum > 0.2);
    CHECK(result->report.quads == Approx(options.quads).epsilon(0.05));
  }
  // Where there is no room they are let go, and the warning tells the count that has it.
  options.quads = 300;
  const Expected<RemeshResult> few = remesh(asset, options, context);
  REQUIRE(few);
  for (const RimReport& rim : few->report.rims) CHECK(rim.quads_for > options.quads);
  CHECK(std::ranges::any_of(few->report.warnings, [](const Warning& warning) {
    return warning.text.find("eye") != std::string::npos && warning.text.find("have room") != std::string::npos;
  }));
}
