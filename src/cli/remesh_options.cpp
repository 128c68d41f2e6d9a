// The options of quadrig remesh.
#include "remesh_command.hpp"

namespace quadrig::cli {
namespace {

/// What `--for` stands for: options where they are not given. Nothing else looks at a bundle.
struct Bundle {
  std::string_view name;
  std::vector<std::pair<const char*, const char*>> options;
};
const std::vector<Bundle>& bundles() {
  static const std::vector<Bundle> all{
      {"game", {{"--symmetry", "auto"}, {"--fit", "surface"}, {"--influences", "4"}}},
      {"film", {{"--symmetry", "auto"}, {"--fit", "subdivision"}, {"--influences", "8"}}},
      {"lod",
       {{"--symmetry", "none"},
        {"--fit", "surface"},
        {"--topology", "best"},
        {"--loops", "0"},
        {"--rims", "none"},
        {"--influences", "4"}}},
      {"scan", {{"--preset", "static"}, {"--density", "rest"}, {"--symmetry", "none"}}},
  };
  return all;
}
void apply_bundle(CLI::App& verb, std::string_view name) {
  for (const Bundle& bundle : bundles()) {
    if (bundle.name != name) continue;
    for (const auto& [option, value] : bundle.options) {
      CLI::Option& place = *verb.get_option(option);
      if (place.count() > 0) continue;
      place.add_result(value);
      place.run_callback();
    }
  }
}

/// NAME=FACTOR, as often as it is given. \throws CLI::ValidationError
void add_factors(CLI::App& verb, const std::string& option, std::vector<NamedFactor>& place, const std::string& text,
                 const std::string& group = {}) {
  CLI::Option* added = verb.add_option_function<std::vector<std::string>>(
      option,
      [&place, option](const std::vector<std::string>& all) {
        for (const std::string& each : all) {
          const std::size_t equals = each.rfind('=');
          double factor = 0;
          const bool sound =
              equals != std::string::npos && equals > 0 && CLI::detail::lexical_cast(each.substr(equals + 1), factor);
          if (!sound) throw CLI::ValidationError(option, each + " is no NAME=FACTOR, such as head=2");
          place.push_back({each.substr(0, equals), factor});
        }
      },
      text);
  added->allow_extra_args(false)->type_name("NAME=FACTOR");
  if (!group.empty()) added->group(group);
}

}  // namespace

void add_remesh(CLI::App& app, Run& run) {
  auto options = std::make_shared<RemeshCommand>();
  RemeshOptions& remesh = options->remesh;
  CLI::App* verb = app.add_subcommand("remesh", "Quads that follow the rig, with the rig's weights");
  add_input(*verb, options->input, ".obj, .off, .ply or .stl, or a glTF file: .glb, .gltf or .vrm");
  const std::string files = "Other files", edges = "Where edges run", sizes = "Where quads are small";

  // The twelve that most need.
  verb->add_option("--quads", options->quads, "How many quads; of a glTF file several, one file a level of detail")
      ->required()
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N[,N…]");
  verb->add_option("-o,--output", options->output, "The quads; of a glTF file the whole file")
      ->required()
      ->type_name("OUT.obj|.glb|.gltf|.vrm");
  verb->add_option("--for", options->bundle,
                   "What the quads are for: sets the options that docs/command.md lists, where they are not given")
      ->check(CLI::IsMember({"game", "film", "lod", "scan"}))
      ->option_text("game|film|lod|scan");
  verb->add_option_function<std::string>(
          "--symmetry",
          [options](const std::string& name) {
            if (const Expected<SymmetryChoice> choice = symmetry_choice(name)) options->remesh.symmetry = *choice;
          },
          "The same quads on both sides of a mirror plane: auto finds it, x, y or z is the axis it lies across, none "
          "leaves each side to itself. With a rig auto, else none")
      ->check(CLI::IsMember({"auto", "x", "y", "z", "none"}))
      ->option_text("auto|x|y|z|none");
  add_factors(*verb, "--bone-density", options->bone_density,
              "So many times as many quads on what a bone moves, the count being the same: head=2; * stands for any "
              "letters; may be repeated");
  CLI::Option* guides = verb->add_option("--guides", options->guides,
                                         "Curves that edges follow: the lines (l) of an OBJ, drawn on the surface")
                            ->type_name("FILE.obj");
  verb->add_option(
          "--loops", options->loops,
          "Closed rings of quads round each joint that bends a limb, at least, where the count allows; for some "
          "joints by name, in which * stands for anything: --loops 3,elbow.L=5,'*knee*=4'")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->option_text("N|NAME=N[,…] = 3");
  verb->add_option("--rims", options->rims,
                   "Closed rings of quads round openings: auto: round eyes and mouth, with a rig; or kinds of those "
                   "that quadrig rims finds, eyes,mouth,nostrils,ears,pockets; or closed lines of an OBJ")
      ->option_text("auto|none|KIND[,…]|FILE.obj = auto");
  verb->add_option_function<std::string>(
          "--fit", [&remesh](const std::string& name) { remesh.fit.method = *fit_method(name); },
          "Where vertices go: surface: off the surface, where flat quads are nearest to it at rest and bent; "
          "subdivision: where the surface is nearest that subdividing them makes; slide: along the surface; none: "
          "where quads are most even")
      ->check(CLI::IsMember({"surface", "subdivision", "slide", "none"}))
      ->option_text("surface|subdivision|slide|none = surface");
  verb->add_option("--influences", remesh.influences, "Most bones that move a vertex")
      ->capture_default_str()
      ->type_name("N");
  verb->add_option("--report", options->report, "The figures as JSON (docs/report-schema.json)")->type_name("FILE");

  verb->get_option("--bind")->group(files);
  verb->add_option("--weights-out", options->weights_out, "The skin weights of the quads")
      ->type_name("W.dmat")
      ->group(files);
  verb->add_flag("--binary-weights", options->binary_weights, "Write the weights as binary DMAT")
      ->needs("--weights-out")
      ->group(files);
  verb->add_option("--quads-out", options->quads_out, "The quads of a glTF file alone")
      ->type_name("Q.obj")
      ->group(files);
  verb->add_option(
          "--map-out", options->map_out,
          "The map: its triangles with the grid of the quads as texture coordinates, cuts and singular vertices")
      ->type_name("M.obj")
      ->group(files);

  verb->add_option("--creases", options->creases,
                   "Edges that bend more than this stay edges, degrees; flats: the sharp ones of parts made of flat "
                   "sides, without a rig; none")
      ->option_text("ANGLE|flats|none = flats")
      ->group(edges);
  verb->add_option("--keep", options->keep,
                   "Borders that become edges of quads: of materials, of texture islands, of the vertex groups of the "
                   "rig (where another bone's weight becomes the largest), what the OBJ draws as lines, and every hole "
                   "and notch of open borders, however small (else those smaller than a quad are bridged)")
      ->delimiter(',')
      ->check(CLI::IsMember({"materials", "textures", "groups", "lines", "borders"}))
      ->allow_extra_args(false)
      ->type_name("materials|textures|groups|lines|borders[,…]")
      ->group(edges);
  verb->add_option("--fill-holes", remesh.fill_holes, "Close holes and open ends that are at most so long around")
      ->check(CLI::NonNegativeNumber)
      ->type_name("LENGTH")
      ->group(edges);
  verb->add_option("--guide-width", options->guide_width,
                   "Guides do not become edges, but pull at the directions of edges within this length of them")
      ->check(CLI::NonNegativeNumber)
      ->needs(guides)
      ->type_name("LENGTH")
      ->group(edges);
  verb->add_option("--guide-weight", options->guide_weight, "How much they pull then; a bone pulls by 1")
      ->check(CLI::PositiveNumber)
      ->needs(guides)
      ->capture_default_str()
      ->type_name("WEIGHT")
      ->group(edges);
  verb->add_option("--preset", options->preset,
                   "default: the rig's directions, sizes by how it bends; thesis: the exact energy and densities of "
                   "the thesis; static: no rig, along the curvature")
      ->check(CLI::IsMember({"default", "thesis", "static"}))
      ->option_text("default|thesis|static = default")
      ->group(edges);
  const auto pull = [&](const std::string& name, std::optional<double>& place, const std::string& text) {
    verb->add_option_function<double>(
            name, [&place](const double& value) { place = value; }, text)
        ->check(CLI::NonNegativeNumber)
        ->type_name("WEIGHT")
        ->group(edges);
  };
  pull("--bones", remesh.directions.bones, "Pull of the bones on the directions");
  pull("--curvature", remesh.directions.curvature, "Pull of the curvature at rest");
  verb->add_option("--curl", remesh.curl_rounds,
                   "Rounds of moving directions and sizes towards those of a map, so that the map turns them less; 5 "
                   "are enough")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str()
      ->type_name("ROUNDS")
      ->group(edges);
  verb->add_option("--posed", remesh.directions.posed, "Pull of the curvature over the poses")
      ->check(CLI::NonNegativeNumber)
      ->type_name("WEIGHT")
      ->group(edges);

  add_factors(*verb, "--material-density", options->material_density,
              "So many times as many quads on a material; may be repeated", sizes);
  verb->add_option("--face-density", remesh.rims.face_density,
                   "So many times as many quads about eyes and mouth, the count being the same")
      ->capture_default_str()
      ->type_name("X")
      ->group(sizes);
  verb->add_flag("--density-colors", options->density_colors,
                 "Colours of vertices say how many quads: red four times as many, cyan a quarter, grey as many")
      ->group(sizes);
  auto* density = verb->add_option("--density", options->density,
                                   "What decides the size of a quad: uniform: nothing; rest: how the surface curves; "
                                   "posed: how it curves when bent; blend: where weights blend; field: the thesis's");
  density->check(CLI::IsMember({"uniform", "field", "blend", "rest", "posed"}))
      ->option_text("uniform|field|blend|rest|posed")
      ->group(sizes);
  const auto size = [&](const std::string& name, double& place, const std::string& text) {
    return verb->add_option(name, place, text)->needs(density)->capture_default_str()->type_name("X")->group(sizes);
  };
  size("--aspect", options->sizing.largest_aspect, "Longest over shortest side of a quad, at most")
      ->each([options](const std::string&) { options->aspect_given = true; });
  size("--joint-weight", options->sizing.joint_weight, "How much more an error counts where weights blend");
  size("--least-density", options->sizing.least_density, "Fewest quads anywhere, of the mean");
  size("--largest-density", options->sizing.largest_density, "Most quads anywhere, of the mean");
  size("--gradation", options->sizing.gradation, "Change of size over one quad, at most");
  verb->add_option("--bend", remesh.bend_degrees, "The poses: every bone bent by this both ways, degrees")
      ->capture_default_str()
      ->type_name("ANGLE")
      ->group(sizes);
  verb->add_option("--directions", options->directions,
                   "Of a glTF file: bones give directions at rest, or averaged over the poses of its clips, where the "
                   "rest pose is bad")
      ->check(CLI::IsMember({"rest", "clips"}))
      ->option_text("rest|clips = rest")
      ->group(edges);
  verb->add_option("--poses", options->poses, "Of a glTF file: bend every joint, or sample its own clips")
      ->check(CLI::IsMember({"bends", "clips"}))
      ->option_text("bends|clips = bends")
      ->group(sizes);

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
  verb->callback([options, verb, &run] {
    apply_bundle(*verb, options->bundle);
    run = [options](Session& session) { return remesh_files(*options, session); };
  });
}

}  // namespace quadrig::cli
