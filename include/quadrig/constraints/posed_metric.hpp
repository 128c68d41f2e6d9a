// How curved the surface gets when it moves, and the quads that follow it best: directions, aspect and density.
//
// A quad with rest edge vectors a, b strays from the surface of pose p by an error e_p(a, b) that is quadratic in C_p,
// the second fundamental form of the posed surface pulled back to the rest surface: with A = C(a, a), B = C(b, b) and
// M = C(a, b), e² = (3 A² + 3 B² + 5 A B + 4 M²) / 360 is the mean square distance of the two triangles that a renderer
// draws, over both diagonals (quadratic interpolation error, integrated); principal directions are best. At a fixed
// area A of the quad e_p² = A² E_p(θ, ρ): the best angle θ and aspect ρ make E = Σ_p weight_p E_p least.
#pragma once

#include "quadrig/connection.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig {

/// C_p of every face and pose. Poses that move a face as a rigid body share the form of the rest pose.
class PosedForms {
 public:
  /// A symmetric form in the face's basis of connection.hpp (one over length): C(z, z) = xx x² + 2 xy x y + yy y² for
  /// z = x + i y; and the share of the poses that have it.
  struct Form {
    double xx = 0, xy = 0, yy = 0;
    double weight = 0;
    /// C(z, z). \cost O(1)
    [[nodiscard]] double at(Complex z) const {
      return xx * z.real() * z.real() + 2 * xy * z.real() * z.imag() + yy * z.imag() * z.imag();
    }
  };

  struct Options {
    Skinning skinning = Skinning::linear_blend;
    /// Weight of each pose; empty: 1 each.
    std::vector<double> pose_weights = {};
    /// Weight of the rest pose, in addition to them.
    double rest_weight = 1;
    /// Morph targets: displacements of the vertices, each a pose of weight 1 more.
    std::span<const Points<double>> morphs = {};
    /// Rounds of averaging of the vertex normals with their neighbours' before they are differentiated.
    Index smoothing = 1;
    /// Points whose weights leave less than this to all but one rigid body move with that body.
    double rigid_tolerance = 1e-4;
    /// Where a pose shrinks the area of a face below this share of it (a collapsed elbow), its form is scaled down by
    /// the ratio of the two: what is seen of such a fold shrinks alike.
    double least_area_ratio = 0.05;

    [[nodiscard]] Status validate() const;
  };

  /// The forms under each pose and at rest; weights are scaled to sum 1 on each face. Without poses: at rest alone.
  /// \param weights read where there are poses
  /// \pre connection belongs to the mesh, or to one of the same faces
  /// \cost O(moved faces) a pose, after a scan of the weights; 40 bytes a moved face and pose.
  /// \fails bad_option by validate(); bad_input when weights, poses and mesh do not fit each other; cancelled
  [[nodiscard]] static Expected<PosedForms> create(const TriangleMesh<double>& mesh,
                                                   const Connection<double>& connection, const SkinWeights& weights,
                                                   std::span<const Pose> poses, const Options& options,
                                                   Context& context);
  /// The rest pose alone: the curvature of the surface as it stands. \cost O(m). \fails never.
  [[nodiscard]] static PosedForms at_rest(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                          Index smoothing = 1);

  [[nodiscard]] Index face_count() const { return static_cast<Index>(first_.size()) - 1; }
  /// The distinct forms of a face, the rest pose's first; their weights sum to 1.
  [[nodiscard]] std::span<const Form> of_face(Index face) const {
    const auto f = static_cast<std::size_t>(face);
    return {forms_.data() + first_[f], first_[f + 1] - first_[f]};
  }
  /// Σ_p weight_p e_p(a, b)²: the mean square over the poses of the error (a length) that a quad with these rest edge
  /// vectors, given in the face's basis, leaves. \cost O(forms of the face)
  [[nodiscard]] double mean_square_error(Index face, Complex a, Complex b) const;

 private:
  std::vector<Form> forms_;
  std::vector<std::size_t> first_{0};
};

/// What the quads should be at each face. With A = 1 / (lines a unit area) the rest edge vectors of the wanted quad are
///   a = direction · √(A aspect)  (the long one),  b = i · direction · √(A / aspect),
/// so that a frame field with densities has |u| = √(1 / (A aspect)) along `direction` and |v| = √(aspect / A) across
/// it.
struct PosedMetric {
  std::vector<Complex> direction;  ///< unit, of the long edge, in the face's basis; defined up to sign
  std::vector<double> aspect;      ///< in [1, largest_aspect]
  /// In [0, 1]: 1 − E(best) / E(best at 45° from it), 0 where the direction does not matter or the surface is flat. To
  /// be multiplied by the face's share of the area.
  std::vector<double> alignment;
  std::vector<double> error;  ///< E at the best direction and aspect (1 / length²): rms error = A √E
  std::vector<double>
      density;  ///< quads a unit area relative to the mean: Σ area · density = Σ area. 1/A = N density / Σ area
};

struct PosedMetricOptions {
  double largest_aspect = 4;
  /// Errors where weights blend count joint_weight times as much as where one bone rules: j = 1 + (joint_weight − 1)(1
  /// − ω1).
  double joint_weight = 3;
  double least_density = 0.25;  ///< of the mean
  double largest_density = 16;  ///< of the mean: keeps a crease or a fold from taking all quads

  [[nodiscard]] Status validate() const;
};

/// Per face the direction and aspect that make E least, and densities by equidistribution, 1/A ∝ (j E)^{1/3}, which
/// makes Σ A² j E dS least at a fixed number of quads.
/// \param omega1 dominance of the strongest bone on each face, or empty: one bone rules everywhere
/// \cost O(forms). \fails bad_option by validate(); bad_input when omega1 has another number of faces
[[nodiscard]] Expected<PosedMetric> posed_metric(const TriangleMesh<double>& mesh, const PosedForms& forms,
                                                 std::span<const double> omega1, const PosedMetricOptions& options,
                                                 Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/constraints/posed_metric.ipp"
#endif
