// The way from a surface to split quads: refine, simplify, pair, split, place.
#pragma once

#include "quadrig/simplify.hpp"
#include "quadrig/simplify/decimate.hpp"
#include "quadrig/simplify/pair.hpp"
#include "quadrig/simplify/place.hpp"
#include "quadrig/simplify/refined.hpp"

namespace quadrig {
namespace detail {

/// Faces that a walk as long as a quad's edge may cross, on average: each as wide as it is across its longest side.
inline double faces_crossed(const TriangleMesh<double>& mesh, const QuadMesh& quads) {
  double sum = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Index v = quads.quads(q, i), w = quads.quads(q, (i + 1) % 4);
      const Index f = quads.source[static_cast<std::size_t>(v)].face;
      double longest = 0;
      for (Index h = 3 * f; h < 3 * f + 3; ++h) longest = std::max(longest, mesh.edge_vector(h).norm());
      const double length = (quads.positions.row(w) - quads.positions.row(v)).norm();
      sum += std::min(1e6, length * longest / std::max(2 * mesh.area(f), 1e-300));
    }
  return sum / (4.0 * std::max<Index>(quads.quad_count(), 1));
}

/// Polishes while that improves the quads. Where a quad would lose its positive scaled Jacobian, or nearly so, its
/// vertices go back to where they were, then those of the quads that this spoils, at worst to the beginning.
inline void polish_split(const TriangleMesh<double>& mesh, const PolishOptions& options, QuadMesh& quads,
                         Context& context) {
  if (faces_crossed(mesh, quads) > 100) return;  // nothing but needles: every step would take a walk over them all
  for (int done = 0, chunk = 1; done < options.rounds && !context.cancelled(); done += chunk, chunk = 5) {
    std::vector<double> before(static_cast<std::size_t>(quads.quad_count()));
    for (Index q = 0; q < quads.quad_count(); ++q)
      before[static_cast<std::size_t>(q)] = scaled_jacobian(quads.positions, quads.quads.row(q));
    PolishOptions some = options;
    some.rounds = std::min(chunk, options.rounds - done);
    auto [better, report] = polish(mesh, some, quads, context);
    // On slivers the rectangles that polishing aims at may be out of reach.
    if (!(report.average_after > report.average_before - 0.02)) return;
    for (bool again = true; again;) {
      again = false;
      for (Index q = 0; q < quads.quad_count(); ++q) {
        const double now = scaled_jacobian(better.positions, better.quads.row(q));
        if (now > 0 && now >= std::min(0.01, 0.5 * before[static_cast<std::size_t>(q)])) continue;
        for (int i = 0; i < 4; ++i) {
          const Index v = quads.quads(q, i);
          if (better.positions.row(v) == quads.positions.row(v)) continue;
          better.positions.row(v) = quads.positions.row(v);
          better.source[static_cast<std::size_t>(v)] = quads.source[static_cast<std::size_t>(v)];
          again = true;
        }
      }
    }
    quads = std::move(better);
    if (report.average_after < report.average_before + 0.0005 && report.least_after < report.least_before + 0.01)
      return;
  }
}

}  // namespace detail

QUADRIG_INLINE Status SplitOptions::validate() const {
  const auto bad = [](const char* field, const char* remedy) {
    return Error{ErrorCode::bad_option, std::string(field) + " is out of range", "SplitOptions", remedy};
  };
  if (quads < 1) return bad("quads", "ask for 1 or more");
  if (!(uniformity >= 0) || !std::isfinite(uniformity)) return bad("uniformity", "give 0 or more");
  if (!(pair_quality > 0 && pair_quality < 1)) return bad("pair_quality", "give a number between 0 and 1");
  if (Status status = polish.validate(); !status.ok()) return status;
  return refine.validate();
}

QUADRIG_INLINE Expected<SplitQuads> split_quads(const TriangleMesh<double>& mesh, const SplitOptions& options,
                                                Context& context) {
  const Stopwatch watch;
  if (Status status = options.validate(); !status) return status.error();
  if (mesh.face_count() == 0) return Error{ErrorCode::bad_input, "the mesh has no faces", "simplify", "give a surface"};

  // Most triangles find a partner, so a triangle gives little more than two quads.
  const auto count_wanted = static_cast<double>(options.quads);
  const auto faces_wanted = static_cast<Index>(std::ceil(count_wanted / 2.15));
  Expected<std::optional<Refinement>> finer = detail::refined_to_choose(mesh, faces_wanted, options.refine, context);
  if (!finer) return finer.error();
  const std::optional<Refinement>& refined = *finer;
  const TriangleMesh<double>& fine = refined ? refined->mesh : mesh;
  std::vector<SurfacePoint> sources = refined ? refined->source : detail::vertex_points(mesh);
  std::vector<Vector3> positions(sources.size());
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (sources[v].face != no_index) positions[v] = position(mesh, sources[v]);  // else of no face

  SplitQuads result;
  SplitReport& report = result.report;
  report.refined_faces = fine.face_count();
  context.progress("simplify", 0.1);
  detail::Decimator decimator(fine, options.uniformity, std::sqrt(2 * mesh.total_area() / faces_wanted), context);
  if (Status status = decimator.reduce(faces_wanted, context); !status) return status.error();
  context.progress("simplify", 0.6);

  detail::Pairing pairing(positions, decimator.faces(), options.pair_quality);
  for (int attempt = 0; attempt < 8 && pairing.quad_count() > options.quads; ++attempt) {
    const Index before = decimator.face_count();
    const auto fewer = static_cast<Index>(before * (count_wanted / pairing.quad_count()));
    if (Status status = decimator.reduce(std::min(fewer, before - 1), context); !status) return status.error();
    if (decimator.face_count() == before) break;
    pairing = detail::Pairing(positions, decimator.faces(), options.pair_quality);
  }
  pairing.part(options.quads);
  report.triangles = decimator.face_count();
  report.pairs = pairing.pair_count();
  if (pairing.quad_count() > 1.05 * count_wanted) report.minimum_count = pairing.quad_count();
  context.progress("simplify", 0.7);

  detail::SplitPlacer placer(mesh, positions, sources, pairing.polygons());
  if (Status status = placer.run(context); !status) return status.error();
  result.mesh = placer.result();
  context.progress("simplify", 0.8);
  detail::polish_split(mesh, options.polish, result.mesh, context);
  if (context.cancelled()) return cancelled_error("simplify");
  placer.retry(result.mesh);
  result.mesh = placer.result();
  const double tolerance = 1e-9 * mesh.diagonal();
  for (Index v = 0; v < result.mesh.vertex_count(); ++v) {
    const double distance =
        (position(mesh, result.mesh.source[static_cast<std::size_t>(v)]) - result.mesh.positions.row(v).transpose())
            .norm();
    report.off_surface += distance > tolerance;
    report.largest_distance = std::max(report.largest_distance, distance);
  }
  report.least_jacobian = 1;
  for (Index q = 0; q < result.mesh.quad_count(); ++q) {
    const double j = scaled_jacobian(result.mesh.positions, result.mesh.quads.row(q));
    report.least_jacobian = std::min(report.least_jacobian, j);
    report.average_jacobian += j / result.mesh.quad_count();
  }
  report.seconds = watch.seconds();
  return result;
}

}  // namespace quadrig
