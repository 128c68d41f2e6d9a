#include "remesh.hpp"

namespace quadrig::samples {

EditableMesh::EditableMesh(const Shape& shape, const TriangleMesh<double>& mesh) : live_faces_(mesh.face_count()) {
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    points_.push_back(mesh.position(v));
    planes_.push_back(planes_at(shape, mesh.position(v)));
    outgoing_.push_back(mesh.outgoing(v));
  }
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    corners_.push_back(mesh.origin(h));
    twins_.push_back(mesh.twin(h));
  }
}

void EditableMesh::split(Index h, const Vector3& middle) {
  const Index g = twin(h), h1 = next(h), g2 = prev(g);
  const Index a = origin(h), b = target(h), c = origin(prev(h)), d = origin(g2);
  const auto m = static_cast<Index>(points_.size());
  const Index h1_across = twin(h1), g2_across = twin(g2);
  points_.push_back(middle);
  planes_.push_back(planes_along(h));
  outgoing_.push_back(h1);
  const Index k = halfedge_count(), l = k + 3;
  corners_.insert(corners_.end(), {m, b, c, b, m, d});
  twins_.resize(corners_.size());
  live_faces_ += 2;
  origin(h1) = m;  // a m c, and m a d
  origin(g) = m;
  join(k + 1, h1_across);
  join(h1, k + 2);
  join(l + 2, g2_across);
  join(g2, l + 1);
  join(h, g);
  join(k, l);
  leave(a, h);
  leave(b, k + 1);
  leave(c, k + 2);
  leave(d, g2);
}

bool EditableMesh::collapses_within(Index& h) const {
  if (planes(origin(h)) == 0 && planes(target(h)) == 0) return true;
  if ((planes(origin(h)) & ~planes(target(h))) != 0) h = twin(h);
  const Index a = origin(h), b = target(h);
  const auto pair = [](std::uint8_t bits) { return (bits & (bits - 1)) != 0; };
  if ((planes(a) & ~planes(b)) != 0 || pair(planes(a))) return false;
  bool fits = true;
  around(a, [&](Index x) {
    const std::uint8_t shared = planes(target(x)) & planes(b);
    fits = fits && (target(x) == b || shared == 0 || (shared & planes(a)) == shared || adjacent(target(x), b));
  });
  return fits;
}

bool EditableMesh::collapse(Index h, const Vector3& place, double longest) {
  const Index g = twin(h), a = origin(h), b = target(h), c = origin(prev(h)), d = origin(prev(g));
  if (c == d || valence(c) <= 3 || valence(d) <= 3) return false;
  Index common = 0;
  around(a, [&](Index x) { common += adjacent(target(x), b) && target(x) != b; });
  if (common != 2) return false;
  bool fits = true;
  for (const Index v : {a, b})
    around(v, [&](Index x) {
      if (x / 3 == h / 3 || x / 3 == g / 3) return;
      const Index p = target(x), q = origin(prev(x));
      const Vector3 before = normal(v, p, q), after = (at(p) - place).cross(at(q) - place);
      const double edge = std::max((at(p) - place).norm(), (at(q) - place).norm());
      fits = fits && edge < longest && before.dot(after) > 0.3 * before.norm() * after.norm() &&
             after.norm() > 0.1 * edge * edge;
    });
  if (!fits) return false;
  const Index to_c = twin(prev(h)), from_c = twin(next(h)), to_d = twin(next(g)), from_d = twin(prev(g));
  std::vector<Index> leaving;
  around(b, [&](Index x) { leaving.push_back(x); });
  for (const Index x : leaving) origin(x) = a;
  at(a) = place;
  planes_[static_cast<std::size_t>(a)] |= planes(b);
  join(to_c, from_c);  // a to c, c to a
  join(to_d, from_d);
  leave(a, to_c);
  leave(c, from_c);
  leave(d, to_d);
  for (const Index f : {h / 3, g / 3})
    for (Index x = 3 * f; x < 3 * f + 3; ++x) corners_[static_cast<std::size_t>(x)] = no_index;
  outgoing_[static_cast<std::size_t>(b)] = no_index;
  live_faces_ -= 2;
  return true;
}

bool EditableMesh::flip_helps(Index h) const {
  const Index g = twin(h), a = origin(h), b = target(h), c = origin(prev(h)), d = origin(prev(g));
  if (c == d || valence(a) <= 3 || valence(b) <= 3 || adjacent(c, d)) return false;
  if (planes_along(h) != 0 || (planes(c) & planes(d)) != 0) return false;
  const auto off = [](Index v) { return std::abs(v - 6); };
  const Index now = off(valence(a)) + off(valence(b)) + off(valence(c)) + off(valence(d));
  const Index then = off(valence(a) - 1) + off(valence(b) - 1) + off(valence(c) + 1) + off(valence(d) + 1);
  if (then >= now) return false;
  const Vector3 old = normal(a, b, c).normalized() + normal(b, a, d).normalized();
  const Vector3 left = normal(a, d, c), right = normal(d, b, c);
  const double bend = left.normalized().dot(right.normalized());
  return left.dot(old) > 0 && right.dot(old) > 0 && bend > 0;
}

void EditableMesh::flip(Index h) {
  const Index g = twin(h), a = origin(h), b = target(h), c = origin(prev(h)), d = origin(prev(g));
  const Index bc = twin(next(h)), ca = twin(prev(h)), ad = twin(next(g)), db = twin(prev(g));
  const Index f = h - h % 3, e = g - g % 3;
  const Index first[3] = {a, d, c}, second[3] = {d, b, c};
  for (Index i = 0; i < 3; ++i) origin(f + i) = first[i], origin(e + i) = second[i];
  join(f, ad);
  join(f + 1, e + 2);
  join(f + 2, ca);
  join(e, db);
  join(e + 1, bc);
  leave(a, f);
  leave(d, e);
  leave(c, f + 2);
  leave(b, e + 1);
}

void EditableMesh::relax(const Shape& shape, const Context& context) {
  std::vector<Vector3> moved = points_;
  context.parallel_for(points_.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (outgoing_[v] == no_index) continue;
      Vector3 sum = Vector3::Zero(), gradient;
      double count = 0;
      around(static_cast<Index>(v), [&](Index h) {
        if (planes_along(h) != planes_[v]) return;
        sum += at(target(h));
        count += 1;
      });
      if (!(count > 0)) continue;  // where planes meet
      (void)shape.distance(points_[v], gradient);
      const Vector3 n = gradient.normalized(), step = sum / count - points_[v];
      moved[v] = project_within(shape, planes_[v], points_[v] + step - step.dot(n) * n, 2);
    }
  });
  points_ = std::move(moved);
}

void EditableMesh::remesh_round(const Shape& shape, double length_wanted, const Context& context) {
  const auto wanted = [&](Index h) {
    return shape.grading ? length_wanted * shape.grading((at(origin(h)) + at(target(h))) / 2) : length_wanted;
  };
  const auto middle = [&](Index h) {
    return project_within(shape, planes_along(h), (at(origin(h)) + at(target(h))) / 2, 2);
  };
  const Index before = halfedge_count();
  for (Index h = 0; h < before; ++h)
    if (live(h) && h < twin(h) && length(h) > 4.0 / 3 * wanted(h)) split(h, middle(h));
  for (Index h = 0; h < halfedge_count(); ++h) {
    Index g = h;
    if (live(h) && h < twin(h) && length(h) < 0.8 * wanted(h) && collapses_within(g))
      collapse(g, planes(origin(g)) == planes(target(g)) ? middle(g) : at(target(g)), 4.0 / 3 * wanted(h));
  }
  for (Index h = 0; h < halfedge_count(); ++h)
    if (live(h) && h < twin(h) && flip_helps(h)) flip(h);
  relax(shape, context);
}

Expected<TriangleMesh<double>> EditableMesh::compact() const {
  std::vector<Index> number(points_.size(), no_index);
  Index count = 0;
  for (std::size_t v = 0; v < points_.size(); ++v)
    if (outgoing_[v] != no_index) number[v] = count++;
  Points<double> positions(count, 3);
  for (std::size_t v = 0; v < points_.size(); ++v)
    if (number[v] != no_index) positions.row(number[v]) = points_[v].transpose();
  Triangles faces(live_faces_, 3);
  Index f = 0;
  for (Index h = 0; h < halfedge_count(); h += 3) {
    if (!live(h)) continue;
    for (Index i = 0; i < 3; ++i) faces(f, i) = number[static_cast<std::size_t>(origin(h + i))];
    ++f;
  }
  return TriangleMesh<double>::create(std::move(positions), std::move(faces));
}

}  // namespace quadrig::samples
