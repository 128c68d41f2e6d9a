#pragma once

#include "quadrig/seamless/seamless_map.hpp"

namespace quadrig {

QUADRIG_INLINE Status SeamlessOptions::validate(const TriangleMesh<double>& mesh) const {
  const auto bad = [](std::string field, std::string what, std::string remedy) {
    return Error{ErrorCode::bad_option, std::move(what), "seamless." + std::move(field), std::move(remedy)};
  };
  if (!(quads >= 0 && quads <= 1e9)) return bad("quads", "out of range", "give 0 to 1e9");
  if (straightenings < 0) return bad("straightenings", "negative", "give 0 or more");
  if (!kept.empty() && kept.size() != static_cast<std::size_t>(mesh.halfedge_count()))
    return bad("kept", "not one mark a half-edge", "give three marks a face, or none");
  return {};
}

namespace detail {

template <class K>
class SeamlessSolver {
 public:
  /// \param loops that the unknowns close
  SeamlessSolver(const TriangleMesh<double>& mesh, const MapUnknowns<K>& unknowns, const SeamlessOptions& options,
                 const DemandedLoops& loops, SeamlessMap& map, Context& context, Budget& budget)
      : mesh_(mesh),
        unknowns_(unknowns),
        options_(options),
        loops_(loops),
        map_(map),
        context_(context),
        budget_(budget) {}

  [[nodiscard]] Status run() {
    // Sizes as wanted, where need be less so, at last whatever fits together. Sizes that few quads can hardly follow
    // cost these their shape.
    const double quads = options_.quads > 0 ? options_.quads : target_area(map_.target);
    const double faithful = std::clamp(quads / 30, 16.0, 64.0);
    for (const Scaling& scaling : {Scaling{faithful, 4}, Scaling{4, 4}, Scaling{0.1, 64}}) {
      if (!candidates_.empty() && budget_.spent(Work::maps)) break;
      Expected<bool> valid = solve(scaling);
      if (!valid) return valid.error();
      if (*valid) return {};
      if (is_noise(defect_count(candidates_.back().defects), mesh_.face_count()) ||
          loops_.in_trouble(mesh_, options_.loops, map_.report.trouble)) {
        take(std::move(candidates_.back()));
        return {};
      }
      // Where other sizes mend few of the defects, a place of the field is at fault, and yet others mend none.
      constexpr double mended = 0.75;
      if (const std::size_t n = candidates_.size(); n > 1)
        if (defect_count(candidates_[n - 1].defects) > mended * defect_count(candidates_[n - 2].defects)) break;
    }
    return untangle_candidates();
  }

 private:
  struct Scaling {
    double fidelity, largest;
  };
  struct Candidate {
    TargetEdges target;
    std::vector<Complex> z;
    MapDefects defects;
  };

  void take(Candidate candidate) {
    map_.target = std::move(candidate.target);
    map_.z = std::move(candidate.z);
    map_.report.defects = std::move(candidate.defects);
  }

  /// Whether the map of these sizes is valid: then it is taken, else a candidate.
  [[nodiscard]] Expected<bool> solve(const Scaling& scaling) {
    LogScaleOptions scales;
    scales.fidelity = scaling.fidelity;
    scales.largest = scaling.largest;
    scales.solver = options_.solver.factory<double>();
    SpanTimer sizes(context_, "sizes");
    Expected<CorrectedTarget> scaled = correct_log_scale(mesh_, map_.cut, map_.index4, scales, map_.target, context_);
    if (!scaled) return scaled.error();
    sizes.end();
    SpanTimer span(context_, "solves", "fidelity " + std::to_string(scaling.fidelity).substr(0, 4));
    SeamlessReport& report = map_.report;
    report.target_backend = scaled->backend;
    PoissonOptions poisson;
    constexpr std::int64_t fewest = 8, most = 20;
    poisson.max_iterations = static_cast<int>(std::clamp(budget_.left(Work::maps) / mesh_.face_count(), fewest, most));
    poisson.straightenings = options_.straightenings;
    poisson.solver = options_.solver;
    Expected<PoissonMap<K>> solved = solve_poisson<K>(mesh_, unknowns_, map_.index4, scaled->target, poisson, context_);
    if (!solved) return solved.error();
    span.end();
    report.map_backend = solved->report.backend;
    constexpr int of_sizes = 2;  // the correction costs about as much as two solves
    budget_.spend(Work::maps, (solved->report.iterations + std::int64_t{of_sizes}) * mesh_.face_count());
    Candidate candidate{std::move(scaled->target), std::move(solved->z), std::move(solved->report.defects)};
    if (candidate.defects.valid()) {
      report.trouble.clear();
      take(std::move(candidate));
      return true;
    }
    report.trouble = candidate.defects.flipped_faces;
    for (const Index v : candidate.defects.wrong_vertices)
      report.trouble.push_back(TriangleMesh<double>::face_of(mesh_.outgoing(v)));
    report.tries.push_back("seamless map at fidelity " + std::to_string(scaling.fidelity).substr(0, 4) + ": " +
                           defects_text(candidate.defects));
    candidates_.push_back(std::move(candidate));
    return false;
  }

  /// The nearest to valid first.
  [[nodiscard]] Status untangle_candidates() {
    std::stable_sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
      return defect_count(a.defects) < defect_count(b.defects);
    });
    UntangleOptions options;
    options.solver = options_.solver.factory<double>();
    std::vector<char> tried(at(mesh_.vertex_count()), 0);  // corners of defects that were not untangled
    for (Candidate& candidate : candidates_) {
      if (budget_.spent(Work::untangling)) break;
      const auto known = [&](Index f) {
        const auto corner = [&](int i) { return tried[at(mesh_.faces()(f, i))] != 0; };
        return corner(0) || corner(1) || corner(2);
      };
      const std::vector<Index>& flipped = candidate.defects.flipped_faces;
      if (!flipped.empty() && std::ranges::all_of(flipped, known)) continue;
      const SpanTimer span(context_, "untangling");
      Expected<UntangledMap> untangled = untangle(mesh_, map_.cut, map_.index4, map_.aligned, candidate.target, options,
                                                  std::move(candidate.z), context_, budget_);
      if (!untangled) return untangled.error();
      map_.report.untangling_backend = untangled->report.backend;
      candidate.z = std::move(untangled->z);  // as it was where defects are left
      if (untangled->report.defects.valid()) {
        map_.report.trouble.clear();
        take({std::move(candidate.target), std::move(candidate.z), {}});
        return {};
      }
      if (untangled->report.hopeless) break;
      for (const Index f : flipped)
        for (int i = 0; i < 3; ++i) tried[at(mesh_.faces()(f, i))] = 1;
    }
    take(std::move(candidates_.front()));
    return {};
  }

  const TriangleMesh<double>& mesh_;
  const MapUnknowns<K>& unknowns_;
  const SeamlessOptions& options_;
  const DemandedLoops& loops_;
  SeamlessMap& map_;
  Context& context_;
  Budget& budget_;
  std::vector<Candidate> candidates_;
};

}  // namespace detail

QUADRIG_INLINE Expected<SeamlessMap> seamless_map(const TriangleMesh<double>& mesh,
                                                  const Connection<double>& connection, const FrameField& frames,
                                                  const Matching& matching, const Singularities& singularities,
                                                  const SeamlessOptions& options, Context& context, Budget& budget) {
  using detail::at;
  if (Status status = options.validate(mesh); !status.ok()) return status.error();
  const auto stopped = [&] { return context.cancelled(); };
  std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
  for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(matching.r[h] & 3);
  CutGraph cut = make_cut_graph(mesh, rotation, singularities.index4, &context);
  if (stopped()) return cancelled_error("seamless map");
  std::vector<Aligned> aligned = aligned_edges(mesh, connection, cut, matching, frames, options.kept);
  if (stopped()) return cancelled_error("seamless map");
  const TargetEdges wanted = target_edges(mesh, connection, cut, frames.u, frames.v);
  if (stopped()) return cancelled_error("seamless map");

  detail::DemandedLoops loops;
  std::vector<char> closed;
  for (const FaceLoop& loop : options.loops) {
    std::optional<LoopDemand> demand;
    if (quarter_turns(mesh, matching, loop) == 0) demand = loop_demand(mesh, cut, wanted, loop);
    closed.push_back(demand.has_value());
    if (demand) loops.add(static_cast<Index>(closed.size() - 1), std::move(*demand));
  }

  const auto solved = [&]<class K>(std::type_identity<K>) -> Expected<SeamlessMap> {
    Expected<MapUnknowns<K>> unknowns = MapUnknowns<K>::create(mesh, cut, singularities.index4, aligned, &context);
    if (!unknowns) return unknowns.error();
    if (stopped()) return cancelled_error("seamless map");
    SeamlessMap map{std::move(cut), singularities.index4, std::move(aligned), wanted, {}, std::move(*unknowns), {}};
    map.report.closed = std::move(closed);
    const auto solve = [&]<class Unknown>(const MapUnknowns<Unknown>& among) {
      map.target = wanted;
      return detail::SeamlessSolver<Unknown>(mesh, among, options, loops, map, context, budget).run();
    };
    while (!loops.demands.empty()) {
      // Integers that close the loops too need no row for it: what comes after goes by the unknowns without.
      Expected<MapUnknowns<double>> held =
          MapUnknowns<double>::create(mesh, map.cut, singularities.index4, map.aligned, &context, loops.demands);
      if (!held) return held.error();
      if (Status status = solve(*held); !status.ok()) return status.error();
      if (map.valid() || !loops.release(mesh, options.loops, map.report.trouble, map.report.closed)) return map;
    }
    if (Status status = solve(std::get<MapUnknowns<K>>(map.unknowns)); !status.ok()) return status.error();
    return map;
  };
  const bool pinned = std::any_of(aligned.begin(), aligned.end(), [](Aligned a) { return a != Aligned::none; });
  Expected<SeamlessMap> map = pinned ? solved(std::type_identity<double>{}) : solved(std::type_identity<Complex>{});
  if (!map) return map;
  const MapDefects& defects = map->report.defects;
  if (!defects.valid()) {
    if (options.accept_defects) return map;
    return Error{ErrorCode::stage_failed, detail::defects_text(defects),
                 "seamless map, " + (defects.flips > 0 ? "face " + std::to_string(defects.flipped_faces.front())
                                                       : "vertex " + std::to_string(defects.wrong_vertices.front())),
                 "ask for more quads or a smoother field"};
  }
  map->report.strain = map_strain(mesh, map->cut.rotation, wanted, map->z);
  if (options.quads > 0) {
    const double scale = std::sqrt(options.quads / map_area(map->z));
    for (Complex& p : map->z) p *= scale;
  }
  return map;
}

}  // namespace quadrig
