#include "picture/panel.hpp"

#include <fstream>

#include "quadrig/field.hpp"
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
  CHECK_FALSE(draw(std::span<const Panel>{}, PictureOptions{}).has_value());
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

TEST_CASE("picture: a panel's colours, close-up and dots stand where they project to", "[picture][fast]") {
  Panel panel;
  panel.mesh = square();
  panel.colours = std::vector<Colour>(4, Colour(0, 0.4, 0));
  panel.dots = {{Vector3(0.5, 0.5, 0), Colour(1, 0, 0), 3}};
  PictureOptions options = from_the_front();
  options.line_pixels = 0;
  const auto image = draw(std::span(&panel, 1), options);
  REQUIRE(image.has_value());
  // 0.92 of 60 pixels are 2 wide: (0.5, 0.5) lies 13.8 pixels right of and above the middle.
  const Pixel dot = image->at(43, 16), face = image->at(20, 40);
  CHECK(int{dot[0]} > 2 * int{dot[1]});
  CHECK(int{face[1]} > 2 * int{face[0]});
  panel.close_up = CloseUp{Vector3(0.5, 0.5, 0), 0.25};
  const auto close = draw(std::span(&panel, 1), options);
  REQUIRE(close.has_value());
  CHECK(int{close->at(30, 30)[0]} > 2 * int{close->at(30, 30)[1]});
}

TEST_CASE("picture: one frame shows all panels at one size, own frames fill each", "[picture][fast]") {
  std::array<Panel, 2> panels;
  panels[0].mesh = panels[1].mesh = square();
  panels[1].mesh.positions *= 0.25;
  PictureOptions options = from_the_front();
  options.line_pixels = 0.1;
  const auto one = draw(panels, options);
  options.one_frame = false;
  const auto own = draw(panels, options);
  REQUIRE(one.has_value());
  REQUIRE(own.has_value());
  CHECK(one->at(60 + 15, 30) == Pixel{255, 255, 255});
  CHECK(one->at(60 + 30, 30) != Pixel{255, 255, 255});
  CHECK(own->at(60 + 15, 30) != Pixel{255, 255, 255});
}

TEST_CASE("picture: a legend's bar runs from the colour of high to that of low", "[picture][fast]") {
  Panel panel;
  panel.mesh = square();
  panel.legend = {"", 0, 1, {}};
  PictureOptions options = from_the_front();
  options.cell_width = options.cell_height = 200;
  const auto image = draw(std::span(&panel, 1), options);
  REQUIRE(image.has_value());
  const Pixel high = image->at(186, 25), low = image->at(186, 134);
  const Colour top = scalar_colour(1), bottom = scalar_colour(0);
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(std::abs(int{high[k]} - int{encode(top[static_cast<Eigen::Index>(k)])}) <= 12);
    CHECK(std::abs(int{low[k]} - int{encode(bottom[static_cast<Eigen::Index>(k)])}) <= 12);
  }
}

TEST_CASE("picture: captions leave ink under their panel, on light and on dark paper", "[picture][fast]") {
  std::array<Panel, 2> panels;
  panels[0].mesh = panels[1].mesh = square();
  panels[0].caption = "\xcf\x89 1";
  for (const bool dark : {false, true}) {
    PictureOptions options = from_the_front();
    options.dark = dark;
    const auto image = draw(panels, options);
    REQUIRE(image.has_value());
    const Pixel paper = image->at(0, 0);
    CHECK((paper[0] < 60) == dark);
    const auto ink = [&](int left) {
      int count = 0;
      for (int y = 32; y < 60; ++y)
        for (int x = left; x < left + 60; ++x) count += std::abs(int{image->at(x, y)[1]} - int{paper[1]}) > 60;
      return count;
    };
    CHECK(ink(0) > 10);
    CHECK(ink(60) == 0);
  }
}

TEST_CASE("picture: lines of a grid lie where its coordinates are whole", "[picture][fast]") {
  Panel panel;
  panel.mesh = PolygonMesh::from_triangles(square().positions, (Triangles(2, 3) << 0, 1, 2, 0, 2, 3).finished());
  panel.grid = {{0.5, 0.5}, {2.5, 0.5}, {2.5, 2.5}, {0.5, 0.5}, {2.5, 2.5}, {0.5, 2.5}};
  panel.edges = false;
  panel.colours = std::vector<Colour>(2, Colour(0.5, 0.5, 0.5));
  const auto image = draw(std::span(&panel, 1), from_the_front());
  REQUIRE(image.has_value());
  // u = 1 lies a quarter of 55.2 pixels right of the left side, which is at 2.4.
  CHECK(image->at(16, 30)[0] < 80);
  CHECK(image->at(30, 30)[0] > 120);
  CHECK(image->at(43, 30)[0] < 80);
}

TEST_CASE("picture: lines along a straight field are straight and apart", "[picture][fast]") {
  constexpr Index n = 12;
  Points<double> points((n + 1) * (n + 1), 3);
  Triangles faces(2 * n * n, 3);
  for (Index y = 0; y <= n; ++y)
    for (Index x = 0; x <= n; ++x) points.row(y * (n + 1) + x) << x, y, 0;
  for (Index y = 0; y < n; ++y)
    for (Index x = 0; x < n; ++x) {
      const Index a = y * (n + 1) + x, b = a + n + 1;
      faces.row(2 * (y * n + x)) << a, a + 1, b + 1;
      faces.row(2 * (y * n + x) + 1) << a, b + 1, b;
    }
  const auto mesh = TriangleMesh<double>::create(points, faces);
  REQUIRE(mesh.has_value());
  const Connection<double> connection(*mesh);
  FrameField frames;
  for (Index f = 0; f < mesh->face_count(); ++f) {
    frames.u.push_back(connection.to_complex(f, Vector3::UnitX()));
    frames.v.push_back(connection.to_complex(f, Vector3::UnitY()));
  }
  const auto strokes = field_lines(*mesh, frames, 1.5, Colour::Zero(), 1);
  CHECK(strokes.size() > 40);
  for (const Stroke& stroke : strokes) {
    const Vector3 d = (stroke.to - stroke.from).cwiseAbs();
    CHECK(std::min(d.x(), d.y()) < 1e-9);
  }
}

TEST_CASE("picture: words before a mesh are of all, after it of that alone", "[picture][fast]") {
  const std::vector<std::string> words{"rig=a.tgf", "a.obj", "caption=one = 1", "b.obj", "./c=d.obj"};
  const auto panels = parse_panels(words);
  REQUIRE(panels.has_value());
  REQUIRE(panels->size() == 3);
  CHECK((*panels)[0].value("caption") == "one = 1");
  CHECK((*panels)[1].value("caption").empty());
  CHECK((*panels)[1].value("rig") == "a.tgf");
  CHECK((*panels)[2].mesh == "./c=d.obj");
  const std::vector<std::string> wrong{"a.obj", "color=bones"};
  const auto refused = parse_panels(wrong);
  REQUIRE_FALSE(refused.has_value());
  CHECK(refused.error().where.find("color") != std::string::npos);
}
