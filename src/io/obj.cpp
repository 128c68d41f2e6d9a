// Wavefront OBJ. A parser of our own: it is smaller than a wrapper that would give another's errors a line, and the
// readers in packages pass over broken numbers without a word.
#include <map>

#include "scan.hpp"

namespace quadrig {
namespace {

using io::at_line;
using io::shown;

constexpr std::string_view surface_free[] = {"vn",       "vp",     "p",          "g",        "o",     "s",
                                             "mg",       "mtllib", "usemap",     "maplib",   "bevel", "c_interp",
                                             "d_interp", "lod",    "shadow_obj", "trace_obj"};

/// A line with its continuations by a backslash joined.
class Lines {
 public:
  explicit Lines(std::string_view text) : cursor_(text) {}
  [[nodiscard]] std::size_t line() const { return cursor_.line(); }
  std::string_view word() {
    while (true) {
      std::string_view found = cursor_.word('#');
      if (!found.ends_with('\\') || !cursor_.at_line_end()) return found;
      found.remove_suffix(1);
      cursor_.next_line();
      if (!found.empty()) return found;
    }
  }
  bool next() { return cursor_.next_line(); }
  [[nodiscard]] bool at_end() const { return cursor_.at_end(); }

 private:
  io::Cursor cursor_;
};

/// Texture coordinates of corners, by the number of the first that is the same.
class TextureNumbers {
 public:
  void add(double u, double v) { coordinates_.push_back({u, v}); }
  [[nodiscard]] std::int64_t count() const { return static_cast<std::int64_t>(coordinates_.size()); }
  [[nodiscard]] bool empty() const { return coordinates_.empty(); }
  /// In the place of each number that of the first with the same coordinates; of numbers that do not exist, none.
  void unite(std::vector<Index>& numbers) const {
    std::vector<Index> order(coordinates_.size()), first(coordinates_.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<Index>(k);
    const auto of = [&](Index k) { return coordinates_[static_cast<std::size_t>(k)]; };
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return of(a) < of(b); });
    for (std::size_t k = 0; k < order.size(); ++k)
      first[static_cast<std::size_t>(order[k])] =
          k > 0 && of(order[k - 1]) == of(order[k]) ? first[static_cast<std::size_t>(order[k - 1])] : order[k];
    for (Index& number : numbers)
      number = number >= 0 && number < count() ? first[static_cast<std::size_t>(number)] : no_index;
  }

 private:
  std::vector<std::array<double, 2>> coordinates_;
};

/// A number of an OBJ statement, counted from 1 or back from −1, as one from 0. Negative where it is none.
std::int64_t from_zero(std::int64_t number, std::int64_t so_far) { return number > 0 ? number - 1 : so_far + number; }

/// Of v/vt or v/vt/vn; no_index where there is none.
Index texture_of(std::string_view corner, std::int64_t so_far) {
  const std::size_t slash = corner.find('/');
  if (slash == std::string_view::npos) return no_index;
  const std::string_view rest = corner.substr(slash + 1);
  std::int64_t number = 0;
  if (!io::to_integer(rest.substr(0, rest.find('/')), number) || number == 0) return no_index;
  const std::int64_t texture = from_zero(number, so_far);
  return texture >= 0 && texture < std::numeric_limits<Index>::max() ? static_cast<Index>(texture) : no_index;
}

}  // namespace

Expected<PolygonMesh> read_obj(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  Expected<std::string> text = io::read_text(path, limits, &context);
  if (!text) return text.error();

  PolygonMesh mesh;
  std::vector<double> coordinates;
  std::vector<std::size_t> face_line;
  std::vector<Index> polygon, corner_textures;
  mesh.first_corner.push_back(0);
  Index unknown = 0, free_form = 0, edges = 0;
  std::size_t unknown_line = 0;
  std::string unknown_word;
  TextureNumbers textures;
  std::map<std::string, Index, std::less<>> materials;
  Index material = 0;
  Lines lines(*text);
  do {
    const std::string_view keyword = lines.word();
    if (keyword.empty() || keyword.front() == '$') continue;  // some exporters begin comments so
    const std::size_t line = lines.line();
    if (line % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
    if (keyword == "v") {
      for (int i = 0; i < 3; ++i) {
        double value = 0;
        const std::string_view word = lines.word();
        if (word.empty())
          return at_line(path, line, "a vertex of " + std::to_string(i) + " coordinates", "give it three");
        if (!io::to_number(word, value) || !std::isfinite(value))
          return at_line(path, line, shown(word) + " is not a finite number", "give x, y and z as numbers");
        coordinates.push_back(value);
      }
      if (coordinates.size() / 3 > static_cast<std::size_t>(limits.vertices))
        return at_line(path, line, "more than " + std::to_string(limits.vertices) + " vertices", "raise the limit");
    } else if (keyword == "f" || keyword == "fo") {
      const auto so_far = static_cast<std::int64_t>(coordinates.size() / 3);
      polygon.clear();
      corner_textures.clear();
      for (std::string_view word = lines.word(); !word.empty(); word = lines.word()) {
        std::int64_t number = 0;
        if (!io::to_integer(word.substr(0, word.find('/')), number))
          return at_line(path, line, shown(word) + " is not a vertex number", "write v, v/vt, v//vn or v/vt/vn");
        const std::int64_t vertex = from_zero(number, so_far);
        if (number == 0 || vertex < 0 || vertex >= std::numeric_limits<Index>::max())
          return at_line(path, line, "vertex number " + std::to_string(number) + " does not exist",
                         "count vertices from 1, or back from -1");
        polygon.push_back(static_cast<Index>(vertex));
        corner_textures.push_back(texture_of(word, textures.count()));
      }
      if (polygon.empty()) return at_line(path, line, "a face without corners", "give it three or more");
      if (polygon.size() < 3) {
        ++edges;
        continue;
      }
      if (mesh.corners.size() + polygon.size() >= (std::size_t{1} << 31) || mesh.polygon_count() >= limits.polygons)
        return at_line(path, line, "too many faces", "use a smaller mesh");
      mesh.add_polygon(polygon);
      mesh.material.push_back(material);
      mesh.texture.insert(mesh.texture.end(), corner_textures.begin(), corner_textures.end());
      face_line.push_back(line);
    } else if (keyword == "vt") {
      const auto coordinate = [&] {
        double value = 0;
        return io::to_number(lines.word(), value) && std::isfinite(value) ? value : 0;
      };
      const double u = coordinate();
      textures.add(u, coordinate());
    } else if (keyword == "usemtl") {
      std::string name;  // with its blanks: "Mat A" is not "Mat B"
      for (std::string_view word = lines.word(); !word.empty(); word = lines.word()) name.append(word).append(1, ' ');
      material = materials.try_emplace(std::move(name), static_cast<Index>(materials.size()) + 1).first->second;
    } else if (keyword == "l") {
      const auto so_far = static_cast<std::int64_t>(coordinates.size() / 3);
      Index before = no_index;
      for (std::string_view word = lines.word(); !word.empty(); word = lines.word()) {
        std::int64_t number = 0;
        const bool sound = io::to_integer(word.substr(0, word.find('/')), number) && number != 0;
        const std::int64_t vertex = sound ? from_zero(number, so_far) : -1;
        const bool there = vertex >= 0 && vertex < std::numeric_limits<Index>::max();
        if (there && before != no_index) mesh.lines.push_back({before, static_cast<Index>(vertex)});
        before = there ? static_cast<Index>(vertex) : no_index;
      }
    } else if (std::find(std::begin(surface_free), std::end(surface_free), keyword) == std::end(surface_free)) {
      const bool plain =
          keyword.size() <= 16 &&
          std::all_of(keyword.begin(), keyword.end(),
                      [](char c) {
                        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
                      }) &&
          !(keyword[0] >= '0' && keyword[0] <= '9');
      if (!plain)
        return at_line(path, line, shown(keyword) + " begins no OBJ statement", "check that the file is OBJ text");
      if (keyword == "surf" || keyword == "curv" || keyword == "curv2") {
        ++free_form;
      } else if (unknown++ == 0) {
        unknown_line = line;
        unknown_word = keyword;
      }
    }
  } while (lines.next());

  mesh.positions =
      Eigen::Map<const Points<double>>(coordinates.data(), static_cast<Eigen::Index>(coordinates.size() / 3), 3);
  for (Index i = 0; i < mesh.polygon_count(); ++i)
    for (const Index v : mesh.polygon(i))
      if (v >= mesh.vertex_count())
        return at_line(path, face_line[static_cast<std::size_t>(i)],
                       "vertex number " + std::to_string(v + 1) + " does not exist: the file has " +
                           std::to_string(mesh.vertex_count()),
                       "check that the file is complete");
  if (mesh.polygon_count() == 0) return io::in_file(path, "has no faces", "give a surface");
  if (materials.empty()) mesh.material.clear();
  if (textures.empty())
    mesh.texture.clear();
  else
    textures.unite(mesh.texture);
  std::erase_if(mesh.lines,
                [&](const std::array<Index, 2>& line) { return std::max(line[0], line[1]) >= mesh.vertex_count(); });
  if (edges > 0)
    context.warn("read", path.string() + ": " + std::to_string(edges) + " faces of one or two corners left out");
  if (free_form > 0)
    context.warn("read", path.string() + ": " + std::to_string(free_form) + " free-form curves or surfaces left out");
  if (unknown > 0)
    context.warn("read", path.string() + ":" + std::to_string(unknown_line) + ": " + std::to_string(unknown) +
                             " unknown statements left out, the first " + shown(unknown_word));
  return mesh;
}

}  // namespace quadrig
