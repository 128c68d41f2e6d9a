// From a seamless map to the best quads of it on the surface: integers, fine map, extraction, polish.
#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/quads/integer_map.hpp"

namespace quadrig::detail {

/// No alternative is tried above this least scaled Jacobian.
inline constexpr double fine_enough = 0.3;
/// Below this the coarse map is better than the fine one, and another field better than either.
inline constexpr double sound = 0.05;

/// Quads, and how even they are.
struct MadeQuads {
  QuadMesh quads;
  Rung rung = Rung::fine_map;
  double least = -1;       ///< scaled Jacobian
  std::vector<Complex> z;  ///< of the map that they are of, where RemeshOptions::keep_maps asks for it
};

/// Where quads go: the triangles of the map, or the surface that these stand for.
struct QuadSurface {
  const TriangleMesh<double>& mesh;
  const EdgeMarks& kept;
  function_ref<SurfacePoint(const SurfacePoint&)> onto;  ///< from the mesh of the map to `mesh`
};

/// One map through all that may become of it. What it took stands in the members, also where it failed.
class MapQuads {
 public:
  MapQuads(const TriangleMesh<double>& mesh, const SeamlessMap& map, const QuadSurface& surface, double quads,
           const RemeshOptions& options, Context& context, Budget& budget)
      : mesh_(mesh), map_(map), surface_(surface), options_(options), context_(context), budget_(budget) {
    wanted_.quads = quads;
    wanted_.tolerance = options.count_tolerance;
    wanted_.solver = options.solver;
  }

  /// \fails stage_failed where there are no integers, or a quad stays flat or inverted in space; cancelled.
  [[nodiscard]] Expected<MadeQuads> run();

  StageSeconds seconds;
  std::string untangling_backend;
  std::vector<std::string> reasons;  ///< why earlier counts and rungs were left
  std::vector<Index> flat;           ///< faces of the map's mesh under quads that stay flat, where that was the end

 private:
  [[nodiscard]] Expected<CoarseQuads> integers(IntegerSearch& search, double quads, double tolerance, double share);
  [[nodiscard]] Expected<MadeQuads> quads_of(const CoarseMap& coarse, const CoarseQuads& found);
  [[nodiscard]] Expected<MadeQuads> fine_quads(const CoarseMap& coarse, const CoarseQuads& found);
  [[nodiscard]] Expected<MadeQuads> coarse_quads(const CoarseMap& coarse, const CoarseQuads& found);
  [[nodiscard]] Status vary(IntegerSearch& search, double count, MadeQuads& made);
  [[nodiscard]] Expected<MadeQuads> on_surface(ExtractedQuads extracted, Rung rung, std::vector<Complex> z);
  void polish_once(MadeQuads& made);
  [[nodiscard]] std::vector<Index> under_flat(const QuadMesh& quads) const;
  void lap(double& into) {
    into += watch_.seconds();
    watch_ = {};
  }

  const TriangleMesh<double>& mesh_;
  const SeamlessMap& map_;
  const QuadSurface& surface_;
  const RemeshOptions& options_;
  Context& context_;
  Budget& budget_;
  IntegerOptions wanted_;
  int fine_maps_ = 0;
  Stopwatch watch_;
};

}  // namespace quadrig::detail
