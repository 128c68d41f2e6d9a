// quadrig sample: rigged meshes made by code.
#include "command.hpp"
#include "quadrig/gltf.hpp"
#include "quadrig/samples.hpp"

namespace quadrig::cli {
namespace {

struct SampleCommand {
  std::string name;
  std::filesystem::path output;
  Index triangles = 20000;
};

Status sample(const SampleCommand& options, Session& session) {
  const auto place = [&](const char* extension) { return options.output / (options.name + extension); };
  FileSet files;
  files.standard_output = true;
  if (const auto container = gltf_container(options.output)) {
    Expected<std::string> bytes = make_sample_glb(options.name, options.triangles, session.context);
    if (!bytes) return bytes.error();
    const auto document = GltfDocument::parse(std::move(*bytes), options.name + ".glb", {}, session.context);
    if (!document) return document.error();
    if (Status s = document->add_to(files, options.output, session.context); !s) return s;
    if (Status s = session.commit(files); !s) return s;
    session.say(options.output.string());
    return {};
  }
  files.make_folder(options.output);
  const Expected<Asset> asset = make_sample(options.name, options.triangles, session.context);
  if (!asset) return asset.error();
  if (Status s = files.add(place(".obj"), obj_text(asset->mesh.positions(), asset->mesh.faces())); !s) return s;
  if (Status s = files.add(place(".tgf"), tgf_text(asset->rig->skeleton)); !s) return s;
  if (Status s = files.add(place(".dmat"), dmat_text(asset->rig->weights)); !s) return s;
  if (Status s = session.commit(files); !s) return s;
  session.say(place(".obj").string() + ", .tgf, .dmat: " + std::to_string(asset->mesh.face_count()) + " triangles, " +
              std::to_string(asset->rig->skeleton.bone_count()) + " bones");
  return {};
}

}  // namespace

void add_sample(CLI::App& app, Run& run) {
  auto options = std::make_shared<SampleCommand>();
  std::string names, footer = "Samples:\n";
  for (const SampleInfo& info : sample_infos()) {
    names += (names.empty() ? "" : "|") + std::string(info.name);
    footer += "  " + std::string(info.name) + std::string(12 - info.name.size(), ' ') + std::string(info.description) +
              " (" + std::to_string(info.bones) + " bones)\n";
  }
  CLI::App* verb =
      app.add_subcommand("sample", "Write a rigged mesh made by code: NAME.obj, NAME.tgf, NAME.dmat, or one glTF file");
  verb->add_option("NAME", options->name, names)->required()->type_name("");
  verb->add_option("-o,--output", options->output, "Folder, made where it is not there, or a .glb or .gltf file")
      ->required()
      ->type_name("DIR");
  verb->add_option("--triangles", options->triangles, "About how many, 500 to 4000000")
      ->capture_default_str()
      ->type_name("N");
  verb->footer(footer + R"(
Examples:
  quadrig sample pear -o demo
  quadrig sample humanoid -o demo --triangles 100000
  quadrig sample head -o head.glb)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return sample(*options, session); }; });
}

}  // namespace quadrig::cli
