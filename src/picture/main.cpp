// quadrig-picture: meshes in, one PNG out.
#include <CLI/CLI.hpp>

#include <iostream>

#include "picture/picture.hpp"
#include "quadrig/io.hpp"

int main(int argc, char** argv) {
  CLI::App app("Draws meshes side by side into a PNG: shaded faces, edges, irregular vertices of quads.");
  std::vector<std::string> inputs;
  std::string output;
  quadrig::PictureOptions options;
  app.add_option("meshes", inputs, "OBJ, OFF or PLY files")->required();
  app.add_option("-o,--output", output, "PNG file to write")->required();
  app.add_option("--width", options.cell_width, "pixels of each mesh")->capture_default_str();
  app.add_option("--height", options.cell_height, "pixels of each mesh")->capture_default_str();
  app.add_option("--columns", options.columns, "meshes a row; 0: all in one")->capture_default_str();
  app.add_option("--turn", options.turn_degrees, "degrees of the eye around the upright axis")->capture_default_str();
  app.add_option("--tilt", options.tilt_degrees, "degrees of the eye above the horizon")->capture_default_str();
  app.add_option("--up", options.up, "upright axis: y or z")->capture_default_str();
  app.add_option("--line", options.line_pixels, "pixels of the edges; 0: by the size of the faces")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const auto fail = [](const quadrig::Error& error) {
    std::cerr << "quadrig-picture: " << error.message() << "\n";
    return 1;
  };
  quadrig::Context context;
  std::vector<quadrig::PolygonMesh> meshes;
  for (const auto& input : inputs) {
    auto mesh = quadrig::read_surface(input, {}, context);
    if (!mesh) return fail(mesh.error());
    meshes.push_back(std::move(*mesh));
  }
  const auto image = quadrig::draw(meshes, options);
  if (!image) return fail(image.error());
  if (const auto status = quadrig::write_png(*image, output); !status) return fail(status.error());
  return 0;
}
