// Operations on the singularities of a field, and the edges along which its map is straight.
#include <numeric>

#include "map_shapes.hpp"
#include "quadrig/field/surgery.hpp"
#include "quadrig/quads/integer_map.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

Index units(const FieldResult& field) {
  return std::accumulate(field.singularities.index4.begin(), field.singularities.index4.end(), Index{0});
}
/// What every field has to keep: the indices are those of its matching, the report counts them, frames and matching go
/// together.
void check_field(const FieldCase& c, const FieldResult& field) {
  const Singularities again = singularities(c.mesh, field.matching).value();
  CHECK(again.index4 == field.singularities.index4);
  CHECK(again.plus == field.singularities.plus);
  CHECK(again.minus == field.singularities.minus);
  CHECK(field.report.singularities_plus == field.singularities.plus);
  CHECK(field.report.singularities_minus == field.singularities.minus);
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Index g = c.mesh.twin(h);
    if (g == no_index) continue;
    // Vector 0 of the face, carried over and turned by ρ, is vector r of the face across.
    const double here = std::arg(field.frames.u[at(h / 3)]) - std::arg(c.connection.edge(h)),
                 there = std::arg(field.frames.u[at(g / 3)]) - std::arg(-c.connection.edge(g));
    const double off = here - field.matching.rho[at(h)] - there - field.matching.r[at(h)] * std::numbers::pi / 2;
    REQUIRE(std::abs(std::remainder(off, 2 * std::numbers::pi)) < 1e-6);
  }
}
Index regular_inner(const FieldCase& c, const FieldResult& field, Index from = 0) {
  for (Index v = from; v < c.mesh.vertex_count(); ++v) {
    if (c.mesh.outgoing(v) == no_index || c.mesh.on_boundary(v)) continue;
    if (field.singularities.index4[at(v)] == 0) return v;
  }
  return no_index;
}

}  // namespace

TEST_CASE("surgery: a unit moves from vertex to vertex, and frames follow", "[seamless]") {
  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  check_field(c, c.field);
  Context context;
  FieldSurgery surgery(c.mesh, c.field);
  const Index v = regular_inner(c, c.field), h = c.mesh.outgoing(v);
  const Index there = c.field.singularities.index4[at(c.mesh.target(h))];
  surgery.move_unit(h);
  CHECK(surgery.field().singularities.index4[at(v)] == -1);
  CHECK(surgery.field().singularities.index4[at(c.mesh.target(h))] == there + 1);
  REQUIRE(surgery.apply({}, context));
  check_field(c, surgery.field());
  CHECK(units(surgery.field()) == units(c.field));
  // The polynomial is still that of the frames, but for the scale that the test gave these.
  const FieldResult moved = std::move(surgery).release();
  for (std::size_t f = 0; f < moved.frames.u.size(); ++f) {
    const Complex x0 = moved.frames.u[f] * moved.frames.u[f] * moved.frames.v[f] * moved.frames.v[f];
    const Complex was = c.field.frames.u[f] * c.field.frames.u[f] * c.field.frames.v[f] * c.field.frames.v[f];
    const Complex turn = (x0 / was) / (moved.polynomial.x0[f] / c.field.polynomial.x0[f]);
    REQUIRE(std::abs(turn - 1.0) < 1e-9);
  }
  // And back: nothing is left of it.
  FieldSurgery back(c.mesh, moved);
  back.move_unit(c.mesh.twin(h));
  REQUIRE(back.apply({}, context));
  CHECK(back.field().singularities.index4 == c.field.singularities.index4);
}

TEST_CASE("surgery: faces that are held keep their frames", "[seamless]") {
  const FieldCase c = field_case(closed_surface(0), 0, 0.12);
  Context context;
  FieldSurgery surgery(c.mesh, c.field);
  surgery.move_unit(c.mesh.outgoing(regular_inner(c, c.field)));
  std::vector<char> held(at(c.mesh.face_count()), 0);
  for (std::size_t f = 0; f < held.size(); f += 3) held[f] = 1;
  REQUIRE(surgery.apply(held, context));
  Index turned = 0;
  for (std::size_t f = 0; f < held.size(); ++f) {
    const double moved = std::abs(surgery.field().frames.u[f] - c.field.frames.u[f]);
    if (held[f]) CHECK(moved == 0);
    turned += moved > 1e-9;
  }
  CHECK(turned > 0);
  check_field(c, surgery.field());
}

TEST_CASE("surgery: tips are split until quads can have them", "[seamless]") {
  for (const int units_there : {2, 3, 4, -4, -6}) {
    const FieldCase c = field_case(closed_surface(0), 0, 0.12);
    Context context;
    FieldSurgery surgery(c.mesh, c.field);
    // All units gathered at one vertex, out of others around it.
    const Index v = regular_inner(c, c.field, c.mesh.vertex_count() / 2);
    Index h = c.mesh.outgoing(v);
    for (int k = 0; k < std::abs(units_there); ++k) {
      surgery.move_unit(units_there > 0 ? c.mesh.twin(h) : h);
      h = c.mesh.next_around(h);
      if (h == c.mesh.outgoing(v)) h = c.mesh.next_around(h);
    }
    REQUIRE(surgery.field().singularities.index4[at(v)] == units_there);
    CHECK(surgery.split_extremes(0.1, context) > 0);
    REQUIRE(surgery.apply({}, context));
    check_field(c, surgery.field());
    CHECK(units(surgery.field()) == units(c.field));
    for (const Index i : surgery.field().singularities.index4) {
      CHECK(i <= 1);
      CHECK(i >= -3);
    }
  }
}

TEST_CASE("surgery: close pairs cancel, far ones only where singularities are too many", "[seamless]") {
  const FieldCase c = field_case(closed_surface(1), 0, 0.12);
  Context context;
  FieldSurgery made(c.mesh, c.field);
  const Index v = regular_inner(c, c.field), h = c.mesh.outgoing(v);
  made.move_unit(h);
  const double edge = c.mesh.edge_vector(h).norm();
  const FieldResult pair = made.field();
  const auto count = [](const FieldResult& field) {
    return std::ranges::count_if(field.singularities.index4, [](Index i) { return i != 0; });
  };
  FieldSurgery near(c.mesh, pair);
  CHECK(near.cancel_pairs(1.01 * edge, 0, 1e9) >= 1);
  CHECK(count(near.field()) < count(pair));
  FieldSurgery enough(c.mesh, pair);
  CHECK(enough.cancel_pairs(0.5 * edge, 1.01 * edge, 1e9) == 0);
  FieldSurgery crowded(c.mesh, pair);
  CHECK(crowded.cancel_pairs(0.5 * edge, 1.01 * edge, 0) >= 1);
  // Near a face of it the pair is found; where there is none nothing is.
  FieldSurgery around(c.mesh, pair);
  const std::vector<Index> faces{TriangleMesh<double>::face_of(h)};
  CHECK(around.cancel_near(faces));
  CHECK(count(around.field()) < count(pair));
  while (around.cancel_pairs(1e9, 0, 1e9) > 0) continue;
  CHECK_FALSE(around.cancel_near(faces));
}

TEST_CASE("surgery: a repaired field is one that quads can have", "[seamless]") {
  for (const int which : {0, 1, 2}) {
    const FieldCase c = field_case(closed_surface(which), 1, 0.12);
    Context context;
    const FieldResult field = repair_singularities(c.mesh, c.field, {.edge = 0.12, .quads = 400}, context).value();
    check_field(c, field);
    CHECK(units(field) == units(c.field));
    for (Index v = 0; v < c.mesh.vertex_count(); ++v) {
      CHECK(field.singularities.index4[at(v)] <= 1);
      CHECK(field.singularities.index4[at(v)] >= -3);
    }
  }
}

TEST_CASE("aligned edges: the border is, and kept edges that the field follows", "[seamless]") {
  const Index n = 8;
  const Grid grid{n, n};
  const TriangleMesh<double> mesh =
      build(grid.positions([&](Index i, Index j) -> Vector3 { return Vector3(i, j, 0); }), grid.triangles());
  const Connection<double> connection(mesh);
  const auto frames_at = [&](double angle) {
    FrameField frames;
    for (Index f = 0; f < mesh.face_count(); ++f) {
      frames.u.push_back(connection.to_complex(f, Vector3(std::cos(angle), std::sin(angle), 0)));
      frames.v.push_back(frames.u.back() * Complex(0, 1));
    }
    return frames;
  };
  EdgeMarks kept(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    kept[at(h)] = std::abs(mesh.position(mesh.origin(h)).y() - 4) < 1e-9 &&
                  std::abs(mesh.position(mesh.target(h)).y() - 4) < 1e-9;
  const auto aligned = [&](const FrameField& frames, const EdgeMarks& marks) {
    const Matching matching = match(mesh, connection, frames);
    const Singularities none = singularities(mesh, matching).value();
    std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
    for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(matching.r[h] & 3);
    const CutGraph cut = make_cut_graph(mesh, rotation, none.index4);
    auto edges = aligned_edges(mesh, connection, cut, matching, frames, marks);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)  // as if no chart were turned
      if (edges[at(h)] != Aligned::none && (cut.combing[at(h / 3)] & 1))
        edges[at(h)] = edges[at(h)] == Aligned::u_constant ? Aligned::v_constant : Aligned::u_constant;
    return edges;
  };
  const auto straight = aligned(frames_at(0), kept), free = aligned(frames_at(0), {});
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const bool border = mesh.twin(h) == no_index, across = std::abs(mesh.edge_vector(h).y()) > 0.5;
    const Aligned wanted = across ? Aligned::u_constant : Aligned::v_constant;
    CHECK(straight[at(h)] == (border || kept[at(h)] ? wanted : Aligned::none));
    CHECK(free[at(h)] == (border ? wanted : Aligned::none));
  }
  // Three degrees off is farther than a field that was made to follow an edge can be.
  const auto turned = aligned(frames_at(0.06), kept);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) != no_index) CHECK(turned[at(h)] == Aligned::none);
  // Two kept edges an eighth of a turn apart, both followed by nothing between them: at most one stays.
  EdgeMarks both = kept;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) != no_index && std::abs(mesh.edge_vector(h).x()) > 0.5 && std::abs(mesh.edge_vector(h).y()) > 0.5)
      both[at(h)] = 1;
  const auto diagonals = aligned(frames_at(0), both);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (both[at(h)] && !kept[at(h)]) CHECK(diagonals[at(h)] == Aligned::none);
}

TEST_CASE("aligned edges: where one quad would have three corners in a line, one of the edges is let go",
          "[seamless][fast]") {
  // A fan, and a straight line of two spokes through its middle; on one side the field turns by `turn` less than it.
  const Index n = 24;
  Points<double> places(n + 1, 3);
  Triangles faces(n, 3);
  places.row(n).setZero();
  for (Index k = 0; k < n; ++k) {
    const double angle = 2 * std::numbers::pi * k / n;
    places.row(k) << std::cos(angle), std::sin(angle), 0;
    faces.row(k) << n, k, (k + 1) % n;
  }
  const TriangleMesh<double> mesh = build(places, faces);
  const Connection<double> connection(mesh);
  EdgeMarks kept(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    for (const Index end : {0, n / 2})
      if ((mesh.origin(h) == n && mesh.target(h) == end) || (mesh.target(h) == n && mesh.origin(h) == end))
        kept[at(h)] = 1;
  const auto aligned_spokes = [&](double turn) {
    FrameField frames;
    for (Index f = 0; f < n; ++f) {
      const double below = std::clamp((f + 0.5 - n / 2 - 1) / (n / 2 - 2), 0.0, 1.0), angle = turn * below;
      frames.u.push_back(connection.to_complex(f, Vector3(std::cos(angle), std::sin(angle), 0)));
      frames.v.push_back(frames.u.back() * Complex(0, 1));
    }
    const Matching matching = match(mesh, connection, frames);
    const Singularities index = singularities(mesh, matching).value();
    CHECK(index.index4[at(n)] == static_cast<Index>(std::lround(turn / (std::numbers::pi / 2))));
    std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
    for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(matching.r[h] & 3);
    const CutGraph cut = make_cut_graph(mesh, rotation, index.index4);
    const std::vector<Aligned> edges = aligned_edges(mesh, connection, cut, matching, frames, kept);
    int spokes = 0;
    for (Index h = 0; h < mesh.halfedge_count(); ++h) spokes += kept[at(h)] && edges[at(h)] != Aligned::none;
    return spokes / 2;
  };
  CHECK(aligned_spokes(0) == 2);                      // two quads on each side
  CHECK(aligned_spokes(std::numbers::pi / 2) == 1);   // one below
  CHECK(aligned_spokes(-std::numbers::pi / 2) == 2);  // three
}

TEST_CASE("seamless map: valid, at the count that is asked for, and a defect is an error with its place",
          "[seamless]") {
  const int which = GENERATE(0, 1, 2, 3, 4);
  const FieldCase c = field_case(which < 3 ? closed_surface(which) : open_surface(which - 3), 0, 0.12);
  REQUIRE(mappable(c));
  Context context;
  const SeamlessMap map = seamless_map(c.mesh, c.connection, c.field, SeamlessOptions{.quads = 640}, context).value();
  CHECK(map.valid());
  CHECK(check_map(c.mesh, map.index4, map.z).valid());
  CHECK(map_area(map.z) == quadrig::test::Approx(640));
  CHECK(map.index4 == c.index());
  CHECK(map.report.map_backend != "");
  for (Index h = 0; h < c.mesh.halfedge_count(); ++h) {
    const Index g = c.mesh.twin(h);
    const Complex here = map.z[at(c.mesh.next(h))] - map.z[at(h)];
    if (map.aligned[at(h)] == Aligned::v_constant) CHECK(std::abs(here.imag()) < 1e-9);
    if (map.aligned[at(h)] == Aligned::u_constant) CHECK(std::abs(here.real()) < 1e-9);
    if (g == no_index) {
      CHECK(map.aligned[at(h)] != Aligned::none);
      continue;
    }
    const Complex there = map.z[at(g)] - map.z[at(c.mesh.next(g))];
    REQUIRE(std::abs(rotated(here, map.cut.rotation[at(h)]) - there) < 1e-9);
  }
  SeamlessOptions bad;
  bad.quads = -1;
  CHECK(seamless_map(c.mesh, c.connection, c.field, bad, context).error().where == "seamless.quads");
  bad = {};
  bad.kept.assign(3, 1);
  CHECK(seamless_map(c.mesh, c.connection, c.field, bad, context).error().where == "seamless.kept");

  const IntegerMap integers = integer_map(c.mesh, map, IntegerOptions{.quads = 640}, context).value();
  CHECK(std::abs(integers.found.integers.quads - 640) <= 32);
  const QuadMesh quads = quad_mesh(c.mesh, extract(c.mesh, map, integers, context).value());
  CHECK(quads.quad_count() == static_cast<Index>(std::lround(integers.found.integers.quads)));
  CHECK(unlike(quad_topology(quads.quads, quads.vertex_count()), SurfaceTopology(c.mesh)) == "");
  CHECK(integer_map(c.mesh, map, IntegerOptions{.quads = 0}, context).error().where == "integers.quads");
  CHECK(integer_map(c.mesh, map, IntegerOptions{.quads = 640, .most_quads = 10}, context).error().code ==
        ErrorCode::stage_failed);
}
