// What quadrig remesh was asked for.
#pragma once

#include "command.hpp"
#include "quadrig/gltf.hpp"

namespace quadrig::cli {

struct RemeshCommand {
  Input input;
  RemeshOptions remesh;
  std::string preset = "default", density;
  SizingOptions sizing;
  bool aspect_given = false;
  std::string creases = "flats";
  std::filesystem::path output, report, weights_out, quads_out, map_out;
  bool binary_weights = false;
  std::string poses = "bends", directions = "rest";
  std::vector<Index> quads;
  GltfSelection selection;
  bool source_map = false, seams = true, force = false;
  std::string topology = "best", normals = "auto";
  double max_error = GltfRemeshOptions{}.most_edges_off;
  std::vector<std::string> keep;
  std::string bundle;
  std::vector<NamedFactor> bone_density, material_density;
  bool density_colors = false;
  std::filesystem::path guides;
  double guide_width = 0, guide_weight = 1;
  bool strict_count = false;
  std::vector<std::string> loops;
  std::string rims = "auto";
  [[nodiscard]] bool keeps(std::string_view what) const {
    return std::find(keep.begin(), keep.end(), what) != keep.end();
  }
};

/// All that the verb does. \fails as the stages; bad_option on options that do not go together
[[nodiscard]] Status remesh_files(RemeshCommand options, Session& session);

}  // namespace quadrig::cli
