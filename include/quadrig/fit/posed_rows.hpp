// Where the poses and morph targets of a motion take the samples of a surface: rows of the fit.
#pragma once

#include "quadrig/fit.hpp"
#include "quadrig/fit/placed_samples.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig::detail {

/// One row of the least squares: where a pose takes a sample, by the plane of the surface there.
struct PosedRow {
  Index pose = 0;                 ///< a morph target is a pose after the others
  double weight = 0, offset = 0;  ///< offset: normal · position
  Vector3 normal;
};

/// The transform of a row of weights.
[[nodiscard]] inline Eigen::Matrix<double, 3, 4> blended(const SkinWeights& weights, Index row, const Pose& pose) {
  Eigen::Matrix<double, 3, 4> sum = Eigen::Matrix<double, 3, 4>::Zero();
  for (SkinWeights::InnerIterator it(weights, row); it; ++it)
    sum += it.value() * pose[at(static_cast<Index>(it.col()))].matrix().topRows<3>();
  return sum;
}

class PosedRows {
 public:
  /// \param weights of the cage's vertices, read where the motion has weights
  PosedRows(const TriangleMesh<double>& surface, const FitMotion& motion, const FitBasis& basis,
            const PlacedSamples& samples, const SkinWeights& weights, Context& context)
      : surface_(surface), motion_(motion), basis_(basis), samples_(samples), weights_(weights), context_(context) {
    collect();
  }

  [[nodiscard]] std::size_t poses() const { return motion_.weights ? motion_.poses.size() : 0; }
  [[nodiscard]] std::size_t morphs() const { return motion_.morphs.size(); }
  [[nodiscard]] std::span<const PosedRow> of(std::size_t sample) const {
    return std::span(rows_).subspan(first_[sample], first_[sample + 1] - first_[sample]);
  }
  /// Of a sample: the weight of its rest pose and of the poses that move it as one body.
  [[nodiscard]] double rest_share(std::size_t sample) const { return rest_share_[sample]; }

 private:
  /// The poses that bend each quad, or the surface below it: of those every sample has a row of its own; the others
  /// move it as one body, and count as its rest pose once more.
  void collect() {
    const std::size_t all = poses() + morphs();
    double total = motion_.rest_weight;
    std::vector<double> pose_weight(all, 1.0);
    for (std::size_t p = 0; p < all; ++p) {
      if (p < poses() && !motion_.pose_weights.empty()) pose_weight[p] = motion_.pose_weights[p];
      total += pose_weight[p];
    }
    rest_share_.assign(samples_.size(), 1.0);
    first_.assign(samples_.size() + 1, 0);
    if (all == 0) return;
    const std::vector<std::vector<Index>> bending = bending_poses();
    std::size_t rows = 0;
    for (std::size_t s = 0; s < samples_.size(); ++s)
      if (samples_.placed(s)) rows += bending[at(samples_.quad(s))].size();
    // Where very many bones share everything, each sample sees every few poses, its neighbours the others.
    constexpr std::size_t most_rows = 2'000'000;
    const std::size_t stride = rows / most_rows + 1;
    std::vector<std::vector<std::size_t>> of_pose(all);
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      first_[s + 1] = first_[s];
      if (!samples_.placed(s)) continue;
      const std::vector<Index>& own = bending[at(samples_.quad(s))];
      double bent = 0;
      for (const Index p : own) bent += pose_weight[at(p)];
      rest_share_[s] = (total - bent) / total;
      double seen = 0;
      const std::size_t begin = rows_.size();
      for (std::size_t k = s % stride; k < own.size(); k += stride) {
        of_pose[at(own[k])].push_back(rows_.size());
        rows_.push_back({own[k], pose_weight[at(own[k])], 0, Vector3::Zero()});
        sample_of_.push_back(s);
        seen += pose_weight[at(own[k])];
      }
      for (std::size_t k = begin; k < rows_.size(); ++k) rows_[k].weight *= seen > 0 ? bent / (seen * total) : 0;
      first_[s + 1] = rows_.size();
    }
    for (std::size_t p = 0; p < all; ++p) {
      if (context_.cancelled()) return;
      place_rows(static_cast<Index>(p), of_pose[p]);
    }
  }

  /// Of each quad the poses that move its vertices or the surface below it in more than one way.
  [[nodiscard]] std::vector<std::vector<Index>> bending_poses() const {
    std::vector<std::vector<Index>> groups;
    for (std::size_t p = 0; p < poses(); ++p) groups.push_back(rigid_groups(motion_.poses[p]));
    std::vector<std::vector<Index>> bending(at(basis_.quad_count()));
    context_.parallel_for(bending.size(), 64, [&](std::size_t begin, std::size_t end) {
      std::vector<Index> bones, faces;
      for (std::size_t q = begin; q < end; ++q) {
        if (q % 64 == 0 && context_.cancelled()) return;
        const auto quad = static_cast<Index>(q);
        faces.clear();
        for (const std::size_t s : samples_.on(quad))
          if (const Index face = samples_.point(s).face; faces.empty() || faces.back() != face) faces.push_back(face);
        bones.clear();
        const auto note = [&](const SkinWeights& weights, Index row) {
          constexpr double counts = 1e-3;
          for (SkinWeights::InnerIterator it(weights, row); it; ++it)
            if (it.value() > counts) bones.push_back(static_cast<Index>(it.col()));
        };
        if (poses() > 0) {
          for (const Index v : basis_.patch(quad)) note(weights_, v);
          for (const Index face : faces)
            for (int i = 0; i < 3; ++i) note(*motion_.weights, surface_.faces()(face, i));
        }
        std::sort(bones.begin(), bones.end());
        bones.erase(std::unique(bones.begin(), bones.end()), bones.end());
        for (std::size_t p = 0; p < poses(); ++p)
          if (std::any_of(bones.begin(), bones.end(),
                          [&](Index b) { return groups[p][at(b)] != groups[p][at(bones.front())]; }))
            bending[q].push_back(static_cast<Index>(p));
        for (std::size_t k = 0; k < morphs(); ++k)
          if (std::any_of(faces.begin(), faces.end(), [&](Index face) { return shears(motion_.morphs[k], face); }))
            bending[q].push_back(static_cast<Index>(poses() + k));
      }
    });
    return bending;
  }
  /// Whether a morph moves the corners of a face apart from each other.
  [[nodiscard]] bool shears(const Points<double>& morph, Index face) const {
    constexpr double still = 1e-3;  // of an edge
    for (int i = 0; i < 3; ++i) {
      const Index a = surface_.faces()(face, i), b = surface_.faces()(face, (i + 1) % 3);
      if ((morph.row(a) - morph.row(b)).norm() > still * (surface_.position(a) - surface_.position(b)).norm())
        return true;
    }
    return false;
  }

  /// Where one pose takes the samples of its rows.
  void place_rows(Index pose, const std::vector<std::size_t>& rows) {
    std::vector<Index> vertices;
    for (const std::size_t row : rows)
      for (int i = 0; i < 3; ++i) vertices.push_back(surface_.faces()(samples_.point(sample_of_[row]).face, i));
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    posed_.resize(surface_.vertex_count(), 3);
    context_.parallel_for(vertices.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const Index v = vertices[k];
        const Vector3 p = surface_.position(v);
        if (at(pose) < poses())
          posed_.row(v) = (blended(*motion_.weights, v, motion_.poses[at(pose)]) * p.homogeneous()).transpose();
        else
          posed_.row(v) = p.transpose() + motion_.morphs[at(pose) - poses()].row(v);
      }
    });
    context_.parallel_for(rows.size(), 2048, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        PosedRow& row = rows_[rows[k]];
        const SurfacePoint& point = samples_.point(sample_of_[rows[k]]);
        const auto corner = [&](int i) { return Vector3(posed_.row(surface_.faces()(point.face, i)).transpose()); };
        const Vector3 a = corner(0), b = corner(1), c = corner(2), n = (b - a).cross(c - a);
        const double length = n.norm();
        if (!(length > 0)) {
          row.weight = 0;  // a face that the pose collapses
          continue;
        }
        row.normal = n / length;
        row.offset = row.normal.dot(point.barycentric[0] * a + point.barycentric[1] * b + point.barycentric[2] * c);
      }
    });
  }

  const TriangleMesh<double>& surface_;
  const FitMotion& motion_;
  const FitBasis& basis_;
  const PlacedSamples& samples_;
  const SkinWeights& weights_;
  Context& context_;
  std::vector<PosedRow> rows_;  // of the samples, one after the other
  std::vector<std::size_t> first_, sample_of_;
  Points<double> posed_;  // vertices of the surface, in the pose at hand
  std::vector<double> rest_share_;
};

}  // namespace quadrig::detail
