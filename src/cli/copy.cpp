// quadrig copy: a glTF file through the lossless layer.
#include "command.hpp"
#include "quadrig/gltf/document.hpp"

namespace quadrig::cli {
namespace {

struct CopyCommand {
  std::filesystem::path input, output;
  bool force = false;
};

Status copy(const CopyCommand& options, Session& session) {
  Input input;
  input.files.mesh = options.input;
  FileSet files;
  files.replaces_beside = options.force;
  if (Status status = declare(files, input, {options.output}); !status) return status;
  const Expected<GltfDocument> document = GltfDocument::read(options.input, {}, session.context);
  if (!document) return document.error();
  if (Status status = document->declare(files, options.output); !status) return status;
  if (Status status = document->add_to(files, options.output, session.context); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  session.say(options.output.string() + ": copied");
  return {};
}

}  // namespace

void add_copy(CLI::App& app, Run& run) {
  auto options = std::make_shared<CopyCommand>();
  CLI::App* verb = app.add_subcommand("copy", "A glTF file as it is, or from .glb to .gltf and back");
  verb->add_option("IN", options->input, "A .glb or .gltf file; -: standard input")
      ->required()
      ->transform(standard_input())
      ->type_name("");
  verb->add_option("OUT", options->output, "The same, .glb or .gltf; -: .glb to standard output")
      ->required()
      ->type_name("");
  add_force(*verb, options->force);
  verb->footer(
      R"(Within one container the copy is the same bytes; buffers and images that the file names go with it into
another folder. From .glb to .gltf the binary chunk becomes a file beside it, from .gltf to .glb the first buffer becomes
the binary chunk.

Examples:
  quadrig copy knight.glb copies/knight.glb
  quadrig copy knight.glb copies/knight.gltf)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return copy(*options, session); }; });
}

}  // namespace quadrig::cli
