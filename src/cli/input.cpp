// What goes in: the options that name it, and the asset that they stand for.
#include <array>
#include <fstream>

#include "command.hpp"

namespace quadrig::cli {

bool is_gltf(const std::filesystem::path& path) {
  if (gltf_container(path)) return true;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;  // what is read from a pipe is gone
  std::ifstream file(path, std::ios::binary);
  char magic[4] = {};
  if (!file.read(magic, 4)) return false;
  // No surface file without an extension begins like JSON.
  return std::string_view(magic, 4) == "glTF" || (path.extension().empty() && magic[0] == '{');
}

CLI::Option* add_bind_method(CLI::App& verb, const std::string& name, std::function<void(BindMethod)> set,
                             const std::string& text) {
  return verb
      .add_option_function<std::string>(
          name,
          [set = std::move(set)](const std::string& given) {
            for (const BindMethod method :
                 {BindMethod::nearest_bone, BindMethod::geodesic_voxel, BindMethod::bounded_biharmonic})
              if (given == bind_method_name(method)) set(method);
          },
          text)
      ->check(CLI::IsMember({"voxel", "biharmonic", "nearest"}));
}

void add_input(CLI::App& verb, Input& input, const std::string& formats) {
  verb.add_option("MESH", input.files.mesh, "Surface: " + formats + "; -: standard input")
      ->required()
      ->transform(standard_input())
      ->type_name("");
  auto* rig = verb.add_option("--rig", input.files.rig, "Bones: .tgf")->transform(standard_input())->type_name("FILE");
  auto* weights = verb.add_option("--weights", input.files.weights, "Skin weights, a column a bone: .dmat");
  weights->transform(standard_input())->type_name("FILE");
  weights->needs(rig);
  add_bind_method(
      verb, "--bind", [&input](BindMethod method) { input.load.bind.emplace().method = method; },
      "Make the weights of a rig that comes without")
      ->needs(rig)
      ->excludes(weights)
      ->option_text("voxel|biharmonic|nearest (needs --rig, excludes --weights)");
  const std::string group = "Input repair";
  verb.add_flag("--strict", input.load.prepare.strict, "Refuse an input that needs repair")->group(group);
  verb.add_option("--weld", input.load.prepare.weld, "Which vertices at one position become one")
      ->transform(CLI::CheckedTransformer(
          std::vector<std::pair<std::string, Weld>>{{"never", Weld::never}, {"seams", Weld::seams}, {"all", Weld::all}},
          CLI::ignore_case))
      ->option_text("never|seams|all = seams")
      ->group(group);
  verb.add_option("--weld-distance", input.load.prepare.weld_distance, "Positions at most this far apart are one")
      ->type_name("LENGTH")
      ->group(group);
  verb.add_option("--weight-tolerance", input.load.prepare.weight_tolerance,
                  "Weights whose sum is off by at most this are rescaled")
      ->type_name("SHARE")
      ->capture_default_str()
      ->group(group);
}

void add_selection(CLI::App& verb, GltfSelection& selection, const std::string& text, const std::string& group) {
  CLI::Option* option = verb.add_option("--select", selection.names, text);
  option->allow_extra_args(false)->type_name("NAME");
  if (!group.empty()) option->group(group);
}

namespace {

/// The largest of the surfaces chosen, with its rig.
Expected<LoadedAsset> load_gltf(const Input& input, FileSet& files, Session& session) {
  const std::filesystem::path& path = input.files.mesh;
  if (!input.files.rig.empty())
    return Error{ErrorCode::bad_option, "a glTF file has its rig and weights within", path.string(),
                 "leave out --rig and what goes with it"};
  const Expected<GltfDocument> document = read_document(path, files, session);
  if (!document) return document.error();
  std::vector<std::filesystem::path> read = document->named_files();
  read.push_back(path);
  session.expect(read, input.quads);
  GltfClipOptions clips;
  clips.enabled = input.clips;
  Expected<std::vector<GltfSurface>> surfaces =
      gltf_surfaces(*document, input.load.prepare, clips, session.context, input.selection);
  if (!surfaces) return surfaces.error();
  const auto area = [](const GltfSurface& one) {
    return one.asset.mesh.total_area() * one.world_scale * one.world_scale;
  };
  const auto largest = std::max_element(surfaces->begin(), surfaces->end(),
                                        [&](const auto& a, const auto& b) { return area(a) < area(b); });
  if (surfaces->size() > 1)
    session.context.warn("read", path.string() + " has " + std::to_string(surfaces->size()) + " surfaces: only " +
                                     largest->label() + " is looked at; --select takes others");
  LoadedAsset loaded;
  loaded.asset = std::move(largest->asset);
  loaded.report = std::move(largest->prepared);
  return loaded;
}

}  // namespace

Expected<GltfDocument> read_document(const std::filesystem::path& path, FileSet& files, Session& session) {
  Expected<GltfDocument> document = GltfDocument::read(path, {}, session.context);
  if (!document) return document.error();
  for (const std::filesystem::path& file : document->named_files())
    if (Status status = files.reads(file); !status) return status.error();
  return document;
}

Expected<LoadedAsset> load(const Input& input, FileSet& files, Session& session) {
  if (is_gltf(input.files.mesh)) return load_gltf(input, files, session);
  if (!input.selection.names.empty())
    return Error{ErrorCode::bad_option, "--select is for glTF files", input.files.mesh.string(), "leave it out"};
  session.context.progress("read", 0);
  session.expect(std::array{input.files.mesh, input.files.rig, input.files.weights}, input.quads);
  return load_asset(input.files, input.load, session.context);
}

Json report_head(std::string_view verb, const Input& input, const LoadedAsset& loaded) {
  Json report;
  report["quadrig"] = QUADRIG_VERSION;
  report["verb"] = verb;
  Json& in = report["input"];
  in["mesh"] = input.files.mesh.string();
  if (!input.files.rig.empty()) {
    in["rig"] = input.files.rig.string();
    if (input.load.bind)
      in["bind"] = bind_method_name(input.load.bind->method);
    else
      in["weights"] = input.files.weights.string();
  }
  in["vertices"] = loaded.asset.mesh.vertex_count();
  in["faces"] = loaded.asset.mesh.face_count();
  in["bones"] = loaded.asset.rig ? loaded.asset.rig->skeleton.bone_count() : 0;
  in["components"] = loaded.report.components;
  in["closed"] = loaded.asset.mesh.closed();
  in["doubled_vertices"] = loaded.report.doubled_vertices;
  in["repairs"] = loaded.report.repairs();
  return report;
}

Status declare(FileSet& files, const Input& input, std::initializer_list<std::filesystem::path> outputs) {
  files.standard_output = true;
  for (const auto& path : {input.files.mesh, input.files.rig, input.files.weights})
    if (Status status = files.reads(path); !status) return status;
  for (const auto& path : outputs)
    if (!path.empty())
      if (Status status = files.writes(path); !status) return status;
  return {};
}

}  // namespace quadrig::cli
