// A head as the zero of a function, and the fields that move it.
#include "head.hpp"

namespace quadrig::samples::head {
namespace {

/// A distance and its gradient.
struct Jet {
  double value;
  Vector3 gradient;
  Jet operator-() const { return {-value, -gradient}; }
};

/// The lesser of both, rounded over a width (Quilez's polynomial); the gradient is exact.
Jet join(const Jet& a, const Jet& b, double width) {
  const double h = std::clamp(0.5 + 0.5 * (b.value - a.value) / width, 0.0, 1.0);
  return {b.value + h * (a.value - b.value) - width * h * (1 - h), b.gradient + h * (a.gradient - b.gradient)};
}
Jet cut(const Jet& a, const Jet& b, double width) { return -join(-a, b, width); }
Jet meet(const Jet& a, const Jet& b, double width) { return -join(-a, -b, width); }

Jet ball(const Vector3& p, const Vector3& center, double radius) {
  const Vector3 away = p - center;
  const double length = away.norm();
  return {length - radius, length > 0 ? Vector3(away / length) : Vector3::UnitY()};
}
/// About the distance; exact at the surface.
Jet ellipsoid(const Vector3& p, const Vector3& center, const Vector3& radii) {
  const Vector3 scaled = (p - center).cwiseQuotient(radii), twice = scaled.cwiseQuotient(radii);
  const double length = scaled.norm(), slope = twice.norm();
  if (!(slope > 0)) return {-radii.minCoeff(), Vector3::UnitY()};
  return {length * (length - 1) / slope, twice / slope};
}
Jet capsule(const Vector3& p, const Vector3& a, const Vector3& b, double radius_a, double radius_b) {
  const Vector3 axis = b - a;
  const double t = std::clamp((p - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return ball(p, a + t * axis, radius_a + t * (radius_b - radius_a));
}

double step(double from, double to, double x) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}
double bell(const Vector3& p, const Vector3& center, const Vector3& widths) {
  return elementary::exp(-(p - center).cwiseQuotient(widths).squaredNorm());
}

constexpr double almond = 0.0138;  // half the width of the lids' opening

/// What lies between the lids, from the eye's middle forward.
Jet opening(const Vector3& p) {
  const double u = p.x() - eye_x, v = p.y() - eye_y;
  const double upper = v - upper_margin(u), lower = lower_margin(u) - v;
  const double d = 1e-6, slope_u = (upper_margin(u + d) - upper_margin(u - d)) / (2 * d),
               slope_l = (lower_margin(u + d) - lower_margin(u - d)) / (2 * d);
  const double scale_u = std::hypot(1, slope_u), scale_l = std::hypot(1, slope_l);
  const Jet above{upper / scale_u, Vector3(-slope_u, 1, 0) / scale_u};
  const Jet below{lower / scale_l, Vector3(slope_l, -1, 0) / scale_l};
  return meet(meet(above, below, 0.0004), {eye_z - p.z(), -Vector3::UnitZ()}, 0.001);
}

Jet trunk(const Vector3& p) {
  Jet d = ellipsoid(p, {0, 0.042, -0.016}, {0.075, 0.088, 0.096});                                 // cranium
  d = join(d, ellipsoid(p, {0, -0.02, 0.022}, {0.067, 0.084, 0.069}), 0.03);                       // face
  d = join(d, capsule(p, {0.012, -0.094, 0.058}, {0.047, -0.052, 0.006}, 0.014, 0.016), 0.03);     // jaw
  d = join(d, capsule(p, {-0.009, -0.098, 0.066}, {0.009, -0.098, 0.066}, 0.0145, 0.0145), 0.02);  // chin
  d = join(d, ball(p, {0.042, -0.022, 0.056}, 0.02), 0.03);                                        // cheekbone
  d = join(d, capsule(p, {0.012, 0.032, 0.08}, {0.046, 0.03, 0.06}, 0.01, 0.009), 0.02);           // brow
  d = join(d, capsule(p, {0, -0.08, -0.026}, {0, -0.21, -0.045}, 0.045, 0.05), 0.035);             // neck
  d = join(d, capsule(p, {0, -0.24, -0.045}, {0.11, -0.27, -0.045}, 0.055, 0.045), 0.04);          // shoulder
  d = join(d, ellipsoid(p, {0, -0.33, -0.03}, {0.13, 0.1, 0.075}), 0.05);                          // chest
  return d;
}

Jet ear(const Vector3& p) {
  const Vector3 center(0.0745, -0.004, -0.014), out = Vector3(0.89, 0, 0.45).normalized();
  const Vector3 back = Vector3(0.45, 0, -0.89).normalized(), up = Vector3::UnitY();
  Eigen::Matrix3d axes;
  axes << out.transpose(), back.transpose(), up.transpose();
  const Vector3 q = axes * (p - center);
  const auto turned = [&](Jet jet) { return Jet{jet.value, axes.transpose() * jet.gradient}; };
  Jet d = ellipsoid(q, {0, 0.003, 0}, {0.0075, 0.018, 0.03});
  d = join(d, ellipsoid(q, {0, -0.001, -0.024}, {0.006, 0.009, 0.012}), 0.006);      // lobe
  d = cut(d, ellipsoid(q, {0.0085, 0.003, 0.004}, {0.0065, 0.0115, 0.021}), 0.004);  // inside the helix
  d = cut(d, ellipsoid(q, {0.004, -0.003, -0.006}, {0.007, 0.0075, 0.009}), 0.004);  // concha
  return turned(d);
}

Jet face(const Vector3& p, Jet d) {
  d = cut(d, ball(p, {0.034, 0.009, 0.0985}, 0.0205), 0.016);                             // socket
  d = join(d, ball(p, eye, 0.0166), 0.007);                                               // lids
  d = join(d, capsule(p, {0, 0.018, 0.079}, {0, -0.026, 0.105}, 0.0075, 0.0105), 0.014);  // nose
  d = join(d, ball(p, {0.0105, -0.033, 0.0955}, 0.0085), 0.006);                          // its wing
  d = cut(d, ellipsoid(p, {0.0062, -0.0425, 0.098}, {0.0036, 0.006, 0.0052}), 0.003);     // nostril
  d = join(
      d, capsule(p, {0, mouth_y + 0.0055, lips_z - 0.001}, {0.0235, mouth_y + 0.0015, lips_z - 0.017}, 0.0062, 0.0035),
      0.007);
  d = join(
      d, capsule(p, {0, mouth_y - 0.0068, lips_z - 0.003}, {0.0215, mouth_y - 0.002, lips_z - 0.0165}, 0.0072, 0.0045),
      0.006);
  d = cut(d, ellipsoid(p, {0, mouth_y - 0.0185, lips_z + 0.007}, {0.022, 0.005, 0.008}), 0.01);  // below the lip
  d = cut(d, ellipsoid(p, {0, mouth_y, 0.05}, {0.025, 0.015, 0.024}), 0.006);                    // inner mouth
  const Jet slit{std::abs(p.y() - mouth_y) - 0.0017, Vector3(0, p.y() < mouth_y ? -1 : 1, 0)};
  d = cut(d, meet(slit, ellipsoid(p, {0, mouth_y, 0.08}, {0.0235, 1, 0.04}), 0.001), 0.002);  // between the lips
  d = cut(d, ball(p, eye, eye_radius + 0.0007), 0.001);
  return cut(d, opening(p), 0.0026);
}

double distance(const Vector3& p, Vector3& gradient) {
  const Vector3 q(std::abs(p.x()), p.y(), p.z());
  const Jet d = face(q, join(trunk(q), ear(q), 0.005));
  gradient = d.gradient;
  gradient.x() *= p.x() < 0 ? -1.0 : p.x() > 0 ? 1.0 : 0.0;
  return d.value;
}

/// What the jaw carries: below the line between the lips, sharp between them and soft beyond their corners and inside.
double jaw_share(const Vector3& p) {
  const double soft = 0.0008 + 0.016 * step(0.012, 0.032, std::abs(p.x())) + 0.014 * step(0.07, 0.03, p.z());
  const double below = step(-soft, soft, mouth_y - p.y());
  const double front = step(-0.025, 0.045, p.z()),
               above_neck = step(-0.165, -0.105, p.y() - 0.35 * std::min(p.z() - 0.06, 0.0));
  return below * front * above_neck;
}

/// A lid turns about the eye's middle: by what angle.
double lid_turn(const Vector3& p) {
  const Vector3 q = p - eye;
  const double along = elementary::atan2(q.y(), q.z());
  const double top = elementary::asin(std::clamp(upper_margin(q.x()) / 0.0145, -1.0, 1.0));
  const double low = elementary::asin(std::clamp(lower_margin(q.x()) / 0.0145, -1.0, 1.0));
  const double open = std::max(top - low, 0.0), middle = low + 0.25 * open;
  const double far = 1 - step(0.017, 0.026, q.norm());
  if (along > middle) return -far * 0.82 * open * (1 - step(top + 0.05, 1.5, along));
  return far * 0.26 * open * (1 - step(-low, 1.2, -along));
}

Vector3 turned(const Vector3& p, const Vector3& about, double angle) {
  // A positive angle lifts what is in front.
  return about + elementary::rotation(-angle, Vector3::UnitX()) * (p - about) - p;
}

Vector3 blink(const Vector3& p) {
  if (p.x() < 0.004 || (p - eye).norm() > 0.04) return Vector3::Zero();
  return step(0.004, 0.012, p.x()) * turned(p, eye, lid_turn(p));
}

}  // namespace

double upper_margin(double u) { return 0.0062 * (1 - u * u / (almond * almond)) + 0.06 * u; }
double lower_margin(double u) { return -0.0044 * (1 - u * u / (almond * almond)) + 0.06 * u; }

Vector3 displacement(std::size_t morph, const Vector3& p) {
  const Vector3 q(std::abs(p.x()), p.y(), p.z());
  Vector3 moved = Vector3::Zero();
  switch (morph) {
    case 0:
      return blink(p);
    case 1:
      moved = blink({-p.x(), p.y(), p.z()});
      moved.x() = -moved.x();
      return moved;
    case 2:
      return turned(p, {0, -0.012, 0.004}, -0.3 * jaw_share(p));
    case 3:
      moved = bell(q, {0.023, mouth_y + 0.001, 0.08}, {0.017, 0.02, 0.024}) * Vector3(0.008, 0.0095, -0.005);
      break;
    case 4:
      moved = bell(q, {0.03, 0.042, 0.075}, {0.03, 0.016, 0.04}) * Vector3(0, 0.008, 0.001);
      break;
    case 5: {
      const double share = bell(q, {0, mouth_y, lips_z - 0.004}, {0.028, 0.02, 0.022});
      moved = share * Vector3(-0.38 * q.x(), 0, 0.007);
      break;
    }
    default:
      break;
  }
  moved.x() *= p.x() < 0 ? -1 : 1;
  return moved;
}

bool in_pocket(const Vector3& p) {
  const Vector3 q(std::abs(p.x()), p.y(), p.z());
  if ((q - eye).norm() < eye_radius + 0.0012) return true;
  return q.z() < lips_z - 0.016 &&
         (q - Vector3(0, mouth_y, 0.054)).cwiseQuotient(Vector3(0.025, 0.018, 0.03)).norm() < 1.05;
}

Eigen::RowVector4d weights(const Vector3& p) {
  const double lean = p.y() + 0.45 * (p.z() + 0.04);
  const double on_skull = step(-0.15, -0.06, p.y() < -0.04 ? std::min(lean, p.y() + 0.06) : p.y());
  const double on_chest = 1 - step(-0.28, -0.15, p.y());
  const double on_jaw = jaw_share(p);
  Eigen::RowVector4d row;
  row << on_chest, (1 - on_chest) * (1 - on_skull), (1 - on_chest) * on_skull, 0;
  row *= 1 - on_jaw;
  row[3] = on_jaw;
  return row;
}

Shape shape() {
  Shape made;
  made.low = Vector3(-0.17, -0.446, -0.131);
  made.high = Vector3(0.17, 0.14, 0.13);
  made.cell = 0.002;
  made.distance = distance;
  made.kept = {{0, 0.0}, {1, neck_y}, {1, bottom_y}, {2, seam_z}};
  made.mirrored = true;
  made.weights = [](const Vector3& p) -> Eigen::RowVectorXd { return weights(p); };
  made.grading = [](const Vector3& p) {
    const Vector3 q(std::abs(p.x()), p.y(), p.z());
    const double near =
        std::min({(q - eye).norm() / 0.016, (q - Vector3(0, mouth_y, 0.085)).norm() / 0.026,
                  (q - Vector3(0.078, 0, -0.012)).norm() / 0.03, (q - Vector3(0.006, -0.035, 0.1)).norm() / 0.014});
    return 0.26 + 1.04 * step(0.9, 4.5, near) + 0.9 * step(-0.15, -0.25, p.y());
  };
  const auto bone = [&](const char* name, const Vector3& from, const Vector3& to, Index parent) {
    Bone added;
    added.head = from;
    added.tail = to;
    added.parent = parent;
    added.name = name;
    made.skeleton.bones.push_back(std::move(added));
  };
  bone("chest", {0, -0.34, -0.045}, {0, -0.21, -0.045}, no_index);
  bone("neck", {0, -0.21, -0.045}, {0, -0.09, -0.025}, chest);
  bone("head", {0, -0.09, -0.025}, {0, 0.12, -0.015}, neck);
  bone("jaw", {0, -0.012, 0.004}, {0, -0.105, 0.075}, skull);
  return made;
}

}  // namespace quadrig::samples::head
