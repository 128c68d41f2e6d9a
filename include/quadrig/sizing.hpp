// How large the quads are where: line densities for a frame field, from the rig, the weights or the curvature.
#pragma once

#include "quadrig/constraints.hpp"
#include "quadrig/constraints/posed_metric.hpp"
#include "quadrig/field.hpp"

namespace quadrig {

/// What decides the area of a quad.
enum class DensitySource : std::uint8_t {
  uniform,  ///< every quad the same
  field,    ///< the magnitudes the field itself gives (thesis)
  blend,    ///< 1 + 3 (1 − ω1): more where weights blend
  rest,     ///< curvature of the rest surface
  posed,    ///< curvature of the surface over its poses
};

/// "uniform", "field", "blend", "rest" or "posed". \fails bad_option on any other name
[[nodiscard]] inline Expected<DensitySource> density_source(std::string_view name) {
  constexpr std::array<std::string_view, 5> names{"uniform", "field", "blend", "rest", "posed"};
  for (std::size_t k = 0; k < names.size(); ++k)
    if (names[k] == name) return static_cast<DensitySource>(k);
  return Error{ErrorCode::bad_option, "there is no such density", "density " + std::string(name),
               "one of: uniform, field, blend, rest, posed"};
}
[[nodiscard]] constexpr std::string_view density_source_name(DensitySource source) {
  constexpr std::array<std::string_view, 5> names{"uniform", "field", "blend", "rest", "posed"};
  return names[static_cast<std::size_t>(source)];
}

struct SizingOptions {
  DensitySource density = DensitySource::uniform;
  /// Longest over shortest side of the wanted quads, ≥ 1; 1: squares. Sides come from the same curvature as areas.
  double largest_aspect = 4;
  /// How much more an error counts where weights blend, ≥ 1.
  double joint_weight = 6;
  double least_density = 0.25;  ///< of the mean, in (0, 1]
  double largest_density = 16;  ///< of the mean, ≥ 1
  double gradation = 0.8;       ///< relative change of size over one quad, > 0
  /// Quads a unit area, relative to each other, in the place of `density`: one value a vertex of the mesh, or one a
  /// face; empty: none. Graded like the others.
  std::vector<double> own_density{};

  [[nodiscard]] Status validate() const {
    const auto bad = [](std::string field, std::string remedy) {
      return Error{ErrorCode::bad_option, "out of range", "sizing." + std::move(field), std::move(remedy)};
    };
    if (!(largest_aspect >= 1 && largest_aspect <= 100)) return bad("largest_aspect", "give 1 to 100");
    if (!(joint_weight >= 1 && joint_weight <= 1e6)) return bad("joint_weight", "give 1 to 1e6");
    if (!(least_density > 0 && least_density < 1)) return bad("least_density", "give a number in (0, 1)");
    if (!(largest_density >= 1)) return bad("largest_density", "give 1 or more");
    if (!(gradation > 0)) return bad("gradation", "give a number above 0");
    for (const double d : own_density)
      if (!(d > 0 && std::isfinite(d))) return bad("own_density", "give numbers above 0");
    return {};
  }
};

/// Quads a unit area relative to the mean, and the forms that decide their sides; made once for a whole asset.
struct SizeField {
  std::vector<double> density;  ///< a face, mean 1 over the area
  PosedForms forms;             ///< empty where squares are wanted
  double largest_aspect = 1;
};

/// Curvature along and across a frame, squared; and whether quads would go more than a quarter around a tube.
struct TubeCheck {
  static constexpr double mostly = 4;  ///< a tube curves so much more around than along
  static constexpr double quarter = std::numbers::pi / 2;
  double across = 0;  ///< the larger curvature
  bool around_v = false, coarse = false;

  /// \param u, v squared curvatures along the frame \param edge of a square quad
  TubeCheck(double u, double v, double edge) {
    across = std::sqrt(std::max(u, v));
    around_v = v > u;
    coarse = std::max(u, v) > mostly * mostly * std::min(u, v) && edge * across > quarter;
  }
};

/// The frames with the line densities (per unit length) of the size field at `quads` on `area`: the side ratio that
/// leaves the least error along the frame's own directions, smoothed along the surface.
/// \param parent face of the size field's mesh that each face of `mesh` is part of
/// \pre forms, where not empty, belong to `parent_connection`
/// \cost one sparse factorization of two unknowns a face.
[[nodiscard]] inline Expected<FrameField> apply_sizes(const TriangleMesh<double>& mesh,
                                                      const Connection<double>& connection, const SizeField& sizes,
                                                      const Connection<double>& parent_connection,
                                                      std::span<const Index> parent, double quads, double area,
                                                      const Matching& matching, FrameField frames, Context& context,
                                                      const SolverFactory<double>& factory = solver_factory<double>()) {
  const auto m = static_cast<std::size_t>(mesh.face_count());
  constexpr double most_stretch = 1000;
  const double mean = quads / area;
  DensityTargets wanted{std::vector<double>(m), std::vector<double>(m), std::vector<double>(m, 1.0),
                        std::vector<double>(m)};
  const bool squares = sizes.largest_aspect <= 1 || sizes.forms.face_count() <= 0;
  // Curvature far below the mean cannot tell a direction from noise.
  std::vector<std::array<double, 2>> strength(m, {0, 0});
  double floor = 0;
  bool thin_tube = false;  // thinner than four quads
  if (!squares) {
    double total_area = 0, tube_area = 0;
    for (Index f = 0; f < mesh.face_count(); ++f) {
      if (f % 1024 == 0 && context.cancelled()) return cancelled_error("sizes");
      const Index p = parent[static_cast<std::size_t>(f)];
      const auto at = static_cast<std::size_t>(f);
      const Complex u = parent_connection.to_complex(p, connection.to_vector(f, frames.u[at]));
      const Complex v = parent_connection.to_complex(p, connection.to_vector(f, frames.v[at]));
      for (const PosedForms::Form& form : sizes.forms.of_face(p)) {
        const double cu = form.at(u / std::abs(u)), cv = form.at(v / std::abs(v));
        strength[at][0] += form.weight * cu * cu;
        strength[at][1] += form.weight * cv * cv;
      }
      floor += mesh.area(f) * std::sqrt(std::max(strength[at][0], strength[at][1]));
      total_area += mesh.area(f);
      if (TubeCheck(strength[at][0], strength[at][1], 1 / std::sqrt(mean)).coarse) tube_area += mesh.area(f);
    }
    thin_tube = tube_area > total_area / 2;
    floor = 0.1 * floor / total_area;
    floor *= floor;
  }
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (f % 1024 == 0 && context.cancelled()) return cancelled_error("sizes");
    const auto at = static_cast<std::size_t>(f);
    const double density = mean * sizes.density[static_cast<std::size_t>(parent[at])];
    double aspect = 1;          // |long along u| : E(ρ) = (S_u ρ² + S_v / ρ²) / 64 + const
    if (!squares && floor > 0)  // a flat surface has no best side ratio
      aspect = std::clamp(std::sqrt(std::sqrt((strength[at][1] + floor) / (strength[at][0] + floor))),
                          1 / sizes.largest_aspect, sizes.largest_aspect);
    if (thin_tube)
      if (const TubeCheck tube(strength[at][0], strength[at][1], 1 / std::sqrt(density)); tube.coarse) {
        // Four quads around, as long as their number allows.
        const double across = tube.across / TubeCheck::quarter;
        const double stretch = std::min(across * across / density, most_stretch);
        aspect = tube.around_v ? std::max(aspect, stretch) : std::min(aspect, 1 / stretch);
      }
    wanted.length[at] = 1 / std::sqrt(std::max(density, mean));  // narrow bands keep their sizes
    wanted.log_u[at] = 0.5 * elementary::log(density / aspect);
    wanted.log_v[at] = 0.5 * elementary::log(density * aspect);
  }
  const double edge = 1 / std::sqrt(mean);
  Expected<DensityTargets> smooth = smooth_log_densities(mesh, matching, wanted, edge, context, factory);
  if (!smooth) return smooth.error();
  if (context.cancelled()) return cancelled_error("sizes");
  apply_densities(frames, *smooth, 0, std::numeric_limits<double>::infinity());
  return frames;
}

}  // namespace quadrig
