#include "quadrig/fit.hpp"

#include "quadrig/closest.hpp"
#include "quadrig/subdivision.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A tube along x, open at both ends, and quads on every few of its vertices.
struct Tube {
  static constexpr Index around = 48, along = 72, every = 6;
  TriangleMesh<double> mesh;
  QuadMesh quads;

  explicit Tube(double length = 6) {
    Points<double> positions((along + 1) * around, 3);
    for (Index i = 0; i <= along; ++i)
      for (Index j = 0; j < around; ++j) {
        const double angle = 2 * std::numbers::pi * j / around;
        positions.row(i * around + j) << length * i / along, std::cos(angle), std::sin(angle);
      }
    Triangles faces(2 * along * around, 3);
    for (Index i = 0; i < along; ++i)
      for (Index j = 0; j < around; ++j) {
        const Index a = i * around + j, b = i * around + (j + 1) % around, c = b + around, d = a + around;
        faces.row(2 * a) << a, b, c;
        faces.row(2 * a + 1) << a, c, d;
      }
    mesh = build(positions, faces);
    constexpr Index rings = along / every + 1, sides = around / every;
    quads.positions.resize(rings * sides, 3);
    quads.quads.resize((rings - 1) * sides, 4);
    for (Index i = 0; i < rings; ++i)
      for (Index j = 0; j < sides; ++j) {
        const Index h = mesh.outgoing(i * every * around + j * every);
        SurfacePoint s{h / 3, Vector3::Zero()};
        s.barycentric[h % 3] = 1;
        quads.source.push_back(s);
        quads.positions.row(i * sides + j) = position(mesh, s).transpose();
        if (i + 1 < rings)
          quads.quads.row(i * sides + j) << i * sides + j, i * sides + (j + 1) % sides,
              (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j;
      }
  }
  /// Weights of two bones that blend around the middle over `width`.
  [[nodiscard]] SkinWeights two_bones(double width = 2) const {
    std::vector<Eigen::Triplet<double, Index>> entries;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      const double t = std::clamp((mesh.position(v).x() - 3) / width + 0.5, 0.0, 1.0);
      if (t < 1) entries.emplace_back(v, 0, 1 - t);
      if (t > 0) entries.emplace_back(v, 1, t);
    }
    SkinWeights weights(mesh.vertex_count(), 2);
    weights.setFromTriplets(entries.begin(), entries.end());
    return weights;
  }
};

Pose bent(double degrees) {
  Pose pose(2, Eigen::Affine3d::Identity());
  pose[1] = Eigen::Translation3d(3, 0, 0) * Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3::UnitZ()) *
            Eigen::Translation3d(-3, 0, 0);
  return pose;
}

/// Root mean square distance of the surface's vertices, away from the ends, to quads drawn as 0 1 2, 0 2 3.
double straying(const Points<double>& surface, const Points<double>& rest, const QuadMesh& quads) {
  Triangles drawn(2 * quads.quad_count(), 3);
  for (Index q = 0; q < quads.quad_count(); ++q) {
    drawn.row(2 * q) << quads.quads(q, 0), quads.quads(q, 1), quads.quads(q, 2);
    drawn.row(2 * q + 1) << quads.quads(q, 0), quads.quads(q, 2), quads.quads(q, 3);
  }
  const ClosestPoint closest(quads.positions, drawn);
  double sum = 0;
  Index count = 0;
  for (Eigen::Index v = 0; v < surface.rows(); ++v) {
    if (rest(v, 0) < 1 || rest(v, 0) > 5) continue;
    sum += closest.closest(surface.row(v).transpose()).squared_distance;
    ++count;
  }
  return std::sqrt(sum / count);
}
double straying(const Tube& tube, const QuadMesh& quads) {
  return straying(tube.mesh.positions(), tube.mesh.positions(), quads);
}

}  // namespace

TEST_CASE("fit: quads round a tube stand outside it, half as far off, and its lines stay straight", "[fit][fast]") {
  const Tube tube;
  Context context;
  const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, {}, {}, {}, context);
  REQUIRE(fitted);
  CHECK(straying(tube, fitted->mesh) < 0.6 * straying(tube, tube.quads));
  CHECK(fitted->report.rest_after < 0.6 * fitted->report.rest_before);
  CHECK(fitted->report.posed_after == Approx(fitted->report.rest_after).epsilon(0.01));
  CHECK(fitted->report.largest_move > 0.01);
  double least = 10, largest = 0;
  for (Index v = 0; v < fitted->mesh.vertex_count(); ++v) {
    const Vector3 p = fitted->mesh.positions.row(v).transpose();
    if (p.x() < 1.9 || p.x() > 4.1) continue;  // away from the borders, which are held
    const double radius = std::hypot(p.y(), p.z());
    least = std::min(least, radius);
    largest = std::max(largest, radius);
    CHECK(p.x() == Approx(tube.quads.positions(v, 0)).margin(1e-3));
  }
  CHECK(least > 1);
  CHECK(largest - least < 2e-3);
  // the source is where the surface is nearest
  for (Index v = 0; v < fitted->mesh.vertex_count(); ++v) {
    const Vector3 p = fitted->mesh.positions.row(v).transpose();
    CHECK((position(tube.mesh, fitted->mesh.source[at(v)]) - p).norm() <= fitted->report.largest_move + 1e-12);
  }
}

TEST_CASE("fit: held vertices stay; a flat sheet stays; method none moves nothing", "[fit][fast]") {
  const Tube tube;
  Context context;
  std::vector<char> held(at(tube.quads.vertex_count()), 0);
  held[43] = 1;
  const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, {}, held, {}, context);
  REQUIRE(fitted);
  CHECK(fitted->mesh.positions.row(43) == tube.quads.positions.row(43));
  const Expected<FittedQuads> still = fit(tube.mesh, tube.quads, {}, {}, {.method = FitMethod::none}, context);
  REQUIRE(still);
  CHECK(still->mesh.positions == tube.quads.positions);
  CHECK(still->report.rest_after == still->report.rest_before);

  const Grid fine{12, 12}, coarse{4, 4};
  const auto place = [](double i, double j) { return Vector3(i, j, 0); };
  const TriangleMesh<double> sheet =
      build(fine.positions([&](Index i, Index j) { return place(double(i), double(j)); }), fine.triangles());
  QuadMesh quads;
  quads.quads = coarse.quads();
  quads.positions.resize(coarse.vertex_count(), 3);
  for (Index j = 0; j <= 4; ++j)
    for (Index i = 0; i <= 4; ++i) {
      const Index h = sheet.outgoing(fine.vertex(3 * i, 3 * j));
      SurfacePoint s{h / 3, Vector3::Zero()};
      s.barycentric[h % 3] = 1;
      quads.source.push_back(s);
      quads.positions.row(coarse.vertex(i, j)) = position(sheet, s).transpose();
    }
  const Expected<FittedQuads> flat = fit(sheet, quads, {}, {}, {}, context);
  REQUIRE(flat);
  CHECK((flat->mesh.positions - quads.positions).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("fit: borders and kept edges go to where their chords stray least from the line", "[fit][fast]") {
  const Tube tube;
  Context context;
  EdgeMarks middle(at(tube.mesh.halfedge_count()), 0);  // round the tube at x = 3
  for (Index h = 0; h < tube.mesh.halfedge_count(); ++h)
    middle[at(h)] = std::abs(tube.mesh.position(tube.mesh.origin(h)).x() - 3) < 1e-9 &&
                    std::abs(tube.mesh.position(tube.mesh.target(h)).x() - 3) < 1e-9;
  const Expected<FittedQuads> fitted =
      fit(tube.mesh, tube.quads, {}, {}, {}, context, solver_factory<double>(), middle);
  REQUIRE(fitted);
  // A side whose corners are at R is R cos(a) / cos(t) off the axis, a an eighth of half a turn, at angles t up to a.
  const double eighth = std::numbers::pi / 8,
               best = std::log(std::tan(std::numbers::pi / 4 + eighth / 2)) / std::sin(eighth);
  for (Index v = 0; v < fitted->mesh.vertex_count(); ++v) {
    const Vector3 p = fitted->mesh.positions.row(v).transpose(), q = tube.quads.positions.row(v).transpose();
    if (q.x() > 0 && q.x() < 6 && std::abs(q.x() - 3) > 1e-9) continue;
    CHECK(p.x() == Approx(q.x()).margin(1e-3));
    CHECK(std::hypot(p.y(), p.z()) - 1 == Approx(best - 1).epsilon(0.05));
  }
}

TEST_CASE("fit: border vertices at one place stay together, and corners of a border stay", "[fit][fast]") {
  // A cap that is bent over x, cut in two along its ridge: two surfaces whose borders coincide.
  const Grid fine{12, 12}, coarse{4, 2};
  const auto place = [](double i, double j) {
    return Vector3(i, j - 6, 3 - 0.01 * i * (12 - i) - 0.05 * (j - 6) * (j - 6));
  };
  Points<double> positions(2 * fine.vertex_count(), 3);
  const Points<double> one = fine.positions([&](Index i, Index j) { return place(double(i), 6 + double(j) / 2); });
  positions << one, one;
  positions.bottomRows(fine.vertex_count()).col(1) *= -0.7;
  Triangles faces(2 * fine.triangles().rows(), 3);
  faces << fine.triangles(), fine.triangles().rowwise().reverse().array() + fine.vertex_count();
  const TriangleMesh<double> surface = build(positions, faces);
  QuadMesh quads;
  quads.positions.resize(2 * coarse.vertex_count(), 3);
  quads.quads.resize(2 * coarse.quads().rows(), 4);
  quads.quads << coarse.quads(), coarse.quads().rowwise().reverse().array() + coarse.vertex_count();
  for (const Index side : {0, 1})
    for (Index j = 0; j <= 2; ++j)
      for (Index i = 0; i <= 4; ++i) {
        const Index h = surface.outgoing(side * fine.vertex_count() + fine.vertex(3 * i, 6 * j));
        SurfacePoint s{h / 3, Vector3::Zero()};
        s.barycentric[h % 3] = 1;
        quads.source.push_back(s);
        quads.positions.row(side * coarse.vertex_count() + coarse.vertex(i, j)) = position(surface, s).transpose();
      }
  Context context;
  const Expected<FittedQuads> fitted = fit(surface, quads, {}, {}, {}, context);
  REQUIRE(fitted);
  double moved = 0;
  for (Index i = 0; i <= 4; ++i) {
    const Index v = coarse.vertex(i, 0), w = coarse.vertex_count() + v;
    REQUIRE(quads.positions.row(v) == quads.positions.row(w));
    CHECK(fitted->mesh.positions.row(v) == fitted->mesh.positions.row(w));
    moved = std::max(moved, (fitted->mesh.positions.row(v) - quads.positions.row(v)).norm());
    if (i % 4 == 0) CHECK(fitted->mesh.positions.row(v) == quads.positions.row(v));
  }
  CHECK(moved > 0.005);
}

TEST_CASE("fit: poses that bend the surface bring the posed quads closer than the rest pose alone", "[fit][fast]") {
  const Tube tube;
  const SkinWeights weights = tube.two_bones();
  const std::vector<Pose> poses{bent(70)};
  Context context;
  FitMotion motion;
  motion.weights = &weights;
  const Expected<FittedQuads> at_rest = fit(tube.mesh, tube.quads, motion, {}, {}, context);
  motion.poses = poses;
  const std::vector<double> emphasis{10};
  motion.pose_weights = emphasis;
  const Expected<FittedQuads> posed = fit(tube.mesh, tube.quads, motion, {}, {}, context);
  REQUIRE(at_rest);
  REQUIRE(posed);
  const Points<double> fine = skin(tube.mesh.positions(), weights, poses[0]);
  const auto error = [&](const FittedQuads& made) {
    QuadMesh moved = made.mesh;
    moved.positions = skin(made.mesh.positions, *made.weights, poses[0]);
    return straying(fine, tube.mesh.positions(), moved);
  };
  CHECK(error(*posed) < 0.95 * error(*at_rest));
  CHECK(posed->report.posed_after < posed->report.posed_before);
  for (Index v = 0; v < posed->mesh.vertex_count(); ++v) CHECK(posed->weights->row(v).sum() == Approx(1));
}

TEST_CASE("fit: the influences that are kept move a vertex as all of them do, where they can", "[fit][fast]") {
  const Tube tube;
  // Six bones: three that always move together, and three others; the strongest four are not the best four.
  const SkinWeights two = tube.two_bones();
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < tube.mesh.vertex_count(); ++v)
    for (SkinWeights::InnerIterator it(two, v); it; ++it)
      for (Index k = 0; k < 3; ++k) entries.emplace_back(v, 3 * static_cast<Index>(it.col()) + k, it.value() / 3);
  SkinWeights weights(tube.mesh.vertex_count(), 6);
  weights.setFromTriplets(entries.begin(), entries.end());
  std::vector<Pose> poses;
  for (const double degrees : {-60.0, 60.0}) {
    const Pose pair = bent(degrees);
    Pose pose;
    for (Index b = 0; b < 6; ++b) pose.push_back(pair[at(b / 3)]);
    poses.push_back(pose);
  }
  Context context;
  FitMotion motion;
  motion.weights = &weights;
  motion.poses = poses;
  motion.influences = 2;
  const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, motion, {}, {.method = FitMethod::none}, context);
  REQUIRE(fitted);
  CHECK(fitted->report.dropped_influences == tube.quads.vertex_count());
  CHECK(fitted->report.dropped_error < 1e-3);
  for (Index v = 0; v < fitted->mesh.vertex_count(); ++v) {
    double sum = 0, second = 0;
    Index count = 0;
    for (SkinWeights::InnerIterator it(*fitted->weights, v); it; ++it) {
      CHECK(it.value() > 0);
      sum += it.value();
      if (it.col() >= 3) second += it.value();
      ++count;
    }
    CHECK(count <= 2);
    CHECK(sum == Approx(1));
    const double x = fitted->mesh.positions(v, 0);
    CHECK(second == Approx(std::clamp((x - 3) / 2 + 0.5, 0.0, 1.0)).margin(0.02));
  }
}

TEST_CASE("fit: morph targets are carried in the mean, and count as poses", "[fit][fast]") {
  const Tube tube;
  std::vector<Points<double>> morphs(2, Points<double>::Zero(tube.mesh.vertex_count(), 3));
  for (Index v = 0; v < tube.mesh.vertex_count(); ++v) {
    const Vector3 p = tube.mesh.position(v);
    morphs[0].row(v) << 0.25, -0.5, 1;  // the whole moves
    morphs[1].row(v) = 0.8 * std::exp(-4 * (p.x() - 3) * (p.x() - 3)) * Vector3(0, p.y(), p.z()).transpose();
  }
  Context context;
  FitMotion motion;
  motion.morphs = morphs;
  const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, motion, {}, {}, context);
  const Expected<FittedQuads> without = fit(tube.mesh, tube.quads, {}, {}, {}, context);
  REQUIRE(fitted);
  REQUIRE(without);
  REQUIRE(fitted->morphs.size() == 2);
  CHECK((fitted->morphs[0].rowwise() - Eigen::RowVector3d(0.25, -0.5, 1)).cwiseAbs().maxCoeff() < 1e-3);
  const Points<double> bulge = tube.mesh.positions() + morphs[1];
  QuadMesh moved = fitted->mesh, read = without->mesh;
  moved.positions += fitted->morphs[1];
  for (Index v = 0; v < read.vertex_count(); ++v)
    for (int i = 0; i < 3; ++i)
      read.positions.row(v) +=
          read.source[at(v)].barycentric[i] * morphs[1].row(tube.mesh.faces()(read.source[at(v)].face, i));
  CHECK(straying(bulge, tube.mesh.positions(), moved) < 0.9 * straying(bulge, tube.mesh.positions(), read));
}

TEST_CASE("fit: the same bits at any number of threads; a cancelled fit says so; wrong input is named", "[fit][fast]") {
  const Tube tube;
  const SkinWeights weights = tube.two_bones();
  const std::vector<Pose> poses{bent(60), bent(-60)};
  FitMotion motion;
  motion.weights = &weights;
  motion.poses = poses;
  std::optional<Points<double>> first;
  for (const unsigned threads : {1u, 2u, 7u}) {
    Context context;
    context.threads = threads;
    const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, motion, {}, {}, context);
    REQUIRE(fitted);
    if (!first) first = fitted->mesh.positions;
    CHECK(*first == fitted->mesh.positions);
  }
  Context stopped;
  std::atomic<bool> stop = true;
  stopped.cancel_flag = &stop;
  const Expected<FittedQuads> cancelled = fit(tube.mesh, tube.quads, motion, {}, {}, stopped);
  REQUIRE_FALSE(cancelled);
  CHECK(cancelled.error().code == ErrorCode::cancelled);

  Context context;
  const auto refused = [&](const FitMotion& wrong) {
    const Expected<FittedQuads> made = fit(tube.mesh, tube.quads, wrong, {}, {}, context);
    REQUIRE_FALSE(made);
    CHECK(made.error().code == ErrorCode::bad_input);
    return made.error().where;
  };
  const std::vector<Pose> other{Pose(3, Eigen::Affine3d::Identity())};
  FitMotion wrong = motion;
  wrong.poses = other;
  CHECK(refused(wrong) == "pose 0");
  const std::vector<double> one_weight{1};
  wrong = motion;
  wrong.pose_weights = one_weight;
  CHECK(refused(wrong) == "pose weights");
  const std::vector<Points<double>> short_morph{Points<double>::Zero(3, 3)};
  wrong = motion;
  wrong.morphs = short_morph;
  CHECK(refused(wrong) == "morph 0");
  for (const FitOptions& bad : {FitOptions{.rounds = -1}, FitOptions{.samples = 0}, FitOptions{.stiffness = -1},
                                FitOptions{.shear = -1}, FitOptions{.sliding = -1}, FitOptions{.largest_move = -1},
                                FitOptions{.accepted = 1}, FitOptions{.slide = {.skew = -1}}}) {
    const Expected<FittedQuads> made = fit(tube.mesh, tube.quads, {}, {}, bad, context);
    REQUIRE_FALSE(made);
    CHECK(made.error().code == ErrorCode::bad_option);
    CHECK(made.error().where.starts_with("fit."));
  }
}

TEST_CASE("fit: the limit surface of a cage lies on a tube, and its borders on the tube's", "[fit][fast]") {
  if (!can_subdivide()) {
    WARN("skipped: built without OpenSubdiv");
    return;
  }
  const Tube tube;
  Context context;
  const auto limit = [&](const QuadMesh& cage) {
    const Expected<Subdivision> s = subdivide(cage.quads, cage.vertex_count());
    REQUIRE(s);
    return QuadMesh{s->stencils * cage.positions, s->quads, {}};
  };
  const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, {}, {}, {.method = FitMethod::subdivision}, context);
  REQUIRE(fitted);
  const QuadMesh before = limit(tube.quads), after = limit(fitted->mesh);
  CHECK(straying(tube, after) < 0.1 * straying(tube, before));
  CHECK(straying(tube, after) < 0.2 * straying(tube, tube.quads));
  double border = 0;
  for (Eigen::Index v = 0; v < after.positions.rows(); ++v) {
    const Vector3 p = after.positions.row(v).transpose();
    if (p.x() > 0.1) continue;
    border = std::max({border, std::abs(p.x()), std::abs(std::hypot(p.y(), p.z()) - 1)});
  }
  CHECK(border < 0.01);
}

TEST_CASE("fit: a bent cage follows the bent tube once it is subdivided", "[fit][fast]") {
  if (!can_subdivide()) {
    WARN("skipped: built without OpenSubdiv");
    return;
  }
  const Tube tube;
  const SkinWeights weights = tube.two_bones();
  const std::vector<Pose> poses{bent(60), bent(-60)};
  Context context;
  const auto posed_error = [&](FitMethod method) {
    FitMotion motion;
    motion.weights = &weights;
    motion.poses = poses;
    const Expected<FittedQuads> fitted = fit(tube.mesh, tube.quads, motion, {}, {.method = method}, context);
    REQUIRE(fitted);
    const Expected<Subdivision> s = subdivide(fitted->mesh.quads, fitted->mesh.vertex_count());
    REQUIRE(s);
    const QuadMesh drawn{s->stencils * skin(fitted->mesh.positions, *fitted->weights, poses[0]), s->quads, {}};
    return straying(skin(tube.mesh.positions(), weights, poses[0]), tube.mesh.positions(), drawn);
  };
  CHECK(posed_error(FitMethod::subdivision) < 0.4 * posed_error(FitMethod::surface));
}
