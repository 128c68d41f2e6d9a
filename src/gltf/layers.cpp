// Heights over other shells, before and after.
#include "layers.hpp"

#include <algorithm>
#include <numeric>

#include "quadrig/quality/distance.hpp"

namespace quadrig::gltf {
namespace {

/// At least these shares of the distance in the input are kept: at the sheet's vertices, at those of the shell below.
constexpr double own_share = 0.5, other_share = 0.25;
constexpr int rounds = 4;

/// What lies over another shell lies along its normal there, not beside its border.
constexpr double least_cosine = 0.5;

/// A signed distance and the direction in which it grows; none where the point is beside the surface.
struct Height {
  double value = 0;
  Vector3 normal = Vector3::Zero();
  Index face = no_index;
  [[nodiscard]] bool found() const { return face != no_index; }
};

Height height_over(const ClosestPoint& tree, const Points<double>& positions, const Triangles& faces, const Vector3& p,
                   double reach) {
  const SurfaceHit hit = tree.closest(p, {Vector3::Zero(), 0, reach});
  if (!hit.found() || hit.squared_distance > reach * reach) return {};
  const auto corner = [&](int i) { return Vector3(positions.row(faces(hit.face, i)).transpose()); };
  const Vector3 area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  const double length = area.norm();
  if (!(length > 0)) return {};
  const Vector3 normal = area / length, away = p - hit.position;
  const double along = away.dot(normal), distance = away.norm();
  if (distance > 1e-3 * reach && std::abs(along) < least_cosine * distance) return {};
  return {along, normal, hit.face};
}

/// A shell as it is now.
struct Made {
  Triangles faces;                 // over its own vertices
  std::vector<Index> vertex;       // of polygons: of the surface
  std::vector<SurfacePoint> from;  // on the surface
  Eigen::AlignedBox3d box;
  double edge = 0;
  bool open = false;
  double area = 0;
};

class Layers {
 public:
  Layers(const Gathered& gathered, Shells& shells, const Context& context)
      : gathered_(gathered), shells_(shells), mesh_(gathered.surface.asset.mesh), context_(context) {
    for (const Attribute& a : gathered.attributes)
      if (a.target != Attribute::no_target && a.name == "POSITION") targets_.push_back(a.first);
    for (const Shell& shell : shells.list) made_.push_back(as_made(shell));
  }

  Index run() {
    struct Pair {
      std::size_t sheet, below;
    };
    std::vector<Pair> pairs;
    for (std::size_t a = 0; a < made_.size(); ++a)
      for (std::size_t b = 0; b < made_.size(); ++b) {
        if (a == b || !made_[a].open || made_[a].area >= made_[b].area) continue;
        if (changed(a) || changed(b))
          if (reach_box(b).intersects(made_[a].box)) pairs.push_back({a, b});
      }
    for (const Pair& pair : pairs) {
      if (context_.cancelled()) break;
      for (std::size_t state = 0; state <= targets_.size(); ++state)
        if (state == 0 || moves(pair.sheet, state) || moves(pair.below, state)) settle(pair.sheet, pair.below, state);
    }
    Index count = 0;
    for (const Shell& shell : shells_.list) count += static_cast<Index>(shell.moved.size());
    return count + moved_;
  }

 private:
  [[nodiscard]] bool changed(std::size_t s) const { return shells_.list[s].make != GltfMake::kept; }
  [[nodiscard]] Eigen::AlignedBox3d reach_box(std::size_t s) const {
    const Vector3 reach = Vector3::Constant(made_[s].edge);
    return {made_[s].box.min() - reach, made_[s].box.max() + reach};
  }

  [[nodiscard]] Made as_made(const Shell& shell) const {
    Made made;
    if (shell.field) {
      const QuadMesh& quads = shell.field->result.mesh;
      made.faces = fan_triangles(to_polygons(quads));
      for (const SurfacePoint& p : quads.source) made.from.push_back({shell.field->faces[at(p.face)], p.barycentric});
    } else {
      std::map<Index, Index> number;
      made.faces = as_triangles(shell.polygons);
      for (Index k = 0; k < static_cast<Index>(made.faces.size()); ++k) {
        Index& v = made.faces(k / 3, k % 3);
        const auto [place, is_new] = number.try_emplace(v, static_cast<Index>(number.size()));
        if (is_new) {
          made.vertex.push_back(v);
          const Index h = mesh_.outgoing(v);
          made.from.push_back({h / 3, Vector3::Unit(h % 3)});
        }
        v = place->second;
      }
    }
    for (const Index f : shell.faces) {
      made.area += mesh_.area(f);
      for (Index h = 3 * f; h < 3 * f + 3; ++h) {
        made.open = made.open || mesh_.twin(h) == no_index;
        made.box.extend(mesh_.position(mesh_.origin(h)));
      }
    }
    made.edge = std::sqrt(2 * made.area / std::max<double>(1, static_cast<double>(made.faces.rows())));
    return made;
  }

  /// Of the input: where a point of the surface is in a state.
  [[nodiscard]] Vector3 input_place(const SurfacePoint& p, std::size_t state) const {
    Vector3 place = position(mesh_, p);
    if (state > 0)
      for (int i = 0; i < 3; ++i)
        place += p.barycentric[i] * gathered_.values.row(gathered_.corner_vertex[at(3 * p.face + i)])
                                        .segment<3>(targets_[state - 1])
                                        .transpose();
    return place;
  }
  [[nodiscard]] bool moves(std::size_t s, std::size_t state) const {
    for (const Index f : shells_.list[s].faces)
      for (Index h = 3 * f; h < 3 * f + 3; ++h)
        if (!gathered_.values.row(gathered_.corner_vertex[at(h)]).segment<3>(targets_[state - 1]).isZero()) return true;
    return false;
  }

  [[nodiscard]] Points<double> places(std::size_t s, std::size_t state) const {
    const Shell& shell = shells_.list[s];
    const Made& made = made_[s];
    Points<double> list(static_cast<Eigen::Index>(made.from.size()), 3);
    if (shell.field) {
      list = shell.field->result.mesh.positions;
      if (state > 0) list += shell.field->result.morphs[state - 1];
      return list;
    }
    for (std::size_t v = 0; v < made.from.size(); ++v) {
      Vector3 p = input_place(made.from[v], state);
      if (const auto found = shell.moved.find(made.vertex[v]); found != shell.moved.end()) {
        p += found->second[0];
        if (state > 0) p += found->second[state];
      }
      list.row(static_cast<Eigen::Index>(v)) = p.transpose();
    }
    return list;
  }

  void move(std::size_t s, std::size_t state, std::size_t v, const Vector3& by) {
    Shell& shell = shells_.list[s];
    if (shell.field) {
      const auto row = static_cast<Eigen::Index>(v);
      if (state == 0)
        shell.field->result.mesh.positions.row(row) += by.transpose();
      else
        shell.field->result.morphs[state - 1].row(row) += by.transpose();
      ++moved_;
      return;
    }
    std::vector<Vector3>& offsets = shell.moved[made_[s].vertex[v]];
    if (offsets.empty()) offsets.assign(1 + targets_.size(), Vector3::Zero());
    offsets[state] += by;
  }

  /// The input's triangles of a shell in a state, over vertices of its own.
  struct Input {
    Points<double> positions;
    Triangles faces;
    ClosestPoint tree;
  };
  [[nodiscard]] Input input_of(std::size_t s, std::size_t state) const {
    const std::vector<Index>& faces = shells_.list[s].faces;
    Input input;
    input.positions.resize(3 * static_cast<Eigen::Index>(faces.size()), 3);
    input.faces.resize(static_cast<Eigen::Index>(faces.size()), 3);
    Index row = 0;
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (int i = 0; i < 3; ++i, ++row) {
        input.positions.row(row) = input_place({faces[f], Vector3::Unit(i)}, state).transpose();
        input.faces(static_cast<Eigen::Index>(f), i) = row;
      }
    input.tree = ClosestPoint(input.positions, input.faces);
    return input;
  }

  /// Takes back the moves at the corners of quads that they would turn over or crush.
  static void keep_sound(const QuadMesh& quads, std::vector<Vector3>& by) {
    constexpr double least = 0.2;
    for (bool again = true; again;) {
      again = false;
      Points<double> moved = quads.positions;
      for (std::size_t v = 0; v < by.size(); ++v) moved.row(static_cast<Eigen::Index>(v)) += by[v].transpose();
      for (Index q = 0; q < quads.quad_count(); ++q) {
        const auto quad = quads.quads.row(q);
        if (scaled_jacobian(moved, quad) >= std::min(least, scaled_jacobian(quads.positions, quad))) continue;
        for (int i = 0; i < 4; ++i) {
          Vector3& own = by[at(quad[i])];
          again = again || !own.isZero();
          own.setZero();
        }
      }
    }
  }

  /// One sheet over one other shell in one state.
  void settle(std::size_t a, std::size_t b, std::size_t state) {
    const Made &sheet = made_[a], &below = made_[b];
    const double reach = std::max(below.edge, sheet.edge);
    const Points<double> ground = places(b, state);
    const ClosestPoint ground_tree(ground, below.faces);
    // What is near the other in the input, and by how much.
    const auto near = [&](const Made& from, std::size_t to) {
      std::vector<std::pair<std::size_t, double>> list;
      const Eigen::AlignedBox3d box = state == 0 ? made_[to].box : Eigen::AlignedBox3d();
      std::optional<Input> input;
      for (std::size_t v = 0; v < from.from.size(); ++v) {
        const Vector3 p = input_place(from.from[v], state);
        if (!box.isEmpty() && box.squaredExteriorDistance(p) > reach * reach) continue;
        if (!input) input = input_of(to, state);
        const Height h = height_over(input->tree, input->positions, input->faces, p, reach);
        if (h.found() && std::abs(h.value) > 1e-4 * reach) list.emplace_back(v, h.value);
      }
      return list;
    };
    const auto over = near(sheet, b), under = near(below, a);
    for (int round = 0; round < rounds; ++round) {
      std::vector<Vector3> by(sheet.from.size(), Vector3::Zero());
      Points<double> own = places(a, state);
      const auto raise = [&](std::size_t v, const Vector3& shift) {
        if (shift.norm() > by[v].norm()) by[v] = shift;
      };
      for (const auto& [v, wanted] : over) {
        const Vector3 p = own.row(static_cast<Eigen::Index>(v)).transpose();
        const Height now = height_over(ground_tree, ground, below.faces, p, 2 * reach);
        const double side = wanted > 0 ? 1 : -1, missing = own_share * std::abs(wanted) - side * now.value;
        if (now.found() && missing > 0) raise(v, side * missing * now.normal);
      }
      if (!under.empty()) {
        const ClosestPoint own_tree(own, sheet.faces);
        for (const auto& [v, wanted] : under) {
          const Vector3 p = ground.row(static_cast<Eigen::Index>(v)).transpose();
          const Height now = height_over(own_tree, own, sheet.faces, p, 2 * reach);
          const double side = wanted > 0 ? 1 : -1, missing = other_share * std::abs(wanted) - side * now.value;
          if (!now.found() || !(missing > 0)) continue;
          for (int i = 0; i < 3; ++i) raise(at(sheet.faces(now.face, i)), -side * missing * now.normal);
        }
      }
      if (state == 0 && shells_.list[a].field) keep_sound(shells_.list[a].field->result.mesh, by);
      bool any = false;
      for (std::size_t v = 0; v < by.size(); ++v)
        if (!by[v].isZero()) move(a, state, v, by[v]), any = true;
      if (!any) break;
    }
  }

  const Gathered& gathered_;
  Shells& shells_;
  const TriangleMesh<double>& mesh_;
  const Context& context_;
  std::vector<Eigen::Index> targets_;  // first columns
  std::vector<Made> made_;
  Index moved_ = 0;
};

}  // namespace

Index keep_layers(const Gathered& gathered, Shells& shells, const Context& context) {
  return Layers(gathered, shells, context).run();
}

}  // namespace quadrig::gltf
