// A solver backend of one's own: conjugate gradients with a diagonal preconditioner, checked by the laws of backends
// and then used for a field.
#include <cstdio>

#include "quadrig/asset.hpp"
#include "quadrig/field.hpp"
#include "quadrig/laws.hpp"

using quadrig::Context;
using quadrig::Error;
using quadrig::ErrorCode;
using quadrig::HermitianView;
using quadrig::Index;
using quadrig::SolveInfo;
using quadrig::Status;

template <class K>
class ConjugateGradients {
 public:
  [[nodiscard]] static constexpr std::string_view name() { return "conjugate gradients"; }

  static Status analyze(const HermitianView<K>&, std::span<const Index>, Context&) { return {}; }

  Status factorize(const HermitianView<K>& A, Context&) {
    matrix_ = {A.size,
               {A.column_starts.begin(), A.column_starts.end()},
               {A.rows.begin(), A.rows.end()},
               {A.values.begin(), A.values.end()}};
    inverse_diagonal_.clear();
    for (Index i = 0; i < A.size; ++i) {
      const auto diagonal = std::real(A.values[static_cast<std::size_t>(A.column_starts[static_cast<std::size_t>(i)])]);
      if (!(diagonal > 0 && std::isfinite(diagonal)))
        return Error{ErrorCode::numeric, "the matrix is not positive definite", "unknown " + std::to_string(i), {}};
      inverse_diagonal_.push_back(1 / diagonal);
    }
    return {};
  }

  SolveInfo solve(std::span<const K> b, std::span<K> x, Context& context) {
    using Real = quadrig::real_of<K>;
    const std::size_t n = b.size();
    const auto dot = [](const std::vector<K>& p, const std::vector<K>& q) {
      Real sum = 0;
      for (std::size_t i = 0; i < p.size(); ++i) sum += std::real(quadrig::conjugate(p[i]) * q[i]);
      return sum;
    };
    std::fill(x.begin(), x.end(), K{});
    std::vector<K> residual(b.begin(), b.end()), scaled(n), search(n), image(n);
    const Real scale = std::sqrt(dot(residual, residual));
    if (scale == 0) return {.status = {}, .residual = 0};
    Real previous = 0, size = scale;
    SolveInfo info;
    for (const auto limit = static_cast<Index>(20 * n + 100); info.iterations < limit; ++info.iterations) {
      if (context.cancelled()) return {.status = quadrig::cancelled_error("conjugate gradients")};
      for (std::size_t i = 0; i < n; ++i) scaled[i] = inverse_diagonal_[i] * residual[i];
      const Real now = dot(residual, scaled);
      for (std::size_t i = 0; i < n; ++i)
        search[i] = scaled[i] + (info.iterations > 0 ? now / previous : Real(0)) * search[i];
      previous = now;
      quadrig::multiply(matrix_.view(), std::span<const K>(search), std::span<K>(image));
      const Real curvature = dot(search, image);
      if (!(curvature > 0)) {
        info.status = Error{ErrorCode::numeric, "the matrix is not positive definite", name().data(), {}};
        return info;
      }
      for (std::size_t i = 0; i < n; ++i) {
        x[i] += now / curvature * search[i];
        residual[i] -= now / curvature * image[i];
      }
      size = std::sqrt(dot(residual, residual));
      if (size <= 4 * std::numeric_limits<Real>::epsilon() * scale) break;
    }
    info.residual = static_cast<double>(size / scale);
    if (!(info.residual < 1e-5)) info.status = Error{ErrorCode::numeric, "no convergence", name().data(), {}};
    return info;
  }

 private:
  quadrig::HermitianMatrix<K> matrix_;
  std::vector<quadrig::real_of<K>> inverse_diagonal_;
};

// A tetrahedron, each triangle split in four and pushed to the unit sphere, n times.
static quadrig::TriangleMesh<double> ball(int n) {
  quadrig::Points<double> points(4, 3);
  points << 1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1;
  quadrig::Triangles faces(4, 3);
  faces << 0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2;
  for (; n > 0; --n) {
    const auto mesh = quadrig::TriangleMesh<double>::create(points, faces).value();
    std::vector<Index> middle(static_cast<std::size_t>(mesh.halfedge_count()));
    Index count = mesh.vertex_count();
    points.conservativeResize(count + mesh.edge_count(), 3);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      if (!mesh.is_representative(h)) continue;
      points.row(count) = (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))).transpose() / 2;
      middle[static_cast<std::size_t>(h)] = middle[static_cast<std::size_t>(mesh.twin(h))] = count++;
    }
    faces.resize(4 * mesh.face_count(), 3);
    for (Index f = 0; f < mesh.face_count(); ++f) {
      const Index a = mesh.faces()(f, 0), b = mesh.faces()(f, 1), c = mesh.faces()(f, 2);
      const auto at = static_cast<std::size_t>(3 * f);
      faces.row(4 * f) << a, middle[at], middle[at + 2];
      faces.row(4 * f + 1) << middle[at], b, middle[at + 1];
      faces.row(4 * f + 2) << middle[at + 2], middle[at + 1], c;
      faces.row(4 * f + 3) << middle[at], middle[at + 1], middle[at + 2];
    }
  }
  points.rowwise().normalize();
  return quadrig::TriangleMesh<double>::create(points, faces).value();
}

int main() {
  Context context;
  const auto make = [] { return ConjugateGradients<quadrig::Complex>(); };
  if (const Status lawful = quadrig::check_solver_backend<quadrig::Complex>(make, context); !lawful) {
    std::fprintf(stderr, "%s\n", lawful.error().message().c_str());
    return 1;
  }

  quadrig::Points<double> points = ball(4).positions();
  points.col(0) *= 1.7;  // an ellipsoid of three axes
  points.col(1) *= 1.3;
  const quadrig::Asset asset{quadrig::TriangleMesh<double>::create(points, ball(4).faces()).value(), {}};
  const quadrig::Connection<double> connection(asset.mesh);
  quadrig::FieldOptions own, standard;
  own.own_solver = [&]() -> quadrig::Expected<quadrig::AnySolver<quadrig::Complex>> { return {make()}; };
  const auto a = quadrig::design_field(asset, connection, own, context);
  const auto b = quadrig::design_field(asset, connection, standard, context);
  if (!a || !b) {
    std::fprintf(stderr, "%s\n", (a ? b : a).error().message().c_str());
    return 1;
  }
  double difference = 0;
  for (std::size_t f = 0; f < a->polynomial.x0.size(); ++f)
    difference = std::max(difference, std::abs(a->polynomial.x0[f] - b->polynomial.x0[f]));
  std::printf("%d faces, index sum %d, differs from the default backend by %.1e at most\n", asset.mesh.face_count(),
              a->singularities.sum, difference);
  return difference < 1e-6 ? 0 : 1;
}
