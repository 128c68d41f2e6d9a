// Names and regular expressions against the names of a file.
#include "select.hpp"

#include <regex>
#include <utility>

#include "io/scan.hpp"

namespace quadrig::gltf {
namespace {

/// A name as it was given, and as an expression where it is one.
struct Pattern {
  std::string text;
  std::optional<std::regex> expression;
  bool found = false;

  [[nodiscard]] bool matches(const std::string& name) {
    // The library's matcher recurses once a character: long names are compared only as they are.
    bool same = name == text;
    if (!same && expression && name.size() <= 500) {
      try {
        same = std::regex_match(name, *expression);
      } catch (const std::regex_error&) {
        same = false;  // too costly to decide
      }
    }
    found = found || same;
    return same;
  }
};

/// Which meshes a joint of a skin, or a node below one, has: rigid parts of a character.
std::vector<char> hung_on_joints(const State& state, std::size_t meshes) {
  const Json& nodes = array_of(state.json, "nodes");
  std::vector<char> seen(nodes.size(), 0), hung(meshes, 0);
  std::vector<std::size_t> open;
  const auto reach = [&](const Json& number) {
    const auto node = whole(number);
    if (node && *node < nodes.size() && !std::exchange(seen[*node], char{1})) open.push_back(*node);
  };
  for (const Json& skin : array_of(state.json, "skins"))
    for (const Json& joint : array_of(skin, "joints")) reach(joint);
  while (!open.empty()) {
    const Json& node = nodes[open.back()];
    open.pop_back();
    const Json* mesh = member(node, "mesh");
    if (const auto number = mesh ? whole(*mesh) : std::nullopt; number && *number < meshes) hung[*number] = 1;
    for (const Json& child : array_of(node, "children")) reach(child);
  }
  return hung;
}

}  // namespace

Expected<Selector> Selector::create(const State& state, const GltfSelection& selection,
                                    const std::vector<std::size_t>& skin_of_mesh) {
#if defined(__GLIBCXX__)
  // Time by the product of name and expression: no expression goes back over the name again and again. References to
  // groups, which need that, are no regular expressions here.
  constexpr auto matching = std::regex::ECMAScript | std::regex_constants::__polynomial;
#else
  constexpr auto matching = std::regex::ECMAScript;
#endif
  std::vector<Pattern> patterns;
  for (const std::string& text : selection.names) {
    Pattern pattern{text, {}, false};
    try {
      pattern.expression.emplace(text, matching);
    } catch (const std::regex_error&) {
      pattern.expression.reset();
    }
    patterns.push_back(std::move(pattern));
  }
  const auto named = [&](const Json& json) {
    const Json* name = member(json, "name");
    if (!name || !name->is_string()) return false;
    bool any = false;
    for (Pattern& pattern : patterns) any = pattern.matches(name->get_ref<const std::string&>()) || any;
    return any;
  };
  const auto each = [&](const char* array) {
    std::vector<char> chosen;
    for (const Json& one : array_of(state.json, array)) chosen.push_back(named(one) ? 1 : 0);
    return chosen;
  };

  Selector selector;
  selector.mesh_ = each("meshes");
  const std::size_t meshes = selector.mesh_.size();
  bool any_skinned = false;
  for (const std::size_t skin : skin_of_mesh) any_skinned = any_skinned || skin != no_skin;
  std::vector<char> in_scene(meshes, 0);
  for (const Json& node : array_of(state.json, "nodes")) {
    const Json* mesh = member(node, "mesh");
    const auto number = mesh ? whole(*mesh) : std::nullopt;
    if (!number || *number >= meshes) continue;
    in_scene[*number] = 1;
    if (!patterns.empty() && named(node)) selector.mesh_[*number] = 1;
  }
  if (patterns.empty()) {
    const std::vector<char> hung = hung_on_joints(state, meshes);
    for (std::size_t m = 0; m < meshes; ++m)
      selector.mesh_[m] =
          skin_of_mesh[m] != no_skin || (in_scene[m] && (selection.unskinned || !any_skinned || hung[m]));
    return selector;
  }
  const std::vector<char> skins = each("skins");
  for (std::size_t m = 0; m < meshes; ++m)
    if (skin_of_mesh[m] != no_skin && skins[skin_of_mesh[m]]) selector.mesh_[m] = 1;
  selector.material_ = each("materials");
  for (const Pattern& pattern : patterns)
    if (!pattern.found)
      return Error{ErrorCode::bad_option,
                   (pattern.expression ? "no mesh, node, material or skin is called "
                                       : "is no regular expression, and nothing is called ") +
                       io::shown(pattern.text),
                   state.name.string() + ": selection", "give a name of the file"};
  return selector;
}

bool Selector::has(std::size_t mesh, const Json& primitive) const {
  if (mesh_[mesh]) return true;
  const Json* material = member(primitive, "material");
  const auto number = material ? whole(*material) : std::nullopt;
  return number && *number < material_.size() && material_[*number];
}

}  // namespace quadrig::gltf
