// The presets: reference figures, invariance, borders, creases, fallbacks.
#include "field_shapes.hpp"

#include <map>

#include "quadrig/io.hpp"

using namespace quadrig;
using quadrig::test::Grid;

namespace {

FieldResult design(const Asset& asset, const FieldOptions& options = {}, unsigned threads = 1) {
  Context context;
  context.threads = threads;
  auto result = design_field(asset, Connection<double>(asset.mesh), options, context);
  INFO((result ? std::string() : result.error().message()));
  REQUIRE(result);
  return std::move(*result);
}

std::vector<double> angles_between(const Asset& a, const FieldResult& field_a, const Asset& b,
                                   const FieldResult& field_b) {
  const auto arms_a = test::cross_arms(a, field_a.frames), arms_b = test::cross_arms(b, field_b.frames);
  std::vector<double> angles;
  for (std::size_t f = 0; f < arms_a.size(); ++f)
    angles.push_back(test::cross_angle(arms_a[f], arms_b[f], a.mesh.normal(static_cast<Index>(f))));
  return angles;
}

double largest(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

std::optional<Asset> corpus_asset(const std::string& mesh, const std::string& rig = {},
                                  const std::string& weights = {}) {
  const auto path = test::corpus(mesh);
  if (!path) return std::nullopt;
  AssetFiles files{*path, {}, {}};
  if (!rig.empty()) {
    files.rig = path->parent_path() / rig;
    files.weights = path->parent_path() / weights;
  }
  Context context;
  auto loaded = load_asset(files, {}, context);
  REQUIRE(loaded);
  return std::move(loaded->asset);
}

}  // namespace

TEST_CASE("field: the thesis preset gives the figures of an independent solver on the arm", "[field][corpus]") {
  const auto asset = corpus_asset("libigl_arm/arm.obj", "arm.tgf", "arm-weights.dmat");
  if (!asset) return;
  const FieldReport r = design(*asset, {.preset = FieldPreset::thesis}).report;
  CHECK(r.vertices == 8311);
  CHECK(r.faces == 16618);
  CHECK(r.bones == 4);
  CHECK(r.interior_edges == 24927);
  CHECK(r.faces_omega1_above_0_9 == 12331);
  CHECK(r.singularities_plus == 42);
  CHECK(r.singularities_minus == 34);
  CHECK(r.index_sum == 8);
  CHECK(r.sum_omega1 == Approx(14396.059710990628).epsilon(1e-6));
  CHECK(r.sum_omega2 == Approx(2141.898142255095).epsilon(1e-6));
  CHECK(r.energy_align == Approx(1295.5665743673173).epsilon(1e-6));
  CHECK(r.energy_smooth == Approx(163.0234356780478).epsilon(1e-6));
  CHECK(r.energy_orth == Approx(1113.5595304316469).epsilon(1e-6));
  CHECK(r.sum_abs_x0 == Approx(37511.53769524424).epsilon(1e-6));
  CHECK(r.sum_abs_x1 == Approx(9740.691713949205).epsilon(1e-6));
  CHECK(r.median_abs_x0 == Approx(1.001737530296234).epsilon(1e-6));
  CHECK(r.mean_angle_to_bone_deg == Approx(0.5750967235990356).epsilon(1e-6));
  CHECK(r.median_angle_to_bone_deg == Approx(0.23490436750468865).epsilon(1e-6));
  CHECK(r.solve.analyses == 1);  // x0 and x1 share their pattern

  const FieldReport own = design(*asset).report;
  CHECK(own.mean_angle_to_bone_deg < 4);
  CHECK(own.singularities_plus + own.singularities_minus < 60);
}

TEST_CASE("field: the static preset needs no more singularities than the peers", "[field][corpus]") {
  // Irregular vertices of QuadriFlow's 2000 quads.
  const auto [file, most] = GENERATE(std::pair{"surfaces/bunny.off", 42}, std::pair{"surfaces/fertility.off", 64},
                                     std::pair{"surfaces/fandisk.off", 42}, std::pair{"surfaces/camelhead.off", 54},
                                     std::pair{"libigl_arm/arm.obj", 42});
  const auto asset = corpus_asset(file);
  if (!asset) return;
  INFO(file);
  const FieldResult field = design(*asset);
  CHECK(field.report.preset == FieldPreset::flat);
  CHECK(field.report.singularities_plus + field.report.singularities_minus <= most);
  CHECK(field.report.index_sum == 4 * field.report.euler_characteristic);
  for (Index v = 0; v < asset->mesh.vertex_count(); ++v)
    if (!asset->mesh.on_boundary(v)) CHECK(std::abs(field.singularities.index4[static_cast<std::size_t>(v)]) <= 1);
}

TEST_CASE("field: results do not depend on place, size, numbering or tangent bases", "[field]") {
  const auto preset = GENERATE(FieldPreset::standard, FieldPreset::thesis, FieldPreset::flat);
  INFO(field_preset_name(preset));
  const Asset asset = test::limbed_asset(3, true);
  const FieldOptions options{.preset = preset};
  const FieldResult field = design(asset, options);
  const auto check = [&](const FieldResult& result) {
    CHECK(result.report.singularities_plus == field.report.singularities_plus);
    CHECK(result.report.singularities_minus == field.report.singularities_minus);
    CHECK(result.report.sum_abs_x0 == Approx(field.report.sum_abs_x0).epsilon(1e-8));
    CHECK(result.report.sum_abs_x1 == Approx(field.report.sum_abs_x1).epsilon(1e-8));
    CHECK(result.report.energy_align == Approx(field.report.energy_align).epsilon(1e-8));
    CHECK(result.report.energy_smooth == Approx(field.report.energy_smooth).epsilon(1e-8));
    CHECK(result.report.mean_angle_to_bone_deg == Approx(field.report.mean_angle_to_bone_deg).epsilon(1e-8));
  };

  SECTION("moved and turned") {
    const Eigen::AngleAxisd turn(0.8, Vector3(1, -2, 0.5).normalized());
    const Vector3 shift(3, -40, 7);
    Asset moved = asset;
    moved.mesh =
        test::build((asset.mesh.positions() * turn.toRotationMatrix().transpose()).rowwise() + shift.transpose(),
                    asset.mesh.faces());
    for (Bone& bone : moved.rig->skeleton.bones) {
      bone.head = turn * bone.head + shift;
      bone.tail = turn * bone.tail + shift;
    }
    const FieldResult result = design(moved, options);
    check(result);
    auto arms = test::cross_arms(moved, result.frames);
    const auto before = test::cross_arms(asset, field.frames);
    for (std::size_t f = 0; f < arms.size(); ++f)
      CHECK(test::cross_angle(before[f], turn.inverse() * arms[f], asset.mesh.normal(static_cast<Index>(f))) < 1e-5);
  }
  SECTION("scaled") {
    for (const double scale : {1e-4, 3e5}) {
      Asset scaled = asset;
      scaled.mesh = test::build(asset.mesh.positions() * scale, asset.mesh.faces());
      for (Bone& bone : scaled.rig->skeleton.bones) {
        bone.head *= scale;
        bone.tail *= scale;
      }
      const FieldResult result = design(scaled, options);
      check(result);
      CHECK(largest(angles_between(asset, field, scaled, result)) < 1e-5);
    }
  }
  SECTION("vertices and faces renumbered, faces begun at another corner") {
    std::mt19937 engine(5);
    std::vector<Index> vertex(static_cast<std::size_t>(asset.mesh.vertex_count()));
    std::vector<Index> face(static_cast<std::size_t>(asset.mesh.face_count()));
    for (auto* order : {&vertex, &face}) {
      for (std::size_t i = 0; i < order->size(); ++i) (*order)[i] = static_cast<Index>(i);
      for (std::size_t i = order->size(); i > 1; --i) std::swap((*order)[i - 1], (*order)[engine() % i]);
    }
    Points<double> points(asset.mesh.vertex_count(), 3);
    std::vector<Eigen::Triplet<double>> entries;
    for (Index v = 0; v < asset.mesh.vertex_count(); ++v) {
      points.row(vertex[static_cast<std::size_t>(v)]) = asset.mesh.positions().row(v);
      for (SkinWeights::InnerIterator entry(asset.rig->weights, v); entry; ++entry)
        entries.emplace_back(vertex[static_cast<std::size_t>(v)], static_cast<Index>(entry.col()), entry.value());
    }
    Triangles faces(asset.mesh.face_count(), 3);
    for (Index f = 0; f < asset.mesh.face_count(); ++f) {
      const Index first = static_cast<Index>(engine() % 3);
      for (Index i = 0; i < 3; ++i)
        faces(face[static_cast<std::size_t>(f)], i) =
            vertex[static_cast<std::size_t>(asset.mesh.faces()(f, (first + i) % 3))];
    }
    Asset other{test::build(points, faces), asset.rig};
    other.rig->weights.setZero();
    other.rig->weights.setFromTriplets(entries.begin(), entries.end());
    const FieldResult result = design(other, options);
    check(result);
    const auto arms = test::cross_arms(asset, field.frames), others = test::cross_arms(other, result.frames);
    for (std::size_t f = 0; f < arms.size(); ++f)
      CHECK(test::cross_angle(arms[f], others[static_cast<std::size_t>(face[f])],
                              asset.mesh.normal(static_cast<Index>(f))) < 1e-5);
  }
}

TEST_CASE("field: the same bits at any number of threads", "[field]") {
  const Asset asset = test::limbed_asset(3, true);
  for (const auto preset : {FieldPreset::standard, FieldPreset::thesis, FieldPreset::flat}) {
    const FieldOptions options{.preset = preset, .bone_density = true};
    const FieldResult one = design(asset, options, 1), many = design(asset, options, 7);
    CHECK(one.frames.u == many.frames.u);
    CHECK(one.frames.v == many.frames.v);
    CHECK(one.matching.rho == many.matching.rho);
  }
}

TEST_CASE("field: default and static do not depend on the resolution", "[field][slow]") {
  const bool rigged = GENERATE(false, true);
  INFO((rigged ? "default" : "static"));
  const std::array<Asset, 3> assets{test::limbed_asset(4, rigged), test::limbed_asset(5, rigged),
                                    test::limbed_asset(6, rigged)};
  std::vector<FieldResult> fields;
  for (const Asset& asset : assets) fields.push_back(design(asset));
  const auto finest = test::cross_arms(assets[2], fields[2].frames);
  const auto count = [](const FieldReport& r) { return r.singularities_plus + r.singularities_minus; };
  for (std::size_t level = 0; level < 2; ++level) {
    const Asset& asset = assets[level];
    CHECK(std::abs(count(fields[level].report) - count(fields[2].report)) <= count(fields[2].report) / 10.0);
    // Away from the singularities of either by a twentieth of the whole.
    std::vector<Vector3> centres;
    for (const std::size_t which : {level, std::size_t{2}})
      for (Index v = 0; v < assets[which].mesh.vertex_count(); ++v)
        if (fields[which].singularities.index4[static_cast<std::size_t>(v)] != 0)
          centres.push_back(assets[which].mesh.position(v));
    const auto arms = test::cross_arms(asset, fields[level].frames);
    const Index children = level == 0 ? 16 : 4;
    double sum = 0, area = 0;
    for (Index f = 0; f < asset.mesh.face_count(); ++f) {
      const Vector3 p = asset.mesh.position(asset.mesh.faces()(f, 0));
      const bool near =
          std::ranges::any_of(centres, [&](const Vector3& c) { return (c - p).norm() < 0.05 * asset.mesh.diagonal(); });
      if (near) continue;
      const Index middle = children * f + children - 1;  // of the middle child of each split
      sum += asset.mesh.area(f) * test::cross_angle(arms[static_cast<std::size_t>(f)],
                                                    finest[static_cast<std::size_t>(middle)], asset.mesh.normal(f));
      area += asset.mesh.area(f);
    }
    CHECK(area > 0.5 * asset.mesh.total_area());
    CHECK(sum / area < 3);
  }
}

TEST_CASE("field: on an open surface the cross follows the border and turns at its corners", "[field]") {
  const Grid grid{20, 14, false, false};
  const Asset sheet{test::build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0.4 * std::sin(0.3 * i)); }),
                                grid.triangles()),
                    {}};
  const FieldResult field = design(sheet);
  const Connection<double> connection(sheet.mesh);
  for (const Index h : boundary_halfedges(sheet.mesh)) {
    const auto f = static_cast<std::size_t>(h / 3);
    const Complex edge = connection.edge(h);
    const double u = std::abs(std::imag(field.frames.u[f] * std::conj(edge)));
    const double v = std::abs(std::imag(field.frames.v[f] * std::conj(edge)));
    CHECK(std::min(u, v) < 0.1);  // corner faces see two edges, nearly at right angles
  }
  CHECK(field.report.singularities_plus + field.report.singularities_minus == 0);
  CHECK(field.report.singularities_boundary == 4);
  CHECK(field.report.index_sum == 4);
  for (const Index corner : {0, 20, 21 * 14, 21 * 14 + 20})
    CHECK(field.singularities.index4[static_cast<std::size_t>(corner)] == 1);

  const Grid round{24, 16, true, false};
  const Asset tube{test::build(test::tube_positions(round, 4, 1), round.triangles()), {}};
  const FieldResult along = design(tube);
  CHECK(along.report.singularities_plus + along.report.singularities_minus + along.report.singularities_boundary == 0);
}

TEST_CASE("field: given directions are met exactly, and targets drive the field", "[field]") {
  const Asset asset = test::limbed_asset(3, false);
  const Connection<double> connection(asset.mesh);
  FieldOptions options;
  for (const Index face : {7, 300, 801}) options.fixed.push_back({face, std::polar(3.0, 0.1 * face)});
  const FieldResult field = design(asset, options);
  for (const FixedDirection& each : options.fixed) {
    const auto f = static_cast<std::size_t>(each.face);
    const Complex x0 = -integer_power(each.direction / 3.0, 4);
    CHECK(std::abs(field.polynomial.x0[f] / std::abs(field.polynomial.x0[f]) - x0) < 1e-12);
  }
  CHECK(field.report.fixed_faces == 3);

  // A skewed target everywhere: u along x, v at 60° to it.
  FieldOptions skewed{.merge_rounds = 0, .curvature_weight = 0.0};
  skewed.targets = PolyVectorTargets::none(asset.mesh.face_count());
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const Complex x = connection.to_complex(f, Vector3::UnitX());
    if (std::abs(x) < 0.5) continue;
    const Complex u = x / std::abs(x), v = u * std::polar(1.0, std::numbers::pi / 3);
    const auto i = static_cast<std::size_t>(f);
    skewed.targets->x0[i] = u * u * v * v;
    skewed.targets->x1[i] = -(u * u + v * v);
    skewed.targets->weight[i] = 100;
  }
  const FieldResult driven = design(asset, skewed);
  double worst = 0;
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const Complex x = connection.to_complex(f, Vector3::UnitX());
    if (std::abs(x) < 0.8) continue;
    const auto i = static_cast<std::size_t>(f);
    const double opening = opening_angle(driven.frames.u[i], driven.frames.v[i]);
    worst = std::max(worst,
                     std::min(std::abs(opening - std::numbers::pi / 3), std::abs(opening - 2 * std::numbers::pi / 3)));
  }
  CHECK(worst < 0.1);
}

TEST_CASE("field: creases of a cube are followed on both sides, and its corners are the singularities", "[field]") {
  // Each face of the cube a grid of 12 × 12, vertices shared along the edges.
  constexpr int n = 12;
  std::map<std::array<int, 3>, Index> numbers;
  std::vector<std::array<Index, 3>> triangles;
  const auto vertex = [&](std::array<int, 3> p) {
    return numbers.try_emplace(p, static_cast<Index>(numbers.size())).first->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int a, int b) {
            std::array<int, 3> p{};
            p[static_cast<std::size_t>(axis)] = side;
            p[static_cast<std::size_t>((axis + 1) % 3)] = a;
            p[static_cast<std::size_t>((axis + 2) % 3)] = b;
            return vertex(p);
          };
          std::array<Index, 4> quad{at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
          if (side == 0) std::swap(quad[1], quad[3]);
          const auto k = static_cast<std::size_t>((i * 7 + j * 3) % 2);  // diagonals both ways
          triangles.push_back({quad[k], quad[k + 1], quad[k + 2]});
          triangles.push_back({quad[k], quad[k + 2], quad[(k + 3) % 4]});
        }
  Points<double> points(static_cast<Index>(numbers.size()), 3);
  for (const auto& [p, index] : numbers) points.row(index) << p[0], p[1], p[2];
  Triangles faces(static_cast<Index>(triangles.size()), 3);
  for (std::size_t f = 0; f < triangles.size(); ++f)
    faces.row(static_cast<Index>(f)) << triangles[f][0], triangles[f][1], triangles[f][2];
  const Asset cube{test::build(points, faces), {}};

  FieldOptions options;
  options.crease_angle_radians = 0.7;
  const FieldResult field = design(cube, options);
  // 12 edges of 12, both sides, less the corner faces that have two such edges.
  CHECK(field.report.fixed_faces <= 288);
  CHECK(field.report.fixed_faces >= 288 - 24);
  CHECK(field.report.singularities_plus == 8);
  CHECK(field.report.singularities_minus == 0);
  for (Index v = 0; v < cube.mesh.vertex_count(); ++v) {
    const auto p = cube.mesh.position(v);
    bool corner = true;
    for (int k = 0; k < 3; ++k) corner = corner && (p[k] == 0 || p[k] == n);
    CHECK(field.singularities.index4[static_cast<std::size_t>(v)] == (corner ? 1 : 0));
  }
}

TEST_CASE("field: a component without any target takes the smoothest field", "[field]") {
  // Two bodies apart: the bones of one have no direction.
  const Asset body = test::limbed_asset(2, true);
  const Index n = body.mesh.vertex_count(), m = body.mesh.face_count();
  Points<double> points(2 * n, 3);
  points << body.mesh.positions(), body.mesh.positions().rowwise() + Eigen::RowVector3d(9, 0, 0);
  Triangles faces(2 * m, 3);
  faces << body.mesh.faces(), (body.mesh.faces().array() + n).matrix();
  Asset pair{test::build(points, faces), Rig{}};
  pair.rig->skeleton.bones.resize(2);
  pair.rig->skeleton.bones[0].tail = Vector3(2, 0.4, 0.2);
  pair.rig->skeleton.bones[1].has_direction = false;
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < 2 * n; ++v) entries.emplace_back(v, v < n ? 0 : 1, 1.0);
  pair.rig->weights.resize(2 * n, 2);
  pair.rig->weights.setFromTriplets(entries.begin(), entries.end());

  const FieldResult field = design(pair);
  CHECK(field.report.free_components == 1);
  CHECK(field.report.index_sum == 16);
  CHECK(field.report.solve.inverse_iterations > 1);
  Context context;
  const auto thesis = design_field(pair, Connection<double>(pair.mesh), {.preset = FieldPreset::thesis}, context);
  REQUIRE(!thesis);  // the exact energy has no such rule, and says so
  CHECK(thesis.error().code == ErrorCode::numeric);
}

TEST_CASE("field: densities of bones stay within 1 and 4, and are 1 where one bone rules", "[field]") {
  const Asset asset = test::limbed_asset(4, true);
  const FieldResult field = design(asset, {.bone_density = true});
  const auto dominance = Dominance::create(asset.mesh, *asset.rig).value();
  double most = 0;
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    for (const double size : {std::abs(field.frames.u[i]), std::abs(field.frames.v[i])}) {
      CHECK(size >= 1 - 1e-12);
      CHECK(size <= 4 + 1e-12);
      most = std::max(most, size);
    }
  }
  CHECK(most > 1.5);
  const FieldResult even = design(asset);
  for (const Complex& u : even.frames.u) CHECK(std::abs(u) == Approx(1));
}

TEST_CASE("field: bad options and bad input are errors that name themselves", "[field]") {
  const Asset asset = test::limbed_asset(1, false);
  const Connection<double> connection(asset.mesh);
  Context context;
  const auto where = [&](const FieldOptions& options) {
    const auto result = design_field(asset, connection, options, context);
    return result ? std::string("no error") : result.error().where;
  };
  CHECK(where({.preset = FieldPreset::thesis}) == "field, preset");
  CHECK(where({.smoothing_length = 0.0}) == "field, smoothing_length");
  CHECK(where({.quad_edge = -1}) == "field, quad_edge");
  CHECK(where({.merge_rounds = -1}) == "field, merge_rounds");
  CHECK(where({.curvature_weight = -1.0}) == "field, curvature_weight");
  CHECK(where({.targets = PolyVectorTargets::none(3)}) == "field, targets");
  CHECK(where({.fixed = {{asset.mesh.face_count(), 1.0}}}) == "field, fixed");
  CHECK(where({.solver = "cholesky"}) == "solver cholesky");
  CHECK(!field_preset("fancy"));
  CHECK(field_preset("static").value() == FieldPreset::flat);

  const std::atomic<bool> cancel = true;
  context.cancel_flag = &cancel;
  const auto cancelled = design_field(asset, connection, {}, context);
  REQUIRE(!cancelled);
  CHECK(cancelled.error().code == ErrorCode::cancelled);
}

TEST_CASE("field: the smallest surfaces have a field", "[field]") {
  Points<double> corners(4, 3);
  corners << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  Triangles one(1, 3), closed(4, 3);
  one << 0, 1, 2;
  closed << 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2;
  for (const bool follow : {true, false}) {
    FieldOptions options;
    options.follow_boundary = follow;
    CHECK(design({test::build(corners.topRows(3), one), {}}, options).report.index_sum == 4);
    CHECK(design({test::build(corners, closed), {}}, options).report.index_sum == 8);
    CHECK(design({TriangleMesh<double>(), {}}, options).report.index_sum == 0);
  }
}

TEST_CASE("field: the thesis preset follows borders, creases and fixed directions", "[field]") {
  Asset asset = test::limbed_asset(3, true);
  const Connection<double> whole(asset.mesh);
  const FieldResult closed = design(asset, {.preset = FieldPreset::thesis});
  CHECK(closed.report.fixed_faces == 0);
  Context context;
  const FieldResult fixed =
      design(asset, {.preset = FieldPreset::thesis, .fixed = {{7, whole.to_complex(7, Vector3(1, 2, 3))}}});
  const auto angle = [](const FrameField& frames, Index f, Complex along) {
    const auto i = static_cast<std::size_t>(f);
    const auto to = [&](Complex d) { return std::abs((along * std::conj(d)).real()) / std::abs(along) / std::abs(d); };
    return std::acos(std::min(1.0, std::max(to(frames.u[i]), to(frames.v[i])))) * 180 / std::numbers::pi;
  };
  CHECK(angle(fixed.frames, 7, whole.to_complex(7, Vector3(1, 2, 3))) < 1e-4);

  // The same cut open where one limb ends.
  std::vector<Index> kept;
  const Vector3 limb = Vector3(1, 0.2, 0.1).normalized();
  double far = 0;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v) far = std::max(far, asset.mesh.position(v).dot(limb));
  for (Index f = 0; f < asset.mesh.face_count(); ++f)
    if (position(asset.mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)}).dot(limb) < 0.8 * far) kept.push_back(f);
  std::vector<Index> number(static_cast<std::size_t>(asset.mesh.vertex_count()), no_index), rows;
  Triangles faces(static_cast<Index>(kept.size()), 3);
  for (std::size_t k = 0; k < kept.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      const Index v = asset.mesh.faces()(kept[k], i);
      Index& place = number[static_cast<std::size_t>(v)];
      if (place == no_index) {
        place = static_cast<Index>(rows.size());
        rows.push_back(v);
      }
      faces(static_cast<Index>(k), i) = place;
    }
  Points<double> points(static_cast<Index>(rows.size()), 3);
  for (std::size_t k = 0; k < rows.size(); ++k) points.row(static_cast<Index>(k)) = asset.mesh.positions().row(rows[k]);
  const Asset open{test::build(points, faces), Rig{asset.rig->skeleton, rows_of(asset.rig->weights, rows), {}}};
  const Connection<double> connection(open.mesh);
  const FieldResult field = design(open, {.preset = FieldPreset::thesis});
  Index beside = 0;
  for (Index h = 0; h < open.mesh.halfedge_count(); ++h) {
    if (open.mesh.twin(h) != no_index) continue;
    if (open.mesh.twin(open.mesh.next(h)) == no_index || open.mesh.twin(open.mesh.prev(h)) == no_index)
      continue;  // no frame follows two edges
    ++beside;
    CHECK(angle(field.frames, h / 3, connection.edge(h)) < 1);
  }
  CHECK(beside > 10);
  CHECK(field.report.fixed_faces > 10);
  const auto short_pose = design_field(asset, whole, {.bone_poses = {Pose(2)}}, context);  // four bones
  REQUIRE(!short_pose);
  CHECK(short_pose.error().where == "field, bone_poses");
}
