// Integers whose quads are a mesh like the surface, and these quads where the coarse map puts them.
#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/quads/grid_map.hpp"
#include "quadrig/quads/place.hpp"
#include "quadrig/quads/topology.hpp"

namespace quadrig::detail {

inline Error map_error(std::string what) {
  return {ErrorCode::stage_failed, std::move(what), "seamless map", "ask for more quads or a smoother field"};
}

/// Euler characteristic and border loops of a surface, which its quads have to have too.
struct SurfaceTopology {
  explicit SurfaceTopology(const TriangleMesh<double>& mesh) : euler(euler_characteristic(mesh)) {
    std::vector<char> seen(at(mesh.vertex_count()), 0);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      if (seen[at(v)] || !mesh.on_boundary(v)) continue;
      ++loops;
      for (Index w = v; !seen[at(w)]; w = mesh.target(mesh.outgoing(w))) seen[at(w)] = 1;
    }
  }
  Index euler, loops = 0;
};

/// Why the quads are not a mesh like the surface; empty where they are.
[[nodiscard]] inline std::string unlike(const QuadTopology& quads, const SurfaceTopology& surface) {
  if (!quads.defect.empty()) return quads.defect;
  if (quads.euler != surface.euler || quads.boundary_loops != surface.loops)
    return "the quads have another topology than the surface";
  return {};
}

/// Quads where `place` puts the corners that were extracted.
[[nodiscard]] inline Expected<QuadMesh> placed_quads(const TriangleMesh<double>& mesh, ExtractedQuads extracted,
                                                     function_ref<SurfacePoint(const SurfacePoint&)> place,
                                                     const Context& context) {
  QuadMesh quads;
  quads.quads = std::move(extracted.quads);
  quads.source = std::move(extracted.vertices);
  quads.positions.resize(static_cast<Eigen::Index>(quads.source.size()), 3);
  for (std::size_t v = 0; v < quads.source.size(); ++v) {
    if (v % 1024 == 0 && context.cancelled()) return cancelled_error("extraction");
    quads.source[v] = place(quads.source[v]);
    quads.positions.row(static_cast<Eigen::Index>(v)) = position(mesh, quads.source[v]).transpose();
  }
  return quads;
}

/// Integers of a coarse map and the quads that they make on it.
struct CoarseQuads {
  Quantization integers;
  ExtractedQuads quads;
};

/// Searches for such integers. A handle, a limb or a loop that is fewer than three quads around makes a quad meet
/// itself or one of another side: then rows are added there, and where that does not help, more quads asked for.
class CoarseQuadsSearch {
 public:
  CoarseQuadsSearch(const CoarseMap& map, const std::vector<Index>& index, const std::vector<char>& on_border,
                    const SurfaceTopology& surface, StageSeconds& seconds)
      : map_(map), index_(index), on_border_(on_border), surface_(surface), seconds_(seconds) {}

  /// \param most quads, of which more are an error
  /// \param reasons receives why the first count, or a greater one, did not do
  [[nodiscard]] Expected<CoarseQuads> find(double target, double tolerance, double most, std::int64_t& work,
                                           std::vector<std::string>& reasons, Context& context) {
    QuantizeOptions options;
    options.target_quads = target;
    options.tolerance = tolerance;
    for (int attempt = 0; attempt < 12; ++attempt, options.target_quads *= 1.5) {
      Expected<Quantization> integers = quantize(map_, index_, on_border_, options, context, &work);
      if (!integers) return integers.error();
      if (context.cancelled()) return cancelled_error("coarse map");
      if (integers->quads > most)
        return map_error("the map needs " + std::to_string(static_cast<Index>(integers->quads)) + " quads");
      Expected<Tried> tried = extract(std::move(*integers));
      if (!tried) return tried.error();
      if (!tried->defect.empty()) {
        reasons.push_back("integers at " + std::to_string(static_cast<Index>(tried->found.integers.quads)) +
                          " quads: " + tried->defect);
        if (Status status = widen(options.target_quads, *tried, work, context); !status.ok()) return status.error();
      }
      if (tried->defect.empty()) return std::move(tried->found);
    }
    return map_error(reasons.back());
  }

 private:
  struct Tried {
    CoarseQuads found;
    std::string defect;
    std::vector<Index> at_defects;  // quad vertices
  };

  [[nodiscard]] Expected<Tried> extract(Quantization integers) {
    Stopwatch watch;
    const GridMap grid = coarse_grid_map(map_, integers);
    if (!grid_map_exact(grid)) return map_error("the coarse map is not an integer-grid map");
    Expected<ExtractedQuads> quads = extract_quads(grid, static_cast<std::size_t>(integers.quads + 0.5));
    if (!quads) return quads.error();
    QuadTopology topology = quad_topology(quads->quads, static_cast<Index>(quads->vertices.size()));
    Tried tried{{std::move(integers), std::move(*quads)}, unlike(topology, surface_), std::move(topology.at_defects)};
    seconds_.extraction += watch.seconds();
    return tried;
  }

  /// Adds rows next to defects as long as that leaves fewer, and not more quads than the next attempt asks for.
  [[nodiscard]] Status widen(double target, Tried& tried, std::int64_t& work, Context& context) {
    while (!tried.defect.empty() && !tried.at_defects.empty()) {
      bool fewer = false;
      for (Quantization& wider : rows_at(tried.found, tried.at_defects, target, work, context)) {
        if (wider.quads > 1.5 * target) continue;
        if (context.cancelled()) return cancelled_error("coarse map");
        if (trials_ <= 0) return {};
        trials_ -= static_cast<std::int64_t>(wider.quads);
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

  /// Integers with a row more through the coarse faces under the quads at these corners. \param target quads
  [[nodiscard]] std::vector<Quantization> rows_at(const CoarseQuads& from, std::span<const Index> corners,
                                                  double target, std::int64_t& work, const Context& context) const {
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
    return widened(map_, index_, on_border_, options, from.integers, faces, context, work);
  }

  const CoarseMap& map_;
  const std::vector<Index>& index_;
  const std::vector<char>& on_border_;
  const SurfaceTopology& surface_;
  StageSeconds& seconds_;
  std::int64_t trials_ = 1'000'000;  // quads that may still be extracted to try rows
};

}  // namespace quadrig::detail
