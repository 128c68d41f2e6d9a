#include "quadrig/quality.hpp"

#include <fstream>
#include <sstream>

#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

// Quads of a grid that lie on the finer triangle mesh of the same surface: each vertex is a vertex of that mesh.
QuadMesh quads_on(const TriangleMesh<double>& mesh, const test::Grid& coarse, const test::Grid& fine) {
  const Index by_column = fine.columns / coarse.columns, by_row = fine.rows / coarse.rows;
  QuadMesh result;
  result.quads = coarse.quads();
  result.positions = coarse.positions(
      [&](Index i, Index j) -> Vector3 { return mesh.position(fine.vertex(i * by_column, j * by_row)); });
  for (Index j = 0; j < (coarse.wrap_rows ? coarse.rows : coarse.rows + 1); ++j)
    for (Index i = 0; i < coarse.across(); ++i) {
      const Index v = fine.vertex(i * by_column, j * by_row), h = mesh.outgoing(v);
      SurfacePoint point{h / 3, Vector3::Zero()};
      point.barycentric[h % 3] = 1;
      result.source.push_back(point);
    }
  return result;
}

struct Torus {
  test::Grid fine{24, 48, true, true}, coarse{12, 24, true, true};
  TriangleMesh<double> mesh = test::build(test::torus_positions(fine, 1, 0.4), fine.triangles());
  QuadMesh quads = quads_on(mesh, coarse, fine);
};

// A tube with a hinge in the middle, weights smooth over the middle third.
struct Tube {
  test::Grid fine{24, 72, true, false}, coarse{12, 24, true, false};
  TriangleMesh<double> mesh = test::build(test::tube_positions(fine, 6, 0.5), fine.triangles());
  QuadMesh quads = quads_on(mesh, coarse, fine);
  Rig rig;
  Tube() {
    rig.skeleton.bones = {{.head = {0, 0, 0}, .tail = {3, 0, 0}}, {.head = {3, 0, 0}, .tail = {6, 0, 0}, .parent = 0}};
    rig.weights.resize(mesh.vertex_count(), 2);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      const double t = std::clamp(mesh.positions()(v, 0) / 2 - 1, 0.0, 1.0), s = t * t * (3 - 2 * t);
      rig.weights.insert(v, 0) = 1 - s;
      rig.weights.insert(v, 1) = s;
    }
    rig.weights.makeCompressed();
  }
};

void write_obj(const std::filesystem::path& path, const PolygonMesh& mesh) {
  std::ofstream out(path);
  out.precision(17);
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    out << "v " << mesh.positions(v, 0) << ' ' << mesh.positions(v, 1) << ' ' << mesh.positions(v, 2) << '\n';
  for (Index f = 0; f < mesh.polygon_count(); ++f) {
    out << 'f';
    for (const Index v : mesh.polygon(f)) out << ' ' << v + 1;
    out << '\n';
  }
}

// What a reference script prints for these arguments, or nothing where scripts or their Python are absent. They lie in
// $QUADRIG_REFERENCE_SCRIPTS or in ../shared/judge beside the source tree.
std::optional<std::string> reference(const std::string& script, const std::string& arguments,
                                     const test::ScratchFolder& scratch) {
  const char* set = std::getenv("QUADRIG_REFERENCE_SCRIPTS");
  const std::filesystem::path root =
      set && *set ? std::filesystem::path(set) : std::filesystem::path(QUADRIG_SOURCE_DIR) / ".." / "shared" / "judge";
  if (!std::filesystem::exists(root / script)) {
    std::cout << "\nskipped: no " << script << "; set QUADRIG_REFERENCE_SCRIPTS to the folder that has it\n";
    return std::nullopt;
  }
  for (const std::string python : {"python3", "/usr/bin/python3"}) {
    if (std::system((python + " -c 'import numpy, scipy' >/dev/null 2>&1").c_str()) != 0) continue;
    const std::filesystem::path output = scratch / "output.txt";
    const std::string command =
        python + " -B '" + (root / script).string() + "' " + arguments + " > '" + output.string() + "'";
    REQUIRE(std::system(command.c_str()) == 0);
    std::ostringstream text;
    text << std::ifstream(output).rdbuf();
    return text.str();
  }
  std::cout << "\nskipped: no Python with numpy and scipy\n";
  return std::nullopt;
}

// The number after "key": in a line of JSON; nothing for null.
std::optional<double> number(const std::string& json, const std::string& key) {
  const std::size_t at = json.find('"' + key + "\":");
  REQUIRE(at != std::string::npos);
  const std::string value = json.substr(at + key.size() + 3, 30);
  if (value.find("null") < 3) return std::nullopt;
  return std::stod(value);
}

bool breaks(const ValidityReport& report, ValidityRule rule) {
  return std::any_of(report.violations.begin(), report.violations.end(),
                     [&](const Violation& v) { return v.rule == rule; });
}

}  // namespace

TEST_CASE("statistics: a torus of quads has genus one and no irregular vertex", "[quality][fast]") {
  const Torus torus;
  const MeshStatistics s = mesh_statistics(torus.quads);
  CHECK(s.vertices == 288);
  CHECK(s.faces == 288);
  CHECK(s.quads == 288);
  CHECK(s.components == 1);
  CHECK(s.genus == 1);
  CHECK(s.euler == 0);
  CHECK(s.irregular == 0);
  CHECK(s.boundary_edges == 0);
  CHECK(s.scaled_jacobian_minimum > 0.9);
  CHECK(s.scaled_jacobian_average >= s.scaled_jacobian_minimum);
}

TEST_CASE("statistics: the corners of a patch are irregular and its border is one loop", "[quality][fast]") {
  const test::Grid grid{3, 5};
  QuadMesh mesh;
  mesh.quads = grid.quads();
  mesh.positions = grid.positions([](Index i, Index j) { return Vector3(i, 2 * j, 0); });
  const MeshStatistics s = mesh_statistics(mesh);
  CHECK(s.irregular == 4);
  CHECK(s.irregular_interior == 0);
  CHECK(s.boundary_edges == 16);
  CHECK(s.boundary_loops == 1);
  CHECK(s.genus == 0);
  CHECK(s.scaled_jacobian_minimum == 1);
  const ShapeStatistics shape = shape_statistics(mesh.positions, mesh.quads);
  CHECK(shape.aspect_mean == Approx(2));
  CHECK(shape.edge_ratio_mean == Approx(2));
  CHECK(shape.angle_error_maximum_degrees == Approx(0).margin(1e-9));
  CHECK(shape.area_p99_by_p1 == Approx(1));
}

TEST_CASE("statistics: quantiles are interpolated", "[quality][fast]") {
  CHECK(quantile(std::vector<double>{3, 1, 2}, 0.5) == 2);
  CHECK(quantile(std::vector<double>{4, 1, 2, 3}, 0.5) == 2.5);
  CHECK(quantile(std::vector<double>{4, 1, 2, 3}, 0.99) == Approx(3.97));
  CHECK(quantile(std::vector<double>{4, 1}, 1) == 4);
  CHECK(quantile(std::vector<double>{}, 0.5) == 0);
}

TEST_CASE("statistics: they agree with the reference script on sound and broken polygons", "[quality][reference]") {
  const test::ScratchFolder scratch("statistics");
  const Torus torus;
  std::vector<PolygonMesh> meshes{to_polygons(torus.quads), to_polygons(torus.mesh)};
  std::mt19937 engine(11);
  for (const Index vertices : {8, 20, 60, 200}) {  // soups of triangles, quads and pentagons, mostly broken
    PolygonMesh soup;
    soup.positions.resize(vertices, 3);
    for (Index i = 0; i < soup.positions.size(); ++i)
      soup.positions.data()[i] = static_cast<double>(engine() % 1000) / 100;
    for (Index f = 0; f < vertices; ++f) {
      std::vector<Index> polygon(3 + engine() % 3);
      for (Index& v : polygon) v = static_cast<Index>(engine() % static_cast<unsigned>(vertices));
      if (engine() % 3) {  // most have no vertex twice
        std::sort(polygon.begin(), polygon.end());
        if (std::adjacent_find(polygon.begin(), polygon.end()) != polygon.end()) continue;
        std::swap(polygon[0], polygon[1]);
      }
      soup.add_polygon(polygon);
      if (engine() % 8 == 0) soup.add_polygon(polygon);
    }
    meshes.push_back(soup);
  }
  for (int k = 0; k < 3; ++k) {  // a torus with holes, turned quads and shared vertices
    PolygonMesh damaged;
    damaged.positions = torus.quads.positions;
    for (Index q = 0; q < torus.quads.quad_count(); ++q) {
      std::vector<Index> polygon(torus.quads.quads.row(q).begin(), torus.quads.quads.row(q).end());
      if (engine() % 10 == 0) continue;
      if (k > 0 && engine() % 20 == 0) std::reverse(polygon.begin(), polygon.end());
      if (k > 1 && engine() % 20 == 0) polygon[0] = static_cast<Index>(engine() % 288);
      damaged.add_polygon(polygon);
    }
    meshes.push_back(damaged);
  }
  std::string files;
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    const auto path = scratch / ("mesh" + std::to_string(k) + ".obj");
    write_obj(path, meshes[k]);
    files += " '" + path.string() + "'";
  }
  const auto output = reference("quadstats.py", "--json" + files, scratch);
  if (!output) return;
  std::istringstream lines(*output);
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    INFO("mesh " << k);
    std::string line;
    REQUIRE(std::getline(lines, line));
    const MeshStatistics s = mesh_statistics(meshes[k]);
    const std::pair<const char*, Index> counts[] = {{"V", s.vertices},
                                                    {"F", s.faces},
                                                    {"quads", s.quads},
                                                    {"tris", s.triangles},
                                                    {"ngons", s.ngons},
                                                    {"irregular", s.irregular},
                                                    {"irr_interior", s.irregular_interior},
                                                    {"components", s.components},
                                                    {"euler", s.euler},
                                                    {"boundary", s.boundary_edges},
                                                    {"b_loops", s.boundary_loops},
                                                    {"nm_edges", s.nonmanifold_edges},
                                                    {"nm_verts", s.nonmanifold_vertices},
                                                    {"bad_orient", s.misoriented_edges},
                                                    {"degenerate", s.degenerate_faces},
                                                    {"dup_faces", s.duplicate_faces}};
    for (const auto& [key, count] : counts) {
      INFO(key);
      CHECK(number(line, key) == count);
    }
    const auto genus = number(line, "genus");
    CHECK(genus.has_value() == s.genus.has_value());
    if (genus && s.genus) CHECK(*genus == *s.genus);
    if (s.quads == 0) continue;
    CHECK(*number(line, "sj_avg") == Approx(s.scaled_jacobian_average).margin(1e-12));
    CHECK(*number(line, "sj_min") == Approx(s.scaled_jacobian_minimum).margin(1e-12));
    CHECK(*number(line, "sj_neg") == Approx(s.scaled_jacobian_negative).margin(1e-12));
  }
}

TEST_CASE("validity: quads that keep every rule are valid", "[quality][fast]") {
  const Torus torus;
  const ValidityReport report = check_validity(torus.mesh, torus.quads);
  CHECK(report.valid());
  CHECK(report.largest_surface_distance == 0);
  const Tube tube;
  const SkinWeights weights = transfer_weights(tube.mesh, tube.rig.weights, tube.quads.source).value();
  CHECK(check_validity(tube.mesh, tube.quads, &weights).valid());
}

TEST_CASE("validity: each broken rule is named with its place", "[quality][fast]") {
  using Rule = ValidityRule;
  const Torus torus;
  const auto check = [&](auto&& damage) {
    QuadMesh mesh = torus.quads;
    damage(mesh);
    return check_validity(torus.mesh, mesh);
  };
  const auto drop = [](QuadMesh& mesh, Index count) { mesh.quads.conservativeResize(mesh.quad_count() - count, 4); };
  const auto append = [](QuadMesh& mesh, Index a, Index b, Index c, Index d) {
    mesh.quads.conservativeResize(mesh.quad_count() + 1, 4);
    mesh.quads.row(mesh.quad_count() - 1) << a, b, c, d;
  };

  CHECK(breaks(check([](QuadMesh& m) { m.positions(3, 1) = std::nan(""); }), Rule::finite_positions));
  CHECK(breaks(check([](QuadMesh& m) { m.quads(5, 1) = 1000; }), Rule::vertices_in_range));
  CHECK(breaks(check([](QuadMesh& m) { m.quads(5, 1) = m.quads(5, 0); }), Rule::no_degenerate_quads));
  const ValidityReport doubled =
      check([&](QuadMesh& m) { append(m, m.quads(7, 1), m.quads(7, 2), m.quads(7, 3), m.quads(7, 0)); });
  CHECK(breaks(doubled, Rule::no_duplicate_quads));
  CHECK(breaks(doubled, Rule::manifold_edges));
  CHECK(doubled.error().code == ErrorCode::stage_failed);
  CHECK(breaks(check([](QuadMesh& m) { m.quads.row(9) = m.quads.row(9).reverse().eval(); }),
               Rule::consistent_orientation));
  CHECK(breaks(check([&](QuadMesh& m) { drop(m, 1); }), Rule::same_boundary_loops));
  CHECK(breaks(check([](QuadMesh& m) {  // two quads gone that meet in one vertex
                 m.quads.row(0) = m.quads.row(m.quad_count() - 1);
                 m.quads.row(m.quad_count() - 1) = m.quads.row(13);
                 m.quads.row(13) = m.quads.row(m.quad_count() - 2);
                 m.quads.conservativeResize(m.quad_count() - 2, 4);
               }),
               Rule::manifold_vertices));
  const ValidityReport folded =
      check([](QuadMesh& m) { m.positions.row(40) += 5 * (m.positions.row(41) - m.positions.row(40)); });
  CHECK(breaks(folded, Rule::positive_scaled_jacobian));
  CHECK(breaks(folded, Rule::on_the_surface));
  CHECK(folded.largest_surface_distance > 0.1);
  CHECK(breaks(check([](QuadMesh& m) { m.source[4].face = 1 << 20; }), Rule::on_the_surface));
  CHECK(breaks(check([](QuadMesh& m) { m.source.pop_back(); }), Rule::on_the_surface));
  CHECK(breaks(check([](QuadMesh& m) {
                 m.positions.conservativeResize(m.vertex_count() + 1, 3);
                 m.positions.row(m.vertex_count() - 1) = m.positions.row(0);
                 m.source.push_back(m.source[0]);
               }),
               Rule::no_unused_vertices));
  // a tube is not a torus: genus and loops differ; and two shells are not one
  const test::Grid open{12, 23, true, false};
  CHECK(breaks(check([&](QuadMesh& m) { m.quads = open.quads(); }), Rule::same_genus));
  const ValidityReport twice = check([&](QuadMesh& m) {
    QuadMesh two = m;
    two.positions.resize(2 * m.vertex_count(), 3);
    two.positions << m.positions, m.positions;
    two.quads.resize(2 * m.quad_count(), 4);
    two.quads << m.quads, (m.quads.array() + m.vertex_count()).matrix();
    two.source.insert(two.source.end(), m.source.begin(), m.source.end());
    m = two;
  });
  CHECK(breaks(twice, Rule::same_components));
}

TEST_CASE("validity: unsound weights are named", "[quality][fast]") {
  using Rule = ValidityRule;
  const Tube tube;
  const SkinWeights sound = transfer_weights(tube.mesh, tube.rig.weights, tube.quads.source).value();
  const auto check = [&](const SkinWeights& weights, ValidityOptions options = {}) {
    return check_validity(tube.mesh, tube.quads, &weights, options);
  };
  SkinWeights bad = sound;
  bad.coeffRef(150, 0) += 1e-3;
  CHECK(breaks(check(bad), Rule::weights_sum_to_one));
  bad = sound;
  bad.coeffRef(150, 0) = -0.25;
  bad.coeffRef(150, 1) = 1.25;
  CHECK(breaks(check(bad), Rule::nonnegative_weights));
  CHECK_FALSE(breaks(check(bad), Rule::weights_sum_to_one));
  CHECK(breaks(check(sound, {.influences = 1}), Rule::few_influences));
  CHECK(breaks(check(SkinWeights(3, 2)), Rule::one_weight_row_a_vertex));
}

TEST_CASE("distance: samples spread by area and stay the same for the same seed", "[quality][fast]") {
  Points<double> positions(6, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0, 0, 8, 0, 0, 5, 1, 0;  // areas 1/2 and 3/2
  Triangles faces(2, 3);
  faces << 0, 1, 2, 3, 4, 5;
  const auto samples = sample_surface(positions, faces, 4000, 3);
  REQUIRE(samples.size() == 4000);
  CHECK(std::count_if(samples.begin(), samples.end(), [](const SurfacePoint& p) { return p.face == 0; }) == 1000);
  Vector3 mean = Vector3::Zero();
  for (const SurfacePoint& p : samples) {
    CHECK(p.barycentric.minCoeff() >= 0);
    CHECK(std::abs(p.barycentric.sum() - 1) < 1e-12);
    mean += p.barycentric / 4000;
  }
  CHECK((mean - Vector3::Constant(1.0 / 3)).norm() < 0.02);
  const auto again = sample_surface(positions, faces, 4000, 3), other = sample_surface(positions, faces, 4000, 4);
  CHECK(again[77].barycentric == samples[77].barycentric);
  CHECK(other[77].barycentric != samples[77].barycentric);
  CHECK(sample_surface(positions, Triangles(0, 3), 10, 1).empty());
}

TEST_CASE("distance: what bulges and what is missing are told apart", "[quality][fast]") {
  const test::Grid grid{10, 10};
  const auto full = test::build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0); }), grid.triangles());
  const test::Grid half{5, 10};
  QuadMesh part;
  part.quads = half.quads();
  part.positions = half.positions([](Index i, Index j) { return Vector3(i, j, 0.25); });
  for (const unsigned threads : {1u, 3u}) {
    Context context;
    context.threads = threads;
    const SurfaceDistance d = surface_distance(full, part, {}, context).value();
    CHECK(d.to_input.maximum == Approx(0.25));
    CHECK(d.to_input.mean == Approx(0.25));
    CHECK(d.to_input.rms == Approx(0.25));
    CHECK(d.from_input.maximum == Approx(std::hypot(5, 0.25)));
    CHECK(d.hausdorff() == d.from_input.maximum);
  }
  Context context;
  CHECK(surface_distance(full, QuadMesh{}, {}, context).error().code == ErrorCode::bad_input);
}

TEST_CASE("deformation: a surface does not stray from itself", "[quality][fast]") {
  const Tube tube;
  Context context;
  const auto figures = deformation_error(tube.mesh, tube.rig.weights, to_polygons(tube.mesh), tube.rig.weights,
                                         bend_poses(tube.rig.skeleton), {.samples = 2000}, context)
                           .value();
  CHECK(figures.all.rms < 1e-6);
  CHECK(figures.back_rms < 1e-6);
  CHECK(figures.rest_all_rms < 1e-6);
}

TEST_CASE("deformation: the bits are the same at any number of threads and misfits are refused", "[quality][fast]") {
  const Tube tube;
  const auto coarse = to_polygons(tube.quads);
  const SkinWeights weights = closest_weights(tube.mesh, tube.rig.weights, coarse.positions).value();
  const std::vector<Pose> poses = bend_poses(tube.rig.skeleton);
  DeformationFigures first;
  for (const unsigned threads : {1u, 2u, 7u}) {
    Context context;
    context.threads = threads;
    const auto figures =
        deformation_error(tube.mesh, tube.rig.weights, coarse, weights, poses, {.samples = 1000}, context).value();
    if (threads == 1) first = figures;
    CHECK(figures.all.rms == first.all.rms);
    CHECK(figures.joints.p99 == first.joints.p99);
    CHECK(figures.back_p99 == first.back_p99);
    CHECK(figures.bent_rms == first.bent_rms);
    CHECK(figures.scaled_jacobian_average == first.scaled_jacobian_average);
  }
  CHECK(first.all.rms > 1);
  CHECK(first.scaled_jacobian_minimum < first.scaled_jacobian_average);
  Context context;
  const auto code = [&](const SkinWeights& w, std::span<const Pose> some, const DeformationOptions& options) {
    return deformation_error(tube.mesh, tube.rig.weights, coarse, w, some, options, context).error().code;
  };
  CHECK(code(SkinWeights(1, 2), poses, {}) == ErrorCode::bad_input);
  CHECK(code(weights, {}, {}) == ErrorCode::bad_input);
  CHECK(code(weights, std::vector<Pose>(1), {}) == ErrorCode::bad_input);
  CHECK(code(weights, poses, {.samples = 0}) == ErrorCode::bad_option);
}

TEST_CASE("deformation: the figures are those of the reference script", "[quality][reference][slow]") {
  const test::ScratchFolder scratch("deformation");
  const Tube tube;
  const auto coarse = to_polygons(tube.quads);
  write_obj(scratch / "fine.obj", to_polygons(tube.mesh));
  write_obj(scratch / "coarse.obj", coarse);
  std::ofstream(scratch / "rig.tgf") << "1 0 0 0\n2 3 0 0\n3 6 0 0\n#\n1 2\n2 3\n#\n";
  {
    std::ofstream dmat(scratch / "weights.dmat");
    dmat.precision(17);
    dmat << 2 << ' ' << tube.mesh.vertex_count() << '\n';
    for (Index b = 0; b < 2; ++b)
      for (Index v = 0; v < tube.mesh.vertex_count(); ++v) dmat << tube.rig.weights.coeff(v, b) << '\n';
  }
  std::string files;
  for (const char* name : {"fine.obj", "rig.tgf", "weights.dmat", "coarse.obj"})
    files += " '" + (scratch / name).string() + "'";
  const auto output = reference("deform.py", files, scratch);
  if (!output) return;
  // "name faces | rms p99 degrees | rms p99 degrees | rms p99 | rms rms | rms rms degrees | percent"
  std::string line = output->substr(output->find("coarse.obj"));
  std::replace(line.begin(), line.end(), '|', ' ');
  std::istringstream fields(line);
  std::string name;
  double faces = 0, theirs[14];
  fields >> name >> faces;
  for (double& x : theirs) REQUIRE(fields >> x);
  REQUIRE(faces == tube.quads.quad_count());

  Context context;
  const SkinWeights weights = closest_weights(tube.mesh, tube.rig.weights, coarse.positions).value();
  const auto f =
      deformation_error(tube.mesh, tube.rig.weights, coarse, weights, bend_poses(tube.rig.skeleton), {}, context)
          .value();
  const double ours[14] = {f.joints.rms,
                           f.joints.p99,
                           f.joints.normal_degrees,
                           f.all.rms,
                           f.all.p99,
                           f.all.normal_degrees,
                           f.back_rms,
                           f.back_p99,
                           f.rest_joints_rms,
                           f.rest_all_rms,
                           f.bent_rms,
                           f.bent_rest_rms,
                           f.bent_normal_degrees,
                           100 * f.flipped};
  for (int k = 0; k < 14; ++k) {
    INFO("figure " << k);
    CHECK(ours[k] == Approx(theirs[k]).epsilon(0.05).margin(0.02));
  }
}

TEST_CASE("guidance: a tube's quads run along its bones and ring its hinge", "[quality][fast]") {
  const Tube tube;
  const GuidanceFigures figures = guidance_figures(tube.mesh, tube.rig, tube.quads).value();
  CHECK(figures.bone_edges > 100);
  CHECK(figures.bone_angle_p99_degrees < 1e-6);
  CHECK(figures.irregular_where_blending == 0);
  // rings lie 1/4 apart; from 2.5 to 3.5 either bone holds more than 5 % of them
  CHECK(figures.hinge_loops == std::vector<Index>{0, 5});
  REQUIRE(figures.regions.size() == 3);
  double area = 0, quads = 0;
  for (const RegionDensity& region : figures.regions) {
    area += region.area_share;
    quads += region.quad_share;
    CHECK(region.density() == Approx(1).epsilon(0.2));
  }
  CHECK(area == Approx(1));
  CHECK(quads == Approx(1));

  // Bones across the tube: edges run along them or at right angles; where a bone leaves the surface nothing is said.
  Rig turned = tube.rig;
  turned.skeleton.bones[0].tail = {0, 0, 1};
  turned.skeleton.bones[1].tail = {3, 1, 0};
  const GuidanceFigures across = guidance_figures(tube.mesh, turned, tube.quads).value();
  CHECK(across.bone_angle_mean_degrees < 1e-6);
  CHECK(across.bone_edges > 0);
  CHECK(across.bone_edges < figures.bone_edges);

  // Lines wound round the tube at 20° while the rings stay: 10° on average.
  QuadMesh wound = tube.quads;
  const ClosestPoint tree(tube.mesh);
  for (Index v = 0; v < wound.vertex_count(); ++v) {
    const Vector3 p = wound.positions.row(v).transpose();
    const double angle = std::tan(20 * std::numbers::pi / 180) * p.x() / 0.5;
    wound.positions.row(v) = (Eigen::AngleAxisd(angle, Vector3::UnitX()) * p).transpose();
    wound.source[static_cast<std::size_t>(v)] = tree.closest(wound.positions.row(v).transpose());
  }
  CHECK(guidance_figures(tube.mesh, tube.rig, wound).value().bone_angle_mean_degrees == Approx(10).epsilon(0.1));
}

TEST_CASE("guidance: a torus is woven of closed loops", "[quality][fast]") {
  const Torus torus;
  const auto loops = edge_loops(torus.quads.quads);
  CHECK(loops.size() == 12 + 24);
  CHECK(std::count_if(loops.begin(), loops.end(), [](const auto& loop) { return loop.size() == 12; }) == 24);
  CHECK(std::count_if(loops.begin(), loops.end(), [](const auto& loop) { return loop.size() == 24; }) == 12);
  const Tube tube;  // open along its length: only the rings between its ends close
  CHECK(edge_loops(tube.quads.quads).size() == 23);
}
