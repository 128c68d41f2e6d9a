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
  double least = -1;  ///< scaled Jacobian
  std::vector<std::string> reasons;
};

inline double map_area(const std::vector<Complex>& z) {
  double area = 0;
  for (std::size_t h = 0; h + 2 < z.size(); h += 3) area += cross(z[h + 1] - z[h], z[h + 2] - z[h]) / 2;
  return area;
}

inline std::string count_of(Index n, const char* what) { return std::to_string(n) + " " + what + (n == 1 ? "" : "s"); }

/// K is double where edges are aligned, whose two parameters part, else Complex.
template <class K>
class MapStage {
 public:
  MapStage(const MapInput& in, const RemeshOptions& options, StageSeconds& seconds, StageBackends& backends)
      : in_(in), mesh_(in.mesh), options_(options), seconds_(seconds), backends_(backends), topology_(in.mesh) {
    untangling_.solver = options.solver.factory<double>();
    for (Index v = 0; v < mesh_.vertex_count(); ++v) on_border_.push_back(mesh_.on_boundary(v));
  }

  /// \param trouble faces at which no valid map was found, where that was the reason
  [[nodiscard]] Expected<MapOutput> run(std::vector<Index>& trouble, Context& context) {
    if (Status status = find_seamless(trouble, context); !status.ok()) return status.error();
    if (context.cancelled()) return cancelled_error("coarse map");
    context.progress("integers", 0.6);
    const double scale = std::sqrt(in_.quads / map_area(z_));
    for (Complex& p : z_) p *= scale;
    const CoarseMap coarse = decimate_map(mesh_, in_.cut, in_.index, in_.aligned, z_, &context);
    if (context.cancelled()) return cancelled_error("coarse map");

    CoarseQuadsSearch search(coarse, in_.index, on_border_, topology_, seconds_);
    Expected<CoarseQuads> found = integers(search, in_.quads, options_.count_tolerance, 0.75, reasons_, context);
    if (!found) return found.error();
    context.progress("quads", 0.8);
    Expected<MapOutput> made = quads_of(coarse, *found, context);
    if (!made) return made.error();
    if (Status status = vary(search, coarse, found->integers.quads, *made, context); !status.ok())
      return status.error();
    if (!(made->least > sound)) return map_error("coarse map: a quad stays flat or inverted in space");
    made->reasons = std::move(reasons_);
    return made;
  }

 private:
  static constexpr double sound = 0.05;  // least scaled Jacobian: below it, another way is better

  void lap(double& into) {
    into += watch_.seconds();
    watch_ = {};
  }

  /// A valid seamless map, the sizes bending ever further to integrability: z_ and the sizes that it has, target_.
  [[nodiscard]] Status find_seamless(std::vector<Index>& trouble, Context& context) {
    Expected<MapUnknowns<K>> unknowns = MapUnknowns<K>::create(mesh_, in_.cut, in_.index, in_.aligned, &context);
    if (!unknowns) return unknowns.error();
    unknowns_ = std::move(*unknowns);
    if (context.cancelled()) return cancelled_error("seamless map");
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
    // Sizes that few quads cannot follow cost their shape.
    const double faithful = std::clamp(in_.quads / 30, 16.0, 64.0);
    for (const auto& [fidelity, largest] : {Scaling{faithful, 4}, Scaling{4, 4}, Scaling{0.1, 64}}) {
      if (!candidates.empty() && in_.left.mapping <= 0) break;
      target_ = in_.target;
      LogScaleOptions scales;
      scales.fidelity = fidelity;
      scales.largest = largest;
      scales.solver = options_.solver.factory<double>();
      Expected<LogScaleReport> scaled = correct_log_scale(mesh_, in_.cut, in_.index, scales, target_, context);
      if (!scaled) return scaled.error();
      backends_.target = scaled->backend;
      PoissonOptions poisson;
      poisson.max_iterations = static_cast<int>(std::clamp<std::int64_t>(in_.left.mapping / mesh_.face_count(), 8, 20));
      poisson.straightenings = seamless_straightenings;
      poisson.solver = options_.solver;
      std::vector<K> x;
      Expected<PoissonReport> solved = solve_poisson<K>(mesh_, *unknowns_, in_.index, target_, poisson, x, z_, context);
      if (!solved) return solved.error();
      backends_.map = solved->backend;
      in_.left.mapping -= (solved->iterations + std::int64_t{2}) * mesh_.face_count();  // two for the sizes
      valid = solved->defects.valid();
      if (valid) break;
      const Index defects = solved->defects.flips + solved->defects.wrong_cones;
      candidates.push_back({target_, z_, defects});
      trouble = solved->defects.flipped_faces;
      for (const Index v : solved->defects.wrong_vertices) trouble.push_back(mesh_.outgoing(v) / 3);
      reasons_.push_back("seamless map at fidelity " + std::to_string(fidelity).substr(0, 4) + ": " +
                         count_of(solved->defects.flips, "flipped triangle") + ", " +
                         count_of(solved->defects.wrong_cones, "wrong cone"));
      // Noise, not a tangle that other sizes or a few moves would undo.
      if (defects > std::max<Index>(300, mesh_.face_count() / 50)) {
        candidates.clear();
        break;
      }
    }
    // The nearest to valid first.
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Tried& a, const Tried& b) { return a.defects < b.defects; });
    bool hopeless = false;
    for (std::size_t k = 0; k < candidates.size() && !valid && !hopeless && in_.left.untangling > 0; ++k) {
      target_ = std::move(candidates[k].target);
      z_ = std::move(candidates[k].z);
      Expected<UntangleReport> untangled = untangle_map(target_, z_, context);
      if (!untangled) return untangled.error();
      hopeless = untangled->hopeless;
      valid = untangled->defects.valid();
    }
    lap(seconds_.map);
    if (!valid) return map_error(reasons_.back());
    trouble.clear();
    return {};
  }

  [[nodiscard]] Expected<UntangleReport> untangle_map(const TargetEdges& target, std::vector<Complex>& z,
                                                      Context& context) {
    untangling_.most = in_.left.untangling;
    Expected<UntangleReport> untangled =
        untangle(mesh_, in_.cut, in_.index, in_.aligned, target, untangling_, z, context);
    if (!untangled) return untangled;
    in_.left.untangling -= untangled->work;
    backends_.untangling = untangled->backend;
    return untangled;
  }

  /// \param share of the work that is left which may be spent
  [[nodiscard]] Expected<CoarseQuads> integers(CoarseQuadsSearch& search, double quads, double tolerance, double share,
                                               std::vector<std::string>& reasons, Context& context) {
    const double extraction_before = seconds_.extraction;
    auto work = static_cast<std::int64_t>(share * static_cast<double>(in_.left.integers));
    in_.left.integers -= work;
    const auto singular = std::count_if(in_.index.begin(), in_.index.end(), [](Index i) { return i != 0; });
    const double most = 2 * std::max(in_.quads, 20.0 * static_cast<double>(singular + 1));
    Expected<CoarseQuads> found = search.find(quads, tolerance, most, work, reasons, context);
    in_.left.integers += work;
    lap(seconds_.integers);
    seconds_.integers -= seconds_.extraction - extraction_before;
    return found;
  }

  /// Where quads came out poor, counts beside the one asked for, which round otherwise, may do better.
  [[nodiscard]] Status vary(CoarseQuadsSearch& search, const CoarseMap& coarse, double count, MapOutput& made,
                            Context& context) {
    for (const double beside : {-0.6, 0.6}) {
      if (made.least > fine_enough || in_.left.mapping <= 0 || in_.left.integers <= 0) return {};
      const double tolerance = options_.count_tolerance;
      std::vector<std::string> reasons;
      const Expected<CoarseQuads> other =
          integers(search, in_.quads * (1 + beside * tolerance), 0.4 * tolerance, 0.25, reasons, context);
      if (context.cancelled()) return cancelled_error("coarse map");
      if (!other || other->integers.quads == count) continue;
      if (std::abs(other->integers.quads / in_.quads - 1) > tolerance) continue;
      Expected<MapOutput> quads = quads_of(coarse, *other, context);
      if (!quads) return quads.error();
      if (quads->least > made.least) made = std::move(*quads);
    }
    return {};
  }

  /// The quads of these integers, of the fine map or else of the coarse one, however poor.
  [[nodiscard]] Expected<MapOutput> quads_of(const CoarseMap& coarse, const CoarseQuads& found, Context& context) {
    MapOutput fine;
    if (Expected<QuadMesh> quads = fine_quads(coarse, found.integers, context)) {
      fine.quads = std::move(*quads);
      fine.least = polished(fine.quads, context);
      if (fine.least > fine_enough) return fine;
    } else if (quads.error().code == ErrorCode::cancelled) {
      return quads.error();
    } else {
      reasons_.push_back(quads.error().what);
    }
    const CoarsePlacement place(mesh_, in_.cut, z_, coarse);
    const auto on_surface = [&](const SurfacePoint& p) { return in_.onto(place(p)); };
    Expected<QuadMesh> quads = placed_quads(in_.surface, found.quads, on_surface, context);
    if (!quads) return quads.error();
    lap(seconds_.extraction);
    MapOutput straight{std::move(*quads), Rung::coarse_map, -1, {}};
    straight.least = polished(straight.quads, context);
    // Straight lines leave more to be done than a fine map does.
    for (int again = 0; again < 3 && straight.least > sound; ++again)
      straight.least = polished(straight.quads, context);
    if (fine.least > std::max(sound, straight.least - 0.1)) return fine;
    if (fine.quads.quad_count() > 0) reasons_.push_back("fine map: a quad stays flat or inverted in space");
    return straight;
  }

  /// Least scaled Jacobian after the polish.
  double polished(QuadMesh& quads, Context& context) {
    const double least = polish(in_.surface, options_.polish, quads, context, in_.kept).least_after;
    lap(seconds_.polish);
    return least;
  }

  [[nodiscard]] Expected<QuadMesh> fine_quads(const CoarseMap& coarse, const Quantization& integers, Context& context) {
    Expected<IntegerSolution<K>> solution = substitute_integers<K>(in_.cut, *unknowns_, coarse, integers);
    if (!solution) return solution.error();
    if (context.cancelled()) return cancelled_error("fine map");
    TargetEdges scaled = target_;
    const double factor = std::sqrt(integers.quads / target_area(target_));
    for (Complex& d : scaled) d *= factor;
    std::vector<K> x = solution->unknown;
    PoissonOptions poisson;
    poisson.max_iterations = 25;
    poisson.straightenings = fine_straightenings;
    poisson.solver = options_.solver;
    poisson.fixed = unknowns_->integer();
    std::vector<Complex> fine;
    Expected<PoissonReport> solved = solve_poisson<K>(mesh_, *unknowns_, in_.index, scaled, poisson, x, fine, context);
    if (!solved) return solved.error();
    if (fine_maps_++ > 0) in_.left.mapping -= solved->iterations * std::int64_t{mesh_.face_count()};
    if (!solved->defects.valid() && in_.left.untangling > 0) {
      Expected<UntangleReport> untangled = untangle_map(scaled, fine, context);
      if (!untangled) return untangled.error();
      if (untangled->defects.valid()) solved->defects = {};
    }
    lap(seconds_.map);
    if (!solved->defects.valid())
      return map_error("fine map: " + count_of(solved->defects.flips, "flipped triangle") + ", " +
                       count_of(solved->defects.wrong_cones, "wrong cone"));
    Expected<GridMap> grid = fixed_point_map<K>(mesh_, in_.cut, *solution, fine);
    if (!grid) return grid.error();
    if (context.cancelled()) return cancelled_error("fine map");
    if (!grid_map_exact(*grid)) return map_error("fine map: a triangle flips in fixed point");
    Expected<ExtractedQuads> extracted = extract_quads(*grid, static_cast<std::size_t>(integers.quads + 0.5));
    if (!extracted) return extracted.error();
    if (context.cancelled()) return cancelled_error("extraction");
    if (std::string defect =
            unlike(quad_topology(extracted->quads, static_cast<Index>(extracted->vertices.size())), topology_);
        !defect.empty())
      return map_error(std::move(defect));
    Expected<QuadMesh> quads = placed_quads(in_.surface, std::move(*extracted), in_.onto, context);
    lap(seconds_.extraction);
    return quads;
  }

  const MapInput& in_;
  const TriangleMesh<double>& mesh_;
  const RemeshOptions& options_;
  StageSeconds& seconds_;
  StageBackends& backends_;
  const SurfaceTopology topology_;
  std::vector<char> on_border_;
  UntangleOptions untangling_;
  std::optional<MapUnknowns<K>> unknowns_;
  TargetEdges target_;
  std::vector<Complex> z_;
  std::vector<std::string> reasons_;
  int fine_maps_ = 0;
  Stopwatch watch_;
};

}  // namespace quadrig::detail
