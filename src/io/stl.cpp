// Stereolithography, as text and as bytes: triangles that name no vertices. Corners at one position become one vertex.
#include <algorithm>
#include <bit>

#include "scan.hpp"

namespace quadrig {
namespace {

using io::at_line;
using io::shown;

constexpr std::size_t head_bytes = 80, count_bytes = 4, triangle_bytes = 50;

std::uint32_t little_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (std::size_t k = 4; k-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[k]);
  return value;
}

/// Triangles of three corners each, a row of coordinates a corner.
Expected<PolygonMesh> welded(const std::filesystem::path& path, std::vector<std::array<double, 3>> corners,
                             const FileLimits& limits, const Context& context) {
  if (corners.empty()) return io::in_file(path, "has no triangles", "give a surface");
  std::vector<Index> order(corners.size()), vertex(corners.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<Index>(k);
  const auto of = [&](Index k) -> const std::array<double, 3>& { return corners[static_cast<std::size_t>(k)]; };
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return of(a) != of(b) ? of(a) < of(b) : a < b; });
  if (context.cancelled()) return cancelled_error("read");
  // Vertices are numbered as the file names them first.
  std::vector<Index> first(corners.size());
  for (std::size_t k = 0; k < order.size(); ++k)
    first[static_cast<std::size_t>(order[k])] =
        k > 0 && of(order[k - 1]) == of(order[k]) ? first[static_cast<std::size_t>(order[k - 1])] : order[k];
  Index count = 0;
  for (std::size_t k = 0; k < corners.size(); ++k)
    vertex[k] = first[k] == static_cast<Index>(k) ? count++ : vertex[static_cast<std::size_t>(first[k])];
  if (count > limits.vertices) return io::in_file(path, "has more vertices than allowed", "raise the limit");
  PolygonMesh mesh;
  mesh.positions.resize(count, 3);
  for (std::size_t k = 0; k < corners.size(); ++k)
    for (int i = 0; i < 3; ++i) mesh.positions(vertex[k], i) = corners[k][static_cast<std::size_t>(i)];
  mesh.first_corner.reserve(corners.size() / 3 + 1);
  mesh.first_corner.push_back(0);
  for (std::size_t k = 0; k < corners.size(); k += 3) {
    const std::array<Index, 3> triangle{vertex[k], vertex[k + 1], vertex[k + 2]};
    mesh.add_polygon(triangle);
  }
  return mesh;
}

Expected<PolygonMesh> read_binary(const std::filesystem::path& path, std::string_view bytes, const FileLimits& limits,
                                  const Context& context) {
  if (bytes.size() < head_bytes + count_bytes)
    return io::in_file(path, "ends within its head of 84 bytes", "check that the file is complete");
  const std::size_t count = little_endian(bytes.substr(head_bytes));
  bytes.remove_prefix(head_bytes + count_bytes);
  if (count > bytes.size() / triangle_bytes || count > static_cast<std::size_t>(limits.polygons))
    return io::in_file(path, std::to_string(count) + " triangles are announced, more than the file can hold",
                       "check that the file is complete");
  std::vector<std::array<double, 3>> corners;
  corners.reserve(3 * count);
  for (std::size_t f = 0; f < count; ++f) {
    if (f % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    constexpr std::size_t normal_bytes = 12;
    std::string_view triangle = bytes.substr(f * triangle_bytes + normal_bytes);
    for (int k = 0; k < 3; ++k) {
      std::array<double, 3>& corner = corners.emplace_back();
      for (double& coordinate : corner) {
        coordinate = static_cast<double>(std::bit_cast<float>(little_endian(triangle))) + 0.0;  // −0 is 0
        triangle.remove_prefix(4);
        if (!std::isfinite(coordinate))
          return io::in_file(path, "triangle " + std::to_string(f) + " has a coordinate that is not finite",
                             "check that the file is complete");
      }
    }
  }
  return welded(path, std::move(corners), limits, context);
}

Expected<PolygonMesh> read_ascii(const std::filesystem::path& path, std::string_view text, const FileLimits& limits,
                                 const Context& context) {
  io::Cursor cursor(text);
  std::vector<std::array<double, 3>> corners;
  std::size_t in_loop = 0;
  do {
    std::string_view keyword = cursor.word();
    if (keyword == "outer") in_loop = 0;
    if (keyword == "endloop" && in_loop != 3)
      return at_line(path, cursor.line(), "a loop of " + std::to_string(in_loop) + " vertices", "give it three");
    if (keyword != "vertex") continue;  // normals, and names of solids, are passed over
    if (corners.size() % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    if (++in_loop > 3) return at_line(path, cursor.line(), "a loop of four vertices", "give it three");
    std::array<double, 3>& corner = corners.emplace_back();
    for (double& coordinate : corner) {
      const std::string_view word = cursor.word();
      if (!io::to_number(word, coordinate) || !std::isfinite(coordinate))
        return at_line(path, cursor.line(), shown(word) + " is not a finite number", "give x, y and z as numbers");
      coordinate += 0.0;
    }
    if (corners.size() / 3 > static_cast<std::size_t>(limits.polygons))
      return at_line(path, cursor.line(), "too many triangles", "use a smaller mesh");
  } while (cursor.next_line());
  if (corners.size() % 3 != 0)
    return at_line(path, cursor.line(), "the text ends within a triangle", "check that it is complete");
  return welded(path, std::move(corners), limits, context);
}

/// Some binary files begin with "solid" too, so their size decides first, then whether facets follow.
bool is_text(std::string_view bytes) {
  if (bytes.size() >= head_bytes + count_bytes &&
      bytes.size() == head_bytes + count_bytes + triangle_bytes * std::size_t{little_endian(bytes.substr(head_bytes))})
    return false;
  constexpr std::size_t seen = 4096;
  const std::string_view begin = bytes.substr(0, seen);
  return bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF") ||
         (begin.find("solid") != std::string_view::npos && begin.find('\0') == std::string_view::npos);
}

}  // namespace

Expected<PolygonMesh> read_stl(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  Expected<std::string> bytes = io::read_file(path, limits, &context);
  if (!bytes) return bytes.error();
  if (!is_text(*bytes)) return read_binary(path, *bytes, limits, context);
  Expected<std::string> text = io::as_utf8(std::move(*bytes), path, &context);
  if (!text) return text.error();
  return read_ascii(path, *text, limits, context);
}

}  // namespace quadrig
