// From the words of a panel to what is drawn.
#pragma once

#include <map>

#include "picture/picture.hpp"

namespace quadrig {

/// One setting of a panel, for the help.
struct PanelWord {
  std::string_view name, meaning;
};
[[nodiscard]] std::span<const PanelWord> panel_words();

/// The settings of one panel by name; values as they were written.
struct PanelWords {
  std::filesystem::path mesh;
  std::map<std::string, std::string, std::less<>> settings;
  /// The setting, or nothing.
  [[nodiscard]] std::string value(std::string_view name) const;
};

/// A word `name=value` with a name of small letters sets something of the mesh before it, or of all where none is
/// before it; any other word is a mesh. \fails bad_option on a name that is not known, or where there is no mesh
[[nodiscard]] Expected<std::vector<PanelWords>> parse_panels(std::span<const std::string> words);

/// Reads the files of a panel and makes what they show. \fails as the readers; bad_option naming the setting
[[nodiscard]] Expected<Panel> read_panel(const PanelWords& words, Context& context);

/// Field lines, evenly apart: they follow one vector of the frame from face to face.
[[nodiscard]] std::vector<Stroke> field_lines(const TriangleMesh<double>& mesh, const struct FrameField& frames,
                                              double spacing, const Colour& colour, double pixels);

}  // namespace quadrig
