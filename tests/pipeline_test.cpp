#include <atomic>
#include <cstring>
#include <numeric>
#include <random>

#include "corpus/synthetic.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/shares.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/quality.hpp"
#include "quadrig/samples.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

Asset asset_of(const Soup& soup) {
  Context context;
  auto prepared = prepare(PolygonMesh::from_triangles(soup.positions(), soup.triangles()), nullptr, {}, context);
  REQUIRE(prepared);
  return {std::move(prepared->mesh), std::nullopt};
}
RemeshOptions wanting(Index quads) {
  RemeshOptions options;
  options.quads = quads;
  return options;
}
Index used_vertices(const TriangleMesh<double>& mesh) {
  Index n = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) n += mesh.outgoing(v) != no_index;
  return n;
}
Index border_loops(const TriangleMesh<double>& mesh) {
  Index loops = 0;
  std::vector<char> seen(at(mesh.vertex_count()), 0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (seen[at(v)] || !mesh.on_boundary(v)) continue;
    ++loops;
    for (Index w = v; !seen[at(w)]; w = mesh.target(mesh.outgoing(w))) seen[at(w)] = 1;
  }
  return loops;
}
Index quad_components(const Quads& quads, Index vertices) {
  std::vector<Index> root(at(vertices));
  for (Index v = 0; v < vertices; ++v) root[at(v)] = v;
  const auto find = [&](Index v) {
    while (root[at(v)] != v) v = root[at(v)] = root[at(root[at(v)])];
    return v;
  };
  for (Index q = 0; q < quads.rows(); ++q)
    for (int i = 1; i < 4; ++i) root[at(find(quads(q, i)))] = find(quads(q, 0));
  Index n = 0;
  for (Index v = 0; v < vertices; ++v) n += find(v) == v;
  return n;
}

/// The rules that no result may break.
void check_result(const Asset& asset, const RemeshResult& result) {
  const TriangleMesh<double>& mesh = asset.mesh;
  const QuadMesh& quads = result.mesh;
  const QuadTopology topology = quad_topology(quads.quads, quads.vertex_count());
  CHECK(topology.defect == "");
  CHECK(topology.euler == used_vertices(mesh) - mesh.edge_count() + mesh.face_count());
  CHECK(topology.boundary_loops == border_loops(mesh));
  CHECK(quad_components(quads.quads, quads.vertex_count()) == face_components(mesh).count);
  CHECK(result.report.quads == quads.quad_count());
  CHECK(result.report.irregular == topology.irregular);
  double least = 1;
  for (Index q = 0; q < quads.quad_count(); ++q)
    least = std::min(least, scaled_jacobian(quads.positions, quads.quads.row(q)));
  CHECK(least > 0);
  CHECK(least == result.report.scaled_jacobian_minimum);
  REQUIRE(quads.source.size() == at(quads.vertex_count()));
  double off = 0;
  for (Index v = 0; v < quads.vertex_count(); ++v) {
    const SurfacePoint& s = quads.source[at(v)];
    CHECK(s.face >= 0);
    CHECK(s.face < mesh.face_count());
    CHECK(s.barycentric.minCoeff() >= 0);
    off = std::max(off, (position(mesh, s) - quads.positions.row(v).transpose()).norm());
  }
  // The surface is no farther than the fit moved the vertex off it; where a ragged border was bridged there is none for
  // less than a quad.
  const GapReport& gaps = result.report.gaps;
  const double bridged = gaps.notches > 0 || gaps.holes_cut > 0 ? std::sqrt(mesh.total_area() / quads.quad_count()) : 0;
  CHECK(off <= result.report.fit.largest_move + bridged + 1e-6 * mesh.diagonal());
}

bool same_bytes(const QuadMesh& a, const QuadMesh& b) {
  if (a.positions.rows() != b.positions.rows() || a.quads.rows() != b.quads.rows()) return false;
  const auto bytes = [](const auto& m) { return sizeof(*m.data()) * static_cast<std::size_t>(m.size()); };
  return std::memcmp(a.positions.data(), b.positions.data(), bytes(a.positions)) == 0 &&
         std::memcmp(a.quads.data(), b.quads.data(), bytes(a.quads)) == 0;
}

}  // namespace

TEST_CASE("remesh: small surfaces of every kind come out valid", "[pipeline]") {
  for (const SyntheticCase& c : synthetic_cases()) {
    // The small ones; all of them in the slow test.
    static constexpr std::array<std::string_view, 24> small{"sphere_16",
                                                            "torus_coarse",
                                                            "cube_3",
                                                            "tetrahedron",
                                                            "wedge",
                                                            "pyramid",
                                                            "l_shape",
                                                            "frame",
                                                            "ladder_2",
                                                            "cage",
                                                            "slivers_cube",
                                                            "slivers_torus",
                                                            "units_tiny_cube",
                                                            "units_huge_sheet",
                                                            "triangle",
                                                            "square_2",
                                                            "skewed",
                                                            "ragged_42",
                                                            "annulus_0.5",
                                                            "cube_open",
                                                            "parts_mixed",
                                                            "parts_of_all_sizes",
                                                            "mask",
                                                            "sliver"};
    if (std::find(small.begin(), small.end(), c.name) == small.end()) continue;
    INFO(c.name);
    const Asset asset = asset_of(c.make());
    Context context;
    const auto result = remesh(asset, wanting(400), context);
    REQUIRE(result);
    check_result(asset, *result);
  }
}

TEST_CASE("remesh: every synthetic surface comes out valid", "[pipeline][slow]") {
  for (const SyntheticCase& c : synthetic_cases()) {
    INFO(c.name);
    const Asset asset = asset_of(c.make());
    if (asset.mesh.face_count() > 20000) continue;
    Context context;
    const auto result = remesh(asset, wanting(600), context);
    CHECK(result);
    if (result) check_result(asset, *result);
  }
}

TEST_CASE("remesh: the count is met where there are enough quads a singularity", "[pipeline]") {
  using namespace synthetic;
  for (const Soup& soup : {torus_mesh(40, 20, 1, 0.4), bumpy(sphere(20), 0.2, 3, 5), cells({{0, 0, 0}, {1, 0, 0}}, 6),
                           clipped(sphere(20), holes_in_ball(2, 0.4))}) {
    const Asset asset = asset_of(soup);
    for (const Index wanted : {1000, 4000}) {
      Context context;
      const auto result = remesh(asset, wanting(wanted), context);
      REQUIRE(result);
      check_result(asset, *result);
      CHECK(std::abs(static_cast<double>(result->report.quads) / wanted - 1) < 0.05);
      CHECK(result->report.minimum_count == 0);
      for (const ComponentReport& part : result->report.components) CHECK(part.rung == Rung::fine_map);
    }
  }
}

TEST_CASE("remesh: a small count is met too, whatever whole rows it needs", "[pipeline]") {
  for (const SyntheticCase& c : synthetic_cases()) {
    if (c.name != "skewed" && c.name != "parts_many") continue;
    const Asset asset = asset_of(c.make());
    Context context;
    const auto result = remesh(asset, wanting(300), context);
    REQUIRE(result);
    check_result(asset, *result);
    CHECK(std::abs(result->mesh.quad_count() - 300) <= 15);
  }
}

TEST_CASE("remesh: quads are shared out, and many parts that miss theirs alike are asked again", "[pipeline]") {
  using quadrig::detail::asked_again;
  using quadrig::detail::quads_due;
  CHECK(quads_due({1, 3}, 400, {6, 6}) == std::vector<double>{100, 300});
  CHECK(quads_due({1, 999}, 400, {6, 6}) == std::vector<double>{6, 394});
  CHECK(quads_due({1, 1, 1}, 6, {6, 6, 6}) == std::vector<double>{6, 6, 6});
  CHECK(quads_due({1, 1, 1}, 3, {1, 1, 1}) == std::vector<double>{1, 1, 1});    // sheets
  CHECK(quads_due({1, 1, 1.1}, 3, {1, 1, 1}) == std::vector<double>{1, 1, 1});  // the last is due no more than its part
  // Three of 12 have three too many each.
  const std::vector<double> due{12, 12, 12, 200}, least(4, 6.0);
  CHECK(asked_again(due, {15, 15, 15, 200}, least, 9, 10).empty());
  using Again = std::vector<std::pair<std::size_t, double>>;
  CHECK(asked_again(due, {15, 15, 15, 200}, least, 9, 1) == Again{{0, 6}, {1, 6}});
  CHECK(asked_again(due, {10, 9, 12, 200}, least, -5, 1) == Again{{1, 18}});
  CHECK(asked_again(due, {12, 12, 12, 230}, least, 30, 1).empty());  // no matter of whole rows
  CHECK(asked_again({8, 8}, {12, 12}, {6, 6}, 8, 1).empty());        // none closes with less
}

TEST_CASE("remesh: the result does not depend on the number of threads", "[pipeline]") {
  using namespace synthetic;
  const Asset parts = asset_of(joined(joined(torus_mesh(30, 14, 1, 0.3), scaled(sphere(10), 0.5, Vector3(3, 0, 0))),
                                      scaled(cells({{0, 0, 0}}, 4), 1, Vector3(-4, 0, 0))));
  std::optional<QuadMesh> first;
  for (const unsigned threads : {1u, 2u, 16u}) {
    Context context;
    context.threads = threads;
    const auto result = remesh(parts, wanting(500), context);
    REQUIRE(result);
    if (!first)
      first = result->mesh;
    else
      CHECK(same_bytes(*first, result->mesh));
  }
}

TEST_CASE("remesh: progress comes from the caller's thread, goes on all the way, and the log tells each part",
          "[pipeline]") {
  using namespace synthetic;
  const Asset one = asset_of(torus_mesh(30, 14, 1, 0.3));
  const Asset three = asset_of(joined(joined(torus_mesh(30, 14, 1, 0.3), scaled(sphere(10), 0.5, Vector3(3, 0, 0))),
                                      scaled(cells({{0, 0, 0}}, 4), 1, Vector3(-4, 0, 0))));
  for (const Asset* asset : {&one, &three}) {
    Context context;
    context.threads = 2;
    const std::thread::id caller = std::this_thread::get_id();
    std::vector<double> told;
    std::vector<std::string> stages, lines;
    bool elsewhere = false;
    context.on_progress = [&](std::string_view stage, double fraction) {
      elsewhere = elsewhere || std::this_thread::get_id() != caller;
      told.push_back(fraction);
      stages.emplace_back(stage);
    };
    context.on_log = [&](std::string_view line) { lines.emplace_back(line); };
    REQUIRE(remesh(*asset, wanting(500), context));
    CHECK_FALSE(elsewhere);
    CHECK(std::ranges::is_sorted(told));
    CHECK(told.front() == 0);
    CHECK(told.back() == 1);
    CHECK(std::ranges::count_if(told, [](double f) { return f > 0.1 && f < 0.95; }) >= 3);
    for (const char* stage : {"metric", "field", "map", "integers", "fit"})
      CHECK(std::ranges::find(stages, stage) != stages.end());
    CHECK(lines.size() == (asset == &one ? 1u : 3u));
  }
}

TEST_CASE("remesh: a rigged result is valid, weighted and the same at any number of threads", "[pipeline]") {
  Context making;
  const auto sample = make_sample("pear", 1500, making);
  REQUIRE(sample);
  std::optional<RemeshResult> first;
  for (const unsigned threads : {1u, 2u, 16u}) {
    Context context;
    context.threads = threads;
    RemeshOptions options = wanting(600);
    options.influences = 2;
    auto result = remesh(*sample, options, context);
    REQUIRE(result);
    if (first) {
      CHECK(same_bytes(first->mesh, result->mesh));
      CHECK((Eigen::MatrixXd(*first->weights) - Eigen::MatrixXd(*result->weights)).norm() == 0);
      continue;
    }
    check_result(*sample, *result);
    REQUIRE(result->weights);
    REQUIRE(result->weights->rows() == result->mesh.vertex_count());
    for (Index v = 0; v < result->weights->rows(); ++v) {
      double sum = 0;
      int entries = 0;
      for (SkinWeights::InnerIterator it(*result->weights, v); it; ++it) {
        CHECK(it.value() >= 0);
        sum += it.value();
        entries += it.value() > 0;
      }
      CHECK(sum == quadrig::test::Approx(1).margin(1e-12));
      CHECK(entries <= 2);
    }
    first = std::move(*result);
  }
}

TEST_CASE("remesh: edges keep to the bones and ring the limbs, whatever was done to the singularities", "[pipeline]") {
  Context context;
  for (const auto& [name, limit] : {std::pair{"humanoid", 5.0}, std::pair{"wing", 4.0}}) {
    INFO(name);
    const auto sample = make_sample(name, 6000, context);
    REQUIRE(sample);
    const auto result = remesh(*sample, wanting(1500), context);
    REQUIRE(result);
    const auto guidance = guidance_figures(sample->mesh, *sample->rig, result->mesh);
    REQUIRE(guidance);
    CHECK(guidance->bone_edges > 300);
    CHECK(guidance->bone_angle_mean_degrees < limit);
    const Index rings = std::accumulate(guidance->hinge_loops.begin(), guidance->hinge_loops.end(), Index{0});
    if (name == std::string_view("humanoid")) CHECK(rings > 25);
  }
}

TEST_CASE("remesh: every stage solves with the backend that is asked for, and tells", "[pipeline]") {
  Context context;
  const Asset asset = make_sample("humanoid", 6000, context).value();
  RemeshOptions options = wanting(600);
  CHECK(remesh(asset, options, context).value().report.backends.map == "automatic: supernodal, minimum degree");
  options.solver = "supernodal/dissection";
  const RemeshResult named = remesh(asset, options, context).value();
  int reals = 0, complexes = 0;
  options.solver = "eigen";
  options.solver.own_real = [&] { return ++reals, make_solver<double>("supernodal/dissection"); };
  options.solver.own_complex = [&] { return ++complexes, make_solver<Complex>("supernodal/dissection"); };
  const RemeshResult own = remesh(asset, options, context).value();
  for (const RemeshReport* report : {&named.report, &own.report}) {
    CHECK(report->backends.field == "supernodal, nested dissection");
    CHECK(report->backends.target == "supernodal, nested dissection");
    CHECK(report->backends.map == "supernodal, nested dissection");
    CHECK((report->backends.surgery == "" || report->backends.surgery == "supernodal, nested dissection"));
    CHECK((report->backends.untangling == "" || report->backends.untangling == "supernodal, nested dissection"));
  }
  options.solver = "petsc";  // known, but not made from a name
  const auto refused = remesh(asset, options, context);
  REQUIRE(!refused);
  CHECK(refused.error().code == ErrorCode::unsupported);
  CHECK(own.report.field.solver == "own");
  CHECK(reals >= 2);  // sizes and target
  CHECK(complexes >= 2);
  CHECK(named.mesh.quads == own.mesh.quads);
  CHECK(named.mesh.positions == own.mesh.positions);
}

TEST_CASE("remesh: a surface that no map fits leaves the ladder once its work is spent", "[pipeline][slow]") {
  using namespace synthetic;
  // Each vertex is somewhere along its ray.
  Soup rough = sphere(40);
  std::mt19937_64 random(3);
  for (Vector3& p : rough.points) p *= 0.85 + 0.3 * static_cast<double>(random() % 1000) / 1000;
  const Asset asset = asset_of(rough);
  Context context;
  const auto result = remesh(asset, wanting(3000), context);
  REQUIRE(result);
  check_result(asset, *result);
  const ComponentReport& part = result->report.components.front();
  CHECK(std::any_of(part.reasons.begin(), part.reasons.end(),
                    [](const std::string& reason) { return reason.find("share of the work") != std::string::npos; }));
}

TEST_CASE("remesh: the units of a sharp tip go all around it, not side by side", "[pipeline]") {
  // A needle's tip: a fan of 24 triangles whose angles sum to a quarter turn and less.
  using namespace synthetic;
  constexpr int sides = 24, rings = 40;
  Soup cone;
  for (int j = 0; j < rings; ++j)
    for (int i = 0; i < sides; ++i) {
      const double t = (j + 1.0) / rings, angle = 2 * std::numbers::pi * i / sides;
      cone.points.push_back({0.2 * t * std::cos(angle), 0.2 * t * std::sin(angle), 1.5 * (1 - t)});
    }
  const Index tip = static_cast<Index>(cone.points.size()), bottom = tip + 1;
  cone.points.push_back({0, 0, 1.5});
  cone.points.push_back({0, 0, 0});
  for (int i = 0; i < sides; ++i) {
    const Index next = (i + 1) % sides;
    cone.faces.push_back({tip, i, next});
    for (int j = 0; j + 1 < rings; ++j) {
      const Index a = j * sides + i, b = j * sides + next;
      cone.faces.push_back({a, a + sides, b + sides});
      cone.faces.push_back({a, b + sides, b});
    }
    cone.faces.push_back({bottom, (rings - 1) * sides + next, (rings - 1) * sides + i});
  }
  const Asset asset = asset_of(cone);
  for (const Index wanted : {1000, 2000, 4000}) {
    Context context;
    const auto result = remesh(asset, wanting(wanted), context);
    REQUIRE(result);
    check_result(asset, *result);
    CHECK(result->report.components.front().rung == Rung::fine_map);
    CHECK(result->report.irregular == 8);
    CHECK(result->report.scaled_jacobian_minimum > 0.3);
  }
}

TEST_CASE("remesh: the count is met where the search for integers is used up before, and where a tip is thin",
          "[pipeline][slow]") {
  for (const SyntheticCase& c : synthetic_cases()) {
    // A tip of horns would be two quads around.
    if (c.name != "gear_24" && c.name != "horns") continue;
    const Asset asset = asset_of(c.make());
    Context context;
    const auto result = remesh(asset, wanting(20'000), context);
    REQUIRE(result);
    check_result(asset, *result);
    CHECK(std::abs(result->mesh.quad_count() - 20'000) <= 1000);
  }
}

TEST_CASE("remesh: units and places do not matter", "[pipeline]") {
  using namespace synthetic;
  const Soup soup = clipped(torus_mesh(30, 14, 1, 0.35), [](const Vector3& p) { return p[0] - 1.2; });
  for (const double factor : {1e-6, 1.0, 1e6})
    for (const Vector3& place : {Vector3(0, 0, 0), Vector3(1e3, -2e3, 5e2)}) {
      const Asset asset = asset_of(scaled(soup, factor, factor * place));
      Context context;
      const auto result = remesh(asset, wanting(500), context);
      REQUIRE(result);
      check_result(asset, *result);
      CHECK(std::abs(result->report.quads / 500.0 - 1) < 0.1);
      CHECK(result->report.components.front().rung == Rung::fine_map);
    }
}

TEST_CASE("remesh: bad options are refused by name", "[pipeline]") {
  const Asset asset = asset_of(synthetic::sphere(6));
  const auto refused = [&](auto change, std::string_view field) {
    RemeshOptions options;
    change(options);
    Context context;
    const auto result = remesh(asset, options, context);
    REQUIRE_FALSE(result);
    CHECK(result.error().code == ErrorCode::bad_option);
    CHECK(result.error().where.find(field) != std::string::npos);
  };
  refused([](RemeshOptions& o) { o.quads = 0; }, "quads");
  refused([](RemeshOptions& o) { o.quads = 1'000'000; }, "quads");
  refused([](RemeshOptions& o) { o.influences = 0; }, "influences");
  refused([](RemeshOptions& o) { o.count_tolerance = 0; }, "count_tolerance");
  refused([](RemeshOptions& o) { o.bend_degrees = 180; }, "bend_degrees");
  refused([](RemeshOptions& o) { o.crease_angle_radians = -1; }, "crease_angle_radians");
  refused([](RemeshOptions& o) { o.directions.posed = -1; }, "directions.posed");
  refused([](RemeshOptions& o) { o.preset = FieldPreset::thesis; }, "preset");
  refused([](RemeshOptions& o) { o.sizing = SizingOptions{}, o.sizing->gradation = 0; }, "sizing.gradation");
  refused([](RemeshOptions& o) { o.solver = "no such solver"; }, "no such solver");
}

TEST_CASE("remesh: no faces are an error, and a cancelled job says so", "[pipeline]") {
  Context context;
  const auto nothing = remesh(Asset{}, RemeshOptions{}, context);
  REQUIRE_FALSE(nothing);
  CHECK(nothing.error().code == ErrorCode::bad_input);
  std::atomic<bool> stop{true};
  context.cancel_flag = &stop;
  const auto stopped = remesh(asset_of(synthetic::sphere(30)), wanting(100'000), context);
  REQUIRE_FALSE(stopped);
  CHECK(stopped.error().code == ErrorCode::cancelled);
}
