// What real characters need of a glTF file: one budget, the input's own quads, nothing torn or lost.
#include <map>

#include "gltf_tube.hpp"
#include "quadrig/gltf.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

std::vector<GltfVertices> vertices_with(const GltfDocument& document, std::string_view name) {
  Context context;
  Expected<std::vector<GltfVertices>> all = gltf_vertices(document, name, context);
  REQUIRE(all.has_value());
  return std::move(*all);
}

struct Character {
  GltfDocument document;
  std::vector<GltfRemeshed> surfaces;
  [[nodiscard]] Index triangles() const {
    Index sum = 0;
    for (const GltfRemeshed& one : surfaces) sum += 2 * one.result.report.quads + one.triangles;
    return sum;
  }
};

Character made(const std::string& file, const GltfRemeshOptions& options) {
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(file, "tube.glb", {}, context);
  REQUIRE(document.has_value());
  Expected<std::vector<GltfRemeshed>> surfaces = remesh_gltf(*document, options, context);
  if (!surfaces) FAIL(surfaces.error().message());
  return {std::move(*document), std::move(*surfaces)};
}

Character made(const Tube& tube, Index quads) {
  GltfRemeshOptions options;
  options.remesh.quads = quads;
  return made(tube_file(tube), options);
}

}  // namespace

TEST_CASE("gltf characters: at its own count a modelled shell keeps its quads and its vertices", "[gltf][fast]") {
  const Tube tube{.sides = 12, .rings = 16};  // 192 quads, and 24 triangles of the caps
  const Character done = made(tube, 204);
  REQUIRE(done.surfaces.size() == 1);
  REQUIRE(done.surfaces[0].shells.size() == 1);
  const GltfShell& shell = done.surfaces[0].shells[0];
  CHECK(shell.make == GltfMake::kept);
  CHECK(shell.input_triangles == 408);
  CHECK(2 * shell.quads + shell.triangles == 408);
  CHECK(shell.quads >= 192);
  CHECK(shell.largest == 0);
  CHECK(gltf_triangle_count(done.document) == 408);
  // Every quad of the sides is one that the tube was made from: two of its corners above the other two.
  const QuadMesh& mesh = done.surfaces[0].result.mesh;
  Index upright = 0;
  for (Index q = 0; q < mesh.quad_count(); ++q) {
    std::map<int, int> heights;
    for (int i = 0; i < 4; ++i) ++heights[static_cast<int>(std::lround(8 * mesh.positions(mesh.quads(q, i), 1)))];
    upright += heights.size() == 2 && heights.begin()->second == 2;
  }
  CHECK(upright == 192);
  // The places, texture coordinates and displacements of all corners are the input's.
  Context context;
  const Expected<GltfDocument> input = GltfDocument::parse(tube_file(tube), "in.glb", {}, context);
  REQUIRE(input.has_value());
  for (const char* name : {"TEXCOORD_0", "targets[0].POSITION"}) {
    INFO(name);
    const auto corners = [&](const GltfDocument& of) {
      std::vector<std::vector<float>> all;
      for (const GltfVertices& one : vertices_with(of, name))
        for (Eigen::Index c = 0; c < one.triangles.size(); ++c) {
          const Index v = one.triangles(c / 3, c % 3);
          std::vector<float>& row = all.emplace_back();
          for (int k = 0; k < 3; ++k) row.push_back(static_cast<float>(one.positions(v, k)));
          for (Eigen::Index k = 0; k < one.values.cols(); ++k) row.push_back(static_cast<float>(one.values(v, k)));
        }
      std::sort(all.begin(), all.end());
      return all;
    };
    CHECK(corners(done.document) == corners(*input));
  }
}

TEST_CASE("gltf characters: fewer quads are whole rows less, on the vertices that were there", "[gltf][fast]") {
  const Character done = made({.sides = 16, .rings = 24}, 200);
  const GltfShell& shell = done.surfaces[0].shells[0];
  CHECK(shell.make != GltfMake::kept);
  CHECK(std::abs(done.triangles() - 400) <= 20);
  CHECK(gltf_triangle_count(done.document) == done.triangles());
  CHECK(shell.largest > 0);
  CHECK(done.surfaces[0].result.report.scaled_jacobian_minimum > 0);
  if (shell.make != GltfMake::rows) return;
  const QuadMesh& mesh = done.surfaces[0].result.mesh;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const double ring = 12 * mesh.positions(v, 1);
    CHECK(std::abs(ring - std::round(ring)) < 1e-5);
  }
}

TEST_CASE("gltf characters: counts fall with the request, and no material is lost", "[gltf][fast]") {
  Index before = std::numeric_limits<Index>::max();
  for (const Index quads : {1000, 400, 200, 100, 50, 25}) {
    INFO(quads);
    const Character done = made({.sides = 16, .rings = 24}, quads);
    CHECK(done.triangles() <= before);
    before = done.triangles();
    if (quads >= 50) CHECK(std::abs(done.triangles() - 2 * quads) <= std::max(4.0, 0.1 * quads));
    const std::vector<GltfVertices> primitives = vertices_with(done.document, "POSITION");
    REQUIRE(primitives.size() == 2);
    for (const GltfVertices& one : primitives) CHECK(one.triangles.rows() > 0);
  }
}

TEST_CASE("gltf characters: islands smaller than a quad keep one each, where they lie", "[gltf][fast]") {
  // Two cells with sides of .06 on quads with sides of .15 to .3: they hold the middle of one by chance alone.
  for (const Index quads : {40, 80, 160}) {
    GltfRemeshOptions options;
    options.remesh.quads = quads;
    options.topology = GltfTopology::field;
    const Character done = made(tube_file({.sides = 24, .rings = 32, .spots = true}), options);
    INFO(quads);
    CHECK(done.surfaces[0].failures.empty());
    CHECK(done.surfaces[0].shells[0].make == GltfMake::field);
    const std::vector<GltfVertices> primitives = vertices_with(done.document, "POSITION");
    REQUIRE(primitives.size() == 3);
    const GltfVertices& spots = primitives[2];
    CHECK(spots.triangles.rows() >= 4);
    CHECK(spots.triangles.rows() <= 8);
    const double edge = std::sqrt(std::numbers::pi / quads);  // about: the tube's area is 3.5
    Index near = 0, far = 0;
    for (Eigen::Index k = 0; k < spots.triangles.size(); ++k) {
      const auto p = spots.values.row(spots.triangles(k / 3, k % 3));
      (p[0] > 0 ? near : far) += 1;
      CHECK(std::abs(p[1] - 0.5) < 2.5 * edge);
      CHECK(std::abs(p[2]) < 0.25);
    }
    CHECK(near >= 6);
    CHECK(far >= 6);
  }
}

TEST_CASE("gltf characters: where own quads keep what is painted in its place, they are taken", "[gltf][fast]") {
  // The field's few quads are as near to a tube as fewer rows are; its spots are off by half a quad.
  const Character done = made({.sides = 24, .rings = 32, .spots = true}, 400);
  const std::vector<GltfVertices> primitives = vertices_with(done.document, "POSITION");
  REQUIRE(primitives.size() == 3);
  const GltfVertices& spots = primitives[2];
  for (Eigen::Index k = 0; k < spots.triangles.size(); ++k) {
    const auto p = spots.values.row(spots.triangles(k / 3, k % 3));
    CHECK(std::abs(p[1] - 0.53) < 0.1);
    CHECK(std::abs(p[2]) < 0.2);
  }
}

TEST_CASE("gltf characters: quads on the border of a material are fitted as others are", "[gltf][fast]") {
  // Flat quads are nearest to a tube with their corners outside it; the border runs round at y = 1.
  GltfRemeshOptions options;
  options.remesh.quads = 300;
  options.topology = GltfTopology::field;
  const Character done = made(tube_file({.sides = 48, .rings = 32}), options);
  CHECK(done.surfaces[0].snapped_edges > 10);
  const Points<double>& places = done.surfaces[0].result.mesh.positions;
  Index border = 0, outside = 0;
  for (Index v = 0; v < places.rows(); ++v) {
    if (std::abs(places(v, 1) - 1) > 0.01) continue;
    ++border;
    outside += std::hypot(places(v, 0), places(v, 2)) > 0.25;
  }
  CHECK(border >= 6);
  CHECK(2 * outside > border);
}

TEST_CASE("gltf characters: coarse or fine, no morph target parts doubled vertices", "[gltf][fast]") {
  for (const Index quads : {60, 150, 192, 600}) {
    const Character done = made({.sides = 16, .rings = 12}, quads);
    std::map<std::array<double, 3>, Vector3> first;
    Index doubled = 0;
    for (const GltfVertices& one : vertices_with(done.document, "targets[0].POSITION"))
      for (Eigen::Index v = 0; v < one.positions.rows(); ++v) {
        const Vector3 change = one.values.row(v).transpose();
        const auto [place, is_new] =
            first.try_emplace({one.positions(v, 0), one.positions(v, 1), one.positions(v, 2)}, change);
        doubled += is_new ? 0 : 1;
        CHECK((place->second - change).norm() < 1e-6);
      }
    CHECK(doubled > 5);
  }
}

TEST_CASE("gltf characters: a rigid part that hangs on a joint is part of the character", "[gltf][fast]") {
  CHECK(made({.crate = true}, 150).surfaces.size() == 1);
  const Character done = made({.crate = true, .hung = true}, 150);
  REQUIRE(done.surfaces.size() == 2);
  CHECK(done.surfaces[1].surface.label() == "meshes[1] 'crate'");
  CHECK(done.surfaces[1].shells[0].due > 0);
  CHECK(std::abs(gltf_triangle_count(done.document) - 300) <= 15);  // the box counts too
}

TEST_CASE("gltf characters: skins that agree are one surface, and stay closed", "[gltf][fast]") {
  Context context;
  for (const GltfTopology topology : {GltfTopology::best, GltfTopology::field}) {
    Expected<GltfDocument> document = GltfDocument::parse(tube_file({.parted = true}), "tube.glb", {}, context);
    REQUIRE(document.has_value());
    GltfRemeshOptions options;
    options.remesh.quads = 150;
    options.topology = topology;
    const auto done = remesh_gltf(*document, options, context);
    REQUIRE(done.has_value());
    CHECK(done->size() == 1);
    const auto again = gltf_surfaces(*document, {.weld_distance = 1e-7}, {}, context);
    REQUIRE(again.has_value());
    REQUIRE(again->size() == 1);
    CHECK((*again)[0].asset.mesh.closed());
    CHECK((*again)[0].meshes == std::vector<Index>{0, 1});
    // Either mesh has its own part, and its own skin.
    for (const GltfVertices& one : vertices_with(*document, "POSITION")) CHECK(one.triangles.rows() > 50);
    CHECK(document->json().find("\"mesh\":1,\"skin\":1") != std::string::npos);
  }
}

TEST_CASE("gltf characters: flat shading comes out flat, smooth normals stay the file's", "[gltf][fast]") {
  // The tube has no normals, which glTF draws flat: every face of what is written has one.
  const Character done = made({}, 150);
  const std::vector<GltfVertices> normals = vertices_with(done.document, "NORMAL");
  Index seen = 0;
  for (const GltfVertices& one : normals)
    for (Eigen::Index t = 0; t < one.triangles.rows(); ++t) {
      const auto n = [&](int i) { return Vector3(one.values.row(one.triangles(t, i)).transpose()); };
      CHECK((n(0) - n(1)).norm() + (n(1) - n(2)).norm() < 1e-6);
      ++seen;
    }
  CHECK(seen > 250);
  // Kept as it is, it has none again: what is drawn when it moves is the same too.
  const Character kept = made({.sides = 12, .rings = 16}, 204);
  for (const GltfVertices& one : vertices_with(kept.document, "NORMAL")) CHECK(one.values.rows() == 0);
}

TEST_CASE("gltf characters: quads of a field have the hard edges of the file, and none beside", "[gltf][fast]") {
  GltfRemeshOptions options;
  options.topology = GltfTopology::field;
  options.remesh.quads = 300;
  const Character done = made(tube_file({.sides = 24, .rings = 24, .two_materials = false, .normals = true}), options);
  const GltfVertices one = vertices_with(done.document, "NORMAL").front();
  std::map<std::array<double, 3>, std::vector<Vector3>> at;
  for (Eigen::Index v = 0; v < one.positions.rows(); ++v)
    at[{one.positions(v, 0), one.positions(v, 1), one.positions(v, 2)}].push_back(one.values.row(v).transpose());
  Index rim = 0, parted = 0;
  for (const auto& [place, normals] : at) {
    const double height = place[1], radius = std::hypot(place[0], place[2]);
    const bool on_rim = std::abs(std::abs(height - 1) - 1) < 0.02 && radius > 0.23;
    bool parts = false;
    for (const Vector3& n : normals) parts = parts || n.dot(normals.front()) < 0.5;  // 60 of the file's 90 degrees
    rim += on_rim;
    parted += on_rim && parts;
    if (!on_rim && radius < 0.2) CHECK_FALSE(parts);
    if (std::abs(height - 1) < 0.8) {
      CHECK_FALSE(parts);
      for (const Vector3& n : normals) CHECK(std::abs(n.y()) < 0.2);
    }
  }
  CHECK(rim >= 12);
  CHECK(parted == rim);
}

TEST_CASE("gltf characters: the distance of each primitive is known, in each morph target too", "[gltf][fast]") {
  const Character kept = made({.sides = 12, .rings = 16}, 204), fewer = made({.sides = 16, .rings = 24}, 40);
  for (const Character* done : {&kept, &fewer}) {
    const std::vector<GltfPrimitive>& primitives = done->surfaces.front().primitives;
    REQUIRE(primitives.size() == 2);
    Index triangles = 0;
    for (const GltfPrimitive& one : primitives) {
      triangles += one.triangles;
      CHECK(one.mesh == 0);
      CHECK(one.size > 1);
      REQUIRE(one.targets.size() == 1);
      CHECK((one.rest.largest > 1e-5) == (done == &fewer));
      CHECK((one.targets[0].distance.largest > 1e-5) == (done == &fewer));
      CHECK(one.rest.mean <= one.rest.largest);
      CHECK(one.rest.largest < one.edge);
    }
    CHECK(triangles == done->triangles());
  }
}

TEST_CASE("gltf characters: normals of the author are carried over, others made anew", "[gltf][fast]") {
  GltfRemeshOptions options;
  options.topology = GltfTopology::field;
  options.remesh.quads = 200;
  const auto least_up = [&](const Tube& tube, GltfNormals normals, Index kept) {
    options.normals = normals;
    const Character done = made(tube_file(tube), options);
    CHECK(done.surfaces.front().kept_normals == kept);
    double least = 1;
    for (const GltfVertices& one : vertices_with(done.document, "NORMAL"))
      least = std::min(least, one.values.col(1).minCoeff());
    return least;
  };
  CHECK(least_up({.upward = true}, GltfNormals::automatic, 1) > 0.999);
  CHECK(least_up({.upward = true}, GltfNormals::keep, 1) > 0.999);
  CHECK(least_up({.upward = true}, GltfNormals::fresh, 0) < 0.2);
  CHECK(least_up({.normals = true}, GltfNormals::automatic, 0) < -0.9);
}

TEST_CASE("gltf characters: brows and lashes stay over a coarse face, in each morph target", "[gltf][slow]") {
  Context context;
  const std::string file = make_sample_glb("head", 8000, context).value();
  GltfRemeshOptions options;
  options.remesh.quads = 1000;
  const Character done = made(file, options);
  CHECK(done.surfaces.front().moved_vertices > 0);
  for (int target = 0; target < 6; ++target)
    for (const double strength : {0.0, 1.0}) {
      const auto primitives = vertices_with(done.document, "targets[" + std::to_string(target) + "].POSITION");
      const auto place = [&](const GltfVertices& of, Index v) {
        return Vector3((of.positions.row(v) + strength * of.values.row(v)).transpose());
      };
      // Rays from brows to the front meet no skin.
      const GltfVertices &skin = primitives[0], &sheets = primitives[2];
      Index brows = 0, covered = 0;
      for (Index v = 0; v < static_cast<Index>(sheets.positions.rows()); ++v) {
        const Vector3 p = place(sheets, v);
        if (sheets.positions(v, 1) < 0.026) continue;
        ++brows;
        bool hit = false;
        for (Index f = 0; f < static_cast<Index>(skin.triangles.rows()) && !hit; ++f) {
          const Vector3 a = place(skin, skin.triangles(f, 0)), b = place(skin, skin.triangles(f, 1)),
                        c = place(skin, skin.triangles(f, 2));
          Eigen::Matrix3d system;
          system << a.head<2>(), b.head<2>(), c.head<2>(), 1, 1, 1;
          if (std::abs(system.determinant()) < 1e-12) continue;
          const Vector3 shares = system.inverse() * Vector3(p.x(), p.y(), 1);
          hit = shares.minCoeff() > 1e-6 && shares.dot(Vector3(a.z(), b.z(), c.z())) > p.z() + 1e-5;
        }
        covered += hit;
      }
      INFO("target " << target << " at " << strength);
      CHECK(brows >= 8);
      CHECK(covered == 0);
    }
}

TEST_CASE("gltf characters: eyes and mouth of the head have their rings from 1500 quads on", "[gltf][rims][slow]") {
  Context context;
  const std::string file = make_sample_glb("head", 8000, context).value();
  GltfRemeshOptions options;
  for (const Index quads : {1500, 3000}) {
    options.remesh.quads = quads;
    const Character done = made(file, options);
    const std::vector<RimReport>& rims = done.surfaces.front().result.report.rims;
    CAPTURE(quads);
    CHECK(rims.size() == 3);
    for (const RimReport& rim : rims) CHECK(rim.loops >= 3);
  }
}
