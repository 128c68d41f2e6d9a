// What remains unknown of a seamless map once every transition, cone and alignment is built in exactly.
#pragma once

#include <queue>
#include <span>

#include "quadrig/seamless/cut_graph.hpp"
#include "quadrig/sparse.hpp"

namespace quadrig {

/// Which parameter is constant along a half-edge of the border or of a crease, in the chart of its own face.
enum class Aligned : std::int8_t { none, v_constant, u_constant };

/// What a map owes a closed way over its faces: that the translation once round has no such component, in the chart
/// where it begins.
struct LoopDemand {
  LinearExpression<Gaussian> translation;  ///< over the branches of the cut
  int component = 1;                       ///< 0: U, 1: V
};

/// The ring of exact coefficients and the field of the solve: Z[i] and complex numbers where only whole points are
/// constrained; Z and reals, two a point, once alignment pins one coordinate alone.
template <class K>
using RingOf = std::conditional_t<std::is_same_v<K, Complex>, Gaussian, std::int64_t>;

/// Corner parameters as exact linear combinations of independent unknowns: z = A x. Any x gives a map whose
/// transitions are quarter turns and whose aligned edges are straight; where the unknowns marked `integer` are
/// integers it is an integer-grid map.
template <class K>
class MapUnknowns {
 public:
  using R = RingOf<K>;
  using Kind = typename Elimination<R>::Kind;
  static constexpr int components = std::is_same_v<K, Complex> ? 1 : 2;

  /// \param loops whose translation is to have no component across them; one that contradicts the rest does nothing
  /// \pre for K = Complex nothing is aligned, and there are no loops
  /// \fails stage_failed where the constraints contradict each other; cancelled, where there is a context to ask.
  [[nodiscard]] static Expected<MapUnknowns> create(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                    const std::vector<Index>& index,
                                                    const std::vector<Aligned>& aligned,
                                                    const Context* context = nullptr,
                                                    std::span<const LoopDemand> loops = {}) {
    using detail::at;
    const Index n = mesh.vertex_count();
    const Index points = n + cut.branch_count;
    std::vector<Kind> kinds(at(components * points + 1), Kind::integer);
    for (Index v = 0; v < n; ++v)
      if (index[at(v)] == 0)
        for (int c = 0; c < components; ++c) kinds[at(components * v + c)] = Kind::free;
    kinds.back() = Kind::constant;
    if constexpr (components == 2)
      for (Index h = 0; h < mesh.halfedge_count(); ++h)
        if (aligned[at(h)] != Aligned::none)
          for (const Index corner : {h, mesh.next(h)}) {
            const int component =
                (aligned[at(h)] == Aligned::v_constant ? 1 : 0) ^ (cut.corner_rotation[at(corner)] & 1);
            kinds[at(2 * mesh.origin(corner) + component)] = Kind::integer;
          }

    MapUnknowns result(Elimination<R>(std::move(kinds)));
    result.vertex_count_ = n;
    result.constant_ = components * points;
    const Error contradiction{ErrorCode::stage_failed, "the constraints of the seamless map contradict each other",
                              "seamless map", "relax the feature edges"};

    // The gauge: translations of each component as a whole.
    const Components components_of = face_components(mesh);
    std::vector<Index> origin(at(components_of.count), no_index);
    const auto component = [&](Index v) { return at(components_of.of_face[at(mesh.outgoing(v) / 3)]); };
    const auto offer = [&](Index v) {
      if (mesh.outgoing(v) != no_index && origin[component(v)] == no_index) origin[component(v)] = v;
    };
    for (Index v = 0; v < n; ++v)
      if (index[at(v)] != 0) offer(v);
    if constexpr (components == 2)
      for (Index h = 0; h < mesh.halfedge_count(); ++h)
        if (aligned[at(h)] != Aligned::none) offer(mesh.origin(h));
    for (Index v = 0; v < n; ++v) offer(v);
    for (const Index v : origin)
      for (int c = 0; c < components; ++c)
        if (!result.elimination_.add(result.project({{v, {1, 0}}}, c))) return contradiction;

    // Once around each node, leaves of the cut first so that expressions stay short.
    std::vector<Index> open(cut.closings.size());
    std::vector<std::vector<std::size_t>> nodes_of_branch(at(cut.branch_count));
    using Entry = std::pair<Index, std::size_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (std::size_t k = 0; k < cut.closings.size(); ++k) {
      open[k] = static_cast<Index>(cut.closings[k].translation.size());
      for (const auto& term : cut.closings[k].translation) nodes_of_branch[at(term.variable)].push_back(k);
      queue.push({open[k], k});
    }
    std::vector<char> done(cut.closings.size(), 0);
    while (!queue.empty()) {
      const auto [count, k] = queue.top();
      queue.pop();
      if (done[k] || count != open[k]) continue;
      done[k] = 1;
      const auto& closing = cut.closings[k];
      LinearExpression<Gaussian> row;
      const Gaussian factor = rotated(Gaussian{1, 0}, closing.turn) - Gaussian{1, 0};
      if (!ring_zero(factor)) row.push_back({closing.vertex, factor});
      for (const auto& term : closing.translation) row.push_back({n + term.variable, term.coefficient});
      for (int c = 0; c < components; ++c)
        if (!result.elimination_.add(result.project(row, c))) return contradiction;
      for (const auto& term : closing.translation)
        for (const std::size_t other : nodes_of_branch[at(term.variable)])
          if (!done[other]) queue.push({--open[other], other});
    }

    if constexpr (components == 2)
      for (Index h = 0; h < mesh.halfedge_count(); ++h)
        if (aligned[at(h)] != Aligned::none)
          if (!result.elimination_.add(
                  result.project(result.edge_expression(mesh, cut, h), aligned[at(h)] == Aligned::v_constant ? 1 : 0)))
            return contradiction;

    if constexpr (components == 2)
      for (const LoopDemand& loop : loops) {
        LinearExpression<Gaussian> row = loop.translation;
        for (auto& term : row) term.variable += n;
        (void)result.elimination_.add(result.project(row, loop.component));  // else the map is as it would be without
      }

    if (!result.index_corners(mesh, cut, context)) return cancelled_error("seamless map");
    return result;
  }

  [[nodiscard]] Index count() const { return static_cast<Index>(integer_.size()); }
  /// Per unknown: 1 where an integer-grid map needs an integer.
  [[nodiscard]] const std::vector<char>& integer() const { return integer_; }

  struct RowView {
    std::span<const Index> at;
    std::span<const K> coefficient;
  };
  /// Component 0 (z, or U) and 1 (V) of corner h.
  [[nodiscard]] RowView corner(Index h, int component) const { return row(corners_, components * h + component); }
  /// z(next corner) − z(corner), in the chart of the face.
  [[nodiscard]] RowView edge(Index h, int component) const { return row(edges_, components * h + component); }

  /// Corner parameters from the unknowns.
  [[nodiscard]] std::vector<Complex> corners(std::span<const K> x) const {
    std::vector<Complex> z((corners_.starts.size() - 1) / components);
    for (std::size_t h = 0; h < z.size(); ++h) {
      if constexpr (components == 1)
        z[h] = evaluate(corner(static_cast<Index>(h), 0), x);
      else
        z[h] = {evaluate(corner(static_cast<Index>(h), 0), x), evaluate(corner(static_cast<Index>(h), 1), x)};
    }
    return z;
  }

  /// Exact combination of vertex and branch variables as a row over the ring; branch b is variable n + b.
  [[nodiscard]] LinearExpression<R> project(const LinearExpression<Gaussian>& z, [[maybe_unused]] int component) const {
    if constexpr (components == 1) {
      return z;
    } else {
      LinearExpression<R> out;
      for (const auto& [v, c] : z) {
        const std::int64_t u = component == 0 ? c.re : c.im, w = component == 0 ? -c.im : c.re;
        if (u != 0) out.push_back({2 * v, u});
        if (w != 0) out.push_back({2 * v + 1, w});
      }
      return out;
    }
  }
  [[nodiscard]] LinearExpression<Gaussian> corner_expression(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                             Index h) const {
    LinearExpression<Gaussian> e{{mesh.origin(h), rotated(Gaussian{1, 0}, cut.corner_rotation[detail::at(h)])}};
    for (const auto& term : cut.corner_translation[detail::at(h)])
      e.push_back({vertex_count_ + term.variable, term.coefficient});
    return e;
  }
  [[nodiscard]] LinearExpression<Gaussian> edge_expression(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                           Index h) const {
    LinearExpression<Gaussian> e = corner_expression(mesh, cut, mesh.next(h));
    accumulate(e, corner_expression(mesh, cut, h), Gaussian{-1, 0});
    return e;
  }
  /// The elimination as it stands, to add relations to; `constant()` is the variable that stands for 1 (or 1 + 0i).
  [[nodiscard]] const Elimination<R>& elimination() const { return elimination_; }
  [[nodiscard]] Index constant() const { return constant_; }
  /// The unknown that a variable of the elimination became, or no_index where it was eliminated or is not needed.
  [[nodiscard]] Index unknown_of(Index variable) const { return unknown_of_[detail::at(variable)]; }
  [[nodiscard]] Index vertex_count() const { return vertex_count_; }

 private:
  explicit MapUnknowns(Elimination<R> elimination) : elimination_(std::move(elimination)) {}

  struct Rows {
    std::vector<std::size_t> starts{0};
    std::vector<Index> at;
    std::vector<K> coefficients;
    void push(const LinearExpression<R>& e, const std::vector<Index>& unknown_of) {
      for (const auto& [v, c] : e) {
        at.push_back(unknown_of[detail::at(v)]);
        coefficients.push_back(to_field(c));
      }
      starts.push_back(at.size());
    }
  };
  [[nodiscard]] static RowView row(const Rows& rows, Index k) {
    const std::size_t first = rows.starts[detail::at(k)], count = rows.starts[detail::at(k) + 1] - first;
    return {std::span(rows.at).subspan(first, count), std::span(rows.coefficients).subspan(first, count)};
  }
  [[nodiscard]] static K evaluate(RowView row, std::span<const K> x) {
    K sum{};
    for (std::size_t k = 0; k < row.at.size(); ++k) sum += row.coefficient[k] * x[detail::at(row.at[k])];
    return sum;
  }

  /// False once cancelled.
  [[nodiscard]] bool index_corners(const TriangleMesh<double>& mesh, const CutGraph& cut, const Context* context) {
    const auto cancelled = [&](Index h) { return h % 8192 == 0 && context && context->cancelled(); };
    const Index half_edges = mesh.halfedge_count();
    std::vector<LinearExpression<R>> corners(detail::at(components * half_edges));
    std::vector<char> used(detail::at(elimination_.variable_count()), 0);
    for (Index h = 0; h < half_edges; ++h) {
      if (cancelled(h)) return false;
      const auto expression = corner_expression(mesh, cut, h);
      for (int c = 0; c < components; ++c) {
        auto& e = corners[detail::at(components * h + c)];
        e = elimination_.resolved(project(expression, c));
        for (const auto& term : e) used[detail::at(term.variable)] = 1;
      }
    }
    unknown_of_.assign(detail::at(elimination_.variable_count()), no_index);
    for (Index v = 0; v < elimination_.variable_count(); ++v)
      if (used[detail::at(v)]) {
        unknown_of_[detail::at(v)] = static_cast<Index>(integer_.size());
        integer_.push_back(elimination_.kind(v) == Kind::integer);
      }
    for (std::size_t k = 0; k < corners.size(); ++k) {
      if (cancelled(static_cast<Index>(k % 8192))) return false;
      corners_.push(corners[k], unknown_of_);
    }
    const R minus_one = R{} - one_of(R{});
    for (Index h = 0; h < half_edges; ++h) {
      if (cancelled(h)) return false;
      for (int c = 0; c < components; ++c) {
        LinearExpression<R> difference = corners[detail::at(components * mesh.next(h) + c)];
        accumulate(difference, corners[detail::at(components * h + c)], minus_one);
        edges_.push(difference, unknown_of_);
      }
    }
    return true;
  }

  Elimination<R> elimination_;
  Index vertex_count_ = 0, constant_ = 0;
  std::vector<Index> unknown_of_;
  std::vector<char> integer_;
  Rows corners_, edges_;
};

}  // namespace quadrig
