// Edges of a surface file that quads must keep, on the mesh that was made of it.
#include "keep.hpp"

namespace quadrig::io {
namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

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

  /// Of each of these: how many edges it marked.
  Index materials() {
    return mark([&](Index h) {
      return !input_.material.empty() &&
             input_.material[at(polygon_[at(h / 3)])] != input_.material[at(polygon_[at(mesh_.twin(h) / 3)])];
    });
  }
  Index textures() {
    return mark([&](Index h) {
      const Index p = polygon_[at(h / 3)], q = polygon_[at(mesh_.twin(h) / 3)];
      if (input_.texture.empty() || p == q) return false;
      for (const Index v : {mesh_.origin(h), mesh_.target(h)}) {
        const Vector3 place = mesh_.position(v);
        if (input_.texture[corner_at(input_, p, place)] != input_.texture[corner_at(input_, q, place)]) return true;
      }
      return false;
    });
  }
  Index lines() {
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
    Index marked = 0;
    for (const Index h : there)
      if (!std::exchange(marks_[at(h)], char{1})) {
        marks_[at(mesh_.twin(h))] = 1;
        ++marked;
      }
    return marked;
  }

  [[nodiscard]] std::vector<Index> halfedges() const {
    std::vector<Index> result;
    for (std::size_t h = 0; h < marks_.size(); ++h)
      if (marks_[h]) result.push_back(static_cast<Index>(h));
    return result;
  }

 private:
  Index mark(function_ref<bool(Index)> parts) {
    Index marked = 0;
    for (Index h = 0; h < mesh_.halfedge_count(); ++h) {
      const Index g = mesh_.twin(h);
      if (g == no_index || g < h || !parts(h)) continue;
      marks_[at(h)] = marks_[at(g)] = 1;
      ++marked;
    }
    return marked;
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
  const auto tell = [&](Index found, const char* what) {
    if (found == 0) context.warn("read", path.string() + ": no " + what + ", so none are kept");
  };
  if (options.materials) tell(keeper.materials(), "borders of materials");
  if (options.textures) tell(keeper.textures(), "borders of texture islands");
  if (options.lines) tell(keeper.lines(), "lines along edges of faces");
  return keeper.halfedges();
}

}  // namespace quadrig::io
