#include <algorithm>
#include <map>

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

/// Quads of a field, wherever there is room for one.
GltfRemeshOptions asked(Index quads) {
  GltfRemeshOptions options;
  options.remesh.quads = quads;
  options.topology = GltfTopology::field;
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
  for (const auto& [from, to] :
       {std::pair{"\"animations\":", "\"accessors\""}, std::pair{"\"nodes\":[{", "\"meshes\""},
        std::pair{"\"materials\":", "\"animations\""}, std::pair{"\"extras\":{\"huge\":", "}"}})
    CHECK(part(done.json, from, to) == part(in, from, to));
}

TEST_CASE("gltf: a skin that cannot be read stays as it is, by name and with its reason", "[gltf]") {
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.broken = true}), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  const std::string old = part(document->json(), "\"name\":\"broken\"", "]}");
  GltfDocument strict_document = document->copy();
  const Expected<std::vector<GltfRemeshed>> all = remesh_gltf(*document, asked(300), context);
  REQUIRE(all.has_value());
  REQUIRE(all->size() == 2);
  CHECK((*all)[0].failures.empty());
  REQUIRE((*all)[1].failures.size() == 1);
  const GltfFailure& failure = (*all)[1].failures[0];
  CHECK(failure.part == "skins[1] 'bad'");
  CHECK(failure.reason.code == ErrorCode::bad_input);
  CHECK(failure.reason.message().find("not finite") != std::string::npos);
  CHECK(part(document->json(), "\"name\":\"broken\"", "]}") == old);
  CHECK(std::ranges::any_of(context.warnings, [](const Warning& warning) {
    return warning.text.find("skins[1] 'bad' stays as it is") != std::string::npos;
  }));

  GltfRemeshOptions strict = asked(300);
  strict.prepare.strict = true;
  strict.prepare.weld = Weld::all;
  const std::string before = strict_document.json();
  CHECK(!remesh_gltf(strict_document, strict, context).has_value());
  CHECK(strict_document.json() == before);
}

TEST_CASE("gltf: bind matrices are mended where the surface is too small to be remeshed too", "[gltf]") {
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.speck = true}), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  const std::string old = part(document->json(), "\"name\":\"broken\"", "]}");
  const Expected<std::vector<GltfRemeshed>> all = remesh_gltf(*document, asked(300), context);
  REQUIRE(all.has_value());
  REQUIRE(all->size() == 2);
  CHECK((*all)[1].passed_shells == 1);
  CHECK((*all)[1].surface.repairs.bind_rows == 2);
  CHECK(part(document->json(), "\"name\":\"broken\"", "]}") == old);
  const Expected<std::vector<GltfSurface>> again = gltf_surfaces(*document, {}, {}, context);
  REQUIRE(again.has_value());
  CHECK((*again)[1].repairs.bind_rows == 0);
}

TEST_CASE("gltf: joints that hang apart are given a root in the scene, and do not move", "[gltf]") {
  GltfRemeshOptions options = asked(200);
  options.pose_source = GltfPoses::clips;  // reads them
  const Done done = remeshed({.loose = true}, options);
  CHECK(done.surfaces[0].surface.repairs.loose_roots == 2);
  CHECK(done.read_back[0].repairs.loose_roots == 0);
  CHECK(part(done.json, "\"scenes\":", "]}") == "\"scenes\":[{\"nodes\":[0,3");
  CHECK(done.json.find("{\"name\":\"joints\",\"children\":[1,2]}") != std::string::npos);
  const Clip &before = done.surfaces[0].surface.asset.rig->clips[0], &after = done.read_back[0].asset.rig->clips[0];
  REQUIRE(before.poses.size() > 10);
  for (std::size_t k = 0; k < before.poses.size(); ++k)
    for (std::size_t j = 0; j < 2; ++j) CHECK(before.poses[k][j].isApprox(after.poses[k][j]));

  GltfRemeshOptions strict = asked(200);
  strict.prepare.strict = true;
  strict.prepare.weld = Weld::all;
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.loose = true}), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  CHECK(!remesh_gltf(*document, strict, context).has_value());
}

TEST_CASE("gltf: a shell that cannot be remeshed stays among the quads of the others", "[gltf]") {
  GltfRemeshOptions options = asked(300);
  options.least_shell_quads = 0;
  const Done done = remeshed({.needle = true}, options);
  REQUIRE(done.surfaces.size() == 1);
  const GltfRemeshed& one = done.surfaces[0];
  // The tube's quads hang together, and the needle, narrower than what is welded here, is beside them.
  const Components components = face_components(done.read_back[0].asset.mesh);
  REQUIRE(one.shells.size() == 2);
  CHECK(std::ranges::count(components.of_face, 0) == 2 * one.shells[0].quads);
  CHECK(components.count >= 2);
  // What it becomes is the pipeline's to say; what is told of it must be true.
  REQUIRE(one.failures.size() <= 1);
  CHECK(one.passed_triangles == one.passed_shells);
  if (one.failures.empty()) return;
  CHECK(one.failures[0].part == "skins[0] 'tube', shell 1 (meshes[0], 1 triangles)");
  CHECK(!one.failures[0].reason.what.empty());
  CHECK(done.read_back[0].asset.mesh.face_count() == 2 * one.result.mesh.quad_count() + 1);
}

TEST_CASE("gltf: a file without a skinned mesh is remeshed without a rig", "[gltf]") {
  const Done done = remeshed({.skinned = false}, asked(400));
  REQUIRE(done.surfaces.size() == 1);
  CHECK(done.surfaces[0].surface.skin == no_index);
  CHECK(done.surfaces[0].surface.label() == "meshes[0] 'tube'");
  CHECK(!done.surfaces[0].result.weights.has_value());
  CHECK(done.json.find("JOINTS_0") == std::string::npos);
  CHECK(done.read_back[0].asset.mesh.closed());
  CHECK(done.read_back[0].asset.mesh.face_count() == 2 * done.surfaces[0].result.mesh.quad_count());
}

TEST_CASE("gltf: what is remeshed is told by rule and by name", "[gltf]") {
  const std::string bytes = tube_file({.crate = true});
  const auto labels = [&](const GltfSelection& selection) {
    Context context;
    const Expected<GltfDocument> document = GltfDocument::parse(bytes, "tube.glb", {}, context);
    REQUIRE(document.has_value());
    const Expected<std::vector<GltfSurface>> surfaces = gltf_surfaces(*document, {}, {}, context, selection);
    std::string text;
    if (!surfaces) return surfaces.error().message();
    for (const GltfSurface& surface : *surfaces)
      text += surface.label() + " " + std::to_string(surface.asset.mesh.face_count()) + ";";
    return text;
  };
  const std::string tube = "skins[0] 'tube' ", crate = "meshes[1] 'crate' 12;";
  CHECK(labels({}) == tube + "408;");
  CHECK(labels({.names = {}, .unskinned = true}) == tube + "408;" + crate);
  for (const char* name : {"crate", "prop", "cra.*", "(crate|none)"}) CHECK(labels({.names = {name}}) == crate);
  CHECK(labels({.names = {"body"}}) == tube + "408;");
  CHECK(labels({.names = {"red"}}) == tube + "204;");
  CHECK(labels({.names = {"red", "prop"}}) == tube + "204;" + crate);
  for (const char* name : {"rat", "(", "none"}) {
    INFO(name);
    CHECK(labels({.names = {name}}).find("give a name of the file") != std::string::npos);
  }
}

TEST_CASE("gltf: a mesh that is not selected keeps its bytes", "[gltf]") {
  GltfRemeshOptions options = asked(200);
  options.selection.names = {"tube"};
  const Done done = remeshed({.crate = true}, options);
  Context context;
  const Expected<GltfDocument> before = GltfDocument::parse(tube_file({.crate = true}), "tube.glb", {}, context);
  REQUIRE(before.has_value());
  CHECK(part(done.json, "\"name\":\"crate\"", "]}") == part(before->json(), "\"name\":\"crate\"", "]}"));
}

TEST_CASE("gltf: the source map leads from each vertex to its place on the input", "[gltf]") {
  GltfRemeshOptions options = asked(300);
  options.remesh.fit.method = FitMethod::slide;  // vertices lie where they say
  options.source_map = true;
  const Done done = remeshed({}, options);
  CHECK(done.json.find("\"_SOURCE\"") != std::string::npos);
  // The written attribute is read back by the layer itself as a custom attribute: numbers within their ranges, and the
  // point of the named triangle is where the vertex is.
  const ScratchFolder folder("gltf-source");
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file(), "tube.glb", {}, context);
  const Expected<std::vector<GltfRemeshed>> all = remesh_gltf(*document, options, context);
  REQUIRE(all.has_value());
  const Expected<std::vector<GltfVertices>> written = gltf_vertices(*document, "_SOURCE", context);
  const Expected<GltfDocument> input = GltfDocument::parse(tube_file(), "tube.glb", {}, context);
  const Expected<std::vector<GltfVertices>> read = gltf_vertices(*input, "TEXCOORD_0", context);
  REQUIRE((written.has_value() && read.has_value()));
  REQUIRE(written->size() == 2);
  double worst = 0;
  Index seen = 0;
  for (const GltfVertices& primitive : *written)
    for (Index v = 0; v < primitive.positions.rows(); ++v) {
      const Eigen::RowVectorXd source = primitive.values.row(v);
      const GltfVertices& from = (*read)[static_cast<std::size_t>(source[0])];
      const auto t = static_cast<Index>(source[1]);
      REQUIRE(t < from.triangles.rows());
      const double b[3] = {1 - source[2] - source[3], source[2], source[3]};
      Vector3 p = Vector3::Zero();
      for (int i = 0; i < 3; ++i) p += b[i] * from.positions.row(from.triangles(t, i)).transpose();
      worst = std::max(worst, (p - primitive.positions.row(v).transpose()).norm());
      ++seen;
    }
  CHECK(seen > 300);
  CHECK(worst < 1e-6);
}

TEST_CASE("gltf: edges between regions lie on the seams where quads stay good", "[gltf]") {
  GltfRemeshOptions options = asked(600);
  options.remesh.fit.method = FitMethod::slide;
  options.remesh.symmetry = SymmetryChoice::none;  // a seam in the middle of a half may have no line near
  const Done kept = remeshed({}, options);
  options.snap_seams = false;
  const Done free = remeshed({}, options);
  const GltfRemeshed &with = kept.surfaces[0], &without = free.surfaces[0];
  CHECK(without.seam_edges == 0);
  CHECK(with.result.mesh.quad_count() == without.result.mesh.quad_count());
  CHECK(with.seam_edges > 40);  // up the side, and three rings
  CHECK(2 * with.snapped_edges > with.seam_edges);
  CHECK(with.result.report.scaled_jacobian_minimum >=
        std::min(options.least_at_seams, without.result.report.scaled_jacobian_minimum) - 1e-12);
  // Vertices stay where `source` says, and on the seams are more of them: the side's, the middle's and the caps'.
  const auto on_seams = [](const GltfRemeshed& one) {
    Index count = 0;
    for (Index v = 0; v < one.result.mesh.vertex_count(); ++v) {
      const Vector3 p = one.result.mesh.positions.row(v).transpose();
      CHECK((position(one.remeshed, one.result.mesh.source[static_cast<std::size_t>(v)]) - p).norm() < 1e-12);
      const bool side = std::abs(p.z()) < 1e-9 && p.x() > 0.1, middle = std::abs(p.y() - 1) < 1e-9;
      const bool cap = std::hypot(p.x(), p.z()) > 0.24 && (std::abs(p.y()) < 1e-9 || std::abs(p.y() - 2) < 1e-9);
      count += side || middle || cap;
    }
    return count;
  };
  CHECK(on_seams(with) > 2 * on_seams(without));
  CHECK(on_seams(with) > with.snapped_edges / 2);
}

TEST_CASE("gltf: the attribute _DENSITY says where quads are small", "[gltf]") {
  const auto share_above = [](bool dense_top) {
    GltfRemeshOptions options = asked(600);
    options.topology = GltfTopology::field;
    const Done done = remeshed({.two_materials = false, .dense_top = dense_top}, options);
    const QuadMesh& mesh = done.surfaces[0].result.mesh;
    Index above = 0;
    for (Index q = 0; q < mesh.quad_count(); ++q) {
      double y = 0;
      for (int i = 0; i < 4; ++i) y += mesh.positions(mesh.quads(q, i), 1) / 4;
      above += y > 1;
    }
    return static_cast<double>(above) / mesh.quad_count();
  };
  const double even = share_above(false), dense = share_above(true);
  CAPTURE(even, dense);
  CHECK(even < 0.6);
  CHECK(dense > even + 0.1);  // 0.9 of all, but that sizes change gradually and the middle bends
}

TEST_CASE("gltf: normals of morph targets are those of the moved quads", "[gltf]") {
  const Done done = remeshed({.morph_normals = true}, asked(300));
  // The target stretches the tube along y by 5 %: what it does to normals is small, and nothing like the input's 0.5.
  CHECK(done.json.find("\"targets\":[{\"POSITION\":") != std::string::npos);
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.morph_normals = true}), "tube.glb", {}, context);
  REQUIRE(remesh_gltf(*document, asked(300), context).has_value());
  const Expected<std::vector<GltfVertices>> normals = gltf_vertices(*document, "NORMAL", context),
                                            moved = gltf_vertices(*document, "targets[0].NORMAL", context);
  REQUIRE((normals.has_value() && moved.has_value()));
  double largest = 0, length = 0;
  for (std::size_t p = 0; p < moved->size(); ++p) {
    largest = std::max(largest, (*moved)[p].values.cwiseAbs().maxCoeff());
    const Eigen::MatrixXd sum = (*moved)[p].values + (*normals)[p].values;
    for (Eigen::Index v = 0; v < sum.rows(); ++v) length = std::max(length, std::abs(sum.row(v).norm() - 1));
  }
  CHECK(largest > 1e-4);
  CHECK(largest < 0.2);
  CHECK(length < 1e-5);
}

TEST_CASE("gltf: vertices doubled along seams move as one in morph targets", "[gltf]") {
  Context context;
  // Coarse quads: corners of those that reach over a seam lie far from their own side.
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.sides = 24, .rings = 32}), "tube.glb", {}, context);
  REQUIRE(remesh_gltf(*document, asked(90), context).has_value());
  const Expected<std::vector<GltfVertices>> moved = gltf_vertices(*document, "targets[0].POSITION", context);
  REQUIRE(moved.has_value());
  std::map<std::array<double, 3>, Vector3> first;
  Index doubled = 0;
  for (const GltfVertices& one : *moved)
    for (Eigen::Index v = 0; v < one.positions.rows(); ++v) {
      const Vector3 change = one.values.row(v).transpose();
      const auto [place, is_new] =
          first.try_emplace({one.positions(v, 0), one.positions(v, 1), one.positions(v, 2)}, change);
      doubled += is_new ? 0 : 1;
      CHECK((place->second - change).norm() < 1e-6);
    }
  CHECK(doubled > 10);
}

TEST_CASE("gltf: shells that are due less than a few quads stay as they are", "[gltf]") {
  GltfRemeshOptions options = asked(200);
  options.least_shell_quads = 1000;  // the largest shell is remeshed even so
  const Done done = remeshed({}, options);
  CHECK(done.surfaces[0].result.mesh.quad_count() > 0);
  CHECK(done.surfaces[0].passed_shells == 0);
}

TEST_CASE("gltf: the bytes of the replaced surface go, and all others stay", "[gltf]") {
  const ScratchFolder folder("gltf-compact");
  Context context;
  const std::string input = tube_file({.crate = true, .normals = true});
  Expected<GltfDocument> document = GltfDocument::parse(input, "tube.glb", {}, context);
  REQUIRE(document.has_value());
  REQUIRE(remesh_gltf(*document, asked(60), context).has_value());
  const Expected<std::string> written = document->glb();
  REQUIRE(written.has_value());
  CHECK(written->size() < input.size());
  // The box that was not remeshed, and the clip, read the same.
  const Expected<GltfDocument> before = GltfDocument::parse(input, "a.glb", {}, context),
                               after = GltfDocument::parse(*written, "b.glb", {}, context);
  REQUIRE((before.has_value() && after.has_value()));
  const auto vertices_of = [&](const GltfDocument& of) { return gltf_vertices(of, "POSITION", context); };
  const auto old_boxes = vertices_of(*before), new_boxes = vertices_of(*after);
  REQUIRE((old_boxes.has_value() && new_boxes.has_value()));
  CHECK(old_boxes->back().positions == new_boxes->back().positions);
  CHECK(old_boxes->back().triangles == new_boxes->back().triangles);
  const auto clips_of = [&](const GltfDocument& of) { return gltf_surfaces(of, {}, {}, context); };
  const auto old_clips = clips_of(*before), new_clips = clips_of(*after);
  REQUIRE((old_clips.has_value() && new_clips.has_value()));
  const Clip &a = (*old_clips)[0].asset.rig->clips[0], &b = (*new_clips)[0].asset.rig->clips[0];
  REQUIRE(a.poses.size() == b.poses.size());
  for (std::size_t k = 0; k < a.poses.size(); ++k)
    for (std::size_t j = 0; j < 2; ++j) CHECK(a.poses[k][j].matrix() == b.poses[k][j].matrix());

  // Places that an extension may know of stay where they are.
  std::string json = tube_file({.as_json = true});
  json.insert(json.find("\"extras\":{") + 10, "\"byteOffset\":0,");
  Expected<GltfDocument> known = GltfDocument::parse(json, "tube.gltf", {}, context);
  REQUIRE(known.has_value());
  REQUIRE(remesh_gltf(*known, asked(60), context).has_value());
  const auto views = [](const std::string& text) { return text.substr(text.find("\"bufferViews\":"), 60); };
  CHECK(views(known->json()) == views(json));
}

TEST_CASE("gltf: the poses of the clips can be what sizes are made for", "[gltf]") {
  GltfRemeshOptions options = asked(300);
  const Points<double> bends = remeshed({}, options).surfaces[0].result.mesh.positions;
  options.pose_source = GltfPoses::clips;
  const Points<double> clips = remeshed({}, options).surfaces[0].result.mesh.positions;
  CHECK((bends.rows() != clips.rows() || (bends - clips).norm() > 1e-6));
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
