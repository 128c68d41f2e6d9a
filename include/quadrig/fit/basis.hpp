// What a surface is measured against: quads as they are drawn, flat or subdivided, every point of them a sum of the
// vertices that the fit moves.
#pragma once

#include "quadrig/fit/drawn.hpp"
#include "quadrig/subdivision.hpp"

namespace quadrig::detail {

class FitBasis {
 public:
  /// The quads themselves.
  explicit FitBasis(const QuadMesh& cage) : quads_(cage.quads), drawn_(cage) {
    by_cage_.resize(at(cage.quad_count()));
    for (std::size_t q = 0; q < by_cage_.size(); ++q) by_cage_[q] = {static_cast<Index>(q)};
  }
  /// What subdivision makes of them.
  FitBasis(const QuadMesh& cage, Subdivision subdivision)
      : quads_(cage.quads),
        subdivision_(std::move(subdivision)),
        drawn_(QuadMesh{Points<double>(subdivision_->stencils * cage.positions), subdivision_->quads, {}}) {
    by_cage_.resize(at(cage.quad_count()));
    patch_.resize(by_cage_.size());
    for (Index q = 0; q < drawn_.quad_count(); ++q) by_cage_[at(cage_of(q))].push_back(q);
    for (std::size_t q = 0; q < patch_.size(); ++q) {
      std::vector<Index>& patch = patch_[q];
      for (const Index part : by_cage_[q])
        for (int i = 0; i < 4; ++i)
          for (Row it(subdivision_->stencils, subdivision_->quads(part, i)); it; ++it)
            patch.push_back(static_cast<Index>(it.col()));
      std::sort(patch.begin(), patch.end());
      patch.erase(std::unique(patch.begin(), patch.end()), patch.end());
    }
  }

  [[nodiscard]] bool is_flat() const { return !subdivision_; }
  [[nodiscard]] Index quad_count() const { return static_cast<Index>(quads_.rows()); }
  [[nodiscard]] DrawnQuads& drawn() { return drawn_; }
  [[nodiscard]] const DrawnQuads& drawn() const { return drawn_; }
  /// Of a drawn quad the one of the cage.
  [[nodiscard]] Index cage_of(Index drawn) const { return subdivision_ ? subdivision_->parent[at(drawn)] : drawn; }
  [[nodiscard]] std::span<const Index> drawn_of(Index quad) const { return by_cage_[at(quad)]; }
  /// Of a vertex of the cage the drawn one.
  [[nodiscard]] Index drawn_vertex(Index v) const { return subdivision_ ? subdivision_->vertex[at(v)] : v; }
  /// The vertices that a quad of the cage, as it is drawn, is a sum of: its corners, or more.
  [[nodiscard]] std::span<const Index> patch(Index quad) const {
    if (subdivision_) return patch_[at(quad)];
    return {quads_.data() + 4 * quad, 4};
  }
  [[nodiscard]] std::size_t largest_patch() const {
    std::size_t most = 4;
    for (const std::vector<Index>& patch : patch_) most = std::max(most, patch.size());
    return most;
  }
  /// Adds to the shares of a quad's patch those of corner i of a drawn quad of it, times a weight.
  void add_corner(Index drawn, int corner, double weight, std::span<double> shares) const {
    if (!subdivision_) {
      shares[at(corner)] += weight;
      return;
    }
    const std::vector<Index>& patch = patch_[at(cage_of(drawn))];
    auto place = patch.begin();
    for (Row it(subdivision_->stencils, subdivision_->quads(drawn, corner)); it; ++it) {
      place = std::lower_bound(place, patch.end(), static_cast<Index>(it.col()));
      shares[static_cast<std::size_t>(place - patch.begin())] += weight * it.value();
    }
  }
  void set_positions(const Points<double>& cage) {
    if (subdivision_)
      drawn_.set_positions(subdivision_->stencils * cage);
    else
      drawn_.set_positions(cage);
  }

 private:
  using Row = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>::InnerIterator;

  Quads quads_;
  std::optional<Subdivision> subdivision_;
  DrawnQuads drawn_;
  std::vector<std::vector<Index>> by_cage_, patch_;
};

}  // namespace quadrig::detail
