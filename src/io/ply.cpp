// Stanford PLY. Ours, because the readers at hand hide the line or byte of an error, or throw.
#include <bit>
#include <cstring>

#include "scan.hpp"

namespace quadrig {
namespace {

using io::at_line;
using io::shown;

enum class Type : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::pair<std::string_view, Type> type_names[] = {
    {"char", Type::i8},   {"int8", Type::i8},     {"uchar", Type::u8},   {"uint8", Type::u8},
    {"short", Type::i16}, {"int16", Type::i16},   {"ushort", Type::u16}, {"uint16", Type::u16},
    {"int", Type::i32},   {"int32", Type::i32},   {"uint", Type::u32},   {"uint32", Type::u32},
    {"float", Type::f32}, {"float32", Type::f32}, {"double", Type::f64}, {"float64", Type::f64}};

constexpr std::size_t size_of(Type type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

std::optional<Type> type_named(std::string_view name) {
  for (const auto& [known, type] : type_names)
    if (known == name) return type;
  return std::nullopt;
}

struct Property {
  std::string_view name;
  Type type = Type::f32;
  std::optional<Type> count_type;  ///< of a list
};
struct Element {
  std::string_view name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};
enum class Coding : std::uint8_t { ascii, little, big };

/// Values one after another, from words or from bytes.
class Body {
 public:
  Body(io::Cursor cursor, Coding coding) : cursor_(cursor), coding_(coding), at_(cursor.position()) {
    left_ = cursor.bytes_left();
    total_ = left_;
  }
  /// The least bytes that one value of the type takes.
  [[nodiscard]] std::size_t least_size(Type type) const { return coding_ == Coding::ascii ? 1 : size_of(type); }
  [[nodiscard]] std::size_t bytes_left() const { return coding_ == Coding::ascii ? cursor_.bytes_left() + 1 : left_; }
  [[nodiscard]] std::string place(const std::filesystem::path& path, std::size_t header_bytes) const {
    if (coding_ == Coding::ascii) return path.string() + ":" + std::to_string(cursor_.line());
    return path.string() + ", byte " + std::to_string(header_bytes + total_ - left_);
  }
  /// False at the end of the data, or where a word is not a number of the type.
  bool read(Type type, double& value) {
    if (coding_ == Coding::ascii) {
      const std::string_view word = cursor_.word_across();
      if (word.empty()) return false;
      return io::to_number(word, value);
    }
    const std::size_t size = size_of(type);
    if (left_ < size) return false;
    unsigned char raw[8];
    std::memcpy(raw, at_, size);
    at_ += size;
    left_ -= size;
    if ((coding_ == Coding::little) != (std::endian::native == std::endian::little)) std::reverse(raw, raw + size);
    const auto as = [&raw]<class T>(T) {
      T result;
      std::memcpy(&result, raw, sizeof(T));
      return static_cast<double>(result);
    };
    switch (type) {
      case Type::i8:
        value = as(std::int8_t{});
        break;
      case Type::u8:
        value = as(std::uint8_t{});
        break;
      case Type::i16:
        value = as(std::int16_t{});
        break;
      case Type::u16:
        value = as(std::uint16_t{});
        break;
      case Type::i32:
        value = as(std::int32_t{});
        break;
      case Type::u32:
        value = as(std::uint32_t{});
        break;
      case Type::f32:
        value = as(float{});
        break;
      case Type::f64:
        value = as(double{});
        break;
    }
    return true;
  }

 private:
  io::Cursor cursor_;
  Coding coding_;
  const char* at_;
  std::size_t left_ = 0, total_ = 0;
};

/// The triangles of a strip: each vertex makes one with the two before it, every other turned; −1 begins anew.
void add_strip(const std::vector<Index>& strip, PolygonMesh& mesh) {
  std::size_t begin = 0;
  for (std::size_t k = 0; k < strip.size(); ++k) {
    if (strip[k] == no_index) {
      begin = k + 1;
      continue;
    }
    if (k < begin + 2) continue;
    const bool turned = (k - begin) % 2 != 0;
    const std::array<Index, 3> triangle{strip[k - (turned ? 1 : 2)], strip[k - (turned ? 2 : 1)], strip[k]};
    mesh.add_polygon(triangle);
  }
}

}  // namespace

Expected<PolygonMesh> read_ply(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  Expected<std::string> text = io::read_text(path, limits, &context);
  if (!text) return text.error();
  io::Cursor cursor(*text);
  const auto header_error = [&](std::string what) {
    return at_line(path, cursor.line(), std::move(what), "check that the file is PLY");
  };
  if (cursor.word() != "ply") return header_error("does not begin with 'ply'");
  std::optional<Coding> coding;
  std::vector<Element> elements;
  while (true) {
    if (!cursor.next_line()) return header_error("the header does not end");
    const std::string_view keyword = cursor.word();
    if (keyword == "end_header") break;
    if (keyword.empty() || keyword == "comment" || keyword == "obj_info") continue;
    if (keyword == "format") {
      const std::string_view name = cursor.word();
      if (name == "ascii")
        coding = Coding::ascii;
      else if (name == "binary_little_endian")
        coding = Coding::little;
      else if (name == "binary_big_endian")
        coding = Coding::big;
      else
        return header_error("format " + shown(name) + " is not known");
    } else if (keyword == "element") {
      Element element;
      element.name = cursor.word();
      const std::string_view count = cursor.word();
      if (element.name.empty() || !io::to_integer(count, element.count) || element.count < 0)
        return header_error(shown(count) + " is not a number of elements");
      elements.push_back(std::move(element));
    } else if (keyword == "property") {
      Property property;
      std::string_view word = cursor.word();
      if (word == "list") {
        const std::string_view count_name = cursor.word();
        property.count_type = type_named(count_name);
        if (!property.count_type || *property.count_type == Type::f32 || *property.count_type == Type::f64)
          return header_error(shown(count_name) + " is not a type of counts");
        word = cursor.word();
      }
      const std::optional<Type> type = type_named(word);
      if (!type) return header_error(shown(word) + " is not a type");
      property.type = *type;
      property.name = cursor.word();
      if (elements.empty() || property.name.empty()) return header_error("a property without an element or a name");
      elements.back().properties.push_back(property);
    } else {
      return header_error(shown(keyword) + " begins no header line");
    }
  }
  if (!coding) return header_error("the header names no format");
  cursor.next_line();
  const std::size_t header_bytes = text->size() - cursor.bytes_left();
  Body body(cursor, *coding);
  const auto body_error = [&](std::string what) {
    return Error{ErrorCode::bad_input, std::move(what), body.place(path, header_bytes),
                 "check that the file is complete"};
  };

  PolygonMesh mesh;
  mesh.first_corner.push_back(0);
  bool has_vertices = false, has_faces = false, has_strips = false;
  std::vector<Index> polygon;
  for (const Element& element : elements) {
    if (element.properties.empty()) continue;
    std::size_t least = 0;
    for (const Property& property : element.properties)
      least += property.count_type ? body.least_size(*property.count_type)
                                   : body.least_size(property.type) + (*coding == Coding::ascii ? 1 : 0);
    if (static_cast<std::uint64_t>(element.count) > body.bytes_left() / std::max<std::size_t>(least, 1) + 1)
      return body_error(std::to_string(element.count) + " entries of element " + shown(element.name) +
                        " are announced, more than the file can hold");
    const bool vertices = element.name == "vertex" && !has_vertices, faces = element.name == "face" && !has_faces;
    const bool strips = element.name == "tristrips" && !has_strips;
    int axis[3] = {-1, -1, -1}, list = -1;
    for (int i = 0; i < static_cast<int>(element.properties.size()); ++i) {
      const Property& property = element.properties[static_cast<std::size_t>(i)];
      for (int k = 0; k < 3; ++k)
        if (vertices && !property.count_type && property.name == std::string_view("xyz").substr(std::size_t(k), 1))
          axis[k] = i;
      if ((faces || strips) && property.count_type &&
          (property.name == "vertex_indices" || property.name == "vertex_index"))
        list = i;
    }
    if (vertices) {
      if (axis[0] < 0 || axis[1] < 0 || axis[2] < 0) return header_error("element 'vertex' has no x, y and z");
      if (element.count > limits.vertices) return header_error("too many vertices");
      mesh.positions.resize(static_cast<Eigen::Index>(element.count), 3);
      has_vertices = true;
    } else if (faces) {
      if (list < 0) return header_error("element 'face' has no list vertex_indices");
      if (element.count > limits.polygons) return header_error("too many faces");
      mesh.first_corner.reserve(static_cast<std::size_t>(element.count) + 1);
      has_faces = true;
    } else if (strips) {
      if (list < 0) return header_error("element 'tristrips' has no list vertex_indices");
      has_strips = true;
    }
    for (std::int64_t row = 0; row < element.count; ++row) {
      if (row % 16'384 == 0 && context.cancelled()) return cancelled_error("read");
      const auto row_error = [&](const std::string& what) {
        return body_error(what + " in entry " + std::to_string(row) + " of element " + shown(element.name));
      };
      for (int i = 0; i < static_cast<int>(element.properties.size()); ++i) {
        const Property& property = element.properties[static_cast<std::size_t>(i)];
        double value = 0;
        if (!property.count_type) {
          if (!body.read(property.type, value)) return row_error("no number for " + shown(property.name));
          for (int k = 0; k < 3; ++k) {
            if (i != axis[k]) continue;
            if (!std::isfinite(value)) return row_error("a coordinate that is not finite");
            mesh.positions(static_cast<Eigen::Index>(row), k) = value;
          }
          continue;
        }
        if (!body.read(*property.count_type, value) || value < 0 || value != std::floor(value) ||
            value * static_cast<double>(body.least_size(property.type)) > static_cast<double>(body.bytes_left()))
          return row_error("a length of list " + shown(property.name) + " that the file cannot hold");
        const auto corners = static_cast<std::size_t>(value);
        // A strip has three corners for each of its own.
        if (i == list && mesh.corners.size() + (strips ? 3 : 1) * corners >= (std::size_t{1} << 31))
          return row_error("too many corners");
        polygon.clear();
        for (std::size_t k = 0; k < corners; ++k) {
          if (!body.read(property.type, value)) return row_error("no number in list " + shown(property.name));
          if (i != list) continue;
          if (strips && value == -1) {
            polygon.push_back(no_index);
            continue;
          }
          if (!(value >= 0 && value < 2147483648.0) || value != std::floor(value))
            return row_error("a vertex number that cannot be");
          polygon.push_back(static_cast<Index>(value));
        }
        if (i != list) continue;
        if (strips)
          add_strip(polygon, mesh);
        else if (polygon.size() >= 3)
          mesh.add_polygon(polygon);
      }
    }
  }
  if (!has_vertices) return io::in_file(path, "has no element 'vertex'", "give a surface");
  if (mesh.polygon_count() == 0) return io::in_file(path, "has no faces", "give a surface; point clouds are not read");
  for (Index i = 0; i < mesh.polygon_count(); ++i)
    for (const Index v : mesh.polygon(i))
      if (v >= mesh.vertex_count())
        return io::in_file(path,
                           "face " + std::to_string(i) + " names vertex " + std::to_string(v) + " of " +
                               std::to_string(mesh.vertex_count()),
                           "count vertices from 0");
  return mesh;
}

}  // namespace quadrig
