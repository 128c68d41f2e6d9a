// The order of the repairs, the weights, and the report.
#pragma once

#include "quadrig/prepare.hpp"
#include "quadrig/prepare/flaps.hpp"
#include "quadrig/prepare/repair.ipp"

namespace quadrig {
namespace prepare_detail {

/// Clips and rescales one row. \fails bad_input beyond the tolerance, or not finite.
inline Status mend_row(std::vector<std::pair<Index, double>>& row, const std::string& where, double tolerance,
                       PrepareReport& report) {
  constexpr double rounding = 1e-6;
  double sum = 0;
  for (auto& [bone, weight] : row) {
    if (!std::isfinite(weight))
      return Error{ErrorCode::bad_input, "weight of bone " + std::to_string(bone) + " is not finite", where,
                   "give every weight a number from 0 to 1"};
    if (weight < -tolerance || weight > 1 + tolerance)
      return Error{ErrorCode::bad_input,
                   "weight " + std::to_string(weight) + " of bone " + std::to_string(bone) + " is outside [0, 1]",
                   where, "normalize the weights before"};
    if (weight < -rounding || weight > 1 + rounding) ++report.clipped_weights;
    weight = std::clamp(weight, 0.0, 1.0);
    sum += weight;
  }
  if (std::abs(sum - 1) > tolerance)
    return Error{
        ErrorCode::bad_input,
        "weights sum to " + std::to_string(sum) + ", further from 1 than the tolerance of " + std::to_string(tolerance),
        where, "normalize the weights before"};
  if (std::abs(sum - 1) > rounding) ++report.rescaled_weights;
  for (auto& entry : row) entry.second /= sum;
  return {};
}

inline std::string counted(Index count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

}  // namespace prepare_detail

QUADRIG_INLINE Status PrepareOptions::validate() const {
  const auto fail = [](const char* field, const char* remedy) {
    return Error{ErrorCode::bad_option, std::string(field) + " is out of range", "PrepareOptions", remedy};
  };
  if (!(weld_distance >= 0) || !std::isfinite(weld_distance)) return fail("weld_distance", "give a length, 0 or more");
  if (!(flat_ratio >= 0) || flat_ratio > 0.01) return fail("flat_ratio", "give a share in [0, 0.01]");
  if (!(weight_tolerance >= 0) || weight_tolerance >= 1) return fail("weight_tolerance", "give a share in [0, 1)");
  return {};
}

QUADRIG_INLINE std::vector<std::string> PrepareReport::repairs() const {
  using prepare_detail::counted;
  std::vector<std::string> lines;
  const auto add = [&](Index count, const char* one, const char* many) {
    if (count > 0) lines.push_back(counted(count, one, many));
  };
  add(welded_vertices, "doubled vertex welded", "doubled vertices welded");
  add(contracted_edges, "edge of zero length contracted", "edges of zero length contracted");
  add(degenerate_faces, "face with a repeated vertex dropped", "faces with a repeated vertex dropped");
  add(repeated_faces, "repeated or stray face dropped", "repeated or stray faces dropped");
  add(flat_faces, "face without area removed", "faces without area removed");
  add(split_edges, "edge of more than two faces cut apart", "edges of more than two faces cut apart");
  add(split_vertices, "vertex of several fans doubled", "vertices of several fans doubled");
  add(twisted_edges, "edge cut that no orientation agrees across", "edges cut that no orientation agrees across");
  add(turned_faces, "face turned over", "faces turned over");
  add(unreferenced_vertices, "vertex of no face dropped", "vertices of no face dropped");
  add(clipped_weights, "weight outside [0, 1] clipped", "weights outside [0, 1] clipped");
  add(rescaled_weights, "vertex rescaled to weights of sum 1", "vertices rescaled to weights of sum 1");
  add(merged_weights, "welded vertex got the mean of different weights",
      "welded vertices got the mean of different weights");
  return lines;
}

QUADRIG_INLINE Expected<Prepared> prepare(const PolygonMesh& input, const VertexWeights* weights,
                                          const PrepareOptions& options, Context& context) {
  using namespace prepare_detail;
  if (Status status = options.validate(); !status) return status.error();
  if (weights && weights->rows() != input.vertex_count())
    return Error{
        ErrorCode::bad_input,
        std::to_string(weights->rows()) + " rows of weights for " + std::to_string(input.vertex_count()) + " vertices",
        "weights", "give one row for each vertex of the mesh"};
  Expected<Triangulation> cut = triangulate(input);
  if (!cut) return cut.error();
  if (context.cancelled()) return cancelled_error("prepare");

  Prepared result;
  PrepareReport& report = result.report;
  report.input_vertices = input.vertex_count();
  report.input_polygons = input.polygon_count();
  for (Index i = 0; i < input.polygon_count(); ++i) report.polygons_cut += input.polygon(i).size() > 3;
  report.degenerate_faces = cut->degenerate_polygons;

  Draft work;
  work.positions = input.positions.array() + 0.0;  // −0 and 0 are one position
  work.source.resize(static_cast<std::size_t>(input.vertex_count()));
  for (std::size_t v = 0; v < work.source.size(); ++v) work.source[v] = {static_cast<Index>(v), no_index};
  work.faces.resize(static_cast<std::size_t>(cut->faces.rows()));
  for (std::size_t f = 0; f < work.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      work.faces[f][i] = cut->faces(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(i));
  work.polygon = std::move(cut->polygon);
  cut->faces.resize(0, 3);

  std::vector<char> used(work.source.size(), 0);
  for (const Index v : input.corners) used[static_cast<std::size_t>(v)] = 1;
  report.unreferenced_vertices = static_cast<Index>(std::count(used.begin(), used.end(), 0));

  // First what repeats another face: the two sides of a two-sided triangle would hide each other's open edges.
  DisjointSets alone(work.source.size());
  if (context.cancelled()) return cancelled_error("prepare");
  apply_groups(work, alone, report);
  if (context.cancelled()) return cancelled_error("prepare");
  DisjointSets welded = weld(work, options, report, context);
  if (context.cancelled()) return cancelled_error("prepare");
  apply_groups(work, welded, report);
  if (context.cancelled()) return cancelled_error("prepare");
  report.repeated_faces += Flaps(work).drop();
  make_manifold(work, options, report, context);
  for (int pass = 0; pass < 8 && !context.cancelled(); ++pass) {
    DisjointSets groups(work.source.size());
    if (!remove_flat_faces(work, options.flat_ratio, groups, report)) break;
    PrepareReport ignored;
    apply_groups(work, groups, ignored);
    make_manifold(work, options, ignored, context);
    report.components = ignored.components;
    report.closed_components = ignored.closed_components;
  }
  if (context.cancelled()) return cancelled_error("prepare");
  if (work.faces.empty())
    return Error{ErrorCode::bad_input,
                 report.input_polygons == 0
                     ? std::string("the mesh has no faces")
                     : "none of the " + std::to_string(report.input_polygons) + " faces has an area",
                 "mesh", "give a surface"};

  // Kept vertices in the order of the input, then those made here.
  std::vector<Index> number(work.source.size(), no_index);
  for (const Face& face : work.faces)
    for (const Index v : face) number[static_cast<std::size_t>(v)] = 0;
  Index count = 0;
  for (Index& v : number)
    if (v != no_index) v = count++;
  Points<double> positions(count, 3);
  result.source_vertex.resize(static_cast<std::size_t>(count));
  std::vector<std::array<Index, 2>> sources(static_cast<std::size_t>(count));
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] == no_index) continue;
    const auto at = static_cast<std::size_t>(number[v]);
    positions.row(number[v]) = work.positions.row(static_cast<Eigen::Index>(v));
    sources[at] = work.source[v];
    result.source_vertex[at] = work.source[v][0];
  }
  Triangles faces(static_cast<Eigen::Index>(work.faces.size()), 3);
  for (std::size_t f = 0; f < work.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      faces(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(i)) =
          number[static_cast<std::size_t>(work.faces[f][i])];
  result.source_polygon = std::move(work.polygon);

  if (context.cancelled()) return cancelled_error("prepare");
  if (weights) {
    // Rows of the welded group of each kept vertex are averaged.
    std::vector<std::vector<Index>> others(static_cast<std::size_t>(input.vertex_count()));
    for (Index v = 0; v < input.vertex_count(); ++v)
      if (used[static_cast<std::size_t>(v)] && welded.find(v) != v)
        others[static_cast<std::size_t>(welded.find(v))].push_back(v);
    std::vector<Eigen::Triplet<double, Index>> entries;
    entries.reserve(static_cast<std::size_t>(weights->nonZeros()));
    std::vector<std::pair<Index, double>> row, total;
    std::vector<char> told(static_cast<std::size_t>(input.vertex_count()), 0);
    for (Index v = 0; v < count; ++v) {
      if (v % 4096 == 0 && context.cancelled()) return cancelled_error("prepare");
      total.clear();
      double members = 0;
      for (const Index source : sources[static_cast<std::size_t>(v)]) {
        if (source == no_index) continue;
        const std::vector<Index>& more = others[static_cast<std::size_t>(source)];
        bool differ = false;
        std::vector<std::pair<Index, double>> first;
        for (std::size_t k = 0; k <= more.size(); ++k) {
          const Index from = k == 0 ? source : more[k - 1];
          row.clear();
          for (VertexWeights::InnerIterator it(*weights, from); it; ++it)
            if (it.value() != 0) row.emplace_back(static_cast<Index>(it.col()), it.value());
          PrepareReport ignored;
          PrepareReport& counts = std::exchange(told[static_cast<std::size_t>(from)], 1) ? ignored : report;
          if (Status status =
                  mend_row(row, "weights of vertex " + std::to_string(from), options.weight_tolerance, counts);
              !status)
            return status.error();
          if (k == 0) first = row;
          differ = differ || row != first;
          total.insert(total.end(), row.begin(), row.end());
          members += 1;
        }
        if (differ) ++report.merged_weights;
      }
      std::sort(total.begin(), total.end());
      for (std::size_t i = 0; i < total.size();) {
        double sum = 0;
        const Index bone = total[i].first;
        for (; i < total.size() && total[i].first == bone; ++i) sum += total[i].second;
        if (sum > 0) entries.emplace_back(v, bone, sum / members);
      }
    }
    if (context.cancelled()) return cancelled_error("prepare");
    result.weights.emplace(count, weights->cols());
    result.weights->setFromTriplets(entries.begin(), entries.end());
  }

  if (context.cancelled()) return cancelled_error("prepare");
  Expected<TriangleMesh<double>> mesh = TriangleMesh<double>::create(std::move(positions), std::move(faces));
  if (!mesh) {
    Error error = mesh.error();
    error.remedy = "this mesh could not be mended; remove the place named";
    return error;
  }
  result.mesh = std::move(*mesh);
  if (context.cancelled()) return cancelled_error("prepare");
  const std::vector<std::string> repairs = report.repairs();
  if (options.strict && !repairs.empty())
    return Error{ErrorCode::bad_input, "the input needs repair: " + repairs.front(), "mesh",
                 "mend the file, or leave out the strict option"};
  for (const std::string& line : repairs) context.warn("prepare", line);
  const Index unwelded = report.doubled_vertices - report.welded_vertices;
  if (options.weld_distance == 0 && unwelded > 0)
    context.warn("prepare", counted(unwelded, "doubled vertex left as it is", "doubled vertices left as they are"));
  return result;
}

}  // namespace quadrig
