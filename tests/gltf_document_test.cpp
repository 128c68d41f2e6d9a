#include <fstream>
#include <sstream>

#include "gltf_tube.hpp"
#include "quadrig/gltf.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

std::string contents(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}
void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}
Status copied(const std::filesystem::path& from, const std::filesystem::path& to) {
  Context context;
  const Expected<GltfDocument> document = GltfDocument::read(from, {}, context);
  if (!document) return document.error();
  FileSet files;
  if (Status status = document->add_to(files, to, context); !status) return status;
  return files.commit();
}
Expected<std::vector<GltfSurface>> surfaces_of(const std::string& bytes, const GltfLimits& limits = {}) {
  Context context;
  const Expected<GltfDocument> document = GltfDocument::parse(bytes, "made.glb", limits, context);
  if (!document) return document.error();
  return gltf_surfaces(*document, {}, {}, context);
}

}  // namespace

TEST_CASE("gltf: a copy is the same bytes when it stays in its container", "[gltf]") {
  const ScratchFolder folder("gltf-copy");
  for (const bool as_json : {false, true}) {
    const std::string name = as_json ? "in.gltf" : "in.glb", copy = as_json ? "out.gltf" : "out.glb";
    std::string bytes = tube_file({.as_json = as_json});
    if (!as_json) {  // an unknown chunk behind
      bytes += std::string("\4\0\0\0ODD\0what", 12);
      const auto length = static_cast<std::uint32_t>(bytes.size());
      std::memcpy(bytes.data() + 8, &length, 4);
    }
    write(folder / name, bytes);
    REQUIRE(copied(folder / name, folder / copy).ok());
    CHECK(contents(folder / copy) == bytes);
  }
}

TEST_CASE("gltf: the surface is the same when the file goes to .gltf and back", "[gltf]") {
  const ScratchFolder folder("gltf-there");
  write(folder / "in.glb", tube_file());
  std::filesystem::create_directories(folder / "elsewhere");
  REQUIRE(copied(folder / "in.glb", folder / "a.gltf").ok());
  CHECK(std::filesystem::exists(folder / "a.bin"));
  REQUIRE(copied(folder / "a.gltf", folder / "elsewhere/b.gltf").ok());
  CHECK(contents(folder / "a.bin") == contents(folder / "elsewhere/a.bin"));
  REQUIRE(copied(folder / "elsewhere/b.gltf", folder / "c.glb").ok());
  Context context;
  std::vector<std::vector<GltfSurface>> read;
  for (const char* name : {"in.glb", "a.gltf", "elsewhere/b.gltf", "c.glb"}) {
    const Expected<GltfDocument> document = GltfDocument::read(folder / name, {}, context);
    REQUIRE(document.has_value());
    Expected<std::vector<GltfSurface>> surfaces = gltf_surfaces(*document, {}, {}, context);
    REQUIRE(surfaces.has_value());
    read.push_back(std::move(*surfaces));
  }
  for (const auto& surfaces : read) CHECK(surfaces[0].asset.mesh.positions() == read[0][0].asset.mesh.positions());
}

TEST_CASE("gltf: what is written beside a file has a name that nothing of its has", "[gltf]") {
  const ScratchFolder folder("gltf-beside");
  // Names that only differ in what a URI has to encode.
  for (const char* name : {"\xE9\xBE\x99 a.gltf", "\xE8\x99\x8E a.gltf", "___ a.gltf"}) {
    write(folder / "in.glb", tube_file({.rings = 10 + static_cast<int>(std::strlen(name))}));
    REQUIRE(copied(folder / "in.glb", folder / name).ok());
  }
  for (const char* name : {"\xE9\xBE\x99 a.gltf", "\xE8\x99\x8E a.gltf", "___ a.gltf"}) {
    Context context;
    const auto document = GltfDocument::read(folder / name, {}, context);
    REQUIRE(document);
    CHECK(gltf_surfaces(*document, {}, {}, context).has_value());
  }

  // A buffer is known by its file, not by how the file spells its name.
  REQUIRE(copied(folder / "in.glb", folder / "scene.gltf").ok());
  const std::string named = "\"scene.bin\"", spelled = "\"./sc%65ne.bin\"";
  std::string json = contents(folder / "scene.gltf");
  const auto place = json.find(named);
  REQUIRE(place != std::string::npos);
  write(folder / "orig.gltf", json.replace(place, named.size(), spelled));
  std::filesystem::remove(folder / "scene.gltf");
  const std::string before = contents(folder / "scene.bin");
  Context context;
  auto document = GltfDocument::read(folder / "orig.gltf", {}, context);
  REQUIRE(document);
  GltfRemeshOptions options;
  options.remesh.quads = 200;
  REQUIRE(remesh_gltf(*document, options, context));
  FileSet files;
  REQUIRE(document->add_to(files, folder / "scene.gltf", context).ok());
  REQUIRE(files.commit().ok());
  CHECK(contents(folder / "scene.bin") == before);
  for (const char* name : {"orig.gltf", "scene.gltf"}) {
    const auto again = GltfDocument::read(folder / name, {}, context);
    REQUIRE(again);
    CHECK(gltf_surfaces(*again, {}, {}, context).has_value());
  }
}

TEST_CASE("gltf: every corpus file is copied without a difference", "[gltf][slow]") {
  const auto root = corpus("");
  if (!root) return;
  const ScratchFolder folder("gltf-corpus");
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*root)) {
    const auto extension = entry.path().extension();
    if (extension != ".glb" && extension != ".gltf") continue;
    ++count;
    const std::filesystem::path copy = folder / ("copy" + std::to_string(count) + extension.string());
    INFO(entry.path());
    REQUIRE(copied(entry.path(), copy).ok());
    CHECK(contents(copy) == contents(entry.path()));
  }
  CHECK(count > 0);
}

TEST_CASE("gltf: seams are welded, bones run along the joints, and the clip bends", "[gltf]") {
  const Expected<std::vector<GltfSurface>> surfaces = surfaces_of(tube_file());
  REQUIRE(surfaces.has_value());
  REQUIRE(surfaces->size() == 1);
  const GltfSurface& surface = surfaces->front();
  const TriangleMesh<double>& mesh = surface.asset.mesh;
  CHECK(mesh.closed());
  CHECK(mesh.vertex_count() == 12 * 17 + 2);
  CHECK(*std::max_element(surface.source_primitive.begin(), surface.source_primitive.end()) == 1);
  const Rig& rig = *surface.asset.rig;
  REQUIRE(rig.skeleton.bone_count() == 2);
  CHECK((rig.skeleton.bones[0].tail - Vector3(0, 1, 0)).norm() < 1e-12);
  CHECK(rig.skeleton.bones[1].parent == 0);
  CHECK(rig.skeleton.bones[1].has_direction);
  CHECK(std::abs(rig.skeleton.bones[1].direction().y()) > 0.99);
  REQUIRE(rig.clips.size() == 1);
  CHECK(rig.clips[0].name == "bow");
  CHECK(std::abs(rig.clips[0].times_seconds.back() - 1) < 1e-9);
  CHECK(rig.clips[0].poses.front()[1].matrix().isApprox(Eigen::Matrix4d::Identity(), 1e-6));
  // Half-way, the upper joint has turned by 0.7 about z through (0, 1, 0), whatever the frames.
  const std::size_t half = rig.clips[0].poses.size() / 2;
  REQUIRE(std::abs(rig.clips[0].times_seconds[half] - 0.5) < 1e-9);
  CHECK((rig.clips[0].poses[half][1] * Vector3(0, 2, 0) - Vector3(-std::sin(0.7), 1 + std::cos(0.7), 0)).norm() < 1e-5);
}

TEST_CASE("gltf: vertices without weights follow their neighbours, and are counted", "[gltf]") {
  const Expected<std::vector<GltfSurface>> surfaces = surfaces_of(tube_file({.nan_weights = true}));
  REQUIRE(surfaces.has_value());
  CHECK(surfaces->front().repairs.unweighted == 3);
  CHECK(surfaces->front().repairs.bad_weights == 6);
  const SkinWeights& weights = surfaces->front().asset.rig->weights;
  for (Index v = 0; v < weights.rows(); ++v) CHECK(std::abs(weights.row(v).sum() - 1) < 1e-9);
}

TEST_CASE("gltf: a fault is an error that names its place", "[gltf]") {
  const auto message = [](const std::string& bytes, const GltfLimits& limits = {}) {
    const Expected<std::vector<GltfSurface>> surfaces = surfaces_of(bytes, limits);
    return surfaces ? std::string("no error") : surfaces.error().message();
  };
  const auto with = [](std::string text, const std::string& from, const std::string& to) {
    const auto place = text.find(from);
    REQUIRE(place != std::string::npos);
    return text.replace(place, from.size(), to);
  };
  const auto says = [](const std::string& text, const std::string& part) {
    UNSCOPED_INFO(text);
    return text.find(part) != std::string::npos;
  };
  const std::string json = tube_file({.as_json = true});
  CHECK(says(message(tube_file({.cycle = true})), "cycle"));
  CHECK(says(message(tube_file().substr(0, 200)), "cut short"));
  CHECK(says(message(tube_file().replace(8, 4, std::string("\x0c\0\0\0", 4))), "cut short"));
  CHECK(says(message(json.substr(0, 200)), "not JSON"));
  CHECK(says(message(with(json, "\"count\":", "\"count\":9")), "accessors[0]"));
  CHECK(says(message(with(json, "\"byteOffset\":0", "\"byteOffset\":99999999")), "bufferViews[0]"));
  CHECK(says(message(with(json, "\"byteOffset\":0", "\"byteOffset\":-1")), "byteOffset"));
  CHECK(says(message(with(json, "\"joints\":[1,2]", "\"joints\":[1,9]")), "skins[0].joints"));
  CHECK(says(message(with(json, "\"joints\":[1,2]", "\"joints\":[1,1]")), "twice"));
  CHECK(says(message(with(json, "data:application/octet-stream;base64,", "../secret.bin\",\"x\":\"")),
             "leaves the folder"));
  CHECK(says(message(with(json, "data:application/octet-stream;base64,", "http://a.b/c.bin\",\"x\":\"")), "elsewhere"));
  CHECK(says(message(with(json, "{\"buffer\":0,", "{\"extensions\":{\"EXT_meshopt_compression\":{}},\"buffer\":0,")),
             "EXT_meshopt_compression"));
  CHECK(
      says(message(with(json, "{\"attributes\"", "{\"extensions\":{\"KHR_draco_mesh_compression\":{}},\"attributes\"")),
           "KHR_draco_mesh_compression"));
  CHECK(says(message(json, {.json_bytes = 100}), "limit"));
  CHECK(says(message(json, {.values = 100}), "limit"));
  CHECK(says(message(json, {.frames = 3}), "limit"));
  CHECK(says(message("{\"asset\":{\"version\":\"2.0\"},\"x\":" + std::string(100000, '[') + "}"), "deep"));
  CHECK(says(message("{\"asset\":{\"version\":\"1.0\"}}"), "1.0"));
  CHECK(says(message("{\"asset\":{\"version\":\"2.0\"}}"), "no triangles"));
}

TEST_CASE("gltf: what a file asks for is held against its bytes", "[gltf]") {
  const auto file = [](const std::string& primitives, const std::string& accessors) {
    return "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[" + primitives +
           "]}],\"accessors\":[" + accessors + "]}";
  };
  const auto refused = [](const std::string& bytes) {
    const auto surfaces = surfaces_of(bytes);
    REQUIRE_FALSE(surfaces.has_value());
    UNSCOPED_INFO(surfaces.error().message());
    return surfaces.error().code == ErrorCode::bad_input &&
           surfaces.error().what.find("asks for more than") != std::string::npos;
  };
  const std::string few = "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":3}";
  // No bytes are behind these, so nothing but the sum of the counts tells.
  CHECK(refused(
      file("{\"attributes\":{\"POSITION\":0}}", "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":60000000}")));
  CHECK(refused(file("{\"attributes\":{\"POSITION\":0},\"indices\":1}",
                     few + ",{\"type\":\"SCALAR\",\"componentType\":5125,\"count\":60000000}")));
  std::string primitives;
  for (int k = 0; k < 1000; ++k) primitives += std::string(k > 0 ? "," : "") + "{\"attributes\":{\"POSITION\":0}}";
  CHECK(refused(file(primitives, "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":300000}")));
  std::string targets;
  for (int k = 0; k < 10000; ++k) targets += std::string(k > 0 ? "," : "") + "{\"POSITION\":0,\"NORMAL\":0}";
  CHECK(refused(file("{\"attributes\":{\"POSITION\":0},\"targets\":[" + targets + "]}",
                     "{\"type\":\"VEC3\",\"componentType\":5126,\"count\":3000}")));
}

TEST_CASE("gltf: the dragon is one dragon however its numbers are stored", "[gltf]") {
  const auto root = corpus("quirks");
  if (!root) return;
  Context context;
  std::optional<GltfSurface> first;
  for (const char* name : {"dragon_interleaved.glb", "dragon_quant.glb", "dragon_sparse.glb", "dragon_w16.glb",
                           "dragon_w8.glb", "dragon_draco.glb", "dragon_meshopt.glb"}) {
    INFO(name);
    const Expected<GltfDocument> document = GltfDocument::read(*root / name, {}, context);
    REQUIRE(document.has_value());
    Expected<std::vector<GltfSurface>> surfaces = gltf_surfaces(*document, {}, {}, context);
    const bool compressed =
        std::string(name).find("draco") != std::string::npos || std::string(name) == "dragon_meshopt.glb";
    if (compressed && !surfaces && surfaces.error().code == ErrorCode::unsupported) {
      CHECK(surfaces.error().what.find("compression") != std::string::npos);  // a build without the decoder says so
      continue;
    }
    REQUIRE(surfaces.has_value());
    if (!first) {
      first = std::move(surfaces->front());
      continue;
    }
    const Asset &a = first->asset, &b = surfaces->front().asset;
    CHECK(std::abs(b.mesh.face_count() - a.mesh.face_count()) <= a.mesh.face_count() / 100);
    CHECK(b.rig->clips.size() == a.rig->clips.size());
    CHECK(b.rig->skeleton.bone_count() == a.rig->skeleton.bone_count());
    // In the scene, joints are where they were: mesh space itself may be scaled by quantization.
    const auto extent = [](const Asset& asset, double scale) { return asset.mesh.diagonal() * scale; };
    const double ratio = extent(b, surfaces->front().world_scale) / extent(a, first->world_scale);
    CHECK(std::abs(ratio - 1) < 0.01);
  }
}
