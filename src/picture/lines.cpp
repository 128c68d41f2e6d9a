// Lines along a cross field.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "picture/panel.hpp"
#include "quadrig/field.hpp"

namespace quadrig {

namespace {

/// Points of lines by place, to keep lines that run alike apart.
class Spacing {
 public:
  explicit Spacing(double distance) : distance_(distance) {}

  void add(const Vector3& point, const Vector3& direction) { cells_[key(point)].push_back({point, direction}); }
  [[nodiscard]] bool free(const Vector3& point, const Vector3& direction) const {
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          if (const auto cell = cells_.find(key(point + distance_ * Vector3(x, y, z))); cell != cells_.end())
            for (const auto& [other, along] : cell->second)
              if ((other - point).norm() < distance_ && std::abs(along.dot(direction)) > 0.75) return false;
    return true;
  }

 private:
  [[nodiscard]] std::uint64_t key(const Vector3& point) const {
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k)
      key = (key << 21) ^
            (static_cast<std::uint64_t>(std::llround(std::floor(point[k] / distance_)) + (1 << 20)) & ((1U << 21) - 1));
    return key;
  }
  double distance_;
  std::unordered_map<std::uint64_t, std::vector<std::array<Vector3, 2>>> cells_;
};

struct Step {
  Vector3 from, to, direction;
};

/// Where a ray within a face leaves it, and through which half-edge. \pre the point is on the face
std::pair<Index, Vector3> exit_of(const TriangleMesh<double>& mesh, Index face, const Vector3& point,
                                  const Vector3& direction) {
  Index through = no_index;
  double least = std::numeric_limits<double>::infinity();
  for (Index h = 3 * face; h < 3 * face + 3; ++h) {
    const Vector3 outward = mesh.edge_vector(h).cross(mesh.normal(face));
    const double speed = direction.dot(outward);
    if (!(speed > 0)) continue;
    const double t = std::max(0.0, (mesh.position(mesh.origin(h)) - point).dot(outward) / speed);
    if (t < least) least = t, through = h;
  }
  return {through, through == no_index ? point : Vector3(point + least * direction)};
}

std::vector<Step> trace(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                        const FrameField& frames, const Spacing& spacing, Spacing& own, double own_distance, Index face,
                        Complex along) {
  std::vector<Step> steps;
  // A line that runs round may come back to itself: what lies far enough behind its end counts as another's.
  std::size_t behind = 0;
  double length_behind = 0;
  Vector3 point = position(mesh, SurfacePoint{face, Vector3::Constant(1.0 / 3)});
  for (int k = 0; k < 2000; ++k) {
    const Vector3 direction = connection.to_vector(face, along / std::abs(along)).normalized();
    if (k > 0 && !(spacing.free(point, direction) && own.free(point, direction))) break;
    const auto [through, end] = exit_of(mesh, face, point, direction);
    if (through == no_index) break;
    steps.push_back({point, end, direction});
    for (length_behind += (end - point).norm(); length_behind > own_distance; ++behind) {
      own.add((steps[behind].from + steps[behind].to) / 2, steps[behind].direction);
      length_behind -= (steps[behind].to - steps[behind].from).norm();
    }
    if (mesh.twin(through) == no_index) break;
    const Complex carried = along / std::abs(along) * connection.transport(mesh, through);
    face = mesh.twin(through) / 3;
    const auto at = static_cast<std::size_t>(face);
    double best = -2;
    for (const Complex z : {frames.u[at], frames.v[at], -frames.u[at], -frames.v[at]})
      if (const double cosine = (z * std::conj(carried)).real() / std::abs(z); cosine > best) best = cosine, along = z;
    point = end;
  }
  return steps;
}

}  // namespace

std::vector<Stroke> field_lines(const TriangleMesh<double>& mesh, const FrameField& frames, double spacing,
                                const Colour& colour, double pixels) {
  const Connection<double> connection(mesh);
  Spacing taken(spacing);
  std::vector<Stroke> strokes;
  // A stride that visits all faces, far from each other.
  const Index count = mesh.face_count();
  auto stride = static_cast<Index>(0.618 * count) | 1;
  while (std::gcd(stride, count) != 1) stride += 2;
  for (Index k = 0, f = 0; k < count; ++k, f = (f + stride) % count) {
    const auto at = static_cast<std::size_t>(f);
    const Vector3 start = position(mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)});
    for (const Complex z : {frames.u[at], frames.v[at]}) {
      if (!taken.free(start, connection.to_vector(f, z).normalized())) continue;
      Spacing own(spacing);
      std::vector<Step> line = trace(mesh, connection, frames, taken, own, 3 * spacing, f, z);
      // The line's beginning is too near for its other half.
      Spacing own_back(spacing);
      double length_before = 0;
      for (const Step& step : line)
        if ((length_before += (step.to - step.from).norm()) > 3 * spacing)
          own_back.add((step.from + step.to) / 2, step.direction);
      const std::vector<Step> back = trace(mesh, connection, frames, taken, own_back, 3 * spacing, f, -z);
      line.insert(line.end(), back.begin(), back.end());
      double length = 0;
      for (const Step& step : line) length += (step.to - step.from).norm();
      if (length < 1.5 * spacing) continue;
      for (const Step& step : line) {
        taken.add((step.from + step.to) / 2, step.direction);
        strokes.push_back({step.from, step.to, colour, pixels});
      }
    }
  }
  return strokes;
}

}  // namespace quadrig
