// Integers whose quads are a mesh like the surface.
#pragma once

#include "quadrig/quads/grid_map.hpp"
#include "quadrig/quads/topology.hpp"
#include "quadrig/seamless/seamless_map.hpp"

namespace quadrig {
namespace detail {

[[nodiscard]] inline Error map_error(std::string what) {
  return {ErrorCode::stage_failed, std::move(what), "seamless map", "ask for more quads or a smoother field"};
}

}  // namespace detail

/// Integers of a map and the quads that they make on the coarse map.
struct CoarseQuads {
  Quantization integers;
  ExtractedQuads quads;              ///< `vertices` lie in faces of the coarse map
  std::vector<std::string> reasons;  ///< why a count asked for before did not do
};

/// Searches for integers of a seamless map whose quads are a mesh like the surface. A handle, a limb or a loop that is
/// fewer than three quads around makes a quad meet itself or one of another side: then strips are added there, and
/// where that does not help, more quads asked for.
class IntegerSearch {
 public:
  /// Decimates the map. Keeps a reference to it.
  /// \pre map.valid()
  IntegerSearch(const TriangleMesh<double>& mesh, const SeamlessMap& map, const Context& context)
      : IntegerSearch(decimate_map(mesh, map.cut, map.index4, map.aligned, map.z, &context), map.index4,
                      border_vertices(mesh), SurfaceTopology(mesh)) {}
  /// \param coarse the decimated map \param index4 I4 a vertex
  IntegerSearch(CoarseMap coarse, const std::vector<Index>& index4, std::vector<char> on_border,
                const SurfaceTopology& surface)
      : map_(std::move(coarse)), index_(index4), on_border_(std::move(on_border)), surface_(surface) {}

  [[nodiscard]] const CoarseMap& coarse() const { return map_; }
  /// Spent so far on extracting quads to look at them.
  [[nodiscard]] double extraction_seconds() const { return extraction_seconds_; }

  /// \param most quads, of which more are an error
  /// \cost within the budget for the search, and for strips
  /// \fails stage_failed where there are none, or more than `most` are needed; cancelled.
  [[nodiscard]] Expected<CoarseQuads> find(double target, double tolerance, double most, Context& context,
                                           Budget& budget) {
    QuantizeOptions options;
    options.target_quads = target;
    options.tolerance = tolerance;
    std::vector<std::string> reasons;
    constexpr int counts = 12;
    for (int attempt = 0; attempt < counts; ++attempt, options.target_quads *= more) {
      Expected<Quantization> integers = quantize(map_, index_, on_border_, options, context, budget);
      if (!integers) return integers.error();
      if (context.cancelled()) return cancelled_error("coarse map");
      if (integers->quads > most)
        return detail::map_error("the map needs " + std::to_string(static_cast<Index>(integers->quads)) + " quads");
      Expected<Tried> tried = extract(std::move(*integers));
      if (!tried) return tried.error();
      if (!tried->defect.empty()) {
        reasons.push_back("integers at " + std::to_string(static_cast<Index>(tried->found.integers.quads)) +
                          " quads: " + tried->defect);
        if (Status status = widen(options.target_quads, *tried, context, budget); !status.ok()) return status.error();
      }
      if (tried->defect.empty()) {
        tried->found.reasons = std::move(reasons);
        return std::move(tried->found);
      }
    }
    return detail::map_error(reasons.back());
  }

 private:
  static constexpr double more = 1.5;  // times as many quads are asked for where the count does not do

  struct Tried {
    CoarseQuads found;
    std::string defect;
    std::vector<Index> at_defects;  // quad vertices
  };

  [[nodiscard]] static std::size_t at(Index i) { return detail::at(i); }
  [[nodiscard]] static std::vector<char> border_vertices(const TriangleMesh<double>& mesh) {
    std::vector<char> on_border;
    for (Index v = 0; v < mesh.vertex_count(); ++v) on_border.push_back(mesh.on_boundary(v));
    return on_border;
  }

  [[nodiscard]] Expected<Tried> extract(Quantization integers) {
    Stopwatch watch;
    const GridMap grid = coarse_grid_map(map_, integers);
    if (!grid_map_exact(grid)) return detail::map_error("the coarse map is not an integer-grid map");
    Expected<ExtractedQuads> quads = extract_quads(grid, static_cast<std::size_t>(integers.quads + 0.5));
    if (!quads) return quads.error();
    QuadTopology topology = quad_topology(quads->quads, static_cast<Index>(quads->vertices.size()));
    Tried tried{
        {std::move(integers), std::move(*quads), {}}, unlike(topology, surface_), std::move(topology.at_defects)};
    extraction_seconds_ += watch.seconds();
    return tried;
  }

  /// Adds strips next to defects as long as that leaves fewer, and not more quads than the next attempt asks for.
  [[nodiscard]] Status widen(double target, Tried& tried, Context& context, Budget& budget) {
    while (!tried.defect.empty() && !tried.at_defects.empty()) {
      bool fewer = false;
      for (Quantization& wider : strips_at(tried.found, tried.at_defects, target, context, budget)) {
        if (wider.quads > more * target) continue;
        if (context.cancelled()) return cancelled_error("coarse map");
        if (trials_.spent(Work::strips)) return {};
        trials_.spend(Work::strips, static_cast<std::int64_t>(wider.quads));
        Expected<Tried> next = extract(std::move(wider));
        if (!next) return next.error();
        fewer =
            next->defect.empty() || (!next->at_defects.empty() && next->at_defects.size() < tried.at_defects.size());
        if (!fewer) continue;
        tried = std::move(*next);
        break;
      }
      if (!fewer) return {};
    }
    return {};
  }

  /// Integers with a strip more through the coarse faces under the quads at these corners. \param target quads
  [[nodiscard]] std::vector<Quantization> strips_at(const CoarseQuads& from, std::span<const Index> corners,
                                                    double target, const Context& context, Budget& budget) const {
    const ExtractedQuads& quads = from.quads;
    std::vector<char> marked(quads.vertices.size(), 0), face(at(map_.face_count()), 0), vertex(on_border_.size(), 0);
    for (const Index v : corners) marked[at(v)] = 1;
    for (Eigen::Index q = 0; q < quads.quads.rows(); ++q) {
      bool near = false;
      for (int i = 0; i < 4; ++i) near = near || marked[at(quads.quads(q, i))];
      for (int i = 0; near && i < 4; ++i) {
        const Index v = quads.quads(q, i);
        face[at(quads.vertices[at(v)].face)] = 1;
        if (const Index w = quads.mesh_vertex[at(v)]; w != no_index) vertex[at(w)] = 1;
      }
    }
    std::vector<Index> faces;
    for (Index f = 0; f < map_.face_count(); ++f) {
      bool near = face[at(f)];
      for (Index h = 3 * f; h < 3 * f + 3; ++h) near = near || vertex[at(map_.origin[at(h)])];
      if (near) faces.push_back(f);
    }
    QuantizeOptions options;
    options.target_quads = target;
    return widened(map_, index_, on_border_, options, from.integers, faces, context, budget);
  }

  CoarseMap map_;
  const std::vector<Index>& index_;
  std::vector<char> on_border_;
  SurfaceTopology surface_;
  double extraction_seconds_ = 0;
  Budget trials_;  // of this map alone: strips
};

}  // namespace quadrig
