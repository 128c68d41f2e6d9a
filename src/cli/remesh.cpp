// quadrig remesh: the whole way.
#include <charconv>

#include "map_obj.hpp"
#include "remesh_gltf.hpp"

namespace quadrig::cli {
namespace {

struct RemeshCommand {
  Input input;
  RemeshOptions remesh;
  std::string preset = "default", density;
  SizingOptions sizing;
  bool aspect_given = false;
  std::string creases = "flats";
  std::filesystem::path output, report, weights_out, quads_out, map_out;
  bool binary_weights = false;
  std::string poses = "bends";
  std::vector<Index> quads;
  GltfSelection selection;
  bool source_map = false, seams = true, force = false;
  std::string topology = "best", normals = "auto";
  double max_error = GltfRemeshOptions{}.most_edges_off;
  bool strict_count = false;
  std::vector<std::string> keep, loops;
  [[nodiscard]] bool keeps(std::string_view what) const {
    return std::find(keep.begin(), keep.end(), what) != keep.end();
  }
};

Json options_json(const RemeshCommand& o) {
  const auto unless_set = [](const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); };
  Json json = {{"quads", o.remesh.quads},
               {"preset", o.preset},
               {"bones", unless_set(o.remesh.directions.bones)},
               {"curvature", unless_set(o.remesh.directions.curvature)},
               {"posed", o.remesh.directions.posed}};
  if (o.remesh.sizing)
    json["sizing"] = {{"density", density_source_name(o.remesh.sizing->density)},
                      {"largest_aspect", o.remesh.sizing->largest_aspect},
                      {"joint_weight", o.remesh.sizing->joint_weight},
                      {"least_density", o.remesh.sizing->least_density},
                      {"largest_density", o.remesh.sizing->largest_density},
                      {"gradation", o.remesh.sizing->gradation}};
  else
    json["sizing"] = nullptr;
  json["bend_degrees"] = o.remesh.bend_degrees;
  const auto& crease = o.remesh.crease_angle_radians;
  json["crease_degrees"] = crease ? Json(*crease * 180 / std::numbers::pi) : Json(nullptr);
  json["max_error"] = o.max_error;
  json["keep"] = o.keep;
  json["loops"] = o.remesh.loops.least;
  json["joint_loops"] = Json::object();
  for (const LoopOptions::OfJoint& one : o.remesh.loops.of_joints) json["joint_loops"][one.name] = one.loops;
  json["fit"] = fit_method_name(o.remesh.fit.method);
  json["influences"] = o.remesh.influences;
  json["count_tolerance"] = o.remesh.count_tolerance;
  json["solver"] = o.remesh.solver.name;
  if (is_gltf(o.input.files.mesh)) {
    json["poses"] = o.poses;
    json["select"] = o.selection.names;
    json["all"] = o.selection.unskinned;
    json["source_map"] = o.source_map;
    json["seams"] = o.seams;
    json["topology"] = o.topology;
    json["normals"] = o.normals;
  }
  const PrepareOptions& prepare = o.input.load.prepare;
  json["weld"] = prepare.weld == Weld::never ? "never" : prepare.weld == Weld::all ? "all" : "seams";
  json["weld_distance"] = prepare.weld_distance;
  json["weight_tolerance"] = prepare.weight_tolerance;
  json["strict"] = prepare.strict;
  return json;
}

Json report_json(const RemeshCommand& options, const LoadedAsset& loaded, const RemeshReport& r, double read_seconds,
                 std::span<const Warning> warnings) {
  Json report = report_head("remesh", options.input, loaded);
  report["options"] = options_json(options);
  add_remesh_figures(report, r, read_seconds, warnings);
  return report;
}

/// N, or NAME=N, in the order given.
Status read_loops(std::span<const std::string> given, LoopOptions& loops) {
  for (const std::string& one : given) {
    const std::size_t equals = one.rfind('=');
    const std::string_view number = std::string_view(one).substr(equals == std::string::npos ? 0 : equals + 1);
    Index count = 0;
    const auto [end, fault] = std::from_chars(number.data(), number.data() + number.size(), count);
    if (fault != std::errc{} || end != number.data() + number.size() || count < 0 || equals == 0)
      return Error{ErrorCode::bad_option, "is no number of loops, nor a joint with one", "--loops " + one,
                   "give a number such as 3, or NAME=5"};
    if (equals == std::string::npos)
      loops.least = count;
    else
      loops.of_joints.push_back({one.substr(0, equals), count});
  }
  return {};
}

/// \param text an angle in degrees, "none" or "flats" \fails bad_option on all else
Status set_creases(const std::string& text, RemeshOptions& options) {
  if (text == "flats") return {};
  double degrees = 180;
  if (text != "none") {
    const char* end = text.data() + text.size();
    const auto [rest, fault] = std::from_chars(text.data(), end, degrees);
    if (fault != std::errc() || rest != end || !(degrees >= 0.01 && degrees <= 180))
      return Error{ErrorCode::bad_option, "is no angle", "--creases " + text,
                   "give 0.01 to 180 degrees, none, or flats"};
  }
  options.crease_angle_radians = degrees * std::numbers::pi / 180;
  return {};
}

Status remesh_files(RemeshCommand options, Session& session) {
  const Input& input = options.input;
  const std::filesystem::path& weights_out = options.weights_out;
  const bool gltf = is_gltf(input.files.mesh);
  if (!gltf && options.output.extension() != ".obj")
    return Error{ErrorCode::bad_option,
                 "the quads of " + input.files.mesh.extension().string() + " files can only be written as OBJ",
                 options.output.string(), "give a name that ends in .obj"};
  if (gltf && (!weights_out.empty() || !input.files.rig.empty()))
    return Error{ErrorCode::bad_option, "a glTF file has its rig and weights within", input.files.mesh.string(),
                 "leave out --rig, --weights and --weights-out"};
  if (!gltf &&
      (!options.quads_out.empty() || options.poses != "bends" || options.source_map || options.selection.unskinned ||
       !options.selection.names.empty() || !options.seams || options.topology != "best" || options.normals != "auto"))
    return Error{
        ErrorCode::bad_option,
        "--quads-out, --poses, --select, --all, --source-map, --no-seams, --topology and --normals are for glTF files",
        input.files.mesh.string(), "leave them out"};
  if (!options.quads_out.empty() && options.quads_out.extension() != ".obj")
    return Error{ErrorCode::bad_option, "quads can only be written as OBJ", options.quads_out.string(),
                 "give a name that ends in .obj"};
  if (!options.map_out.empty() && (gltf || options.map_out.extension() != ".obj"))
    return Error{ErrorCode::bad_option,
                 gltf ? "--map-out is not available for glTF files" : "the map can only be written as OBJ",
                 options.map_out.string(), gltf ? "leave it out" : "give a name that ends in .obj"};
  if (!gltf && options.quads.size() > 1)
    return Error{ErrorCode::bad_option, "several counts are for glTF files", input.files.mesh.string(), "give one"};
  if (options.quads.empty() || options.quads.size() > 16)
    return Error{ErrorCode::bad_option, options.quads.empty() ? "is empty" : "are more than 16 counts", "--quads",
                 options.quads.empty() ? "give a count" : "give fewer"};
  options.remesh.quads = options.quads.front();
  options.input.quads = options.remesh.quads;
  if (!weights_out.empty() && input.files.rig.empty())
    return Error{ErrorCode::bad_option, "weights asked of an asset without a rig", weights_out.string(),
                 "give --rig and --weights"};
  const Expected<FieldPreset> preset = field_preset(options.preset);
  if (!preset) return preset.error();
  options.remesh.preset = *preset;
  if (!options.density.empty()) {
    const Expected<DensitySource> density = density_source(options.density);
    if (!density) return density.error();
    options.sizing.density = *density;
    if (*density == DensitySource::uniform && !options.aspect_given) options.sizing.largest_aspect = 1;
    options.remesh.sizing = options.sizing;
  }
  if (Status status = set_creases(options.creases, options.remesh); !status) return status;
  options.remesh.group_borders = options.keeps("groups");
  options.input.load.keep = {options.keeps("materials"), options.keeps("textures"), options.keeps("lines")};
  if (gltf && options.keeps("lines"))
    return Error{ErrorCode::bad_option, "--keep lines is for OBJ files", input.files.mesh.string(), "leave it out"};
  if (Status status = read_loops(options.loops, options.remesh.loops); !status) return status;
  if (Status status = options.remesh.validate(); !status) return status;
  if (options.input.load.bind) {
    options.input.load.bind->influences = options.remesh.influences;
    options.input.load.bind->solver = options.remesh.solver.name;
  }

  if (gltf) {
    GltfJob job;
    job.input = input.files.mesh;
    job.output = options.output;
    job.report = options.report;
    job.quads_out = options.quads_out;
    job.quads = options.quads;
    job.options.remesh = options.remesh;
    job.options.prepare = input.load.prepare;
    job.options.selection = options.selection;
    job.options.pose_source = options.poses == "clips" ? GltfPoses::clips : GltfPoses::bends;
    job.options.source_map = options.source_map;
    job.options.snap_seams = options.seams;
    // The thesis's method is that of a field.
    const bool field = options.topology == "field" || options.remesh.preset == FieldPreset::thesis;
    job.options.topology = field ? GltfTopology::field : GltfTopology::best;
    job.options.normals = options.normals == "keep"  ? GltfNormals::keep
                          : options.normals == "new" ? GltfNormals::fresh
                                                     : GltfNormals::automatic;
    job.options.most_edges_off = options.max_error;
    job.options.keep_materials = options.keeps("materials");
    job.options.keep_textures = options.keeps("textures");
    job.options_json = options_json(options);
    job.force = options.force;
    return remesh_gltf_file(job, session);
  }

  if (options.force)
    return Error{ErrorCode::bad_option, "--force is for glTF files, which name others", input.files.mesh.string(),
                 "leave it out"};
  FileSet files;
  if (Status status = declare(files, input, {options.output, options.report, weights_out}); !status) return status;
  const Stopwatch watch;
  const Expected<LoadedAsset> loaded = load(input, session);
  if (!loaded) return loaded.error();
  const double read_seconds = watch.seconds();
  options.remesh.features = loaded->features;
  options.remesh.keep_maps = !options.map_out.empty();
  const Expected<RemeshResult> result = remesh(loaded->asset, options.remesh, session.context);
  if (!result) return result.error();
  const RemeshReport& r = result->report;

  if (Status status = files.add(options.output, obj_text(result->mesh)); !status) return status;
  if (!weights_out.empty()) {
    const DmatFormat format = options.binary_weights ? DmatFormat::binary : DmatFormat::ascii;
    if (Status status = files.add(weights_out, dmat_text(*result->weights, format)); !status) return status;
  }
  if (!options.map_out.empty()) {
    if (result->maps.empty())
      return Error{ErrorCode::stage_failed, "no component has a map: all were split", options.map_out.string(),
                   "ask for more quads, or leave out --map-out"};
    if (Status status = files.add(options.map_out, map_obj_text(result->maps)); !status) return status;
  }
  if (!options.report.empty()) {
    const Json report = report_json(options, *loaded, r, read_seconds, session.context.warnings);
    if (Status status = files.add(options.report, report_text(report)); !status) return status;
  }
  if (Status status = session.commit(files); !status) return status;
  const double off = std::abs(static_cast<double>(r.quads) / options.remesh.quads - 1);
  session.in_part = options.strict_count && off > options.remesh.count_tolerance;
  const auto strays = [&](const ComponentReport& part) { return part.farthest > options.max_error * part.edge; };
  if (options.max_error > 0 && std::ranges::any_of(r.components, strays)) session.in_part = true;
  std::string line =
      options.output.string() + ": " + std::to_string(r.quads) + " quads, " + std::to_string(r.irregular) +
      " irregular vertices, scaled Jacobian " + decimals(r.scaled_jacobian_average, 3) + " on average and " +
      decimals(r.scaled_jacobian_minimum, 3) + " at least, " + decimals(read_seconds + r.seconds.total, 2) + " s";
  session.say(line);
  return {};
}

}  // namespace

void add_remesh_figures(Json& report, const RemeshReport& r, double read_seconds, std::span<const Warning> warnings) {
  report["quads"] = r.quads;
  report["vertices"] = r.vertices;
  report["irregular"] = r.irregular;
  report["scaled_jacobian"] = {{"average", r.scaled_jacobian_average}, {"minimum", r.scaled_jacobian_minimum}};
  report["minimum_count"] = r.minimum_count;
  report["components"] = Json::array();
  for (const ComponentReport& c : r.components)
    report["components"].push_back({{"faces", c.faces},
                                    {"asked", c.asked},
                                    {"quads", c.quads},
                                    {"irregular", c.irregular},
                                    {"singularities", c.singularities},
                                    {"rung", rung_name(c.rung)},
                                    {"map",
                                     {{"curl_mean", c.strain.curl_mean},
                                      {"curl_largest", c.strain.curl_largest},
                                      {"turned_mean_degrees", c.strain.turned_mean_degrees},
                                      {"turned_p95_degrees", c.strain.turned_p95_degrees},
                                      {"scaled_mean", c.strain.scaled_mean},
                                      {"scaled_p95", c.strain.scaled_p95}}},
                                    {"kept_length", c.kept_length},
                                    {"kept_as_quads", c.kept_as_quads},
                                    {"edge", c.edge},
                                    {"farthest", c.farthest},
                                    {"farthest_place", {c.farthest_place[0], c.farthest_place[1], c.farthest_place[2]}},
                                    {"share_missed", c.share_missed},
                                    {"area_ratio", c.area_ratio},
                                    {"reasons", c.reasons}});
  report["hinges"] = Json::array();
  for (const HingeReport& hinge : r.hinges)
    report["hinges"].push_back({{"joint", hinge.joint},
                                {"wanted", hinge.wanted},
                                {"loops", hinge.rings.loops},
                                {"around", hinge.rings.around},
                                {"poles", hinge.rings.poles},
                                {"quads_for", hinge.quads_for}});
  report["field"] = {{"preset", field_preset_name(r.field.preset)},
                     {"singularities_plus", r.field.singularities_plus},
                     {"singularities_minus", r.field.singularities_minus},
                     {"index_sum", r.field.index_sum},
                     {"mean_angle_to_bone_deg", r.field.mean_angle_to_bone_deg},
                     {"residual", r.field.solve.residual}};
  report["fit"] = {{"rest_before", r.fit.rest_before},    {"rest_after", r.fit.rest_after},
                   {"back_before", r.fit.back_before},    {"back_after", r.fit.back_after},
                   {"posed_before", r.fit.posed_before},  {"posed_after", r.fit.posed_after},
                   {"largest_move", r.fit.largest_move},  {"dropped_influences", r.fit.dropped_influences},
                   {"dropped_error", r.fit.dropped_error}};
  report["solvers"] = {{"field", r.backends.field},
                       {"surgery", r.backends.surgery},
                       {"target", r.backends.target},
                       {"map", r.backends.map},
                       {"untangling", r.backends.untangling}};
  report["seconds"] = {{"read", read_seconds},
                       {"metric", r.seconds.metric},
                       {"pieces", r.seconds.pieces},
                       {"field", r.seconds.field},
                       {"map", r.seconds.map},
                       {"integers", r.seconds.integers},
                       {"extraction", r.seconds.extraction},
                       {"polish", r.seconds.polish},
                       {"fit", r.seconds.fit},
                       {"transfer", r.seconds.transfer},
                       {"total", read_seconds + r.seconds.total}};
  Json all = warnings_json(warnings);
  for (const Json& warning : warnings_json(r.warnings))
    if (std::find(all.begin(), all.end(), warning) == all.end()) all.push_back(warning);
  report["warnings"] = all;
}

void add_remesh(CLI::App& app, Run& run) {
  auto options = std::make_shared<RemeshCommand>();
  RemeshOptions& remesh = options->remesh;
  CLI::App* verb = app.add_subcommand("remesh", "Quads that follow the rig, with the rig's weights");
  add_input(*verb, options->input, ".obj, .off, .ply or .stl, or a glTF file: .glb, .gltf or .vrm");
  verb->add_option("--quads", options->quads, "How many quads; of a glTF file several, one file a level of detail")
      ->required()
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N[,N…]");
  verb->add_option("-o,--output", options->output, "The quads; of a glTF file the whole file")
      ->required()
      ->type_name("OUT.obj|.glb|.gltf|.vrm");
  verb->add_option("--quads-out", options->quads_out, "The quads of a glTF file alone")->type_name("Q.obj");
  verb->add_option(
          "--map-out", options->map_out,
          "The map: its triangles with the grid of the quads as texture coordinates, cuts and singular vertices")
      ->type_name("M.obj");
  verb->add_option("--weights-out", options->weights_out, "Their skin weights")->type_name("W.dmat");
  verb->add_flag("--binary-weights", options->binary_weights, "Write the weights as binary DMAT")
      ->needs("--weights-out");
  verb->add_option("--report", options->report, "The figures as JSON (docs/report-schema.json)")->type_name("FILE");
  verb->add_option("--preset", options->preset,
                   "default: the rig's directions, sizes by how it bends; thesis: the exact energy and densities of "
                   "the thesis; static: no rig, along the curvature")
      ->check(CLI::IsMember({"default", "thesis", "static"}))
      ->option_text("default|thesis|static = default");
  verb->add_option("--creases", options->creases,
                   "Edges that bend more than this stay edges, degrees; flats: the sharp ones of parts made of flat "
                   "sides, without a rig; none")
      ->option_text("ANGLE|flats|none = flats");
  verb->add_option("--keep", options->keep,
                   "Borders that become edges of quads: of materials, of texture islands, of the vertex groups of the "
                   "rig (where another bone's weight becomes the largest), and what the OBJ draws as lines")
      ->delimiter(',')
      ->check(CLI::IsMember({"materials", "textures", "groups", "lines"}))
      ->allow_extra_args(false)
      ->type_name("materials|textures|groups|lines[,…]");
  verb->add_option(
          "--loops", options->loops,
          "Closed rings of quads round each joint that bends a limb, at least, where the count allows; for some "
          "joints by name, in which * stands for anything: --loops 3,elbow.L=5,'*knee*=4'")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->option_text("N|NAME=N[,…] = 3");
  verb->add_option_function<std::string>(
          "--fit", [&remesh](const std::string& name) { remesh.fit.method = *fit_method(name); },
          "Where vertices go: surface: off the surface, where flat quads are nearest to it at rest and bent; slide: "
          "along "
          "the surface; none: where quads are most even")
      ->check(CLI::IsMember({"surface", "subdivision", "slide", "none"}))
      ->option_text("surface|subdivision|slide|none = surface");
  verb->add_option("--influences", remesh.influences, "Most weights that a vertex keeps")
      ->capture_default_str()
      ->type_name("N");

  const std::string group = "Directions and sizes (where not given, the preset's; thesis takes its own directions)";
  const auto pull = [&](const std::string& name, std::optional<double>& place, const std::string& text) {
    verb->add_option_function<double>(
            name, [&place](const double& value) { place = value; }, text)
        ->check(CLI::NonNegativeNumber)
        ->type_name("WEIGHT")
        ->group(group);
  };
  pull("--bones", remesh.directions.bones, "Pull of the bones on the directions");
  pull("--curvature", remesh.directions.curvature, "Pull of the curvature at rest");
  verb->add_option("--posed", remesh.directions.posed, "Pull of the curvature over the poses")
      ->check(CLI::NonNegativeNumber)
      ->type_name("WEIGHT")
      ->group(group);
  auto* density = verb->add_option("--density", options->density, "What decides the size of a quad");
  density->check(CLI::IsMember({"uniform", "field", "blend", "rest", "posed"}))
      ->option_text("uniform|field|blend|rest|posed")
      ->group(group);
  const auto size = [&](const std::string& name, double& place, const std::string& text) {
    return verb->add_option(name, place, text)->needs(density)->capture_default_str()->type_name("X")->group(group);
  };
  size("--aspect", options->sizing.largest_aspect, "Longest over shortest side, at most")
      ->each([options](const std::string&) { options->aspect_given = true; });
  size("--joint-weight", options->sizing.joint_weight, "How much more an error counts where weights blend");
  size("--least-density", options->sizing.least_density, "Of the mean");
  size("--largest-density", options->sizing.largest_density, "Of the mean");
  size("--gradation", options->sizing.gradation, "Change of size over one quad, at most");
  verb->add_option("--bend", remesh.bend_degrees, "The poses: every bone bent by this both ways, degrees")
      ->capture_default_str()
      ->type_name("ANGLE")
      ->group(group);
  verb->add_option("--poses", options->poses, "Of a glTF file: bend every joint, or sample its own clips")
      ->check(CLI::IsMember({"bends", "clips"}))
      ->option_text("bends|clips = bends")
      ->group(group);

  const std::string parts = "Parts of a glTF file";
  verb->add_option("--select", options->selection.names,
                   "Only these: a name or regular expression of a mesh, node, material or skin; may be repeated")
      ->allow_extra_args(false)
      ->type_name("NAME")
      ->group(parts);
  verb->add_flag("--all", options->selection.unskinned, "Meshes that no skin moves too")->group(parts);
  verb->add_flag("--source-map", options->source_map, "Each vertex tells where it lies on the input, as _SOURCE")
      ->group(parts);

  verb->add_flag("!--no-seams", options->seams, "Do not move edges of quads onto the seams of textures and materials")
      ->group(parts);

  add_force(*verb, options->force);
  verb->get_option("--force")->group(parts);
  verb->add_option("--topology", options->topology,
                   "best: of each shell what lies nearest, the input's own quads with fewer rows or quads of a field; "
                   "field: quads of a field wherever there is room")
      ->check(CLI::IsMember({"best", "field"}))
      ->option_text("best|field = best")
      ->group(parts);
  verb->add_option("--normals", options->normals,
                   "Of new vertices: keep: the file's, carried over; new: those of the new faces, parted where the "
                   "file's part; auto: kept on shells where they are not those of the faces")
      ->check(CLI::IsMember({"auto", "keep", "new"}))
      ->option_text("auto|keep|new = auto")
      ->group(parts);
  verb->add_option("--max-error", options->max_error,
                   "The exit code is 9 where a part lies farther than this many edges of its quads from them; 0: never")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->type_name("EDGES");

  const std::string expert = "For experts";
  verb->add_option("--count-tolerance", remesh.count_tolerance, "How far off the count may be")
      ->capture_default_str()
      ->type_name("SHARE")
      ->group(expert);
  verb->add_flag("--strict-count", options->strict_count,
                 "The exit code is 9 where the count is off by more than the tolerance")
      ->group(expert);
  verb->add_option("--solver", remesh.solver.name, "Linear solver")
      ->capture_default_str()
      ->type_name("NAME")
      ->group(expert);
  verb->footer(R"(Examples:
  quadrig remesh arm.obj --rig arm.tgf --weights arm.dmat --quads 2000 -o quads.obj --weights-out quads.dmat
  quadrig remesh knight.glb --quads 4000 -o quads.glb --quads-out quads.obj
  quadrig remesh knight.glb --quads 8000,4000,2000 -o knight.glb    (knight_LOD0.glb, knight_LOD1.glb, knight_LOD2.glb)
  quadrig remesh crate.glb --quads 500 --select 'Crate.*' -o quads.glb
  quadrig remesh bunny.off --quads 5000 -o quads.obj --report report.json
  quadrig remesh fandisk.off --quads 3000 --creases 40 -o quads.obj
  quadrig remesh crate.obj --quads 3000 --keep materials,textures -o quads.obj
  quadrig remesh arm.obj --rig arm.tgf --weights arm.dmat --quads 2000 --density posed --joint-weight 8 -o quads.obj

On an error nothing is written, the reason is one line, and the exit code tells its kind: see quadrig --help.)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return remesh_files(*options, session); }; });
}

}  // namespace quadrig::cli
