// Definitions of fit.hpp.
#pragma once

#include "quadrig/fit.hpp"
#include "quadrig/fit/influences.hpp"
#include "quadrig/fit/line_samples.hpp"
#include "quadrig/fit/normal_equations.hpp"
#include "quadrig/fit/posed_rows.hpp"

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

class LeastSquaresFit {
 public:
  LeastSquaresFit(const TriangleMesh<double>& surface, QuadMesh quads, const FitMotion& motion, std::vector<char> held,
                  const EdgeMarks& kept, const FitOptions& options, Context& context)
      : surface_(surface),
        motion_(motion),
        options_(options),
        context_(context),
        quads_(std::move(quads)),
        start_(quads_.positions),
        held_(std::move(held)),
        lines_(surface, options.method == FitMethod::subdivision ? EdgeMarks{} : kept) {}

  [[nodiscard]] Expected<FittedQuads> run(const SolverFactory<double>& factory) {
    FittedQuads result;
    if (Status status = check(); !status.ok()) return status.error();
    if (Status status = carry_weights(); !status.ok()) return status.error();
    if (Status status = place_samples(); !status.ok()) return status.error();
    hold_vertices();
    if (Status status = project_morphs(factory); !status.ok()) return status.error();
    const PosedRows rows(surface_, motion_, *basis_, *samples_, weights_, context_);
    rows_ = &rows;
    if (context_.cancelled()) return cancelled_error("fit");
    limit_influences(result.report);
    measure(result.report.rest_before, result.report.back_before, result.report.posed_before);
    if (options_.method != FitMethod::none && options_.method != FitMethod::slide && options_.rounds > 0)
      if (Status status = solve_rounds(factory, result.report); !status.ok()) return status.error();
    if (result.report.rounds > 0)
      if (Status status = project_morphs(factory); !status.ok()) return status.error();
    measure(result.report.rest_after, result.report.back_after, result.report.posed_after);
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      result.report.largest_move =
          std::max(result.report.largest_move, (quads_.positions.row(v) - start_.row(v)).norm());
      if (has_quads(v) && quads_.source[at(v)].face != no_index)
        quads_.source[at(v)] = walk_closest(surface_, quads_.positions.row(v).transpose(), quads_.source[at(v)]);
    }
    if (basis_->is_flat()) begin_at_diagonals();
    if (motion_.weights) result.weights = std::move(weights_);
    result.mesh = std::move(quads_);
    result.morphs = std::move(morphs_);
    return result;
  }

 private:
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
  [[nodiscard]] Status place_samples() {
    if (options_.method == FitMethod::subdivision) {
      Expected<Subdivision> subdivision = subdivide(quads_.quads, quads_.vertex_count());
      if (!subdivision) return subdivision.error();
      basis_.emplace(quads_, std::move(*subdivision));
    } else {
      basis_.emplace(quads_);
    }
    const double least = options_.samples * static_cast<double>(quads_.quad_count());
    samples_.emplace(surface_, sample_surface(surface_, least, 4 * least), motion_.face_weights, quads_.source, *basis_,
                     context_);
    if (context_.cancelled()) return cancelled_error("fit");
    samples_->place(quads_.positions);
    if (context_.cancelled()) return cancelled_error("fit");
    constexpr double across_quad = 4;  // samples of a line
    const double side = std::sqrt(surface_.total_area() / std::max<Index>(1, quads_.quad_count()));
    line_samples_.emplace(surface_, lines_, quads_, *basis_, side / across_quad);
    return {};
  }
  /// Vertices on lines are fitted to them, but for their corners. On a border beside the surface's, and of a cage where
  /// two sides of one quad are border, they stay.
  void hold_vertices() {
    held_.resize(at(quads_.vertex_count()), 0);
    const QuadCorners corners(quads_);
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      if (!has_quads(v))
        held_[at(v)] = 1;
      else if (!basis_->is_flat())
        held_[at(v)] = held_[at(v)] || corners.at(v).size() == 1;
      else if (lines_.at_corner(quads_.source[at(v)]))
        held_[at(v)] = 1;
    }
    const DrawnQuads cage(quads_);
    for (Index side = 0; side < 4 * quads_.quad_count(); ++side) {
      if (cage.twin(side) != no_index) continue;
      for (const int i : {side % 4, (side + 1) % 4}) {
        const Index v = quads_.quads(side / 4, i);
        on_border_.push_back(v);
        if (basis_->is_flat() && !lines_.lies_on(quads_.source[at(v)])) held_[at(v)] = 1;
      }
    }
    tie_coincident();
  }
  /// Border vertices at one place move as one, or not at all.
  void tie_coincident() {
    leader_.resize(at(quads_.vertex_count()));
    std::iota(leader_.begin(), leader_.end(), Index{0});
    const auto place = [&](Index v) { return std::array<double, 3>{start_(v, 0), start_(v, 1), start_(v, 2)}; };
    std::sort(on_border_.begin(), on_border_.end(),
              [&](Index v, Index w) { return std::pair(place(v), v) < std::pair(place(w), w); });
    on_border_.erase(std::unique(on_border_.begin(), on_border_.end()), on_border_.end());
    for (std::size_t k = 0, first = 0; k < on_border_.size(); ++k) {
      if (place(on_border_[k]) != place(on_border_[first])) first = k;
      leader_[at(on_border_[k])] = on_border_[first];
      if (k == first || !held_[at(on_border_[k])]) continue;
      held_[at(on_border_[first])] = 1;
    }
    // Two corners of one quad do not lie at one place; where they do they are left alone.
    for (Index q = 0; q < quads_.quad_count(); ++q)
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < i; ++j)
          if (leader_[at(quads_.quads(q, i))] == leader_[at(quads_.quads(q, j))])
            held_[at(leader_[at(quads_.quads(q, i))])] = 1;
    for (std::size_t v = 0; v < leader_.size(); ++v) held_[v] = held_[at(leader_[v])];
  }
  [[nodiscard]] bool has_quads(Index v) const { return !basis_->drawn().corners().at(basis_->drawn_vertex(v)).empty(); }
  [[nodiscard]] std::vector<std::span<const Index>> patches() const {
    std::vector<std::span<const Index>> result;
    for (Index q = 0; q < quads_.quad_count(); ++q) result.push_back(basis_->patch(q));
    return result;
  }
  void begin_at_diagonals() {
    for (Index q = 0; q < quads_.quad_count(); ++q)
      if (basis_->drawn().diagonal(q) != 0) {
        const Eigen::Matrix<Index, 1, 4> quad = quads_.quads.row(q);
        quads_.quads.row(q) << quad[1], quad[2], quad[3], quad[0];
      }
  }

  /// Values of the vertices whose sums at the samples are nearest to what these have, in the mean.
  /// \param put called with a sample and add(column, value): what it has
  /// \returns vertices × columns
  template <class Put>
  [[nodiscard]] Expected<Eigen::MatrixXd> project(Index columns, const SolverFactory<double>& factory, Put&& put) {
    const Index n = quads_.vertex_count();
    std::vector<Index> unknown(at(n));
    std::iota(unknown.begin(), unknown.end(), Index{0});
    BlockEquations<1> equations(std::move(unknown), n, patches());
    using Block = BlockEquations<1>::Block;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n, columns), x(n, columns), block;
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      if (q % 256 == 0 && context_.cancelled()) return cancelled_error("fit");
      const std::span<const Index> patch = basis_->patch(q);
      const auto size = static_cast<Eigen::Index>(patch.size());
      double area = 0;
      block.setZero(size, size);
      for (std::size_t k = 0; k < samples_->on(q).size(); ++k) {
        const std::size_t s = samples_->on(q)[k];
        const Eigen::Map<const Eigen::VectorXd> shares(samples_->shares(q, k).data(), size);
        const double weight = samples_->area(s);
        area += weight;
        block.selfadjointView<Eigen::Lower>().rankUpdate(shares, weight);
        put(s, [&](Index column, double value) {
          for (Eigen::Index i = 0; i < size; ++i) right(patch[at(int(i))], column) += weight * shares[i] * value;
        });
      }
      for (Eigen::Index i = 0; i < size; ++i)
        for (Eigen::Index j = 0; j <= i; ++j) equations.add(patch[at(int(i))], patch[at(int(j))], Block(block(i, j)));
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
          const SurfacePoint& point = samples_->point(s);
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

  /// Rows with more influences than allowed: which, with which weights, keep the vertex where all of them take it?
  void limit_influences(FitReport& report) {
    if (!motion_.weights) return;
    const Index most = motion_.influences;
    std::vector<double> pose_weight(motion_.poses.size(), 1.0);
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

  /// The rows of one quad: of each the gradients of normal · (place − sample) by the patch's vertices, a column, and
  /// the value that they are to take off. Kept, so that memory is taken once.
  class QuadRows {
   public:
    explicit QuadRows(const LeastSquaresFit& fit)
        : fit_(fit), transforms_(fit.rows_->poses() + fit.rows_->morphs()), of_(transforms_.size(), no_index) {}

    void collect(Index quad) {
      const std::span<const Index> patch = fit_.basis_->patch(quad);
      const auto size = static_cast<Eigen::Index>(patch.size());
      std::size_t most = 2 * fit_.line_samples_->on(quad).size();
      for (const std::size_t s : fit_.samples_->on(quad)) most += 1 + fit_.rows_->of(s).size();
      if (gradients_.rows() != 3 * size || gradients_.cols() < static_cast<Eigen::Index>(most)) {
        gradients_.resize(3 * size, static_cast<Eigen::Index>(most));
        residuals_.resize(static_cast<Eigen::Index>(most));
        weights_.resize(static_cast<Eigen::Index>(most));
      }
      count_ = 0;
      corner_.resize(patch.size());
      for (std::size_t i = 0; i < patch.size(); ++i) corner_[i] = fit_.quads_.positions.row(patch[i]).transpose();
      for (std::size_t k = 0; k < fit_.samples_->on(quad).size(); ++k) {
        const std::size_t s = fit_.samples_->on(quad)[k];
        const double area = fit_.samples_->weight(s);
        if (!(area > 0)) continue;
        const std::span<const double> shares = fit_.samples_->shares(quad, k);
        if (const double rest = fit_.rows_->rest_share(s); rest > 0) {
          const Vector3& normal = fit_.samples_->normal(s);
          double residual = normal.dot(fit_.samples_->position(s));
          for (std::size_t i = 0; i < shares.size(); ++i) {
            gradients_.col(count_).template segment<3>(static_cast<Eigen::Index>(3 * i)) = shares[i] * normal;
            residual -= shares[i] * normal.dot(corner_[i]);
          }
          push(area * rest, residual);
        }
        for (const PosedRow& posed : fit_.rows_->of(s)) {
          if (!(posed.weight > 0)) continue;
          const auto& transforms = of_pose(quad, patch, posed.pose);
          double residual = posed.offset;
          for (std::size_t i = 0; i < shares.size(); ++i) {
            const auto& t = transforms[i];
            const Vector3 gradient = shares[i] * (t.template leftCols<3>().transpose() * posed.normal);
            gradients_.col(count_).template segment<3>(static_cast<Eigen::Index>(3 * i)) = gradient;
            residual -= gradient.dot(corner_[i]) + shares[i] * posed.normal.dot(t.col(3));
          }
          push(area * posed.weight, residual);
        }
      }
    }
    /// After collect(): the rows of the quad's part of lines.
    void collect_lines(Index quad) {
      for (const std::size_t s : fit_.line_samples_->on(quad))
        collect_line((*fit_.line_samples_)[s], fit_.basis_->patch(quad).size());
    }
    [[nodiscard]] auto gradients() const { return gradients_.leftCols(count_); }
    [[nodiscard]] auto residuals() const { return residuals_.head(count_); }
    [[nodiscard]] auto weights() const { return weights_.head(count_); }

   private:
    using Transform = Eigen::Matrix<double, 3, 4>;

    /// A sample of a line counts as a strip half as wide as its quad's side is long.
    void collect_line(const LineSamples::Sample& sample, std::size_t size) {
      const DrawnQuads& drawn = fit_.basis_->drawn();
      const Index quad = sample.side / 4, cage = fit_.basis_->cage_of(quad);
      const int i = sample.side % 4, j = (i + 1) % 4;
      shares_.assign(size, 0.0);
      fit_.basis_->add_corner(quad, i, 1 - sample.along, shares_);
      fit_.basis_->add_corner(quad, j, sample.along, shares_);
      const Vector3 off = sample.position - drawn.position(drawn.quads()(quad, i)) * (1 - sample.along) -
                          drawn.position(drawn.quads()(quad, j)) * sample.along;
      const auto& corners = fit_.quads_.quads;
      const double width = std::sqrt((fit_.start_.row(corners(cage, 0)) - fit_.start_.row(corners(cage, 2))).norm() *
                                     (fit_.start_.row(corners(cage, 1)) - fit_.start_.row(corners(cage, 3))).norm()) /
                           2;
      for (const Vector3& across : sample.across) {
        for (std::size_t k = 0; k < size; ++k)
          gradients_.col(count_).template segment<3>(static_cast<Eigen::Index>(3 * k)) = shares_[k] * across;
        push(sample.length * width, across.dot(off));
      }
    }
    void push(double weight, double residual) {
      weights_[count_] = weight;
      residuals_[count_++] = residual;
    }
    /// The transforms of a quad's patch in a pose, computed where they are first asked for.
    [[nodiscard]] const std::vector<Transform>& of_pose(Index quad, std::span<const Index> patch, Index pose) {
      std::vector<Transform>& transforms = transforms_[at(pose)];
      if (of_[at(pose)] == quad) return transforms;
      of_[at(pose)] = quad;
      transforms.resize(patch.size());
      const std::size_t poses = fit_.rows_->poses();
      for (std::size_t i = 0; i < patch.size(); ++i) {
        if (at(pose) < poses)
          transforms[i] = blended(fit_.weights_, patch[i], fit_.motion_.poses[at(pose)]);
        else
          transforms[i] << Eigen::Matrix3d::Identity(), fit_.morphs_[at(pose) - poses].row(patch[i]).transpose();
      }
      return transforms;
    }

    const LeastSquaresFit& fit_;
    std::vector<std::vector<Transform>> transforms_;
    std::vector<Index> of_;  // of each pose: the quad whose transforms are held
    std::vector<Vector3> corner_;
    std::vector<double> shares_;
    Eigen::MatrixXd gradients_;
    Eigen::VectorXd residuals_, weights_;
    Eigen::Index count_ = 0;
  };

  void measure(double& rest, double& back, double& posed) {
    struct Sums {
      double rest = 0, posed = 0, weight = 0, back = 0, area = 0;
      Sums& operator+=(const Sums& other) {
        rest += other.rest, posed += other.posed, weight += other.weight, back += other.back, area += other.area;
        return *this;
      }
    };
    std::vector<Sums> sums(at(quads_.quad_count()));
    context_.parallel_for(sums.size(), 64, [&](std::size_t begin, std::size_t end) {
      QuadRows rows(*this);
      for (std::size_t q = begin; q < end; ++q) {
        Sums& own = sums[q];
        rows.collect(static_cast<Index>(q));
        own.posed = (rows.weights().array() * rows.residuals().array().square()).sum();
        for (const std::size_t s : samples_->on(static_cast<Index>(q))) {
          const double off = samples_->normal(s).dot(samples_->position(s) - samples_->place(s).position);
          own.rest += samples_->weight(s) * off * off;
          own.weight += samples_->weight(s);
        }
        measure_back(static_cast<Index>(q), own.back, own.area);
      }
    });
    Sums all;
    for (const Sums& each : sums) all += each;
    const auto rms = [](double squares, double weight) { return weight > 0 ? std::sqrt(squares / weight) : 0; };
    rest = rms(all.rest, all.weight);
    posed = rms(all.posed, all.weight);
    back = rms(all.back, all.area);
  }
  /// From three points of each drawn triangle to the surface: the quadrature that is exact for squares.
  void measure_back(Index quad, double& squares, double& area) const {
    const std::span<const std::size_t> own = samples_->on(quad);
    if (own.empty()) return;
    const DrawnQuads& drawn = basis_->drawn();
    for (const Index part : basis_->drawn_of(quad))
      for (const Index triangle : {2 * part, 2 * part + 1}) {
        const double share = drawn.area(triangle) / 3;
        for (int i = 0; i < 3; ++i) {
          Vector3 barycentric = Vector3::Constant(1.0 / 6);
          barycentric[i] = 2.0 / 3;
          const Vector3 p = drawn.point(triangle, barycentric);
          const SurfacePoint nearest = walk_closest(surface_, p, samples_->point(own.front()));
          const double off = surface_.normal(nearest.face).dot(p - position(surface_, nearest));
          squares += share * off * off;
          area += share;
        }
      }
  }

  [[nodiscard]] Status solve_rounds(const SolverFactory<double>& factory, FitReport& report) {
    std::vector<Index> unknown(at(quads_.vertex_count()), no_index);
    Index unknowns = 0;
    for (std::size_t v = 0; v < unknown.size(); ++v)
      if (!held_[v]) unknown[v] = leader_[v] == static_cast<Index>(v) ? unknowns++ : unknown[at(leader_[v])];
    if (unknowns == 0) return {};
    BlockEquations<3> equations(std::move(unknown), unknowns, patches());
    Expected<AnySolver<double>> solver = factory();
    if (!solver) return solver.error();
    std::vector<double> x(at(3 * unknowns));
    for (; report.rounds < options_.rounds; ++report.rounds) {
      if (report.rounds > 0) place();
      if (context_.cancelled()) return cancelled_error("fit");
      assemble(equations);
      if (Status status = solver->prepare(equations.matrix(), 1, context_); !status.ok()) return status;
      if (SolveInfo info = solver->solve(equations.rhs(), x, context_); !info.status.ok()) return info.status;
      step(equations, x);
    }
    place();
    return {};
  }
  void place() {
    samples_->place(quads_.positions);
    line_samples_->place();
  }

  void assemble(BlockEquations<3>& equations) const {
    equations.clear();
    constexpr Index run = 512;  // quads whose blocks are held at once
    std::vector<Eigen::MatrixXd> block(at(run));
    std::vector<Eigen::VectorXd> right(at(run));
    for (Index begin = 0; begin < quads_.quad_count(); begin += run) {
      const Index count = std::min(run, quads_.quad_count() - begin);
      context_.parallel_for(at(count), 32, [&](std::size_t from, std::size_t to) {
        QuadRows rows(*this);
        Eigen::MatrixXd weighted;
        for (std::size_t k = from; k < to; ++k) {
          rows.collect(begin + static_cast<Index>(k));
          rows.collect_lines(begin + static_cast<Index>(k));
          weighted = rows.gradients() * rows.weights().asDiagonal();
          block[k].noalias() = weighted * rows.gradients().transpose();
          right[k].noalias() = weighted * rows.residuals();
        }
      });
      for (Index k = 0; k < count; ++k) {
        const std::span<const Index> patch = basis_->patch(begin + k);
        for (Index i = 0; i < static_cast<Index>(patch.size()); ++i) {
          equations.add(patch[at(i)], right[at(k)].segment<3>(3 * i));
          for (Index j = 0; j <= i; ++j)
            equations.add(patch[at(i)], patch[at(j)], block[at(k)].block<3, 3>(3 * i, 3 * j));
        }
        keep_order(begin + k, equations);
      }
    }
  }
  /// What a quad adds to keep its corners in order.
  void keep_order(Index q, BlockEquations<3>& equations) const {
    std::array<Vector3, 4> p, moved;
    for (int i = 0; i < 4; ++i) {
      const Index v = quads_.quads(q, i);
      p[at(i)] = quads_.positions.row(v).transpose();
      moved[at(i)] = p[at(i)] - start_.row(v).transpose();
    }
    Vector3 normal = (p[2] - p[0]).cross(p[3] - p[1]);
    const double area = normal.norm() / 2;
    if (!(area > 0)) return;
    normal /= 2 * area;
    const Eigen::Matrix3d along = Eigen::Matrix3d::Identity() - normal * normal.transpose();
    // The limit surface is even where its cage is less so.
    const double even = basis_->is_flat() ? 1 : 0.1;
    const Eigen::Matrix3d hold =
        options_.stiffness * area / 4 * Eigen::Matrix3d::Identity() + even * options_.shear * area / 4 * along;
    const double slip = even * options_.sliding * area / 4;
    for (int i = 0; i < 4; ++i) {
      const int j = (i + 1) % 4;
      const Index v = quads_.quads(q, i), w = quads_.quads(q, j);
      const Vector3 pull = hold * (moved[at(i)] - moved[at(j)]);
      equations.add(v, v, Eigen::Matrix3d(hold + slip * along + 1e-6 * area * Eigen::Matrix3d::Identity()));
      equations.add(w, w, hold);
      equations.add(v, w, Eigen::Matrix3d(-hold));
      equations.add(v, Vector3(-pull - slip * (along * moved[at(i)])));
      equations.add(w, pull);
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
        for (const Index end : {v, w}) reach[at(leader_[at(end)])] = std::min(reach[at(leader_[at(end)])], length);
      }
    }
    Points<double> wish = from;
    for (std::size_t v = 0; v < n; ++v) {
      const Index i = equations.unknown(static_cast<Index>(v));
      if (i == no_index) continue;
      Vector3 whole = from.row(static_cast<Index>(v)).transpose();
      for (int c = 0; c < 3; ++c) whole[c] += x[at(3 * i + c)];
      const Vector3 home = start_.row(static_cast<Index>(v)).transpose();
      const double most = reach[at(leader_[v])];
      if (const double length = (whole - home).norm(); length > most) whole = home + most / length * (whole - home);
      wish.row(static_cast<Index>(v)) = whole.transpose();
    }
    const auto go = [&](Index v) {
      quads_.positions.row(v) = from.row(v) + share[at(leader_[at(v)])] * (wish.row(v) - from.row(v));
    };
    for (Index v = 0; v < quads_.vertex_count(); ++v) go(v);
    const QuadCorners cage(quads_);
    constexpr int halvings = 4;
    std::vector<Index> suspects(m);
    std::iota(suspects.begin(), suspects.end(), Index{0});
    for (int round = 0; !suspects.empty(); ++round) {
      std::vector<Index> touched;
      for (const Index q : suspects) {
        if (scaled_jacobian(quads_.positions, quads_.quads.row(q)) >= std::min(options_.accepted, before[at(q)]))
          continue;
        for (int i = 0; i < 4; ++i) {
          const Index v = leader_[at(quads_.quads(q, i))];
          if (share[at(v)] == 0) continue;
          share[at(v)] = round < halvings ? share[at(v)] / 2 : 0;
          touched.push_back(v);
        }
      }
      suspects.clear();
      add_coincident(touched);
      for (const Index v : touched) {
        go(v);
        for (const Index c : cage.at(v)) suspects.push_back(c / 4);
      }
      std::sort(suspects.begin(), suspects.end());
      suspects.erase(std::unique(suspects.begin(), suspects.end()), suspects.end());
    }
  }

  /// To leaders those that they lead.
  void add_coincident(std::vector<Index>& leaders) const {
    if (on_border_.empty()) return;
    std::sort(leaders.begin(), leaders.end());
    for (const Index v : on_border_)
      if (leader_[at(v)] != v && std::binary_search(leaders.begin(), leaders.end(), leader_[at(v)]))
        leaders.push_back(v);
  }

  const TriangleMesh<double>& surface_;
  const FitMotion& motion_;
  const FitOptions& options_;
  Context& context_;
  QuadMesh quads_;
  const Points<double> start_;
  std::vector<char> held_;
  const SurfaceLines lines_;
  std::vector<Index> on_border_;  // vertices, those at one place together
  std::vector<Index> leader_;     // of each vertex the one that it moves with
  SkinWeights weights_;           // of the vertices
  std::optional<FitBasis> basis_;
  std::optional<PlacedSamples> samples_;
  std::optional<LineSamples> line_samples_;
  const PosedRows* rows_ = nullptr;
  std::vector<Points<double>> morphs_;  // of the vertices
};

}  // namespace detail

QUADRIG_INLINE Expected<FittedQuads> fit(const TriangleMesh<double>& surface, QuadMesh quads, const FitMotion& motion,
                                         std::vector<char> held, const FitOptions& options, Context& context,
                                         const SolverFactory<double>& solver, const EdgeMarks& kept) {
  if (Status status = options.validate(); !status.ok()) return status.error();
  return detail::LeastSquaresFit(surface, std::move(quads), motion, std::move(held), kept, options, context)
      .run(solver);
}

}  // namespace quadrig
