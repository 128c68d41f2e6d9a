#include "quadrig/density.hpp"

#include <fstream>

#include "quadrig/io.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using quadrig::detail::at;

/// Quads whose corners are moved by a bone more than by all others together.
Index quads_of_bone(const RemeshResult& result, Index bone) {
  Index count = 0;
  for (Index q = 0; q < result.mesh.quad_count(); ++q) {
    double share = 0;
    for (int i = 0; i < 4; ++i) share += result.weights->coeff(result.mesh.quads(q, i), bone) / 4;
    count += share > 0.5;
  }
  return count;
}

}  // namespace

TEST_CASE("density: patterns fit names, and near misses are told when none does", "[density][fast]") {
  CHECK(fits_name("head", "Head"));
  CHECK(fits_name("finger*", "finger1-2.L"));
  CHECK(fits_name("*.L", "finger1-2.L"));
  CHECK(fits_name("arm?", "arm1"));
  CHECK(!fits_name("arm?", "arm"));
  CHECK(!fits_name("head", "forehead"));
  CHECK(edit_distance("kitten", "sitting") == 3);
  const std::vector<std::string> names{"head", "hand.L", "hand.R", "spine"};
  const NamedFactor hands{"hand.*", 2}, left{"*.L", 3};
  const auto found = named_factors(std::vector{hands, left}, names, "bone");
  REQUIRE(found);
  CHECK(*found == std::vector<double>{1, 6, 2, 1});
  const auto missed = named_factors(std::vector{NamedFactor{"hed", 2}}, names, "bone");
  REQUIRE(!missed);
  CHECK(missed.error().message().find("head") != std::string::npos);
  CHECK(!named_factors(std::vector{NamedFactor{"head", 0}}, names, "bone"));
  CHECK(!named_factors(std::vector{NamedFactor{"head", 1000}}, names, "bone"));
}

TEST_CASE("density: grey leaves it as it is, red asks for more and cyan for less", "[density][fast]") {
  for (const double grey : {0.0, 0.5, 1.0}) CHECK(density_of_color(Vector3::Constant(grey)) == 1);
  CHECK(density_of_color({1, 0, 0}) == 4);
  CHECK(density_of_color({0, 1, 1}) == 0.25);
  CHECK(density_of_color({1, 0.5, 0.5}) == 2);
}

TEST_CASE("density: a bone gets more quads when it is given a factor, its twin too, and the count stays", "[density]") {
  Context context;
  const auto asset = make_sample("humanoid", 6000, context);
  REQUIRE(asset);
  RemeshOptions options;
  options.quads = 1500;
  const auto before = remesh(*asset, options, context);
  REQUIRE(before);
  const MirrorPlane& plane = *before->report.symmetry.plane;
  // The bone that moves most of one arm.
  Index arm = no_index;
  for (Index b = 0; b < static_cast<Index>(plane.twin.size()); ++b)
    if (plane.twin[at(b)] != b && (arm == no_index || quads_of_bone(*before, b) > quads_of_bone(*before, arm))) arm = b;
  const Index twin = plane.twin[at(arm)];
  options.bone_density.assign(plane.twin.size(), 1.0);
  options.bone_density[at(arm)] = 3;
  const auto after = remesh(*asset, options, context);
  REQUIRE(after);
  CHECK(std::abs(after->mesh.quad_count() - 1500) <= 75);
  CHECK(quads_of_bone(*after, arm) > 1.3 * quads_of_bone(*before, arm));
  CHECK(quads_of_bone(*after, arm) == quads_of_bone(*after, twin));
  CHECK(after->report.scaled_jacobian_minimum > 0.2);
}

TEST_CASE("density: factors that do not fit the asset are refused by name", "[density][fast]") {
  Context context;
  const auto asset = make_sample("pear", 1000, context);
  REQUIRE(asset);
  RemeshOptions options;
  options.density_factors = {1, 2};
  auto refused = remesh(*asset, options, context);
  REQUIRE(!refused);
  CHECK(refused.error().where == "density_factors");
  options.density_factors.assign(at(asset->mesh.face_count()), -1.0);
  CHECK(!remesh(*asset, options, context));
  options.density_factors.clear();
  options.bone_density = {1};
  refused = remesh(*asset, options, context);
  REQUIRE(!refused);
  CHECK(refused.error().where == "bone_density");
  options.bone_density = {1, 2};
  options.preset = FieldPreset::thesis;
  CHECK(!remesh(*asset, options, context));
}

TEST_CASE("density: colours and materials of surface files become factors of their faces", "[density][io][fast]") {
  const ScratchFolder folder("density");
  std::ofstream(folder / "a.obj") << "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 1 1 0 0 1 1\nv 2 1 0\n"
                                     "usemtl Skin A\nf 1 2 3\nusemtl cloth\nf 2 4 3\nf 2 5 4\n";
  std::ofstream(folder / "a.ply") << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                     "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
                                     "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                     "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n";
  Context context;
  LoadOptions options;
  options.density.colors = true;
  auto loaded = load_asset({folder / "a.ply", {}, {}}, options, context);
  REQUIRE(loaded);
  REQUIRE(loaded->density_factors.size() == 1);
  CHECK(loaded->density_factors[0] == Approx(4));
  options.density.materials = {{"skin*", 2}};
  loaded = load_asset({folder / "a.obj", {}, {}}, options, context);
  REQUIRE(loaded);
  REQUIRE(loaded->density_factors.size() == 3);
  CHECK(loaded->density_factors[0] == Approx(8));
  CHECK(loaded->density_factors[1] == Approx(std::cbrt(4)));
  CHECK(loaded->density_factors[2] == Approx(1));
  options.density.materials = {{"clth", 2}};
  loaded = load_asset({folder / "a.obj", {}, {}}, options, context);
  REQUIRE(!loaded);
  CHECK(loaded.error().message().find("cloth") != std::string::npos);
  CHECK(!load_asset({folder / "a.ply", {}, {}}, options, context));
}
