// Faces that lie double on a surface and stray ones that hang on it: they would have it cut apart around them.
#pragma once

#include <map>
#include <set>

#include "quadrig/prepare/repair.ipp"

namespace quadrig::prepare_detail {

/// Drops what hangs on edges of three faces and more, one face after the other:
/// - a face that doubles half of two neighbours, as where a quad is cut along both of its diagonals;
/// - a small one whose other edges are open.
class Flaps {
 public:
  explicit Flaps(Draft& work) : work_(work) {}

  /// How many faces went. \cost O(m log m) where there are edges of three faces, else O(m)
  Index drop() {
    std::vector<Index> suspects;
    for_each_edge(sorted_sides(work_.faces), [&](std::span<const Side> edge) {
      if (!forks(edge.size())) return;
      for (const Side& side : edge) suspects.push_back(side.halfedge / 3);
    });
    if (suspects.empty()) return 0;
    std::sort(suspects.begin(), suspects.end());
    suspects.erase(std::unique(suspects.begin(), suspects.end()), suspects.end());
    gather(suspects);
    std::vector<char> gone(work_.faces.size(), 0);
    Index dropped = 0;
    for (bool again = true; again;) {
      again = false;
      for (std::size_t k = suspects.size(); k-- > 0;) {
        const Index f = suspects[k];
        if (gone[at(f)] || !(doubles(face(f)) || hangs(face(f)))) continue;
        gone[at(f)] = 1;
        remove(face(f));
        ++dropped;
        again = true;
      }
    }
    std::size_t kept = 0;
    for (std::size_t f = 0; f < work_.faces.size(); ++f) {
      if (gone[f]) continue;
      work_.faces[kept] = work_.faces[f];
      work_.polygon[kept++] = work_.polygon[f];
    }
    work_.faces.resize(kept);
    work_.polygon.resize(kept);
    return dropped;
  }

 private:
  using Edge = std::array<Index, 2>;
  /// Whether the faces at an edge may be a sheet and slips of dirt. More are a fan, and looking at each of them for
  /// each of them would have no end.
  [[nodiscard]] static bool forks(std::size_t faces) { return faces >= 3 && faces <= 16; }
  [[nodiscard]] static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  [[nodiscard]] const Face& face(Index f) const { return work_.faces[at(f)]; }
  [[nodiscard]] static Edge edge(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }
  [[nodiscard]] static Face sorted(Face f) {
    std::sort(f.begin(), f.end());
    return f;
  }
  [[nodiscard]] double area(const Face& f) const {
    return triangle_normal(work_.positions, f[0], f[1], f[2]).norm() / 2;
  }

  /// The edges around the suspects, each with the corners that faces have across it.
  void gather(const std::vector<Index>& suspects) {
    for (const Index f : suspects)
      for (std::size_t i = 0; i < 3; ++i) across_[edge(face(f)[i], face(f)[(i + 1) % 3])];
    for (const Face& f : work_.faces) {
      total_area_ += area(f);
      bool near = false;
      for (std::size_t i = 0; i < 3; ++i)
        if (const auto found = across_.find(edge(f[i], f[(i + 1) % 3])); found != across_.end()) {
          found->second.push_back(f[(i + 2) % 3]);
          near = true;
        }
      if (near) faces_.insert(sorted(f));
    }
  }
  void remove(const Face& f) {
    for (std::size_t i = 0; i < 3; ++i) {
      std::vector<Index>& corners = across_.at(edge(f[i], f[(i + 1) % 3]));
      corners.erase(std::find(corners.begin(), corners.end(), f[(i + 2) % 3]));
    }
    faces_.erase(sorted(f));
  }
  [[nodiscard]] const std::vector<Index>& across(Index a, Index b) const { return across_.at(edge(a, b)); }

  /// Of the face a b d: faces a b c and a c d are there too, and what lies across b d is nothing, or b c d.
  [[nodiscard]] bool doubles(const Face& f) const {
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = f[i], b = f[(i + 1) % 3], d = f[(i + 2) % 3];
      if (!forks(across(a, b).size()) || across(a, d).size() < 3 || across(b, d).size() > 2) continue;
      for (const Index c : across(a, b)) {
        if (c == d || !faces_.contains(sorted({a, c, d}))) continue;
        const std::vector<Index>& beyond = across(b, d);
        if (std::all_of(beyond.begin(), beyond.end(), [&](Index v) { return v == a || v == c; })) return true;
      }
    }
    return false;
  }
  /// Open but for an edge, where two faces go on that do not hang there themselves.
  [[nodiscard]] bool hangs(const Face& f) const {
    constexpr double small = 1e-3;  // of the area of all
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = f[i], b = f[(i + 1) % 3], c = f[(i + 2) % 3];
      if (!forks(across(a, b).size()) || across(b, c).size() > 1 || across(a, c).size() > 1) continue;
      const auto goes_on = [&](Index v) { return across(a, v).size() > 1 || across(b, v).size() > 1; };
      const std::vector<Index>& others = across(a, b);
      return area(f) < small * total_area_ && std::count_if(others.begin(), others.end(), goes_on) >= 2;
    }
    return false;
  }

  Draft& work_;
  std::map<Edge, std::vector<Index>> across_;
  std::set<Face> faces_;  // sorted
  double total_area_ = 0;
};

}  // namespace quadrig::prepare_detail
