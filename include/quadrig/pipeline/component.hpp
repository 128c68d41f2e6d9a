// One connected component to quads: the ladder of attempts that ends at the first good mesh.
#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/prepare.hpp"

namespace quadrig::detail {

inline constexpr double parts_done = 0.95;  // of the job: what follows is the fit

/// Directions of the caller's own, by face of the asset's mesh.
struct OwnDirections {
  std::vector<Vector3> direction;  ///< zero: none
  std::vector<double> weight;      ///< infinity: exactly so
};

/// A rim that is to get rings.
struct RimRings {
  const Rim& rim;
  double edge;   ///< of the quads beside it, a length
  double reach;  ///< of the band in which quads run along it
};

/// What all components of an asset share.
struct RemeshShared {
  const Asset& asset;
  const Connection<double>& connection;
  const RemeshOptions& options;
  const SizingOptions& sizing;
  const SizeField* sizes = nullptr;     ///< null: the field's own magnitudes
  const SizeField* rounded = nullptr;   ///< of quads that do not keep `kept`; null: the same
  const PosedMetric* metric = nullptr;  ///< null: no posed directions
  const EdgeMarks& kept;                ///< of the asset's mesh
  const OwnDirections* own = nullptr;   ///< null: the caller gives none
  std::size_t parts = 1;                ///< components
  const MirrorPlane* plane = nullptr;   ///< null: there is none
  std::span<const RimRings> rings{};

  /// Whether the caller asks for directions that no other option names.
  [[nodiscard]] bool asks_for_directions() const { return own || options.directions.terms || !rings.empty(); }
};

struct ComponentResult {
  QuadMesh mesh;             ///< `source` refers to the asset's mesh
  std::vector<char> held;    ///< vertices on kept edges; empty: none
  std::vector<char> landed;  ///< vertices on tips of the surface; empty: none
  ComponentReport report;
  StageSeconds seconds;
  FieldReport field;
  StageBackends backends;
  std::vector<Warning> warnings;
  std::optional<ComponentMap> map;
  std::vector<char> on_cut;   ///< of a half: vertices on the mirror plane
  std::vector<Index> twin{};  ///< of each vertex its mirror twin; empty: none has one
};

struct MirrorPart;

/// \param faces the component's faces in the asset's mesh, ascending
/// \param quads its share of the count
/// \param mirrored of a component that is remeshed by half: quads of that half alone are returned, half of `quads`
[[nodiscard]] QUADRIG_INLINE Expected<ComponentResult> remesh_component(const RemeshShared& shared,
                                                                        std::span<const Index> faces, double quads,
                                                                        const Context& context,
                                                                        const MirrorPart* mirrored = nullptr);

}  // namespace quadrig::detail
