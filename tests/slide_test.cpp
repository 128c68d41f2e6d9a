#include "quadrig/fit.hpp"

#include "quadrig/pipeline.hpp"
#include "quadrig/skinning.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A sheet over [0, 3] × [0, 2] and quads on every few of its vertices.
struct Sheet {
  TriangleMesh<double> mesh;
  QuadMesh quads;
};
template <class Height>
Sheet sheet(Index columns, Index rows, Index every, Height&& height) {
  const Grid fine{columns * every, rows * every}, coarse{columns, rows};
  const auto place = [&](double i, double j) {
    const double x = 3 * i / static_cast<double>(fine.columns), y = 2 * j / static_cast<double>(fine.rows);
    return Vector3(x, y, height(x, y));
  };
  Sheet out{
      build(fine.positions([&](Index i, Index j) { return place(static_cast<double>(i), static_cast<double>(j)); }),
            fine.triangles()),
      {}};
  out.quads.quads = coarse.quads();
  out.quads.positions.resize(coarse.vertex_count(), 3);
  for (Index j = 0; j <= rows; ++j)
    for (Index i = 0; i <= columns; ++i) {
      const Index h = out.mesh.outgoing(fine.vertex(i * every, j * every));
      SurfacePoint s{h / 3, Vector3::Zero()};
      s.barycentric[h % 3] = 1;
      out.quads.source.push_back(s);
      out.quads.positions.row(coarse.vertex(i, j)) = position(out.mesh, s).transpose();
    }
  return out;
}
double wave(double x, double y) { return 0.3 * std::tanh(6 * (x - 1.4 + 0.2 * y)); }
double roof(double x, double) { return -0.6 * std::abs(x - 1.55); }

/// Root mean square distance from the quads, by 7 × 7 points each, to the surface.
double straying(const Sheet& s) {
  const ClosestPoint closest(s.mesh);
  double sum = 0, area = 0;
  for (Index q = 0; q < s.quads.quad_count(); ++q) {
    const auto p = [&](int i) { return Vector3(s.quads.positions.row(s.quads.quads(q, i)).transpose()); };
    const double share = (p(2) - p(0)).cross(p(3) - p(1)).norm() / 2 / 49;
    for (int k = 0; k < 49; ++k) {
      const double u = (k % 7 + 0.5) / 7, v = (k / 7 + 0.5) / 7;
      const Vector3 at_uv = (1 - v) * ((1 - u) * p(0) + u * p(1)) + v * ((1 - u) * p(3) + u * p(2));
      sum += share * closest.closest(at_uv).squared_distance;
      area += share;
    }
  }
  return std::sqrt(sum / area);
}
double least(const QuadMesh& quads) {
  double worst = 1;
  for (Index q = 0; q < quads.quad_count(); ++q)
    worst = std::min(worst, scaled_jacobian(quads.positions, quads.quads.row(q)));
  return worst;
}
void check_on_surface(const Sheet& s) {
  for (Index v = 0; v < s.quads.vertex_count(); ++v) {
    const SurfacePoint& source = s.quads.source[at(v)];
    CHECK((position(s.mesh, source) - s.quads.positions.row(v).transpose()).norm() < 1e-12);
    CHECK(source.barycentric.minCoeff() >= 0);
  }
}

}  // namespace

TEST_CASE("slide: quads come closer to the surface, stay on it and sound, and the border stays", "[slide][fast]") {
  Sheet s = sheet(12, 8, 8, wave);
  const QuadMesh start = s.quads;
  const double before = straying(s);
  Context context;
  const SlideReport report = slide(s.mesh, {}, {}, {}, s.quads, context);
  CHECK(report.rounds == 4);
  CHECK(straying(s) < 0.75 * before);
  // what the report says of five points a quad is near what many points say
  CHECK(report.before == Approx(before).epsilon(0.25));
  CHECK(report.after == Approx(straying(s)).epsilon(0.25));
  CHECK(least(s.quads) >= std::min(0.8, least(start)));
  check_on_surface(s);
  const Grid grid{12, 8};
  for (Index j = 0; j <= 8; ++j)
    for (Index i = 0; i <= 12; ++i)
      if (i % 12 == 0 || j % 8 == 0)
        CHECK(s.quads.positions.row(grid.vertex(i, j)) == start.positions.row(grid.vertex(i, j)));
  CHECK(s.quads.quads == start.quads);
}

TEST_CASE("slide: no rounds, and a flat sheet, change nothing", "[slide][fast]") {
  Context context;
  Sheet curved = sheet(6, 4, 4, wave);
  const Points<double> start = curved.quads.positions;
  const SlideReport report = slide(curved.mesh, {}, {}, {.rounds = 0}, curved.quads, context);
  CHECK(report.rounds == 0);
  CHECK(report.before == report.after);
  CHECK(curved.quads.positions == start);
  Sheet flat = sheet(6, 4, 4, [](double, double) { return 0.0; });
  const Points<double> even = flat.quads.positions;
  (void)slide(flat.mesh, {}, {}, {}, flat.quads, context);
  CHECK((flat.quads.positions - even).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("slide: held vertices stay, and parts are fitted as if they were alone", "[slide][fast]") {
  // One sheet, and a copy of it a hundred times as large beside it.
  const Sheet one = sheet(8, 6, 4, wave);
  const Index n = one.mesh.vertex_count(), m = one.mesh.face_count(), v = one.quads.vertex_count(),
              q = one.quads.quad_count();
  Points<double> positions(2 * n, 3);
  positions << one.mesh.positions(), 100 * one.mesh.positions().array() + 1000;
  Triangles faces(2 * m, 3);
  faces << one.mesh.faces(), one.mesh.faces().array() + n;
  Sheet both{build(positions, faces), {}};
  both.quads.positions.resize(2 * v, 3);
  both.quads.positions << one.quads.positions, 100 * one.quads.positions.array() + 1000;
  both.quads.quads.resize(2 * q, 4);
  both.quads.quads << one.quads.quads, one.quads.quads.array() + v;
  both.quads.source = one.quads.source;
  for (SurfacePoint s : one.quads.source) {
    s.face += m;
    both.quads.source.push_back(s);
  }
  const Index middle = Grid{8, 6}.vertex(4, 3);
  std::vector<char> held(at(v), 0);
  held[at(middle)] = 1;
  Sheet alone = one;
  Context context;
  (void)slide(alone.mesh, {}, held, {}, alone.quads, context);
  CHECK(alone.quads.positions.row(middle) == one.quads.positions.row(middle));
  CHECK((alone.quads.positions - one.quads.positions).cwiseAbs().maxCoeff() > 0.01);
  held.resize(at(2 * v), 0);
  held[at(v + middle)] = 1;
  (void)slide(both.mesh, {}, held, {}, both.quads, context);
  CHECK(both.quads.positions.topRows(v) == alone.quads.positions);
  const Points<double> large = (both.quads.positions.bottomRows(v).array() - 1000) / 100;
  CHECK((large - alone.quads.positions).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("slide: the same bits at 1, 2 and 16 threads", "[slide][fast]") {
  const Sheet start = sheet(96, 64, 2, wave);
  std::vector<Points<double>> found;
  for (const unsigned threads : {1U, 2U, 16U}) {
    Sheet s = start;
    Context context;
    context.threads = threads;
    (void)slide(s.mesh, {}, {}, {.rounds = 2}, s.quads, context);
    found.push_back(s.quads.positions);
  }
  CHECK(found[0] == found[1]);
  CHECK(found[0] == found[2]);
  CHECK((found[0] - start.quads.positions).cwiseAbs().maxCoeff() > 1e-4);
}

TEST_CASE("slide: lines of vertices find a ridge, and stay on one that is held", "[slide][fast]") {
  // Columns of quads stand 0.25 apart, the ridge between two of them at 1.55; on the border nothing moves.
  Sheet s = sheet(12, 8, 15, roof);
  const double before = straying(s);
  Context context;
  (void)slide(s.mesh, {}, {}, {.rounds = 8}, s.quads, context);
  CHECK(straying(s) < 0.55 * before);
  const Grid grid{12, 8};
  for (Index j = 2; j <= 6; ++j) CHECK(s.quads.positions(grid.vertex(6, j), 0) == Approx(1.55).margin(0.01));

  // A bump beside the ridge, which stands on a column now, draws vertices away from it.
  const auto bumpy = [](double x, double y) {
    return -0.6 * std::abs(x - 1.5) + 0.15 * std::exp(-20 * ((x - 1.8) * (x - 1.8) + (y - 1) * (y - 1)));
  };
  const Sheet start = sheet(12, 8, 8, bumpy);
  double slid = 0;
  std::vector<char> ridge(static_cast<std::size_t>(start.quads.vertex_count()), 0);
  for (Index j = 0; j <= 8; ++j) ridge[static_cast<std::size_t>(grid.vertex(6, j))] = 1;
  for (const bool hold : {false, true}) {
    Sheet held = start;
    (void)slide(held.mesh, {}, hold ? ridge : std::vector<char>{}, {}, held.quads, context);
    double moved = 0;
    for (Index j = 1; j < 8; ++j) {
      const Index v = grid.vertex(6, j);
      moved = std::max(moved, (held.quads.positions.row(v) - start.quads.positions.row(v)).norm());
    }
    if (hold)
      CHECK(moved == 0);
    else
      slid = moved;
  }
  CHECK(slid > 0.01);
}

TEST_CASE("slide: lines gather where the surface is going to bend", "[slide][fast]") {
  Sheet s = sheet(12, 8, 6, [](double, double) { return 0.0; });
  Skeleton skeleton;
  skeleton.bones = {{.head = {0, 1, 0}, .tail = {1.5, 1, 0}}, {.head = {1.5, 1, 0}, .tail = {3, 1, 0}, .parent = 0}};
  SkinWeights weights(s.mesh.vertex_count(), 2);
  for (Index v = 0; v < s.mesh.vertex_count(); ++v) {
    const double t = std::clamp((s.mesh.positions()(v, 0) - 1.25) / 0.5, 0.0, 1.0), share = t * t * (3 - 2 * t);
    if (share < 1) weights.insert(v, 0) = 1 - share;
    if (share > 0) weights.insert(v, 1) = share;
  }
  weights.makeCompressed();
  const Connection<double> connection(s.mesh);
  Context context;
  const std::vector<Pose> poses = bend_poses(skeleton, 60);
  SlideTargets targets;
  targets.set_bending(connection, PosedForms::create(s.mesh, connection, weights, poses, {}, context).value(), context);
  const SlideReport report = slide(s.mesh, targets, {}, {}, s.quads, context);
  CHECK(report.after < 0.8 * report.before);
  const Grid grid{12, 8};
  const auto x = [&](Index i) { return s.quads.positions(grid.vertex(i, 4), 0); };
  CHECK(x(7) - x(5) < 0.9 * 0.5);
  CHECK(x(5) - x(4) > 1.05 * 0.25);
  CHECK(least(s.quads) >= 0.8);
  check_on_surface(s);
}

TEST_CASE("slide: edges turn to the direction they are given", "[slide][fast]") {
  Sheet s = sheet(12, 8, 8, wave);
  const ClosestPoint closest(s.mesh);
  const Grid grid{12, 8};
  for (Index j = 1; j < 8; ++j)
    for (Index i = 1; i < 12; ++i) {  // rows that run up and down
      const Index v = grid.vertex(i, j);
      const Vector3 away = s.quads.positions.row(v).transpose() + Vector3(0, i % 2 ? 0.03 : -0.03, 0);
      const SurfaceHit hit = closest.closest(away);
      s.quads.source[at(v)] = hit;
      s.quads.positions.row(v) = hit.position.transpose();
    }
  const auto leaving = [&](const QuadMesh& quads) {  // mean slope of the rows, as seen from above
    double sum = 0;
    for (Index j = 1; j < 8; ++j)
      for (Index i = 1; i < 11; ++i) {
        const Index v = grid.vertex(i, j), w = grid.vertex(i + 1, j);
        sum += std::abs(quads.positions(w, 1) - quads.positions(v, 1)) / 0.25 / 70;
      }
    return sum;
  };
  SlideTargets targets;
  targets.direction.assign(at(s.mesh.face_count()), Vector3::UnitX());
  Sheet free = s;
  const double before = leaving(s.quads);
  Context context;
  (void)slide(s.mesh, targets, {}, {.skew = 0}, s.quads, context);
  (void)slide(free.mesh, {}, {}, {.skew = 0}, free.quads, context);
  CHECK(leaving(s.quads) < 0.6 * before);
  CHECK(leaving(s.quads) < 0.8 * leaving(free.quads));
}

TEST_CASE("slide: where errors weigh more, quads come closer", "[slide][fast]") {
  const auto two = [](double x, double y) {
    return 0.2 * std::sin(4 * y) * std::exp(-8 * (x - 0.7) * (x - 0.7)) +
           0.2 * std::sin(4 * y) * std::exp(-8 * (x - 2.3) * (x - 2.3));
  };
  const Sheet start = sheet(12, 8, 6, two);
  std::array<double, 2> share{};
  for (int k = 0; k < 2; ++k) {
    Sheet s = start;
    SlideTargets targets;
    for (Index f = 0; k == 1 && f < s.mesh.face_count(); ++f)
      targets.weight.push_back(s.mesh.position(s.mesh.faces()(f, 0)).x() < 1.5 ? 20 : 1);
    Context context;
    (void)slide(s.mesh, targets, {}, {}, s.quads, context);
    const ClosestPoint closest(s.mesh);
    for (Index q = 0; q < s.quads.quad_count(); ++q) {
      Vector3 centre = Vector3::Zero();
      for (int i = 0; i < 4; ++i) centre += s.quads.positions.row(s.quads.quads(q, i)).transpose() / 4;
      if (centre.x() < 1.5) share[at(k)] += closest.closest(centre).squared_distance;
    }
  }
  CHECK(share[1] < 0.95 * share[0]);
}

TEST_CASE("slide: options out of range are named, and a cancelled fit leaves sound quads", "[slide][fast]") {
  for (const SlideOptions& bad :
       {SlideOptions{.rounds = -1}, SlideOptions{.skew = -1}, SlideOptions{.turn = std::nan("")},
        SlideOptions{.stray = -2}, SlideOptions{.accepted = 1}})
    CHECK(bad.validate().error().where.starts_with("fit.slide."));
  RemeshOptions options;
  options.fit.rounds = -1;
  CHECK(options.validate().error().where == "fit.rounds");

  Sheet s = sheet(12, 8, 4, wave);
  Context context;
  std::atomic<bool> cancel{true};
  context.cancel_flag = &cancel;
  CHECK(slide(s.mesh, {}, {}, {}, s.quads, context).rounds == 0);
  CHECK(least(s.quads) > 0.6);
}
