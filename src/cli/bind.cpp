// quadrig bind: the weights of the input itself.
#include "command.hpp"
#include "quadrig/quality/deformation.hpp"

namespace quadrig::cli {
namespace {

struct BindCommand {
  Input input;
  BindOptions bind;
  std::filesystem::path output, report;
  bool binary = false;
};

Status bind(const BindCommand& options, Session& session) {
  Input input = options.input;
  input.load.bind = options.bind;
  if (is_gltf(input.files.mesh))
    return Error{ErrorCode::bad_option, "a glTF file has its weights within", input.files.mesh.string(),
                 "give an .obj, .off, .ply or .stl"};
  if (!goes_to(options.output, ".dmat"))
    return Error{ErrorCode::bad_option, "weights are written as DMAT alone", options.output.string(),
                 "name a .dmat file"};
  FileSet files;
  if (Status status = declare(files, input, {options.output, options.report}); !status) return status;
  const Expected<LoadedAsset> loaded = load(input, files, session);
  if (!loaded) return loaded.error();
  const Asset& asset = loaded->asset;
  // Every vertex of the file has a row, those too that were welded or belong to no face.
  const Expected<PolygonMesh> file = read_surface(input.files.mesh, input.load.limits, session.context);
  if (!file) return file.error();
  const Expected<SkinWeights> weights = closest_weights(asset.mesh, asset.rig->weights, file->positions);
  if (!weights) return weights.error();

  std::vector<double> sum(static_cast<std::size_t>(asset.rig->skeleton.bone_count()), 0.0);
  Index most = 0;
  for (Index v = 0; v < weights->rows(); ++v) {
    Index own = 0;
    for (SkinWeights::InnerIterator it(*weights, v); it; ++it, ++own)
      sum[static_cast<std::size_t>(it.col())] += it.value();
    most = std::max(most, own);
  }
  Json report = report_head("bind", input, *loaded);
  report["options"] = {{"method", bind_method_name(options.bind.method)},
                       {"influences", options.bind.influences},
                       {"resolution", options.bind.resolution},
                       {"stiffness", options.bind.stiffness},
                       {"smoothing", options.bind.smoothing}};
  report["rows"] = weights->rows();
  report["most_influences"] = most;
  Index idle = 0;
  for (std::size_t b = 0; b < sum.size(); ++b) {
    report["bones"].push_back(
        {{"name", asset.rig->skeleton.bones[b].name},
         {"mean_weight", sum[b] / static_cast<double>(std::max<Eigen::Index>(weights->rows(), 1))}});
    idle += sum[b] > 0 ? 0 : 1;
  }
  report["bones_without_weight"] = idle;
  report["warnings"] = warnings_json(session.context.warnings);

  const std::string text = dmat_text(*weights, options.binary ? DmatFormat::binary : DmatFormat::ascii);
  if (Status status = files.add(options.output, text); !status) return status;
  if (!options.report.empty())
    if (Status status = files.add(options.report, report_text(report, session)); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  session.say(options.output.string() + ": " + std::to_string(weights->rows()) + " vertices, " +
              std::to_string(weights->cols()) + " bones" +
              (idle > 0 ? " (" + std::to_string(idle) + " of them without weight)" : "") + ", at most " +
              std::to_string(most) + " a vertex");
  return {};
}

}  // namespace

void add_bind(CLI::App& app, Run& run) {
  auto options = std::make_shared<BindCommand>();
  CLI::App* verb = app.add_subcommand("bind", "Make skin weights for a surface and its bones");
  add_input(*verb, options->input, ".obj, .off, .ply or .stl");
  verb->remove_option(verb->get_option("--weights"));
  verb->remove_option(verb->get_option("--bind"));
  verb->get_option("--rig")->required();
  verb->add_option("-o,--output", options->output, "A row a vertex of MESH, a column a bone: .dmat")
      ->required()
      ->type_name("W.dmat");
  add_bind_method(
      *verb, "--method", [options](BindMethod method) { options->bind.method = method; },
      "voxel: falls off with the distance within the body; biharmonic: the smoothest through it; nearest: the "
      "nearest bone alone")
      ->option_text("voxel|biharmonic|nearest = voxel");
  verb->add_option("--influences", options->bind.influences, "Most bones that move a vertex")
      ->capture_default_str()
      ->type_name("N");
  verb->add_option("--resolution", options->bind.resolution,
                   "Cells along the longest side of the body; biharmonic takes at most half as many")
      ->capture_default_str()
      ->type_name("N");
  verb->add_option("--stiffness", options->bind.stiffness, "0: broad, soft blends; 1: each bone keeps to itself")
      ->capture_default_str()
      ->type_name("X");
  verb->add_option("--smoothing", options->bind.smoothing, "Weights are smoothed along the surface over so many cells")
      ->capture_default_str()
      ->type_name("CELLS");
  verb->add_option("--solver", options->bind.solver, "Linear solver, for biharmonic")
      ->capture_default_str()
      ->type_name("NAME");
  verb->add_flag("--binary-weights", options->binary, "Write binary DMAT");
  verb->add_option("--report", options->report, "Write the figures as JSON")->type_name("FILE");
  verb->footer(R"(Examples:
  quadrig bind body.obj --rig body.tgf -o body.dmat
  quadrig bind hand.obj --rig hand.tgf --method biharmonic --influences 8 -o hand.dmat)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return bind(*options, session); }; });
}

}  // namespace quadrig::cli
