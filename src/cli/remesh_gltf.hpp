// What quadrig remesh does with a glTF file.
#pragma once

#include "command.hpp"
#include "quadrig/gltf.hpp"

namespace quadrig::cli {

struct GltfJob {
  std::filesystem::path input, output, report, quads_out;
  std::filesystem::path guides, rims;  ///< read already; no output may be one of these files
  GltfRemeshOptions options;
  std::vector<Index> quads;  ///< one count a level of detail
  bool force = false;
  bool strict_count = false;  ///< a count off by more than the tolerance is exit code 9
  Json options_json;
};

/// Several counts: each level is a file of its own, `_LOD0` and so on before the extension of every output's name.
[[nodiscard]] Status remesh_gltf_file(const GltfJob& job, Session& session);

/// What the summary says of the symmetry; empty where there is none.
[[nodiscard]] std::string symmetry_words(const SymmetryReport& symmetry);
/// The figures of a remesh, after the head of its report.
void add_remesh_figures(Json& report, const RemeshReport& r, double read_seconds, std::span<const Warning> warnings);

}  // namespace quadrig::cli
