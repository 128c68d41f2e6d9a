// Definitions of seamless/reduce_curl.hpp.
#pragma once

#include "quadrig/quantile.hpp"
#include "quadrig/seamless/reduce_curl.hpp"

namespace quadrig {

QUADRIG_INLINE Status CurlOptions::validate(const TriangleMesh<double>& mesh) const {
  const auto bad = [](std::string field, std::string what, std::string remedy) {
    return Error{ErrorCode::bad_option, std::move(what), "curl." + std::move(field), std::move(remedy)};
  };
  if (rounds < 0 || rounds > 1000) return bad("rounds", "out of range", "give 0 to 1000");
  if (!(direction_weight >= 0)) return bad("direction_weight", "not a weight", "give 0 or more");
  if (!(size_weight >= 0)) return bad("size_weight", "not a weight", "give 0 or more");
  if (!kept.empty() && kept.size() != static_cast<std::size_t>(mesh.halfedge_count()))
    return bad("kept", "not one mark a half-edge", "give three marks a face, or none");
  return {};
}

namespace detail {

/// A field between what was wanted and a map, in rounds.
template <class K>
class CurlReducer {
 public:
  CurlReducer(const TriangleMesh<double>& mesh, const Connection<double>& connection, const MapUnknowns<K>& unknowns,
              const CurlOptions& options, std::vector<QuadEdges> wanted, Context& context)
      : mesh_(mesh),
        unknowns_(unknowns),
        options_(options),
        context_(context),
        wanted_(std::move(wanted)),
        field_(wanted_),
        edges_(at(mesh.halfedge_count())) {
    for (Index h = 0; h < mesh.halfedge_count(); ++h) edges_[at(h)] = connection.to_complex(h / 3, mesh.edge_vector(h));
    retarget();
    cotangent_ = bounded_cotangents(target_);
  }

  [[nodiscard]] Status run() {
    QuadraticForm<K> form(unknowns_.count());
    Expected<AnySolver<K>> solver = options_.solver.factory<K>()();
    if (!solver) return solver.error();
    const RowTerm poisson{"poisson", [&](EmitRow<K> emit) { emit_rows(emit); }};
    std::vector<K> x(at(unknowns_.count()));
    for (Index round = 0; round < options_.rounds && unknowns_.count() > 0; ++round) {
      if (context_.cancelled()) return cancelled_error("curl");
      if (Status status = form.assemble(context_, poisson); !status.ok()) return status;
      if (round == 0)
        if (Status status = solver->prepare(form.matrix(), form.pattern_version(), context_); !status.ok())
          return status;
      if (SolveInfo info = solver->solve(form.rhs(), x, context_); !info.status.ok()) return info.status;
      follow(unknowns_.corners(x));
      retarget();
      backend = solver->description();
    }
    return {};
  }

  [[nodiscard]] const std::vector<QuadEdges>& field() const { return field_; }

  std::string backend;

 private:
  /// The parameter vectors of the edges that the field asks for.
  void retarget() {
    target_.resize(edges_.size());
    for (std::size_t h = 0; h < edges_.size(); ++h) {
      const auto& [a, b] = field_[h / 3];
      const double area = cross(a, b);
      target_[h] = {cross(edges_[h], b) / area, cross(a, edges_[h]) / area};
    }
  }

  void emit_rows(EmitRow<K> emit) const {
    for (Index h = 0; h < mesh_.halfedge_count(); ++h)
      for (int c = 0; c < MapUnknowns<K>::components; ++c) {
        const auto row = unknowns_.edge(h, c);
        K rhs;
        if constexpr (MapUnknowns<K>::components == 1)
          rhs = target_[at(h)];
        else
          rhs = c == 0 ? target_[at(h)].real() : target_[at(h)].imag();
        emit({row.at, row.coefficient, rhs, 0.5 * cotangent_[at(h)]});
      }
  }

  /// The field between the map and what was wanted: turns and logarithms of lengths in the middle that the weights
  /// make. A face that the map turns over stays as it was.
  void follow(const std::vector<Complex>& z) {
    const double turns = 1 / (1 + options_.direction_weight), scales = 1 / (1 + options_.size_weight);
    parallel_each(&context_, field_.size(), [&](std::size_t f) {
      const std::size_t h = 3 * f;
      const auto edges = quad_edges(edges_[h], edges_[h + 1], z[h + 1] - z[h], z[h + 2] - z[h + 1]);
      if (!edges) return;
      const auto moved = [&](Complex from, Complex to) {
        const Complex by = change(from, to);
        return from * elementary::polar(elementary::exp(scales * by.real()), turns * by.imag());
      };
      QuadEdges next{moved(wanted_[f].a, edges->a), moved(wanted_[f].b, edges->b)};
      const double opening = opening_angle(next.a, next.b), least = options_.limits.least_angle_radians;
      if (const double more = std::clamp(opening, least, std::numbers::pi - least) - opening; more != 0) {
        next.a *= elementary::polar(1.0, -more / 2);
        next.b *= elementary::polar(1.0, more / 2);
      }
      field_[f] = next;
    });
  }

  /// Logarithm of the ratio, bounded.
  [[nodiscard]] static Complex change(Complex from, Complex to) {
    constexpr double largest_turn = std::numbers::pi / 4, largest_scale = 1.5;
    const Complex ratio = elementary::log(to / from);
    return {std::clamp(ratio.real(), -largest_scale, largest_scale),
            std::clamp(ratio.imag(), -largest_turn, largest_turn)};
  }

  const TriangleMesh<double>& mesh_;
  const MapUnknowns<K>& unknowns_;
  const CurlOptions& options_;
  Context& context_;
  const std::vector<QuadEdges> wanted_;
  std::vector<QuadEdges> field_;
  std::vector<Complex> edges_;  // of the faces, in their bases
  TargetEdges target_;
  std::vector<double> cotangent_;
};

/// Of both directions the turns in degrees, and of both densities the logarithms, by face.
inline void report_changes(const TriangleMesh<double>& mesh, const FrameField& before, const FrameField& after,
                           CurlReport& report) {
  const std::size_t m = before.u.size();
  std::vector<double> turned(m), scaled(m);
  for (std::size_t f = 0; f < m; ++f) {
    const Complex u = after.u[f] / before.u[f], v = after.v[f] / before.v[f];
    turned[f] = (std::abs(elementary::arg(u)) + std::abs(elementary::arg(v))) * 90 / std::numbers::pi;
    scaled[f] = (std::abs(elementary::log(std::abs(u))) + std::abs(elementary::log(std::abs(v)))) / 2;
    const double share = mesh.area(static_cast<Index>(f)) / mesh.total_area();
    report.turned_mean_degrees += share * turned[f];
    report.scaled_mean += share * scaled[f];
  }
  report.turned_p95_degrees = quantile(std::move(turned), 0.95);
  report.scaled_p95 = quantile(std::move(scaled), 0.95);
}

}  // namespace detail

QUADRIG_INLINE Expected<ReducedField> reduce_curl(const TriangleMesh<double>& mesh,
                                                  const Connection<double>& connection, const FrameField& frames,
                                                  const Matching& matching, const Singularities& singularities,
                                                  const CurlOptions& options, Context& context) {
  using detail::at;
  if (Status status = options.validate(mesh); !status.ok()) return status.error();
  ReducedField result{frames, matching, {}};
  CurlReport& report = result.report;
  const auto measure = [&](double& mean, double& largest) {
    const FieldCurl curl = field_curl(mesh, connection, result.frames, result.matching);
    mean = curl.mean;
    largest = curl.largest;
  };
  measure(report.mean_before, report.largest_before);
  report.mean_after = report.mean_before;
  report.largest_after = report.largest_before;
  if (options.rounds == 0) return result;
  std::vector<std::int8_t> rotation(at(mesh.halfedge_count()));
  for (std::size_t h = 0; h < rotation.size(); ++h) rotation[h] = static_cast<std::int8_t>(matching.r[h] & 3);
  const CutGraph cut = make_cut_graph(mesh, rotation, singularities.index4, &context);
  if (context.cancelled()) return cancelled_error("curl");
  const std::vector<Aligned> aligned = aligned_edges(mesh, connection, cut, matching, frames, options.kept);
  std::vector<detail::QuadEdges> wanted(frames.u.size());
  for (std::size_t f = 0; f < wanted.size(); ++f) {
    const std::array<Complex, 4> arms{frames.u[f], frames.v[f], -frames.u[f], -frames.v[f]};
    const auto turn = static_cast<std::size_t>(cut.combing[f]);
    const Complex a = arms[turn], b = arms[(turn + 1) % 4];
    wanted[f] = {a / std::norm(a), b / std::norm(b)};
  }
  std::vector<detail::QuadEdges> reduced;
  const auto solve = [&]<class K>(std::type_identity<K>) -> Status {
    Expected<MapUnknowns<K>> unknowns = MapUnknowns<K>::create(mesh, cut, singularities.index4, aligned, &context);
    if (!unknowns) return unknowns.error();
    detail::CurlReducer<K> reducer(mesh, connection, *unknowns, options, wanted, context);
    if (Status status = reducer.run(); !status.ok()) return status;
    reduced = reducer.field();
    report.backend = reducer.backend;
    return {};
  };
  const bool pinned = std::ranges::any_of(aligned, [](Aligned a) { return a != Aligned::none; });
  const Status status = pinned ? solve(std::type_identity<double>{}) : solve(std::type_identity<Complex>{});
  if (!status.ok()) return status.error();

  std::vector<double> turn(reduced.size());
  for (std::size_t f = 0; f < reduced.size(); ++f) {
    const Complex a = reduced[f].a / std::norm(reduced[f].a), b = reduced[f].b / std::norm(reduced[f].b);
    turn[f] = (elementary::arg(reduced[f].a / wanted[f].a) + elementary::arg(reduced[f].b / wanted[f].b)) / 2;
    const std::array<Complex, 4> arms{a, b, -a, -b};
    const auto back = static_cast<std::size_t>((4 - cut.combing[f]) & 3);
    result.frames.u[f] = arms[back];
    result.frames.v[f] = arms[(back + 1) % 4];
  }
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (const Index twin = mesh.twin(h); twin != no_index)
      result.matching.rho[at(h)] += turn[at(h / 3)] - turn[at(twin / 3)];
  report.rounds = options.rounds;
  measure(report.mean_after, report.largest_after);
  detail::report_changes(mesh, frames, result.frames, report);
  return result;
}

}  // namespace quadrig
