#pragma once

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCore>

#include "quadrig/seamless/untangle.hpp"

namespace quadrig {

namespace detail {

class Untangler {
 public:
  Untangler(const TriangleMesh<double>& mesh, const CutGraph& cut, const std::vector<Index>& index,
            const std::vector<Aligned>& aligned, const TargetEdges& target, const UntangleOptions& options,
            std::vector<Complex> z)
      : mesh_(mesh), cut_(cut), index_(index), target_(target), options_(options), z_(std::move(z)) {
    held_.assign(at(mesh.vertex_count()), 0);
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      if (index[at(v)] != 0 || mesh.outgoing(v) == no_index) held_[at(v)] = 3;
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (aligned[at(h)] != Aligned::none)
        for (const Index corner : {h, mesh.next(h)}) {
          const int component = (aligned[at(h)] == Aligned::v_constant ? 1 : 0) ^ (cut.corner_rotation[at(corner)] & 1);
          held_[at(mesh.origin(corner))] |= static_cast<char>(1 << component);
        }
  }

  Expected<UntangledMap> run(Context& context, Budget& budget) {
    UntangleReport report;
    report.defects = check_map(mesh_, index_, z_);
    const std::vector<Complex> start = z_;
    const std::int64_t most =
        std::min(budget.left(Work::untangling), options_.work + 5 * std::int64_t{mesh_.face_count()});
    left_ = most;
    int in_vain = 0;
    for (int rings = 4; rings <= options_.rings && !report.defects.valid() && left_ > 0; rings *= 2) {
      if (context.cancelled()) return cancelled_error("seamless map");
      z_ = start;
      if (!gather(check_map(mesh_, index_, z_), rings)) break;
      report.rings = rings;
      Expected<AnySolver<double>> solver = options_.solver();
      if (!solver) return solver.error();
      report.iterations += descend(*solver, context);
      report.backend = solver->description();
      if (context.cancelled()) return cancelled_error("seamless map");
      const Index before = report.defects.flips + report.defects.wrong_cones;
      report.defects = check_map(mesh_, index_, z_);
      // Few defects may be more for a while; many do not come apart that way.
      report.hopeless = before > 30 && report.defects.flips + report.defects.wrong_cones >= before;
      constexpr int patience = 2;  // neighbourhoods in a row that leave as many
      in_vain = report.defects.flips + report.defects.wrong_cones >= before ? in_vain + 1 : 0;
      if (report.hopeless || in_vain == patience) break;
    }
    report.work = most - left_;
    budget.spend(Work::untangling, report.work);
    if (!report.defects.valid()) z_ = start;
    return UntangledMap{std::move(z_), std::move(report)};
  }

 private:
  struct Piece {
    Index face;
    std::array<Eigen::Vector2d, 3> slope;  // J = Σ z_i slope_iᵀ over the corners
    double weight;
  };

  /// Free vertices within some edges of a defect, and the faces around them. False where that is too much.
  bool gather(const MapDefects& defects, int rings) {
    std::vector<Index> front;
    std::vector<char> seen(at(mesh_.vertex_count()), 0);
    const auto reach = [&](Index v) {
      if (!seen[at(v)]) {
        seen[at(v)] = 1;
        front.push_back(v);
      }
    };
    for (const Index f : defects.flipped_faces)
      for (int i = 0; i < 3; ++i) reach(mesh_.faces()(f, i));
    for (const Index v : defects.wrong_vertices) reach(v);
    std::size_t first = 0;
    for (int ring = 0; ring < rings; ++ring) {
      const std::size_t last = front.size();
      for (std::size_t k = first; k < last; ++k)
        for_each_corner(front[k], [&](Index h) {
          reach(mesh_.target(h));
          reach(mesh_.origin(mesh_.prev(h)));
        });
      first = last;
    }
    variable_.assign(at(2 * mesh_.vertex_count()), no_index);
    count_ = 0;
    std::vector<char> taken(at(mesh_.face_count()), 0);
    pieces_.clear();
    vertices_.clear();
    for (const Index v : front) {
      if (held_[at(v)] == 3) continue;
      vertices_.push_back(v);
      for (int c = 0; c < 2; ++c)
        if (!(held_[at(v)] & (1 << c))) variable_[at(2 * v + c)] = count_++;
      for_each_corner(v, [&](Index h) {
        if (taken[at(h / 3)]) return;
        taken[at(h / 3)] = 1;
        pieces_.push_back(piece(h / 3));
      });
    }
    double mean = 0;
    for (const Piece& p : pieces_) mean += p.weight / static_cast<double>(pieces_.size());
    for (Piece& p : pieces_) p.weight = std::max(p.weight / mean, 0.02);
    return count_ > 0;
  }

  [[nodiscard]] Piece piece(Index f) const {
    Complex a = target_[at(3 * f)], b = target_[at(3 * f + 1)];
    const double longest = std::max({std::norm(a), std::norm(b), std::norm(a + b)});
    if (!(cross(a, b) > 0.02 * longest)) {  // a needle asks for too much: a rounder triangle stands for it
      a = Complex(0.5 * std::sqrt(longest), 0);
      b = a * Complex(-0.5, 0.86602540378443865);
    }
    const double det = cross(a, b);
    const Eigen::Vector2d m0(b.imag() / det, -b.real() / det), m1(-a.imag() / det, a.real() / det);
    return {f, {-m0, m0 - m1, m1}, det};
  }

  using Jacobian = Eigen::Vector4d;  // J00, J01, J10, J11
  [[nodiscard]] Jacobian jacobian(const Piece& p) const {
    Jacobian j = Jacobian::Zero();
    for (int i = 0; i < 3; ++i) {
      const Complex& z = z_[at(3 * p.face + i)];
      const Eigen::Vector2d& s = p.slope[static_cast<std::size_t>(i)];
      j += Jacobian(z.real() * s[0], z.real() * s[1], z.imag() * s[0], z.imag() * s[1]);
    }
    return j;
  }
  [[nodiscard]] static double determinant(const Jacobian& j) { return j[0] * j[3] - j[1] * j[2]; }
  [[nodiscard]] static double positive(double epsilon, double d) {
    const double root = std::sqrt(epsilon * epsilon + d * d);
    return d <= 0 ? epsilon * epsilon / (2 * (root - d)) : (d + root) / 2;
  }
  [[nodiscard]] double energy(double epsilon, double& least) const {
    double total = 0;
    least = std::numeric_limits<double>::infinity();
    for (const Piece& p : pieces_) {
      const Jacobian j = jacobian(p);
      const double d = determinant(j);
      least = std::min(least, d);
      total +=
          p.weight * ((1 - options_.theta) * j.squaredNorm() + options_.theta * (1 + d * d)) / positive(epsilon, d);
    }
    return total;
  }

  /// Newton steps on the regularized energy of Garanzha et al. 2021, epsilon sinking with progress.
  int descend(AnySolver<double>& solver, Context& context) {
    const double theta = options_.theta;
    double epsilon = 1, least = 0;
    double value = energy(epsilon, least);
    if (least < 0) epsilon = std::max(0.1, std::min(1.0, -least));
    value = energy(epsilon, least);
    int step = 0, after = 0;
    for (; step < options_.iterations && left_ > 0; ++step) {
      left_ -= static_cast<std::int64_t>(pieces_.size());
      std::vector<Eigen::Triplet<double>> entries;
      entries.reserve(36 * pieces_.size() + at(count_));
      Eigen::VectorXd gradient = Eigen::VectorXd::Zero(count_);
      for (const Piece& p : pieces_) {
        const Jacobian j = jacobian(p);
        const double d = determinant(j), root = std::sqrt(epsilon * epsilon + d * d);
        const double chi = positive(epsilon, d), chi1 = 0.5 + d / (2 * root),
                     chi2 = epsilon * epsilon / (2 * root * root * root);
        const double n = (1 - theta) * j.squaredNorm() + theta * (1 + d * d);
        const Jacobian cofactor(j[3], -j[2], -j[1], j[0]);
        const Jacobian dn = 2 * (1 - theta) * j + 2 * theta * d * cofactor;
        const Jacobian slope = dn / chi - (n * chi1 / (chi * chi)) * cofactor;
        Eigen::Matrix4d twist = Eigen::Matrix4d::Zero();
        twist(0, 3) = twist(3, 0) = 1;
        twist(1, 2) = twist(2, 1) = -1;
        const Eigen::Matrix4d outer = cofactor * cofactor.transpose();
        Eigen::Matrix4d hessian =
            (2 * (1 - theta) * Eigen::Matrix4d::Identity() + 2 * theta * (outer + d * twist)) / chi -
            (chi1 / (chi * chi)) * (dn * cofactor.transpose() + cofactor * dn.transpose()) +
            (2 * n * chi1 * chi1 / (chi * chi * chi) - n * chi2 / (chi * chi)) * outer -
            (n * chi1 / (chi * chi)) * twist;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> spectrum(hessian);
        const Eigen::Vector4d values =
            spectrum.eigenvalues().cwiseMax(1e-9 * spectrum.eigenvalues().cwiseAbs().maxCoeff());
        hessian = spectrum.eigenvectors() * values.asDiagonal() * spectrum.eigenvectors().transpose();
        // Corner i, coordinate c in the vertex's own sector: a column of dJ/dx each.
        std::array<Index, 6> where{};
        Eigen::Matrix<double, 4, 6> map = Eigen::Matrix<double, 4, 6>::Zero();
        for (int i = 0; i < 3; ++i) {
          const Index h = 3 * p.face + i, v = mesh_.origin(h);
          const Eigen::Vector2d& s = p.slope[static_cast<std::size_t>(i)];
          for (int c = 0; c < 2; ++c) {
            where[static_cast<std::size_t>(2 * i + c)] = variable_[at(2 * v + c)];
            const Complex move = rotated(c == 0 ? Complex(1, 0) : Complex(0, 1), cut_.corner_rotation[at(h)]);
            map.col(2 * i + c) =
                Jacobian(move.real() * s[0], move.real() * s[1], move.imag() * s[0], move.imag() * s[1]);
          }
        }
        const Eigen::Matrix<double, 6, 6> block = p.weight * map.transpose() * hessian * map;
        const Eigen::Matrix<double, 6, 1> part = p.weight * map.transpose() * slope;
        for (int r = 0; r < 6; ++r) {
          const Index row = where[static_cast<std::size_t>(r)];
          if (row == no_index) continue;
          gradient[row] += part[r];
          for (int c = 0; c < 6; ++c)
            if (const Index column = where[static_cast<std::size_t>(c)]; column != no_index && column <= row)
              entries.emplace_back(row, column, block(r, c));
        }
      }
      Eigen::SparseMatrix<double, Eigen::ColMajor, Index> matrix(count_, count_);
      matrix.setFromTriplets(entries.begin(), entries.end());
      const auto n = at(count_), nonzeros = static_cast<std::size_t>(matrix.nonZeros());
      const HermitianView<double> view{
          count_, {matrix.outerIndexPtr(), n + 1}, {matrix.innerIndexPtr(), nonzeros}, {matrix.valuePtr(), nonzeros}};
      constexpr std::uint64_t only_pattern = 1;
      Eigen::VectorXd direction(count_);
      if (!solver.prepare(view, only_pattern, context).ok() ||
          !solver.solve({gradient.data(), n}, {direction.data(), n}, context).status.ok() || !direction.allFinite())
        return step;
      direction = -direction;
      const double slope = gradient.dot(direction);
      const std::vector<Complex> before = corners();
      double length = 1, next = value, next_least = least;
      bool moved = false;
      for (int halving = 0; halving < 30; ++halving, length /= 2) {
        put(before, length * direction);
        next = energy(epsilon, next_least);
        if (next <= value + 1e-4 * length * slope) {
          moved = true;
          break;
        }
      }
      if (!moved) {
        put(before, 0 * direction);
        next = energy(epsilon, next_least);
      }
      const double progress = std::max(1 - next / value, 0.1);
      least = next_least;
      if (least > 0 && (++after > 6 || !moved || 1 - next / value < 1e-3)) return step + 1;
      const double mu = (1 - progress) * positive(epsilon, least);
      epsilon = least < mu ? std::max(1e-9, 2 * std::sqrt(mu * (mu - least))) : 1e-9;
      value = energy(epsilon, least);
    }
    return step;
  }

  /// Positions of the free vertices, in their own sectors.
  [[nodiscard]] std::vector<Complex> corners() const {
    std::vector<Complex> base;
    base.reserve(vertices_.size());
    for (const Index v : vertices_) base.push_back(z_[at(mesh_.outgoing(v))]);
    return base;
  }
  void put(const std::vector<Complex>& base, const Eigen::VectorXd& move) {
    for (std::size_t k = 0; k < vertices_.size(); ++k) {
      const Index v = vertices_[k], first = mesh_.outgoing(v);
      const Index u = variable_[at(2 * v)], w = variable_[at(2 * v + 1)];
      const Complex step(u == no_index ? 0.0 : move[u], w == no_index ? 0.0 : move[w]);
      const Complex change = base[k] + rotated(step, cut_.corner_rotation[at(first)]) - z_[at(first)];
      const Complex sector = rotated(change, -cut_.corner_rotation[at(first)]);
      for_each_corner(v, [&](Index h) { z_[at(h)] += rotated(sector, cut_.corner_rotation[at(h)]); });
    }
  }
  template <class Body>
  void for_each_corner(Index v, Body&& body) const {
    const Index start = mesh_.outgoing(v);
    if (start == no_index) return;
    Index h = start;
    do {
      body(h);
      h = mesh_.next_around(h);
    } while (h != no_index && h != start);
  }

  const TriangleMesh<double>& mesh_;
  const CutGraph& cut_;
  const std::vector<Index>& index_;
  const TargetEdges& target_;
  const UntangleOptions& options_;
  std::vector<Complex> z_;
  std::vector<char> held_;
  std::vector<Index> variable_, vertices_;
  std::vector<Piece> pieces_;
  Index count_ = 0;
  std::int64_t left_ = 0;
};

}  // namespace detail

QUADRIG_INLINE Expected<UntangledMap> untangle(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                               const std::vector<Index>& index, const std::vector<Aligned>& aligned,
                                               const TargetEdges& target, const UntangleOptions& options,
                                               std::vector<Complex> z, Context& context, Budget& budget) {
  return detail::Untangler(mesh, cut, index, aligned, target, options, std::move(z)).run(context, budget);
}

}  // namespace quadrig
