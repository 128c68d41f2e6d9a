// Pictures of polygon meshes, drawn in software: shaded faces, their edges, and the irregular vertices of quads. For
// the README, the documentation and a first look at a result; needs no graphics card and gives the same bytes
// everywhere.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>

#include "quadrig/prepare.hpp"

namespace quadrig {

/// 8 bits each of red, green and blue, row by row from the top.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;

  [[nodiscard]] std::array<std::uint8_t, 3> at(int x, int y) const {
    const std::size_t i =
        3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
    return {rgb[i], rgb[i + 1], rgb[i + 2]};
  }
};

/// Red, green and blue of linear light, each in [0, 1].
using Colour = Eigen::Vector3d;

/// A straight piece, as wide as so many pixels.
struct Stroke {
  Vector3 from, to;
  Colour colour = Colour::Zero();
  double pixels = 1;
  bool on_top = false;  ///< seen through the surface too
};
struct Dot {
  Vector3 at;
  Colour colour = Colour::Zero();
  double pixels = 4;  ///< radius
};

/// What colours mean: a bar from low to high, or names.
struct Legend {
  std::string title;
  double low = 0, high = 0;  ///< of the bar, where high > low
  std::vector<std::pair<std::string, Colour>> names;
};

/// A sphere that fills the panel.
struct CloseUp {
  Vector3 centre = Vector3::Zero();
  double radius = 1;
};

/// One part of a picture.
struct Panel {
  PolygonMesh mesh;
  std::string caption;          ///< ASCII, and \u03c9 and \u00b0
  std::vector<Colour> colours;  ///< one a vertex, one a polygon, or none
  /// Texture coordinates, one a corner, or none: lines where a coordinate is whole.
  std::vector<std::array<double, 2>> grid;
  bool checker = false;  ///< squares of the grid in two shades
  std::vector<Stroke> strokes;
  std::vector<Dot> dots;
  Legend legend;
  std::optional<CloseUp> close_up;
  bool edges = true;
  bool irregular_vertices = true;  ///< dots, where the options have them too
};

struct PictureOptions {
  int cell_width = 640, cell_height = 640;  ///< pixels of each mesh's part of the picture
  int columns = 0;                          ///< 0: all in one row
  double turn_degrees = 25;                 ///< of the eye around the upright axis, from the front (+z)
  double tilt_degrees = 12;                 ///< of the eye above the horizon
  char up = 'y';                            ///< 'y' or 'z'
  double line_pixels = 0;                   ///< width of the edges; 0: by the size of the faces
  bool irregular_vertices = true;           ///< dots on vertices of quad meshes with other than four edges
  bool one_frame = true;  ///< all panels show the same part of space at the same size; else each its own
  bool dark = false;      ///< dark paper

  /// \fails bad_option: names the field.
  [[nodiscard]] Status validate() const;
};

/// Colours of scalars: dark blue over green to yellow for 0 to 1.
[[nodiscard]] Colour scalar_colour(double value);
/// Colours that neighbouring numbers do not share: hues a golden angle apart.
[[nodiscard]] Colour numbered_colour(Index number);

/// Blue where quads around a vertex are fewer than four (index4 above 0), else orange.
[[nodiscard]] Colour singular_colour(Index index4);

/// Draws the panels row by row, seen from far away (no perspective) by one eye. Faces seen from behind are drawn red.
/// Irregular vertices: blue below four edges, orange above. \cost O(pixels + faces), about 1 s a panel of the default
/// size.
[[nodiscard]] Expected<Image> draw(std::span<const Panel> panels, const PictureOptions& options);
[[nodiscard]] Expected<Image> draw(std::span<const PolygonMesh> meshes, const PictureOptions& options);

/// Writes text, its first letter's foot at (x, y) pixels, capitals `height` pixels high. Letters that are not known
/// show as '?'. \return where the next letter would stand
double write_text(Image& image, double x, double y, double height, std::string_view text, const Colour& colour);
/// Width of the text in pixels.
[[nodiscard]] double text_width(double height, std::string_view text);
/// The byte that shows linear light, and the light of a byte.
[[nodiscard]] std::uint8_t encode(double linear);
[[nodiscard]] double decode(std::uint8_t byte);

/// \fails bad_file when it cannot be written.
[[nodiscard]] Status write_png(const Image& image, const std::filesystem::path& file);

}  // namespace quadrig
