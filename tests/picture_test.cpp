#include "picture/picture.hpp"

#include <fstream>

#include "test.hpp"

using namespace quadrig;

namespace {

/// A square in the plane z = 0 that looks along +z, corners at (±1, ±1).
PolygonMesh square(bool turned = false) {
  PolygonMesh mesh;
  mesh.positions.resize(4, 3);
  mesh.positions << -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0;
  mesh.corners = turned ? std::vector<Index>{3, 2, 1, 0} : std::vector<Index>{0, 1, 2, 3};
  mesh.first_corner = {0, 4};
  return mesh;
}

PictureOptions from_the_front() {
  PictureOptions options;
  options.cell_width = options.cell_height = 60;
  options.turn_degrees = options.tilt_degrees = 0;
  options.line_pixels = 6;
  return options;
}

using Pixel = std::array<std::uint8_t, 3>;

}  // namespace

TEST_CASE("picture: a face shows its colour, its edge and nothing beside it", "[picture][fast]") {
  const std::vector<PolygonMesh> meshes{square()};
  const auto image = draw(meshes, from_the_front());
  REQUIRE(image.has_value());
  REQUIRE(image->width == 60);
  REQUIRE(image->height == 60);
  const Pixel middle = image->at(30, 30), outside = image->at(0, 0), edge = image->at(3, 30);
  CHECK(outside == Pixel{255, 255, 255});
  CHECK(middle[2] > middle[0]);  // quads are blue
  CHECK(int{edge[1]} < int{middle[1]} - 60);
}

TEST_CASE("picture: a face seen from behind is red", "[picture][fast]") {
  const std::vector<PolygonMesh> meshes{square(true)};
  const auto image = draw(meshes, from_the_front());
  REQUIRE(image.has_value());
  CHECK(int{image->at(30, 30)[0]} > 2 * int{image->at(30, 30)[2]});
}

TEST_CASE("picture: the nearer of two faces hides the other in either order", "[picture][fast]") {
  for (const bool near_first : {true, false}) {
    PolygonMesh mesh = square();
    const double z = near_first ? -1 : 1;
    mesh.positions.conservativeResize(8, 3);
    mesh.positions.bottomRows(4) << -1, -1, z, 1, -1, z, 1, 1, z, -1, 1, z;
    // Of the two faces, the one at the front looks at the eye and the other away.
    mesh.corners = near_first ? std::vector<Index>{0, 1, 2, 3, 7, 6, 5, 4} : std::vector<Index>{3, 2, 1, 0, 4, 5, 6, 7};
    mesh.first_corner = {0, 4, 8};
    const std::vector<PolygonMesh> meshes{mesh};
    const auto image = draw(meshes, from_the_front());
    REQUIRE(image.has_value());
    CHECK(image->at(30, 30)[2] > image->at(30, 30)[0]);
  }
}

TEST_CASE("picture: several meshes fill their own cells row by row", "[picture][fast]") {
  const std::vector<PolygonMesh> meshes{square(), square(true), square()};
  PictureOptions options = from_the_front();
  options.columns = 2;
  const auto image = draw(meshes, options);
  REQUIRE(image.has_value());
  CHECK(image->width == 120);
  CHECK(image->height == 120);
  CHECK(image->at(30, 30) == image->at(30, 90));
  CHECK(image->at(90, 30)[0] > image->at(90, 30)[2]);
  CHECK(image->at(90, 90) == Pixel{255, 255, 255});
}

TEST_CASE("picture: options out of range are errors that name the field", "[picture][fast]") {
  const std::vector<PolygonMesh> meshes{square()};
  PictureOptions options;
  options.cell_width = 0;
  const auto image = draw(meshes, options);
  REQUIRE_FALSE(image.has_value());
  CHECK(image.error().what.find("cell_width") != std::string::npos);
  CHECK_FALSE(draw({}, PictureOptions{}).has_value());
}

TEST_CASE("picture: a PNG is written whole or refused", "[picture][fast]") {
  const quadrig::test::ScratchFolder folder("picture");
  const std::vector<PolygonMesh> meshes{square()};
  const auto image = draw(meshes, from_the_front());
  REQUIRE(image.has_value());
  REQUIRE(write_png(*image, folder / "a.png").ok());
  std::ifstream file(folder / "a.png", std::ios::binary);
  std::string start(8, ' ');
  file.read(start.data(), 8);
  CHECK(start == "\x89PNG\r\n\x1a\n");
  CHECK_FALSE(write_png(*image, folder / "nowhere" / "a.png").ok());
}
