// Definition of symmetrize.
#pragma once

#include <map>

#include "quadrig/closest.hpp"
#include "quadrig/symmetry.hpp"

namespace quadrig {
namespace detail {

class Symmetrizer {
 public:
  Symmetrizer(const TriangleMesh<double>& surface, const SkinWeights* weights,
              std::span<const Points<double>> source_morphs, const MirrorPlane& plane, std::span<const Index> twin,
              std::span<const char> held, Index influences, FittedQuads& quads, Context& context)
      : surface_(surface),
        source_weights_(weights),
        source_morphs_(source_morphs),
        plane_(plane),
        twin_(twin),
        held_(held),
        influences_(influences),
        quads_(quads),
        context_(context),
        closest_(surface) {}

  [[nodiscard]] SymmetrizeReport run() {
    find_symmetric();
    if (context_.cancelled()) return report_;
    move();
    if (quads_.weights && source_weights_) share_weights();
    if (!quads_.morphs.empty() && source_morphs_.size() == quads_.morphs.size()) share_morphs();
    turn_diagonals();
    for (std::size_t v = 0; v < twin_.size(); ++v)
      if (leads(v)) {
        ++report_.pairs;
        report_.exact += symmetric_[v] != 0;
      }
    return report_;
  }

 private:
  /// One of each pair stands for both.
  [[nodiscard]] bool leads(std::size_t v) const { return twin_[v] != no_index && static_cast<Index>(v) <= twin_[v]; }
  [[nodiscard]] Vector3 place(Index v) const { return quads_.mesh.positions.row(v).transpose(); }
  /// Where nearly all of the surface agrees with its image, what is off by little more is so by its triangles.
  [[nodiscard]] double tolerance() const {
    constexpr double little = 3;
    return nearly_symmetric() ? little * plane_.tolerance : plane_.tolerance;
  }
  [[nodiscard]] bool nearly_symmetric() const {
    constexpr double nearly_all = 0.98;
    return plane_.share > nearly_all;
  }
  [[nodiscard]] SurfaceHit image_of(const SurfacePoint& point) const {
    ClosestFilter filter;
    filter.normal = plane_.mirrored_direction(surface_.normal(point.face));
    filter.minimum_cosine = 0.5;
    filter.maximum_distance = tolerance();
    return closest_.closest(plane_.mirrored(position(surface_, point)), filter);
  }

  void find_symmetric() {
    symmetric_.assign(twin_.size(), 0);
    context_.parallel_for(twin_.size(), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        if (twin_[v] == no_index || quads_.mesh.source[v].face == no_index) continue;
        symmetric_[v] = image_of(quads_.mesh.source[v]).found();
      }
    });
    for (std::size_t v = 0; v < twin_.size(); ++v)
      if (leads(v)) symmetric_[v] = symmetric_[at(twin_[v])] = symmetric_[v] && symmetric_[at(twin_[v])];
  }

  void move() {
    const Points<double> before = quads_.mesh.positions;
    std::vector<double> shortest(twin_.size(), std::numeric_limits<double>::infinity());
    const auto& rows = quads_.mesh.quads;
    for (Index q = 0; q < quads_.mesh.quad_count(); ++q)
      for (int i = 0; i < 4; ++i) {
        const Index v = rows(q, i), w = rows(q, (i + 1) % 4);
        const double length = (before.row(v) - before.row(w)).norm();
        shortest[at(v)] = std::min(shortest[at(v)], length);
        shortest[at(w)] = std::min(shortest[at(w)], length);
      }
    for (std::size_t k = 0; k < twin_.size(); ++k) {
      if (!leads(k) || !symmetric_[k]) continue;
      const auto v = static_cast<Index>(k);
      const Index w = twin_[k];
      const bool stays = !held_.empty() && held_[k], other_stays = !held_.empty() && held_[at(w)];
      Vector3 here = place(v);
      if (v == w)
        here -= plane_.side(here) * plane_.normal;
      else if (!stays && !other_stays)
        here = (here + plane_.mirrored(place(w))) / 2;
      else if (!stays)
        here = plane_.mirrored(place(w));
      const Vector3 there = v == w ? here : plane_.mirrored(here);
      const double most = std::min(shortest[k], shortest[at(w)]);
      if ((here - place(v)).norm() > most || (there - place(w)).norm() > most) {
        symmetric_[k] = symmetric_[at(w)] = 0;
        continue;
      }
      quads_.mesh.positions.row(v) = here.transpose();
      quads_.mesh.positions.row(w) = there.transpose();
    }
    give_back(before);
    for (std::size_t v = 0; v < twin_.size(); ++v) {
      const double moved =
          (quads_.mesh.positions.row(static_cast<Index>(v)) - before.row(static_cast<Index>(v))).norm();
      report_.largest = std::max(report_.largest, moved);
      if (moved > 0 && quads_.mesh.source[v].face != no_index)
        quads_.mesh.source[v] = walk_closest(surface_, place(static_cast<Index>(v)), quads_.mesh.source[v]);
    }
  }

  /// Where a quad became worse than it may be, its corners and their twins go back.
  void give_back(const Points<double>& before) {
    constexpr double sound = 0.05;
    const auto& rows = quads_.mesh.quads;
    for (bool again = true; again;) {
      again = false;
      for (Index q = 0; q < quads_.mesh.quad_count(); ++q) {
        const double now = scaled_jacobian(quads_.mesh.positions, rows.row(q));
        if (now >= sound || now >= scaled_jacobian(before, rows.row(q))) continue;
        for (int i = 0; i < 4; ++i) {
          const Index v = rows(q, i);
          if (!symmetric_[at(v)]) continue;
          for (const Index w : {v, twin_[at(v)]}) {
            quads_.mesh.positions.row(w) = before.row(w);
            symmetric_[at(w)] = 0;
          }
          again = true;
        }
      }
    }
  }

  // --- weights ------------------------------------------------------------------------------------------------------

  using Row = std::vector<BoneShare>;
  [[nodiscard]] static Row row_of(const SkinWeights& weights, Index v) {
    Row row;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      if (it.value() > 0) row.push_back({static_cast<Index>(it.col()), it.value()});
    return row;
  }
  /// The row on the other side; nothing where a bone has no twin.
  [[nodiscard]] std::optional<Row> mirrored(Row row) const {
    for (BoneShare& share : row) {
      share.bone = at(share.bone) < plane_.twin.size() ? plane_.twin[at(share.bone)] : no_index;
      if (share.bone == no_index) return std::nullopt;
    }
    std::sort(row.begin(), row.end(), [](const BoneShare& a, const BoneShare& b) { return a.bone < b.bone; });
    return row;
  }
  [[nodiscard]] static double apart(const Row& a, const Row& b) {
    std::map<Index, double> difference;
    for (const BoneShare& share : a) difference[share.bone] += share.weight;
    for (const BoneShare& share : b) difference[share.bone] -= share.weight;
    double sum = 0;
    for (const auto& [bone, d] : difference) sum += std::abs(d);
    return sum;
  }

  void share_weights() {
    SkinWeights& weights = *quads_.weights;
    const SkinWeights source = interpolate(surface_, *source_weights_, quads_.mesh.source);
    // Sum of the differences up to which the input counts as symmetric: weights that were computed or painted on
    // triangles which differ are off by more than the surface.
    constexpr double of_bodies = 0.5, of_parts = 0.25;
    const double alike = nearly_symmetric() ? of_bodies : of_parts;
    std::vector<Row> rows(twin_.size());
    for (std::size_t v = 0; v < rows.size(); ++v) rows[v] = row_of(weights, static_cast<Index>(v));
    for (std::size_t v = 0; v < rows.size(); ++v) {
      if (!leads(v) || !symmetric_[v]) continue;
      const Index w = twin_[v];
      const std::optional<Row> image = mirrored(row_of(source, w));
      if (!image || apart(row_of(source, static_cast<Index>(v)), *image) > alike) continue;
      const std::optional<Row> other = mirrored(rows[v]);
      if (!other) continue;
      if (w != static_cast<Index>(v))
        rows[at(w)] = *other;
      else
        rows[v] = even(rows[v], *other);
    }
    std::vector<Eigen::Triplet<double, Index>> entries;
    for (std::size_t v = 0; v < rows.size(); ++v)
      for (const BoneShare& share : rows[v]) entries.emplace_back(static_cast<Index>(v), share.bone, share.weight);
    SkinWeights result(weights.rows(), weights.cols());
    result.setFromTriplets(entries.begin(), entries.end());
    weights = std::move(result);
  }

  /// The mean of a row on the plane and its mirror image: bones with their twins, the strongest pairs first.
  [[nodiscard]] Row even(const Row& row, const Row& other) const {
    std::map<Index, double> sum;
    for (const Row* each : {&row, &other})
      for (const BoneShare& share : *each) sum[share.bone] += share.weight / 2;
    std::vector<BoneShare> groups;  // by the lower bone, the weight of both
    for (const auto& [bone, weight] : sum)
      if (const Index twin = plane_.twin[at(bone)]; bone <= twin)
        groups.push_back({bone, twin == bone ? weight : weight + sum[twin]});
    std::sort(groups.begin(), groups.end(), BoneShare::stronger);
    Row kept;
    double total = 0;
    for (const BoneShare& group : groups) {
      const Index twin = plane_.twin[at(group.bone)], count = twin == group.bone ? 1 : 2;
      if (static_cast<Index>(kept.size()) + count > influences_) continue;
      kept.push_back({group.bone, group.weight / count});
      if (count == 2) kept.push_back({twin, group.weight / count});
      total += group.weight;
    }
    if (!(total > 0)) return row;
    for (BoneShare& share : kept) share.weight /= total;
    return kept;
  }

  // --- morph targets ------------------------------------------------------------------------------------------------

  /// Of each morph the one that moves the other side as it moves this; itself where it is self-symmetric.
  [[nodiscard]] std::vector<Index> morph_twins() const {
    constexpr std::size_t probes = 2000;
    constexpr double alike = 0.05;  // squared difference, of the squared displacements
    const auto n = static_cast<std::size_t>(surface_.vertex_count());
    const std::size_t step = std::max<std::size_t>(1, n / probes), count = source_morphs_.size();
    std::vector<std::pair<Index, SurfaceHit>> images;
    for (std::size_t v = 0; v < n; v += step) {
      const Index h = surface_.outgoing(static_cast<Index>(v));
      if (h == no_index) continue;
      const SurfaceHit hit = image_of({h / 3, Vector3::Unit(h % 3)});
      if (hit.found()) images.emplace_back(static_cast<Index>(v), hit);
    }
    std::vector<Points<double>> here(count), there(count);
    for (std::size_t k = 0; k < count; ++k) {
      here[k].resize(static_cast<Eigen::Index>(images.size()), 3);
      there[k].setZero(static_cast<Eigen::Index>(images.size()), 3);
      for (std::size_t i = 0; i < images.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        here[k].row(row) = plane_.mirrored_direction(source_morphs_[k].row(images[i].first).transpose()).transpose();
        for (int c = 0; c < 3; ++c)
          there[k].row(row) +=
              images[i].second.barycentric[c] * source_morphs_[k].row(surface_.faces()(images[i].second.face, c));
      }
    }
    std::vector<Index> twin(count, no_index);
    for (std::size_t k = 0; k < count; ++k) {
      double least = alike * here[k].squaredNorm();
      for (std::size_t other = 0; other < count; ++other) {
        const double apart = (here[k] - there[other]).squaredNorm();
        if (apart < least || (apart == least && twin[k] == no_index))
          least = apart, twin[k] = static_cast<Index>(other);
      }
    }
    for (std::size_t k = 0; k < count; ++k)
      if (twin[k] != no_index && twin[at(twin[k])] != static_cast<Index>(k)) twin[k] = no_index;
    return twin;
  }

  void share_morphs() {
    const std::vector<Index> twins = morph_twins();
    for (std::size_t k = 0; k < twins.size(); ++k) {
      if (twins[k] == no_index || twins[k] < static_cast<Index>(k)) continue;
      Points<double>&one = quads_.morphs[k], &other = quads_.morphs[at(twins[k])];
      for (std::size_t v = 0; v < twin_.size(); ++v) {
        if (twin_[v] == no_index || !symmetric_[v] || (&one == &other && !leads(v))) continue;
        const auto row = static_cast<Eigen::Index>(v);
        const Vector3 there = other.row(twin_[v]).transpose();
        const Vector3 mean = (one.row(row).transpose() + plane_.mirrored_direction(there)) / 2;
        one.row(row) = mean.transpose();
        other.row(twin_[v]) = plane_.mirrored_direction(mean).transpose();
      }
    }
  }

  /// Quads in pairs begin at corners in pairs: their halves are mirror images too.
  void turn_diagonals() {
    auto& rows = quads_.mesh.quads;
    std::map<std::array<Index, 4>, Index> number;
    const auto key = [&](Index q, bool image) {
      std::array<Index, 4> corners;
      for (int i = 0; i < 4; ++i) corners[at(i)] = image ? twin_[at(rows(q, i))] : rows(q, i);
      std::sort(corners.begin(), corners.end());
      return corners;
    };
    for (Index q = 0; q < quads_.mesh.quad_count(); ++q) number.emplace(key(q, false), q);
    for (Index q = 0; q < quads_.mesh.quad_count(); ++q) {
      bool exact = true;
      for (int i = 0; i < 4; ++i) exact = exact && symmetric_[at(rows(q, i))];
      if (!exact) continue;
      const auto found = number.find(key(q, true));
      if (found == number.end() || found->second <= q) continue;
      for (int i = 0; i < 4; ++i) rows(found->second, i) = twin_[at(rows(q, (4 - i) % 4))];
    }
  }

  const TriangleMesh<double>& surface_;
  const SkinWeights* source_weights_;
  std::span<const Points<double>> source_morphs_;
  const MirrorPlane& plane_;
  std::span<const Index> twin_;
  std::span<const char> held_;
  const Index influences_;
  FittedQuads& quads_;
  Context& context_;
  const ClosestPoint closest_;
  std::vector<char> symmetric_;
  SymmetrizeReport report_;
};

}  // namespace detail

QUADRIG_INLINE SymmetrizeReport symmetrize(const TriangleMesh<double>& surface, const SkinWeights* weights,
                                           std::span<const Points<double>> source_morphs, const MirrorPlane& plane,
                                           std::span<const Index> twin, std::span<const char> held, Index influences,
                                           FittedQuads& quads, Context& context) {
  return detail::Symmetrizer(surface, weights, source_morphs, plane, twin, held, influences, quads, context).run();
}

}  // namespace quadrig
