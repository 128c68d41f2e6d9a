#include <cstring>
#include <filesystem>
#include <fstream>

#include "corpus/synthetic.hpp"
#include "gltf_tube.hpp"
#include "quadrig/c.h"
#include "quadrig/gltf.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

struct Destroy {
  void operator()(quadrig_job* p) const { quadrig_job_destroy(p); }
  void operator()(quadrig_asset* p) const { quadrig_asset_destroy(p); }
  void operator()(quadrig_quads* p) const { quadrig_quads_destroy(p); }
  void operator()(quadrig_bytes* p) const { quadrig_bytes_destroy(p); }
};
template <class T>
using Handle = std::unique_ptr<T, Destroy>;

quadrig_options options_for(std::uint32_t quads) {
  quadrig_options options;
  quadrig_options_init(&options, sizeof options);
  options.quads = quads;
  return options;
}

/// A tetrahedron without a rig, its corners as doubles.
quadrig_mesh tetrahedron() {
  static constexpr double positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  static constexpr std::uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  quadrig_mesh mesh;
  quadrig_mesh_init(&mesh, sizeof mesh);
  mesh.positions = positions;
  mesh.vertex_count = 4;
  mesh.triangles = triangles;
  mesh.triangle_count = 4;
  return mesh;
}

std::string message_of(const Handle<quadrig_job>& job) { return quadrig_job_message(job.get()); }

}  // namespace

TEST_CASE("c: arrays go in and the quads that C++ makes come out", "[c][fast]") {
  Context context;
  const Expected<Asset> sample = make_sample("pear", 2000, context);
  REQUIRE(sample.has_value());
  const TriangleMesh<double>& mesh = sample->mesh;
  std::vector<quadrig_bone> bones;
  for (const Bone& bone : sample->rig->skeleton.bones) {
    quadrig_bone& one = bones.emplace_back();
    Eigen::Map<Vector3>(one.head) = bone.head;
    Eigen::Map<Vector3>(one.tail) = bone.tail;
    one.parent = bone.parent;
  }
  std::vector<std::uint32_t> joints;
  std::vector<float> weights;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    for (std::uint32_t b = 0; b < bones.size(); ++b) {
      joints.push_back(b);
      weights.push_back(static_cast<float>(sample->rig->weights.coeff(v, static_cast<Index>(b))));
    }
  std::vector<std::uint32_t> triangles(mesh.faces().data(), mesh.faces().data() + mesh.faces().size());
  quadrig_mesh given;
  quadrig_mesh_init(&given, sizeof given);
  given.positions = mesh.positions().data();
  given.vertex_count = static_cast<std::size_t>(mesh.vertex_count());
  given.triangles = triangles.data();
  given.triangle_count = triangles.size() / 3;
  given.bones = bones.data();
  given.bone_count = bones.size();
  given.influences = bones.size();
  given.joints = joints.data();
  given.weights = weights.data();

  const Handle<quadrig_job> job(quadrig_job_create());
  quadrig_asset* made = nullptr;
  INFO(message_of(job));
  REQUIRE(quadrig_asset_create(job.get(), &given, &made) == quadrig_ok);
  const Handle<quadrig_asset> asset(made);
  CHECK(quadrig_asset_vertex_count(asset.get()) == given.vertex_count);
  const quadrig_options options = options_for(500);
  quadrig_quads* result = nullptr;
  REQUIRE(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_ok);
  const Handle<quadrig_quads> quads(result);

  // The same by C++, from the same weights as floats.
  Asset same = *sample;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    double sum = 0;
    for (std::size_t b = 0; b < bones.size(); ++b) sum += weights[static_cast<std::size_t>(v) * bones.size() + b];
    for (std::size_t b = 0; b < bones.size(); ++b)
      if (const double w = weights[static_cast<std::size_t>(v) * bones.size() + b]; w > 0)
        entries.emplace_back(v, static_cast<Index>(b), w / sum);
  }
  same.rig->weights.setFromTriplets(entries.begin(), entries.end());
  RemeshOptions wanted;
  wanted.quads = 500;
  const Expected<RemeshResult> expected = remesh(same, wanted, context);
  REQUIRE(expected.has_value());
  REQUIRE(quadrig_quads_count(quads.get()) == static_cast<std::size_t>(expected->mesh.quad_count()));
  const std::size_t n = quadrig_quads_vertex_count(quads.get());
  REQUIRE(n == static_cast<std::size_t>(expected->mesh.vertex_count()));
  Points<double> positions(static_cast<Eigen::Index>(n), 3);
  CHECK(quadrig_quads_positions(quads.get(), positions.data(), 3 * n) == quadrig_ok);
  CHECK((positions - expected->mesh.positions).cwiseAbs().maxCoeff() < 1e-9);
  std::vector<std::uint32_t> own_joints(n);
  std::vector<float> own_weights(n);
  CHECK(quadrig_quads_weights(quads.get(), 1, own_joints.data(), own_weights.data(), n - 1) == quadrig_too_small);
  CHECK(quadrig_quads_weights(quads.get(), 1, own_joints.data(), own_weights.data(), n) == quadrig_ok);
  for (std::size_t v = 0; v < n; ++v) {
    CHECK(own_weights[v] == 1.0F);
    const auto row = static_cast<Index>(v);
    CHECK(expected->weights->coeff(row, static_cast<Index>(own_joints[v])) >= 0.5 - 1e-6);
  }
}

TEST_CASE("c: edges that the caller names become edges of quads", "[c]") {
  // A box of 6 × 6 × 6 squares, one line around it.
  const test::Soup box = test::synthetic::cells({{0, 0, 0}}, 6);
  const Points<double> positions = box.positions();
  std::vector<std::uint32_t> triangles, edges;
  for (const auto& face : box.faces)
    for (std::size_t i = 0; i < 3; ++i) triangles.push_back(static_cast<std::uint32_t>(face[i]));
  const double height = positions(0, 2) + (positions.col(2).maxCoeff() - positions.col(2).minCoeff()) / 3;
  const auto on = [&](std::uint32_t v) { return std::abs(positions(static_cast<Index>(v), 2) - height) < 1e-9; };
  for (std::size_t h = 0; h < triangles.size(); ++h)
    if (const std::uint32_t a = triangles[h], b = triangles[h % 3 == 2 ? h - 2 : h + 1]; a < b && on(a) && on(b)) {
      edges.push_back(a);
      edges.push_back(b);
    }
  REQUIRE(edges.size() == 2 * 24);
  const Handle<quadrig_job> job(quadrig_job_create());
  quadrig_mesh given;
  quadrig_mesh_init(&given, sizeof given);
  given.positions = positions.data();
  given.vertex_count = static_cast<std::size_t>(positions.rows());
  given.triangles = triangles.data();
  given.triangle_count = triangles.size() / 3;
  quadrig_asset* made = nullptr;
  REQUIRE(quadrig_asset_create(job.get(), &given, &made) == quadrig_ok);
  const Handle<quadrig_asset> asset(made);
  quadrig_options options = options_for(400);
  options.edges = edges.data();
  options.edge_count = static_cast<std::uint32_t>(edges.size() / 2);
  quadrig_quads* result = nullptr;
  INFO(message_of(job));
  REQUIRE(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_ok);
  const Handle<quadrig_quads> quads(result);
  Points<double> corners(static_cast<Eigen::Index>(quadrig_quads_vertex_count(quads.get())), 3);
  REQUIRE(quadrig_quads_positions(quads.get(), corners.data(), static_cast<std::size_t>(corners.size())) == quadrig_ok);
  CHECK(((corners.col(2).array() - height).abs() < 1e-6).count() >= 20);

  quadrig_quads* none = nullptr;
  edges[0] = static_cast<std::uint32_t>(given.vertex_count);
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
  CHECK(message_of(job).find("edge 0") != std::string::npos);
  options.edges = nullptr;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
  options.edge_count = 0;
  options.keep = 8;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
}

TEST_CASE("c: what is wrong is a status and a message", "[c][fast]") {
  const Handle<quadrig_job> job(quadrig_job_create());
  quadrig_asset* asset = nullptr;
  quadrig_quads* quads = nullptr;
  CHECK(quadrig_asset_create(nullptr, nullptr, &asset) == quadrig_bad_option);
  CHECK(quadrig_asset_create(job.get(), nullptr, &asset) == quadrig_bad_option);
  CHECK(message_of(job) == "mesh: is null; give one");
  CHECK(quadrig_remesh(job.get(), nullptr, nullptr, &quads) == quadrig_bad_option);
  CHECK(quadrig_asset_load(job.get(), "nowhere.obj", nullptr, nullptr, &asset) == quadrig_bad_file);
  CHECK(message_of(job).find("nowhere.obj") != std::string::npos);
  CHECK(quadrig_quads_count(nullptr) == 0);
  CHECK(quadrig_quads_positions(nullptr, nullptr, 0) == quadrig_bad_option);
  quadrig_job_destroy(nullptr);
  CHECK(std::string(quadrig_status_name(quadrig_done_in_part)) == "done_in_part");

  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::uint32_t sides[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  quadrig_mesh mesh;
  quadrig_mesh_init(&mesh, sizeof mesh);
  mesh.positions_f = corners;
  mesh.vertex_count = 4;
  mesh.triangles = sides;
  mesh.triangle_count = 4;
  // A struct of a later version: members that are zero are fine, others are not known.
  struct Later {
    quadrig_mesh mesh;
    std::uint64_t more;
  } later{mesh, 0};
  later.mesh.size = sizeof later;
  REQUIRE(quadrig_asset_create(job.get(), &later.mesh, &asset) == quadrig_ok);
  quadrig_asset_destroy(asset);
  later.more = 1;
  CHECK(quadrig_asset_create(job.get(), &later.mesh, &asset) == quadrig_bad_option);
  // One of an earlier version: what it does not have keeps its default.
  quadrig_options earlier = options_for(100);
  earlier.size = offsetof(quadrig_options, crease_degrees);
  earlier.bend_degrees = -1;
  REQUIRE(quadrig_asset_create(job.get(), &mesh, &asset) == quadrig_ok);
  CHECK(quadrig_remesh(job.get(), asset, &earlier, &quads) == quadrig_ok);
  quadrig_quads_destroy(quads);
  earlier.size = sizeof earlier;
  CHECK(quadrig_remesh(job.get(), asset, &earlier, &quads) == quadrig_bad_option);
  CHECK(message_of(job).find("bend_degrees") != std::string::npos);
  CHECK(quads == nullptr);
  quadrig_asset_destroy(asset);

  sides[4] = 4;
  CHECK(quadrig_asset_create(job.get(), &mesh, &asset) == quadrig_bad_input);
  CHECK(message_of(job).find("triangle 1") != std::string::npos);
  sides[4] = 3;
  mesh.reserved = 1;
  CHECK(quadrig_asset_create(job.get(), &mesh, &asset) == quadrig_bad_option);
  mesh.reserved = 0;
  for (const std::size_t size : {std::size_t{0}, std::numeric_limits<std::size_t>::max(), std::size_t{1} << 40}) {
    mesh.size = size;
    CHECK(quadrig_asset_create(job.get(), &mesh, &asset) == quadrig_bad_option);
    quadrig_options options;
    quadrig_options_init(&options, size);
    mesh.size = sizeof mesh;
    REQUIRE(quadrig_asset_create(job.get(), &mesh, &asset) == quadrig_ok);
    if (size > 0) CHECK(quadrig_remesh(job.get(), asset, &options, &quads) == quadrig_bad_option);
    options = options_for(100);
    options.size = size;
    CHECK(quadrig_remesh(job.get(), asset, &options, &quads) == quadrig_bad_option);
    quadrig_asset_destroy(asset);
  }

  // Parents that lead back to where they came from.
  const std::uint32_t joints[] = {0, 1, 2, 0};
  const float weights[] = {1, 1, 1, 1};
  mesh.bone_count = 3;
  mesh.influences = 1;
  mesh.joints = joints;
  mesh.weights = weights;
  for (const auto& [parents, sound] : {std::pair{std::array{-1, 0, 1}, true}, std::pair{std::array{-1, 1, 1}, false},
                                       std::pair{std::array{2, 0, 1}, false}, std::pair{std::array{1, 0, 0}, false},
                                       std::pair{std::array{1, 2, -1}, true}}) {
    quadrig_bone bones[3] = {};
    for (std::size_t b = 0; b < 3; ++b) {
      bones[b].tail[b] = 1;
      bones[b].parent = parents[b];
    }
    mesh.bones = bones;
    CHECK(quadrig_asset_create(job.get(), &mesh, &asset) == (sound ? quadrig_ok : quadrig_bad_input));
    if (!sound) CHECK(message_of(job).find("bone") != std::string::npos);
    quadrig_asset_destroy(asset);
  }
}

TEST_CASE("c: a file is never written over what is read for it", "[c][gltf][fast]") {
  const ScratchFolder folder("c-over");
  const std::string input = (folder.path() / "tube.glb").string(), bytes = tube_file();
  std::ofstream(input, std::ios::binary) << bytes;
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_hard_link(input, folder / "sub/hard.glb");
  std::filesystem::create_symlink("../tube.glb", folder / "sub/link.glb");
  const Handle<quadrig_job> job(quadrig_job_create());
  const quadrig_options options = options_for(200);
  for (const char* output : {"tube.glb", "sub/../tube.glb", "sub/hard.glb", "sub/link.glb"}) {
    INFO(output);
    CHECK(quadrig_remesh_gltf_file(job.get(), input.c_str(), (folder / output).c_str(), &options) ==
          quadrig_bad_option);
    CHECK(message_of(job).find("tube.glb") != std::string::npos);
    std::ifstream stream(input, std::ios::binary);
    CHECK(std::string(std::istreambuf_iterator<char>(stream), {}) == bytes);
  }
}

TEST_CASE("c: a glTF file goes from memory to memory", "[c][gltf][fast]") {
  const Handle<quadrig_job> job(quadrig_job_create());
  for (const bool broken : {false, true}) {
    const std::string bytes = tube_file({.broken = broken});
    quadrig_options options = options_for(200);
    quadrig_bytes* made = nullptr;
    const quadrig_status status = quadrig_remesh_gltf(job.get(), bytes.data(), bytes.size(), nullptr, &options, &made);
    INFO(message_of(job));
    REQUIRE(status == (broken ? quadrig_done_in_part : quadrig_ok));
    bool told = false;
    for (std::size_t i = 0; i < quadrig_job_warning_count(job.get()); ++i)
      told = told || std::string(quadrig_job_warning(job.get(), i)).find("stays as it is") != std::string::npos;
    CHECK(told == broken);
    const Handle<quadrig_bytes> glb(made);
    Context context;
    const Expected<GltfDocument> again = GltfDocument::parse(
        std::string(static_cast<const char*>(quadrig_bytes_data(glb.get())), quadrig_bytes_size(glb.get())), "out.glb",
        {}, context);
    REQUIRE(again.has_value());
    CHECK(again->container() == GltfContainer::binary);
    const Expected<std::vector<GltfVertices>> vertices = gltf_vertices(*again, "JOINTS_0", context);
    REQUIRE(vertices.has_value());
    CHECK((*vertices)[0].triangles.rows() > 100);
    CHECK((*vertices)[0].values.rows() == (*vertices)[0].positions.rows());

    const char* names[] = {"nobody"};
    options.select = names;
    options.select_count = 1;
    CHECK(quadrig_remesh_gltf(job.get(), bytes.data(), bytes.size(), nullptr, &options, &made) == quadrig_bad_option);
    CHECK(message_of(job).find("nobody") != std::string::npos);
    CHECK(made == nullptr);
  }
  quadrig_bytes* made = nullptr;
  CHECK(quadrig_remesh_gltf(job.get(), "glTF", 4, nullptr, nullptr, &made) == quadrig_bad_input);
}

TEST_CASE("c: a job that is cancelled leaves no file behind", "[c][gltf][cancel][fast]") {
  const ScratchFolder folder("c-cancel");
  const std::string input = (folder.path() / "tube.glb").string(), output = (folder.path() / "quads.glb").string();
  {
    const std::string bytes = tube_file();
    std::ofstream(input, std::ios::binary) << bytes;
  }
  const Handle<quadrig_job> job(quadrig_job_create());
  struct Until {
    quadrig_job* job;
    int calls, last;
  } until{job.get(), 0, 0};
  quadrig_job_set_progress(
      job.get(),
      [](void* user, const char*, double) {
        auto* const own = static_cast<Until*>(user);
        if (++own->calls > own->last) quadrig_job_cancel(own->job);
      },
      &until);
  const quadrig_options options = options_for(200);
  const auto files = [&] {
    const std::filesystem::directory_iterator all(folder.path());
    return std::distance(begin(all), end(all));
  };
  int cancelled = 0;
  for (;; ++until.last) {
    until.calls = 0;
    quadrig_job_reset(job.get());
    const quadrig_status status = quadrig_remesh_gltf_file(job.get(), input.c_str(), output.c_str(), &options);
    if (until.calls <= until.last) {
      CHECK(status == quadrig_ok);
      break;
    }
    if (status == quadrig_ok) {  // cancelled by the last call, when all was done
      std::filesystem::remove(output);
      continue;
    }
    CHECK(status == quadrig_cancelled);
    CHECK(files() == 1);
    ++cancelled;
  }
  CHECK(cancelled > 1);
  CHECK(files() == 2);
}

TEST_CASE("c: a memory limit is kept by refusing, with the number", "[c][gltf][fast]") {
  const std::string file = tube_file();
  const Handle<quadrig_job> job(quadrig_job_create());
  const auto remeshed = [&](std::uint64_t limit, std::uint32_t quads) {
    quadrig_job_set_memory_limit(job.get(), limit);
    const quadrig_options options = options_for(quads);
    quadrig_bytes* bytes = nullptr;
    const quadrig_status status =
        quadrig_remesh_gltf(job.get(), file.data(), file.size(), "tube.glb", &options, &bytes);
    const Handle<quadrig_bytes> made(bytes);
    CHECK((made != nullptr) == (status == quadrig_ok));
    return status;
  };
  CHECK(remeshed(0, 200) == quadrig_ok);
  CHECK(remeshed(100'000'000, 200) == quadrig_ok);
  CHECK(remeshed(100'000'000, 100'000) == quadrig_out_of_memory);
  CHECK(message_of(job).find("limit of 100 MB; ask for fewer quads") != std::string::npos);
  CHECK(remeshed(20'000'000, 200) == quadrig_out_of_memory);
  CHECK(remeshed(4 * file.size() - 8, 200) == quadrig_out_of_memory);  // the file alone is too large

  const quadrig_mesh mesh = tetrahedron();
  const auto created = [&](std::uint64_t limit) {
    quadrig_job_set_memory_limit(job.get(), limit);
    quadrig_asset* asset = nullptr;
    const quadrig_status status = quadrig_asset_create(job.get(), &mesh, &asset);
    return std::pair{status, Handle<quadrig_asset>(asset)};
  };
  CHECK(created(1'000'000).first == quadrig_out_of_memory);
  const auto [status, asset] = created(10'000'000);
  REQUIRE(status == quadrig_ok);
  const quadrig_options options = options_for(50);
  quadrig_quads* quads = nullptr;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &quads) == quadrig_out_of_memory);
  CHECK(quads == nullptr);
  quadrig_job_set_memory_limit(job.get(), 200'000'000);
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &quads) == quadrig_ok);
  quadrig_quads_destroy(quads);

  const ScratchFolder folder("c-limit");
  {
    std::ofstream grid(folder / "grid.obj");
    for (int i = 0; i < 100 * 100; ++i) grid << "v " << i % 100 << ' ' << i / 100 << " 0\n";
    for (int i = 0; i + 101 < 100 * 100; ++i)
      if (i % 100 != 99) grid << "f " << i + 1 << ' ' << i + 2 << ' ' << i + 102 << ' ' << i + 101 << '\n';
  }
  const auto loaded = [&](std::uint64_t limit) {
    quadrig_job_set_memory_limit(job.get(), limit);
    quadrig_asset* read = nullptr;
    const quadrig_status result = quadrig_asset_load(job.get(), (folder / "grid.obj").c_str(), nullptr, nullptr, &read);
    quadrig_asset_destroy(read);
    return result;
  };
  CHECK(loaded(0) == quadrig_ok);
  CHECK(loaded(100'000'000) == quadrig_ok);
  CHECK(loaded(20'000'000) == quadrig_out_of_memory);  // 19602 triangles
}

TEST_CASE("c: sizes and directions of the caller's own reach the quads", "[c]") {
  constexpr std::uint32_t n = 20;
  std::vector<double> positions, density;
  std::vector<std::uint32_t> triangles, under;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) positions.insert(positions.end(), {1.0 * i, 1.0 * j, 0.01 * i * (n - i)});
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t v = i + j * (n + 1);
      triangles.insert(triangles.end(), {v, v + 1, v + n + 2, v, v + n + 2, v + n + 1});
      for (int k = 0; k < 2; ++k) {
        if (i > 7 && i < 12 && j > 7 && j < 12) under.push_back(static_cast<std::uint32_t>(density.size()));
        density.push_back(i < n / 2 ? 1 : 3);
      }
    }
  quadrig_mesh mesh;
  quadrig_mesh_init(&mesh, sizeof mesh);
  mesh.positions = positions.data();
  mesh.vertex_count = positions.size() / 3;
  mesh.triangles = triangles.data();
  mesh.triangle_count = triangles.size() / 3;
  const Handle<quadrig_job> job(quadrig_job_create());
  quadrig_asset* made = nullptr;
  REQUIRE(quadrig_asset_create(job.get(), &mesh, &made) == quadrig_ok);
  const Handle<quadrig_asset> asset(made);
  const auto positions_with = [&](const quadrig_options& options) {
    quadrig_quads* out = nullptr;
    REQUIRE(quadrig_remesh(job.get(), asset.get(), &options, &out) == quadrig_ok);
    std::vector<double> result(3 * quadrig_quads_vertex_count(out));
    REQUIRE(quadrig_quads_positions(out, result.data(), result.size()) == quadrig_ok);
    quadrig_quads_destroy(out);
    return result;
  };
  const auto share_right = [](const std::vector<double>& points) {
    double right = 0;
    for (std::size_t v = 0; v < points.size(); v += 3) right += points[v] > n / 2;
    return 3 * right / static_cast<double>(points.size());
  };
  quadrig_options options = options_for(400);
  const std::vector<double> plain = positions_with(options);
  options.fit = quadrig_fit_surface;
  CHECK(positions_with(options) == plain);
  options.fit = quadrig_fit_none;
  CHECK(positions_with(options) != plain);
  options.fit = quadrig_fit_subdivision + 1;
  quadrig_quads* none = nullptr;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
  CHECK(message_of(job).find("options.fit") != std::string::npos);
  options.fit = quadrig_fit_default;
  CHECK(share_right(plain) == quadrig::test::Approx(0.5).margin(0.05));
  options.density = density.data();
  options.density_count = density.size();
  CHECK(share_right(positions_with(options)) > 0.6);
  options.density_count = 7;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
  CHECK(message_of(job).find("options.density") != std::string::npos);

  options = options_for(400);
  std::vector<double> directions;
  for (std::size_t k = 0; k < under.size(); ++k) directions.insert(directions.end(), {1, 1, 0});
  options.direction_triangles = under.data();
  options.directions = directions.data();
  options.direction_count = under.size();
  CHECK(positions_with(options) != plain);
  under[0] = static_cast<std::uint32_t>(mesh.triangle_count);
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &none) == quadrig_bad_option);
  CHECK(message_of(job).find("options.direction_triangles") != std::string::npos);
}

TEST_CASE("c: what an option cannot do for an asset is told", "[c][gltf][fast]") {
  const Handle<quadrig_job> job(quadrig_job_create());
  const std::string file = tube_file();
  const std::uint32_t edge[] = {0, 1};
  quadrig_options options = options_for(200);
  options.edges = edge;
  options.edge_count = 1;
  quadrig_bytes* bytes = nullptr;
  CHECK(quadrig_remesh_gltf(job.get(), file.data(), file.size(), "tube.glb", &options, &bytes) == quadrig_bad_option);
  CHECK(message_of(job).find("options.edges") != std::string::npos);

  const std::uint32_t joints[] = {0, 0, 0, 0};
  const float weights[] = {1, 1, 0.3F, 1};
  quadrig_bone bone{};
  bone.tail[0] = 1;
  bone.parent = -1;
  quadrig_mesh mesh = tetrahedron();
  mesh.bones = &bone;
  mesh.bone_count = 1;
  mesh.joints = joints;
  mesh.weights = weights;
  mesh.influences = 1;
  for (const int strict : {0, 1}) {
    mesh.strict = strict;
    quadrig_asset* asset = nullptr;
    const quadrig_status status = quadrig_asset_create(job.get(), &mesh, &asset);
    const Handle<quadrig_asset> made(asset);
    CHECK(status == (strict ? quadrig_bad_input : quadrig_ok));
    if (strict) {
      CHECK(message_of(job).find("vertex 2: has weights that sum to 0.3") != std::string::npos);
      continue;
    }
    options = options_for(50);
    options.keep = quadrig_keep_materials;
    quadrig_quads* quads = nullptr;
    CHECK(quadrig_remesh(job.get(), asset, &options, &quads) == quadrig_ok);
    quadrig_quads_destroy(quads);
    REQUIRE(quadrig_job_warning_count(job.get()) > 0);
    CHECK(std::string(quadrig_job_warning(job.get(), 0)).find("options.keep") == 0);
  }
}
