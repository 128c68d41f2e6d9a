// Bytes of replaced surfaces out of their buffers.
#include <algorithm>
#include <map>

#include "reader.hpp"

namespace quadrig::gltf {
namespace {

struct Range {
  std::size_t first = 0, last = 0;
};

/// Calls `visit` with every number of a buffer view that glTF itself knows of.
void each_view_reference(Json& document, function_ref<void(Json&)> visit) {
  const auto value = [&](Json& parent) {
    if (!parent.is_object()) return;
    if (const auto found = parent.find("bufferView"); found != parent.end()) visit(*found);
  };
  if (document.contains("meshes") && document["meshes"].is_array())
    for (Json& mesh : document["meshes"]) {
      if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array()) continue;
      for (Json& primitive : mesh["primitives"])
        if (primitive.is_object() && primitive.contains("extensions") && primitive["extensions"].is_object() &&
            primitive["extensions"].contains(draco_name))
          value(primitive["extensions"][draco_name]);
    }
  for (const char* array : {"accessors", "images"}) {
    if (!document.contains(array) || !document[array].is_array()) continue;
    for (Json& one : document[array]) {
      value(one);
      if (!one.is_object() || !one.contains("sparse")) continue;
      Json& sparse = one["sparse"];
      if (!sparse.is_object()) continue;
      for (const char* part : {"indices", "values"})
        if (sparse.contains(part)) value(sparse[part]);
    }
  }
}

/// Whether an extension or extras may refer to places within buffers.
bool has_foreign_places(const Json& json, bool foreign) {
  if (json.is_object()) {
    for (const auto& [key, child] : json.items()) {
      if (foreign && (key == "buffer" || key == "byteOffset")) return true;
      if (has_foreign_places(child, foreign || key == "extensions" || key == "extras")) return true;
    }
  } else if (json.is_array()) {
    for (const Json& child : json)
      if (has_foreign_places(child, foreign)) return true;
  }
  return false;
}

std::optional<Range> range_of(const Json& view) {
  const Json *offset = member(view, "byteOffset"), *length = member(view, "byteLength");
  const auto first = offset ? whole(*offset) : std::optional<std::size_t>(0);
  const auto bytes = length ? whole(*length) : std::nullopt;
  if (!first || !bytes) return std::nullopt;
  return Range{*first, *first + *bytes};
}

/// Multiples of 4 within `gone` that no range of `used` touches, ascending.
std::vector<Range> free_ranges(std::vector<Range> gone, std::vector<Range> used) {
  const auto before = [](const Range& a, const Range& b) {
    return a.first != b.first ? a.first < b.first : a.last < b.last;
  };
  std::sort(gone.begin(), gone.end(), before);
  std::sort(used.begin(), used.end(), before);
  std::vector<Range> result;
  std::size_t done = 0, next = 0, covered = 0;
  const auto take = [&](std::size_t first, std::size_t last) {
    first = (std::max(first, done) + 3) / 4 * 4;
    last = last / 4 * 4;
    if (first >= last) return;
    result.push_back({first, last});
    done = last;
  };
  for (const Range& range : gone) {
    std::size_t at_byte = range.first;
    while (next < used.size() && used[next].first < range.last) {
      take(std::max(at_byte, covered), std::min(used[next].first, range.last));
      covered = std::max(covered, used[next].last);
      ++next;
    }
    take(std::max(at_byte, covered), range.last);
  }
  return result;
}

void cut(State& state, std::size_t buffer, const std::vector<Range>& out) {
  std::string& bytes = state.buffers[buffer].bytes;
  std::string kept;
  std::size_t from = 0;
  for (const Range& range : out) {
    kept.append(bytes, from, range.first - from);
    from = range.last;
  }
  kept.append(bytes, from, std::string::npos);
  bytes = std::move(kept);
  std::vector<std::size_t> sum(1, 0);  // bytes taken out by the first ranges
  for (const Range& range : out) sum.push_back(sum.back() + range.last - range.first);
  for (Json& view : state.json["bufferViews"]) {
    const Json* number = member(view, "buffer");
    if (!number || whole(*number) != buffer) continue;
    const auto own = range_of(view);
    const auto behind =
        std::partition_point(out.begin(), out.end(), [&](const Range& range) { return range.last <= own->first; });
    const std::size_t before = sum[static_cast<std::size_t>(behind - out.begin())];
    if (before > 0) view["byteOffset"] = own->first - before;
  }
  state.json["buffers"][buffer]["byteLength"] = bytes.size();
}

}  // namespace

std::set<std::size_t> referred_views(State& state) {
  std::set<std::size_t> used;
  each_view_reference(state.json, [&](Json& reference) {
    if (const auto number = whole(reference)) used.insert(*number);
  });
  return used;
}

void drop_unused_bytes(State& state, std::size_t first_new, const std::set<std::size_t>& before) {
  if (has_foreign_places(state.json, false)) return;
  std::set<std::size_t> used = referred_views(state);
  collect_foreign(state.json, false, used);
  Json& views = state.json["bufferViews"];
  std::map<std::size_t, std::vector<Range>> gone, kept;
  std::vector<std::size_t> free_slots;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Json* number = member(views[i], "buffer");
    const auto buffer = number ? whole(*number) : std::nullopt;
    const auto range = range_of(views[i]);
    if (!buffer || !range || *buffer >= state.buffers.size()) return;  // a broken view: leave all as it is
    const Buffer& held = state.buffers[*buffer];
    const bool drop = i < first_new && before.contains(i) && !used.contains(i) && held.embedded && held.loaded &&
                      range->last <= held.bytes.size();
    (drop ? gone : kept)[*buffer].push_back(*range);
    if (drop) free_slots.push_back(i);
  }
  std::map<std::size_t, std::size_t> moved;
  for (const std::size_t slot : free_slots) {
    const std::size_t last = views.size() - 1;
    if (last >= first_new) {
      replace(views[slot], std::move(views[last]));
      moved[last] = slot;
      views.erase(last);
    } else {
      replace(views[slot], object_of({{"buffer", *whole(views[slot]["buffer"])}, {"byteLength", 1}}));
    }
  }
  each_view_reference(state.json, [&](Json& reference) {
    if (const auto number = whole(reference))
      if (const auto found = moved.find(*number); found != moved.end()) reference = found->second;
  });
  for (const auto& [buffer, ranges] : gone) {
    const std::vector<Range> out = free_ranges(ranges, kept[buffer]);
    if (!out.empty()) cut(state, buffer, out);
  }
}

}  // namespace quadrig::gltf
