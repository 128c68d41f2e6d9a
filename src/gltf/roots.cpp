// Roots of joints, and the scenes that have them.
#include "roots.hpp"

#include <algorithm>

namespace quadrig::gltf {
namespace {

/// The node at the top of each node's tree.
std::vector<std::size_t> tops_of(const NodeTree& tree) {
  std::vector<std::size_t> top(tree.nodes.size());
  for (const std::size_t node : tree.order) {
    const std::size_t parent = tree.nodes[node].parent;
    top[node] = parent == Node::no_node ? node : top[parent];
  }
  return top;
}

/// Numbers of nodes in a list of the file; those that are none are passed over.
std::vector<std::size_t> listed(const Json& list, std::size_t nodes) {
  std::vector<std::size_t> result;
  for (const Json& one : list)
    if (const auto number = whole(one); number && *number < nodes) result.push_back(*number);
  return result;
}

/// Of the joints, in their order.
std::vector<std::size_t> roots_of(const State& state, const std::vector<std::size_t>& top, std::size_t skin) {
  std::vector<std::size_t> roots;
  std::vector<char> known(top.size(), 0);
  for (const std::size_t joint : listed(array_of(array_of(state.json, "skins")[skin], "joints"), top.size()))
    if (!std::exchange(known[top[joint]], 1)) roots.push_back(top[joint]);
  return roots;
}

/// Scenes that show a mesh with the skin.
std::vector<std::size_t> scenes_of(const State& state, const std::vector<std::size_t>& top, std::size_t skin) {
  std::vector<char> shows(top.size(), 0);
  const Json& nodes = array_of(state.json, "nodes");
  for (std::size_t n = 0; n < nodes.size() && n < top.size(); ++n)
    if (const Json* own = member(nodes[n], "skin"); own && member(nodes[n], "mesh") && whole(*own) == skin)
      shows[top[n]] = 1;
  std::vector<std::size_t> result;
  const Json& scenes = array_of(state.json, "scenes");
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    const auto own = listed(array_of(scenes[s], "nodes"), top.size());
    if (std::any_of(own.begin(), own.end(), [&](std::size_t node) { return shows[node] != 0; })) result.push_back(s);
  }
  return result;
}

}  // namespace

Index loose_roots(const State& state, const NodeTree& tree, std::size_t skin) {
  const std::vector<std::size_t> top = tops_of(tree), roots = roots_of(state, top, skin);
  if (roots.empty()) return 0;
  if (roots.size() > 1) return static_cast<Index>(roots.size());
  for (const std::size_t s : scenes_of(state, top, skin)) {
    const auto nodes = listed(array_of(array_of(state.json, "scenes")[s], "nodes"), tree.nodes.size());
    if (std::find(nodes.begin(), nodes.end(), roots.front()) == nodes.end()) return 1;
  }
  return 0;
}

void join_roots(State& state, const NodeTree& tree, std::size_t skin) {
  const std::vector<std::size_t> top = tops_of(tree), roots = roots_of(state, top, skin),
                                 scenes = scenes_of(state, top, skin);
  if (roots.empty()) return;
  std::size_t root = roots.front();
  if (roots.size() > 1) {
    root = state.json["nodes"].size();
    LocalJson joints = object_of({{"name", "joints"}});
    joints["children"] = roots;
    state.json["nodes"].push_back(std::move(static_cast<Json&>(joints)));
    std::vector<char> joined(top.size(), 0);
    for (const std::size_t one : roots) joined[one] = 1;
    for (std::size_t s = 0; s < array_of(state.json, "scenes").size(); ++s) {
      Json& scene = state.json["scenes"][s];
      if (array_of(scene, "nodes").empty()) continue;
      LocalJson kept = Json::array();
      bool taken = false;
      for (const Json& one : scene["nodes"]) {
        const auto number = whole(one);
        if (!number || *number >= joined.size() || !joined[*number])
          kept.push_back(one);
        else if (!std::exchange(taken, true))
          kept.push_back(root);
      }
      replace(scene["nodes"], std::move(kept));
    }
  }
  for (const std::size_t s : scenes) {
    Json& nodes = state.json["scenes"][s]["nodes"];
    if (std::find(nodes.begin(), nodes.end(), Json(root)) == nodes.end()) nodes.push_back(root);
  }
  state.edited = true;
}

}  // namespace quadrig::gltf
