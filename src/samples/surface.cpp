// From a shape's function to an even mesh: marching tetrahedra, then remeshing.
#include <map>
#include <unordered_map>

#include "quadrig/disjoint_sets.hpp"
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

std::uint8_t planes_at(const Shape& shape, const Vector3& p) {
  std::uint8_t planes = 0;
  for (std::size_t i = 0; i < shape.kept.size(); ++i)
    if (p[shape.kept[i].axis] == shape.kept[i].at) planes |= static_cast<std::uint8_t>(1U << i);
  return planes;
}

Vector3 project_within(const Shape& shape, std::uint8_t planes, Vector3 p, int steps) {
  if (planes == 0) return project(shape, p, steps);
  Vector3 gradient;
  for (int i = 0;; ++i) {
    for (std::size_t k = 0; k < shape.kept.size(); ++k)
      if ((planes >> k & 1U) != 0) p[shape.kept[k].axis] = shape.kept[k].at;
    if (i == steps) return p;
    const double value = shape.distance(p, gradient);
    for (std::size_t k = 0; k < shape.kept.size(); ++k)
      if ((planes >> k & 1U) != 0) gradient[shape.kept[k].axis] = 0;
    const double squared = gradient.squaredNorm();
    if (!(squared > 1e-2)) return p;  // the surface lies along the plane
    p -= std::clamp(value / squared, -shape.cell, shape.cell) * gradient;
  }
}

std::vector<Index> plane_regions(const Shape& shape, const TriangleMesh<double>& mesh) {
  DisjointSets sets(static_cast<std::size_t>(mesh.face_count()));
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) != no_index &&
        (planes_at(shape, mesh.position(mesh.origin(h))) & planes_at(shape, mesh.position(mesh.target(h)))) == 0)
      sets.join(h / 3, mesh.twin(h) / 3);
  std::vector<Index> region(static_cast<std::size_t>(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) region[static_cast<std::size_t>(f)] = sets.find(f);
  return region;
}

namespace {

/// The half of the mesh beyond x = 0, and its image in the mirror.
Expected<TriangleMesh<double>> mirror(const Shape& shape, const TriangleMesh<double>& mesh) {
  const std::vector<Index> region = plane_regions(shape, mesh);
  std::unordered_map<Index, double> side;
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i)
      side[region[static_cast<std::size_t>(f)]] += mesh.area(f) * mesh.position(mesh.faces()(f, i)).x();
  std::vector<Index> number(static_cast<std::size_t>(mesh.vertex_count()), no_index);
  std::vector<Index> image = number;
  std::vector<Vector3> points;
  std::vector<std::array<Index, 3>> faces;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (side[region[static_cast<std::size_t>(f)]] < 0) continue;
    std::array<Index, 3> here{}, there{};
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(f, i);
      const auto k = static_cast<std::size_t>(v);
      Vector3 p = mesh.position(v);
      if (number[k] == no_index) {
        number[k] = image[k] = static_cast<Index>(points.size());
        points.push_back(p);
        if (p.x() != 0) {
          p.x() = -p.x();
          image[k] = static_cast<Index>(points.size());
          points.push_back(p);
        }
      }
      here[static_cast<std::size_t>(i)] = number[k];
      there[static_cast<std::size_t>(2 - i)] = image[k];
    }
    faces.push_back(here);
    faces.push_back(there);
  }
  Points<double> positions(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v) positions.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  Triangles corners(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int i = 0; i < 3; ++i) corners(static_cast<Eigen::Index>(f), i) = faces[f][static_cast<std::size_t>(i)];
  return TriangleMesh<double>::create(std::move(positions), std::move(corners));
}

/// The zero of the function on the six tetrahedra (Kuhn) of each lattice cell: closed and manifold by construction.
Expected<TriangleMesh<double>> march(const Shape& shape, Context& context) {
  Eigen::Array3i cells;
  for (int i = 0; i < 3; ++i) cells[i] = static_cast<int>(std::ceil((shape.high[i] - shape.low[i]) / shape.cell)) + 2;
  const Eigen::Array3i nodes = cells + 1;
  const auto node = [&](int x, int y, int z) { return (static_cast<std::int64_t>(z) * nodes[1] + y) * nodes[0] + x; };
  const auto place = [&](std::int64_t id) {
    const auto x = id % nodes[0], y = id / nodes[0] % nodes[1], z = id / nodes[0] / nodes[1];
    Vector3 p = shape.low + shape.cell * (Vector3(double(x), double(y), double(z)) - Vector3::Ones());
    for (const KeptPlane& plane : shape.kept)  // a layer of the lattice lies in each
      if (std::abs(p[plane.axis] - plane.at) <= shape.cell / 2) p[plane.axis] = plane.at;
    return p;
  };
  std::vector<double> value(static_cast<std::size_t>(nodes[0]) * static_cast<std::size_t>(nodes[1]) *
                            static_cast<std::size_t>(nodes[2]));
  // Blocks of nodes that the surface is far from keep the sign of their middle; "about the distance" leaves room.
  constexpr int block = 4;
  const double far = 2.5 * block * shape.cell;
  const Eigen::Array3i blocks = (nodes + (block - 1)) / block;
  context.parallel_for(static_cast<std::size_t>(blocks.prod()), 64, [&](std::size_t begin, std::size_t end) {
    Vector3 gradient;
    for (std::size_t i = begin; i < end; ++i) {
      const auto n = static_cast<int>(i);
      const Eigen::Array3i low =
          block * Eigen::Array3i(n % blocks[0], n / blocks[0] % blocks[1], n / blocks[0] / blocks[1]);
      const Eigen::Array3i high = (low + block).min(nodes), middle = (low + block / 2).min(nodes - 1);
      const double there = shape.distance(place(node(middle[0], middle[1], middle[2])), gradient);
      for (int z = low[2]; z < high[2]; ++z)
        for (int y = low[1]; y < high[1]; ++y)
          for (int x = low[0]; x < high[0]; ++x) {
            const std::int64_t id = node(x, y, z);
            value[static_cast<std::size_t>(id)] = std::abs(there) > far ? there : shape.distance(place(id), gradient);
          }
    }
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
      const Vector3 from = place(a), to = place(b);
      Vector3 p = (1 - t) * from + t * to;
      for (const KeptPlane& plane : shape.kept)
        if (from[plane.axis] == plane.at && to[plane.axis] == plane.at) p[plane.axis] = plane.at;
      points.push_back(p);
    }
    return found->second;
  };
  PolygonMesh soup;
  constexpr int order[6][2] = {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {2, 0}, {2, 1}};
  for (int z = 0; z < cells[2]; ++z)
    for (int y = 0; y < cells[1]; ++y)
      for (int x = 0; x < cells[0]; ++x) {
        int inside = 0;
        for (int corner = 0; corner < 8; ++corner)
          inside +=
              value[static_cast<std::size_t>(node(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)))] < 0;
        if (inside == 0 || inside == 8) continue;
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
  EditableMesh mesh(shape, *rough);
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
  Expected<TriangleMesh<double>> even = mesh.compact();
  return even && shape.mirrored ? mirror(shape, *even) : std::move(even);
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
        double valence = 0, along = 0;
        const Vector3 p = positions.row(v).transpose();
        const std::uint8_t planes = planes_at(shape, p);
        for (Index h = finer->outgoing(v), first = h; valence == 0 || h != first; h = finer->next_around(h)) {
          const Vector3 q = positions.row(finer->target(h)).transpose();
          row += weights.row(finer->target(h));
          valence += 1;
          if ((planes & planes_at(shape, q)) != planes) continue;
          sum += q;
          along += 1;
        }
        (void)shape.distance(p, gradient);
        const Vector3 normal = gradient.normalized();
        const Vector3 step = along > 0 ? Vector3((sum / along - p) / 2) : Vector3::Zero();
        relaxed.row(v) = project_within(shape, planes, p + step - step.dot(normal) * normal, 2).transpose();
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
