#include <charconv>
#include <fstream>
#include <string_view>

#include "picture/picture.hpp"

namespace quadrig {

namespace {

std::string_view next_word(std::string_view& line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return line = {};
  const std::size_t last = line.find_first_of(" \t\r", first);
  const std::string_view word = line.substr(first, last - first);
  line = last == std::string_view::npos ? std::string_view{} : line.substr(last);
  return word;
}

template <class Number>
bool parse(std::string_view word, Number& number) {
  return std::from_chars(word.data(), word.data() + word.size(), number).ec == std::errc{};
}

}  // namespace

bool PolygonMesh::all_quads() const {
  for (Index p = 0; p < polygon_count(); ++p)
    if (polygon(p).size() != 4) return false;
  return polygon_count() > 0;
}

Expected<PolygonMesh> read_polygons(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) return Error{ErrorCode::bad_file, "cannot be opened", file.string(), "check the name"};
  std::vector<double> positions;
  PolygonMesh mesh;
  std::size_t number = 0;
  for (std::string text; std::getline(stream, text);) {
    ++number;
    const auto fail = [&](std::string what) {
      return Error{ErrorCode::bad_input, std::move(what), file.string() + ":" + std::to_string(number),
                   "mend the file"};
    };
    std::string_view line = text;
    const std::string_view kind = next_word(line);
    if (kind == "v") {
      for (int i = 0; i < 3; ++i) {
        double x = 0;
        if (!parse(next_word(line), x)) return fail("a vertex needs three numbers");
        positions.push_back(x);
      }
    } else if (kind == "f") {
      const auto count = static_cast<Index>(positions.size() / 3);
      for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
        Index index = 0;
        if (!parse(word, index)) return fail("a face needs vertex numbers");
        index = index < 0 ? count + index : index - 1;
        if (index < 0 || index >= count) return fail("vertex number out of range");
        mesh.corners.push_back(index);
      }
      mesh.begin.push_back(static_cast<Index>(mesh.corners.size()));
      if (mesh.polygon(mesh.polygon_count() - 1).size() < 3) return fail("a face needs three vertices");
    }
  }
  mesh.positions =
      Eigen::Map<const Points<double>>(positions.data(), static_cast<Eigen::Index>(positions.size() / 3), 3);
  if (!mesh.positions.allFinite())
    return Error{ErrorCode::bad_input, "a position is not finite", file.string(), "mend the file"};
  return mesh;
}

}  // namespace quadrig
