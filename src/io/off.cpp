// Object File Format, as text and as bytes.
#include <bit>
#include <cstring>

#include "scan.hpp"

namespace quadrig {
namespace {

using io::at_line;
using io::shown;

/// What the first word tells: [ST][C][N][4][n]OFF, in any case, perhaps with the number of vertices glued to it.
struct Header {
  bool texture = false, colour = false, normal = false;
  std::string_view rest;  ///< what follows OFF in the word
};

/// Nothing where the word is no such.
std::optional<Header> header_of(std::string_view word) {
  if (word.find("nOFF") != std::string_view::npos) return std::nullopt;  // of any dimension; "noff" is NOFF
  std::string upper(word);
  for (char& c : upper) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  Header header;
  std::string_view left = upper;
  const auto take = [&](std::string_view prefix) {
    const bool found = left.starts_with(prefix);
    if (found) left.remove_prefix(prefix.size());
    return found;
  };
  header.texture = take("ST");
  header.colour = take("C");
  header.normal = take("N");
  if (!take("OFF")) return std::nullopt;
  header.rest = word.substr(word.size() - left.size());
  return header;
}

/// The counts of vertices and faces, held against what the file can hold and what is allowed.
Status check_counts(std::int64_t vertices, std::int64_t faces, std::int64_t most_vertices, std::int64_t most_faces,
                    const FileLimits& limits, std::string where) {
  if (vertices >= 0 && faces >= 0 && vertices <= std::min<std::int64_t>(limits.vertices, most_vertices) &&
      faces <= std::min<std::int64_t>(limits.polygons, most_faces))
    return {};
  return Error{ErrorCode::bad_input,
               std::to_string(vertices) + " vertices and " + std::to_string(faces) +
                   " faces are announced, more than the file can hold",
               std::move(where), "check that the file is complete"};
}

/// Big-endian numbers of four bytes each.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : left_(bytes), total_(bytes.size()) {}
  [[nodiscard]] std::size_t words_left() const { return left_.size() / 4; }
  [[nodiscard]] std::size_t read() const { return total_ - left_.size(); }
  void skip(std::size_t words) { left_.remove_prefix(4 * words); }
  /// \pre a word is left
  [[nodiscard]] std::uint32_t word() {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k) value = value << 8 | static_cast<unsigned char>(left_[k]);
    skip(1);
    return value;
  }
  [[nodiscard]] double real() { return static_cast<double>(std::bit_cast<float>(word())); }

 private:
  std::string_view left_;
  std::size_t total_;
};

/// \param begin of the numbers in the text
Expected<PolygonMesh> read_binary(const std::filesystem::path& path, std::string_view text, std::size_t begin,
                                  const Header& header, const FileLimits& limits, const Context& context) {
  Bytes bytes(text.substr(begin));
  const auto where = [&] { return path.string() + ", byte " + std::to_string(begin + bytes.read()); };
  const auto fail = [&](std::string what) {
    return Error{ErrorCode::bad_input, std::move(what), where(), "check that the file is complete and big-endian"};
  };
  if (bytes.words_left() < 3) return fail("the counts are missing");
  const std::int64_t vertices = bytes.word(), faces = bytes.word();
  bytes.skip(1);
  const std::size_t more = (header.normal ? 3 : 0) + (header.colour ? 4 : 0) + (header.texture ? 2 : 0);
  const auto words = static_cast<std::int64_t>(bytes.words_left());
  if (Status status =
          check_counts(vertices, faces, words / static_cast<std::int64_t>(3 + more), words / 2, limits, where());
      !status)
    return status.error();
  PolygonMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(vertices), 3);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (v % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    for (int i = 0; i < 3; ++i) {
      mesh.positions(v, i) = bytes.real();
      if (!std::isfinite(mesh.positions(v, i))) return fail("a coordinate that is not finite");
    }
    bytes.skip(more);
  }
  mesh.first_corner.reserve(static_cast<std::size_t>(faces) + 1);
  mesh.first_corner.push_back(0);
  std::vector<Index> polygon;
  for (std::int64_t f = 0; f < faces; ++f) {
    if (f % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    if (bytes.words_left() < 1) return fail("the bytes end after " + std::to_string(f) + " faces");
    const std::size_t corners = bytes.word();
    if (corners < 1 || bytes.words_left() < corners + 1) return fail("a face of more corners than the file can hold");
    polygon.clear();
    for (std::size_t i = 0; i < corners; ++i) {
      const std::uint32_t vertex = bytes.word();
      if (vertex >= static_cast<std::uint64_t>(vertices))
        return fail("vertex number " + std::to_string(vertex) + " of " + std::to_string(vertices));
      polygon.push_back(static_cast<Index>(vertex));
    }
    const std::size_t colours = bytes.word();
    if (colours > bytes.words_left()) return fail("a colour of more numbers than the file can hold");
    bytes.skip(colours);
    if (mesh.corners.size() + polygon.size() >= (std::size_t{1} << 31)) return fail("too many faces");
    if (polygon.size() >= 3) mesh.add_polygon(polygon);
  }
  if (mesh.polygon_count() == 0) return io::in_file(path, "has no faces", "give a surface");
  return mesh;
}

/// \param cursor behind the first word of the counts \param word that
Expected<PolygonMesh> read_ascii(const std::filesystem::path& path, io::Cursor cursor, std::string_view word,
                                 const FileLimits& limits, const Context& context) {
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
  if (Status status = check_counts(counts[0], counts[1], left / 5 + 1, left / 2 + 1, limits,
                                   path.string() + ":" + std::to_string(cursor.line()));
      !status)
    return status.error();
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
      word = cursor.word_across('#');  // some writers wrap long lines
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

}  // namespace

Expected<PolygonMesh> read_off(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  Expected<std::string> text = io::read_text(path, limits, &context);
  if (!text) return text.error();
  io::Cursor cursor(*text);
  std::string_view word = cursor.word_across('#');
  std::optional<Header> header = header_of(word);
  if (!header) {
    if (word.size() >= 3 && header_of(word.substr(word.size() - 3)))  // 4OFF, nOFF
      return at_line(path, cursor.line(), shown(word) + " files are not read", "save as OFF with three coordinates");
    return at_line(path, cursor.line(), "begins with " + shown(word) + ", not with OFF", "check that the file is OFF");
  }
  word = header->rest;
  if (word.empty()) {
    word = cursor.word_across('#');
    if (word == "BINARY") {
      cursor.next_line();
      return read_binary(path, *text, text->size() - cursor.bytes_left(), *header, limits, context);
    }
  }
  return read_ascii(path, cursor, word, limits, context);
}

}  // namespace quadrig
