// Shells of surfaces: which are remeshed, with how many quads, and which stay.
#pragma once

#include <algorithm>

#include "gather.hpp"
#include "quadrig/gltf.hpp"

namespace quadrig::gltf {

/// Shells of one surface, with the count that each is due.
struct Shells {
  Components components;
  std::vector<double> area;  ///< in the scene
  std::vector<char> kept;    ///< to be remeshed
  double kept_area = 0;

  [[nodiscard]] bool keeps_any() const { return std::find(kept.begin(), kept.end(), 1) != kept.end(); }
};

/// Which shells are remeshed: those whose share of the count is large enough, or the largest of all where none is.
[[nodiscard]] std::vector<Shells> choose_shells(const std::vector<Gathered>& all, const GltfRemeshOptions& options);

/// The kept shells as an asset of their own; `source_face` is filled with the face that each of its faces was.
[[nodiscard]] Asset kept_part(const GltfSurface& surface, const Shells& shells, std::vector<Index>& source_face);

/// Remeshes the kept shells of a surface to `quads`. Shells that cannot be are told in `done.failures` and kept no
/// more. \fails bad_option, cancelled; under strict also as remesh
[[nodiscard]] Status remesh_shells(const Gathered& gathered, Shells& shells, double quads,
                                   const GltfRemeshOptions& options, GltfRemeshed& done,
                                   std::vector<Index>& source_face, Context& context);

}  // namespace quadrig::gltf
