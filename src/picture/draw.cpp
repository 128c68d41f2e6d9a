#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>

#include "picture/picture.hpp"
#include "picture/segment.hpp"

namespace quadrig {

namespace {

constexpr int samples = 3;  // a pixel is samples × samples points
constexpr int caption_pixels = 32, caption_letters = 12, legend_bar_pixels = 110;

/// True where every polygon has four sides.
bool all_quads(const PolygonMesh& mesh) {
  for (Index p = 0; p < mesh.polygon_count(); ++p)
    if (mesh.polygon(p).size() != 4) return false;
  return mesh.polygon_count() > 0;
}

/// Paper and letters; dark paper is not black, so that edges show on it.
struct Palette {
  explicit Palette(bool dark) {
    if (dark) background = Colour(0.012, 0.014, 0.018), ink = Colour(0.75, 0.77, 0.8);
  }
  Colour background{1, 1, 1}, ink{0.03, 0.03, 0.04};
  Colour quads{0.52, 0.68, 0.80}, others{0.62, 0.62, 0.60}, behind{0.75, 0.10, 0.08};
  Colour quad_edge{0.01, 0.02, 0.04}, other_edge{0.33, 0.33, 0.33};
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

/// What all cells are fitted to, in the eye's axes.
struct Bounds {
  Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
};

class Painter {
 public:
  Painter(const Panel& panel, const PictureOptions& options, const std::optional<Bounds>& bounds, int margin)
      : panel_(panel),
        mesh_(panel.mesh),
        options_(options),
        palette_(options.dark),
        view_(view(options)),
        bounds_(bounds),
        margin_(margin) {
    const PolygonMesh& mesh = mesh_;
    screen_ = mesh.positions * view_.transpose();
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
    if (quads && options_.irregular_vertices && panel_.irregular_vertices)
      paint_irregular(cell, std::clamp(2.6 * line, 4.0 * samples / 2, 6.0 * samples));
    for (const Stroke& stroke : panel_.strokes) paint_stroke(cell, stroke);
    for (const Dot& dot : panel_.dots) paint_dot(cell, to_screen(dot.at), dot.pixels * samples, dot.colour);
    return cell;
  }

 private:
  /// Places what is to be seen in the middle of the cell, upright, with a margin, above the caption.
  void fit(const Cell& cell) {
    Bounds shown;
    if (panel_.close_up) {
      const Vector3 c = view_ * panel_.close_up->centre, r = Vector3::Constant(panel_.close_up->radius);
      shown = {c - r, c + r};
    } else if (bounds_) {
      shown = *bounds_;
    } else if (screen_.rows() > 0) {
      shown = {screen_.colwise().minCoeff().transpose(), screen_.colwise().maxCoeff().transpose()};
    } else {
      return;
    }
    const Vector3 extent = (shown.high - shown.low).cwiseMax(1e-300);
    const double height = cell.height() - margin_ * samples;
    scale_ = (panel_.close_up ? 1.0 : 0.92) * std::min(cell.width() / extent.x(), height / extent.y());
    middle_ = (shown.low + shown.high) / 2;
    at_ = {cell.width() / 2.0, height / 2};
    for (Index v = 0; v < screen_.rows(); ++v) screen_.row(v) = placed(screen_.row(v).transpose()).transpose();
  }
  /// From the eye's axes to samples, y down.
  [[nodiscard]] Vector3 placed(const Vector3& seen) const {
    const Vector3 p = scale_ * (seen - middle_);
    return {at_.x() + p.x(), at_.y() - p.y(), p.z()};
  }
  [[nodiscard]] Vector3 to_screen(const Vector3& point) const { return placed(view_ * point); }

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
            edge = std::min(edge, distance_to_segment(at, screen_.row(polygon[i]).head<2>().transpose(),
                                                      screen_.row(polygon[(i + 1) % sides]).head<2>().transpose()));
          if (panel_.edges && edge < line / 2) {
            cell.paint(x, y, depth, quads ? palette_.quad_edge : palette_.other_edge);
            continue;
          }
          Vector3 normal = wa * na + wb * nb + wc * nc;
          if (behind) normal = -normal;
          normal = (0.75 * normal.normalized() + 0.25 * (behind ? Vector3(-flat) : flat)).normalized();
          Colour base = behind ? palette_.behind : quads ? palette_.quads : palette_.others;
          if (!behind && panel_.colours.size() == static_cast<std::size_t>(mesh_.vertex_count()))
            base = wa * colour_of(ia) + wb * colour_of(ib) + wc * (sides == 3 ? colour_of(polygon[2]) : mean_colour(p));
          else if (!behind && panel_.colours.size() == static_cast<std::size_t>(mesh_.polygon_count()))
            base = colour_of(p);
          if (!panel_.grid.empty() && sides == 3) base = on_grid(p, {wa, wb, wc}, area, base);
          cell.paint(x, y, depth, shade(base, normal));
        }
    }
  }

  [[nodiscard]] const Colour& colour_of(Index i) const { return panel_.colours[static_cast<std::size_t>(i)]; }
  [[nodiscard]] Colour mean_colour(Index p) const {
    Colour sum = Colour::Zero();
    for (const Index v : mesh_.polygon(p)) sum += colour_of(v);
    return sum / static_cast<double>(mesh_.polygon(p).size());
  }

  /// The colour there, or that of a line of the grid, as wide everywhere.
  [[nodiscard]] Colour on_grid(Index p, const Vector3& weights, double area, const Colour& base) const {
    const auto first = static_cast<std::size_t>(mesh_.first_corner[static_cast<std::size_t>(p)]);
    const auto polygon = mesh_.polygon(p);
    std::array<Eigen::Vector2d, 3> at;
    for (std::size_t i = 0; i < 3; ++i) at[i] = screen_.row(polygon[i]).head<2>().transpose();
    Colour colour = base;
    long square = 0;
    bool line = false;
    for (std::size_t k = 0; k < 2; ++k) {
      double value = 0;
      Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
      for (std::size_t i = 0; i < 3; ++i) {
        const double corner = panel_.grid[first + i][k];
        const Eigen::Vector2d opposite = at[(i + 2) % 3] - at[(i + 1) % 3];
        value += weights[static_cast<Eigen::Index>(i)] * corner;
        gradient += corner * Eigen::Vector2d(-opposite.y(), opposite.x()) / area;
      }
      const double off = std::abs(value - std::round(value));
      if (off < 0.7 * samples * gradient.norm()) line = true;
      square += static_cast<long>(std::floor(value));
    }
    if (line) return palette_.quad_edge;
    if (panel_.checker && square % 2 != 0) colour *= 0.55;
    return colour;
  }

  void paint_dot(Cell& cell, const Vector3& p, double radius, const Colour& colour) {
    for (int y = std::max(0, static_cast<int>(p.y() - radius));
         y <= std::min(cell.height() - 1, static_cast<int>(p.y() + radius)); ++y)
      for (int x = std::max(0, static_cast<int>(p.x() - radius));
           x <= std::min(cell.width() - 1, static_cast<int>(p.x() + radius)); ++x)
        if (std::hypot(x + 0.5 - p.x(), y + 0.5 - p.y()) <= radius) cell.paint(x, y, p.z() + 1.5 * radius, colour);
  }

  void paint_stroke(Cell& cell, const Stroke& stroke) {
    const Vector3 a = to_screen(stroke.from), b = to_screen(stroke.to);
    const double radius = stroke.pixels * samples / 2;
    const Eigen::Vector2d along = (b - a).head<2>();
    for (int y = std::max(0, static_cast<int>(std::min(a.y(), b.y()) - radius));
         y <= std::min(cell.height() - 1, static_cast<int>(std::max(a.y(), b.y()) + radius)); ++y)
      for (int x = std::max(0, static_cast<int>(std::min(a.x(), b.x()) - radius));
           x <= std::min(cell.width() - 1, static_cast<int>(std::max(a.x(), b.x()) + radius)); ++x) {
        const Eigen::Vector2d p(x + 0.5, y + 0.5);
        if (distance_to_segment(p, a.head<2>(), b.head<2>()) > radius) continue;
        const double t =
            along.squaredNorm() > 0 ? std::clamp((p - a.head<2>()).dot(along) / along.squaredNorm(), 0.0, 1.0) : 0;
        cell.paint(x, y, stroke.on_top ? 1e12 : a.z() + t * (b.z() - a.z()) + 2.5 * samples, stroke.colour);
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
      paint_dot(cell, screen_.row(v).transpose(), radius, singular_colour(4 - edges));
    }
  }

  const Panel& panel_;
  const PolygonMesh& mesh_;
  const PictureOptions& options_;
  Palette palette_;
  Eigen::Matrix3d view_;
  std::optional<Bounds> bounds_;
  int margin_;  ///< pixels of the caption
  Vector3 middle_ = Vector3::Zero();
  Eigen::Vector2d at_ = Eigen::Vector2d::Zero();
  Points<double> screen_;          ///< seen from the eye; after fit() in samples, y down
  Points<double> normals_, flat_;  ///< of vertices and polygons, y up, unit
  double scale_ = 1;
};

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

namespace {

/// What every panel that is no close-up shows.
std::optional<Bounds> common_bounds(std::span<const Panel> panels, const PictureOptions& options) {
  if (!options.one_frame) return {};
  Bounds bounds;
  const Eigen::Matrix3d seen = view(options);
  for (const Panel& panel : panels)
    if (!panel.close_up)
      for (Index v = 0; v < panel.mesh.vertex_count(); ++v) {
        const Vector3 p = seen * panel.mesh.positions.row(v).transpose();
        bounds.low = bounds.low.cwiseMin(p);
        bounds.high = bounds.high.cwiseMax(p);
      }
  if (bounds.low.x() > bounds.high.x()) return {};
  return bounds;
}

void fill(Image& image, int x0, int y0, int width, int height, const Colour& colour) {
  for (int y = std::max(0, y0); y < std::min(image.height, y0 + height); ++y)
    for (int x = std::max(0, x0); x < std::min(image.width, x0 + width); ++x)
      for (std::size_t k = 0; k < 3; ++k)
        image.rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                       static_cast<std::size_t>(x)) +
                  k] = encode(colour[static_cast<Eigen::Index>(k)]);
}

/// At most three digits after the point, without zeros at the end.
std::string number_text(double value) {
  std::string text = std::to_string(std::round(1000 * value) / 1000);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

void write_legend(Image& image, const Legend& legend, int left, int top, int width, const Colour& ink) {
  constexpr int letters = 9, line = 17;
  int y = top + line;
  const auto right = [&](const std::string& text, int foot, int room) {
    write_text(image, left + width - room - text_width(letters, text), foot, letters, text, ink);
  };
  if (!legend.title.empty()) right(legend.title, y, 8);
  if (legend.high > legend.low) {
    y += 8;
    for (int i = 0; i < legend_bar_pixels; ++i)
      fill(image, left + width - 20, y + i, 12, 1, scalar_colour(1 - (i + 0.5) / legend_bar_pixels));
    right(number_text(legend.high), y + letters, 26);
    right(number_text(legend.low), y + legend_bar_pixels, 26);
    y += legend_bar_pixels;
  }
  for (const auto& [name, colour] : legend.names) {
    y += line;
    fill(image, left + width - 20, y - letters, 12, letters + 1, colour);
    right(name, y, 26);
  }
}

}  // namespace

Colour scalar_colour(double value) {
  // Lightness rises evenly along these, so that they are told apart without hue.
  static constexpr std::array<std::array<int, 3>, 6> stops{
      {{38, 20, 92}, {46, 79, 142}, {33, 127, 140}, {52, 170, 116}, {150, 204, 72}, {250, 226, 70}}};
  const double x = std::clamp(std::isfinite(value) ? value : 0.0, 0.0, 1.0) * (stops.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(x), stops.size() - 2);
  Colour colour;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto at = [&](std::size_t stop) { return decode(static_cast<std::uint8_t>(stops[stop][k])); };
    const double t = x - static_cast<double>(i);
    colour[static_cast<Eigen::Index>(k)] = (1 - t) * at(i) + t * at(i + 1);
  }
  return colour;
}

Colour singular_colour(Index index4) { return index4 > 0 ? Colour(0.02, 0.10, 0.75) : Colour(0.95, 0.22, 0.01); }

Colour numbered_colour(Index number) {
  const double hue = std::fmod(0.08 + 0.381966 * number, 1.0) * 6;
  const auto channel = [hue](double shift) {
    const double full = std::clamp(std::abs(std::fmod(hue + shift, 6.0) - 3) - 1, 0.0, 1.0);
    return decode(encode(0.16 + 0.62 * full));
  };
  return {channel(0), channel(4), channel(2)};
}

Expected<Image> draw(std::span<const PolygonMesh> meshes, const PictureOptions& options) {
  std::vector<Panel> panels(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) panels[i].mesh = meshes[i];
  return draw(panels, options);
}

Expected<Image> draw(std::span<const Panel> panels, const PictureOptions& options) {
  if (const Status status = options.validate(); !status) return status.error();
  if (panels.empty()) return Error{ErrorCode::bad_option, "no mesh to draw", "picture", "name at least one"};
  const auto count = static_cast<int>(panels.size());
  const int columns = options.columns ? std::min(options.columns, count) : count,
            rows = (count + columns - 1) / columns;
  const bool captions = std::any_of(panels.begin(), panels.end(), [](const Panel& p) { return !p.caption.empty(); });
  const Palette palette(options.dark);
  Image image;
  image.width = columns * options.cell_width;
  image.height = rows * options.cell_height;
  image.rgb.assign(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 255);
  fill(image, 0, 0, image.width, image.height, palette.background);
  const std::optional<Bounds> bounds = common_bounds(panels, options);
  for (int i = 0; i < count; ++i) {
    const Panel& panel = panels[static_cast<std::size_t>(i)];
    const Cell cell = Painter(panel, options, bounds, captions ? caption_pixels : 0).draw();
    const int left = (i % columns) * options.cell_width, top = (i / columns) * options.cell_height;
    const int gap = panel.close_up && count > 1 ? 4 : 0;  // close-ups reach their panel's sides
    for (int y = 0; y < options.cell_height - (captions ? caption_pixels : 0); ++y)
      for (int x = gap; x < options.cell_width - gap; ++x) fill(image, left + x, top + y, 1, 1, cell.pixel(x, y));
    write_legend(image, panel.legend, left, top, options.cell_width, palette.ink);
    const double width = text_width(caption_letters, panel.caption);
    const double height = caption_letters * std::min(1.0, 0.94 * options.cell_width / std::max(width, 1.0));
    write_text(image, left + (options.cell_width - std::min(width, 0.94 * options.cell_width)) / 2,
               top + options.cell_height - 11, height, panel.caption, palette.ink);
  }
  return image;
}

}  // namespace quadrig
