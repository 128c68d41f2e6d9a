// Object File Format.
#include "scan.hpp"

namespace quadrig {

Expected<PolygonMesh> read_off(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  using io::at_line;
  using io::shown;
  Expected<std::string> text = io::read_file(path, limits, &context);
  if (!text) return text.error();
  io::Cursor cursor(*text);

  std::string_view word = cursor.word_across('#');
  if (word.size() < 3 || word.substr(word.size() - 3) != "OFF")
    return at_line(path, cursor.line(), "begins with " + shown(word) + ", not with OFF", "check that the file is OFF");
  const std::string_view prefix = word.substr(0, word.size() - 3);  // any of ST, C, N, 4, n
  if (prefix.find_first_not_of("STCN") != std::string_view::npos)
    return at_line(path, cursor.line(), shown(word) + " files are not read", "save as OFF with three coordinates");
  word = cursor.word_across('#');
  if (word == "BINARY")
    return Error{ErrorCode::unsupported, "binary OFF is not read", path.string(), "save it as ascii OFF or binary PLY"};
  std::int64_t counts[3] = {0, 0, 0};
  for (int i = 0; i < 3; ++i) {
    if (i > 0) word = cursor.word('#');
    if (i == 2 && word.empty()) break;  // some writers leave out the number of edges
    if (!io::to_integer(word, counts[i]) || counts[i] < 0)
      return at_line(path, cursor.line(), shown(word) + " is not a count",
                     "give the numbers of vertices, faces, edges");
  }
  // The shortest vertex is "0 0 0" and the shortest face "3 0 1 2", each with its line end.
  const auto left = static_cast<std::int64_t>(cursor.bytes_left());
  if (counts[0] > limits.vertices || counts[1] > limits.polygons || counts[0] > left / 5 + 1 ||
      counts[1] > left / 2 + 1)
    return at_line(path, cursor.line(),
                   std::to_string(counts[0]) + " vertices and " + std::to_string(counts[1]) +
                       " faces are announced, more than the file can hold",
                   "check that the file is complete");
  PolygonMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(counts[0]), 3);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (v % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    for (int i = 0; i < 3; ++i) {
      word = i == 0 ? cursor.word_across('#') : cursor.word('#');
      if (word.empty())
        return at_line(path, cursor.line(), "the text ends in vertex " + std::to_string(v),
                       "check that it is complete");
      if (!io::to_number(word, mesh.positions(v, i)) || !std::isfinite(mesh.positions(v, i)))
        return at_line(path, cursor.line(), shown(word) + " is not a finite number", "give x, y and z as numbers");
    }
    if (!cursor.next_line() && v + 1 < mesh.vertex_count())  // normals and colours follow on the line
      return at_line(path, cursor.line(), "the text ends after vertex " + std::to_string(v),
                     "check that it is complete");
  }
  mesh.first_corner.reserve(static_cast<std::size_t>(counts[1]) + 1);
  mesh.first_corner.push_back(0);
  std::vector<Index> polygon;
  for (std::int64_t f = 0; f < counts[1]; ++f) {
    if (f % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    word = cursor.word_across('#');
    std::int64_t corners = 0;
    if (word.empty())
      return at_line(path, cursor.line(),
                     "the text ends after " + std::to_string(f) + " of " + std::to_string(counts[1]) + " faces",
                     "check that it is complete");
    if (!io::to_integer(word, corners) || corners < 1 || corners > limits.vertices)
      return at_line(path, cursor.line(), shown(word) + " is not a number of corners", "give 3 or more");
    polygon.clear();
    for (std::int64_t i = 0; i < corners; ++i) {
      word = cursor.word('#');
      Index vertex = 0;
      if (word.empty())
        return at_line(path, cursor.line(),
                       "a face of " + std::to_string(corners) + " corners names " + std::to_string(i), "give them all");
      if (!io::to_integer(word, vertex) || vertex < 0 || vertex >= mesh.vertex_count())
        return at_line(path, cursor.line(), shown(word) + " is not a vertex number below " + std::to_string(counts[0]),
                       "count vertices from 0");
      polygon.push_back(vertex);
    }
    if (mesh.corners.size() + polygon.size() >= (std::size_t{1} << 31))
      return at_line(path, cursor.line(), "too many faces", "use a smaller mesh");
    if (polygon.size() >= 3) mesh.add_polygon(polygon);  // points and edges are no surface
    cursor.next_line();
  }
  if (mesh.polygon_count() == 0) return io::in_file(path, "has no faces", "give a surface");
  return mesh;
}

}  // namespace quadrig
