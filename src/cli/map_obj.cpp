#include "map_obj.hpp"

#include <map>

#include "command.hpp"

namespace quadrig::cli {
std::string map_obj_text(std::span<const ComponentMap> maps) {
  std::string text = "# quadrig map: one unit of texture coordinates a quad\n";
  Index vertices = 1, coordinates = 1;
  for (const ComponentMap& map : maps) {
    const auto at = [](Index i) { return static_cast<std::size_t>(i); };
    const TriangleMesh<double>& mesh = map.mesh;
    text += "o component_" + std::to_string(map.component) + "\n# " + std::string(rung_name(map.rung)) +
            (map.rung == Rung::fine_map ? ": an integer grid\n" : ": seamless, not rounded to integers\n");
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      text += 'v';
      put_numbers(text, mesh.position(v));
      text += '\n';
    }
    // One coordinate for all corners of a vertex that agree.
    std::vector<Index> number(at(mesh.halfedge_count()));
    std::vector<std::vector<Index>> of_vertex(at(mesh.vertex_count()));
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      std::vector<Index>& before = of_vertex[at(mesh.origin(h))];
      const auto same = std::ranges::find_if(before, [&](Index g) { return map.z[at(g)] == map.z[at(h)]; });
      if (same != before.end()) {
        number[at(h)] = number[at(*same)];
        continue;
      }
      before.push_back(h);
      number[at(h)] = coordinates++;
      text += "vt";
      put_number(text, map.z[at(h)].real());
      put_number(text, map.z[at(h)].imag());
      text += '\n';
    }
    for (Index f = 0; f < mesh.face_count(); ++f) {
      text += 'f';
      for (int i = 0; i < 3; ++i)
        text += ' ' + std::to_string(vertices + mesh.faces()(f, i)) + '/' + std::to_string(number[at(3 * f + i)]);
      text += '\n';
    }
    text += "g cut\n";
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (map.cut[at(h)] && mesh.is_representative(h))
        text +=
            "l " + std::to_string(vertices + mesh.origin(h)) + ' ' + std::to_string(vertices + mesh.target(h)) + '\n';
    std::map<std::pair<bool, Index>, std::vector<Index>> singular;
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      if (map.index4[at(v)] != 0 && mesh.outgoing(v) != no_index)
        singular[{mesh.on_boundary(v), map.index4[at(v)]}].push_back(v);
    for (const auto& [kind, here] : singular) {
      text += std::string(kind.first ? "g border_corner_quads_" : "g singular_quads_") +
              std::to_string((kind.first ? 2 : 4) - kind.second) + "\np";
      for (const Index v : here) text += ' ' + std::to_string(vertices + v);
      text += '\n';
    }
    vertices += mesh.vertex_count();
  }
  return text;
}

}  // namespace quadrig::cli
