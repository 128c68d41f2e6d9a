#pragma once

#include <map>
#include <numeric>

#include "quadrig/constraints/hinges.hpp"
#include "quadrig/disjoint_sets.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/rims.hpp"

namespace quadrig {

namespace detail {

/// Directions spread evenly over the sphere. Source: Fibonacci lattice.
[[nodiscard]] inline std::vector<Vector3> even_directions(int count) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Vector3> directions;
  for (int k = 0; k < count; ++k) {
    const double z = 1 - (2 * k + 1.0) / count, r = std::sqrt(1 - z * z);
    directions.emplace_back(r * elementary::cos(golden * k), r * elementary::sin(golden * k), z);
  }
  return directions;
}

/// Means of each vertex and its neighbours, a few times.
inline void smooth_values(const TriangleMesh<double>& mesh, int rounds, std::vector<double>& values) {
  std::vector<double> sum(values.size()), count(values.size());
  for (int round = 0; round < rounds; ++round) {
    std::fill(sum.begin(), sum.end(), 0.0);
    std::fill(count.begin(), count.end(), 0.0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      sum[at(mesh.origin(h))] += values[at(mesh.target(h))];
      sum[at(mesh.target(h))] += values[at(mesh.origin(h))];
      count[at(mesh.origin(h))] += 1;
      count[at(mesh.target(h))] += 1;
    }
    for (std::size_t v = 0; v < values.size(); ++v)
      if (count[v] > 0) values[v] = (values[v] + sum[v] / count[v]) / 2;
  }
}

/// A closed polyline as `count` points an even way apart, smoothed.
[[nodiscard]] inline std::vector<Vector3> even_curve(const std::vector<Vector3>& line, std::size_t count, int rounds) {
  std::vector<double> along{0};
  for (std::size_t k = 0; k < line.size(); ++k)
    along.push_back(along.back() + (line[(k + 1) % line.size()] - line[k]).norm());
  std::vector<Vector3> points;
  std::size_t k = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = along.back() * static_cast<double>(i) / static_cast<double>(count);
    while (k + 1 < line.size() && along[k + 1] < s) ++k;
    const double step = along[k + 1] - along[k], t = step > 0 ? (s - along[k]) / step : 0;
    points.push_back((1 - t) * line[k] + t * line[(k + 1) % line.size()]);
  }
  for (int round = 0; round < rounds; ++round) {
    const std::vector<Vector3> before = points;
    for (std::size_t i = 0; i < count; ++i)
      points[i] = before[i] / 2 + (before[(i + 1) % count] + before[(i + count - 1) % count]) / 4;
  }
  return points;
}

[[nodiscard]] inline double closed_length(const std::vector<Vector3>& points) {
  double sum = 0;
  for (std::size_t k = 0; k < points.size(); ++k) sum += (points[(k + 1) % points.size()] - points[k]).norm();
  return sum;
}

/// What names tell of an opening.
struct RimWords {
  RimKind kind;
  double reach;  ///< of a bone from the centre, in radii
  std::array<std::string_view, 8> words;
};
inline constexpr std::array rim_words{
    RimWords{RimKind::eye, 2.5, {"eye", "lid", "blink", "orbicularis", "oculi", "", "", ""}},
    RimWords{RimKind::mouth, 2.5, {"mouth", "lip", "jaw", "oris", "tongue", "teeth", "", ""}},
};

class RimFinder {
 public:
  RimFinder(const TriangleMesh<double>& mesh, const Rig* rig, const MirrorPlane* plane, const Context& context)
      : mesh_(mesh), rig_(rig), plane_(plane), context_(context) {}

  [[nodiscard]] std::vector<Rim> run() {
    open_ = openness(mesh_, context_);
    if (context_.cancelled()) return {};
    constexpr std::array levels{0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5};
    for (const double level : levels) find_pockets(level);
    if (pockets_.empty()) return {};
    make_rims();
    pair_up();
    name_kinds();
    witness();
    for (Rim& rim : rims_) rim.score = std::min(rim.score, 1.0);
    sort();
    return std::move(rims_);
  }

 private:
  struct Pocket {
    Index deepest = no_index;
    std::vector<Vector3> line;
    double length = 0, roomy = 0;  // how many discs of the opening's size its surface has
    double shortest = 0;           // of its curves so far
  };
  struct Region {
    double area = 0;
    Index deepest = no_index;
    std::vector<FaceLoop> loops{};
  };

  /// Connected parts of the surface darker than a level, those much larger than their openings.
  void find_pockets(double level) {
    constexpr double dark = 0.15, roomy = 1.5, most_others = 0.3;
    const std::vector<FaceLoop> loops = level_loops(mesh_, open_, level);
    if (loops.empty()) return;
    DisjointSets connected(at(mesh_.vertex_count()));
    const auto inside = [&](Index v) { return open_[at(v)] < level; };
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      if (inside(mesh_.origin(h)) && inside(mesh_.target(h))) connected.join(mesh_.origin(h), mesh_.target(h));
    std::map<Index, Region> regions;
    for (const FaceLoop& loop : loops)
      regions[static_cast<Index>(connected.find(mesh_.origin(loop.crossed[0])))].loops.push_back(loop);
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      if (!inside(v)) continue;
      const auto found = regions.find(static_cast<Index>(connected.find(v)));
      if (found == regions.end()) continue;
      Index& deepest = found->second.deepest;
      if (deepest == no_index || open_[at(v)] < open_[at(deepest)]) deepest = v;
    }
    for (Index f = 0; f < mesh_.face_count(); ++f) {
      const auto t = mesh_.faces().row(f);
      if (!inside(t[0]) || !inside(t[1]) || !inside(t[2])) continue;
      if (const auto found = regions.find(static_cast<Index>(connected.find(t[0]))); found != regions.end())
        found->second.area += mesh_.area(f);
    }
    for (const auto& [root, region] : regions) {
      if (!(open_[at(region.deepest)] < dark)) continue;
      std::vector<Vector3> longest;
      double length = 0, all = 0;
      for (const FaceLoop& loop : region.loops) {
        std::vector<Vector3> line;
        for (std::size_t k = 0; k < loop.crossed.size(); ++k) line.push_back(crossing(mesh_, loop, k));
        const double own = closed_length(line);
        all += own;
        if (own > length) length = own, longest = std::move(line);
      }
      // A tunnel has two mouths, and what lies between limbs has a ragged border.
      const double disc = length * length / (4 * std::numbers::pi), ratio = disc > 0 ? region.area / disc : 0;
      if (!(ratio > roomy) || all - length > most_others * length) continue;
      std::reverse(longest.begin(), longest.end());  // counter-clockwise seen from outside
      take({region.deepest, std::move(longest), length, ratio}, connected, root, level);
    }
  }
  /// Of a pocket that is known already the outermost of the shortest curves; a region with two known pockets is none.
  void take(Pocket pocket, DisjointSets& connected, Index root, double level) {
    std::vector<Pocket*> known;
    for (Pocket& one : pockets_)
      if (open_[at(one.deepest)] < level && static_cast<Index>(connected.find(one.deepest)) == root)
        known.push_back(&one);
    constexpr double as_short = 1.03;
    pocket.shortest = pocket.length;
    if (known.empty()) {
      pockets_.push_back(std::move(pocket));
    } else if (known.size() == 1 && pocket.length < as_short * known[0]->shortest) {
      pocket.shortest = std::min(pocket.length, known[0]->shortest);
      *known[0] = std::move(pocket);
    }
  }

  /// The curves smooth and on the surface, even in number of points.
  void make_rims() {
    constexpr std::size_t points = 96;
    constexpr int rounds = 4;
    const ClosestPoint closest(mesh_);
    for (const Pocket& pocket : pockets_) {
      Rim rim;
      for (const Vector3& p : even_curve(pocket.line, points, rounds)) {
        const SurfaceHit hit = closest.closest(p);
        rim.points.push_back(hit.position);
        const auto t = mesh_.faces().row(hit.face);
        const Vector3 a = mesh_.position(t[0]), b = mesh_.position(t[1]), c = mesh_.position(t[2]);
        rim.normals.push_back((b - a).cross(c - a).normalized());
      }
      rim.length = closed_length(rim.points);
      constexpr double of_pocket = 0.4;
      rim.score = of_pocket;
      rim.evidence.push_back("pocket of " + std::to_string(pocket.roomy).substr(0, 4) + " times its opening");
      rims_.push_back(std::move(rim));
    }
  }

  /// How far two openings are from being mirror images, in radii; nothing where they are none.
  [[nodiscard]] std::optional<double> unlike(const Rim& a, const Rim& b) const {
    constexpr double alike = 0.8;
    return std::min(a.length, b.length) > alike * std::max(a.length, b.length)
               ? std::optional(std::abs(a.length - b.length) / a.radius())
               : std::nullopt;
  }

  /// Which rims mirror each other, or themselves.
  void pair_up() {
    constexpr double near = 0.6;  // radii
    std::optional<MirrorPlane> between;
    if (!plane_) {
      // The longest two of one size that face the same way.
      double longest = 0;
      for (std::size_t a = 0; a < rims_.size(); ++a)
        for (std::size_t b = a + 1; b < rims_.size(); ++b) {
          if (!unlike(rims_[a], rims_[b]) || !alongside(rims_[a], rims_[b]) || rims_[a].length < longest) continue;
          longest = rims_[a].length;
          MirrorPlane plane;
          plane.normal = (rims_[a].centre() - rims_[b].centre()).normalized();
          plane.offset = plane.normal.dot(rims_[a].centre() + rims_[b].centre()) / 2;
          between = plane;
        }
      if (!between) return;
    }
    const MirrorPlane& plane = plane_ ? *plane_ : *between;
    for (std::size_t a = 0; a < rims_.size(); ++a) {
      const Vector3 image = plane.mirrored(rims_[a].centre());
      double least = near * rims_[a].radius();
      for (std::size_t b = 0; b < rims_.size(); ++b) {
        const double apart = (rims_[b].centre() - image).norm();
        if (!unlike(rims_[a], rims_[b]) || !(apart < least)) continue;
        least = apart;
        rims_[a].twin = static_cast<Index>(b);
      }
    }
    for (std::size_t a = 0; a < rims_.size(); ++a)
      if (const Index b = rims_[a].twin; b != no_index && rims_[at(b)].twin != static_cast<Index>(a))
        rims_[a].twin = no_index;
  }

  /// Whether two openings face the same way, and are as far apart as eyes may be.
  [[nodiscard]] static bool alongside(const Rim& a, const Rim& b) {
    constexpr double least_cosine = 0.2, nearest = 0.25, farthest = 2.5;  // in lengths of a rim
    const Vector3 u = a.area(), v = b.area();
    const double apart = (a.centre() - b.centre()).norm();
    return u.dot(v) > least_cosine * u.norm() * v.norm() && apart > nearest * a.length && apart < farthest * a.length;
  }

  void name_kinds() {
    constexpr double of_pair = 0.05, of_face = 0.25;  // legs of trousers are a pair as well
    // Eyes: the longest pair that faces the same way.
    Index eye = no_index;
    for (std::size_t a = 0; a < rims_.size(); ++a) {
      const Index b = rims_[a].twin;
      if (b == no_index || at(b) <= a) continue;
      const bool same_way = alongside(rims_[a], rims_[at(b)]);
      for (const Index r : {static_cast<Index>(a), b}) {
        rims_[at(r)].kind = same_way ? RimKind::nostril : RimKind::ear;
        rims_[at(r)].score += of_pair;
        rims_[at(r)].evidence.emplace_back("a mirror image");
      }
      if (same_way && (eye == no_index || rims_[a].length > rims_[at(eye)].length)) eye = static_cast<Index>(a);
    }
    if (eye != no_index)
      for (const Index r : {eye, rims_[at(eye)].twin}) rims_[at(r)].kind = RimKind::eye;
    Rim* mouth = nullptr;
    for (std::size_t a = 0; a < rims_.size(); ++a) {
      Rim& rim = rims_[a];
      if (rim.twin != static_cast<Index>(a)) continue;
      rim.score += of_pair;
      rim.evidence.emplace_back("lies on the mirror plane");
      if (eye != no_index && below(rim, rims_[at(eye)], rims_[at(rims_[at(eye)].twin)]) &&
          (!mouth || rim.length > mouth->length))
        mouth = &rim;
    }
    if (!mouth) return;
    mouth->kind = RimKind::mouth;
    mouth->score += of_face;
    mouth->evidence.emplace_back("below two eyes");
    for (const Index r : {eye, rims_[at(eye)].twin}) {
      rims_[at(r)].score += of_face;
      rims_[at(r)].evidence.emplace_back("above a mouth");
    }
  }
  /// Whether an opening lies as a mouth does to these eyes.
  [[nodiscard]] static bool below(const Rim& rim, const Rim& a, const Rim& b) {
    constexpr double nearest = 0.4, farthest = 3.5;  // from between the eyes, in their distance
    const double apart = (a.centre() - b.centre()).norm();
    const double off = (rim.centre() - (a.centre() + b.centre()) / 2).norm();
    return rim.area().dot(a.area() + b.area()) > 0 && off > nearest * apart && off < farthest * apart;
  }

  /// Names of bones nearby: they speak for a kind, and name it where nothing else does.
  void witness() {
    constexpr double of_name = 0.3;
    if (!rig_) return;
    for (Rim& rim : rims_) {
      const Vector3 middle = rim.centre();
      for (const RimWords& words : rim_words) {
        if (rim.kind != words.kind && rim.kind != RimKind::pocket && rim.kind != RimKind::nostril) continue;
        const Bone* nearest = nullptr;
        double least = words.reach * rim.radius();
        for (const Bone& bone : rig_->skeleton.bones) {
          if (!named(bone.name, words)) continue;
          const double off = std::min((bone.head - middle).norm(), (bone.tail - middle).norm());
          if (off < least) least = off, nearest = &bone;
        }
        if (!nearest) continue;
        rim.kind = words.kind;
        rim.score += of_name;
        rim.evidence.push_back("bone '" + nearest->name + "'");
        break;
      }
    }
  }
  [[nodiscard]] static bool named(const std::string& name, const RimWords& words) {
    std::string lower;
    for (const char c : name) lower += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    if (lower.find("brow") != std::string::npos) return false;
    return std::ranges::any_of(
        words.words, [&](std::string_view word) { return !word.empty() && lower.find(word) != std::string::npos; });
  }

  void sort() {
    std::vector<Index> order(rims_.size()), place(rims_.size());
    std::iota(order.begin(), order.end(), Index{0});
    std::ranges::stable_sort(order, [&](Index a, Index b) {
      return std::pair(rims_[at(a)].kind, -rims_[at(a)].length) < std::pair(rims_[at(b)].kind, -rims_[at(b)].length);
    });
    std::vector<Rim> sorted;
    for (std::size_t k = 0; k < order.size(); ++k) place[at(order[k])] = static_cast<Index>(k);
    for (const Index k : order) {
      sorted.push_back(std::move(rims_[at(k)]));
      if (Index& twin = sorted.back().twin; twin != no_index) twin = place[at(twin)];
    }
    rims_ = std::move(sorted);
  }

  const TriangleMesh<double>& mesh_;
  const Rig* rig_;
  const MirrorPlane* plane_;
  const Context& context_;
  std::vector<double> open_;
  std::vector<Pocket> pockets_;
  std::vector<Rim> rims_;
};

}  // namespace detail

QUADRIG_INLINE std::vector<double> openness(const TriangleMesh<double>& mesh, const Context& context) {
  using detail::at;
  // Most of a surface is open, which few rays tell.
  constexpr int few = 48, many = 192;
  constexpr double shade = 0.8, grazing = 0.05, off_surface = 1e-5;
  constexpr Index least_faces = 64;
  constexpr std::size_t grain = 512;
  std::vector<double> open(at(mesh.vertex_count()), 1.0);
  std::vector<Vector3> normal(open.size(), Vector3::Zero());
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto t = mesh.faces().row(f);
    const Vector3 n = (mesh.position(t[1]) - mesh.position(t[0])).cross(mesh.position(t[2]) - mesh.position(t[0]));
    for (int i = 0; i < 3; ++i) normal[at(t[i])] += n;
  }
  const std::vector<Vector3> first = detail::even_directions(few), then = detail::even_directions(many);
  const double off = off_surface * mesh.diagonal();
  const Components components = face_components(mesh);
  std::vector<std::vector<Index>> faces(at(components.count));
  for (Index f = 0; f < mesh.face_count(); ++f) faces[at(components.of_face[at(f)])].push_back(f);
  for (const std::vector<Index>& part : faces) {
    if (static_cast<Index>(part.size()) < least_faces) continue;
    Triangles own(static_cast<Eigen::Index>(part.size()), 3);
    for (std::size_t f = 0; f < part.size(); ++f) own.row(static_cast<Eigen::Index>(f)) = mesh.faces().row(part[f]);
    const ClosestPoint surface(mesh.positions(), own);
    std::vector<Index> vertices(own.data(), own.data() + own.size());
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    const auto measure = [&](Index v, const std::vector<Vector3>& directions) {
      const Vector3 n = normal[at(v)].normalized(), p = mesh.position(v) + off * n;
      double all = 0, seen = 0;
      for (const Vector3& d : directions) {
        const double cosine = n.dot(d);
        if (!(cosine > grazing)) continue;
        all += cosine;
        if (!surface.meets(p, d, 0)) seen += cosine;
      }
      open[at(v)] = all > 0 ? seen / all : 1;
    };
    context.parallel_for(vertices.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end && !context.cancelled(); ++k) {
        measure(vertices[k], first);
        if (open[at(vertices[k])] < shade) measure(vertices[k], then);
      }
    });
    if (context.cancelled()) return open;
  }
  constexpr int rounds = 2;
  detail::smooth_values(mesh, rounds, open);
  return open;
}

QUADRIG_INLINE std::vector<Rim> find_rims(const TriangleMesh<double>& mesh, const Rig* rig, const MirrorPlane* plane,
                                          const Context& context) {
  return detail::RimFinder(mesh, rig, plane, context).run();
}

}  // namespace quadrig
