// Checked access to the JSON.
#include "document.hpp"

namespace quadrig::gltf {

void dismantle(Json& json) noexcept {
  if (json.is_object()) {
    auto& members = json.get_ref<Json::object_t&>();
    for (; !members.empty(); members.pop_back()) dismantle(members.back().second);
  } else if (json.is_array()) {
    auto& entries = json.get_ref<Json::array_t&>();
    for (; !entries.empty(); entries.pop_back()) dismantle(entries.back());
  }
}

Json object_of(std::initializer_list<std::pair<const char*, Json>> members) {
  LocalJson made = Json::object();
  for (const auto& [name, value] : members) made[name] = value;
  return std::move(static_cast<Json&>(made));
}

const Json& array_of(const Json& object, const char* key) {
  static const Json empty = Json::array();
  const Json* found = member(object, key);
  return found && found->is_array() ? *found : empty;
}

std::optional<std::size_t> whole(const Json& value) {
  constexpr double largest = 9007199254740992.0;  // 2^53: every whole number below is a double
  if (value.is_number_unsigned()) {
    const auto number = value.get<std::uint64_t>();
    if (number <= static_cast<std::uint64_t>(largest)) return static_cast<std::size_t>(number);
  } else if (value.is_number_integer()) {
    const auto number = value.get<std::int64_t>();
    if (number >= 0 && number <= static_cast<std::int64_t>(largest)) return static_cast<std::size_t>(number);
  } else if (value.is_number_float()) {
    const double number = value.get<double>();
    if (number >= 0 && number <= largest && std::floor(number) == number) return static_cast<std::size_t>(number);
  }
  return std::nullopt;
}

Expected<std::size_t> whole_member(const State& state, const Json& object, const char* key, const std::string& where,
                                   std::optional<std::size_t> fallback) {
  const Json* found = member(object, key);
  if (!found) {
    if (fallback) return *fallback;
    return state.bad(where, std::string("has no ") + key);
  }
  if (const auto number = whole(*found)) return *number;
  return state.bad(where + "." + key, "is not a whole number from 0");
}

Expected<const Json*> entry(const State& state, const char* array, std::size_t i, const std::string& where) {
  const Json& all = array_of(state.json, array);
  if (i >= all.size()) return state.bad(where, "refers to " + numbered(array, i) + " of " + std::to_string(all.size()));
  if (!all[i].is_object()) return state.bad(numbered(array, i), "is not an object");
  return &all[i];
}

Expected<std::optional<std::vector<double>>> number_array(const State& state, const Json& object, const char* key,
                                                          std::size_t count, const std::string& where) {
  using Result = std::optional<std::vector<double>>;
  const Json* found = member(object, key);
  if (!found) return Result{};
  const Error wrong = state.bad(where + "." + key, "is not an array of " + std::to_string(count) + " numbers");
  if (!found->is_array() || found->size() != count) return wrong;
  std::vector<double> numbers;
  for (const Json& value : *found) {
    if (!value.is_number()) return wrong;
    numbers.push_back(value.get<double>());
  }
  return Result{std::move(numbers)};
}

}  // namespace quadrig::gltf
