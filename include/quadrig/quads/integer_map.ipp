#pragma once

#include "quadrig/quads/integer_map.hpp"

namespace quadrig {

QUADRIG_INLINE Status IntegerOptions::validate() const {
  const auto bad = [](std::string field, std::string what, std::string remedy) {
    return Error{ErrorCode::bad_option, std::move(what), "integers." + std::move(field), std::move(remedy)};
  };
  if (!(quads >= 1 && quads <= 1e8)) return bad("quads", "out of range", "give 1 to 1e8");
  if (!(tolerance > 0)) return bad("tolerance", "not positive", "give a fraction such as 0.05");
  if (!(most_quads >= 0)) return bad("most_quads", "negative", "give 0 or more");
  if (straightenings < 0) return bad("straightenings", "negative", "give 0 or more");
  return {};
}

QUADRIG_INLINE double most_quads(const IntegerOptions& options, const std::vector<Index>& index4) {
  if (options.most_quads > 0) return options.most_quads;
  constexpr double times = 2, a_singularity = 20;
  const auto singular = std::count_if(index4.begin(), index4.end(), [](Index i) { return i != 0; });
  return times * std::max(options.quads, a_singularity * static_cast<double>(singular + 1));
}

namespace detail {

template <class K>
[[nodiscard]] Expected<FineMap> fine_map_of(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                            const MapUnknowns<K>& unknowns, const CoarseMap& coarse,
                                            const Quantization& integers, const IntegerOptions& options,
                                            Context& context, Budget& budget) {
  const Expected<IntegerSolution<K>> solution = substitute_integers<K>(map.cut, unknowns, coarse, integers);
  if (!solution) return solution.error();
  if (context.cancelled()) return cancelled_error("fine map");
  TargetEdges scaled = map.target;
  const double factor = std::sqrt(integers.quads / target_area(map.target));
  for (Complex& d : scaled) d *= factor;
  PoissonOptions poisson;
  poisson.max_iterations = 25;  // the seamless map was valid: more seldom help
  poisson.straightenings = options.straightenings;
  poisson.solver = options.solver;
  Expected<PoissonMap<K>> solved = solve_poisson<K>(mesh, unknowns, map.index4, scaled, poisson, context,
                                                    HeldUnknowns<K>{unknowns.integer(), solution->unknown});
  if (!solved) return solved.error();
  FineMap fine;
  fine.solves = solved->report.iterations;
  MapDefects defects = std::move(solved->report.defects);
  if (!defects.valid() && !budget.spent(Work::untangling)) {
    UntangleOptions untangling;
    untangling.solver = options.solver.factory<double>();
    Expected<UntangledMap> untangled =
        untangle(mesh, map.cut, map.index4, map.aligned, scaled, untangling, std::move(solved->z), context, budget);
    if (!untangled) return untangled.error();
    fine.untangling_backend = untangled->report.backend;
    solved->z = std::move(untangled->z);
    if (untangled->report.defects.valid()) defects = {};
  }
  if (!defects.valid()) {
    fine.defect = "fine map: " + defects_text(defects);
    return fine;
  }
  Expected<GridMap> grid = fixed_point_map<K>(mesh, map.cut, *solution, solved->z);
  if (!grid) return grid.error();
  if (context.cancelled()) return cancelled_error("fine map");
  if (grid_map_exact(*grid))
    fine.grid = std::move(*grid);
  else
    fine.defect = "fine map: a triangle flips in fixed point";
  return fine;
}

}  // namespace detail

QUADRIG_INLINE Expected<FineMap> fine_map(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                          const CoarseMap& coarse, const Quantization& integers,
                                          const IntegerOptions& options, Context& context, Budget& budget) {
  return std::visit(
      [&](const auto& unknowns) {
        return detail::fine_map_of(mesh, map, unknowns, coarse, integers, options, context, budget);
      },
      map.unknowns);
}

QUADRIG_INLINE Expected<IntegerMap> integer_map(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                const IntegerOptions& options, Context& context, Budget& budget) {
  if (Status status = options.validate(); !status.ok()) return status.error();
  IntegerSearch search(mesh, map, context);
  if (context.cancelled()) return cancelled_error("coarse map");
  Expected<CoarseQuads> found =
      search.find(options.quads, options.tolerance, most_quads(options, map.index4), context, budget);
  if (!found) return found.error();
  Expected<FineMap> fine = fine_map(mesh, map, search.coarse(), found->integers, options, context, budget);
  if (!fine) return fine.error();
  return IntegerMap{search.coarse(), std::move(*found), std::move(*fine)};
}

QUADRIG_INLINE Expected<ExtractedQuads> extract_fine(const TriangleMesh<double>& mesh, const GridMap& grid,
                                                     double quads, const Context& context) {
  Expected<ExtractedQuads> extracted = extract_quads(grid, static_cast<std::size_t>(quads + 0.5));
  if (!extracted) return extracted.error();
  if (context.cancelled()) return cancelled_error("extraction");
  if (std::string defect = unlike(quad_topology(extracted->quads, static_cast<Index>(extracted->vertices.size())),
                                  SurfaceTopology(mesh));
      !defect.empty())
    return detail::map_error(std::move(defect));
  return extracted;
}

QUADRIG_INLINE Expected<ExtractedQuads> extract_coarse(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                       const CoarseMap& coarse, const ExtractedQuads& quads,
                                                       const Context& context) {
  const CoarsePlacement place(mesh, map.cut, map.z, coarse);
  ExtractedQuads placed{quads.quads, {}, quads.mesh_vertex};
  placed.vertices.reserve(quads.vertices.size());
  for (const SurfacePoint& point : quads.vertices) {
    if (placed.vertices.size() % 1024 == 0 && context.cancelled()) return cancelled_error("extraction");
    placed.vertices.push_back(place(point));
  }
  return placed;
}

QUADRIG_INLINE Expected<ExtractedQuads> extract(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                const IntegerMap& integers, const Context& context) {
  if (integers.fine.grid) return extract_fine(mesh, *integers.fine.grid, integers.found.integers.quads, context);
  return extract_coarse(mesh, map, integers.coarse, integers.found.quads, context);
}

QUADRIG_INLINE QuadMesh quad_mesh(const TriangleMesh<double>& mesh, ExtractedQuads quads) {
  QuadMesh made;
  made.quads = std::move(quads.quads);
  made.source = std::move(quads.vertices);
  made.positions.resize(static_cast<Eigen::Index>(made.source.size()), 3);
  for (std::size_t v = 0; v < made.source.size(); ++v)
    made.positions.row(static_cast<Eigen::Index>(v)) = position(mesh, made.source[v]).transpose();
  return made;
}

}  // namespace quadrig
