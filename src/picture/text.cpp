// Captions: letters of strokes, drawn at any size by their distance from each pixel.
#include <algorithm>
#include <cmath>

#include "picture/letters.hpp"
#include "picture/picture.hpp"
#include "picture/segment.hpp"

namespace quadrig {

namespace {

constexpr double capital_units = 21;  // of the letters' own units
constexpr double foot_units = 9;      // below their middle

/// Number of the next letter in stroke_letters, of UTF-8 text, which it shortens.
std::size_t take_letter(std::string_view& text) {
  const auto first = static_cast<unsigned char>(text.front());
  std::size_t bytes = 1;
  while (bytes < text.size() && (static_cast<unsigned char>(text[bytes]) & 0xc0) == 0x80) ++bytes;
  const std::string_view whole = text.substr(0, bytes);
  text.remove_prefix(bytes);
  if (whole == "\xcf\x89") return 95;
  if (whole == "\xc2\xb0") return 96;
  return bytes == 1 && first >= 32 && first < 127 ? first - std::size_t{32} : std::size_t{'?' - 32};
}

double advance(std::size_t letter) {
  const std::string_view data = stroke_letters[letter];
  return data[1] - data[0];
}

}  // namespace

std::uint8_t encode(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  const double s = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

double decode(std::uint8_t byte) {
  const double s = byte / 255.0;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

double text_width(double height, std::string_view text) {
  double width = 0;
  while (!text.empty()) width += advance(take_letter(text)) * height / capital_units;
  return width;
}

double write_text(Image& image, double x, double y, double height, std::string_view text, const Colour& colour) {
  const double unit = height / capital_units, half_width = std::max(0.55, 0.055 * height);
  while (!text.empty()) {
    const std::size_t letter = take_letter(text);
    const std::string_view data = stroke_letters[letter];
    std::vector<std::array<Eigen::Vector2d, 2>> pieces;
    std::optional<Eigen::Vector2d> pen;
    for (std::size_t i = 2; i + 1 < data.size(); i += 2) {
      if (data[i] == ' ') {
        pen.reset();
        continue;
      }
      const Eigen::Vector2d point(x + unit * (data[i] - data[0]), y + unit * (data[i + 1] - 'R' - foot_units));
      if (pen) pieces.push_back({*pen, point});
      pen = point;
    }
    const int x0 = std::max(0, static_cast<int>(x - height)),
              x1 = std::min(image.width - 1, static_cast<int>(x + 2 * height));
    const int y0 = std::max(0, static_cast<int>(y - 2 * height)),
              y1 = std::min(image.height - 1, static_cast<int>(y + height));
    for (int row = y0; row <= y1; ++row)
      for (int column = x0; column <= x1; ++column) {
        double nearest = 1e9;
        for (const auto& [a, b] : pieces)
          nearest = std::min(nearest, distance_to_segment(Eigen::Vector2d(column + 0.5, row + 0.5), a, b));
        const double cover = std::clamp(half_width + 0.5 - nearest, 0.0, 1.0);
        if (cover == 0) continue;
        for (std::size_t k = 0; k < 3; ++k) {
          std::uint8_t& byte = image.rgb[3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
                                              static_cast<std::size_t>(column)) +
                                         k];
          byte = encode((1 - cover) * decode(byte) + cover * colour[static_cast<Eigen::Index>(k)]);
        }
      }
    x += advance(letter) * unit;
  }
  return x;
}

}  // namespace quadrig
