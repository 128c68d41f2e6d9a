#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "picture/picture.hpp"

namespace quadrig {

namespace {

using Colour = Eigen::Vector3d;  // linear light

constexpr int samples = 3;  // a pixel is samples × samples points

/// True where every polygon has four sides.
bool all_quads(const PolygonMesh& mesh) {
  for (Index p = 0; p < mesh.polygon_count(); ++p)
    if (mesh.polygon(p).size() != 4) return false;
  return mesh.polygon_count() > 0;
}

struct Palette {
  Colour background{1, 1, 1};
  Colour quads{0.52, 0.68, 0.80}, others{0.62, 0.62, 0.60}, behind{0.75, 0.10, 0.08};
  Colour quad_edge{0.01, 0.02, 0.04}, other_edge{0.33, 0.33, 0.33};
  Colour low_valence{0.02, 0.10, 0.75}, high_valence{0.95, 0.22, 0.01};
};

/// One mesh's part of the picture at full sampling.
class Cell {
 public:
  Cell(int width, int height, const Colour& background)
      : width_(width * samples),
        height_(height * samples),
        colour_(count(), background),
        depth_(count(), -std::numeric_limits<double>::infinity()) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  /// Paints where (x, y, depth) is nearer than what is there; larger depth is nearer.
  void paint(int x, int y, double depth, const Colour& colour) {
    const std::size_t i = index(x, y);
    if (depth < depth_[i]) return;
    depth_[i] = depth;
    colour_[i] = colour;
  }
  [[nodiscard]] double depth(int x, int y) const { return depth_[index(x, y)]; }

  /// Mean over the samples of a pixel.
  [[nodiscard]] Colour pixel(int x, int y) const {
    Colour sum = Colour::Zero();
    for (int j = 0; j < samples; ++j)
      for (int i = 0; i < samples; ++i) sum += colour_[index(samples * x + i, samples * y + j)];
    return sum / (samples * samples);
  }

 private:
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_, height_;
  std::vector<Colour> colour_;
  std::vector<double> depth_;
};

/// Rows: right, up and towards the eye, in the mesh's coordinates.
Eigen::Matrix3d view(const PictureOptions& options) {
  const double radians = std::numbers::pi / 180;
  Eigen::Matrix3d upright = Eigen::Matrix3d::Identity();
  if (options.up == 'z') upright << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return (Eigen::AngleAxisd(options.tilt_degrees * radians, Vector3::UnitX()) *
          Eigen::AngleAxisd(-options.turn_degrees * radians, Vector3::UnitY()))
             .toRotationMatrix() *
         upright;
}

Colour shade(const Colour& base, const Vector3& normal) {
  static const Vector3 key = Vector3(-0.45, 0.65, 0.75).normalized(), fill = Vector3(0.8, 0.1, 0.5).normalized();
  const double light = 0.28 + 0.62 * std::max(0.0, normal.dot(key)) + 0.22 * std::max(0.0, normal.dot(fill));
  const double gleam = 0.10 * std::pow(std::max(0.0, normal.dot((key + Vector3::UnitZ()).normalized())), 30);
  return base * light + Colour::Constant(gleam);
}

/// Corner-to-corner normal of a polygon, area weighted (Newell).
Vector3 newell(const Points<double>& points, std::span<const Index> polygon) {
  Vector3 normal = Vector3::Zero();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3 a = points.row(polygon[i]).transpose(), b = points.row(polygon[(i + 1) % polygon.size()]).transpose();
    normal += a.cross(b);
  }
  return normal / 2;
}

/// Distance of a point from a segment, in the plane.
double distance(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d ab = b - a;
  const double length2 = ab.squaredNorm();
  const double t = length2 > 0 ? std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * ab).norm();
}

class Painter {
 public:
  Painter(const PolygonMesh& mesh, const PictureOptions& options) : mesh_(mesh), options_(options) {
    screen_ = mesh.positions * view(options).transpose();
    normals_ = Points<double>::Zero(screen_.rows(), 3);
    flat_ = Points<double>::Zero(mesh.polygon_count(), 3);
    for (Index p = 0; p < mesh.polygon_count(); ++p) {
      const Vector3 normal = newell(screen_, mesh.polygon(p));
      for (const Index v : mesh.polygon(p)) normals_.row(v) += normal.transpose();
      flat_.row(p) = normal.normalized().transpose();
    }
    for (Index v = 0; v < screen_.rows(); ++v)
      if (const double length = normals_.row(v).norm(); length > 0) normals_.row(v) /= length;
  }

  Cell draw() {
    Cell cell(options_.cell_width, options_.cell_height, palette_.background);
    fit(cell);
    const bool quads = all_quads(mesh_);
    const double line = line_width();
    for (Index p = 0; p < mesh_.polygon_count(); ++p) paint_polygon(cell, p, quads, line);
    if (quads && options_.irregular_vertices)
      paint_irregular(cell, std::clamp(2.6 * line, 4.0 * samples / 2, 6.0 * samples));
    return cell;
  }

 private:
  /// Places the mesh in the middle of the cell, upright, with a margin.
  void fit(const Cell& cell) {
    if (screen_.rows() == 0) return;
    const Vector3 low = screen_.colwise().minCoeff().transpose(), high = screen_.colwise().maxCoeff().transpose();
    const Vector3 extent = (high - low).cwiseMax(1e-300);
    scale_ = 0.92 * std::min(cell.width() / extent.x(), cell.height() / extent.y());
    const Vector3 middle = (low + high) / 2;
    for (Index v = 0; v < screen_.rows(); ++v) {
      const Vector3 p = scale_ * (screen_.row(v).transpose() - middle);
      screen_.row(v) << cell.width() / 2.0 + p.x(), cell.height() / 2.0 - p.y(), p.z();
    }
  }

  [[nodiscard]] double line_width() const {
    if (options_.line_pixels > 0) return options_.line_pixels * samples;
    double area = 0;
    for (Index p = 0; p < mesh_.polygon_count(); ++p) area += newell(screen_, mesh_.polygon(p)).norm();
    const double side = std::sqrt(area / std::max<Index>(1, mesh_.polygon_count()));
    return std::clamp(side / 9, 0.45 * samples, 1.5 * samples);
  }

  void paint_polygon(Cell& cell, Index p, bool quads, double line) {
    const auto polygon = mesh_.polygon(p);
    const Vector3 flat = flat_.row(p).transpose();
    Vector3 centre = Vector3::Zero();
    for (const Index v : polygon) centre += screen_.row(v).transpose();
    centre /= static_cast<double>(polygon.size());

    // A quad is not flat: four triangles around its middle follow it better than two along a diagonal.
    const std::size_t sides = polygon.size();
    const std::size_t triangles = sides == 3 ? 1 : sides;
    Vector3 middle_normal = Vector3::Zero();
    for (const Index v : polygon) middle_normal += normals_.row(v).transpose();
    for (std::size_t t = 0; t < triangles; ++t) {
      const Index ia = polygon[t], ib = polygon[(t + 1) % sides];
      const Vector3 a = screen_.row(ia).transpose(), b = screen_.row(ib).transpose();
      const Vector3 c = sides == 3 ? Vector3(screen_.row(polygon[2]).transpose()) : centre;
      const Vector3 na = normals_.row(ia).transpose(), nb = normals_.row(ib).transpose();
      const Vector3 nc = sides == 3 ? Vector3(normals_.row(polygon[2]).transpose()) : middle_normal.normalized();
      const double area = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
      if (area == 0) continue;
      const bool behind = area > 0;  // counter-clockwise turns clockwise where y runs down
      const int x0 = std::max(0, static_cast<int>(std::floor(std::min({a.x(), b.x(), c.x()}))));
      const int x1 = std::min(cell.width() - 1, static_cast<int>(std::ceil(std::max({a.x(), b.x(), c.x()}))));
      const int y0 = std::max(0, static_cast<int>(std::floor(std::min({a.y(), b.y(), c.y()}))));
      const int y1 = std::min(cell.height() - 1, static_cast<int>(std::ceil(std::max({a.y(), b.y(), c.y()}))));
      for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
          const Eigen::Vector2d at(x + 0.5, y + 0.5);
          const double wa = ((b.x() - at.x()) * (c.y() - at.y()) - (b.y() - at.y()) * (c.x() - at.x())) / area;
          const double wb = ((c.x() - at.x()) * (a.y() - at.y()) - (c.y() - at.y()) * (a.x() - at.x())) / area;
          const double wc = 1 - wa - wb;
          if (wa < 0 || wb < 0 || wc < 0) continue;
          const double depth = wa * a.z() + wb * b.z() + wc * c.z();
          if (depth < cell.depth(x, y)) continue;
          double edge = std::numeric_limits<double>::infinity();
          for (std::size_t i = 0; i < sides; ++i)
            edge = std::min(edge, distance(at, screen_.row(polygon[i]).head<2>().transpose(),
                                           screen_.row(polygon[(i + 1) % sides]).head<2>().transpose()));
          if (edge < line / 2) {
            cell.paint(x, y, depth, quads ? palette_.quad_edge : palette_.other_edge);
            continue;
          }
          Vector3 normal = wa * na + wb * nb + wc * nc;
          if (behind) normal = -normal;
          normal = (0.75 * normal.normalized() + 0.25 * (behind ? Vector3(-flat) : flat)).normalized();
          cell.paint(x, y, depth, shade(behind ? palette_.behind : quads ? palette_.quads : palette_.others, normal));
        }
    }
  }

  /// Dots where a vertex inside the surface has other than four edges; seen where the surface is.
  void paint_irregular(Cell& cell, double radius) {
    std::vector<std::set<Index>> neighbours(static_cast<std::size_t>(screen_.rows()));
    std::vector<Index> faces(static_cast<std::size_t>(screen_.rows()), 0);
    for (Index p = 0; p < mesh_.polygon_count(); ++p) {
      const auto polygon = mesh_.polygon(p);
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Index a = polygon[i], b = polygon[(i + 1) % polygon.size()];
        neighbours[static_cast<std::size_t>(a)].insert(b);
        neighbours[static_cast<std::size_t>(b)].insert(a);
        ++faces[static_cast<std::size_t>(a)];
      }
    }
    for (Index v = 0; v < screen_.rows(); ++v) {
      const auto edges = static_cast<Index>(neighbours[static_cast<std::size_t>(v)].size());
      const bool inside = edges == faces[static_cast<std::size_t>(v)];
      if (!inside || edges == 4 || edges == 0 || normals_(v, 2) < 0) continue;
      const Vector3 p = screen_.row(v).transpose();
      for (int y = std::max(0, static_cast<int>(p.y() - radius));
           y <= std::min(cell.height() - 1, static_cast<int>(p.y() + radius)); ++y)
        for (int x = std::max(0, static_cast<int>(p.x() - radius));
             x <= std::min(cell.width() - 1, static_cast<int>(p.x() + radius)); ++x)
          if (std::hypot(x + 0.5 - p.x(), y + 0.5 - p.y()) <= radius)
            cell.paint(x, y, p.z() + 1.5 * radius, edges < 4 ? palette_.low_valence : palette_.high_valence);
    }
  }

  const PolygonMesh& mesh_;
  const PictureOptions& options_;
  Palette palette_;
  Points<double> screen_;          ///< seen from the eye; after fit() in samples, y down
  Points<double> normals_, flat_;  ///< of vertices and polygons, y up, unit
  double scale_ = 1;
};

std::uint8_t encode(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  const double s = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

}  // namespace

Status PictureOptions::validate() const {
  const auto bad = [](std::string what) { return Error{ErrorCode::bad_option, std::move(what), "picture", {}}; };
  if (cell_width < 1 || cell_width > 8192) return bad("cell_width must be in [1, 8192]");
  if (cell_height < 1 || cell_height > 8192) return bad("cell_height must be in [1, 8192]");
  if (columns < 0) return bad("columns must not be negative");
  if (up != 'y' && up != 'z') return bad("up must be y or z");
  if (!(line_pixels >= 0)) return bad("line_pixels must not be negative");
  if (!std::isfinite(turn_degrees) || !std::isfinite(tilt_degrees))
    return bad("turn_degrees and tilt_degrees must be finite");
  return {};
}

Expected<Image> draw(std::span<const PolygonMesh> meshes, const PictureOptions& options) {
  if (const Status status = options.validate(); !status) return status.error();
  if (meshes.empty()) return Error{ErrorCode::bad_option, "no mesh to draw", "picture", "name at least one"};
  const auto count = static_cast<int>(meshes.size());
  const int columns = options.columns ? std::min(options.columns, count) : count,
            rows = (count + columns - 1) / columns;
  Image image;
  image.width = columns * options.cell_width;
  image.height = rows * options.cell_height;
  image.rgb.assign(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 255);
  for (int i = 0; i < count; ++i) {
    const Cell cell = Painter(meshes[static_cast<std::size_t>(i)], options).draw();
    const int left = (i % columns) * options.cell_width, top = (i / columns) * options.cell_height;
    for (int y = 0; y < options.cell_height; ++y)
      for (int x = 0; x < options.cell_width; ++x) {
        const Colour colour = cell.pixel(x, y);
        const std::size_t at = 3 * (static_cast<std::size_t>(top + y) * static_cast<std::size_t>(image.width) +
                                    static_cast<std::size_t>(left + x));
        for (int k = 0; k < 3; ++k) image.rgb[at + static_cast<std::size_t>(k)] = encode(colour[k]);
      }
  }
  return image;
}

}  // namespace quadrig
