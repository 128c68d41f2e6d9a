// Accessors: all component types, normalized, interleaved, sparse.
#include <cstring>

#include "document.hpp"

namespace quadrig::gltf {
namespace {

struct Layout {
  std::string_view type;
  std::size_t rows, columns;
};
constexpr Layout layouts[] = {{"SCALAR", 1, 1}, {"VEC2", 2, 1}, {"VEC3", 3, 1}, {"VEC4", 4, 1},
                              {"MAT2", 2, 2},   {"MAT3", 3, 3}, {"MAT4", 4, 4}};

std::size_t bytes_of(int component_type) {
  switch (component_type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      return 0;
  }
}

template <class T>
double number(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double component(const char* bytes, int type) {
  switch (type) {
    case 5120:
      return number<std::int8_t>(bytes);
    case 5121:
      return number<std::uint8_t>(bytes);
    case 5122:
      return number<std::int16_t>(bytes);
    case 5123:
      return number<std::uint16_t>(bytes);
    case 5125:
      return number<std::uint32_t>(bytes);
    default:
      return number<float>(bytes);
  }
}

/// Columns of matrices of small components begin at multiples of 4 bytes.
struct Element {
  std::size_t rows = 1, columns = 1, column_bytes = 0, bytes = 0;
  explicit Element(const AccessorShape& shape) : rows(shape.components) {
    if (shape.components > 4) columns = rows = shape.components == 9 ? 3 : 4;
    column_bytes = rows * shape.component_bytes;
    if (columns > 1) column_bytes = (column_bytes + 3) / 4 * 4;
    bytes = column_bytes * columns;
  }
};

struct Located {
  const char* first = nullptr;
  std::size_t stride = 0;
};

/// Where the elements begin, when all of them are within their view.
Expected<Located> locate(State& state, const Json& json, std::size_t element_bytes, std::size_t count, bool may_stride,
                         const std::string& where) {
  const Expected<std::size_t> view = whole_member(state, json, "bufferView", where);
  if (!view) return view.error();
  const Expected<std::size_t> offset = whole_member(state, json, "byteOffset", where, 0);
  if (!offset) return offset.error();
  std::size_t stride = 0;
  const Expected<std::string_view> bytes = view_bytes(state, *view, stride);
  if (!bytes) return bytes.error();
  if (stride == 0 || !may_stride) stride = element_bytes;
  if (stride < element_bytes)
    return state.bad(
        where, "has a stride of " + std::to_string(stride) + " bytes for elements of " + std::to_string(element_bytes));
  if (count == 0) return Located{bytes->data(), stride};
  if (*offset > bytes->size() || bytes->size() - *offset < element_bytes ||
      (bytes->size() - *offset - element_bytes) / stride < count - 1)
    return state.bad(
        where, "has " + std::to_string(count) + " elements, more than " + numbered("bufferViews", *view) + " holds");
  return Located{bytes->data() + *offset, stride};
}

}  // namespace

double normalized_component(double value, int type) {
  switch (type) {
    case 5120:
      return std::max(value / 127, -1.0);
    case 5121:
      return value / 255;
    case 5122:
      return std::max(value / 32767, -1.0);
    case 5123:
      return value / 65535;
    default:
      return value;
  }
}

Expected<AccessorShape> accessor_shape(const State& state, std::size_t i) {
  const std::string where = numbered("accessors", i);
  const Expected<const Json*> json = entry(state, "accessors", i, where);
  if (!json) return json.error();
  AccessorShape shape;
  const Expected<std::size_t> count = whole_member(state, **json, "count", where);
  if (!count) return count.error();
  shape.count = *count;
  const Expected<std::size_t> component_type = whole_member(state, **json, "componentType", where);
  if (!component_type) return component_type.error();
  shape.component_type = *component_type < 10000 ? static_cast<int>(*component_type) : 0;
  shape.component_bytes = bytes_of(shape.component_type);
  if (shape.component_bytes == 0)
    return state.bad(where, "has the component type " + std::to_string(*component_type) + ", which glTF has not");
  const Json* type = member(**json, "type");
  if (type && type->is_string())
    for (const Layout& layout : layouts)
      if (layout.type == type->get_ref<const std::string&>()) shape.components = layout.rows * layout.columns;
  if (shape.components == 0) return state.bad(where, "has no type that glTF has");
  if (shape.components == 4 && type->get_ref<const std::string&>() == "MAT2")
    return state.unsupported(where, "is of 2 × 2 matrices", "no attribute that is read has them");
  const Json* normalized = member(**json, "normalized");
  shape.normalized = normalized && normalized->is_boolean() && normalized->get<bool>();
  return shape;
}

Status charge(const State& state, Budget& budget, std::size_t rows, std::size_t each, const std::string& where) {
  const auto share = [&](std::size_t bytes, std::size_t numbers) {
    return numbers * std::min(bytes, state.limits.values);
  };
  const std::size_t most =
      std::min(state.limits.values, budget.spare + share(state.bytes, Budget::numbers_a_byte) +
                                        share(state.unpacked_bytes, Budget::numbers_an_unpacked_byte));
  if (budget.used > most || (each > 0 && rows > (most - budget.used) / each))
    return state.bad(where,
                     "asks for more than " + std::to_string(most) + " numbers, which is what a file of " +
                         std::to_string(state.bytes) + " bytes may",
                     "use a simpler file or raise the limit");
  budget.used += rows * each;
  return {};
}

Expected<Values> read_accessor(State& state, std::size_t i, Budget& budget) {
  const std::string where = numbered("accessors", i);
  const Expected<AccessorShape> made = accessor_shape(state, i);
  if (!made) return made.error();
  const AccessorShape& shape = *made;
  const Json& json = array_of(state.json, "accessors")[i];
  const Element element(shape);
  std::optional<Located> located;
  if (member(json, "bufferView")) {
    const Expected<Located> found = locate(state, json, element.bytes, shape.count, true, where);
    if (!found) return found.error();
    located = *found;
  }
  if (Status status = charge(state, budget, shape.count, shape.components, where); !status) return status.error();
  Values values = Values::Zero(static_cast<Eigen::Index>(shape.count), static_cast<Eigen::Index>(shape.components));
  const auto put = [&](std::size_t row, const char* bytes) {
    Eigen::Index c = 0;
    for (std::size_t column = 0; column < element.columns; ++column)
      for (std::size_t k = 0; k < element.rows; ++k) {
        const double value =
            component(bytes + column * element.column_bytes + k * shape.component_bytes, shape.component_type);
        values(static_cast<Eigen::Index>(row), c++) =
            shape.normalized ? normalized_component(value, shape.component_type) : value;
      }
  };
  if (located)
    for (std::size_t k = 0; k < shape.count; ++k) put(k, located->first + k * located->stride);
  const Json* sparse = member(json, "sparse");
  if (!sparse) return values;
  const Expected<std::size_t> count = whole_member(state, *sparse, "count", where + ".sparse");
  if (!count) return count.error();
  if (*count > shape.count) return state.bad(where + ".sparse", "has more elements than its accessor");
  const Json* indices = member(*sparse, "indices");
  const Json* replaced = member(*sparse, "values");
  if (!indices || !replaced) return state.bad(where + ".sparse", "has no indices or no values");
  const std::string at_indices = where + ".sparse.indices";
  const Expected<std::size_t> index_type = whole_member(state, *indices, "componentType", at_indices);
  if (!index_type) return index_type.error();
  if (*index_type != 5121 && *index_type != 5123 && *index_type != 5125)
    return state.bad(at_indices, "are not unsigned whole numbers");
  const int type = static_cast<int>(*index_type);
  const Expected<Located> rows = locate(state, *indices, bytes_of(type), *count, false, at_indices);
  if (!rows) return rows.error();
  const Expected<Located> elements = locate(state, *replaced, element.bytes, *count, false, where + ".sparse.values");
  if (!elements) return elements.error();
  for (std::size_t k = 0; k < *count; ++k) {
    const double row = component(rows->first + k * rows->stride, type);
    if (!(row < static_cast<double>(shape.count))) return state.bad(at_indices, "go beyond the accessor");
    put(static_cast<std::size_t>(row), elements->first + k * elements->stride);
  }
  return values;
}

Expected<std::shared_ptr<const Values>> read_cached(State& state, std::size_t i, Budget& budget, Cache& cache) {
  if (i < cache.size() && cache[i]) return cache[i];
  Expected<Values> values = read_accessor(state, i, budget);
  if (!values) return values.error();
  auto shared = std::make_shared<const Values>(std::move(*values));
  if (i >= cache.size()) cache.resize(i + 1);  // below the number of accessors: it was read
  cache[i] = shared;
  return shared;
}

}  // namespace quadrig::gltf
