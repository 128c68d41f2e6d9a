// Definition of find_mirror_plane.
#pragma once

#include <algorithm>
#include <functional>
#include <map>

#include <Eigen/Eigenvalues>

#include "quadrig/closest.hpp"
#include "quadrig/fit/samples.hpp"
#include "quadrig/symmetry.hpp"

namespace quadrig {
namespace detail {

/// Lengths of the search, in diagonals of the surface; shares.
struct MirrorPolicy {
  static constexpr double agrees = 1e-3, near = 2e-2;
  static constexpr double facing = 0.5;  ///< cosine of the normals of a point and of its image
  static constexpr double close = 5e-3;  ///< as a body that is slightly asymmetric
  static constexpr double least_close = 0.8, least_near_with_names = 0.6, least_near_of_axis = 0.5;
  static constexpr double least_paired = 0.6;  ///< of the bones, where the rig is to be a witness
  static constexpr double joint = 0.02;        ///< twins lie within this of each other's image
  static constexpr double samples = 1500;
  static constexpr double upright = 0.5;  ///< degrees within which the axis itself is tried
};

class MirrorSearch {
 public:
  MirrorSearch(const Asset& asset, Context& context)
      : asset_(asset),
        context_(context),
        closest_(asset.mesh),
        samples_(sample_surface(asset.mesh, MirrorPolicy::samples, MirrorPolicy::samples)),
        diagonal_(asset.mesh.diagonal()) {
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      area_ += samples_.area[s];
      centre_ += samples_.area[s] * samples_.position[s];
    }
    if (area_ > 0) centre_ /= area_;
  }

  [[nodiscard]] Expected<std::optional<MirrorPlane>> run(SymmetryChoice choice) {
    if (choice == SymmetryChoice::none || samples_.size() == 0 || !(diagonal_ > 0)) return std::optional<MirrorPlane>();
    const std::optional<MirrorPlane> of_names = choice == SymmetryChoice::automatic ? plane_of_names() : std::nullopt;
    constexpr double symmetric = 0.98;
    constexpr std::size_t worth_refining = 3;
    const auto rank = [](const MirrorPlane& p) { return p.near_share + p.share; };
    std::vector<MirrorPlane> tried;
    for (MirrorPlane candidate : candidates(choice, of_names)) {
      if (context_.cancelled()) return cancelled_error("symmetry");
      measure(candidate);
      tried.push_back(candidate);
      if (candidate.share > symmetric) break;
    }
    std::ranges::stable_sort(tried, std::ranges::greater{}, rank);
    tried.resize(std::min(tried.size(), worth_refining));
    std::optional<MirrorPlane> best;
    for (MirrorPlane& candidate : tried) {
      if (context_.cancelled()) return cancelled_error("symmetry");
      if (candidate.share < symmetric) refine(candidate);
      if (!best || rank(candidate) > rank(*best)) best = candidate;
      if (best->share > symmetric) break;
    }
    sharpen(*best);
    orient(*best);
    pair_bones(*best);
    const bool rigged = !best->twin.empty();
    const bool witnessed = !rigged || best->paired_bones >= MirrorPolicy::least_paired;
    // Names tell which sides there are: a plane that has both of a pair on one side is another's.
    const bool named = of_names.has_value();
    if (choice == SymmetryChoice::automatic && (!witnessed || (named && !names_agree(*best))))
      return std::optional<MirrorPlane>();
    const bool found = choice != SymmetryChoice::automatic ? best->near_share >= MirrorPolicy::least_near_of_axis
                       : named                             ? best->near_share >= MirrorPolicy::least_near_with_names
                                                           : close_share(*best) >= MirrorPolicy::least_close;
    if (!found) return std::optional<MirrorPlane>();
    return best;
  }

 private:
  [[nodiscard]] MirrorPlane through(const Vector3& point, const Vector3& normal) const {
    MirrorPlane plane;
    plane.normal = normal.normalized();
    plane.offset = plane.normal.dot(point);
    plane.tolerance = MirrorPolicy::agrees * diagonal_;
    return plane;
  }

  [[nodiscard]] std::vector<MirrorPlane> candidates(SymmetryChoice choice,
                                                    const std::optional<MirrorPlane>& of_names) const {
    std::vector<MirrorPlane> planes;
    const Vector3 low = asset_.mesh.positions().colwise().minCoeff().transpose(),
                  high = asset_.mesh.positions().colwise().maxCoeff().transpose();
    const Vector3 middle = (low + high) / 2;
    if (of_names) planes.push_back(*of_names);
    for (int axis = 0; axis < 3; ++axis) {
      if (choice != SymmetryChoice::automatic && axis != static_cast<int>(choice) - static_cast<int>(SymmetryChoice::x))
        continue;
      for (const Vector3& point : {Vector3(Vector3::Zero()), middle, centre_})
        planes.push_back(through(point, Vector3::Unit(axis)));
    }
    if (choice != SymmetryChoice::automatic) return planes;
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      const Vector3 d = samples_.position[s] - centre_;
      inertia += samples_.area[s] * d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(inertia);
    for (int k = 0; k < 3; ++k) planes.push_back(through(centre_, axes.eigenvectors().col(k)));
    return planes;
  }

  /// The point of the surface nearest to the image of a sample, if one within reach faces as the image does.
  [[nodiscard]] SurfaceHit image(const MirrorPlane& plane, std::size_t s, double reach) const {
    ClosestFilter filter;
    filter.maximum_distance = reach;
    filter.normal = plane.mirrored_direction(samples_.normal[s]);
    filter.minimum_cosine = MirrorPolicy::facing;
    return closest_.closest(plane.mirrored(samples_.position[s]), filter);
  }

  void measure(MirrorPlane& plane) const {
    std::vector<double> squared(samples_.size(), std::numeric_limits<double>::infinity());
    context_.parallel_for(squared.size(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s)
        if (const SurfaceHit hit = image(plane, s, 0.1 * diagonal_); hit.found()) squared[s] = hit.squared_distance;
    });
    double agree = 0, near = 0, sum = 0, found = 0;
    const double most = MirrorPolicy::near * diagonal_;
    for (std::size_t s = 0; s < squared.size(); ++s) {
      if (squared[s] <= plane.tolerance * plane.tolerance) agree += samples_.area[s];
      if (squared[s] <= most * most) near += samples_.area[s];
      if (!std::isfinite(squared[s])) continue;
      sum += samples_.area[s] * squared[s];
      found += samples_.area[s];
    }
    plane.share = agree / area_;
    plane.near_share = near / area_;
    plane.deviation = found > 0 ? std::sqrt(sum / found) : diagonal_;
  }

  /// Of the area that lies within 0.5 % of the diagonal of its image.
  [[nodiscard]] double close_share(MirrorPlane plane) const {
    plane.tolerance = MirrorPolicy::close * diagonal_;
    measure(plane);
    return plane.share;
  }

  /// The plane that takes points p to points q best: its normal is the least eigenvector of Σ w (p qᵀ + q pᵀ), both
  /// from their means.
  template <class Pairs>
  [[nodiscard]] std::optional<MirrorPlane> best_plane(const Pairs& pairs) const {
    Vector3 p = Vector3::Zero(), q = Vector3::Zero();
    double weight = 0;
    for (const auto& [a, b, w] : pairs) p += w * a, q += w * b, weight += w;
    if (!(weight > 0)) return std::nullopt;
    p /= weight;
    q /= weight;
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& [a, b, w] : pairs) {
      const Eigen::Matrix3d outer = (a - p) * (b - q).transpose();
      sum += w * (outer + outer.transpose());
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
    if (solver.info() != Eigen::Success) return std::nullopt;
    return through((p + q) / 2, solver.eigenvectors().col(0));
  }
  struct Matched {
    Vector3 a, b;
    double weight;
  };

  /// Closest points and planes in turn; what lies far from its image counts less and less. The way there is found by
  /// few of the samples, its end by all.
  void refine(MirrorPlane& plane) const {
    constexpr int rounds = 24, last_rounds = 4;
    constexpr std::size_t stride = 4;
    MirrorPlane moving = plane;
    double scale = 0.1 * diagonal_;
    settle(moving, scale, stride, rounds - last_rounds);
    settle(moving, scale, 1, last_rounds);
    measure(moving);
    if (moving.near_share + moving.share > plane.near_share + plane.share) plane = moving;
  }
  /// Until the plane stands still, by every `stride`-th sample.
  void settle(MirrorPlane& moving, double& scale, std::size_t stride, int rounds) const {
    for (int round = 0; round < rounds && !context_.cancelled(); ++round) {
      std::vector<Matched> pairs((samples_.size() + stride - 1) / stride);
      context_.parallel_for(pairs.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
          const std::size_t s = k * stride;
          pairs[k] = {Vector3::Zero(), Vector3::Zero(), 0};
          const SurfaceHit hit = image(moving, s, 3 * scale);
          if (!hit.found()) continue;
          const double off = hit.squared_distance / (scale * scale);
          pairs[k] = {samples_.position[s], hit.position, samples_.area[s] / ((1 + off) * (1 + off))};
        }
      });
      const std::optional<MirrorPlane> next = best_plane(pairs);
      if (!next) break;
      const double turn = (next->normal - moving.normal).norm(), shift = std::abs(next->offset - moving.offset);
      moving = *next;
      if (round > 0 && turn < 1e-5 && shift < 1e-5 * diagonal_) break;
      scale = std::max(0.75 * scale, 0.5 * MirrorPolicy::near * diagonal_);
    }
  }

  /// To the last digit: pairs of vertices where there are any, and the axis itself where the plane is next to one.
  void sharpen(MirrorPlane& plane) const {
    const auto take = [&](MirrorPlane other) {
      measure(other);
      if (other.share >= plane.share - 1e-3 && (other.share > plane.share || other.deviation <= plane.deviation))
        plane = other;
    };
    for (int round = 0; round < 3; ++round)
      if (const auto next = best_plane(vertex_pairs(plane))) take(*next);
    Eigen::Index axis = 0;
    plane.normal.cwiseAbs().maxCoeff(&axis);
    if (std::abs(plane.normal[axis]) < elementary::cos(MirrorPolicy::upright * std::numbers::pi / 180)) return;
    MirrorPlane upright = through(plane.offset / plane.normal[axis] * Vector3::Unit(axis), Vector3::Unit(axis));
    for (const double offset : {0.0, upright.offset}) {
      upright.offset = offset;
      MirrorPlane other = upright;
      measure(other);
      // As good as the other within what a file's digits leave.
      if (other.share >= plane.share - 1e-3 && other.deviation <= plane.deviation + 1e-2 * plane.tolerance) {
        plane = other;
        return;
      }
    }
  }

  [[nodiscard]] std::vector<Matched> vertex_pairs(const MirrorPlane& plane) const {
    const TriangleMesh<double>& mesh = asset_.mesh;
    constexpr Index most = 4000;
    const Index step = std::max<Index>(1, mesh.vertex_count() / most);
    std::vector<Matched> pairs;
    ClosestFilter filter;
    filter.maximum_distance = 3 * plane.tolerance;
    for (Index v = 0; v < mesh.vertex_count(); v += step) {
      const Vector3 p = mesh.position(v);
      const SurfaceHit hit = closest_.closest(plane.mirrored(p), filter);
      if (!hit.found()) continue;
      int corner = 0;
      hit.barycentric.maxCoeff(&corner);
      const Vector3 q = mesh.position(mesh.faces()(hit.face, corner));
      if ((q - plane.mirrored(p)).norm() < plane.tolerance) pairs.push_back({p, q, 1});
    }
    if (pairs.size() < 12) pairs.clear();
    return pairs;
  }

  void orient(MirrorPlane& plane) const {
    Eigen::Index axis = 0;
    plane.normal.cwiseAbs().maxCoeff(&axis);
    if (plane.normal[axis] < 0) plane.normal = -plane.normal, plane.offset = -plane.offset;
  }

  // --- the rig ----------------------------------------------------------------------------------------------------

  [[nodiscard]] const std::vector<Bone>& bones() const { return asset_.rig->skeleton.bones; }

  [[nodiscard]] std::map<std::string, Index> bones_by_name() const {
    std::map<std::string, Index> found;
    for (std::size_t b = 0; b < bones().size(); ++b) found.emplace(bones()[b].name, static_cast<Index>(b));
    return found;
  }
  [[nodiscard]] static Index named_twin(const std::map<std::string, Index>& by_name, const std::string& name) {
    for (const std::string& other : mirrored_names(name))
      if (const auto found = by_name.find(other); found != by_name.end() && other != name) return found->second;
    return no_index;
  }

  /// The plane halfway between joints whose names differ in their side.
  [[nodiscard]] std::optional<MirrorPlane> plane_of_names() const {
    if (!asset_.rig) return std::nullopt;
    const std::map<std::string, Index> by_name = bones_by_name();
    Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
    Vector3 middle = Vector3::Zero();
    double weight = 0;
    for (const Bone& bone : bones()) {
      const Index other = named_twin(by_name, bone.name);
      if (other == no_index) continue;
      const Vector3 d = bone.head - bones()[at(other)].head;
      across += d * d.transpose();
      middle += d.squaredNorm() * (bone.head + bones()[at(other)].head) / 2;
      weight += d.squaredNorm();
    }
    if (!(weight > 0)) return std::nullopt;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(across);
    return through(middle / weight, solver.eigenvectors().col(2));
  }
  /// Whether bones whose names differ in their side lie on different sides.
  [[nodiscard]] bool names_agree(const MirrorPlane& plane) const {
    const std::map<std::string, Index> by_name = bones_by_name();
    Index agree = 0, all = 0;
    for (const Bone& bone : bones())
      if (const Index other = named_twin(by_name, bone.name); other != no_index) {
        ++all;
        // Of bones that begin at one joint the far ends tell.
        const Bone& twin = bones()[at(other)];
        agree += plane.side((bone.head + bone.tail) / 2) * plane.side((twin.head + twin.tail) / 2) <= 0;
      }
    return all > 0 && 10 * agree >= 9 * all;
  }

  /// Twins by name and place, else by place alone.
  void pair_bones(MirrorPlane& plane) const {
    if (!asset_.rig) return;
    const std::size_t n = bones().size();
    const std::map<std::string, Index> by_name = bones_by_name();
    const double near = MirrorPolicy::joint * diagonal_;
    const auto apart = [&](std::size_t a, std::size_t b) {
      return (plane.mirrored(bones()[a].head) - bones()[b].head).norm() +
             (plane.mirrored(bones()[a].tail) - bones()[b].tail).norm();
    };
    plane.twin.assign(n, no_index);
    for (std::size_t b = 0; b < n; ++b) {
      if (plane.twin[b] != no_index) continue;
      const Index named = named_twin(by_name, bones()[b].name);
      if (named != no_index && named_twin(by_name, bones()[at(named)].name) == static_cast<Index>(b)) {
        plane.twin[b] = named;
        plane.twin[at(named)] = static_cast<Index>(b);
      }
    }
    for (std::size_t b = 0; b < n; ++b) {
      if (plane.twin[b] != no_index) continue;
      std::size_t best = n;
      double least = 2 * near;
      for (std::size_t other = 0; other < n; ++other) {
        if (plane.twin[other] != no_index && other != b) continue;
        const double d = apart(b, other) * (other == b ? 0.999 : 1);  // of helpers at one place each is its own
        if (d < least) least = d, best = other;
      }
      if (best == n) continue;
      plane.twin[b] = static_cast<Index>(best);
      plane.twin[best] = static_cast<Index>(b);
    }
    follow_chains(plane);
    std::vector<double> moves(n, 0.0);
    for (Index v = 0; v < asset_.mesh.vertex_count(); ++v)
      for (SkinWeights::InnerIterator it(asset_.rig->weights, v); it; ++it)
        moves[at(static_cast<Index>(it.col()))] += it.value();
    double paired = 0, all = 0;
    for (std::size_t b = 0; b < n; ++b) {
      if (!(moves[b] > 0)) continue;
      all += moves[b];
      if (plane.twin[b] != no_index) paired += moves[b];
    }
    plane.paired_bones = all > 0 ? paired / all : 0;
  }

  /// Where the two sides do not stand alike, twins hang on twins: of those that are left the nearest of like length.
  void follow_chains(MirrorPlane& plane) const {
    constexpr double like = 2;
    const std::size_t n = bones().size();
    const auto length = [&](std::size_t b) { return (bones()[b].tail - bones()[b].head).norm(); };
    for (bool again = true; again;) {
      again = false;
      for (std::size_t b = 0; b < n; ++b) {
        const Index parent = bones()[b].parent;
        if (plane.twin[b] != no_index || parent == no_index || plane.twin[at(parent)] == no_index) continue;
        std::size_t best = n;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t other = 0; other < n; ++other) {
          if (other == b || plane.twin[other] != no_index || bones()[other].parent != plane.twin[at(parent)]) continue;
          if (length(other) > like * length(b) || length(b) > like * length(other)) continue;
          const double d = (plane.mirrored(bones()[b].tail) - bones()[other].tail).norm();
          if (d < least) least = d, best = other;
        }
        if (best == n) continue;
        plane.twin[b] = static_cast<Index>(best);
        plane.twin[best] = static_cast<Index>(b);
        again = true;
      }
    }
  }

  const Asset& asset_;
  Context& context_;
  const ClosestPoint closest_;
  const SurfaceSamples samples_;
  const double diagonal_;
  double area_ = 0;
  Vector3 centre_ = Vector3::Zero();
};

}  // namespace detail

QUADRIG_INLINE Expected<std::optional<MirrorPlane>> find_mirror_plane(const Asset& asset, SymmetryChoice choice,
                                                                      Context& context) {
  return detail::MirrorSearch(asset, context).run(choice);
}

}  // namespace quadrig
