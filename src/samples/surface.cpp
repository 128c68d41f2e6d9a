// From a shape's function to an even mesh: marching tetrahedra, then remeshing.
#include <unordered_map>

#include "quadrig/prepare.hpp"
#include "remesh.hpp"

namespace quadrig::samples {

Vector3 project(const Shape& shape, Vector3 p, int steps) {
  Vector3 gradient;
  for (int i = 0; i < steps; ++i) {
    const double value = shape.distance(p, gradient);
    const double squared = gradient.squaredNorm();
    if (!(squared > 1e-12)) break;
    p -= std::clamp(value / squared, -shape.cell, shape.cell) * gradient;
  }
  return p;
}

namespace {

/// The zero of the function on the six tetrahedra (Kuhn) of each lattice cell: closed and manifold by construction.
Expected<TriangleMesh<double>> march(const Shape& shape, Context& context) {
  Eigen::Array3i cells;
  for (int i = 0; i < 3; ++i) cells[i] = static_cast<int>(std::ceil((shape.high[i] - shape.low[i]) / shape.cell)) + 2;
  const Eigen::Array3i nodes = cells + 1;
  const auto node = [&](int x, int y, int z) { return (static_cast<std::int64_t>(z) * nodes[1] + y) * nodes[0] + x; };
  const auto place = [&](std::int64_t id) {
    const auto x = id % nodes[0], y = id / nodes[0] % nodes[1], z = id / nodes[0] / nodes[1];
    return Vector3(shape.low + shape.cell * (Vector3(double(x), double(y), double(z)) - Vector3::Ones()));
  };
  std::vector<double> value(static_cast<std::size_t>(nodes[0]) * static_cast<std::size_t>(nodes[1]) *
                            static_cast<std::size_t>(nodes[2]));
  context.parallel_for(value.size(), 4096, [&](std::size_t begin, std::size_t end) {
    Vector3 gradient;
    for (std::size_t i = begin; i < end; ++i) value[i] = shape.distance(place(static_cast<std::int64_t>(i)), gradient);
  });
  if (context.cancelled()) return cancelled_error("sample");

  std::unordered_map<std::uint64_t, Index> on_edge;
  std::vector<Vector3> points;
  const auto vertex = [&](std::int64_t a, std::int64_t b) {
    if (a > b) std::swap(a, b);
    const auto key = static_cast<std::uint64_t>(a) * value.size() + static_cast<std::uint64_t>(b);
    const auto [found, fresh] = on_edge.emplace(key, static_cast<Index>(points.size()));
    if (fresh) {
      const double fa = value[static_cast<std::size_t>(a)], fb = value[static_cast<std::size_t>(b)];
      const double t = std::clamp(fa / (fa - fb), 0.1, 0.9);  // away from the nodes: no slivers
      points.push_back((1 - t) * place(a) + t * place(b));
    }
    return found->second;
  };
  PolygonMesh soup;
  constexpr int order[6][2] = {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {2, 0}, {2, 1}};
  for (int z = 0; z < cells[2]; ++z)
    for (int y = 0; y < cells[1]; ++y)
      for (int x = 0; x < cells[0]; ++x)
        for (const auto& steps : order) {
          std::int64_t tetrahedron[4];
          Eigen::Array3i corner(x, y, z);
          tetrahedron[0] = node(x, y, z);
          for (int i = 0; i < 2; ++i) {
            ++corner[steps[i]];
            tetrahedron[i + 1] = node(corner[0], corner[1], corner[2]);
          }
          tetrahedron[3] = node(x + 1, y + 1, z + 1);
          std::vector<std::int64_t> in, out;
          for (const std::int64_t n : tetrahedron) (value[static_cast<std::size_t>(n)] < 0 ? in : out).push_back(n);
          if (in.size() == 1 || out.size() == 1) {
            const std::int64_t one = in.size() == 1 ? in[0] : out[0];
            const auto& three = in.size() == 1 ? out : in;
            soup.add_polygon(std::array{vertex(one, three[0]), vertex(one, three[1]), vertex(one, three[2])});
          } else if (in.size() == 2) {
            const Index a = vertex(in[0], out[0]), b = vertex(in[0], out[1]);
            const Index c = vertex(in[1], out[1]), d = vertex(in[1], out[0]);
            soup.add_polygon(std::array{a, b, c});
            soup.add_polygon(std::array{a, c, d});
          }
        }
  soup.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    soup.positions.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  Context quiet;  // turning the faces outward is no warning here
  Expected<Prepared> mended = prepare(soup, nullptr, {}, quiet);
  if (!mended) return mended.error();
  return std::move(mended->mesh);
}

}  // namespace

Expected<TriangleMesh<double>> surface_mesh(const Shape& shape, Index triangles, Context& context) {
  Expected<TriangleMesh<double>> rough = march(shape, context);
  if (!rough) return rough.error();
  EditableMesh mesh(*rough);
  double wanted = std::sqrt(rough->total_area() / triangles * 4 / std::sqrt(3.0));
  double length = std::min(wanted, shape.cell);
  for (; length < wanted; length *= 1.4) {  // in steps: a large one would tear at thin limbs
    mesh.remesh_round(shape, length, context);
    if (context.cancelled()) return cancelled_error("sample");
  }
  for (int attempt = 0; attempt < 6; ++attempt) {
    for (int round = 0; round < 5; ++round) mesh.remesh_round(shape, wanted, context);
    if (context.cancelled()) return cancelled_error("sample");
    const double ratio = static_cast<double>(mesh.face_count()) / triangles;
    if (std::abs(ratio - 1) < 0.03) break;
    wanted *= std::clamp(std::sqrt(ratio), 0.7, 1.4);
  }
  return mesh.compact();
}

Expected<TriangleMesh<double>> subdivide(const Shape& shape, const TriangleMesh<double>& mesh, Eigen::MatrixXd& weights,
                                         Context& context) {
  const Index n = mesh.vertex_count();
  std::vector<Index> middle(static_cast<std::size_t>(mesh.halfedge_count()));
  Index count = n;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.is_representative(h)) {
      middle[static_cast<std::size_t>(h)] = count;
      if (mesh.twin(h) != no_index) middle[static_cast<std::size_t>(mesh.twin(h))] = count;
      ++count;
    }
  Points<double> positions(count, 3);
  positions.topRows(n) = mesh.positions();
  weights.conservativeResize(count, Eigen::NoChange);
  Triangles faces(4 * mesh.face_count(), 3);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index m = middle[static_cast<std::size_t>(h)], a = mesh.origin(h), b = mesh.target(h);
    positions.row(m) = (positions.row(a) + positions.row(b)) / 2;
    weights.row(m) = (weights.row(a) + weights.row(b)) / 2;
    faces.row(4 * (h / 3) + h % 3) << a, m, middle[static_cast<std::size_t>(TriangleMesh<double>::prev(h))];
    faces(4 * (h / 3) + 3, h % 3) = m;
  }
  Expected<TriangleMesh<double>> finer = TriangleMesh<double>::create(positions, faces);
  if (!finer) return finer;
  for (int round = 0; round < 3; ++round) {
    Points<double> relaxed(count, 3);
    Eigen::MatrixXd smoothed(count, weights.cols());
    context.parallel_for(static_cast<std::size_t>(count), 1024, [&](std::size_t begin, std::size_t end) {
      Vector3 gradient;
      for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) {
        Vector3 sum = Vector3::Zero();
        Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(weights.cols());
        double valence = 0;
        for (Index h = finer->outgoing(v), first = h; valence == 0 || h != first; h = finer->next_around(h)) {
          sum += positions.row(finer->target(h)).transpose();
          row += weights.row(finer->target(h));
          valence += 1;
        }
        const Vector3 p = positions.row(v).transpose();
        (void)shape.distance(p, gradient);
        const Vector3 normal = gradient.normalized(), step = (sum / valence - p) / 2;
        relaxed.row(v) = project(shape, p + step - step.dot(normal) * normal, 2).transpose();
        smoothed.row(v) = (weights.row(v) + row / valence) / 2;
      }
    });
    positions = std::move(relaxed);
    weights = std::move(smoothed);
    if (context.cancelled()) return cancelled_error("sample");
  }
  return TriangleMesh<double>::create(std::move(positions), std::move(faces));
}

}  // namespace quadrig::samples
