// quadrig field: the cross field alone.
#include "quadrig/field.hpp"

#include <map>

#include "command.hpp"
#include "quadrig/seamless/reduce_curl.hpp"

namespace quadrig::cli {
namespace {

struct FieldCommand {
  Input input;
  std::string preset = "default", solver{default_solver_name};
  double crease_degrees = 0;
  Index curl_rounds = 0;
  std::optional<double> bones, curvature;
  std::string directions = "rest";
  std::filesystem::path output, report;
};

/// OBJ lines: the two lines of each face's cross, as long as a quad of that density would be where the mean one is as
/// long as the face.
std::string crosses(const TriangleMesh<double>& mesh, const Connection<double>& connection, const FrameField& frames) {
  const auto m = static_cast<std::size_t>(mesh.face_count());
  double mean = 0;
  for (std::size_t f = 0; f < m; ++f) mean += std::sqrt(std::abs(frames.u[f]) * std::abs(frames.v[f]));
  mean /= static_cast<double>(m);
  std::string text = "# two lines a face, along the cross field\n", lines;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto at = static_cast<std::size_t>(f);
    const Vector3 centre = position(mesh, SurfacePoint{f, Vector3::Constant(1.0 / 3)});
    const double size = 0.4 * std::sqrt(mesh.area(f));
    Index corner = 4 * f + 1;
    for (const Complex z : {frames.u[at], frames.v[at]}) {
      const double length = std::abs(z);
      const Complex half = z / length * size * std::clamp(mean / length, 0.25, 1.5);
      const Vector3 arm = connection.to_vector(f, half);
      put_numbers(text += 'v', centre - arm);
      put_numbers(text += "\nv", centre + arm);
      text += '\n';
      lines += "l " + std::to_string(corner) + ' ' + std::to_string(corner + 1) + '\n';
      corner += 2;
    }
  }
  return text + lines;
}

/// OBJ points: the singular vertices, in a group for each index. They follow two lines a face.
std::string singular_points(const TriangleMesh<double>& mesh, const Singularities& singularities) {
  std::map<Index, std::vector<Index>> of_index;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (const Index index = singularities.index4[static_cast<std::size_t>(v)]; index != 0) of_index[index].push_back(v);
  std::string text;
  Index number = 4 * mesh.face_count();
  for (const auto& [index, vertices] : of_index) {
    text += "g singular_" + std::string(index > 0 ? "plus_" : "minus_") + std::to_string(std::abs(index)) + "\n";
    for (const Index v : vertices) {
      put_numbers(text += 'v', mesh.position(v));
      text += "\np " + std::to_string(++number) + "\n";
    }
  }
  return text;
}

/// The text format of Directional: degree and faces, then the vectors of each face one after another.
std::string raw_field(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                      const FrameField& frames) {
  std::string text = "4 " + std::to_string(mesh.face_count()) + "\n";
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto at = static_cast<std::size_t>(f);
    std::string row;
    for (const Complex z : {frames.u[at], frames.v[at], -frames.u[at], -frames.v[at]})
      put_numbers(row, connection.to_vector(f, z));
    text += row.substr(1) + "\n";
  }
  return text;
}

Status field(const FieldCommand& options, Session& session) {
  FileSet files;
  if (Status status = declare(files, options.input, {options.output, options.report}); !status) return status;
  const std::string extension = options.output.extension().string();
  if (!options.output.empty() && !goes_to(options.output, ".obj") && extension != ".rawfield")
    return Error{ErrorCode::bad_option, "is no format for fields", options.output.string(),
                 "name an .obj (lines to look at) or a .rawfield (vectors, as Directional reads them)"};
  const Expected<FieldPreset> preset = field_preset(options.preset);
  if (!preset) return preset.error();
  Input input = options.input;
  input.clips = options.directions == "clips";
  if (input.clips && !is_gltf(input.files.mesh))
    return Error{ErrorCode::bad_option, "clips are of glTF files", "--directions clips", "leave it out"};
  const Expected<LoadedAsset> loaded = load(input, files, session);
  if (!loaded) return loaded.error();
  if (input.clips && (!loaded->asset.rig || loaded->asset.rig->clips.empty()))
    return Error{ErrorCode::bad_option, "has no clip that moves this surface", input.files.mesh.string(),
                 "take directions at rest (--directions rest)"};
  const TriangleMesh<double>& mesh = loaded->asset.mesh;
  const Connection<double> connection(mesh);
  FieldOptions field_options;
  field_options.preset = *preset;
  field_options.solver = options.solver;
  constexpr Index most_poses = 64;
  if (input.clips) field_options.bone_poses = clip_poses(loaded->asset.rig->clips, most_poses);
  field_options.bone_weight = options.bones;
  field_options.curvature_weight = options.curvature;
  if (options.crease_degrees > 0) field_options.crease_angle_radians = options.crease_degrees * std::numbers::pi / 180;
  session.context.progress("field", 0.2);
  Expected<FieldResult> result = design_field(loaded->asset, connection, field_options, session.context);
  if (!result) return result.error();
  const FieldReport& r = result->report;
  CurlOptions curl;
  curl.rounds = options.curl_rounds;
  curl.solver = options.solver;
  Expected<ReducedField> reduced =
      reduce_curl(mesh, connection, result->frames, result->matching, result->singularities, curl, session.context);
  if (!reduced) return reduced.error();
  result->frames = std::move(reduced->frames);

  Json report = report_head("field", options.input, *loaded);
  report["options"] = {{"preset", options.preset},
                       {"crease_degrees", options.crease_degrees > 0 ? Json(options.crease_degrees) : Json(nullptr)},
                       {"bones", options.bones ? Json(*options.bones) : Json(nullptr)},
                       {"curvature", options.curvature ? Json(*options.curvature) : Json(nullptr)},
                       {"directions", options.directions},
                       {"curl", options.curl_rounds},
                       {"solver", options.solver}};
  report["preset_in_force"] = field_preset_name(r.preset);
  report["vertices"] = r.vertices;
  report["faces"] = r.faces;
  report["bones"] = r.bones;
  report["interior_edges"] = r.interior_edges;
  report["sum_omega1"] = r.sum_omega1;
  report["sum_omega2"] = r.sum_omega2;
  report["energy_align"] = r.energy_align;
  report["energy_smooth"] = r.energy_smooth;
  report["energy_orth"] = r.energy_orth;
  report["sum_abs_x0"] = r.sum_abs_x0;
  report["sum_abs_x1"] = r.sum_abs_x1;
  report["median_abs_x0"] = r.median_abs_x0;
  report["faces_omega1_above_0.9"] = r.faces_omega1_above_0_9;
  report["mean_angle_to_bone_deg"] = r.mean_angle_to_bone_deg;
  report["median_angle_to_bone_deg"] = r.median_angle_to_bone_deg;
  report["singularities_plus"] = r.singularities_plus;
  report["singularities_minus"] = r.singularities_minus;
  report["index_sum"] = r.index_sum;
  report["singularities_boundary"] = r.singularities_boundary;
  report["euler_characteristic"] = r.euler_characteristic;
  report["free_components"] = r.free_components;
  report["bounded_frames"] = r.bounded_frames;
  report["curl"] = curl_json(reduced->report.in_units_of(std::sqrt(mesh.total_area())));
  report["residual"] = r.solve.residual;
  report["seconds"] = {{"assembly", r.solve.assembly_seconds},
                       {"analysis", r.solve.analysis_seconds},
                       {"factorization", r.solve.factorization_seconds},
                       {"solve", r.solve.solve_seconds},
                       {"total", r.seconds}};
  report["singular_vertices"] = Json::array();
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (const Index index = result->singularities.index4[static_cast<std::size_t>(v)]; index != 0) {
      const Vector3 p = mesh.position(v);
      // Corners of the border too: there the index counts from the straight border.
      report["singular_vertices"].push_back({{"place", {p[0], p[1], p[2]}}, {"quarter_turns", index}});
    }
  report["warnings"] = warnings_json(session.context.warnings);

  if (!options.output.empty()) {
    const std::string text =
        extension == ".obj" ? crosses(mesh, connection, result->frames) + singular_points(mesh, result->singularities)
                            : raw_field(mesh, connection, result->frames);
    if (Status status = files.add(options.output, text); !status) return status;
  }
  if (!options.report.empty())
    if (Status status = files.add(options.report, report_text(report, session)); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  std::string line = std::to_string(r.singularities_plus + r.singularities_minus) + " singularities (" +
                     std::to_string(r.singularities_plus) + " of valence below 4, " +
                     std::to_string(r.singularities_minus) + " above)";
  if (r.faces_omega1_above_0_9 > 0)
    line += ", " + decimals(r.mean_angle_to_bone_deg, 2) + " degrees to the bone where one rules";
  if (options.curl_rounds > 0) {
    const CurlReport& c = reduced->report;
    line += ", curl to " + decimals(c.mean_before > 0 ? 100 * c.mean_after / c.mean_before : 100, 0) +
            " % by turning " + decimals(c.turned_mean_degrees, 1) + " degrees on average";
  }
  session.say(line + ", " + decimals(r.seconds, 2) + " s");
  return {};
}

}  // namespace

void add_field(CLI::App& app, Run& run) {
  auto options = std::make_shared<FieldCommand>();
  CLI::App* verb = app.add_subcommand("field", "Design the directions alone: a cross a face");
  add_input(*verb, options->input);
  add_selection(*verb, options->input.selection);
  verb->add_option("--preset", options->preset,
                   "default: the rig's, at any resolution; thesis: its exact energy; "
                   "static: no rig, along the curvature")
      ->check(CLI::IsMember({"default", "thesis", "static"}))
      ->option_text("default|thesis|static = default");
  verb->add_option("--creases", options->crease_degrees, "Follow edges that bend more than this, degrees")
      ->check(CLI::Range(0.0, 180.0))
      ->type_name("ANGLE");
  const auto pull = [&](const std::string& name, std::optional<double>& place, const std::string& text) {
    verb->add_option_function<double>(
            name, [&place](const double& value) { place = value; }, text)
        ->check(CLI::NonNegativeNumber)
        ->type_name("WEIGHT");
  };
  verb->add_option("--directions", options->directions,
                   "Of a glTF file: bones give directions at rest, or averaged over the poses of its clips")
      ->check(CLI::IsMember({"rest", "clips"}))
      ->option_text("rest|clips = rest");
  pull("--bones", options->bones, "Pull of the bones");
  pull("--curvature", options->curvature, "Pull of the curvature");
  verb->add_option("--curl", options->curl_rounds,
                   "Rounds of moving directions and lengths towards those of a map; 5 are enough")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str()
      ->type_name("ROUNDS");
  verb->add_option("--solver", options->solver, "Linear solver")->capture_default_str()->type_name("NAME");
  verb->add_option("-o,--output", options->output,
                   "Write the field: .obj, lines to look at, or .rawfield, the vectors as Directional reads them")
      ->type_name("OUT");
  verb->add_option("--report", options->report, "Write the figures as JSON")->type_name("FILE");
  verb->footer(R"(Examples:
  quadrig field arm.obj --rig arm.tgf --weights arm.dmat -o crosses.obj
  quadrig field arm.obj --rig arm.tgf --weights arm.dmat --preset thesis --report field.json
  quadrig field fandisk.off --creases 40 -o field.rawfield
  quadrig field bunny.off --curl 5 -o integrable.rawfield --report field.json)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return field(*options, session); }; });
}

}  // namespace quadrig::cli
