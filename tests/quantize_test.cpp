#include "map_shapes.hpp"
#include "quadrig/quantize/rings.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;
Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }

/// Angle of every vertex of a coarse map in quarter turns, from vectors a half-edge.
template <class Vector>
std::vector<double> cones(const CoarseMap& map, Index vertices, const std::vector<Vector>& vector) {
  std::vector<double> cone(at(vertices), 0);
  const auto field = [&](Index h) {
    if constexpr (std::is_same_v<Vector, Gaussian>)
      return to_field(vector[at(h)]);
    else
      return vector[at(h)];
  };
  for (Index h = 0; h < map.halfedge_count(); ++h)
    cone[at(map.origin[at(h)])] += std::arg(-field(prev(h)) / field(h)) / (std::numbers::pi / 2);
  return cone;
}

struct CoarseCase {
  FieldCase field;
  std::vector<Complex> z;
  CoarseMap map;
};
CoarseCase coarse_case(int which, std::uint64_t seed) {
  FieldCase c = field_case(which < 3 ? closed_surface(which) : open_surface(which - 3), seed, 0.12);
  REQUIRE(mappable(c));
  std::vector<Complex> z;
  bool valid = false;
  if (c.pinned) {
    auto map = seamless_case<double>(c);
    z = std::move(map.z);
    valid = map.valid;
  } else {
    auto map = seamless_case<Complex>(c);
    z = std::move(map.z);
    valid = map.valid;
  }
  REQUIRE(valid);
  CoarseMap map = decimate_map(c.mesh, c.cut, c.index(), c.aligned, z);
  return {std::move(c), std::move(z), std::move(map)};
}

}  // namespace

TEST_CASE("quantize: decimation keeps the flat metric", "[quantize]") {
  const int which = GENERATE(0, 1, 2, 3, 4, 5);
  const CoarseCase c = coarse_case(which, 0);
  const CoarseMap& map = c.map;
  REQUIRE(map.face_count() > 0);
  CHECK(map.face_count() < c.field.mesh.face_count() / 4);
  double area = 0, fine = 0;
  for (Index f = 0; f < map.face_count(); ++f) {
    const double part = cross(map.vector[at(3 * f)], map.vector[at(3 * f + 1)]) / 2;
    CHECK(part > 0);
    area += part;
    CHECK(std::abs(map.vector[at(3 * f)] + map.vector[at(3 * f + 1)] + map.vector[at(3 * f + 2)]) < 1e-6);
  }
  for (std::size_t h = 0; h < c.z.size(); h += 3) fine += cross(c.z[h + 1] - c.z[h], c.z[h + 2] - c.z[h]) / 2;
  CHECK(area == quadrig::test::Approx(fine));
  const auto cone = cones(map, c.field.mesh.vertex_count(), map.vector);
  for (Index h = 0; h < map.halfedge_count(); ++h) {
    const Index v = map.origin[at(h)];
    CHECK(cone[at(v)] ==
          quadrig::test::Approx((c.field.mesh.on_boundary(v) ? 2 : 4) - c.field.index()[at(v)]).margin(1e-5));
    if (const Index g = map.twin[at(h)]; g != no_index) {
      CHECK(map.twin[at(g)] == h);
      CHECK(map.origin[at(g)] == map.origin[at(next(h))]);
      CHECK(std::abs(map.vector[at(g)] + rotated(map.vector[at(h)], map.rotation[at(h)])) < 1e-6);
    }
  }
  for (Index v = 0; v < c.field.mesh.vertex_count(); ++v)  // no cone is lost
    if (c.field.index()[at(v)] != 0) CHECK(cone[at(v)] > 0);
}

TEST_CASE("quantize: integers are closed, positive, consistent and count the quads", "[quantize]") {
  const int which = GENERATE(0, 1, 2, 3, 4, 5);
  const CoarseCase c = coarse_case(which, 0);
  const CoarseMap& map = c.map;
  for (const double wanted : {30.0, 300.0, 2000.0, 20000.0}) {
    QuantizeOptions options;
    options.target_quads = wanted;
    Context context;
    const Quantization q = quantize(map, c.field.index(), c.field.border(), options, context).value();
    std::int64_t twice = 0;
    for (Index f = 0; f < map.face_count(); ++f) {
      REQUIRE(ring_zero(q.edge[at(3 * f)] + q.edge[at(3 * f + 1)] + q.edge[at(3 * f + 2)]));
      const std::int64_t det = cross(q.edge[at(3 * f)], q.edge[at(3 * f + 1)]);
      REQUIRE(det > 0);
      twice += det;
    }
    CHECK(q.quads == quadrig::test::Approx(static_cast<double>(twice) / 2));
    for (Index h = 0; h < map.halfedge_count(); ++h) {
      const Index g = map.twin[at(h)];
      if (g != no_index) REQUIRE(q.edge[at(g)] == -rotated(q.edge[at(h)], map.rotation[at(h)]));
      if (map.aligned[at(h)] == Aligned::v_constant) REQUIRE(q.edge[at(h)].im == 0);
      if (map.aligned[at(h)] == Aligned::u_constant) REQUIRE(q.edge[at(h)].re == 0);
    }
    const auto cone = cones(map, c.field.mesh.vertex_count(), q.edge);
    for (const Index v : map.origin)
      CHECK(cone[at(v)] ==
            quadrig::test::Approx((c.field.mesh.on_boundary(v) ? 2 : 4) - c.field.index()[at(v)]).margin(1e-9));
    if (wanted >= 20.0 * (10 + c.field.singular_count())) CHECK(std::abs(q.quads / wanted - 1) < 0.05);
  }
}

TEST_CASE("quantize: finer integers come closer to the map", "[quantize]") {
  const CoarseCase c = coarse_case(0, 0);
  double last = std::numeric_limits<double>::infinity();
  for (const double wanted : {200.0, 3200.0, 51200.0}) {
    QuantizeOptions options;
    options.target_quads = wanted;
    Context context;
    const double energy = quantize(c.map, c.field.index(), c.field.border(), options, context).value().energy;
    CHECK(energy < last);
    last = energy;
  }
}

TEST_CASE("quantize: the integers determine every cone and handle of the fine map", "[quantize]") {
  const int which = GENERATE(0, 1, 2);
  const CoarseCase c = coarse_case(which, 0);
  const auto unknowns =
      MapUnknowns<Complex>::create(c.field.mesh, c.field.cut, c.field.index(), c.field.aligned).value();
  Context context;
  const Quantization q = quantize(c.map, c.field.index(), c.field.border(), QuantizeOptions{}, context).value();
  const auto solution = substitute_integers<Complex>(c.field.cut, unknowns, c.map, q).value();
  for (std::size_t k = 0; k < solution.unknown.size(); ++k)
    if (unknowns.integer()[k]) {
      CHECK(solution.unknown[k].real() == std::round(solution.unknown[k].real()));
      CHECK(solution.unknown[k].imag() == std::round(solution.unknown[k].imag()));
    }
  for (Index v = 0; v < c.field.mesh.vertex_count(); ++v)
    if (c.field.index()[at(v)] != 0) CHECK(solution.set[at(v)] == std::array<bool, 2>{true, true});
}

TEST_CASE("quantize: lines that go round are found, and integers close them", "[quantize]") {
  const int which = GENERATE(1, 2);
  const CoarseCase c = coarse_case(which, 0);
  const CoarseMap& map = c.map;
  double area = 0;
  for (Index f = 0; f < map.face_count(); ++f) area += cross(map.vector[at(3 * f)], map.vector[at(3 * f + 1)]) / 2;
  Index found = 0, open = 0;
  for (const double wanted : {600.0, 1000.0, 1700.0, 3000.0}) {
    const double quad = std::sqrt(area / wanted);
    const std::vector<quadrig::detail::Ring> rings = quadrig::detail::near_rings(map, quad, 1.5);
    QuantizeOptions options;
    options.target_quads = wanted;
    Context context;
    const Quantization q = quantize(map, c.field.index(), c.field.border(), options, context).value();
    for (const auto& ring : rings) {
      CHECK(std::abs(ring.pitch) < 1.5 * quad);
      // The walk along the vertices beside the line ends as far from its beginning as the line itself.
      Complex sum = 0;
      Gaussian whole{};
      for (const auto& [h, turn] : ring.walk) {
        sum += rotated(map.vector[at(h)], turn & 3);
        whole = whole + rotated(q.edge[at(h)], turn & 3);
      }
      CHECK(ring.across(sum.real(), sum.imag()) == quadrig::test::Approx(ring.pitch).margin(1e-6 * ring.length));
      CHECK((ring.axis == 0 ? sum.real() : sum.imag()) == quadrig::test::Approx(ring.length));
      ++found;
      open += ring.across(whole.re, whole.im) != 0;
    }
  }
  CHECK(found >= 8);
  CHECK(open * 4 < found);
}

TEST_CASE("quantize: a row that is added leaves valid integers", "[quantize]") {
  const int which = GENERATE(0, 1, 2, 3, 5);
  const CoarseCase c = coarse_case(which, 0);
  Context context;
  QuantizeOptions options;
  options.target_quads = 300;
  const Quantization from = quantize(c.map, c.field.index(), c.field.border(), options, context).value();
  Budget budget = Budget().lend(Work::search, 1'000'000);
  const std::vector<Index> faces{0, c.map.face_count() / 2};
  const auto wider = widened(c.map, c.field.index(), c.field.border(), options, from, faces, context, budget);
  REQUIRE(!wider.empty());
  CHECK(budget.left(Work::search) < 1'000'000);
  double last = 0;
  for (const Quantization& q : wider) {
    std::int64_t twice = 0;
    for (Index f = 0; f < c.map.face_count(); ++f) {
      REQUIRE(ring_zero(q.edge[at(3 * f)] + q.edge[at(3 * f + 1)] + q.edge[at(3 * f + 2)]));
      REQUIRE(cross(q.edge[at(3 * f)], q.edge[at(3 * f + 1)]) > 0);
      twice += cross(q.edge[at(3 * f)], q.edge[at(3 * f + 1)]);
    }
    CHECK(q.quads == quadrig::test::Approx(static_cast<double>(twice) / 2));
    CHECK(q.quads > from.quads);
    const auto cone = cones(c.map, c.field.mesh.vertex_count(), q.edge);
    for (const Index v : c.map.origin)
      CHECK(cone[at(v)] ==
            quadrig::test::Approx((c.field.mesh.on_boundary(v) ? 2 : 4) - c.field.index()[at(v)]).margin(1e-9));
    bool through = false;
    for (const Index f : faces)
      for (Index h = 3 * f; h < 3 * f + 3; ++h) through = through || !ring_zero(q.edge[at(h)] - from.edge[at(h)]);
    CHECK(through);
    last = std::max(last, q.energy);
  }
  CHECK(wider.front().energy <= last);
}

TEST_CASE("quantize: an answer when cancelled", "[quantize]") {
  const CoarseCase c = coarse_case(1, 0);
  std::atomic<bool> stop{true};
  Context context;
  context.cancel_flag = &stop;
  const auto result = quantize(c.map, c.field.index(), c.field.border(), QuantizeOptions{}, context);
  REQUIRE_FALSE(result);
  CHECK(result.error().code == ErrorCode::cancelled);
}

TEST_CASE("quantize: work is counted, and where it is used up there is a valid answer or an error", "[quantize]") {
  const CoarseCase c = coarse_case(1, 0);
  Context context;
  Budget plenty;
  const std::int64_t full = plenty.left(Work::search);
  REQUIRE(quantize(c.map, c.field.index(), c.field.border(), QuantizeOptions{}, context, plenty));
  const std::int64_t needed = full - plenty.left(Work::search);
  CHECK(needed > 100);
  CHECK(needed < full);
  Index answers = 0;
  for (const std::int64_t part : {needed / 2, needed / 10, std::int64_t{1}, std::int64_t{-1}}) {
    Budget budget = Budget().lend(Work::search, part);
    const auto q = quantize(c.map, c.field.index(), c.field.border(), QuantizeOptions{}, context, budget);
    CHECK(budget.spent(Work::search));
    if (!q) {
      CHECK(q.error().code == ErrorCode::stage_failed);
      continue;
    }
    ++answers;
    for (Index f = 0; f < c.map.face_count(); ++f) {
      CHECK(ring_zero(q->edge[at(3 * f)] + q->edge[at(3 * f + 1)] + q->edge[at(3 * f + 2)]));
      CHECK(cross(q->edge[at(3 * f)], q->edge[at(3 * f + 1)]) > 0);
    }
  }
  CHECK(answers > 0);
  CHECK(answers < 4);
}
