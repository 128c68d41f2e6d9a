// quadrig rims: the openings of a surface; and what `remesh --rims` takes.
#include "rims.hpp"

#include "quadrig/symmetry.hpp"

namespace quadrig::cli {
namespace {

struct RimsCommand {
  Input input;
  std::filesystem::path output;
};

/// Closed lines, each in a group named after its kind.
std::string lines_obj(std::span<const Rim> rims) {
  std::string text = "# quadrig " QUADRIG_VERSION "\n";
  std::size_t first = 1;
  for (const Rim& rim : rims) {
    text += "g " + std::string(rim_kind_name(rim.kind)) + "\n";
    for (const Vector3& p : rim.points) {
      put_numbers(text += 'v', p);
      text += '\n';
    }
    text += 'l';
    for (std::size_t k = 0; k <= rim.points.size(); ++k) text += ' ' + std::to_string(first + k % rim.points.size());
    text += '\n';
    first += rim.points.size();
  }
  return text;
}

std::optional<RimKind> kind_of(std::string name) {
  if (name.ends_with('s')) name.pop_back();
  for (const RimKind kind : {RimKind::eye, RimKind::mouth, RimKind::nostril, RimKind::ear, RimKind::pocket})
    if (rim_kind_name(kind) == name) return kind;
  return std::nullopt;
}

/// A curve of the caller's.
Rim rim_of(std::vector<Vector3> points) {
  Rim rim;
  rim.points = std::move(points);
  for (std::size_t k = 0; k < rim.points.size(); ++k)
    rim.length += (rim.points[(k + 1) % rim.points.size()] - rim.points[k]).norm();
  rim.score = 1;
  rim.evidence.emplace_back("given");
  return rim;
}

Status rims(const RimsCommand& options, Session& session) {
  if (!options.output.empty() && !goes_to(options.output, ".obj"))
    return Error{ErrorCode::bad_option, "rims are written as lines of an OBJ", options.output.string(),
                 "name an .obj file"};
  FileSet files;
  if (Status status = declare(files, options.input, {options.output}); !status) return status;
  const Expected<LoadedAsset> loaded = load(options.input, files, session);
  if (!loaded) return loaded.error();
  const Asset& asset = loaded->asset;
  const Expected<std::optional<MirrorPlane>> plane =
      find_mirror_plane(asset, SymmetryChoice::automatic, session.context);
  if (!plane) return plane.error();
  const std::vector<Rim> found =
      find_rims(asset.mesh, asset.rig ? &*asset.rig : nullptr, *plane ? &**plane : nullptr, session.context);
  if (session.context.cancelled()) return cancelled_error("rims");
  if (!options.output.empty()) {
    if (found.empty())
      return Error{ErrorCode::stage_failed, "no opening was found", options.input.files.mesh.string(),
                   "draw curves by hand, for --rims or --guides"};
    if (Status status = files.add(options.output, lines_obj(found)); !status) return status;
    if (Status status = session.commit(files); !status) return status;
  }
  std::string text = found.empty() ? "no opening was found" : "kind     score  length  where, and what speaks for it";
  for (const Rim& rim : found) {
    const Vector3 p = rim.centre();
    char line[160];
    std::snprintf(line, sizeof line, "\n%-8s %5.2f %7.3g  (%.3g, %.3g, %.3g)", rim_kind_name(rim.kind).data(),
                  rim.score, rim.length, p[0], p[1], p[2]);
    text += line;
    for (const std::string& one : rim.evidence) text += "; " + one;
  }
  session.say(text);
  return {};
}

}  // namespace

Status read_rims(const std::string& text, const FileLimits& limits, Context& context, RimOptions& rims) {
  if (text == "auto") return {};
  rims.kinds.emplace();
  if (text == "none") return {};
  if (std::filesystem::path(text).extension() == ".obj") {
    Expected<std::vector<Polyline>> lines = read_lines(text, limits, context);
    if (!lines) return lines.error();
    for (Polyline& line : *lines) {
      if (!line.closed)
        return Error{ErrorCode::bad_input, "has a line that is not closed", text, "close every line: l 1 2 3 1"};
      rims.own.push_back(rim_of(std::move(line.points)));
    }
    return {};
  }
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::optional<RimKind> kind = kind_of(text.substr(begin, end - begin));
    if (!kind)
      return Error{ErrorCode::bad_option, "names no kind of opening and no file", "--rims " + text,
                   "give auto, none, an .obj file, or some of eyes, mouth, nostrils, ears and pockets"};
    rims.kinds->push_back(*kind);
    begin = end + 1;
  }
  return {};
}

Json rims_json(std::span<const RimReport> rims) {
  Json list = Json::array();
  for (const RimReport& rim : rims) {
    const Vector3 p = rim.rim.centre();
    list.push_back({{"kind", rim_kind_name(rim.rim.kind)},
                    {"score", rim.rim.score},
                    {"evidence", rim.rim.evidence},
                    {"centre", {p[0], p[1], p[2]}},
                    {"length", rim.rim.length},
                    {"wanted", rim.wanted},
                    {"loops", rim.loops},
                    {"around", rim.around},
                    {"quads_for", rim.quads_for}});
  }
  return list;
}

void add_rims(CLI::App& app, Run& run) {
  auto options = std::make_shared<RimsCommand>();
  CLI::App* verb = app.add_subcommand("rims", "Find the eyes, the mouth and other openings of a surface");
  add_input(*verb, options->input, std::string(all_formats));
  verb->remove_option(verb->get_option("--bind"));
  verb->get_option("--rig")->needs(verb->get_option("--weights"));
  add_selection(*verb, options->input.selection);
  verb->add_option("-o,--output", options->output,
                   "Their rims as closed lines, to be changed and given to remesh --rims")
      ->type_name("OUT.obj");
  verb->footer(R"(Examples:
  quadrig rims body.glb
  quadrig rims head.obj -o rims.obj)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return rims(*options, session); }; });
}

}  // namespace quadrig::cli
