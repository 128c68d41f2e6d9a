// One primitive's arrays, from accessors or out of a Draco stream.
#pragma once

#include <array>
#include <set>

#include "document.hpp"

namespace quadrig::gltf {

/// What a Draco stream holds.
struct DracoMesh {
  std::size_t vertices = 0;
  std::vector<std::size_t> corners;
  std::map<std::string, std::shared_ptr<const Values>> attributes;
  std::set<std::string> as_stored;  // that the stream does not call normalized: their accessors say
};
/// \fails bad_input; unsupported in a build without Draco
[[nodiscard]] Expected<DracoMesh> read_draco(State& state, const Json& extension, const std::string& where,
                                             Budget& budget);
/// In the extras of a primitive: how many quads its first triangles are the halves of.
inline constexpr const char* quads_mark = "quads";
inline constexpr const char* draco_name = "KHR_draco_mesh_compression";

/// How many triangles a list of corners makes, and which: mode 4 triangles, 5 strip, 6 fan.
[[nodiscard]] inline std::size_t triangle_count(std::size_t mode, std::size_t corners) {
  return mode == 4 ? corners / 3 : corners < 3 ? 0 : corners - 2;
}
[[nodiscard]] inline std::array<std::size_t, 3> triangle_of(std::size_t mode, const std::vector<std::size_t>& list,
                                                            std::size_t t) {
  if (mode == 4) return {list[3 * t], list[3 * t + 1], list[3 * t + 2]};
  if (mode == 6) return {list[0], list[t + 1], list[t + 2]};
  if (t % 2 == 0) return {list[t], list[t + 1], list[t + 2]};
  return {list[t + 1], list[t], list[t + 2]};
}

class PrimitiveReader {
 public:
  /// Reads mode, positions and corners. A primitive that is no surface has no positions.
  /// \fails bad_input, unsupported
  [[nodiscard]] static Expected<PrimitiveReader> open(State& state, const Json& primitive, const std::string& where,
                                                      Budget& budget, Cache& cache);

  [[nodiscard]] bool is_surface() const { return positions_ != nullptr; }
  [[nodiscard]] std::size_t mode() const { return mode_; }
  [[nodiscard]] std::size_t vertices() const { return static_cast<std::size_t>(positions_->rows()); }
  [[nodiscard]] const Values& positions() const { return *positions_; }
  [[nodiscard]] const std::vector<std::size_t>& corners() const { return corners_; }
  /// The attribute `name`, whose accessor is `json`; of a morph target without a name. One row a vertex.
  [[nodiscard]] Expected<std::shared_ptr<const Values>> values(const std::string& name, const Json& json,
                                                               const std::string& where) const;

 private:
  PrimitiveReader(State& state, Budget& budget, Cache& cache) : state_(&state), budget_(&budget), cache_(&cache) {}
  [[nodiscard]] Expected<std::shared_ptr<const Values>> stored(const Json& json, const std::string& where) const;
  /// Normalized where the accessor says so.
  [[nodiscard]] std::shared_ptr<const Values> as_accessor(const std::shared_ptr<const Values>& values,
                                                          const Json& json) const;
  [[nodiscard]] Status read_corners(const Json& primitive, const std::string& where);

  State* state_;
  Budget* budget_;
  Cache* cache_;
  std::size_t mode_ = 4;
  std::optional<DracoMesh> draco_;
  std::shared_ptr<const Values> positions_;
  std::vector<std::size_t> corners_;
};

}  // namespace quadrig::gltf
