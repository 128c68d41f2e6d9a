// What lies over the skin of the head, and its eyes.
#include "head.hpp"

namespace quadrig::samples::head {
namespace {

/// A grid of points as triangles, in pairs; texture coordinates run over it from 0 to 1.
struct Grid {
  Index rows = 0, columns = 0;
  std::vector<Vector3> points;
};

/// `turned`: faces look the other way.
void add_grid(Part& part, const Grid& grid, bool turned) {
  const auto first = static_cast<Index>(part.positions.rows()), faces = static_cast<Index>(part.faces.rows());
  const auto count = static_cast<Index>(grid.points.size());
  part.positions.conservativeResize(first + count, 3);
  part.texture.conservativeResize(first + count, 2);
  part.faces.conservativeResize(faces + 2 * (grid.rows - 1) * (grid.columns - 1), 3);
  Index f = faces;
  for (Index r = 0; r < grid.rows; ++r)
    for (Index c = 0; c < grid.columns; ++c) {
      const Index v = first + r * grid.columns + c;
      part.positions.row(v) = grid.points[detail::at(v - first)].transpose();
      part.texture.row(v) << double(c) / (grid.columns - 1), double(r) / (grid.rows - 1);
      if (r + 1 == grid.rows || c + 1 == grid.columns) continue;
      const Index right = v + 1, up = v + grid.columns, across = up + 1;
      if (turned) {
        part.faces.row(f++) << v, up, across;
        part.faces.row(f++) << v, across, right;
      } else {
        part.faces.row(f++) << v, right, across;
        part.faces.row(f++) << v, across, up;
      }
    }
}

Vector3 image(const Vector3& p) { return {-p.x(), p.y(), p.z()}; }

void add_both(Part& part, Grid grid, bool turned = false) {
  add_grid(part, grid, turned);
  for (Vector3& p : grid.points) p = image(p);
  add_grid(part, grid, !turned);
}

template <class Place>
Grid grid(Index rows, Index columns, Place&& place) {
  Grid made{rows, columns, {}};
  for (Index r = 0; r < rows; ++r)
    for (Index c = 0; c < columns; ++c) made.points.push_back(place(double(r) / (rows - 1), double(c) / (columns - 1)));
  return made;
}

Vector3 above(const Shape& shape, const Vector3& near, double height) {
  const Vector3 p = project(shape, near, 12);
  Vector3 gradient;
  (void)shape.distance(p, gradient);
  return p + height * gradient.normalized();
}

/// Rings about a path; ends stay open unless it is closed.
Grid tube(const std::vector<Vector3>& path, double radius, bool closed) {
  constexpr Index sides = 6;
  const auto count = static_cast<Index>(path.size());
  Grid made{closed ? count + 1 : count, sides + 1, {}};
  Vector3 side = Vector3::Zero();
  for (Index r = 0; r < made.rows; ++r) {
    const Index here = r % count;
    const Index before = closed ? (here + count - 1) % count : std::max(here - 1, 0);
    const Index after = closed ? (here + 1) % count : std::min(here + 1, count - 1);
    const Vector3 along = (path[detail::at(after)] - path[detail::at(before)]).normalized();
    if (r == 0) side = std::abs(along.y()) < 0.9 ? Vector3::UnitY() : Vector3::UnitZ();
    side = (side - side.dot(along) * along).normalized();
    const Vector3 other = along.cross(side);
    for (Index c = 0; c <= sides; ++c) {
      const double angle = 2 * pi * (c % sides) / sides;
      made.points.push_back(path[detail::at(here)] +
                            radius * (elementary::cos(angle) * side + elementary::sin(angle) * other));
    }
  }
  if (closed)  // the last ring is the first, however the path turned
    for (Index c = 0; c <= sides; ++c)
      made.points[detail::at((made.rows - 1) * (sides + 1) + c)] = made.points[detail::at(c)];
  return made;
}

const Vector3 rim(0.0335, 0.007, 0.094);

std::vector<Vector3> rim_path(double scale) {
  std::vector<Vector3> path;
  constexpr int count = 24;
  for (int i = 0; i < count; ++i) {
    const double a = 2 * pi * i / count;
    path.push_back(rim + scale * Vector3(0.0235 * elementary::cos(a), 0.0185 * elementary::sin(a),
                                         -0.1 * 0.0235 * elementary::cos(a)));
  }
  return path;
}

void finish(Part& part, Material material) {
  part.material = material;
  part.normals = vertex_normals(part.positions, part.faces);
}

}  // namespace

Part eyes() {
  Part part;
  add_both(part,
           grid(11, 17,
                [](double t, double around) {
                  const double polar = pi * t, angle = 2 * pi * (around < 1 ? around : 0);
                  return Vector3(eye + eye_radius * Vector3(elementary::sin(polar) * elementary::cos(angle),
                                                            elementary::sin(polar) * elementary::sin(angle),
                                                            elementary::cos(polar)));
                }),
           true);
  finish(part, eye_material);
  return part;
}

Part brows_and_lashes(const Shape& shape) {
  Part part;
  add_both(part, grid(3, 9, [&](double across, double along) {
             const double x = 0.013 + 0.038 * along,
                          middle = 0.0335 + 0.0065 * elementary::sin(pi * 0.75 * along) - 0.003 * along;
             const double width = 0.0055 * (1 - 0.75 * along);
             return above(shape, {x, middle + width * (across - 0.5), 0.1 - 0.02 * along}, 0.0012);
           }));
  const auto lashes = [](bool upper, double length) {
    return grid(3, 11, [upper, length](double out, double along) {
      const double u = 0.0118 * (2 * along - 1), v = upper ? upper_margin(u) + 0.0004 : lower_margin(u) - 0.0004;
      const double reach = 0.0163, forward = std::sqrt(reach * reach - u * u - v * v);
      const double lift = (upper ? 1 : -1) * length * out * (0.25 + 0.45 * out);
      return Vector3(eye + Vector3(u * (1 + 0.12 * out), v + lift, forward + length * out));
    });
  };
  part.roots = part.positions;
  for (const bool upper : {true, false}) {
    Part bare;
    add_both(bare, lashes(upper, 0));
    add_both(part, lashes(upper, upper ? 0.0055 : 0.003), !upper);
    part.roots.conservativeResize(part.positions.rows(), 3);
    part.roots.bottomRows(bare.positions.rows()) = bare.positions;
  }
  finish(part, hair_material);
  return part;
}

Part hair(const Shape& shape) {
  Part part;
  constexpr int around = 22;
  struct Layer {
    double from, to, fringe, height;  // degrees above the level of the middle; metres over the skin
  };
  for (const Layer& layer : {Layer{88, 12, 45, 0.004}, Layer{70, -22, 40, 0.0065}, Layer{52, -48, 36, 0.009}})
    for (int i = 0; i < around / 2; ++i) {
      const double middle = 2 * pi * (i + 0.5) / around, half = 0.62 * 2 * pi / around;
      const bool front = middle < 0.95;
      const double end = front ? layer.fringe : layer.to;
      add_both(part,
               grid(8, 3,
                    [&](double down, double across) {
                      const double level = (layer.from + (end - layer.from) * down) * pi / 180;
                      const double turn = middle + half * (2 * across - 1) * (1 - 0.35 * down);
                      const Vector3 out(elementary::cos(level) * elementary::sin(turn), elementary::sin(level),
                                        elementary::cos(level) * elementary::cos(turn));
                      const double crown = 0.0015 * (1 - (2 * across - 1) * (2 * across - 1));
                      return above(shape, Vector3(0, 0.03, -0.02) + 0.115 * out, layer.height + crown + 0.002 * down);
                    }),
               true);
    }
  finish(part, hair_material);
  return part;
}

Part spectacles() {
  Part part;
  add_both(part, tube(rim_path(1), 0.0013, true));
  std::vector<Vector3> bridge;
  for (int i = 0; i <= 8; ++i) {
    const double t = i / 4.0 - 1;
    bridge.emplace_back(0.0108 * t, rim.y() + 0.0065 - 0.003 * t * t, rim.z() + 0.006 - 0.004 * t * t);
  }
  add_grid(part, tube(bridge, 0.0012, false), false);
  add_both(part, tube({{0.0568, 0.009, 0.0915},
                       {0.066, 0.0105, 0.084},
                       {0.073, 0.0125, 0.06},
                       {0.0765, 0.0145, 0.03},
                       {0.0775, 0.016, 0.004},
                       {0.0785, 0.014, -0.012},
                       {0.079, 0.005, -0.026},
                       {0.078, -0.006, -0.034}},
                      0.0012, false));
  finish(part, frame_material);
  return part;
}

Part lenses() {
  Part part;
  const std::vector<Vector3> path = rim_path(0.96);
  add_both(part,
           grid(4, 25,
                [&](double out, double along) {
                  const auto i = static_cast<std::size_t>(std::lround(24 * along)) % path.size();
                  return Vector3(rim + (0.02 + 0.98 * out) * (path[i] - rim) + Vector3(0, 0, 0.0012 * (1 - out * out)));
                }),
           true);
  finish(part, glass_material);
  return part;
}

}  // namespace quadrig::samples::head
