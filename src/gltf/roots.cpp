// Roots of joints, and the scenes that have them.
#include "roots.hpp"

#include <algorithm>

namespace quadrig::gltf {
namespace {

std::size_t top_of(const NodeTree& tree, std::size_t node) {
  while (tree.nodes[node].parent != Node::no_node) node = tree.nodes[node].parent;
  return node;
}

/// Numbers of nodes in a list of the file; those that are none are passed over.
std::vector<std::size_t> listed(const Json& list, std::size_t nodes) {
  std::vector<std::size_t> result;
  for (const Json& one : list)
    if (const auto number = whole(one); number && *number < nodes) result.push_back(*number);
  return result;
}

std::vector<std::size_t> roots_of(const State& state, const NodeTree& tree, std::size_t skin) {
  std::vector<std::size_t> roots;
  for (const std::size_t joint : listed(array_of(array_of(state.json, "skins")[skin], "joints"), tree.nodes.size()))
    if (const std::size_t top = top_of(tree, joint); std::find(roots.begin(), roots.end(), top) == roots.end())
      roots.push_back(top);
  return roots;
}

/// Scenes that show a mesh with the skin.
std::vector<std::size_t> scenes_of(const State& state, const NodeTree& tree, std::size_t skin) {
  std::vector<std::size_t> tops, result;
  const Json& nodes = array_of(state.json, "nodes");
  for (std::size_t n = 0; n < nodes.size() && n < tree.nodes.size(); ++n)
    if (const Json* own = member(nodes[n], "skin"); own && member(nodes[n], "mesh") && whole(*own) == skin)
      tops.push_back(top_of(tree, n));
  const Json& scenes = array_of(state.json, "scenes");
  for (std::size_t s = 0; s < scenes.size(); ++s)
    for (const std::size_t node : listed(array_of(scenes[s], "nodes"), tree.nodes.size()))
      if (std::find(tops.begin(), tops.end(), node) != tops.end()) {
        result.push_back(s);
        break;
      }
  return result;
}

}  // namespace

Index loose_roots(const State& state, const NodeTree& tree, std::size_t skin) {
  const std::vector<std::size_t> roots = roots_of(state, tree, skin);
  if (roots.size() > 1) return static_cast<Index>(roots.size());
  for (const std::size_t s : scenes_of(state, tree, skin)) {
    const auto nodes = listed(array_of(array_of(state.json, "scenes")[s], "nodes"), tree.nodes.size());
    if (std::find(nodes.begin(), nodes.end(), roots.front()) == nodes.end()) return 1;
  }
  return 0;
}

void join_roots(State& state, const NodeTree& tree, std::size_t skin) {
  std::vector<std::size_t> roots = roots_of(state, tree, skin);
  const std::vector<std::size_t> scenes = scenes_of(state, tree, skin);
  std::size_t root = roots.front();
  if (roots.size() > 1) {
    root = state.json["nodes"].size();
    state.json["nodes"].push_back({{"name", "joints"}, {"children", roots}});
    for (Json& scene : state.json["scenes"]) {
      if (array_of(scene, "nodes").empty()) continue;
      Json kept = Json::array();
      bool taken = false;
      for (const Json& one : scene["nodes"]) {
        const auto number = whole(one);
        if (!number || std::find(roots.begin(), roots.end(), *number) == roots.end())
          kept.push_back(one);
        else if (!std::exchange(taken, true))
          kept.push_back(root);
      }
      scene["nodes"] = std::move(kept);
    }
  }
  for (const std::size_t s : scenes) {
    Json& nodes = state.json["scenes"][s]["nodes"];
    if (std::find(nodes.begin(), nodes.end(), Json(root)) == nodes.end()) nodes.push_back(root);
  }
  state.edited = true;
}

}  // namespace quadrig::gltf
