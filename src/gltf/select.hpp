// Which primitives a selection names.
#pragma once

#include "document.hpp"
#include "quadrig/gltf/surface.hpp"

namespace quadrig::gltf {

class Selector {
 public:
  /// `skin_of_mesh`: of each mesh, or no_skin.
  /// \fails bad_option where a name is no regular expression, or nothing in the file is called so
  [[nodiscard]] static Expected<Selector> create(const State& state, const GltfSelection& selection,
                                                 const std::vector<std::size_t>& skin_of_mesh);
  static constexpr std::size_t no_skin = static_cast<std::size_t>(-1);

  /// Whether the primitive is to be remeshed, skinned or not.
  [[nodiscard]] bool has(std::size_t mesh, const Json& primitive) const;

 private:
  std::vector<char> mesh_, material_;  // chosen
};

}  // namespace quadrig::gltf
