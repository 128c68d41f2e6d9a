// Pictures of polygon meshes, drawn in software: shaded faces, their edges, and the irregular vertices of quads. For
// the README, the documentation and a first look at a result; needs no graphics card and gives the same bytes
// everywhere.
#pragma once

#include <array>
#include <filesystem>
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

struct PictureOptions {
  int cell_width = 640, cell_height = 640;  ///< pixels of each mesh's part of the picture
  int columns = 0;                          ///< 0: all in one row
  double turn_degrees = 25;                 ///< of the eye around the upright axis, from the front (+z)
  double tilt_degrees = 12;                 ///< of the eye above the horizon
  char up = 'y';                            ///< 'y' or 'z'
  double line_pixels = 0;                   ///< width of the edges; 0: by the size of the faces
  bool irregular_vertices = true;           ///< dots on vertices of quad meshes with other than four edges

  /// \fails bad_option: names the field.
  [[nodiscard]] Status validate() const;
};

/// Draws each mesh into a cell of its own, fitted to it, seen from far away (no perspective). Faces seen from behind
/// are drawn red. Irregular vertices: blue below four edges, orange above. \cost O(pixels + faces), about 1 s a cell of
/// the default size.
[[nodiscard]] Expected<Image> draw(std::span<const PolygonMesh> meshes, const PictureOptions& options);

/// \fails bad_file when it cannot be written.
[[nodiscard]] Status write_png(const Image& image, const std::filesystem::path& file);

}  // namespace quadrig
