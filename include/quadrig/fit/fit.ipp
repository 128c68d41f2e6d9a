// Definitions of fit.hpp.
#pragma once

#include "quadrig/fit.hpp"
#include "quadrig/fit/drawn.hpp"
#include "quadrig/fit/influences.hpp"
#include "quadrig/fit/normal_equations.hpp"
#include "quadrig/fit/samples.hpp"

namespace quadrig {

QUADRIG_INLINE Status FitOptions::validate() const {
  const auto bad = [](const char* field, const char* remedy) {
    return Status(Error{ErrorCode::bad_option, "out of range", std::string("fit.") + field, remedy});
  };
  if (rounds < 0) return bad("rounds", "give 0 or more");
  if (!(samples >= 1 && samples <= 1e4)) return bad("samples", "give 1 to 10000");
  if (!(stiffness >= 0)) return bad("stiffness", "give 0 or more");
  if (!(shear >= 0)) return bad("shear", "give 0 or more");
  if (!(sliding >= 0)) return bad("sliding", "give 0 or more");
  if (!(largest_move >= 0)) return bad("largest_move", "give 0 or more");
  if (!(accepted >= 0 && accepted < 1)) return bad("accepted", "give 0 to below 1");
  return slide.validate();
}

namespace detail {

/// One row of the least squares: where a pose takes a sample, by the plane of the surface there.
struct PosedRow {
  Index pose = 0;
  double weight = 0, offset = 0;  ///< offset: normal · position
  Vector3 normal;
};

class LeastSquaresFit {
 public:
  LeastSquaresFit(const TriangleMesh<double>& surface, QuadMesh quads, const FitMotion& motion, std::vector<char> held,
                  const FitOptions& options, Context& context)
      : surface_(surface),
        motion_(motion),
        options_(options),
        context_(context),
        quads_(std::move(quads)),
        start_(quads_.positions),
        drawn_(quads_),
        held_(std::move(held)) {
    held_.resize(at(quads_.vertex_count()), 0);
    for (Index side = 0; side < 4 * quads_.quad_count(); ++side)
      if (drawn_.twin(side) == no_index)
        held_[at(corner(side))] = held_[at(quads_.quads(side / 4, (side + 1) % 4))] = 1;
    for (Index v = 0; v < quads_.vertex_count(); ++v)
      if (drawn_.corners().at(v).empty()) held_[at(v)] = 1;
  }

  [[nodiscard]] Expected<FittedQuads> run(const SolverFactory<double>& factory) {
    FittedQuads result;
    if (Status status = check(); !status.ok()) return status.error();
    if (Status status = carry_weights(); !status.ok()) return status.error();
    const auto quads = static_cast<double>(quads_.quad_count());
    samples_ = sample_surface(surface_, options_.samples * quads, 4 * options_.samples * quads);
    if (context_.cancelled()) return cancelled_error("fit");
    locate();
    choose_diagonals();
    if (context_.cancelled()) return cancelled_error("fit");
    if (Status status = project_morphs(factory); !status.ok()) return status.error();
    collect_rows();
    if (context_.cancelled()) return cancelled_error("fit");
    limit_influences(result.report);
    measure(result.report.rest_before, result.report.posed_before);
    if (options_.method == FitMethod::surface && options_.rounds > 0)
      if (Status status = solve_rounds(factory, result.report); !status.ok()) return status.error();
    if (result.report.rounds > 0)
      if (Status status = project_morphs(factory); !status.ok()) return status.error();
    measure(result.report.rest_after, result.report.posed_after);
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      result.report.largest_move =
          std::max(result.report.largest_move, (quads_.positions.row(v) - start_.row(v)).norm());
      if (!drawn_.corners().at(v).empty() && quads_.source[at(v)].face != no_index)
        quads_.source[at(v)] = walk_closest(surface_, quads_.positions.row(v).transpose(), quads_.source[at(v)]);
    }
    begin_at_diagonals();
    if (motion_.weights) result.weights = std::move(weights_);
    result.mesh = std::move(quads_);
    result.morphs = std::move(morphs_);
    return result;
  }

 private:
  [[nodiscard]] Index corner(Index c) const { return quads_.quads(c / 4, c % 4); }
  [[nodiscard]] std::vector<std::array<Index, 4>> patches() const {
    std::vector<std::array<Index, 4>> result;
    for (Index q = 0; q < quads_.quad_count(); ++q)
      result.push_back({quads_.quads(q, 0), quads_.quads(q, 1), quads_.quads(q, 2), quads_.quads(q, 3)});
    return result;
  }
  [[nodiscard]] Index vertex(Index triangle, int i) const {
    return quads_.quads(triangle / 2, drawn_.corner(triangle, i));
  }

  [[nodiscard]] Status check() const {
    const auto misfit = [](std::string what, std::string where) {
      return Status(Error{ErrorCode::bad_input, std::move(what), std::move(where), "give what belongs to the surface"});
    };
    for (std::size_t p = 0; p < motion_.poses.size(); ++p)
      if (motion_.weights && static_cast<Eigen::Index>(motion_.poses[p].size()) != motion_.weights->cols())
        return misfit("another number of bones", "pose " + std::to_string(p));
    if (!motion_.pose_weights.empty() && motion_.pose_weights.size() != motion_.poses.size())
      return misfit("not one weight a pose", "pose weights");
    for (std::size_t k = 0; k < motion_.morphs.size(); ++k)
      if (motion_.morphs[k].rows() != surface_.vertex_count())
        return misfit("not one row a vertex", "morph " + std::to_string(k));
    if (!motion_.face_weights.empty() && static_cast<Index>(motion_.face_weights.size()) != surface_.face_count())
      return misfit("not one a face", "face weights");
    if (static_cast<Index>(quads_.source.size()) != quads_.vertex_count())
      return misfit("not one a vertex", "source of the quads");
    return {};
  }
  /// All weights at the vertices.
  [[nodiscard]] Status carry_weights() {
    if (!motion_.weights) return {};
    Expected<SkinWeights> all =
        transfer_weights(surface_, *motion_.weights, quads_.source, static_cast<Index>(motion_.weights->cols()));
    if (!all) return all.error();
    weights_ = std::move(*all);
    return {};
  }

  /// Each sample's place on the quads, by way of the surface: a face begins where its neighbour was found, the first
  /// where a vertex lies. So no sample is placed on another sheet that happens to be near.
  void locate() {
    std::vector<Index> found(at(surface_.face_count()), no_index);
    std::vector<Index> queue;
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      const auto at_v = drawn_.corners().at(v);
      const Index face = quads_.source[at(v)].face;
      if (at_v.empty() || face == no_index || found[at(face)] != no_index) continue;
      found[at(face)] = 2 * (at_v[0] / 4);
      queue.push_back(face);
    }
    for (std::size_t k = 0; k < queue.size(); ++k) {
      if (k % 4096 == 0 && context_.cancelled()) return;
      const Index face = queue[k];
      const SurfacePoint centre{face, Vector3::Constant(1.0 / 3)};
      found[at(face)] = drawn_.walk(position(surface_, centre), found[at(face)]).triangle;
      for (Index h = 3 * face; h < 3 * face + 3; ++h)
        if (const Index twin = surface_.twin(h); twin != no_index && found[at(twin / 3)] == no_index) {
          found[at(twin / 3)] = found[at(face)];
          queue.push_back(twin / 3);
        }
    }
    places_.resize(samples_.size());
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      places_[s].triangle = found[at(samples_.point[s].face)];
      if (!motion_.face_weights.empty()) samples_.area[s] *= motion_.face_weights[at(samples_.point[s].face)];
    }
    place();
  }
  /// Places after the vertices have moved.
  void place() {
    drawn_.set_positions(quads_.positions);
    context_.parallel_for(places_.size(), 2048, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s)
        if (places_[s].triangle != no_index) places_[s] = drawn_.walk(samples_.position[s], places_[s].triangle);
    });
    sort_by_quad();
  }
  void sort_by_quad() {
    first_.assign(at(quads_.quad_count()) + 1, 0);
    for (const Place& place : places_)
      if (place.triangle != no_index) ++first_[at(place.triangle / 2) + 1];
    for (std::size_t q = 1; q < first_.size(); ++q) first_[q] += first_[q - 1];
    by_quad_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t s = 0; s < places_.size(); ++s)
      if (places_[s].triangle != no_index) by_quad_[next[at(places_[s].triangle / 2)]++] = s;
  }
  [[nodiscard]] std::span<const std::size_t> samples_of(Index quad) const {
    return std::span(by_quad_).subspan(first_[at(quad)], first_[at(quad) + 1] - first_[at(quad)]);
  }
  /// A sample that faces away from its place says nothing about it.
  [[nodiscard]] double weight(std::size_t s) const {
    constexpr double facing = 0.2;
    return drawn_.normal(places_[s].triangle).dot(samples_.normal[s]) > facing ? samples_.area[s] : 0;
  }

  /// Of both diagonals the one that lies nearer to the surface, as long as neither half folds over the other. Samples
  /// are placed on both: vertices are fitted to the mean of the two, as a choice that differs from quad to quad would
  /// leave its pattern in their lines.
  void choose_diagonals() {
    const auto cubed = [](double x) { return x * x * x; };
    constexpr double worth = 0.95;  // of the error of the first, below which the second is taken
    on_corners_.resize(places_.size());
    context_.parallel_for(at(quads_.quad_count()), 256, [&](std::size_t begin, std::size_t end) {
      std::vector<Place> found[2];
      for (std::size_t k = begin; k < end; ++k) {
        const auto q = static_cast<Index>(k);
        const std::span<const std::size_t> own = samples_of(q);
        for (const std::size_t s : own) on_corners_[s].setZero();
        double error[2];
        for (int d = 0; d < 2; ++d) {
          drawn_.set_diagonal(q, d);
          found[d].clear();
          error[d] = drawn_.normal(2 * q).dot(drawn_.normal(2 * q + 1)) > 0
                         ? 0
                         : 1e6 * surface_.total_area() * surface_.total_area();
          for (const std::size_t s : own) {
            const Place one = drawn_.on(2 * q, samples_.position[s]),
                        other = drawn_.on(2 * q + 1, samples_.position[s]);
            const Place& nearer = found[d].emplace_back(other.squared_distance < one.squared_distance ? other : one);
            error[d] += samples_.area[s] * nearer.squared_distance;
          }
        }
        const double sum = error[0] + error[1];
        for (int d = 0; d < 2; ++d) {
          // 1/2 between equals; 0.9 where the other's error is twice as large
          const double ratio = sum > 0 ? error[1 - d] / sum : 0.5,
                       weight = cubed(ratio) / (cubed(ratio) + cubed(1 - ratio));
          for (std::size_t n = 0; n < own.size(); ++n)
            for (int i = 0; i < 3; ++i)
              on_corners_[own[n]][DrawnQuads::corner(found[d][n].triangle, i, d)] +=
                  weight * found[d][n].barycentric[i];
        }
        const int best = error[1] < worth * error[0] ? 1 : 0;
        drawn_.set_diagonal(q, best);
        for (std::size_t n = 0; n < own.size(); ++n) places_[own[n]] = found[best][n];
      }
    });
  }
  void begin_at_diagonals() {
    for (Index q = 0; q < quads_.quad_count(); ++q)
      if (drawn_.diagonal(q) != 0) {
        const Eigen::Matrix<Index, 1, 4> quad = quads_.quads.row(q);
        quads_.quads.row(q) << quad[1], quad[2], quad[3], quad[0];
      }
  }

  // --- poses -----------------------------------------------------------------------------------------------------

  [[nodiscard]] std::size_t pose_count() const { return motion_.poses.size(); }

  /// The poses that bend each quad, or the surface below it: of those every sample has a row of its own; the others
  /// move it as one body, and count as its rest pose once more. Morph targets are poses after the others.
  void collect_rows() {
    const std::size_t poses = motion_.weights ? pose_count() : 0, all = poses + motion_.morphs.size();
    double total = motion_.rest_weight;
    std::vector<double> pose_weight(all, 1.0);
    for (std::size_t p = 0; p < all; ++p) {
      if (p < poses && !motion_.pose_weights.empty()) pose_weight[p] = motion_.pose_weights[p];
      total += pose_weight[p];
    }
    rest_share_.assign(samples_.size(), 1.0);
    row_first_.assign(samples_.size() + 1, 0);
    if (all == 0) return;
    const std::vector<std::vector<Index>> bending = bending_poses(poses);
    std::size_t rows = 0;
    for (std::size_t s = 0; s < samples_.size(); ++s)
      if (places_[s].triangle != no_index) rows += bending[at(places_[s].triangle / 2)].size();
    // Where very many bones share everything, each sample sees every few poses, its neighbours the others.
    constexpr std::size_t most_rows = 2'000'000;
    const std::size_t stride = rows / most_rows + 1;
    std::vector<std::vector<std::size_t>> of_pose(all);
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      row_first_[s + 1] = row_first_[s];
      if (places_[s].triangle == no_index) continue;
      const std::vector<Index>& own = bending[at(places_[s].triangle / 2)];
      double bent = 0;
      for (const Index p : own) bent += pose_weight[at(p)];
      rest_share_[s] = (total - bent) / total;
      double seen = 0;
      const std::size_t begin = rows_.size();
      for (std::size_t k = s % stride; k < own.size(); k += stride) {
        of_pose[at(own[k])].push_back(rows_.size());
        rows_.push_back({own[k], pose_weight[at(own[k])], 0, Vector3::Zero()});
        row_sample_.push_back(s);
        seen += pose_weight[at(own[k])];
      }
      for (std::size_t k = begin; k < rows_.size(); ++k) rows_[k].weight *= seen > 0 ? bent / (seen * total) : 0;
      row_first_[s + 1] = rows_.size();
    }
    for (std::size_t p = 0; p < all; ++p) {
      if (context_.cancelled()) return;
      place_rows(static_cast<Index>(p), of_pose[p]);
    }
  }

  /// Of each quad the poses that move its corners or the surface below it in more than one way.
  [[nodiscard]] std::vector<std::vector<Index>> bending_poses(std::size_t poses) const {
    std::vector<std::vector<Index>> groups;
    for (std::size_t p = 0; p < poses; ++p) groups.push_back(rigid_groups(motion_.poses[p]));
    std::vector<std::vector<Index>> bending(at(quads_.quad_count()));
    context_.parallel_for(bending.size(), 64, [&](std::size_t begin, std::size_t end) {
      std::vector<Index> bones;
      for (std::size_t q = begin; q < end; ++q) {
        if (q % 64 == 0 && context_.cancelled()) return;
        bones.clear();
        const auto note = [&](const SkinWeights& weights, Index row) {
          constexpr double counts = 1e-3;
          for (SkinWeights::InnerIterator it(weights, row); it; ++it)
            if (it.value() > counts) bones.push_back(static_cast<Index>(it.col()));
        };
        if (poses > 0)
          for (int i = 0; i < 4; ++i) note(weights_, quads_.quads(static_cast<Index>(q), i));
        std::vector<Index> faces;
        for (const std::size_t s : samples_of(static_cast<Index>(q)))
          if (const Index face = samples_.point[s].face; faces.empty() || faces.back() != face) faces.push_back(face);
        if (poses > 0)
          for (const Index face : faces)
            for (int i = 0; i < 3; ++i) note(*motion_.weights, surface_.faces()(face, i));
        std::sort(bones.begin(), bones.end());
        bones.erase(std::unique(bones.begin(), bones.end()), bones.end());
        for (std::size_t p = 0; p < poses; ++p)
          if (std::any_of(bones.begin(), bones.end(),
                          [&](Index b) { return groups[p][at(b)] != groups[p][at(bones.front())]; }))
            bending[q].push_back(static_cast<Index>(p));
        for (std::size_t k = 0; k < motion_.morphs.size(); ++k)
          if (std::any_of(faces.begin(), faces.end(), [&](Index face) { return shears(motion_.morphs[k], face); }))
            bending[q].push_back(static_cast<Index>(poses + k));
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
      for (int i = 0; i < 3; ++i) vertices.push_back(surface_.faces()(samples_.point[row_sample_[row]].face, i));
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    posed_.resize(surface_.vertex_count(), 3);
    context_.parallel_for(vertices.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const Index v = vertices[k];
        const Vector3 p = surface_.position(v);
        if (at(pose) < pose_count())
          posed_.row(v) = (blended(*motion_.weights, v, motion_.poses[at(pose)]) * p.homogeneous()).transpose();
        else
          posed_.row(v) = p.transpose() + motion_.morphs[at(pose) - pose_count()].row(v);
      }
    });
    context_.parallel_for(rows.size(), 2048, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        PosedRow& row = rows_[rows[k]];
        const SurfacePoint& point = samples_.point[row_sample_[rows[k]]];
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

  /// Values of the vertices whose interpolation over the quads is nearest to what the samples have, in the mean.
  /// \param put called with a sample and add(column, value): what it has
  /// \returns vertices × columns
  template <class Put>
  [[nodiscard]] Expected<Eigen::MatrixXd> project(Index columns, const SolverFactory<double>& factory, Put&& put) {
    const Index n = quads_.vertex_count();
    std::vector<Index> unknown(at(n));
    std::iota(unknown.begin(), unknown.end(), Index{0});
    BlockEquations<1> equations(std::move(unknown), n, patches());
    using Block = BlockEquations<1>::Block;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n, columns), x(n, columns);
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      if (q % 256 == 0 && context_.cancelled()) return cancelled_error("fit");
      double area = 0;
      for (const std::size_t s : samples_of(q)) {
        const Place& place = places_[s];
        const double weight = samples_.area[s];
        area += weight;
        std::array<Index, 3> v;
        for (int i = 0; i < 3; ++i) v[at(i)] = vertex(place.triangle, i);
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j <= i; ++j)
            equations.add(v[at(i)], v[at(j)], Block(weight * place.barycentric[i] * place.barycentric[j]));
        put(s, [&](Index column, double value) {
          for (int i = 0; i < 3; ++i) right(v[at(i)], column) += weight * place.barycentric[i] * value;
        });
      }
      // Corners that no sample sees go with their neighbours.
      const double tie = std::max(1e-3 * area, 1e-9 * surface_.total_area() / quads_.quad_count());
      for (int i = 0; i < 4; ++i) {
        const Index a = quads_.quads(q, i), b = quads_.quads(q, (i + 1) % 4);
        equations.add(a, a, Block(tie * (1 + 1e-6)));
        equations.add(b, b, Block(tie));
        equations.add(a, b, Block(-tie));
      }
    }
    Expected<AnySolver<double>> solver = factory();
    if (!solver) return solver.error();
    if (Status status = solver->prepare(equations.matrix(), 1, context_); !status.ok()) return status.error();
    const std::span<const double> from(right.data(), static_cast<std::size_t>(right.size()));
    const std::span<double> to(x.data(), static_cast<std::size_t>(x.size()));
    if (SolveInfo info = solver->solve_all(from, to, columns, context_); !info.status.ok()) return info.status.error();
    return x;
  }

  [[nodiscard]] Status project_morphs(const SolverFactory<double>& factory) {
    const std::size_t count = motion_.morphs.size();
    if (count == 0) return {};
    const Expected<Eigen::MatrixXd> found =
        project(static_cast<Index>(3 * count), factory, [&](std::size_t s, auto&& add) {
          const SurfacePoint& point = samples_.point[s];
          for (std::size_t k = 0; k < count; ++k) {
            Vector3 d = Vector3::Zero();
            for (int i = 0; i < 3; ++i)
              d += point.barycentric[i] * motion_.morphs[k].row(surface_.faces()(point.face, i)).transpose();
            if (d.squaredNorm() > 0)
              for (int c = 0; c < 3; ++c) add(static_cast<Index>(3 * k) + c, d[c]);
          }
        });
    if (!found) return found.error();
    morphs_.clear();
    for (std::size_t k = 0; k < count; ++k) morphs_.push_back(found->middleCols<3>(static_cast<Eigen::Index>(3 * k)));
    return {};
  }

  [[nodiscard]] static Eigen::Matrix<double, 3, 4> blended(const SkinWeights& weights, Index row, const Pose& pose) {
    Eigen::Matrix<double, 3, 4> sum = Eigen::Matrix<double, 3, 4>::Zero();
    for (SkinWeights::InnerIterator it(weights, row); it; ++it)
      sum += it.value() * pose[at(static_cast<Index>(it.col()))].matrix().topRows<3>();
    return sum;
  }

  /// Rows with more influences than allowed: which, with which weights, keep the vertex where all of them take it?
  void limit_influences(FitReport& report) {
    if (!motion_.weights) return;
    const Index most = motion_.influences;
    std::vector<double> pose_weight(pose_count(), 1.0);
    if (!motion_.pose_weights.empty()) pose_weight.assign(motion_.pose_weights.begin(), motion_.pose_weights.end());
    double weight_of_poses = 0;
    for (const double w : pose_weight) weight_of_poses += w;
    const InfluenceLimit limit(motion_.poses, pose_weight, most);
    std::vector<std::vector<Influence>> rows(at(quads_.vertex_count()));
    std::vector<double> error(rows.size(), -1);
    context_.parallel_for(rows.size(), 32, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        if (v % 64 == 0 && context_.cancelled()) return;
        std::vector<Influence>& own = rows[v];
        for (SkinWeights::InnerIterator it(weights_, static_cast<Index>(v)); it; ++it)
          if (it.value() > 0) own.push_back({static_cast<Index>(it.col()), it.value()});
        if (own.size() <= at(most)) continue;
        auto limited = limit(quads_.positions.row(static_cast<Index>(v)).transpose(), std::move(own));
        own = std::move(limited.weights);
        error[v] = limited.squared_error;
      }
    });
    std::vector<Eigen::Triplet<double, Index>> entries;
    double dropped = 0;
    for (std::size_t v = 0; v < rows.size(); ++v) {
      double sum = 0;
      for (const Influence& each : rows[v]) sum += each.weight;
      for (const Influence& each : rows[v]) entries.emplace_back(static_cast<Index>(v), each.bone, each.weight / sum);
      if (error[v] < 0) continue;
      ++report.dropped_influences;
      dropped += error[v];
    }
    if (report.dropped_influences > 0 && weight_of_poses > 0)
      report.dropped_error = std::sqrt(dropped / (report.dropped_influences * weight_of_poses));
    weights_.setZero();
    weights_.setFromTriplets(entries.begin(), entries.end());
  }

  // --- least squares ---------------------------------------------------------------------------------------------

  /// The transforms of a quad's corners in a pose, computed where they are first asked for.
  class CornerTransforms {
   public:
    explicit CornerTransforms(const LeastSquaresFit& fit)
        : fit_(fit), of_(fit.pose_count() + fit.motion_.morphs.size()), stamp_(of_.size(), no_index) {}
    using Four = std::array<Eigen::Matrix<double, 3, 4>, 4>;
    [[nodiscard]] const Four& get(Index quad, Index pose) {
      if (stamp_[at(pose)] != quad) {
        stamp_[at(pose)] = quad;
        for (int i = 0; i < 4; ++i) {
          const Index v = fit_.quads_.quads(quad, i);
          auto& transform = of_[at(pose)][at(i)];
          if (at(pose) < fit_.pose_count())
            transform = blended(fit_.weights_, v, fit_.motion_.poses[at(pose)]);
          else
            transform << Eigen::Matrix3d::Identity(), fit_.morphs_[at(pose) - fit_.pose_count()].row(v).transpose();
        }
      }
      return of_[at(pose)];
    }

   private:
    const LeastSquaresFit& fit_;
    std::vector<Four> of_;
    std::vector<Index> stamp_;
  };

  /// Calls row(weight, residual, gradients) for each row of the samples on a quad: by its four corners the gradients of
  /// normal · (place − sample), whose value is −residual.
  template <class Row>
  void for_each_row(Index quad, CornerTransforms& transforms, Row&& row) const {
    std::array<Vector3, 4> corner, gradient;
    for (int i = 0; i < 4; ++i) corner[at(i)] = quads_.positions.row(quads_.quads(quad, i)).transpose();
    for (const std::size_t s : samples_of(quad)) {
      const Eigen::Vector4d& share = on_corners_[s];
      const double area = weight(s);
      if (!(area > 0)) continue;
      if (rest_share_[s] > 0) {
        Vector3 there = Vector3::Zero();
        for (int i = 0; i < 4; ++i) {
          gradient[at(i)] = share[i] * samples_.normal[s];
          there += share[i] * corner[at(i)];
        }
        row(area * rest_share_[s], samples_.normal[s].dot(samples_.position[s] - there), gradient);
      }
      for (std::size_t k = row_first_[s]; k < row_first_[s + 1]; ++k) {
        const PosedRow& posed = rows_[k];
        if (!(posed.weight > 0)) continue;
        const auto& four = transforms.get(quad, posed.pose);
        double residual = posed.offset;
        for (int i = 0; i < 4; ++i) {
          const auto& t = four[at(i)];
          gradient[at(i)] = share[i] * (t.template leftCols<3>().transpose() * posed.normal);
          residual -= gradient[at(i)].dot(corner[at(i)]) + share[i] * posed.normal.dot(t.col(3));
        }
        row(area * posed.weight, residual, gradient);
      }
    }
  }

  void measure(double& rest, double& posed) {
    struct Sum {
      double rest = 0, posed = 0, weight = 0;
      Sum& operator+=(const Sum& other) {
        rest += other.rest, posed += other.posed, weight += other.weight;
        return *this;
      }
    };
    std::vector<Sum> sums(at(quads_.quad_count()));
    context_.parallel_for(sums.size(), 64, [&](std::size_t begin, std::size_t end) {
      CornerTransforms transforms(*this);
      for (std::size_t q = begin; q < end; ++q) {
        const auto quad = static_cast<Index>(q);
        for_each_row(quad, transforms, [&](double weight, double residual, const auto&...) {
          sums[q].posed += weight * residual * residual;
        });
        for (const std::size_t s : samples_of(quad)) {
          const double off = samples_.normal[s].dot(samples_.position[s] - places_[s].position);
          sums[q].rest += weight(s) * off * off;
          sums[q].weight += weight(s);
        }
      }
    });
    Sum all;
    for (const Sum& each : sums) all += each;
    rest = all.weight > 0 ? std::sqrt(all.rest / all.weight) : 0;
    posed = all.weight > 0 ? std::sqrt(all.posed / all.weight) : 0;
  }

  [[nodiscard]] Status solve_rounds(const SolverFactory<double>& factory, FitReport& report) {
    std::vector<Index> unknown(at(quads_.vertex_count()), no_index);
    Index unknowns = 0;
    for (std::size_t v = 0; v < unknown.size(); ++v)
      if (!held_[v]) unknown[v] = unknowns++;
    if (unknowns == 0) return {};
    BlockEquations<3> equations(std::move(unknown), unknowns, patches());
    Expected<AnySolver<double>> solver = factory();
    if (!solver) return solver.error();
    std::vector<double> x(at(3 * unknowns));
    for (; report.rounds < options_.rounds; ++report.rounds) {
      if (report.rounds > 0) {
        place();
        choose_diagonals();
      }
      if (context_.cancelled()) return cancelled_error("fit");
      assemble(equations);
      if (Status status = solver->prepare(equations.matrix(), 1, context_); !status.ok()) return status;
      if (SolveInfo info = solver->solve(equations.rhs(), x, context_); !info.status.ok()) return info.status;
      step(equations, x);
    }
    place();
    choose_diagonals();
    return {};
  }

  void assemble(BlockEquations<3>& equations) const {
    equations.clear();
    using Block = Eigen::Matrix<double, 12, 12>;
    constexpr Index run = 512;  // quads whose blocks are held at once
    std::vector<Block> block(at(run));
    std::vector<Eigen::Matrix<double, 12, 1>> right(at(run));
    const double stiffness = options_.stiffness, sliding = options_.sliding, shear = options_.shear;
    for (Index begin = 0; begin < quads_.quad_count(); begin += run) {
      const Index count = std::min(run, quads_.quad_count() - begin);
      context_.parallel_for(at(count), 32, [&](std::size_t from, std::size_t to) {
        CornerTransforms transforms(*this);
        for (std::size_t k = from; k < to; ++k) {
          const Index q = begin + static_cast<Index>(k);
          Block& m = block[k];
          auto& b = right[k];
          m.setZero();
          b.setZero();
          for_each_row(q, transforms, [&](double weight, double residual, const std::array<Vector3, 4>& gradient) {
            for (int i = 0; i < 4; ++i) {
              const Vector3 scaled = weight * gradient[at(i)];
              b.template segment<3>(3 * i) += residual * scaled;
              for (int j = 0; j <= i; ++j) m.template block<3, 3>(3 * i, 3 * j) += scaled * gradient[at(j)].transpose();
            }
          });
          // What each quad adds to keep its corners in order.
          double area = 0;
          Vector3 normal = Vector3::Zero();
          std::array<Vector3, 4> p, moved;
          for (int i = 0; i < 4; ++i) {
            const Index v = quads_.quads(q, i);
            p[at(i)] = quads_.positions.row(v).transpose();
            moved[at(i)] = p[at(i)] - start_.row(v).transpose();
          }
          normal = (p[2] - p[0]).cross(p[3] - p[1]);
          area = normal.norm() / 2;
          if (!(area > 0)) continue;
          normal /= 2 * area;
          const Eigen::Matrix3d along = Eigen::Matrix3d::Identity() - normal * normal.transpose();
          for (int i = 0; i < 4; ++i) {
            const int j = (i + 1) % 4, high = std::max(i, j), low = std::min(i, j);
            const double tie = stiffness * area / 4, slip = sliding * area / 4;
            const Eigen::Matrix3d hold = tie * Eigen::Matrix3d::Identity() + shear * area / 4 * along;
            const Vector3 pull = hold * (moved[at(i)] - moved[at(j)]);
            for (const int c : {i, j}) m.block<3, 3>(3 * c, 3 * c) += hold;
            m.block<3, 3>(3 * high, 3 * low) -= hold;
            b.segment<3>(3 * i) -= pull;
            b.segment<3>(3 * j) += pull;
            m.block<3, 3>(3 * i, 3 * i) += slip * along + 1e-6 * area * Eigen::Matrix3d::Identity();
            b.segment<3>(3 * i) -= slip * (along * moved[at(i)]);
          }
        }
      });
      for (Index k = 0; k < count; ++k)
        for (int i = 0; i < 4; ++i) {
          const Index v = quads_.quads(begin + k, i);
          equations.add(v, right[at(k)].segment<3>(3 * i));
          for (int j = 0; j <= i; ++j)
            equations.add(v, quads_.quads(begin + k, j), block[at(k)].block<3, 3>(3 * i, 3 * j));
        }
    }
  }

  /// The solution, shortened where a quad would become worse than it may be.
  void step(const BlockEquations<3>& equations, std::span<const double> x) {
    const auto n = at(quads_.vertex_count()), m = at(quads_.quad_count());
    const Points<double> from = quads_.positions;
    std::vector<double> share(n, 1.0), reach(n, std::numeric_limits<double>::infinity()), before(m);
    for (std::size_t q = 0; q < m; ++q) {
      before[q] = scaled_jacobian(from, quads_.quads.row(static_cast<Index>(q)));
      for (int i = 0; i < 4; ++i) {
        const Index v = quads_.quads(static_cast<Index>(q), i), w = quads_.quads(static_cast<Index>(q), (i + 1) % 4);
        const double length = options_.largest_move * (start_.row(v) - start_.row(w)).norm();
        reach[at(v)] = std::min(reach[at(v)], length);
        reach[at(w)] = std::min(reach[at(w)], length);
      }
    }
    Points<double> wish = from;
    for (std::size_t v = 0; v < n; ++v) {
      const Index i = equations.unknown(static_cast<Index>(v));
      if (i == no_index) continue;
      Vector3 whole = from.row(static_cast<Index>(v)).transpose();
      for (int c = 0; c < 3; ++c) whole[c] += x[at(3 * i + c)];
      const Vector3 home = start_.row(static_cast<Index>(v)).transpose();
      if (const double length = (whole - home).norm(); length > reach[v])
        whole = home + reach[v] / length * (whole - home);
      wish.row(static_cast<Index>(v)) = whole.transpose();
    }
    const auto go = [&](Index v) {
      quads_.positions.row(v) = from.row(v) + share[at(v)] * (wish.row(v) - from.row(v));
    };
    for (Index v = 0; v < quads_.vertex_count(); ++v) go(v);
    constexpr int halvings = 4;
    std::vector<Index> suspects(m);
    std::iota(suspects.begin(), suspects.end(), Index{0});
    for (int round = 0; !suspects.empty(); ++round) {
      std::vector<Index> touched;
      for (const Index q : suspects) {
        if (scaled_jacobian(quads_.positions, quads_.quads.row(q)) >= std::min(options_.accepted, before[at(q)]))
          continue;
        for (int i = 0; i < 4; ++i) {
          const Index v = quads_.quads(q, i);
          if (share[at(v)] == 0) continue;
          share[at(v)] = round < halvings ? share[at(v)] / 2 : 0;
          touched.push_back(v);
        }
      }
      suspects.clear();
      for (const Index v : touched) {
        go(v);
        for (const Index c : drawn_.corners().at(v)) suspects.push_back(c / 4);
      }
      std::sort(suspects.begin(), suspects.end());
      suspects.erase(std::unique(suspects.begin(), suspects.end()), suspects.end());
    }
  }

  const TriangleMesh<double>& surface_;
  const FitMotion& motion_;
  const FitOptions& options_;
  Context& context_;
  QuadMesh quads_;
  const Points<double> start_;
  DrawnQuads drawn_;
  std::vector<char> held_;
  SkinWeights weights_;  // of the vertices
  SurfaceSamples samples_;
  std::vector<Eigen::Vector4d> on_corners_;  // of the samples: shares of the corners of their quads
  std::vector<Place> places_;                // of the samples
  std::vector<std::size_t> first_, by_quad_;
  std::vector<PosedRow> rows_;  // of the samples, one after the other
  std::vector<std::size_t> row_first_, row_sample_;
  Points<double> posed_;                // vertices of the surface, in the pose at hand
  std::vector<Points<double>> morphs_;  // of the vertices
  std::vector<double> rest_share_;      // of each sample: weight of the poses that move it as one body
};

}  // namespace detail

QUADRIG_INLINE Expected<FittedQuads> fit(const TriangleMesh<double>& surface, QuadMesh quads, const FitMotion& motion,
                                         std::vector<char> held, const FitOptions& options, Context& context,
                                         const SolverFactory<double>& solver) {
  if (Status status = options.validate(); !status.ok()) return status.error();
  return detail::LeastSquaresFit(surface, std::move(quads), motion, std::move(held), options, context).run(solver);
}

}  // namespace quadrig
