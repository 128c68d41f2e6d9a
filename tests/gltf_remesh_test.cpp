#include <algorithm>

#include "quadrig/gltf.hpp"

#include "gltf_tube.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

struct Done {
  std::string json;  ///< of the file that was written
  std::vector<GltfRemeshed> surfaces;
  std::vector<GltfSurface> read_back;
};

Done remeshed(const Tube& tube, const GltfRemeshOptions& options) {
  const ScratchFolder folder("gltf-remesh");
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file(tube), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  Expected<std::vector<GltfRemeshed>> surfaces = remesh_gltf(*document, options, context);
  if (!surfaces) FAIL(surfaces.error().message());
  FileSet files;
  REQUIRE(document->add_to(files, folder / "out.glb", context).ok());
  REQUIRE(files.commit().ok());
  const Expected<GltfDocument> again = GltfDocument::read(folder / "out.glb", {}, context);
  REQUIRE(again.has_value());
  Expected<std::vector<GltfSurface>> back = gltf_surfaces(*again, {.weld_distance = 1e-6}, {}, context);
  if (!back) FAIL(back.error().message());
  return {again->json(), std::move(*surfaces), std::move(*back)};
}

GltfRemeshOptions asked(Index quads) {
  GltfRemeshOptions options;
  options.remesh.quads = quads;
  return options;
}

/// The text between a key and what ends its value.
std::string part(const std::string& json, const std::string& from, const std::string& to) {
  const auto first = json.find(from);
  REQUIRE(first != std::string::npos);
  return json.substr(first, json.find(to, first) - first);
}

}  // namespace

TEST_CASE("gltf: the written file holds the quads as triangle pairs, closed once it is welded", "[gltf]") {
  for (const bool as_json : {false, true}) {
    const Done done = remeshed({.as_json = as_json}, asked(400));
    REQUIRE(done.surfaces.size() == 1);
    const RemeshResult& result = done.surfaces[0].result;
    CHECK(result.report.valid);
    const TriangleMesh<double>& mesh = done.read_back[0].asset.mesh;
    CHECK(mesh.face_count() == 2 * result.mesh.quad_count());
    CHECK(mesh.vertex_count() == result.mesh.vertex_count());
    CHECK(mesh.closed());
    CHECK(done.surfaces[0].written_vertices > result.mesh.vertex_count());  // seams and materials part vertices
    // Both materials are there.
    const auto& labels = done.read_back[0].source_primitive;
    CHECK(std::ranges::count(labels, 0) > 50);
    CHECK(std::ranges::count(labels, 1) > 50);
  }
}

TEST_CASE("gltf: joints, clips and weights move the quads as they moved the triangles", "[gltf]") {
  const Done done = remeshed({}, asked(300));
  const GltfSurface &before = done.surfaces[0].surface, &after = done.read_back[0];
  REQUIRE(before.asset.rig->skeleton.bone_count() == after.asset.rig->skeleton.bone_count());
  const SkinWeights& weights = after.asset.rig->weights;
  for (Index v = 0; v < weights.rows(); ++v) {
    // The tube's weights are a function of height alone, so they can be told from the position.
    const double y = after.asset.mesh.positions()(v, 1);
    const double upper = std::min(1.0, std::max(0.0, 2.0 * (y - 0.75)));
    CHECK(std::abs(weights.row(v).sum() - 1) < 1e-6);
    CHECK(std::abs(weights.coeff(v, 1) - upper) < 0.13);  // one ring of the tube
  }
  const std::string in = tube_file({.as_json = true});
  for (const auto& [from, to] : {std::pair{"\"animations\":", "\"accessors\""}, std::pair{"\"nodes\":[{", "\"meshes\""},
                                 std::pair{"\"materials\":", "\"animations\""}, std::pair{"\"extras\":", "}"}})
    CHECK(part(done.json, from, to) == part(in, from, to));
}

TEST_CASE("gltf: shells that are due less than a few quads stay as they are", "[gltf]") {
  GltfRemeshOptions options = asked(200);
  options.least_shell_quads = 1000;  // the largest shell is remeshed even so
  const Done done = remeshed({}, options);
  CHECK(done.surfaces[0].result.mesh.quad_count() > 0);
  CHECK(done.surfaces[0].passed_shells == 0);
}

TEST_CASE("gltf: the poses of the clips can be what sizes are made for", "[gltf]") {
  GltfRemeshOptions options = asked(300);
  options.pose_source = GltfPoses::clips;
  CHECK(remeshed({}, options).surfaces[0].result.report.valid);
}

TEST_CASE("gltf: an option that cannot be leaves the document as it was", "[gltf]") {
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file(), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  const std::string before = document->json();
  const auto result = remesh_gltf(*document, asked(2), context);
  REQUIRE(!result.has_value());
  CHECK(result.error().code == ErrorCode::bad_option);
  CHECK(document->json() == before);
  CHECK(!document->edited());
}
