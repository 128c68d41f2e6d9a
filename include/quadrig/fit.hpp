// Quads as close to the surface that moves as their number allows: vertices leave the surface for where the flat quads
// (or what a subdivision makes of them) stray least from it, at rest, in the poses and in the morph targets.
//
// A quad with its corners on a bulge cuts into it, always to the same side. Least squares put the corners outside, the
// error changes its sign, and half of it goes. Samples of the surface keep their place on the quads for positions,
// weights and displacements alike.
#pragma once

#include "quadrig/curves.hpp"
#include "quadrig/fit/slide.hpp"
#include "quadrig/solver.hpp"
#include "quadrig/transfer.hpp"

namespace quadrig {

enum class FitMethod : std::uint8_t {
  none,         ///< vertices stay where the quads are most even
  slide,        ///< vertices stay on the surface and slide along it (fit/slide.hpp)
  surface,      ///< least squares for flat quads; vertices leave the surface
  subdivision,  ///< least squares for the limit surface of Catmull-Clark subdivision, which the quads are a cage of
};

inline constexpr std::array<std::string_view, 4> fit_method_names{"none", "slide", "surface", "subdivision"};

/// By its name. \fails bad_option on any other
[[nodiscard]] inline Expected<FitMethod> fit_method(std::string_view name) {
  for (std::size_t k = 0; k < fit_method_names.size(); ++k)
    if (fit_method_names[k] == name) return static_cast<FitMethod>(k);
  return Error{ErrorCode::bad_option, "there is no such fit", "fit " + std::string(name),
               "one of: none, slide, surface, subdivision"};
}
[[nodiscard]] constexpr std::string_view fit_method_name(FitMethod method) {
  return fit_method_names[static_cast<std::size_t>(method)];
}

struct FitOptions {
  FitMethod method = FitMethod::surface;
  SlideOptions slide{};  ///< of FitMethod::slide
  int rounds = 4;        ///< of new places for the samples, each with one least-squares solve
  double samples = 32;   ///< of the surface, for each quad at least
  /// What displacements cost against the squared distance: unlike ones of neighbours, as a whole and along the surface,
  /// and their part along the surface.
  double stiffness = 0.005, shear = 0.01, sliding = 0.01;
  double largest_move = 1;  ///< of the shortest edge at the vertex
  double accepted = 0.5;    ///< a move may not push a scaled Jacobian below this, or below what it was

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate() const;
};

/// How the surface moves. Everything is borrowed and may be empty.
struct FitMotion {
  const SkinWeights* weights = nullptr;    ///< one row a vertex of the surface
  std::span<const Pose> poses;             ///< linear blend skinning of `weights`
  std::span<const double> pose_weights;    ///< empty: 1 each
  double rest_weight = 1;                  ///< of the rest pose beside them
  std::span<const Points<double>> morphs;  ///< displacements, n×3, a pose each
  std::span<const double> face_weights;    ///< how much the error counts on each face; empty: 1
  Index influences = 4;                    ///< most weights a vertex of the quads keeps
};

/// Root mean square distances of the surface to the planes of the quads at its places, by `face_weights`; lengths.
struct FitReport {
  double rest_before = 0, rest_after = 0;
  double back_before = 0, back_after = 0;    ///< the other way, at rest: of the quads to the surface
  double posed_before = 0, posed_after = 0;  ///< over rest, poses and morphs; as at rest where there are none
  double largest_move = 0;                   ///< of a vertex, a length
  Index dropped_influences = 0;              ///< vertices that have fewer weights than the surface there
  double dropped_error = 0;                  ///< rms over those and the poses of how far that moves a vertex; a length
  int rounds = 0;

  /// Of several parts: the largest of each distance, the sum of counts.
  FitReport& operator+=(const FitReport& other) {
    for (const auto length :
         {&FitReport::rest_before, &FitReport::rest_after, &FitReport::back_before, &FitReport::back_after,
          &FitReport::posed_before, &FitReport::posed_after, &FitReport::largest_move, &FitReport::dropped_error})
      this->*length = std::max(this->*length, other.*length);
    dropped_influences += other.dropped_influences;
    rounds = std::max(rounds, other.rounds);
    return *this;
  }
};

struct FittedQuads {
  QuadMesh mesh;                       ///< `source`: the points of the surface nearest to the vertices
  std::optional<SkinWeights> weights;  ///< where the motion has weights: at most `influences` a row, sum 1
  std::vector<Points<double>> morphs;  ///< displacements of the vertices, one matrix a morph of the motion
  FitReport report;
};

/// Fits quads to a surface by `options.method`, `surface` or `none` (then only weights and morphs are made). Each quad
/// begins at the corner from which two triangles (0 1 2, 0 2 3) stray least.
/// Vertices on the border and on kept edges are fitted to these lines, but for their corners; border vertices at one
/// place move as one.
/// \param held a flag a vertex, or empty: does not move
/// \param kept marks of edges of the surface that edges of quads run along, or empty; a cage goes by the border alone
/// \pre quads.source has one point a vertex; the quads are an oriented manifold near the surface
/// \cost O(samples · poses that move them) a round, and one sparse factorization of three unknowns a vertex.
///   The same bits for any number of threads.
/// \fails bad_option by validate(); bad_input where weights, poses or morphs do not fit the surface; as the solver
/// does;
///   cancelled
[[nodiscard]] QUADRIG_INLINE Expected<FittedQuads> fit(const TriangleMesh<double>& surface, QuadMesh quads,
                                                       const FitMotion& motion, std::vector<char> held,
                                                       const FitOptions& options, Context& context,
                                                       const SolverFactory<double>& solver = solver_factory<double>(),
                                                       const EdgeMarks& kept = {});

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/fit/fit.ipp"
#endif
