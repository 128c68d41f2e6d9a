// Definitions of weights.hpp.
#pragma once

#include <numeric>

#include "quadrig/weights.hpp"
#include "quadrig/weights/voxel_body.hpp"

namespace quadrig {
namespace detail {

/// Distance of p from a bone's segment.
inline double bone_distance(const Bone& bone, const Vector3& p) {
  const Vector3 axis = bone.tail - bone.head;
  const double square = axis.squaredNorm();
  const double t = square > 0 ? std::clamp((p - bone.head).dot(axis) / square, 0.0, 1.0) : 0.0;
  return (p - bone.head - t * axis).norm();
}

inline Index nearest_bone(const Skeleton& skeleton, const Vector3& p) {
  Index nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (Index b = 0; b < skeleton.bone_count(); ++b)
    if (const double d = bone_distance(skeleton.bones[static_cast<std::size_t>(b)], p); d < least)
      least = d, nearest = b;
  return nearest;
}

/// Rows of dense weights cut to the strongest and rescaled to sum 1. A row without any takes `fallback` of its vertex.
inline SkinWeights strongest(const Eigen::MatrixXd& dense, Index influences, function_ref<Index(Index)> fallback) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  std::vector<BoneShare> row;
  for (Index v = 0; v < dense.rows(); ++v) {
    row.clear();
    for (Index b = 0; b < dense.cols(); ++b)
      if (dense(v, b) > 1e-4) row.push_back({b, dense(v, b)});
    if (row.empty()) row.push_back({fallback(v), 1.0});
    keep_strongest(row, influences);
    for (const BoneShare& share : row) entries.emplace_back(v, share.bone, share.weight);
  }
  SkinWeights weights(dense.rows(), dense.cols());
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

inline std::vector<double> half_cotangents(const TriangleMesh<double>& mesh) {
  std::vector<double> cotangent(at(mesh.halfedge_count()));
  for (Index h = 0; h < mesh.halfedge_count(); ++h) cotangent[at(h)] = half_cotangent(mesh, h);
  return cotangent;
}

inline std::vector<double> vertex_areas(const TriangleMesh<double>& mesh) {
  std::vector<double> area(static_cast<std::size_t>(mesh.vertex_count()), 0.0);
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i) area[static_cast<std::size_t>(mesh.faces()(f, i))] += mesh.area(f) / 3;
  return area;
}

/// The cells where each bone begins, with their distance from it.
inline std::vector<std::vector<std::pair<std::size_t, double>>> bone_seeds(const Skeleton& skeleton,
                                                                           const VoxelBody& body,
                                                                           Index& bones_outside) {
  std::vector<std::vector<std::pair<std::size_t, double>>> seeds(at(skeleton.bone_count()));
  for (std::size_t b = 0; b < seeds.size(); ++b) {
    const Bone& bone = skeleton.bones[b];
    const Vector3 way = bone.tail - bone.head;
    // Of one that lies wholly outside the cells nearest to its ends.
    const auto inside = body.part_inside(bone.head, bone.tail);
    const auto [first, last] = inside.value_or(std::pair{0.0, 1.0});
    const Index steps = inside ? static_cast<Index>(std::ceil(2 * (last - first) * way.norm() / body.side())) : 1;
    bool within = false;
    for (Index s = 0; s <= steps; ++s) {
      const Vector3 p = bone.head + (first + (steps > 0 ? s / static_cast<double>(steps) : 0.0) * (last - first)) * way;
      const std::size_t cell = body.cell_of(p);
      within = within || (inside && body.is_body(cell));
      if (seeds[b].empty() || seeds[b].back().first != cell)
        seeds[b].emplace_back(cell, bone_distance(bone, body.centre(cell)));
    }
    bones_outside += within ? 0 : 1;
  }
  return seeds;
}

/// Distances of all cells from every bone through the body, handed to `use(bone, distances)`, from several threads;
/// infinite where another bone is far nearer. \fails cancelled
template <class Use>
inline Status spread_distances(const Skeleton& skeleton, const VoxelBody& body, Index& bones_outside, Context& context,
                               Use&& use) {
  constexpr double through_air = 8;  // a step outside the body counts this often
  constexpr double reach = 4;        // a bone this much farther than the nearest has no say
  const std::size_t cells = body.cell_count();
  const std::vector<std::vector<std::pair<std::size_t, double>>> seeds = bone_seeds(skeleton, body, bones_outside);

  using Entry = std::pair<double, std::size_t>;
  const auto spread = [&](std::span<const std::pair<std::size_t, double>> from, std::vector<float>& distance,
                          auto&& admit) {
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    const auto offer = [&](std::size_t cell, double d) {
      if (!(static_cast<float>(d) < distance[cell]) || !admit(cell, d)) return;
      distance[cell] = static_cast<float>(d);
      queue.emplace(d, cell);
    };
    for (const auto& [cell, d] : from) offer(cell, d);
    for (std::size_t count = 0; !queue.empty(); ++count) {
      if (count % 4096 == 0 && context.cancelled()) return;
      const double d = queue.top().first;  // named apart: clang before 16 does not capture structured bindings
      const std::size_t cell = queue.top().second;
      queue.pop();
      if (static_cast<float>(d) > distance[cell]) continue;
      body.for_each_neighbour(cell, [&](std::size_t next, double step) {
        const bool through = body.is_body(cell) && body.is_body(next);
        offer(next, d + step * body.side() * (through ? 1.0 : through_air));
      });
    }
  };

  std::vector<float> nearest(cells, std::numeric_limits<float>::infinity());
  std::vector<std::pair<std::size_t, double>> all;
  for (const auto& of_bone : seeds) all.insert(all.end(), of_bone.begin(), of_bone.end());
  spread(all, nearest, [](std::size_t, double) { return true; });
  if (context.cancelled()) return cancelled_error("bind");
  context.parallel_for(seeds.size(), 1, [&](std::size_t begin, std::size_t end) {
    std::vector<float> distance(cells);
    for (std::size_t b = begin; b < end && !context.cancelled(); ++b) {
      std::fill(distance.begin(), distance.end(), std::numeric_limits<float>::infinity());
      spread(seeds[b], distance, [&](std::size_t cell, double d) {
        return d <= reach * static_cast<double>(nearest[cell]) + 4 * body.side();
      });
      use(b, std::span<const float>(distance));
    }
  });
  if (context.cancelled()) return cancelled_error("bind");
  return {};
}

/// Distances of every vertex from every bone through the body; infinite where another bone is far nearer.
inline Expected<Eigen::MatrixXd> body_distances(const TriangleMesh<double>& mesh, const Skeleton& skeleton,
                                                const VoxelBody& body, Index& bones_outside, Context& context) {
  Eigen::MatrixXd distances(mesh.vertex_count(), skeleton.bone_count());
  Status status =
      spread_distances(skeleton, body, bones_outside, context, [&](std::size_t b, std::span<const float> distance) {
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
          // From the centres around the vertex: smoother than the steps between cells.
          const Vector3 p = mesh.position(v);
          double least = std::numeric_limits<double>::infinity();
          const std::size_t cell = body.cell_of(p);
          const auto look = [&](std::size_t near) {
            if (body.is_body(near))
              least = std::min(least, static_cast<double>(distance[near]) + (body.centre(near) - p).norm());
          };
          look(cell);
          body.for_each_neighbour(cell, [&](std::size_t near, double) { look(near); });
          distances(v, static_cast<Index>(b)) = least;
        }
      });
  if (!status) return status.error();
  return distances;
}

/// Dionne and de Lasa's falloff, ((1 − α) λ + α λ²)^−2 of the distance in lengths of the body, sharper by `stiffness`.
inline Eigen::MatrixXd falloff(const Eigen::MatrixXd& distances, double length, double side, double stiffness) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(distances.rows(), distances.cols());
  const double power = 2 + 4 * stiffness;
  for (Index v = 0; v < distances.rows(); ++v) {
    double sum = 0;
    for (Index b = 0; b < distances.cols(); ++b) {
      if (!std::isfinite(distances(v, b))) continue;
      const double lambda = std::max(distances(v, b), 0.5 * side) / length;
      weights(v, b) = elementary::pow(lambda, -power);
      sum += weights(v, b);
    }
    if (sum > 0) weights.row(v) /= sum;
  }
  return weights;
}

/// One implicit step of heat along the surface: (M + t L) w = M w.
inline Status smooth_weights(const TriangleMesh<double>& mesh, double length, const std::string& solver_name,
                             Eigen::MatrixXd& weights, Context& context) {
  const std::vector<double> cotangent = half_cotangents(mesh), area = vertex_areas(mesh);
  const double time = length * length;
  double total = 0;
  for (const double a : area) total += a;
  const double least = 1e-9 * total / static_cast<double>(std::max<std::size_t>(area.size(), 1));
  RowTerm term{"heat", [&](EmitRow<double> emit) {
                 const double one = 1;
                 const std::array<double, 2> difference{1, -1};
                 for (Index v = 0; v < mesh.vertex_count(); ++v) {
                   const double mass = std::max(area[static_cast<std::size_t>(v)], least);
                   emit({std::span(&v, 1), std::span(&one, 1), 0.0, mass});
                 }
                 for (Index h = 0; h < mesh.halfedge_count(); ++h) {
                   const std::array<Index, 2> ends{mesh.origin(h), mesh.target(h)};
                   emit({ends, difference, 0.0, time * cotangent[static_cast<std::size_t>(h)]});
                 }
               }};
  QuadraticForm<double> form(mesh.vertex_count());
  if (Status status = form.assemble(context, term); !status) return status;
  Expected<AnySolver<double>> solver = make_solver<double>(solver_name);
  if (!solver) return solver.error();
  if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status) return status;
  // A few bones at a time, which bounds the memory to a few columns.
  constexpr Index at_once = 8;
  const auto n = static_cast<std::size_t>(mesh.vertex_count());
  std::vector<double> rhs, x;
  for (Index b = 0; b < weights.cols(); b += at_once) {
    if (context.cancelled()) return cancelled_error("bind");
    const Index count = std::min(at_once, static_cast<Index>(weights.cols()) - b);
    rhs.resize(static_cast<std::size_t>(count) * n);
    x.resize(rhs.size());
    for (std::size_t k = 0; k < rhs.size(); ++k)
      rhs[k] = std::max(area[k % n], least) * weights(static_cast<Index>(k % n), b + static_cast<Index>(k / n));
    if (const SolveInfo info = solver->solve_all(rhs, x, count, context); !info.status) return info.status;
    for (std::size_t k = 0; k < x.size(); ++k)
      weights(static_cast<Index>(k % n), b + static_cast<Index>(k / n)) = std::clamp(x[k], 0.0, 1.0);
  }
  return {};
}

/// The body at a resolution, or at a lower one where it would have more cells than these.
inline VoxelBody body_of(const TriangleMesh<double>& mesh, const Skeleton& skeleton, Index resolution, double most) {
  constexpr Index least = 8;
  for (;;) {
    VoxelBody body(mesh, skeleton, resolution);
    const double finer = elementary::cbrt(most / static_cast<double>(std::max<std::size_t>(body.body_count(), 1)));
    if (resolution == least || finer > 0.95) return body;
    resolution = std::max(least, static_cast<Index>(std::min(0.98 * finer, 0.9) * resolution));
  }
}

/// The cells of a body, numbered, with their up to six neighbours.
struct BodyGraph {
  std::vector<std::size_t> cells;
  std::vector<Index> number;  ///< of each cell of the grid; no_index: air
  std::vector<Index> first, neighbours;

  explicit BodyGraph(const VoxelBody& body) : number(body.cell_count(), no_index) {
    for (std::size_t cell = 0; cell < body.cell_count(); ++cell)
      if (body.is_body(cell)) {
        number[cell] = static_cast<Index>(cells.size());
        cells.push_back(cell);
      }
    for (const std::size_t cell : cells) {
      first.push_back(static_cast<Index>(neighbours.size()));
      body.for_each_neighbour(cell, [&](std::size_t next, double step) {
        if (step == 1 && body.is_body(next)) neighbours.push_back(number[next]);
      });
    }
    first.push_back(static_cast<Index>(neighbours.size()));
  }
  [[nodiscard]] Index size() const { return static_cast<Index>(cells.size()); }
  [[nodiscard]] std::span<const Index> around(Index v) const {
    return std::span(neighbours).subspan(at(first[at(v)]), at(first[at(v) + 1] - first[at(v)]));
  }
};

/// The bone that holds a cell, or the two that share it.
struct CellHolder {
  Index bone = no_index, other = no_index;
  [[nodiscard]] double weight(Index of) const {
    return of == bone || of == other ? (other == no_index ? 1.0 : 0.5) : 0.0;
  }
};

/// Of each bone, whether it holds a cell.
inline std::vector<char> holding_bones(std::span<const CellHolder> holder, Index bones) {
  std::vector<char> holds(at(bones), 0);
  for (const CellHolder& own : holder)
    for (const Index b : {own.bone, own.other})
      if (b != no_index) holds[at(b)] = 1;
  return holds;
}

/// Which bone holds each cell of a body: the one whose segment passes through it, of several the one whose middle is
/// nearest, and both where two are as near, as at the joint of two bones of one length. A bone that passes through no
/// cell, or only through those of others, holds the free cell nearest to it.
inline std::vector<CellHolder> cell_holders(const BodyGraph& graph, const VoxelBody& body, const Skeleton& skeleton) {
  const double near = 0.5 * body.side();
  std::vector<CellHolder> holder(graph.cells.size());
  std::vector<double> off(holder.size(), std::numeric_limits<double>::infinity());
  for (Index b = 0; b < skeleton.bone_count(); ++b) {
    const Bone& bone = skeleton.bones[at(b)];
    const Vector3 way = bone.tail - bone.head;
    const auto inside = body.part_inside(bone.head, bone.tail);
    if (!inside) continue;
    const auto steps = static_cast<Index>(std::ceil(2 * (inside->second - inside->first) * way.norm() / body.side()));
    for (Index s = 0; s <= steps; ++s) {
      const double t =
          inside->first + (steps > 0 ? s / static_cast<double>(steps) : 0.0) * (inside->second - inside->first);
      const Index v = graph.number[body.cell_of(bone.head + t * way)];
      const double from_middle = std::abs(t - 0.5) * way.norm();
      if (v == no_index || from_middle > off[at(v)] + near) continue;
      CellHolder& own = holder[at(v)];
      if (own.bone == b || own.other == b) continue;
      if (own.bone != no_index && from_middle > off[at(v)] - near) {
        own.other = b;
      } else {
        own = {b, no_index};
      }
      off[at(v)] = std::min(off[at(v)], from_middle);
    }
  }
  const std::vector<char> holds = holding_bones(holder, skeleton.bone_count());
  for (Index b = 0; b < skeleton.bone_count(); ++b) {
    if (holds[at(b)]) continue;
    Index nearest = no_index;
    double least = std::numeric_limits<double>::infinity();
    for (Index v = 0; v < graph.size(); ++v)
      if (const double d = bone_distance(skeleton.bones[at(b)], body.centre(graph.cells[at(v)]));
          holder[at(v)].bone == no_index && d < least)
        least = d, nearest = v;
    if (nearest != no_index) holder[at(nearest)].bone = b;
  }
  return holder;
}

/// The weights of one bone that bend least within the body, Σ (Lw)², in [0, 1]: 1 where the bone holds, 0 where another
/// does and where another is far nearer. Bounds are met by an active set: what leaves them is held, what pulls back in
/// is let go. \param reached of each cell, whether the bone has a say there
inline Status biharmonic_weights(const BodyGraph& graph, std::span<const CellHolder> holder,
                                 std::span<const char> reached, Index bone, const BindOptions& options,
                                 Eigen::Ref<Eigen::VectorXd> weights, Context& context) {
  constexpr int rounds = 20;
  constexpr double slack = 1e-4;
  // The reached cells, and two rings around, which are 0.
  std::vector<Index> cells, local(at(graph.size()), no_index);
  const auto add = [&](Index v) {
    if (local[at(v)] != no_index) return;
    local[at(v)] = static_cast<Index>(cells.size());
    cells.push_back(v);
  };
  for (Index v = 0; v < graph.size(); ++v)
    if (reached[at(v)]) add(v);
  std::size_t ring = cells.size();
  for (std::size_t k = 0; k < ring; ++k)
    for (const Index next : graph.around(cells[k])) add(next);
  const std::size_t rows = cells.size();
  for (std::size_t k = 0; k < rows; ++k)
    for (const Index next : graph.around(cells[k])) add(next);
  const auto n = static_cast<Index>(cells.size());

  std::vector<Index> unknowns;
  std::vector<double> coefficients;
  RowTerm term{"bending", [&](EmitRow<double> emit) {
                 for (std::size_t k = 0; k < rows; ++k) {
                   const auto around = graph.around(cells[k]);
                   unknowns.assign(1, static_cast<Index>(k));
                   coefficients.assign(1, static_cast<double>(around.size()));
                   for (const Index next : around) {
                     unknowns.push_back(local[at(next)]);
                     coefficients.push_back(-1);
                   }
                   emit({unknowns, coefficients, 0.0, 1.0});
                 }
               }};
  QuadraticForm<double> form(n);
  std::vector<signed char> held(at(n), 0);  // at a bound, which can be let go: -1 below, 1 above
  std::vector<char> given(at(n), 0);
  for (Index k = 0; k < n; ++k) {
    const CellHolder& own = holder[at(cells[at(k)])];
    if (own.bone == no_index && reached[at(cells[at(k)])]) continue;
    form.fix(k, own.weight(bone));
    given[at(k)] = 1;
  }
  Expected<AnySolver<double>> solver = make_solver<double>(options.solver);
  if (!solver) return solver.error();
  std::vector<double> gradient(at(n)), w(at(n), 0.0);
  for (Index k = 0; k < n; ++k) w[at(k)] = holder[at(cells[at(k)])].weight(bone);
  for (int round = 0; round < rounds && form.free_count() > 0; ++round) {
    if (context.cancelled()) return cancelled_error("bind");
    if (Status status = form.assemble(context, term); !status) return status;
    if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status) return status;
    std::vector<double> x(at(form.free_count()));
    if (const SolveInfo info = solver->solve(form.rhs(), x, context); !info.status) return info.status;
    w = form.expand(x);
    // Pull of the energy at the held: Lᵀ L w.
    std::fill(gradient.begin(), gradient.end(), 0.0);
    const auto pull_at = [&](const Row<double>& row) {
      double sum = 0;
      for (std::size_t k = 0; k < row.at.size(); ++k) sum += row.coeff[k] * w[at(row.at[k])];
      for (std::size_t k = 0; k < row.at.size(); ++k) gradient[at(row.at[k])] += row.coeff[k] * sum;
    };
    term.for_each_row(EmitRow<double>(pull_at));
    double largest = 0;
    for (const double g : gradient) largest = std::max(largest, std::abs(g));
    Index changed = 0;
    for (Index k = 0; k < n; ++k) {
      if (given[at(k)]) continue;
      if (held[at(k)] != 0) {
        const double pull = -gradient[at(k)] * held[at(k)];  // towards the inside where negative
        if (pull < -1e-9 * largest && round < rounds / 2) {
          form.release(k);
          held[at(k)] = 0;
          ++changed;
        }
      } else if (w[at(k)] < -slack || w[at(k)] > 1 + slack) {
        held[at(k)] = w[at(k)] < 0 ? -1 : 1;
        form.fix(k, w[at(k)] < 0 ? 0.0 : 1.0);
        ++changed;
      }
    }
    constexpr Index few = 1000;  // one in so many cells is left where it is
    if (few * changed <= n) break;
  }
  for (Index k = 0; k < n; ++k) weights[cells[at(k)]] = std::clamp(w[at(k)], 0.0, 1.0);
  return {};
}

/// Bounded biharmonic weights within the body, read at the vertices. \return n×b, rows of sum 1 or 0
inline Expected<Eigen::MatrixXd> biharmonic_body(const TriangleMesh<double>& mesh, const Skeleton& skeleton,
                                                 const BindOptions& options, Index& bones_outside, Context& context) {
  // Cells that a factorization of a fourth-order operator takes at ease; weights are smoother than cells are small.
  // The square of the bones bounds the work of hundreds of them, each with a factorization for every round.
  constexpr double most_cells = 6000, at_resolution = 128, most_work = 1.5e8;
  constexpr Index least_resolution = 48;  // fewer, and limbs are of one cell
  const double scale = std::max(1.0, options.resolution / at_resolution), bones = skeleton.bone_count();
  const VoxelBody body = body_of(mesh, skeleton, std::max(least_resolution, options.resolution / 2),
                                 std::min(most_cells * scale * scale * scale, most_work / (bones * bones)));
  const BodyGraph graph(body);
  const std::vector<CellHolder> holder = cell_holders(graph, body, skeleton);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(mesh.vertex_count(), skeleton.bone_count());
  std::vector<Status> status(at(skeleton.bone_count()));
  const std::vector<char> holds = holding_bones(holder, skeleton.bone_count());
  Status spread =
      spread_distances(skeleton, body, bones_outside, context, [&](std::size_t b, std::span<const float> distance) {
        if (!holds[b]) return;
        Context quiet = context.quiet(1);
        Eigen::VectorXd cells = Eigen::VectorXd::Zero(graph.size());
        std::vector<char> reached(graph.cells.size());
        for (std::size_t v = 0; v < reached.size(); ++v) reached[v] = std::isfinite(distance[graph.cells[v]]);
        status[b] = biharmonic_weights(graph, holder, reached, static_cast<Index>(b), options, cells, quiet);
        if (!status[b]) return;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
          double sum = 0, shares = 0;
          body.for_each_around(mesh.position(v), [&](std::size_t cell, double share) {
            if (graph.number[cell] == no_index) return;
            sum += share * cells[graph.number[cell]];
            shares += share;
          });
          if (shares > 0) dense(v, static_cast<Index>(b)) = sum / shares;
        }
      });
  if (!spread) return spread.error();
  for (const Status& each : status)
    if (!each) return each.error();
  if (options.smoothing > 0)  // or the steps of the cells show
    if (Status smooth = smooth_weights(mesh, options.smoothing * body.side(), options.solver, dense, context); !smooth)
      return smooth.error();
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (const double sum = dense.row(v).sum(); sum > 0) dense.row(v) /= sum;
  return dense;
}

}  // namespace detail

QUADRIG_INLINE Status BindOptions::validate() const {
  const auto bad = [](std::string what, std::string where) {
    return Error{ErrorCode::bad_option, std::move(what), "bind: " + where, {}};
  };
  if (influences < 1) return bad("at least 1 is needed", "influences");
  if (resolution < 8 || resolution > 512) return bad("must be 8 to 512", "resolution");
  if (!(stiffness >= 0 && stiffness <= 1)) return bad("must be 0 to 1", "stiffness");
  if (!(smoothing >= 0 && smoothing <= 100)) return bad("must be 0 to 100", "smoothing");
  if (const auto solver_made = make_solver<double>(solver); !solver_made) return solver_made.error();
  return {};
}

QUADRIG_INLINE std::string BoundWeights::summary(const BindOptions& options) const {
  std::string text = "the rig came without skin weights; made " + std::to_string(weights.nonZeros()) +
                     " by the method " + std::string(bind_method_name(options.method));
  if (bones_outside > 0) text += "; bones wholly outside the body: " + std::to_string(bones_outside);
  if (unmoved_bones > 0) text += "; bones that move nothing: " + std::to_string(unmoved_bones);
  return text;
}

QUADRIG_INLINE Expected<BoundWeights> bind_weights(const TriangleMesh<double>& mesh, const Skeleton& skeleton,
                                                   const BindOptions& options, Context& context) {
  if (Status status = options.validate(); !status) return status.error();
  const auto bad = [](std::string what, std::string where, std::string remedy) {
    return Error{ErrorCode::bad_input, std::move(what), std::move(where), std::move(remedy)};
  };
  const Index n = mesh.vertex_count(), bones = skeleton.bone_count();
  if (mesh.face_count() == 0) return bad("there is no face to bind", "bind", "give a surface");
  if (bones == 0) return bad("there is no bone to bind to", "bind", "give a skeleton with a bone");
  for (Index b = 0; b < bones; ++b) {
    const Bone& bone = skeleton.bones[static_cast<std::size_t>(b)];
    if (!bone.head.allFinite() || !bone.tail.allFinite())
      return bad("its place is not finite", "bone " + std::to_string(b), "give finite joints");
  }
  const auto nearest = [&](Index v) { return detail::nearest_bone(skeleton, mesh.position(v)); };
  context.progress("bind", 0);

  Eigen::MatrixXd dense;
  BoundWeights result;
  if (options.method == BindMethod::nearest_bone) {
    dense.setZero(n, bones);
    for (Index v = 0; v < n; ++v) dense(v, nearest(v)) = 1;
  } else {
    if (!(mesh.diagonal() > 0)) return bad("all vertices are at one place", "bind", "give a surface");
    if (options.method == BindMethod::bounded_biharmonic) {
      Expected<Eigen::MatrixXd> made = detail::biharmonic_body(mesh, skeleton, options, result.bones_outside, context);
      if (!made) return made.error();
      dense = std::move(*made);
    } else {
      constexpr double most_work = 1.5e9;  // cells times the square of bones
      const detail::VoxelBody body =
          detail::body_of(mesh, skeleton, options.resolution, most_work / (1.0 * bones * bones));
      const Expected<Eigen::MatrixXd> distances =
          detail::body_distances(mesh, skeleton, body, result.bones_outside, context);
      if (!distances) return distances.error();
      dense = detail::falloff(*distances, mesh.diagonal(), body.side(), options.stiffness);
      if (options.smoothing > 0)
        if (Status status =
                detail::smooth_weights(mesh, options.smoothing * body.side(), options.solver, dense, context);
            !status)
          return status.error();
    }
  }
  result.weights = detail::strongest(dense, options.influences, nearest);
  std::vector<char> moves(static_cast<std::size_t>(bones), 0);
  for (Index v = 0; v < n; ++v)
    for (SkinWeights::InnerIterator entry(result.weights, v); entry; ++entry)
      moves[static_cast<std::size_t>(entry.col())] = 1;
  result.unmoved_bones = static_cast<Index>(std::count(moves.begin(), moves.end(), char{0}));
  return result;
}

}  // namespace quadrig
