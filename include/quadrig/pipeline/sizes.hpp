// How large quads are to be: by error, by hand, and beside loops and rings.
#pragma once

#include "quadrig/constraints/gradation.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/hinge_bands.hpp"
#include "quadrig/rims/band.hpp"

namespace quadrig::detail {

/// Whether sizes are wanted other than those of the field.
[[nodiscard]] inline bool gives_sizes(const SizingOptions& sizing) {
  return sizing.density != DensitySource::field || !sizing.own_density.empty();
}

/// Edge of the quads along a loop.
[[nodiscard]] inline double edge_along(const TriangleMesh<double>& mesh, const FaceLoop& loop, const SizeField& sizes,
                                       double quads) {
  const double mean = std::sqrt(mesh.total_area() / quads);
  if (sizes.density.empty()) return mean;
  double density = 0;
  for (const Index h : loop.crossed) density += sizes.density[at(TriangleMesh<double>::face_of(h))];
  return mean / std::sqrt(density / static_cast<double>(loop.crossed.size()));
}

/// Makes the sizes of a whole asset, and the metric that they come from.
class SizeMaker {
 public:
  /// \param plane null: none \param rims all that were found \param rings beside which quads are small enough
  SizeMaker(const Asset& asset, const RemeshOptions& options, const SizingOptions& sizing, const MirrorPlane* plane,
            std::span<const RimReport> rims, std::span<const RimRings> rings, Context& context)
      : asset_(asset),
        mesh_(asset.mesh),
        options_(options),
        sizing_(sizing),
        plane_(plane),
        rims_(rims),
        rings_(rings),
        context_(context) {}

  /// Whether the curvature is that of more than the rest pose.
  [[nodiscard]] bool moves() const { return posed() && (asset_.rig || !options_.morphs.empty()); }

  /// \param kept edges that quads do not cross
  [[nodiscard]] Status operator()(const Connection<double>& connection, const std::vector<double>& omega1,
                                  const EdgeMarks& kept, SizeField& sizes, std::optional<PosedMetric>& metric) const {
    if (Status status = measure_curvature(connection, omega1, kept, sizes, metric); !status.ok()) return status;
    sizes.largest_aspect = sizing_.largest_aspect;
    sizes.density = wanted_density(omega1, metric);
    multiply_density(sizes);
    multiply_face(sizes);
    if (gives_sizes(sizing_)) make_room_for_loops(sizes);
    if (context_.cancelled()) return cancelled_error("remesh");
    if (gives_sizes(sizing_) && (sizing_.density != DensitySource::uniform || !sizing_.own_density.empty() ||
                                 by_hand() || options_.rims.face_density != 1 || !rings_.empty()))
      grade(sizes);
    if (context_.cancelled()) return cancelled_error("remesh");
    return {};
  }

 private:
  [[nodiscard]] bool posed() const { return sizing_.density == DensitySource::posed || options_.directions.posed > 0; }

  /// Where sizes or directions come from it.
  [[nodiscard]] Status measure_curvature(const Connection<double>& connection, const std::vector<double>& omega1,
                                         const EdgeMarks& kept, SizeField& sizes,
                                         std::optional<PosedMetric>& metric) const {
    const SpanTimer span(context_, "curvature");
    if (!posed() && sizing_.density != DensitySource::rest) return {};
    // How far the surface bends at a kept edge is no error of quads that end there.
    std::optional<CutOpen> open;
    if (!kept.empty()) open = cut_open(mesh_, kept);
    const TriangleMesh<double>& mesh = open ? open->mesh : mesh_;
    if (moves()) {
      Expected<PosedForms> forms = posed_forms(mesh, connection, open ? &open->parent : nullptr);
      if (!forms) return forms.error();
      sizes.forms = std::move(*forms);
    } else {
      sizes.forms = PosedForms::at_rest(mesh, connection);
    }
    PosedMetricOptions options;
    options.largest_aspect = sizing_.largest_aspect;
    options.joint_weight = sizing_.joint_weight;
    options.least_density = sizing_.least_density;
    options.largest_density = sizing_.largest_density;
    Expected<PosedMetric> made = posed_metric(mesh_, sizes.forms, omega1, options, context_);
    if (!made) return made.error();
    metric = std::move(*made);
    return {};
  }
  /// \param parent vertices of the asset that those of the mesh are, where it is cut open
  [[nodiscard]] Expected<PosedForms> posed_forms(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                                 const std::vector<Index>* parent) const {
    PosedForms::Options form_options;
    SurfaceBends bends;
    if (asset_.rig && options_.poses.empty()) {
      bends = surface_bends(asset_.rig->skeleton, asset_.rig->weights, options_.bend_degrees);
      form_options.rest_weight += bends.still;  // in these poses the surface has its rest shape
      if (bends.left_out > 0)
        context_.warn("metric", std::to_string(bends.left_out) + " bones are not bent, since there are so many");
    } else if (asset_.rig) {
      bends.poses = options_.poses;
      bends.weights = asset_.rig->weights;
      form_options.pose_weights = options_.pose_weights;
    }
    std::vector<Points<double>> morphs = options_.morphs;
    if (parent) {
      if (asset_.rig) bends.weights = rows_of(bends.weights, *parent);
      for (Points<double>& morph : morphs) morph = Points<double>(morph(*parent, Eigen::all));
    }
    form_options.morphs = morphs;
    return PosedForms::create(mesh, connection, bends.weights, bends.poses, form_options, context_);
  }

  /// A face; empty where the field's own magnitudes count.
  [[nodiscard]] std::vector<double> wanted_density(std::span<const double> omega1,
                                                   const std::optional<PosedMetric>& metric) const {
    const std::size_t m = at(mesh_.face_count());
    const std::vector<double>& own = sizing_.own_density;
    if (own.size() == m) return own;
    if (!own.empty()) return on_faces(own);
    std::vector<double> density;
    switch (sizing_.density) {
      case DensitySource::uniform:
        density.assign(m, 1.0);
        break;
      case DensitySource::blend:
        for (std::size_t f = 0; f < m; ++f) density.push_back(omega1.empty() ? 1.0 : 1 + 3 * (1 - omega1[f]));
        break;
      case DensitySource::rest:
      case DensitySource::posed:
        density = metric->density;
        break;
      case DensitySource::field:
        break;
    }
    return density;
  }

  [[nodiscard]] bool by_hand() const { return !options_.density_factors.empty() || !options_.bone_density.empty(); }

  /// The factors that the caller gives.
  void multiply_density(SizeField& sizes) const {
    if (!by_hand() || sizes.density.empty()) return;
    std::vector<double> factors = options_.density_factors;
    if (factors.size() != at(mesh_.face_count())) factors = on_faces(factors);
    if (!options_.bone_density.empty()) {
      std::vector<double> of_bone = options_.bone_density;
      if (plane_) even_factors(*plane_, of_bone);
      const std::vector<double> moved = on_faces(vertex_factors(asset_.rig->weights, of_bone));
      for (std::size_t f = 0; f < moved.size(); ++f) factors[f] *= moved[f];
    }
    for (std::size_t f = 0; f < factors.size(); ++f) sizes.density[f] *= factors[f];
  }
  /// Where the caller asks for loops at a joint by its name, its bend gets the rows that they need.
  void make_room_for_loops(SizeField& sizes) const {
    if (!asset_.rig || options_.preset != FieldPreset::standard || options_.loops.of_joints.empty()) return;
    const std::vector<Index> wanted = named_loops(asset_.rig->skeleton, options_.loops, plane_);
    for (const Hinge& hinge : find_hinges(mesh_, *asset_.rig))
      densify_bend(mesh_, hinge, wanted[at(hinge.bone)], edge_along(mesh_, hinge.loop, sizes, options_.quads),
                   sizes.density);
  }
  /// Of values a vertex the mean of the corners; 1 where there are none.
  [[nodiscard]] std::vector<double> on_faces(const std::vector<double>& of_vertex) const {
    std::vector<double> result(at(mesh_.face_count()), of_vertex.empty() ? 1.0 : 0.0);
    if (!of_vertex.empty())
      for (Index h = 0; h < mesh_.halfedge_count(); ++h) result[at(h / 3)] += of_vertex[at(mesh_.origin(h))] / 3;
    return result;
  }

  /// The face: as far about the middle of eyes and mouth as half as far again as they reach, fading to as far again.
  void multiply_face(SizeField& sizes) const {
    if (options_.rims.face_density == 1 || sizes.density.empty()) return;
    constexpr double whole = 1.5, faded = 2;
    Vector3 middle = Vector3::Zero();
    std::vector<const Rim*> features;
    for (const RimReport& rim : rims_)
      if (rim.rim.kind == RimKind::eye || rim.rim.kind == RimKind::mouth) features.push_back(&rim.rim);
    if (features.empty()) return;
    for (const Rim* rim : features) middle += rim->centre() / static_cast<double>(features.size());
    double reach = 0;
    for (const Rim* rim : features)
      for (const Vector3& p : rim->points) reach = std::max(reach, (p - middle).norm());
    for (Index f = 0; f < mesh_.face_count(); ++f) {
      const double off = (position(mesh_, SurfacePoint{f, Vector3::Constant(1.0 / 3)}) - middle).norm() / reach;
      const double share = std::clamp((faded - off) / (faded - whole), 0.0, 1.0);
      sizes.density[at(f)] *= elementary::pow(options_.rims.face_density, share);
    }
  }

  /// Sizes that quads can follow, small enough beside rims.
  void grade(SizeField& sizes) const {
    constexpr double nearly = 0.95;
    const auto graded = [&](const std::vector<double>& density) {
      return graded_density(mesh_, density, options_.quads, sizing_.gradation, context_);
    };
    if (rings_.empty()) {
      sizes.density = graded(sizes.density);
      return;
    }
    const double area = mesh_.total_area();
    double mean = 0;
    for (Index f = 0; f < mesh_.face_count(); ++f) mean += mesh_.area(f) * sizes.density[at(f)] / area;
    const ClosestPoint closest(mesh_);
    std::vector<RimBand> bands;
    for (const RimRings& ring : rings_) bands.push_back(rim_band(mesh_, closest, ring.rim, ring.reach));
    std::vector<double> factor(rings_.size(), 1.0), result;
    constexpr int rounds = 3;
    for (int round = 0; round < rounds && !context_.cancelled(); ++round) {
      std::vector<double> density = sizes.density;
      const auto wanted = [&](std::size_t k) { return area / options_.quads / (rings_[k].edge * rings_[k].edge); };
      for (std::size_t k = 0; k < bands.size(); ++k)
        for (const BandFace& beside : bands[k].faces)
          density[at(beside.face)] = std::max(density[at(beside.face)], factor[k] * wanted(k) * mean);
      result = graded(density);
      bool enough = true;
      for (std::size_t k = 0; k < bands.size(); ++k) {
        double here = 0, own = 0;
        for (const BandFace& beside : bands[k].faces) {
          here += mesh_.area(beside.face) * result[at(beside.face)];
          own += mesh_.area(beside.face);
        }
        if (!(own > 0) || here >= nearly * wanted(k) * own) continue;
        factor[k] *= wanted(k) * own / here;
        enough = false;
      }
      if (enough) break;
    }
    sizes.density = std::move(result);
  }

  const Asset& asset_;
  const TriangleMesh<double>& mesh_;
  const RemeshOptions& options_;
  const SizingOptions& sizing_;
  const MirrorPlane* plane_;
  std::span<const RimReport> rims_;
  std::span<const RimRings> rings_;
  Context& context_;
};

}  // namespace quadrig::detail
