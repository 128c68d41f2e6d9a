#include "quadrig/gltf.hpp"

#include "../src/gltf/tangents.hpp"
#include "gltf_tube.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;
using gltf::TangentGroups;

namespace {

/// A strip of two quads over [0, 2] × [0, 1], normals along z, as triangles a b c, a c d.
struct Strip {
  std::vector<Vector3> positions, normals;
  std::vector<Eigen::Vector2d> texture;
  std::vector<Index> corners{0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4};

  template <class Texture>
  explicit Strip(Texture&& of) {
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 3; ++x) {
        positions.emplace_back(x, y, 0);
        normals.push_back(Vector3::UnitZ());
        texture.push_back(of(positions.back()));
      }
  }
  [[nodiscard]] TangentGroups::Vertices vertices() const { return {positions, normals, texture}; }
};

}  // namespace

TEST_CASE("gltf tangents: along the texture, with the bitangent up in the image", "[gltf]") {
  for (const double u : {1.0, -1.0})
    for (const double v : {1.0, -1.0}) {
      const Strip strip([&](const Vector3& p) { return Eigen::Vector2d(u * p.x(), v * p.y()); });
      const TangentGroups groups(strip.vertices(), strip.corners, 2);
      const std::vector<Vector3> tangents = groups.directions(strip.vertices());
      for (std::size_t c = 0; c < strip.corners.size(); ++c) {
        const Vector3 tangent = tangents[static_cast<std::size_t>(groups.of_corner(c))];
        CHECK((tangent - u * Vector3::UnitX()).norm() < 1e-12);
        // The image's up is where the second coordinate falls.
        const Vector3 bitangent = groups.sign(groups.of_corner(c)) * Vector3::UnitZ().cross(tangent);
        CHECK((bitangent + v * Vector3::UnitY()).norm() < 1e-12);
      }
    }
}

TEST_CASE("gltf tangents: a mirrored texture parts the tangents of its vertices, not a quad", "[gltf]") {
  // Mirrored at x = 1: both quads are healthy, and vertices 1 and 4 have a tangent on each side.
  const Strip strip([](const Vector3& p) { return Eigen::Vector2d(std::abs(p.x() - 1), p.y()); });
  const TangentGroups groups(strip.vertices(), strip.corners, 2);
  const std::vector<Vector3> tangents = groups.directions(strip.vertices());
  for (std::size_t c = 0; c < strip.corners.size(); ++c) {
    const double side = c < 6 ? -1 : 1;
    CHECK((tangents[static_cast<std::size_t>(groups.of_corner(c))] - side * Vector3::UnitX()).norm() < 1e-12);
    CHECK(groups.sign(groups.of_corner(c)) == -side);
  }
  // A quad whose second triangle alone is mirrored is one in its tangents.
  Strip folded([](const Vector3& p) { return Eigen::Vector2d(p.x(), p.y()); });
  folded.texture[3] = {0.9, 0.2};
  const TangentGroups whole(folded.vertices(), folded.corners, 2);
  CHECK(whole.of_corner(0) == whole.of_corner(3));
  CHECK(whole.of_corner(2) == whole.of_corner(4));
  CHECK(whole.sign(whole.of_corner(5)) == whole.sign(whole.of_corner(0)));
}

TEST_CASE("gltf tangents: without area in the texture they are what neighbours have, else any", "[gltf]") {
  Strip strip([](const Vector3& p) { return Eigen::Vector2d(std::min(p.x(), 1.0), p.y()); });
  const TangentGroups groups(strip.vertices(), strip.corners, 2);
  CHECK(groups.of_corner(1) == groups.of_corner(6));  // vertex 1 in both quads
  strip.texture.assign(6, Eigen::Vector2d::Zero());
  const TangentGroups none(strip.vertices(), strip.corners, 2);
  for (const Vector3& tangent : none.directions(strip.vertices())) {
    CHECK(std::abs(tangent.norm() - 1) < 1e-12);
    CHECK(std::abs(tangent.z()) < 1e-12);
  }
}

TEST_CASE("gltf: tangents are made anew where a primitive has some", "[gltf]") {
  Context context;
  for (const bool tangents : {false, true}) {
    Expected<GltfDocument> document =
        GltfDocument::parse(tube_file({.morph_normals = true, .tangents = tangents}), "tube.glb", {}, context);
    REQUIRE(document.has_value());
    GltfRemeshOptions options;
    options.remesh.quads = 300;
    const auto done = remesh_gltf(*document, options, context);
    REQUIRE(done.has_value());
    REQUIRE((document->json().find("\"TANGENT\"") != std::string::npos) == tangents);
    if (!tangents) continue;
    const auto found = gltf_vertices(*document, "TANGENT", context),
               normals = gltf_vertices(*document, "NORMAL", context),
               moved = gltf_vertices(*document, "targets[0].TANGENT", context),
               turned = gltf_vertices(*document, "targets[0].NORMAL", context);
    REQUIRE((found.has_value() && normals.has_value() && moved.has_value() && turned.has_value()));
    REQUIRE(found->size() == 2);
    Index quads = 0, around = 0, side = 0;
    for (std::size_t p = 0; p < found->size(); ++p) {
      const GltfVertices& primitive = (*found)[p];
      double length = 0, skew = 0, moved_length = 0, moved_skew = 0, sign = 0;
      for (Index v = 0; v < primitive.positions.rows(); ++v) {
        const Vector3 tangent = primitive.values.row(v).head<3>().transpose(),
                      normal = (*normals)[p].values.row(v).transpose(),
                      changed = tangent + (*moved)[p].values.row(v).transpose(),
                      now = normal + (*turned)[p].values.row(v).transpose();
        length = std::max(length, std::abs(tangent.norm() - 1));
        skew = std::max(skew, std::abs(tangent.dot(normal)));
        moved_length = std::max(moved_length, std::abs(changed.norm() - 1));
        moved_skew = std::max(moved_skew, std::abs(changed.dot(now)));
        sign = std::max(sign, std::abs(std::abs(primitive.values(v, 3)) - 1));
        // The texture runs around the side, one way.
        if (std::abs(normal.y()) > 0.1) continue;
        ++side;
        const Vector3 along(-normal.z(), 0, normal.x());
        around += along.dot(tangent) > 0.9;
      }
      CHECK(length < 1e-6);
      CHECK(skew < 1e-6);
      CHECK(moved_length < 1e-6);
      CHECK(moved_skew < 1e-5);
      CHECK(sign == 0);
      for (Index t = 0; t + 1 < primitive.triangles.rows(); t += 2)
        quads += primitive.triangles(t, 0) == primitive.triangles(t + 1, 0) &&
                 primitive.triangles(t, 2) == primitive.triangles(t + 1, 1);
    }
    CHECK(quads == (*done)[0].result.mesh.quad_count());
    CHECK(side > 100);
    CHECK(around > 0.95 * side);
  }
}

TEST_CASE("gltf: what morph targets do to texture coordinates is carried", "[gltf]") {
  Context context;
  Expected<GltfDocument> document = GltfDocument::parse(tube_file({.coloured = true}), "tube.glb", {}, context);
  REQUIRE(document.has_value());
  GltfRemeshOptions options;
  options.remesh.quads = 300;
  REQUIRE(remesh_gltf(*document, options, context).has_value());
  const auto shifts = gltf_vertices(*document, "targets[0].TEXCOORD_0", context);
  REQUIRE(shifts.has_value());
  for (const GltfVertices& primitive : *shifts)
    for (Index v = 0; v < primitive.positions.rows(); ++v) {
      CHECK(std::abs(primitive.values(v, 0) - 0.25 * primitive.positions(v, 1)) < 0.04);  // a ring is 2/16 high
      CHECK(std::abs(primitive.values(v, 1) - 0.5) < 1e-6);
    }
}
