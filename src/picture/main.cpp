// quadrig-picture: meshes in, one PNG out.
#include <CLI/CLI.hpp>

#include <iostream>

#include "picture/panel.hpp"

int main(int argc, char** argv) {
  CLI::App app(
      "Draws meshes side by side into a PNG: shaded faces, edges, irregular vertices; weights, fields, maps and "
      "bones.");
  std::vector<std::string> inputs;
  std::string output;
  bool own_frames = false;
  quadrig::PictureOptions options;
  app.add_option("meshes", inputs,
                 "OBJ, OFF, PLY, STL or glTF files, each with settings NAME=VALUE after it; settings before the first "
                 "are of all")
      ->required();
  app.add_option("-o,--output", output, "PNG file to write")->required();
  app.add_option("--width", options.cell_width, "pixels of each mesh")->capture_default_str();
  app.add_option("--height", options.cell_height, "pixels of each mesh")->capture_default_str();
  app.add_option("--columns", options.columns, "meshes a row; 0: all in one")->capture_default_str();
  app.add_option("--turn", options.turn_degrees, "degrees of the eye around the upright axis")->capture_default_str();
  app.add_option("--tilt", options.tilt_degrees, "degrees of the eye above the horizon")->capture_default_str();
  app.add_option("--up", options.up, "upright axis: y or z")->capture_default_str();
  app.add_option("--line", options.line_pixels, "pixels of the edges; 0: by the size of the faces")
      ->capture_default_str();
  app.add_flag("--own-frames", own_frames, "Fit each mesh to its part, not all by one camera");
  app.add_flag("--dark", options.dark, "Dark paper");
  std::string footer = "Settings of a panel:\n";
  for (const auto& [name, meaning] : quadrig::panel_words())
    footer += "  " + std::string(name) + std::string(12 - name.size(), ' ') + std::string(meaning) + "\n";
  app.footer(footer + R"(
Examples:
  quadrig-picture arm.obj quads.obj -o picture.png
  quadrig-picture rig=arm.tgf weights=arm.dmat arm.obj colour=omega1 caption=one arm.obj colour=omega2 caption=two -o omegas.png
  quadrig-picture map.obj grid=checker caption="the map" quads.obj caption="its quads" --dark -o map.png
  quadrig-picture knight.glb clip=Walk time=0.5 bones=yes -o walk.png)");
  CLI11_PARSE(app, argc, argv);
  options.one_frame = !own_frames;

  const auto fail = [](const quadrig::Error& error) {
    std::cerr << "quadrig-picture: " << error.message() << "\n";
    return 1;
  };
  quadrig::Context context;
  const auto words = quadrig::parse_panels(inputs);
  if (!words) return fail(words.error());
  std::vector<quadrig::Panel> panels;
  for (const auto& panel_words : *words) {
    auto panel = quadrig::read_panel(panel_words, context);
    if (!panel) return fail(panel.error());
    panels.push_back(std::move(*panel));
  }
  const auto image = quadrig::draw(panels, options);
  if (!image) return fail(image.error());
  if (const auto status = quadrig::write_png(*image, output); !status) return fail(status.error());
  return 0;
}
