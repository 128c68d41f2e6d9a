// Skin weights as the equilibrium of heat between bones and surface.
#include <Eigen/SparseCholesky>

#include "shape.hpp"

namespace quadrig::samples {

Expected<Eigen::MatrixXd> heat_weights(const Shape& shape, const TriangleMesh<double>& mesh, Context& context) {
  const Index n = mesh.vertex_count(), bones = shape.skeleton.bone_count();
  constexpr double sharpness = 2.5;  // blends are about as wide as the limb is thick
  Eigen::MatrixXd source = Eigen::MatrixXd::Zero(n, bones);
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(n);
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i) mass[mesh.faces()(f, i)] += mesh.area(f) / 3;
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < n; ++v) {
    Index nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Index b = 0; b < bones; ++b) {
      const double d = shape.limb_distance(b, mesh.position(v));
      if (d < least) least = d, nearest = b;
    }
    const Bone& bone = shape.skeleton.bones[static_cast<std::size_t>(nearest)];
    const Vector3 axis = bone.tail - bone.head;
    const double t = std::clamp((mesh.position(v) - bone.head).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    const double reach = std::max((mesh.position(v) - bone.head - t * axis).squaredNorm(), 1e-8);
    const double heat = sharpness * mass[v] / reach;
    entries.emplace_back(v, v, heat);
    source(v, nearest) = heat;
  }
  for (Index c = 0; c < mesh.halfedge_count(); ++c) {  // half the cotangent of each corner, for the edge across
    const elementary::SinCos corner = elementary::sincos(mesh.corner_angle(c));
    const double cotangent = std::clamp(0.5 * corner.cos / corner.sin, 0.0, 10.0);
    const Index a = mesh.target(c), b = mesh.origin(TriangleMesh<double>::prev(c));
    entries.emplace_back(a, a, cotangent);
    entries.emplace_back(b, b, cotangent);
    entries.emplace_back(a, b, -cotangent);
    entries.emplace_back(b, a, -cotangent);
  }
  Eigen::SparseMatrix<double> system(n, n);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
  if (solver.info() != Eigen::Success)
    return Error{ErrorCode::numeric, "the heat equation of the sample could not be factorized", "sample", {}};
  if (context.cancelled()) return cancelled_error("sample");
  return Eigen::MatrixXd(solver.solve(source));
}

}  // namespace quadrig::samples
