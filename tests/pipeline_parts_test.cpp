// The parts of the pipeline by themselves: pieces, stand-ins, features, and what the caller adds of his own.
#include <numeric>

#include "corpus/synthetic.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/piece.hpp"
#include "quadrig/quads/from_uv.hpp"
#include "quadrig/quads/topology.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// A hilly sheet of n × n squares over [0, 1]².
TriangleMesh<double> hills(Index n) {
  const Grid grid{n, n};
  return build(grid.positions([&](Index i, Index j) -> Vector3 {
    const double x = 1.0 * i / n, y = 1.0 * j / n;
    return {x, y, 0.1 * std::sin(5 * x) * std::sin(4 * y)};
  }),
               grid.triangles());
}
TriangleMesh<double> part_torus(Index columns, Index rows) {
  const Grid grid{columns, rows, true, true};
  return build(torus_positions(grid, 1, 0.4), grid.triangles());
}
/// The edges along the line y = 1/2 of a sheet with an even number of squares.
EdgeMarks middle_line(const TriangleMesh<double>& mesh) {
  EdgeMarks marks(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    marks[at(h)] = std::abs(mesh.position(mesh.origin(h)).y() - 0.5) < 1e-9 &&
                   std::abs(mesh.position(mesh.target(h)).y() - 0.5) < 1e-9;
  return marks;
}
bool same_on_both_sides(const TriangleMesh<double>& mesh, const EdgeMarks& marks) {
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) != no_index && marks[at(h)] != marks[at(mesh.twin(h))]) return false;
  return true;
}
double marked_length(const TriangleMesh<double>& mesh, const EdgeMarks& marks) {
  double sum = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (marks[at(h)] && mesh.is_representative(h)) sum += mesh.edge_vector(h).norm();
  return sum;
}
RemeshOptions plain_options(Index quads) {
  RemeshOptions options;
  options.quads = quads;
  options.preset = FieldPreset::flat;
  options.fit.method = FitMethod::none;
  return options;
}
/// Alignment that owns its targets.
struct OwnedWish {
  std::vector<Complex> x0;
  std::vector<double> weight;
  [[nodiscard]] static constexpr std::string_view name() { return "wish"; }
  void for_each_row(EmitRow<Complex> emit) const { Alignment<>(x0, weight).for_each_row(emit); }
};

/// Mean angle between the edges of quads whose middle fulfils a condition and the nearer of a direction in the plane
/// and the one across it, degrees in [0, 45].
double mean_off(const QuadMesh& quads, const Vector3& direction, function_ref<bool(const Vector3&)> where) {
  int near = 0;
  double off = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Vector3 a = quads.positions.row(quads.quads(q, i)).transpose(),
                    b = quads.positions.row(quads.quads(q, (i + 1) % 4)).transpose();
      if (!where((a + b) / 2)) continue;
      const double angle = std::atan2(b.y() - a.y(), b.x() - a.x()) - std::atan2(direction.y(), direction.x());
      off += std::abs(std::remainder(angle, std::numbers::pi / 2)) * 180 / std::numbers::pi;
      ++near;
    }
  REQUIRE(near > 20);
  return off / near;
}

}  // namespace

TEST_CASE("pieces: a component keeps its faces, positions and weights", "[parts][fast]") {
  // Two tori, their faces mixed.
  const TriangleMesh<double> one = part_torus(12, 8);
  Points<double> points(2 * one.vertex_count(), 3);
  points << one.positions(), one.positions().rowwise() + Eigen::RowVector3d(5, 0, 0);
  Triangles faces(2 * one.face_count(), 3);
  for (Index f = 0; f < one.face_count(); ++f) {
    faces.row(2 * f) = one.faces().row(f);
    faces.row(2 * f + 1) = one.faces().row(f).array() + one.vertex_count();
  }
  Asset asset{build(std::move(points), std::move(faces)), Rig{}};
  asset.rig->skeleton.bones.resize(2);
  asset.rig->weights.resize(asset.mesh.vertex_count(), 2);
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) asset.rig->weights.insert(v, v % 2) = 1;
  std::vector<Index> second;
  for (Index f = 1; f < asset.mesh.face_count(); f += 2) second.push_back(f);
  const quadrig::detail::Piece piece = quadrig::detail::make_piece(asset, second);
  CHECK(piece.parent == second);
  REQUIRE(piece.asset.mesh.face_count() == one.face_count());
  CHECK(piece.asset.mesh.vertex_count() == one.vertex_count());
  std::vector<Index> number(at(piece.asset.mesh.vertex_count()), no_index);
  for (Index f = 0; f < one.face_count(); ++f)
    for (int i = 0; i < 3; ++i) {
      const Index v = piece.asset.mesh.faces()(f, i), w = asset.mesh.faces()(piece.parent[at(f)], i);
      CHECK(piece.asset.mesh.position(v) == asset.mesh.position(w));
      CHECK(piece.asset.rig->weights.coeff(v, w % 2) == 1);
      CHECK((number[at(v)] == no_index || number[at(v)] == w));
      number[at(v)] = w;
    }
}

TEST_CASE("pieces: refined ones have short edges, keep marks, and refuse to become too many", "[parts][fast]") {
  Context context;
  quadrig::detail::Piece piece;
  piece.asset.mesh = hills(8);
  piece.kept = middle_line(piece.asset.mesh);
  piece.parent.resize(at(piece.asset.mesh.face_count()));
  std::iota(piece.parent.begin(), piece.parent.end(), Index{0});
  const TriangleMesh<double> before = piece.asset.mesh;
  const double length = marked_length(before, piece.kept);
  quadrig::detail::Piece refused = piece;
  CHECK(refine_piece(refused, 0.001, 100, context).error().code == ErrorCode::unsupported);
  REQUIRE(refine_piece(piece, 0.05, 100'000, context));
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) CHECK(mesh.edge_vector(h).norm() <= 0.05);
  CHECK(same_on_both_sides(mesh, piece.kept));
  CHECK(marked_length(mesh, piece.kept) == Approx(length));
  std::vector<double> area(at(before.face_count()), 0.0);
  for (Index f = 0; f < mesh.face_count(); ++f) area[at(piece.parent[at(f)])] += mesh.area(f);
  for (Index f = 0; f < before.face_count(); ++f) CHECK(area[at(f)] == Approx(before.area(f)));
}

TEST_CASE("pieces: no edge inside joins two vertices of lines once these are freed", "[parts][fast]") {
  TriangleMesh<double> mesh = hills(6);
  EdgeMarks kept = middle_line(mesh);
  for (const Index h : {Index{0}, Index{1}, Index{2}})  // a triangle all of lines
    kept[at(h)] = 1, kept[at(mesh.twin(h) == no_index ? h : mesh.twin(h))] = 1;
  int rounds = 0;
  while (std::optional<Refinement> freed = quadrig::detail::border_freed(mesh, kept)) {
    REQUIRE(++rounds < 5);
    kept = quadrig::detail::carried_marks(mesh, kept, *freed);
    mesh = std::move(freed->mesh);
  }
  CHECK(rounds > 0);
  const EdgeMarks lines = joined_marks(border_marks(mesh), kept);
  std::vector<char> on_line(at(mesh.vertex_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (lines[at(h)]) on_line[at(mesh.origin(h))] = on_line[at(mesh.target(h))] = 1;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (!lines[at(h)]) CHECK_FALSE((on_line[at(mesh.origin(h))] && on_line[at(mesh.target(h))]));
  for (Index f = 0; f < mesh.face_count(); ++f)
    CHECK_FALSE((lines[at(3 * f)] && lines[at(3 * f + 1)] && lines[at(3 * f + 2)]));
}

TEST_CASE("stand-in: the surface's topology, lines and places on fewer triangles", "[parts]") {
  Context context;
  const bool open = GENERATE(false, true);
  const TriangleMesh<double> mesh = open ? hills(60) : part_torus(90, 40);
  const EdgeMarks kept = open ? middle_line(mesh) : EdgeMarks{};
  const quadrig::detail::StandIn made = quadrig::detail::make_stand_in(mesh, kept, 1500, context).value();
  CHECK(made.mesh.face_count() > 1000);
  CHECK(made.mesh.face_count() < 2000);
  const SurfaceTopology here(made.mesh), there(mesh);
  CHECK(here.euler == there.euler);
  CHECK(here.loops == there.loops);
  REQUIRE(made.source.size() == at(made.mesh.vertex_count()));
  for (Index v = 0; v < made.mesh.vertex_count(); ++v)
    CHECK((position(mesh, made.source[at(v)]) - made.mesh.position(v)).norm() < 1e-12);
  if (open) {
    CHECK(same_on_both_sides(made.mesh, made.kept));
    CHECK(marked_length(made.mesh, made.kept) == Approx(marked_length(mesh, kept)).epsilon(0.02));
  }

  const quadrig::detail::OntoSurface onto(made.mesh, made.source, made.kept, mesh, kept);
  const double edge = std::sqrt(mesh.total_area() / 750);
  for (Index h = 0; h < made.mesh.halfedge_count(); ++h) {
    SurfacePoint corner{h / 3, Vector3::Unit(h % 3)};
    CHECK((position(mesh, onto(corner)) - made.mesh.position(made.mesh.origin(h))).norm() < 1e-12);
    SurfacePoint middle{h / 3, Vector3::Zero()};
    middle.barycentric[h % 3] = middle.barycentric[(h + 1) % 3] = 0.5;
    const Vector3 p = position(mesh, onto(middle));
    CHECK((p - position(made.mesh, middle)).norm() < edge);
    if (open && made.kept[at(h)]) CHECK(std::abs(p.y() - 0.5) < 1e-9);  // along the line, not off it
    if (made.mesh.twin(h) == no_index) CHECK(std::min({p.x(), p.y(), 1 - p.x(), 1 - p.y()}) < 1e-9);
  }
  if (open) {
    // Marks of its border are those of the surface's.
    const auto low = [](const TriangleMesh<double>& of) {
      EdgeMarks marks(at(of.halfedge_count()), 0);
      for (Index h = 0; h < of.halfedge_count(); ++h)
        marks[at(h)] =
            of.twin(h) == no_index && of.position(of.origin(h)).y() < 1e-9 && of.position(of.target(h)).y() < 1e-9;
      return marks;
    };
    const EdgeMarks marks = low(made.mesh);
    CHECK(marked_length(made.mesh, marks) == Approx(marked_length(mesh, low(mesh))).epsilon(0.02));
    CHECK(quadrig::detail::border_marks_of(made.mesh, made.source, mesh, low(mesh)) == marks);
  }
  // A million triangles are refused nowhere, but a cancelled call ends.
  std::atomic<bool> stop{true};
  context.cancel_flag = &stop;
  CHECK(quadrig::detail::make_stand_in(mesh, kept, 1500, context).error().code == ErrorCode::cancelled);
}

TEST_CASE("needles: surfaces too thin for a quad, made of slivers, have one attempt", "[parts][fast]") {
  // Two cones on one ring: of 1 beside the length they are needles, unless quads are as small.
  const auto remeshed = [](double length, Index quads) {
    constexpr Index sides = 12;
    Points<double> positions(sides + 2, 3);
    Triangles faces(2 * sides, 3);
    for (Index s = 0; s < sides; ++s) {
      const double turn = 2 * std::numbers::pi * s / sides;
      positions.row(s) << std::cos(turn), std::sin(turn), 0;
      faces.row(2 * s) << s, (s + 1) % sides, sides;
      faces.row(2 * s + 1) << (s + 1) % sides, s, sides + 1;
    }
    positions.row(sides) << 0, 0, length;
    positions.row(sides + 1) << 0, 0, -0.1;
    Context context;
    RemeshOptions options = plain_options(quads);
    const auto result = remesh(Asset{build(positions, faces), {}}, options, context);
    REQUIRE(result.has_value());
    return result->report.components.front();
  };
  const ComponentReport needle = remeshed(1e4, 100);
  CHECK(needle.rung == Rung::split);
  CHECK(needle.reasons.size() <= 1);
  CHECK(remeshed(4, 100).rung != Rung::split);
  // A strip as thin is a map at once.
  const Grid strip{1, 1};
  Context context;
  const auto thin = remesh(
      Asset{build(strip.positions([](Index i, Index j) { return Vector3(i, 1e-5 * j, 0); }), strip.triangles()), {}},
      plain_options(300), context);
  REQUIRE(thin.has_value());
  CHECK(thin->report.components.front().rung == Rung::fine_map);
  CHECK(thin->report.irregular == 0);
}

TEST_CASE("features: marks come from the caller and from creases, short ones go, and pieces take theirs",
          "[parts][fast]") {
  const Asset asset{hills(10), std::nullopt};
  const TriangleMesh<double>& mesh = asset.mesh;
  RemeshOptions options;
  CHECK(quadrig::detail::kept_edges(asset, options).empty());
  Index inner = 0, border = 0;
  while (mesh.twin(inner) == no_index) ++inner;
  while (mesh.twin(border) != no_index) ++border;
  options.features = {border};  // the border is kept without being asked
  CHECK(quadrig::detail::kept_edges(asset, options).empty());
  options.features = {inner, border};
  EdgeMarks marks = quadrig::detail::kept_edges(asset, options);
  CHECK(std::accumulate(marks.begin(), marks.end(), 0) == 2);
  CHECK(same_on_both_sides(mesh, marks));

  marks = joined_marks(std::move(marks), middle_line(mesh));
  const double line = marked_length(mesh, middle_line(mesh));
  quadrig::detail::drop_short(mesh, 0.5 * line, marks);
  CHECK(marked_length(mesh, marks) == Approx(line));
  quadrig::detail::drop_short(mesh, 2 * line, marks);
  CHECK(marked_length(mesh, marks) == 0);

  std::vector<Index> some(at(mesh.face_count() / 2));
  std::iota(some.begin(), some.end(), Index{0});
  const EdgeMarks all = middle_line(mesh), part = quadrig::detail::marks_of(all, some);
  REQUIRE(part.size() == 3 * some.size());
  CHECK(std::equal(part.begin(), part.end(), all.begin()));
  CHECK(quadrig::detail::marks_of(EdgeMarks(all.size(), 0), some).empty());
}

TEST_CASE("features: how much was kept is measured along edges of quads", "[parts][fast]") {
  const Index n = 12;
  const Grid fine{n, n}, coarse{6, 6};
  const TriangleMesh<double> mesh = hills(n);
  QuadMesh quads;
  quads.quads = coarse.quads();
  quads.positions.resize(coarse.vertex_count(), 3);
  for (Index j = 0; j <= 6; ++j)
    for (Index i = 0; i <= 6; ++i) {
      const Index v = fine.vertex(2 * i, 2 * j), h = mesh.outgoing(v);
      quads.positions.row(coarse.vertex(i, j)) = mesh.position(v).transpose();
      quads.source.push_back({h / 3, Vector3::Unit(h % 3)});
    }
  const EdgeMarks line = middle_line(mesh);
  const quadrig::detail::Kept kept = quadrig::detail::measure_kept(mesh, line, quads);
  CHECK(kept.as_quads == Approx(marked_length(mesh, line)));
  CHECK(std::accumulate(kept.vertex.begin(), kept.vertex.end(), 0) == 7);
  CHECK(quadrig::detail::measure_kept(mesh, {}, quads).as_quads == 0);
}

TEST_CASE("own: directions on faces turn the quads there, as a wish or exactly", "[parts]") {
  const Asset asset{hills(30), {}};
  const auto middle = [](const Vector3& p) { return std::abs(p.x() - 0.5) < 0.15 && std::abs(p.y() - 0.5) < 0.15; };
  const Vector3 slanted(3, 1, 0);
  Context context;
  RemeshOptions options = plain_options(700);
  options.directions.curvature = 0;
  const auto off = [&] { return mean_off(remesh(asset, options, context).value().mesh, slanted, middle); };
  const double plain = off();
  CHECK(plain > 14);
  const auto wish = [&](double weight) {
    options.directions.own.clear();
    for (Index f = 0; f < asset.mesh.face_count(); ++f)
      if (middle(asset.mesh.position(asset.mesh.faces()(f, 0)))) options.directions.own.push_back({f, slanted, weight});
  };
  wish(std::numeric_limits<double>::infinity());
  CHECK(off() < 0.6 * plain);
  wish(20);
  CHECK(off() < 0.6 * plain);
  wish(0);
  CHECK(off() == Approx(plain).margin(0.1));

  // The same by a term of one's own, asked for on whatever triangles the field is made on.
  options.directions.own.clear();
  options.directions.terms = [&](const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                 std::span<const Index> parent) {
    OwnedWish wanted{std::vector<Complex>(at(mesh.face_count())), std::vector<double>(at(mesh.face_count()), 0.0)};
    for (Index f = 0; f < mesh.face_count(); ++f)
      if (middle(asset.mesh.position(asset.mesh.faces()(parent[at(f)], 0)))) {
        const Complex d = connection.to_complex(f, slanted);
        wanted.x0[at(f)] = -integer_power(d / std::abs(d), 4);
        wanted.weight[at(f)] = 1;
      }
    OwnTerms terms;
    terms.x0.emplace_back(std::move(wanted));
    return terms;
  };
  CHECK(off() < 0.6 * plain);
}

TEST_CASE("own: a field of one's own on every face is the field of the quads", "[parts]") {
  const Asset asset{part_torus(48, 24), {}};
  const Connection<double> connection(asset.mesh);
  FrameField frames;
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {  // spirals around the tube
    const Vector3 p = asset.mesh.position(asset.mesh.faces()(f, 0));
    const Vector3 around = Vector3(-p.y(), p.x(), 0).normalized();
    const Vector3 n = asset.mesh.normal(f), tube = n.cross(around).normalized();
    const Complex u = connection.to_complex(f, around + tube);
    frames.u.push_back(u / std::abs(u));
    frames.v.push_back(Complex(0, 1) * frames.u.back());
  }
  RemeshOptions options = plain_options(800);
  options.directions.own = face_directions(connection, frames);
  Context context;
  const RemeshResult result = remesh(asset, options, context).value();
  CHECK(result.report.components[0].singularities == 0);
  CHECK(result.report.irregular == 0);
  CHECK(result.report.field.fixed_faces >= asset.mesh.face_count());
  int near = 0, along = 0;
  for (Index q = 0; q < result.mesh.quad_count(); ++q) {
    const Vector3 a = result.mesh.positions.row(result.mesh.quads(q, 0)).transpose(),
                  b = result.mesh.positions.row(result.mesh.quads(q, 1)).transpose();
    const Vector3 around = Vector3(-a.y(), a.x(), 0).normalized();
    ++near;
    along += std::abs(std::abs((b - a).normalized().dot(around)) - std::sqrt(0.5)) < 0.25;
  }
  CHECK(along > 0.8 * near);
}

TEST_CASE("own: densities on vertices and on faces say where the quads go", "[parts]") {
  const Asset asset{hills(30), {}};
  Context context;
  const auto ratio = [&](const RemeshOptions& options) {
    const RemeshResult result = remesh(asset, options, context).value();
    CHECK(std::abs(result.report.quads - 900) <= 45);
    double left = 0, right = 0;
    for (Index q = 0; q < result.mesh.quad_count(); ++q) {
      double x = 0;
      for (int i = 0; i < 4; ++i) x += result.mesh.positions(result.mesh.quads(q, i), 0) / 4;
      left += x < 0.3;
      right += x > 0.7;
    }
    return right / left;
  };
  RemeshOptions options = plain_options(900);
  CHECK(ratio(options) == Approx(1).margin(0.3));
  options.sizing.emplace();
  options.sizing->gradation = 1;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v)
    options.sizing->own_density.push_back(asset.mesh.position(v).x() > 0.6 ? 4 : 1);
  CHECK(ratio(options) > 1.7);
  options.sizing->own_density.clear();
  for (Index f = 0; f < asset.mesh.face_count(); ++f)
    options.sizing->own_density.push_back(asset.mesh.position(asset.mesh.faces()(f, 0)).x() > 0.6 ? 4 : 1);
  CHECK(ratio(options) > 1.7);

  options.sizing->own_density.pop_back();
  CHECK(remesh(asset, options, context).error().where == "sizing.own_density");
  options.sizing->own_density.assign(at(asset.mesh.vertex_count()), 1);
  options.sizing->own_density[3] = 0;
  CHECK(remesh(asset, options, context).error().where == "sizing.own_density");
  options = plain_options(900);
  options.directions.own = {{asset.mesh.face_count(), Vector3(1, 0, 0), 1}};
  CHECK(remesh(asset, options, context).error().where == "directions.own");
}

TEST_CASE("maps: what comes out with the quads is their grid", "[parts]") {
  const Asset asset{part_torus(60, 30), {}};
  RemeshOptions options = plain_options(500);
  options.keep_maps = true;
  Context context;
  const RemeshResult result = remesh(asset, options, context).value();
  REQUIRE(result.maps.size() == 1);
  const ComponentMap& map = result.maps[0];
  REQUIRE(map.rung == Rung::fine_map);
  REQUIRE(map.z.size() == at(map.mesh.halfedge_count()));
  CHECK(map_area(map.z) == Approx(result.mesh.quad_count()));
  CornerUv uv(map.mesh.halfedge_count(), 2);
  for (Index h = 0; h < map.mesh.halfedge_count(); ++h) uv.row(h) << map.z[at(h)].real(), map.z[at(h)].imag();
  const UvQuads again = quads_from_uv(map.mesh, uv, UvQuadsOptions{}, context).value();
  CHECK(again.own_grid);
  CHECK(again.mesh.quad_count() == result.mesh.quad_count());
  // Off the cut the parameters do not jump.
  for (Index h = 0; h < map.mesh.halfedge_count(); ++h)
    if (!map.cut[at(h)]) CHECK(std::abs(map.z[at(h)] - map.z[at(map.mesh.next(map.mesh.twin(h)))]) < 1e-6);
  options.keep_maps = false;
  const RemeshResult without = remesh(asset, options, context).value();
  CHECK(without.maps.empty());
  CHECK(without.mesh.positions == result.mesh.positions);
}
