// Edges of a surface file that quads must keep, on the mesh that was made of it.
#include "keep.hpp"

#include "quadrig/constraints/features.hpp"

namespace quadrig::io {
namespace {

using detail::at;

/// The corner of the polygon that is nearest to a vertex of the mesh: welding may have moved it.
std::size_t corner_at(const PolygonMesh& input, Index polygon, const Vector3& p) {
  const std::span<const Index> corners = input.polygon(polygon);
  std::size_t nearest = 0;
  const auto squared = [&](std::size_t k) { return (input.positions.row(corners[k]).transpose() - p).squaredNorm(); };
  for (std::size_t k = 1; k < corners.size(); ++k)
    if (squared(k) < squared(nearest)) nearest = k;
  return at(input.first_corner[at(polygon)]) + nearest;
}

class Keeper {
 public:
  Keeper(const PolygonMesh& input, const TriangleMesh<double>& mesh, const std::vector<Index>& source_polygon)
      : input_(input), mesh_(mesh), polygon_(source_polygon), marks_(at(mesh.halfedge_count()), 0) {}

  /// Each of these: whether it marked any.
  bool materials() {
    if (input_.material.empty()) return false;
    std::vector<Index> material;
    for (const Index polygon : polygon_) material.push_back(input_.material[at(polygon)]);
    return mark(label_borders(mesh_, std::span<const Index>(material)));
  }
  bool textures() {
    if (input_.texture.empty()) return false;
    std::vector<Index> borders;
    for (const Index h : label_borders(mesh_, std::span<const Index>(polygon_))) {
      const Index p = polygon_[at(h / 3)], q = polygon_[at(mesh_.twin(h) / 3)];
      for (const Index v : {mesh_.origin(h), mesh_.target(h)}) {
        const Vector3 place = mesh_.position(v);
        if (input_.texture[corner_at(input_, p, place)] == input_.texture[corner_at(input_, q, place)]) continue;
        borders.push_back(h);
        break;
      }
    }
    return mark(borders);
  }
  bool lines() {
    // Vertices of the mesh by place: those that were welded have one, those that were cut apart several.
    std::vector<Index> order(at(mesh_.vertex_count()));
    for (std::size_t v = 0; v < order.size(); ++v) order[v] = static_cast<Index>(v);
    const auto place = [](const Points<double>& points, Index v) {
      return std::array{points(v, 0), points(v, 1), points(v, 2)};
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return place(mesh_.positions(), a) < place(mesh_.positions(), b); });
    std::vector<Index> there;
    for (const std::array<Index, 2>& line : input_.lines)
      for (const bool turned : {false, true}) {
        const auto p = place(input_.positions, line[turned ? 1 : 0]), q = place(input_.positions, line[turned ? 0 : 1]);
        auto k = std::lower_bound(order.begin(), order.end(), p,
                                  [&](Index v, const auto& key) { return place(mesh_.positions(), v) < key; });
        for (; k != order.end() && place(mesh_.positions(), *k) == p; ++k) {
          Index h = mesh_.outgoing(*k);
          const Index start = h;
          while (h != no_index) {
            if (place(mesh_.positions(), mesh_.target(h)) == q && mesh_.twin(h) != no_index) there.push_back(h);
            h = mesh_.next_around(h);
            if (h == start) break;
          }
        }
      }
    return mark(there);
  }

  [[nodiscard]] std::vector<Index> halfedges() const {
    std::vector<Index> result;
    for (std::size_t h = 0; h < marks_.size(); ++h)
      if (marks_[h]) result.push_back(static_cast<Index>(h));
    return result;
  }

 private:
  /// Marks the edges of these half-edges; whether there are any.
  bool mark(std::span<const Index> halfedges) {
    for (const Index h : halfedges) marks_[at(h)] = marks_[at(mesh_.twin(h))] = 1;
    return !halfedges.empty();
  }

  const PolygonMesh& input_;
  const TriangleMesh<double>& mesh_;
  const std::vector<Index>& polygon_;
  std::vector<char> marks_;
};

}  // namespace

std::vector<Index> kept_halfedges(const PolygonMesh& input, const TriangleMesh<double>& mesh,
                                  const std::vector<Index>& source_polygon, const KeepOptions& options,
                                  const std::filesystem::path& path, Context& context) {
  Keeper keeper(input, mesh, source_polygon);
  const auto tell = [&](bool found, const char* what) {
    if (!found) context.warn("read", path.string() + ": no " + what + ", so none are kept");
  };
  if (options.materials) tell(keeper.materials(), "borders of materials");
  if (options.textures) tell(keeper.textures(), "borders of texture islands");
  if (options.lines) tell(keeper.lines(), "lines along edges of faces");
  return keeper.halfedges();
}

}  // namespace quadrig::io
