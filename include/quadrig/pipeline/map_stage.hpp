// From a field with sizes to quads on one component: seamless map, integers, fine map, extraction, polish.
#pragma once

#include "quadrig/pipeline/coarse_quads.hpp"
#include "quadrig/seamless/target.hpp"
#include "quadrig/seamless/untangle.hpp"

namespace quadrig::detail {

/// Quads of a greater least scaled Jacobian than this are not tried to be bettered on another way.
inline constexpr double fine_enough = 0.3;

/// Solves in which lengths give way to directions. Of the seamless map few: its sizes decide how many quads go where.
inline constexpr int seamless_straightenings = 1, fine_straightenings = 3;

/// What may still be spent on one component, counted so that it is the same on every machine. Several times
/// what any surface of the corpus needs that comes out well.
struct WorkLeft {
  std::int64_t integers = 16'000'000;   ///< nodes searched: quantize
  std::int64_t untangling = 2'000'000;  ///< triangles times steps: untangle
  std::int64_t mapping = 0;             ///< triangles times solves of seamless maps, of one attempt
};

/// What the map of one component starts from.
struct MapInput {
  const TriangleMesh<double>& mesh;
  const Connection<double>& connection;
  const CutGraph& cut;
  const std::vector<Index>& index;
  const std::vector<Aligned>& aligned;
  const TargetEdges& target;
  double quads = 0;
  const TriangleMesh<double>& surface;                   ///< where the quads go: `mesh`, or what it stands for
  const EdgeMarks& kept;                                 ///< of `surface`
  function_ref<SurfacePoint(const SurfacePoint&)> onto;  ///< from `mesh` to `surface`
  WorkLeft& left;
};

struct MapOutput {
  QuadMesh quads;
  Rung rung = Rung::fine_map;
  double least = 0;  ///< scaled Jacobian
  std::vector<std::string> reasons;
};

inline double map_area(const std::vector<Complex>& z) {
  double area = 0;
  for (std::size_t h = 0; h + 2 < z.size(); h += 3) area += cross(z[h + 1] - z[h], z[h + 2] - z[h]) / 2;
  return area;
}

inline std::string count_of(Index n, const char* what) { return std::to_string(n) + " " + what + (n == 1 ? "" : "s"); }

/// \param trouble faces at which no valid map was found, where that was the reason
template <class K>
[[nodiscard]] Expected<MapOutput> map_stage(const MapInput& in, const RemeshOptions& options, StageSeconds& seconds,
                                            StageBackends& backends, std::vector<Index>& trouble, Context& context) {
  const TriangleMesh<double>& mesh = in.mesh;
  MapOutput out;
  Stopwatch watch;
  const auto lap = [&](double& into) {
    into += watch.seconds();
    watch = {};
  };
  const SurfaceTopology topology(mesh);

  const auto singular = std::count_if(in.index.begin(), in.index.end(), [](Index i) { return i != 0; });
  Expected<MapUnknowns<K>> unknowns = MapUnknowns<K>::create(mesh, in.cut, in.index, in.aligned, &context);
  if (!unknowns) return unknowns.error();
  if (context.cancelled()) return cancelled_error("seamless map");

  // A valid seamless map, the sizes bending ever further to integrability.
  std::vector<K> x;
  std::vector<Complex> z;
  TargetEdges target;
  bool valid = false;
  struct Scaling {
    double fidelity, largest;
  };
  struct Tried {
    TargetEdges target;
    std::vector<Complex> z;
    Index defects;
  };
  std::vector<Tried> candidates;
  for (const auto& [fidelity, largest] : {Scaling{64, 4}, Scaling{4, 4}, Scaling{0.1, 64}}) {
    if (!candidates.empty() && in.left.mapping <= 0) break;
    target = in.target;
    LogScaleOptions scales;
    scales.fidelity = fidelity;
    scales.largest = largest;
    scales.solver = options.solver.factory<double>();
    Expected<LogScaleReport> scaled = correct_log_scale(mesh, in.cut, in.index, scales, target, context);
    if (!scaled) return scaled.error();
    backends.target = scaled->backend;
    PoissonOptions poisson;
    poisson.max_iterations = static_cast<int>(std::clamp<std::int64_t>(in.left.mapping / mesh.face_count(), 8, 20));
    poisson.straightenings = seamless_straightenings;
    poisson.solver = options.solver;
    Expected<PoissonReport> solved = solve_poisson<K>(mesh, *unknowns, in.index, target, poisson, x, z, context);
    if (!solved) return solved.error();
    backends.map = solved->backend;
    in.left.mapping -= (solved->iterations + std::int64_t{2}) * mesh.face_count();  // two for the sizes
    valid = solved->defects.valid();
    if (valid) break;
    const Index defects = solved->defects.flips + solved->defects.wrong_cones;
    candidates.push_back({target, z, defects});
    trouble = solved->defects.flipped_faces;
    for (const Index v : solved->defects.wrong_vertices) trouble.push_back(mesh.outgoing(v) / 3);
    out.reasons.push_back("seamless map at fidelity " + std::to_string(fidelity).substr(0, 4) + ": " +
                          count_of(solved->defects.flips, "flipped triangle") + ", " +
                          count_of(solved->defects.wrong_cones, "wrong cone"));
    // Noise, not a tangle that other sizes or a few moves would undo.
    if (defects > std::max<Index>(300, mesh.face_count() / 50)) {
      candidates.clear();
      break;
    }
  }
  UntangleOptions untangling;
  untangling.solver = options.solver.factory<double>();
  // The nearest to valid first.
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Tried& a, const Tried& b) { return a.defects < b.defects; });
  bool hopeless = false;
  for (std::size_t k = 0; k < candidates.size() && !valid && !hopeless && in.left.untangling > 0; ++k) {
    target = std::move(candidates[k].target);
    z = std::move(candidates[k].z);
    untangling.most = in.left.untangling;
    Expected<UntangleReport> untangled = untangle(mesh, in.cut, in.index, in.aligned, target, untangling, z, context);
    if (!untangled) return untangled.error();
    in.left.untangling -= untangled->work;
    hopeless = untangled->hopeless;
    backends.untangling = untangled->backend;
    valid = untangled->defects.valid();
  }
  lap(seconds.map);
  if (!valid) return map_error(out.reasons.back());
  trouble.clear();

  if (context.cancelled()) return cancelled_error("coarse map");
  const double scale = std::sqrt(in.quads / map_area(z));
  for (Complex& p : z) p *= scale;
  const CoarseMap coarse = decimate_map(mesh, in.cut, in.index, in.aligned, z, &context);
  if (context.cancelled()) return cancelled_error("coarse map");
  std::vector<char> on_border(at(mesh.vertex_count()));
  for (Index v = 0; v < mesh.vertex_count(); ++v) on_border[at(v)] = mesh.on_boundary(v);

  const double extraction_before = seconds.extraction;
  Expected<CoarseQuads> found = CoarseQuadsSearch(coarse, in.index, on_border, topology, seconds)
                                    .find(in.quads, options.count_tolerance, in.left.integers, out.reasons, context);
  lap(seconds.integers);
  seconds.integers -= seconds.extraction - extraction_before;
  if (!found) return found.error();
  const Quantization& integers = found->integers;
  if (integers.quads > 2 * std::max(in.quads, 20.0 * static_cast<double>(singular + 1)))
    return map_error("the map needs " + std::to_string(static_cast<Index>(integers.quads)) + " quads");

  constexpr double sound = 0.05;  // least scaled Jacobian: below it, another way is better
  const auto polished = [&](QuadMesh quads) {
    const PolishReport report = polish(in.surface, options.polish, quads, context, in.kept);
    lap(seconds.polish);
    return std::pair{std::move(quads), report};
  };
  const auto fine_quads = [&]() -> Expected<QuadMesh> {
    Expected<IntegerSolution<K>> solution = substitute_integers<K>(in.cut, *unknowns, coarse, integers);
    if (!solution) return solution.error();
    if (context.cancelled()) return cancelled_error("fine map");
    TargetEdges scaled = target;
    const double factor = std::sqrt(integers.quads / target_area(target));
    for (Complex& d : scaled) d *= factor;
    x = solution->unknown;
    PoissonOptions poisson;
    poisson.max_iterations = 25;
    poisson.straightenings = fine_straightenings;
    poisson.solver = options.solver;
    poisson.fixed = unknowns->integer();
    std::vector<Complex> fine;
    Expected<PoissonReport> solved = solve_poisson<K>(mesh, *unknowns, in.index, scaled, poisson, x, fine, context);
    if (!solved) return solved.error();
    if (!solved->defects.valid() && in.left.untangling > 0) {
      untangling.most = in.left.untangling;
      Expected<UntangleReport> untangled =
          untangle(mesh, in.cut, in.index, in.aligned, scaled, untangling, fine, context);
      if (!untangled) return untangled.error();
      in.left.untangling -= untangled->work;
      backends.untangling = untangled->backend;
      if (untangled->defects.valid()) solved->defects = {};
    }
    lap(seconds.map);
    if (!solved->defects.valid())
      return map_error("fine map: " + count_of(solved->defects.flips, "flipped triangle") + ", " +
                       count_of(solved->defects.wrong_cones, "wrong cone"));
    Expected<GridMap> grid = fixed_point_map<K>(mesh, in.cut, *solution, fine);
    if (!grid) return grid.error();
    if (context.cancelled()) return cancelled_error("fine map");
    if (!grid_map_exact(*grid)) return map_error("fine map: a triangle flips in fixed point");
    Expected<ExtractedQuads> extracted = extract_quads(*grid, static_cast<std::size_t>(integers.quads + 0.5));
    if (!extracted) return extracted.error();
    if (context.cancelled()) return cancelled_error("extraction");
    if (std::string defect =
            unlike(quad_topology(extracted->quads, static_cast<Index>(extracted->vertices.size())), topology);
        !defect.empty())
      return map_error(std::move(defect));
    Expected<QuadMesh> quads = placed_quads(in.surface, std::move(*extracted), in.onto, context);
    lap(seconds.extraction);
    return quads;
  }();
  std::optional<std::pair<QuadMesh, PolishReport>> fine;
  if (fine_quads) {
    fine = polished(std::move(*fine_quads));
    if (fine->second.least_after > fine_enough) {
      out.quads = std::move(fine->first);
      out.least = fine->second.least_after;
      return out;
    }
  } else if (fine_quads.error().code == ErrorCode::cancelled) {
    return fine_quads.error();
  } else {
    out.reasons.push_back(fine_quads.error().what);
  }
  const CoarsePlacement place(mesh, in.cut, z, coarse);
  const auto on_surface = [&](const SurfacePoint& p) { return in.onto(place(p)); };
  Expected<QuadMesh> coarse_quads = placed_quads(in.surface, std::move(found->quads), on_surface, context);
  if (!coarse_quads) return coarse_quads.error();
  lap(seconds.extraction);
  auto [quads, report] = polished(std::move(*coarse_quads));
  // Straight lines leave more to be done than a fine map does.
  for (int again = 0; again < 3 && report.least_after > sound; ++again)
    std::tie(quads, report) = polished(std::move(quads));
  if (fine && fine->second.least_after > std::max(sound, report.least_after - 0.1)) {
    out.quads = std::move(fine->first);
    out.least = fine->second.least_after;
    return out;
  }
  if (fine) out.reasons.push_back("fine map: a quad stays flat or inverted in space");
  out.rung = Rung::coarse_map;
  if (!(report.least_after > sound)) return map_error("coarse map: a quad stays flat or inverted in space");
  out.quads = std::move(quads);
  out.least = report.least_after;
  return out;
}

}  // namespace quadrig::detail
