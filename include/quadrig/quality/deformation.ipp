// Definitions of quality/deformation.hpp.
#pragma once

#include <numbers>

#include "quadrig/quality/deformation.hpp"
#include "quadrig/quality/statistics.hpp"

namespace quadrig {

QUADRIG_INLINE Status DeformationOptions::validate() const {
  if (samples < 1) return Error{ErrorCode::bad_option, "less than 1", "samples", "give 1 or more"};
  if (!(joint_blending >= 0)) return Error{ErrorCode::bad_option, "negative", "joint_blending", "give 0 or more"};
  if (!(bent_blending >= 0)) return Error{ErrorCode::bad_option, "negative", "bent_blending", "give 0 or more"};
  return {};
}

QUADRIG_INLINE Expected<SkinWeights> closest_weights(const TriangleMesh<double>& surface, const SkinWeights& weights,
                                                     const Points<double>& points) {
  const ClosestPoint tree(surface);
  std::vector<SurfacePoint> places;
  places.reserve(static_cast<std::size_t>(points.rows()));
  for (Eigen::Index k = 0; k < points.rows(); ++k) places.push_back(tree.closest(points.row(k).transpose()));
  return transfer_weights(surface, weights, places, std::max<Index>(1, static_cast<Index>(weights.cols())));
}

namespace detail {

/// What a set of samples adds up to.
struct DeviationSums {
  double squares = 0, degrees = 0, rest_squares = 0;
  double count = 0;
  void add(double distance, double angle, double rest_distance) {
    squares += distance * distance;
    degrees += angle;
    rest_squares += rest_distance * rest_distance;
    ++count;
  }
  void add(const DeviationSums& other) {
    squares += other.squares;
    degrees += other.degrees;
    rest_squares += other.rest_squares;
    count += other.count;
  }
  [[nodiscard]] double rms() const { return count > 0 ? std::sqrt(squares / count) : 0; }
  [[nodiscard]] double rest_rms() const { return count > 0 ? std::sqrt(rest_squares / count) : 0; }
  [[nodiscard]] double mean_degrees() const { return count > 0 ? degrees / count : 0; }
};

/// Linear combination of the rows of a face's corners: the weights at samples of a surface.
inline SkinWeights weights_at(const SkinWeights& weights, const Triangles& faces,
                              std::span<const SurfacePoint> points) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t k = 0; k < points.size(); ++k)
    for (int i = 0; i < 3; ++i)
      for (SkinWeights::InnerIterator it(weights, faces(points[k].face, i)); it; ++it)
        entries.emplace_back(static_cast<Index>(k), static_cast<Index>(it.col()),
                             points[k].barycentric[i] * it.value());
  SkinWeights result(static_cast<Index>(points.size()), weights.cols());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

inline Vector3 triangle_normal(const Points<double>& positions, const Triangles& faces, Index f) {
  const Vector3 a = positions.row(faces(f, 0)).transpose(), b = positions.row(faces(f, 1)).transpose();
  const Vector3 n = (b - a).cross(Vector3(positions.row(faces(f, 2)).transpose()) - a);
  return n / std::max(n.norm(), 1e-30);
}

/// Six times the volume that triangles enclose, by Gauss's theorem. \pre closed
inline double enclosed(const Points<double>& positions, const Triangles& faces) {
  double sum = 0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f)
    sum +=
        positions.row(faces(f, 0))
            .transpose()
            .dot(
                Vector3(positions.row(faces(f, 1)).transpose()).cross(Vector3(positions.row(faces(f, 2)).transpose())));
  return sum;
}
inline bool is_closed(const Triangles& faces) {
  std::vector<std::array<Index, 2>> sides;
  for (Eigen::Index f = 0; f < faces.rows(); ++f)
    for (int i = 0; i < 3; ++i) {
      const Index a = faces(f, i), b = faces(f, (i + 1) % 3);
      sides.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(sides.begin(), sides.end());
  for (std::size_t k = 0; k < sides.size(); k += 2)
    if (k + 1 == sides.size() || sides[k] != sides[k + 1]) return false;
  return true;
}

}  // namespace detail

QUADRIG_INLINE Expected<DeformationFigures> deformation_error(const TriangleMesh<double>& input,
                                                              const SkinWeights& weights, const PolygonMesh& coarse,
                                                              const SkinWeights& coarse_weights,
                                                              std::span<const Pose> poses,
                                                              const DeformationOptions& options, Context& context) {
  if (const Status valid = options.validate(); !valid) return valid.error();
  const auto misfit = [](std::string what, std::string where) {
    return Error{ErrorCode::bad_input, std::move(what), std::move(where),
                 "give surfaces, weights and poses of one rig"};
  };
  if (poses.empty()) return misfit("no pose to compare in", "poses");
  if (weights.rows() != input.vertex_count()) return misfit("not one row a vertex", "weights of the input");
  if (coarse_weights.rows() != coarse.vertex_count())
    return misfit("not one row a vertex", "weights of the coarse mesh");
  if (coarse_weights.cols() != weights.cols()) return misfit("another number of bones", "weights of the coarse mesh");
  for (std::size_t p = 0; p < poses.size(); ++p)
    if (static_cast<Eigen::Index>(poses[p].size()) != weights.cols())
      return misfit("another number of bones", "pose " + std::to_string(p));

  const Subdivision* smooth = options.subdivision;
  if (smooth && smooth->stencils.cols() != coarse.vertex_count())
    return misfit("stencils of another number of vertices", "subdivision");
  const auto drawn = [&](Points<double> cage) {
    return smooth ? Points<double>(smooth->stencils * cage) : std::move(cage);
  };
  const Triangles faces =
      smooth ? fan_triangles(to_polygons(QuadMesh{coarse.positions, smooth->quads, {}})) : fan_triangles(coarse);
  const std::vector<SurfacePoint> there = sample_surface(drawn(coarse.positions), faces, options.samples, options.seed);
  const std::vector<SurfacePoint> back =
      sample_surface(input.positions(), input.faces(), options.samples, options.seed + 1);
  if (there.empty() || back.empty()) return misfit("a surface has no area", "deformation error");
  const auto count = static_cast<std::size_t>(options.samples);
  const double unit = 1e4 / input.diagonal();
  const SkinWeights sample_weights =
      detail::weights_at(smooth ? SkinWeights(smooth->stencils * coarse_weights) : coarse_weights, faces, there);
  std::vector<char> at_joint(count);
  for (std::size_t k = 0; k < count; ++k) {
    double most = 0;
    for (SkinWeights::InnerIterator it(sample_weights, static_cast<Index>(k)); it; ++it)
      most = std::max(most, it.value());
    at_joint[k] = 1 - most > options.joint_blending;
  }

  struct PoseFigures {
    detail::DeviationSums joints, all, bent, back;
    std::vector<float> distance, back_distance;
    double volume = 0, flipped = 0, jacobian_sum = 0, jacobian_minimum = 1, jacobian_negative = 0, quads = 0;
  };
  std::vector<double> rest_distance(count, 0);
  const bool closed = detail::is_closed(input.faces()) && detail::is_closed(faces);
  // Pose, compare, and take the distances at rest from the first run, which is the rest pose itself.
  const auto compare = [&](const Pose* pose) {
    PoseFigures figures;
    const Points<double> fine = pose ? skin(input.positions(), weights, *pose, options.skinning) : input.positions();
    const Points<double> cage =
        pose ? skin(coarse.positions, coarse_weights, *pose, options.skinning) : coarse.positions;
    const Points<double> posed = drawn(cage);
    const Eigen::VectorXd blend = pose ? blending(sample_weights, *pose) : Eigen::VectorXd::Zero(options.samples);
    const ClosestPoint fine_tree(fine, input.faces()), posed_tree(posed, faces);
    const Points<double> from = positions_at(posed, faces, there), from_back = positions_at(fine, input.faces(), back);
    if (closed) figures.volume = detail::enclosed(posed, faces) / detail::enclosed(fine, input.faces()) - 1;
    figures.distance.resize(count);
    figures.back_distance.resize(count);
    for (std::size_t k = 0; k < count; ++k) {
      if (k % 1024 == 0 && context.cancelled()) return figures;
      const auto row = static_cast<Eigen::Index>(k);
      const Vector3 p = from.row(row).transpose();
      const SurfaceHit hit = fine_tree.closest(p);
      const Vector3 fine_normal = detail::triangle_normal(fine, input.faces(), hit.face);
      const double cosine = detail::triangle_normal(posed, faces, there[k].face).dot(fine_normal);
      const double distance = unit * std::abs((p - hit.position).dot(fine_normal));
      const double degrees = elementary::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
      figures.distance[k] = static_cast<float>(distance);
      if (!pose) rest_distance[k] = distance;
      figures.all.add(distance, degrees, rest_distance[k]);
      if (at_joint[k]) figures.joints.add(distance, degrees, rest_distance[k]);
      if (blend[row] > options.bent_blending) figures.bent.add(distance, degrees, rest_distance[k]);
      figures.flipped += degrees > 90;

      const Vector3 q = from_back.row(row).transpose();
      const SurfaceHit answer = posed_tree.closest(q);
      const double gap = unit * std::abs((q - answer.position).dot(detail::triangle_normal(posed, faces, answer.face)));
      figures.back_distance[k] = static_cast<float>(gap);
      figures.back.add(gap, 0, 0);
    }
    for (Index f = 0; f < coarse.polygon_count(); ++f) {
      const auto polygon = coarse.polygon(f);
      if (polygon.size() != 4) continue;
      const double jacobian = scaled_jacobian(cage, {polygon[0], polygon[1], polygon[2], polygon[3]});
      ++figures.quads;
      figures.jacobian_sum += jacobian;
      figures.jacobian_minimum = std::min(figures.jacobian_minimum, jacobian);
      figures.jacobian_negative += jacobian < 0;
    }
    return figures;
  };
  const PoseFigures rest = compare(nullptr);
  std::vector<PoseFigures> of_pose(poses.size());
  context.parallel_for(poses.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end && !context.cancelled(); ++p) of_pose[p] = compare(&poses[p]);
  });
  if (context.cancelled()) return cancelled_error("deformation error");

  DeformationFigures result;
  PoseFigures sum;
  std::vector<float> at_joints;
  for (PoseFigures& own : of_pose) {
    sum.joints.add(own.joints);
    sum.all.add(own.all);
    sum.bent.add(own.bent);
    sum.back.add(own.back);
    sum.flipped += own.flipped;
    sum.quads += own.quads;
    if (std::abs(own.volume) > std::abs(sum.volume)) sum.volume = own.volume;
    sum.jacobian_sum += own.jacobian_sum;
    sum.jacobian_negative += own.jacobian_negative;
    sum.jacobian_minimum = std::min(sum.jacobian_minimum, own.jacobian_minimum);
    for (std::size_t k = 0; k < count; ++k)
      if (at_joint[k]) at_joints.push_back(own.distance[k]);
    sum.distance.insert(sum.distance.end(), own.distance.begin(), own.distance.end());
    sum.back_distance.insert(sum.back_distance.end(), own.back_distance.begin(), own.back_distance.end());
    own = {};
  }
  result.joints = {sum.joints.rms(), quantile(std::move(at_joints), 0.99), sum.joints.mean_degrees()};
  result.all = {sum.all.rms(), quantile(std::move(sum.distance), 0.99), sum.all.mean_degrees()};
  result.back_rms = sum.back.rms();
  result.back_p99 = quantile(std::move(sum.back_distance), 0.99);
  result.rest_joints_rms = rest.joints.rms();
  result.rest_all_rms = rest.all.rms();
  result.bent_rms = sum.bent.rms();
  result.bent_rest_rms = sum.bent.rest_rms();
  result.bent_normal_degrees = sum.bent.mean_degrees();
  result.rest_volume = rest.volume;
  result.posed_volume = sum.volume;
  result.flipped = sum.flipped / sum.all.count;
  if (sum.quads > 0) {
    result.scaled_jacobian_average = sum.jacobian_sum / sum.quads;
    result.scaled_jacobian_minimum = sum.jacobian_minimum;
    result.scaled_jacobian_negative = sum.jacobian_negative / sum.quads;
  }
  return result;
}

}  // namespace quadrig
