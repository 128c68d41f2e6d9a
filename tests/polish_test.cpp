#include "quadrig/polish.hpp"
#include "corpus/synthetic.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A surface and quads on it: every second vertex of a grid's, thrown about inside the triangles around it.
struct Rough {
  TriangleMesh<double> mesh;
  QuadMesh quads;
};
Rough rough(bool open, double amount, std::uint64_t seed) {
  Grid fine{48, 32, !open, !open}, coarse{12, 8, !open, !open};
  const auto shape = [&](double s, double t) {
    if (open) return Vector3(3 * s, 2 * t, 0.3 * std::sin(4 * s) * t);
    const double a = 2 * std::numbers::pi * s, b = 2 * std::numbers::pi * t, r = 1 + 0.4 * std::cos(b);
    return Vector3(r * std::cos(a), r * std::sin(a), 0.4 * std::sin(b));
  };
  Rough out{build(fine.positions([&](Index i, Index j) { return shape(i / 48.0, j / 32.0); }), fine.triangles()), {}};
  Random random(seed);
  out.quads.quads = coarse.quads();
  out.quads.positions.resize(coarse.vertex_count(), 3);
  for (Index j = 0; j < (coarse.wrap_rows ? 8 : 9); ++j)
    for (Index i = 0; i < (coarse.wrap_columns ? 12 : 13); ++i) {
      const Index v = coarse.vertex(i, j), w = fine.vertex(4 * i, 4 * j);
      Index h = out.mesh.outgoing(w);
      SurfacePoint s{h / 3, Vector3::Zero()};
      const bool border = out.mesh.on_boundary(w);
      const bool corner = border && (i == 0 || i == 12) && (j == 0 || j == 8);
      const double push = corner ? 0.0 : amount * random.number();
      if (border) {  // along the border edge that leaves w
        s.barycentric[h % 3] = 1 - push;
        s.barycentric[(h % 3 + 1) % 3] = push;
      } else {
        for (int turns = static_cast<int>(random.number(0, 6)); turns > 0; --turns) h = out.mesh.next_around(h);
        s.face = h / 3;
        s.barycentric[h % 3] = 1 - push;
        s.barycentric[(h % 3 + 1) % 3] = push * 0.5;
        s.barycentric[(h % 3 + 2) % 3] = push * 0.5;
      }
      out.quads.source.resize(std::max(out.quads.source.size(), at(v) + 1));
      out.quads.source[at(v)] = s;
      out.quads.positions.row(v) = position(out.mesh, s).transpose();
    }
  return out;
}

double least(const QuadMesh& quads) {
  double worst = 1;
  for (Index q = 0; q < quads.quad_count(); ++q)
    worst = std::min(worst, scaled_jacobian(quads.positions, quads.quads.row(q)));
  return worst;
}

/// Polishes in place.
PolishReport polish_in_place(Rough& r, const PolishOptions& options, Context& context) {
  PolishedQuads polished = polish(r.mesh, options, std::move(r.quads), context);
  r.quads = std::move(polished.mesh);
  return polished.report;
}

}  // namespace

TEST_CASE("polish: never inverts, never makes the worst worse, stays on the surface", "[polish]") {
  const bool open = GENERATE(false, true);
  const std::uint64_t seed = GENERATE(1U, 2U, 3U);
  Rough r = rough(open, 0.9, seed);
  const double before = least(r.quads);
  REQUIRE(before > 0);
  Context context;
  const PolishReport report = polish_in_place(r, PolishOptions{}, context);
  CHECK(report.least_before == before);
  CHECK(report.least_after == least(r.quads));
  CHECK(report.least_after >= std::min(before, PolishOptions{}.accepted));
  CHECK(report.average_after > report.average_before);
  for (Index v = 0; v < r.quads.vertex_count(); ++v) {
    const SurfacePoint& s = r.quads.source[at(v)];
    CHECK((position(r.mesh, s) - r.quads.positions.row(v).transpose()).norm() < 1e-12);
    CHECK(s.barycentric.minCoeff() >= 0);
    CHECK(s.barycentric.sum() == quadrig::test::Approx(1));
  }
}

TEST_CASE("polish: border vertices stay on the border, its corners where they are", "[polish]") {
  Rough r = rough(true, 0.9, 4);
  const Points<double> before = r.quads.positions;
  Context context;
  (void)polish_in_place(r, PolishOptions{}, context);
  const Grid coarse{12, 8};
  for (Index j = 0; j <= 8; ++j)
    for (Index i = 0; i <= 12; ++i) {
      const bool side = i == 0 || i == 12, end = j == 0 || j == 8;
      const auto p = r.quads.positions.row(coarse.vertex(i, j));
      if (i == 0) CHECK(std::abs(p[0]) < 1e-12);
      if (i == 12) CHECK(std::abs(p[0] - 3) < 1e-12);
      if (j == 0) CHECK(std::abs(p[1]) < 1e-12);
      if (j == 8) CHECK(std::abs(p[1] - 2) < 1e-12);
      if (side && end) CHECK((p - before.row(coarse.vertex(i, j))).norm() == 0);
    }
}

TEST_CASE("polish: an inverted quad is freed", "[polish]") {
  Rough r = rough(false, 0, 1);
  // One vertex put beyond its neighbour's place.
  const Grid coarse{12, 8, true, true};
  const Index v = coarse.vertex(5, 4), w = coarse.vertex(6, 4);
  r.quads.source[at(v)] = r.quads.source[at(w)];
  const Index h = r.mesh.outgoing(r.mesh.faces()(r.quads.source[at(w)].face, 0));
  r.quads.source[at(v)] = {h / 3, Vector3(0.2, 0.4, 0.4)};
  r.quads.positions.row(v) = position(r.mesh, r.quads.source[at(v)]).transpose();
  REQUIRE(least(r.quads) <= 0);
  Context context;
  CHECK(polish_in_place(r, PolishOptions{}, context).least_after > 0.5);
}

TEST_CASE("polish: a quad that is folded over is poor, however even it is", "[polish]") {
  Rough r = rough(false, 0, 1);
  CHECK_FALSE(turned_over(r.mesh, r.quads, 5));
  // The same corners the other way round.
  std::swap(r.quads.quads(5, 1), r.quads.quads(5, 3));
  CHECK(turned_over(r.mesh, r.quads, 5));
  CHECK(scaled_jacobian(r.quads.positions, r.quads.quads.row(5)) > 0.5);
  Context context;
  PolishOptions options;
  options.rounds = 0;
  CHECK(polish_in_place(r, options, context).least_after < 0.1);
}

TEST_CASE("polish: a quad at a sharp corner of the border is as good as the corner allows", "[polish][fast]") {
  // A kite of 2.3° at its tip and 11.4° at its tail.
  Points<double> corners(4, 3);
  corners << 0, 0, 0, 1, -0.02, 0, 1.2, 0, 0, 1, 0.02, 0;
  Triangles faces(2, 3);
  faces << 0, 1, 3, 1, 2, 3;
  Rough r{TriangleMesh<double>::create(corners, faces).value(), {}};
  r.quads.positions = corners;
  r.quads.quads.resize(1, 4);
  r.quads.quads << 0, 1, 2, 3;
  for (Index v = 0; v < 4; ++v) {
    const Index h = r.mesh.outgoing(v);
    r.quads.source.push_back({h / 3, Vector3::Unit(h % 3)});
  }
  REQUIRE(least(r.quads) < 0.05);
  Context context;
  const PolishReport report = polish_in_place(r, PolishOptions{}, context);
  CHECK(report.least_before > 0.9);
  CHECK(report.rounds < PolishOptions{}.rounds);
  // Within the surface nothing is allowed for.
  const Grid grid{2, 2};
  r.mesh = build(grid.positions([&](Index i, Index j) { return Vector3(i - 1, 0.02 * (j - 1), 0); }), grid.triangles());
  r.quads.positions *= 0.5;
  for (Index v = 0; v < 4; ++v) {
    const SurfaceHit hit = ClosestPoint(r.mesh).closest(r.quads.positions.row(v).transpose());
    r.quads.source[at(v)] = {hit.face, hit.barycentric};
  }
  CHECK(polish_in_place(r, PolishOptions{.rounds = 0}, context).least_before < 0.05);
}

TEST_CASE("polish: no rounds move nothing, and a cancelled call stops", "[polish]") {
  Rough r = rough(false, 0.8, 2);
  const Points<double> before = r.quads.positions;
  Context context;
  PolishOptions none;
  none.rounds = 0;
  CHECK(polish_in_place(r, none, context).rounds == 0);
  CHECK((r.quads.positions - before).norm() == 0);
  std::atomic<bool> stop{true};
  context.cancel_flag = &stop;
  CHECK(polish_in_place(r, PolishOptions{}, context).rounds == 0);
}
