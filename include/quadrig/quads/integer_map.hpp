// The arrows from a seamless map to its integers, and from these to quads.
#pragma once

#include "quadrig/quads/integer_search.hpp"
#include "quadrig/quads/place.hpp"

namespace quadrig {

struct IntegerOptions {
  double quads = 2000;      ///< wanted
  double tolerance = 0.05;  ///< of the count
  double most_quads = 0;    ///< an error beyond it; 0: twice `quads`, or 40 a singularity where that is more
  int straightenings = 3;   ///< solves of the fine map in which lengths give way to directions
  SolverChoice solver{};

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate() const;
};

/// The fine map with given integers.
struct FineMap {
  std::optional<GridMap> grid;  ///< none where it keeps a defect
  std::string defect;           ///< which, in words
  int solves = 0;
  std::string untangling_backend;  ///< what solved, in words; empty where nothing was untangled
};

/// Integers of a seamless map, and what can be made of them.
struct IntegerMap {
  CoarseMap coarse;
  CoarseQuads found;  ///< the integers, and their quads on the coarse map, which are a mesh like the surface
  FineMap fine;
};

/// What `options.most_quads` stands for on a map with these cones.
[[nodiscard]] QUADRIG_INLINE double most_quads(const IntegerOptions& options, const std::vector<Index>& index4);

/// The Poisson solve with integers held, in exact fixed point.
/// \cost one analysis and about a dozen factorizations, at most 25
/// \fails stage_failed where the integers contradict the map; as the backend; cancelled. Defects are no failure.
[[nodiscard]] QUADRIG_INLINE Expected<FineMap> fine_map(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                        const CoarseMap& coarse, const Quantization& integers,
                                                        const IntegerOptions& options, Context& context,
                                                        Budget& budget);

/// Integers for a seamless map such that its quads are a mesh like the surface, about `options.quads` of them, and the
/// map that has them. The map need not be scaled to a count.
/// \pre map.valid(), `mesh` is its mesh
/// \cost the decimation, about O(m log m); the search, on a few hundred triangles; fine_map
/// \fails bad_option; stage_failed where no such integers were found; as fine_map; cancelled.
/// Source: Campen et al. 2015, Bommer et al. 2013 for the setting; docs/map.md for the search.
[[nodiscard]] QUADRIG_INLINE Expected<IntegerMap> integer_map(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                              const IntegerOptions& options, Context& context,
                                                              Budget& budget);
/// The same with the budget of the mesh.
[[nodiscard]] inline Expected<IntegerMap> integer_map(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                      const IntegerOptions& options, Context& context) {
  Budget budget(mesh.face_count());
  return integer_map(mesh, map, options, context, budget);
}

/// Quads of a fine map, their vertices on `mesh`.
/// \param quads how many there are: Quantization::quads
/// \fails stage_failed where they are no mesh like the surface; cancelled.
[[nodiscard]] QUADRIG_INLINE Expected<ExtractedQuads> extract_fine(const TriangleMesh<double>& mesh,
                                                                   const GridMap& grid, double quads,
                                                                   const Context& context);
/// Quads of the coarse map, their vertices carried to `mesh` by straight lines of the seamless map. Always there, less
/// even than those of a fine map.
/// \fails cancelled
[[nodiscard]] QUADRIG_INLINE Expected<ExtractedQuads> extract_coarse(const TriangleMesh<double>& mesh,
                                                                     const SeamlessMap& map, const CoarseMap& coarse,
                                                                     const ExtractedQuads& quads,
                                                                     const Context& context);

/// The quads of an integer map, a mesh like the surface, with each vertex a point of `mesh`: of the fine map where
/// there is one, else of the coarse map. \fails as extract_fine and extract_coarse
[[nodiscard]] QUADRIG_INLINE Expected<ExtractedQuads> extract(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                              const IntegerMap& integers, const Context& context);

/// As a mesh in space.
[[nodiscard]] QUADRIG_INLINE QuadMesh quad_mesh(const TriangleMesh<double>& mesh, ExtractedQuads quads);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quads/integer_map.ipp"
#endif
