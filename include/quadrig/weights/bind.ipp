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

/// Distances of every vertex from every bone through the body; infinite where another bone is far nearer.
inline Expected<Eigen::MatrixXd> body_distances(const TriangleMesh<double>& mesh, const Skeleton& skeleton,
                                                const VoxelBody& body, Index& bones_outside, Context& context) {
  constexpr double through_air = 8;  // a step outside the body counts this often
  constexpr double reach = 4;        // a bone this much farther than the nearest has no say
  const double infinity = std::numeric_limits<double>::infinity();
  const std::size_t cells = body.cell_count();
  const auto bones = static_cast<std::size_t>(skeleton.bone_count());

  std::vector<std::vector<std::pair<std::size_t, double>>> seeds(bones);
  for (std::size_t b = 0; b < bones; ++b) {
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

  Eigen::MatrixXd distances(mesh.vertex_count(), skeleton.bone_count());
  context.parallel_for(bones, 1, [&](std::size_t begin, std::size_t end) {
    std::vector<float> distance(cells);
    for (std::size_t b = begin; b < end && !context.cancelled(); ++b) {
      std::fill(distance.begin(), distance.end(), std::numeric_limits<float>::infinity());
      spread(seeds[b], distance, [&](std::size_t cell, double d) {
        return d <= reach * static_cast<double>(nearest[cell]) + 4 * body.side();
      });
      for (Index v = 0; v < mesh.vertex_count(); ++v) {
        // From the centres around the vertex: smoother than the steps between cells.
        const Vector3 p = mesh.position(v);
        double least = infinity;
        const std::size_t cell = body.cell_of(p);
        const auto look = [&](std::size_t near) {
          if (body.is_body(near))
            least = std::min(least, static_cast<double>(distance[near]) + (body.centre(near) - p).norm());
        };
        look(cell);
        body.for_each_neighbour(cell, [&](std::size_t near, double) { look(near); });
        distances(v, static_cast<Index>(b)) = least;
      }
    }
  });
  if (context.cancelled()) return cancelled_error("bind");
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
      weights(v, b) = std::pow(lambda, -power);
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

/// The weights of one bone that bend least, Σ (Lw)² / M, within [0, 1]: 1 where the bone holds, 0 where another does.
/// Bounds are met by an active set: what leaves them is held, what pulls back in is let go.
inline Status biharmonic_weights(const TriangleMesh<double>& mesh, std::span<const Index> holder, Index bone,
                                 const BindOptions& options, std::span<const double> cotangent,
                                 std::span<const double> area, std::span<double> weights, Context& context) {
  constexpr int rounds = 30;
  const Index n = mesh.vertex_count();
  std::vector<Index> unknowns;
  std::vector<double> coefficients;
  const auto laplacian = [&](Index v, auto&& use) {  // use(): the row of v in `unknowns` and `coefficients`
    unknowns.assign(1, v);
    coefficients.assign(1, 0.0);
    const auto add = [&](Index other, double c) {
      coefficients[0] += c;
      const auto found = std::find(unknowns.begin() + 1, unknowns.end(), other);
      if (found == unknowns.end()) {
        unknowns.push_back(other);
        coefficients.push_back(-c);
      } else {
        coefficients[static_cast<std::size_t>(found - unknowns.begin())] -= c;
      }
    };
    for (const Index h : mesh.around(v)) {
      add(mesh.target(h), cotangent[at(h)]);
      const Index in = mesh.prev(h);
      add(mesh.origin(in), cotangent[at(in)]);
    }
    use();
  };
  RowTerm term{"bending", [&](EmitRow<double> emit) {
                 for (Index v = 0; v < n; ++v)
                   laplacian(v, [&] { emit({unknowns, coefficients, 0.0, 1 / area[at(v)]}); });
               }};

  QuadraticForm<double> form(n);
  std::vector<signed char> held(at(n), 0);  // at a bound, which can be let go: -1 below, 1 above
  for (Index v = 0; v < n; ++v)
    if (holder[at(v)] != no_index) form.fix(v, holder[at(v)] == bone ? 1.0 : 0.0);
  Expected<AnySolver<double>> solver = make_solver<double>(options.solver);
  if (!solver) return solver.error();
  std::vector<double> gradient(at(n)), w(weights.begin(), weights.end());
  for (int round = 0; round < rounds; ++round) {
    if (context.cancelled()) return cancelled_error("bind");
    if (form.free_count() == 0) break;
    if (Status status = form.assemble(context, term); !status) return status;
    if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context); !status) return status;
    std::vector<double> x(at(form.free_count()));
    if (const SolveInfo info = solver->solve(form.rhs(), x, context); !info.status) return info.status;
    w = form.expand(x);
    // Pull of the energy at the held: Lᵀ M⁻¹ L w.
    std::fill(gradient.begin(), gradient.end(), 0.0);
    const auto pull_at = [&](const Row<double>& row) {
      double sum = 0;
      for (std::size_t k = 0; k < row.at.size(); ++k) sum += row.coeff[k] * w[at(row.at[k])];
      for (std::size_t k = 0; k < row.at.size(); ++k) gradient[at(row.at[k])] += row.weight * row.coeff[k] * sum;
    };
    term.for_each_row(EmitRow<double>(pull_at));
    double largest = 0;
    for (const double g : gradient) largest = std::max(largest, std::abs(g));
    Index changed = 0;
    for (Index v = 0; v < n; ++v) {
      if (holder[at(v)] != no_index) continue;
      if (held[at(v)] != 0) {
        const double pull = -gradient[at(v)] * held[at(v)];  // towards the inside where negative
        if (pull < -1e-9 * largest && round < rounds / 2) {
          form.release(v);
          held[at(v)] = 0;
          ++changed;
        }
      } else if (w[at(v)] < -1e-6 || w[at(v)] > 1 + 1e-6) {
        held[at(v)] = w[at(v)] < 0 ? -1 : 1;
        form.fix(v, w[at(v)] < 0 ? 0.0 : 1.0);
        ++changed;
      }
    }
    if (changed == 0) break;
  }
  for (std::size_t v = 0; v < w.size(); ++v) weights[v] = std::clamp(w[v], 0.0, 1.0);
  return {};
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
    const detail::VoxelBody body(mesh, skeleton, options.resolution);
    const Expected<Eigen::MatrixXd> distances =
        detail::body_distances(mesh, skeleton, body, result.bones_outside, context);
    if (!distances) return distances.error();
    const double length = mesh.diagonal();
    dense = detail::falloff(*distances, length, body.side(), options.stiffness);
    if (options.method == BindMethod::geodesic_voxel) {
      if (options.smoothing > 0)
        if (Status status =
                detail::smooth_weights(mesh, options.smoothing * body.side(), options.solver, dense, context);
            !status)
          return status.error();
    } else {
      // A bone holds the vertices that are at most half as far from it as from any other.
      std::vector<Index> holder(static_cast<std::size_t>(n), no_index);
      for (Index v = 0; v < n; ++v) {
        Index first = no_index;
        double least = std::numeric_limits<double>::infinity(), second = least;
        for (Index b = 0; b < bones; ++b) {
          const double d = (*distances)(v, b);
          if (d < least) {
            second = least;
            least = d, first = b;
          } else {
            second = std::min(second, d);
          }
        }
        if (first == no_index) first = nearest(v), second = std::numeric_limits<double>::infinity();
        if (second >= 2 * least || mesh.outgoing(v) == no_index) holder[static_cast<std::size_t>(v)] = first;
      }
      for (Index b = 0; b < bones; ++b) {  // one that is nowhere decided holds the vertex nearest to it
        if (std::find(holder.begin(), holder.end(), b) != holder.end()) continue;
        Index best = no_index;
        for (Index v = 0; v < n; ++v)
          if (dense(v, b) > 0 && (best == no_index || dense(v, b) > dense(best, b))) best = v;
        if (best != no_index && dense(best, b) > 0.3) holder[static_cast<std::size_t>(best)] = b;
      }
      const std::vector<double> cotangent = detail::half_cotangents(mesh);
      std::vector<double> area = detail::vertex_areas(mesh);
      const double mean = mesh.total_area() / n;
      for (double& a : area) a = std::max(a, 1e-3 * mean);
      std::vector<Status> status(static_cast<std::size_t>(bones));
      context.parallel_for(static_cast<std::size_t>(bones), 1, [&](std::size_t begin, std::size_t end) {
        Context quiet = context.quiet(1);
        for (std::size_t b = begin; b < end; ++b) {
          Eigen::VectorXd column = dense.col(static_cast<Index>(b));
          status[b] = detail::biharmonic_weights(mesh, holder, static_cast<Index>(b), options, cotangent, area,
                                                 {column.data(), static_cast<std::size_t>(n)}, quiet);
          dense.col(static_cast<Index>(b)) = column;
        }
      });
      for (const Status& each : status)
        if (!each) return each.error();
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
