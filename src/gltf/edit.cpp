// New accessors behind the old ones: nothing that other parts of the file refer to is moved.
#include <map>
#include <set>

#include "document.hpp"

namespace quadrig::gltf {
namespace {

/// The buffer that new bytes go to: one without a name of its own.
std::size_t target_buffer(State& state) {
  for (std::size_t i = 0; i < state.buffers.size(); ++i)
    if (state.buffers[i].embedded) return i;
  Json& buffers = state.json["buffers"];
  if (!buffers.is_array()) buffers = Json::array();
  buffers.push_back(object_of({{"byteLength", 0}}));
  state.buffers.push_back({std::string(), true, true});
  return state.buffers.size() - 1;
}

/// Leaves null in the place of the entry.
std::size_t append(Json& document, const char* array, Json& entry) {
  Json& all = document[array];
  if (!all.is_array()) all = Json::array();
  all.push_back(std::move(entry));
  return all.size() - 1;
}

/// Calls `visit` with every number of an accessor that glTF itself knows of.
void each_reference(Json& document, function_ref<void(Json&)> visit) {
  const auto list = [](Json& parent, const char* key) -> Json* {
    const auto found = parent.is_object() ? parent.find(key) : parent.end();
    return parent.is_object() && found != parent.end() && found->is_structured() ? &*found : nullptr;
  };
  const auto value = [&](Json& parent, const char* key) {
    if (!parent.is_object()) return;
    if (const auto found = parent.find(key); found != parent.end()) visit(*found);
  };
  if (Json* meshes = list(document, "meshes"))
    for (Json& mesh : *meshes)
      if (Json* primitives = list(mesh, "primitives"))
        for (Json& primitive : *primitives) {
          value(primitive, "indices");
          if (Json* attributes = list(primitive, "attributes"))
            for (Json& attribute : *attributes) visit(attribute);
          if (Json* targets = list(primitive, "targets"))
            for (Json& target : *targets)
              if (target.is_structured())
                for (Json& attribute : target) visit(attribute);
        }
  if (Json* skins = list(document, "skins"))
    for (Json& skin : *skins) value(skin, "inverseBindMatrices");
  if (Json* animations = list(document, "animations"))
    for (Json& animation : *animations)
      if (Json* samplers = list(animation, "samplers"))
        for (Json& sampler : *samplers) {
          value(sampler, "input");
          value(sampler, "output");
        }
}

}  // namespace

void collect_foreign(const Json& json, bool foreign, std::set<std::size_t>& numbers) {
  if (json.is_object()) {
    for (const auto& [key, child] : json.items())
      collect_foreign(child, foreign || key == "extensions" || key == "extras", numbers);
  } else if (json.is_array()) {
    for (const Json& child : json) collect_foreign(child, foreign, numbers);
  } else if (foreign) {
    if (const auto number = whole(json)) numbers.insert(*number);
  }
}

std::set<std::size_t> referred_accessors(State& state) {
  std::set<std::size_t> used;
  each_reference(state.json, [&](Json& reference) {
    if (const auto number = whole(reference)) used.insert(*number);
  });
  return used;
}

void reuse_accessors(State& state, std::size_t first_new, const std::set<std::size_t>& before) {
  std::set<std::size_t> used = referred_accessors(state);
  collect_foreign(state.json, false, used);
  Json& accessors = state.json["accessors"];
  std::map<std::size_t, std::size_t> moved;
  for (const std::size_t slot : before) {
    if (used.contains(slot) || slot >= first_new) continue;
    const std::size_t last = accessors.size() - 1;
    if (last >= first_new) {
      replace(accessors[slot], std::move(accessors[last]));
      moved[last] = slot;
      accessors.erase(last);
    } else {
      replace(accessors[slot], object_of({{"componentType", 5121}, {"count", 1}, {"type", "SCALAR"}}));
    }
  }
  each_reference(state.json, [&](Json& reference) {
    if (const auto number = whole(reference))
      if (const auto found = moved.find(*number); found != moved.end()) reference = found->second;
  });
}

std::size_t append_accessor(State& state, const NewAccessor& made) {
  state.edited = true;
  const std::size_t to = target_buffer(state);
  Json& json = state.json["buffers"][to];
  std::string& bytes = state.buffers[to].bytes;
  // A binary chunk may be padded beyond its buffer's length.
  if (const auto length = whole(json["byteLength"]); length && *length < bytes.size()) bytes.resize(*length);
  bytes.append((4 - bytes.size() % 4) % 4, '\0');
  LocalJson view = object_of({{"buffer", to}, {"byteOffset", bytes.size()}, {"byteLength", made.bytes.size()}});
  if (made.target == 34962) view["byteStride"] = made.row_bytes;
  if (made.target != 0) view["target"] = made.target;
  bytes += made.bytes;
  json["byteLength"] = bytes.size();
  LocalJson accessor = object_of({{"bufferView", append(state.json, "bufferViews", view)},
                                  {"componentType", made.component_type},
                                  {"count", made.count},
                                  {"type", made.type}});
  if (!made.low.empty()) {
    accessor["min"] = made.low;
    accessor["max"] = made.high;
  }
  return append(state.json, "accessors", accessor);
}

}  // namespace quadrig::gltf
