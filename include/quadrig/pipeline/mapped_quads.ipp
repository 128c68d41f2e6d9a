#pragma once

#include "quadrig/pipeline/mapped_quads.hpp"

namespace quadrig::detail {

QUADRIG_INLINE Expected<MadeQuads> MapQuads::run() {
  context_.progress("integers", 0.6);
  IntegerSearch search(mesh_, map_, context_);
  if (context_.cancelled()) return cancelled_error("coarse map");
  constexpr double first_share = 0.75;  // of the search; the rest is for other counts and fields
  Expected<CoarseQuads> found = integers(search, wanted_.quads, wanted_.tolerance, first_share);
  if (!found) return found.error();
  reasons.insert(reasons.end(), found->reasons.begin(), found->reasons.end());
  context_.progress("quads", 0.8);
  Expected<MadeQuads> made = quads_of(search.coarse(), *found);
  if (!made) return made;
  const auto stays_flat = [] { return map_error("coarse map: a quad stays flat or inverted in space"); };
  // Edges that are kept through a flat quad hold it flat whatever the count: another map without them is cheaper.
  if (!(made->least > sound)) flat = under_flat(made->quads);
  if (!flat.empty()) return stays_flat();
  if (Status status = vary(search, found->integers.quads, *made); !status.ok()) return status.error();
  if (!(made->least > sound)) return stays_flat();
  return made;
}

/// The faces at corners of flat quads where edges that are kept run through these.
QUADRIG_INLINE std::vector<Index> MapQuads::under_flat(const QuadMesh& quads) const {
  std::vector<Index> faces;
  if (surface_.kept.empty() || &surface_.mesh != &mesh_) return faces;
  for (Index q = 0; q < quads.quad_count(); ++q) {
    if (scaled_jacobian(quads.positions, quads.quads.row(q)) > sound && !turned_over(mesh_, quads, q)) continue;
    for (int i = 0; i < 4; ++i) faces.push_back(quads.source[at(quads.quads(q, i))].face);
  }
  const std::vector<char> near = corners_of(mesh_, faces);
  for (Index h = 0; h < mesh_.halfedge_count(); ++h)
    if (surface_.kept[at(h)] && near[at(mesh_.origin(h))]) return faces;
  return {};
}

/// \param share of the search that is left which may be spent
QUADRIG_INLINE Expected<CoarseQuads> MapQuads::integers(IntegerSearch& search, double quads, double tolerance,
                                                        double share) {
  const SpanTimer span(context_, "integers");
  const double extraction_before = search.extraction_seconds();
  Budget part =
      budget_.lend(Work::search, static_cast<std::int64_t>(share * static_cast<double>(budget_.left(Work::search))));
  Expected<CoarseQuads> found = search.find(quads, tolerance, most_quads(wanted_, map_.index4), context_, part);
  budget_.give_back(Work::search, part);
  lap(seconds.integers);
  const double extraction = search.extraction_seconds() - extraction_before;
  seconds.integers -= extraction;
  seconds.extraction += extraction;
  return found;
}

/// Where quads came out poor, counts beside the one asked for, which round otherwise, may do better.
QUADRIG_INLINE Status MapQuads::vary(IntegerSearch& search, double count, MadeQuads& made) {
  constexpr double off = 0.6, near = 0.4, share = 0.25;  // of the tolerance, of the tolerance, of the search
  for (const double beside : {-off, off}) {
    if (made.least > fine_enough || budget_.spent(Work::maps) || budget_.spent(Work::search)) return {};
    const double tolerance = wanted_.tolerance;
    const Expected<CoarseQuads> other =
        integers(search, wanted_.quads * (1 + beside * tolerance), near * tolerance, share);
    if (context_.cancelled()) return cancelled_error("coarse map");
    if (!other || other->integers.quads == count) continue;
    if (std::abs(other->integers.quads / wanted_.quads - 1) > tolerance) continue;
    Expected<MadeQuads> quads = quads_of(search.coarse(), *other);
    if (!quads) return quads.error();
    if (quads->least > made.least) made = std::move(*quads);
  }
  return {};
}

/// The quads of these integers, of the fine map or else of the coarse one, however poor.
QUADRIG_INLINE Expected<MadeQuads> MapQuads::quads_of(const CoarseMap& coarse, const CoarseQuads& found) {
  MadeQuads fine;
  if (Expected<MadeQuads> made = fine_quads(coarse, found)) {
    fine = std::move(*made);
    if (fine.least > fine_enough) return fine;
  } else if (made.error().code == ErrorCode::cancelled) {
    return made;
  } else {
    reasons.push_back(made.error().what);
  }
  Expected<MadeQuads> straight = coarse_quads(coarse, found);
  if (!straight) return straight;
  constexpr double clearly = 0.1;  // better
  if (fine.least > std::max(sound, straight->least - clearly)) return fine;
  if (fine.quads.quad_count() > 0) reasons.push_back("fine map: a quad stays flat or inverted in space");
  return straight;
}

QUADRIG_INLINE Expected<MadeQuads> MapQuads::fine_quads(const CoarseMap& coarse, const CoarseQuads& found) {
  SpanTimer span(context_, "fine map");
  Expected<FineMap> fine = fine_map(mesh_, map_, coarse, found.integers, wanted_, context_, budget_);
  span.end();
  lap(seconds.map);
  if (!fine) return fine.error();
  // The first is granted: integers are worth nothing without it.
  if (fine_maps_++ > 0) budget_.spend(Work::maps, fine->solves * std::int64_t{mesh_.face_count()});
  if (!fine->untangling_backend.empty()) untangling_backend = fine->untangling_backend;
  if (!fine->grid) return map_error(fine->defect);
  Expected<ExtractedQuads> extracted = extract_fine(mesh_, *fine->grid, found.integers.quads, context_);
  if (!extracted) return extracted.error();
  std::vector<Complex> z;
  if (options_.keep_maps)
    for (const Gaussian& p : fine->grid->corner) z.push_back(to_field(p) / static_cast<double>(fine->grid->unit));
  return on_surface(std::move(*extracted), Rung::fine_map, std::move(z));
}

QUADRIG_INLINE Expected<MadeQuads> MapQuads::coarse_quads(const CoarseMap& coarse, const CoarseQuads& found) {
  Expected<ExtractedQuads> extracted = extract_coarse(mesh_, map_, coarse, found.quads, context_);
  if (!extracted) return extracted.error();
  Expected<MadeQuads> made =
      on_surface(std::move(*extracted), Rung::coarse_map, options_.keep_maps ? map_.z : std::vector<Complex>{});
  if (!made) return made;
  // Straight lines leave more to be done than a fine map does.
  constexpr int polishes = 3;
  for (int again = 0; again < polishes && made->least > sound; ++again) polish_once(*made);
  return made;
}

QUADRIG_INLINE Expected<MadeQuads> MapQuads::on_surface(ExtractedQuads extracted, Rung rung, std::vector<Complex> z) {
  SpanTimer span(context_, "onto surface");
  for (std::size_t v = 0; v < extracted.vertices.size(); ++v) {
    if (v % 1024 == 0 && context_.cancelled()) return cancelled_error("extraction");
    extracted.vertices[v] = surface_.onto(extracted.vertices[v]);
  }
  MadeQuads made{quad_mesh(surface_.mesh, std::move(extracted)), rung, -1, std::move(z)};
  span.end();
  lap(seconds.extraction);
  polish_once(made);
  return made;
}

QUADRIG_INLINE void MapQuads::polish_once(MadeQuads& made) {
  const SpanTimer span(context_, "polish");
  PolishedQuads polished = polish(surface_.mesh, options_.polish, std::move(made.quads), context_, surface_.kept);
  made.quads = std::move(polished.mesh);
  made.least = polished.report.least_after;
  lap(seconds.polish);
}

}  // namespace quadrig::detail
