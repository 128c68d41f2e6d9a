// quadrig pose: a surface or its quads as bones or a clip move them.
#include <algorithm>
#include <charconv>
#include <cmath>

#include "command.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig::cli {
namespace {

struct PoseCommand {
  Input input;
  std::vector<std::string> bones, axes;
  std::vector<double> angles;
  std::string clip, skinning = "linear";
  double time_seconds = 0;
  std::filesystem::path output;
};

/// What is posed, with the rig that moves it.
struct Posed {
  PolygonMesh mesh;
  Rig rig;
};

Expected<Posed> read_files(const Input& input, Session& session) {
  const AssetFiles& names = input.files;
  session.expect(std::array{names.mesh, names.rig, names.weights}, 0);
  if (names.rig.empty())
    return Error{ErrorCode::bad_option, "has no bones", names.mesh.string(), "give --rig and --weights"};
  Expected<PolygonMesh> mesh = read_surface(names.mesh, input.load.limits, session.context);
  if (!mesh) return mesh.error();
  Expected<Skeleton> skeleton = read_tgf(names.rig, input.load.limits, session.context);
  if (!skeleton) return skeleton.error();
  Expected<Eigen::MatrixXd> weights = read_dmat(names.weights, input.load.limits, &session.context);
  if (!weights) return weights.error();
  if (weights->rows() != mesh->vertex_count() || weights->cols() != skeleton->bone_count())
    return Error{ErrorCode::bad_input,
                 "has " + std::to_string(weights->rows()) + " rows and " + std::to_string(weights->cols()) +
                     " columns, where " + names.mesh.string() + " has " + std::to_string(mesh->vertex_count()) +
                     " vertices and " + names.rig.string() + " has " + std::to_string(skeleton->bone_count()) +
                     " bones",
                 names.weights.string(), "give the weights of this mesh and rig"};
  return Posed{std::move(*mesh), {std::move(*skeleton), weights->sparseView(), {}}};
}

Expected<Posed> read_gltf(const Input& input, FileSet& files, Session& session) {
  Expected<LoadedAsset> loaded = load(input, files, session);
  if (!loaded) return loaded.error();
  if (!loaded->asset.rig)
    return Error{ErrorCode::bad_input, "has no bones", input.files.mesh.string(), "select a mesh that a skin moves"};
  Posed posed;
  posed.mesh.positions = loaded->asset.mesh.positions();
  for (Index f = 0; f < loaded->asset.mesh.face_count(); ++f) {
    const auto& faces = loaded->asset.mesh.faces();
    posed.mesh.add_polygon(std::array{faces(f, 0), faces(f, 1), faces(f, 2)});
  }
  posed.rig = std::move(*loaded->asset.rig);
  return posed;
}

/// x, y, z or three numbers. \fails bad_option
Expected<Vector3> axis_of(const std::string& text) {
  if (text == "x") return Vector3(Vector3::UnitX());
  if (text == "y") return Vector3(Vector3::UnitY());
  if (text == "z") return Vector3(Vector3::UnitZ());
  Vector3 axis = Vector3::Zero();
  const char *at = text.data(), *end = at + text.size();
  bool sound = true;
  for (int k = 0; k < 3 && sound; ++k) {
    if (k > 0) sound = at != end && *at++ == ',';
    if (!sound) break;
    const auto [next, fault] = std::from_chars(at, end, axis[k]);
    sound = fault == std::errc{};
    at = next;
  }
  if (!sound || at != end || !axis.allFinite() || !(axis.norm() > 0))
    return Error{ErrorCode::bad_option, "is no axis", "--axis " + text, "give x, y, z or three numbers such as 0,1,0"};
  return axis;
}

/// Bones bend one within another, in whatever order they are given.
Expected<Pose> bent(const Rig& rig, const PoseCommand& options) {
  struct Bend {
    std::size_t bones_moved = 0;
    Pose pose;
  };
  std::vector<Bend> bends;
  std::vector<std::string> names;
  for (const Bone& bone : rig.skeleton.bones) names.push_back(bone.name);
  for (std::size_t k = 0; k < options.bones.size(); ++k) {
    const auto bone = std::find(names.begin(), names.end(), options.bones[k]);
    if (bone == names.end()) {
      const std::string near = near_misses(options.bones[k], names);
      return Error{ErrorCode::bad_option, "names no bone", "--bone " + options.bones[k],
                   near.empty() ? "quadrig dominance lists their names" : "did you mean " + near + "?"};
    }
    const Expected<Vector3> axis = axis_of(options.axes[k]);
    if (!axis) return axis.error();
    const auto number = static_cast<Index>(bone - names.begin());
    bends.push_back({bones_below(rig.skeleton, number).size(),
                     bend(rig.skeleton, number, *axis, options.angles[k] * std::numbers::pi / 180)});
  }
  // A bone above another moves more bones: its bend comes last, and is the factor on the left.
  std::stable_sort(bends.begin(), bends.end(),
                   [](const Bend& a, const Bend& b) { return a.bones_moved > b.bones_moved; });
  Pose pose = rest_pose(rig.skeleton);
  for (const Bend& one : bends)
    for (std::size_t b = 0; b < pose.size(); ++b) pose[b] = pose[b] * one.pose[b];
  return pose;
}

/// The sampled frame nearest to the time.
Expected<Pose> of_clip(const Rig& rig, const PoseCommand& options) {
  std::vector<std::string> names;
  for (const Clip& clip : rig.clips) {
    names.push_back(clip.name);
    if (clip.name != options.clip || clip.times_seconds.empty()) continue;
    const auto next = std::lower_bound(clip.times_seconds.begin(), clip.times_seconds.end(), options.time_seconds);
    auto at = static_cast<std::size_t>(next - clip.times_seconds.begin());
    if (at == clip.times_seconds.size() ||
        (at > 0 && options.time_seconds - clip.times_seconds[at - 1] < clip.times_seconds[at] - options.time_seconds))
      --at;
    return clip.poses[at];
  }
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return Error{
      ErrorCode::bad_option, "names no clip", "--clip " + options.clip,
      list.empty() ? "bend bones (--bone); the file has no clips that move this surface" : "the clips are: " + list};
}

std::string polygons_obj(const PolygonMesh& mesh) {
  std::string text = "# quadrig " QUADRIG_VERSION "\n";
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    put_numbers(text += 'v', mesh.positions.row(v).transpose());
    text += '\n';
  }
  for (Index p = 0; p < mesh.polygon_count(); ++p) {
    text += 'f';
    for (const Index v : mesh.polygon(p)) put_number(text, v + 1);
    text += '\n';
  }
  return text;
}

Status pose(const PoseCommand& options, Session& session) {
  const bool gltf = is_gltf(options.input.files.mesh);
  if (options.bones.size() != options.axes.size() || options.bones.size() != options.angles.size())
    return Error{ErrorCode::bad_option, "each bone needs an axis and an angle", "--bone",
                 "give --bone, --axis and --angle as often as each other"};
  if (options.bones.empty() == options.clip.empty())
    return Error{ErrorCode::bad_option, "a pose is made of bones or of a clip", "--bone",
                 "give either --bone, --axis and --angle, or --clip and --time"};
  if (!gltf && !options.clip.empty())
    return Error{ErrorCode::bad_option, "clips are of glTF files", "--clip " + options.clip,
                 "bend bones (--bone, --axis, --angle)"};
  if (!goes_to(options.output, ".obj"))
    return Error{ErrorCode::bad_option, "posed surfaces are written as OBJ alone", options.output.string(),
                 "name an .obj file"};
  FileSet files;
  if (Status status = declare(files, options.input, {options.output}); !status) return status;
  Input input = options.input;
  input.clips = !options.clip.empty();
  Expected<Posed> asset = gltf ? read_gltf(input, files, session) : read_files(input, session);
  if (!asset) return asset.error();
  const Expected<Pose> wanted = options.clip.empty() ? bent(asset->rig, options) : of_clip(asset->rig, options);
  if (!wanted) return wanted.error();
  asset->mesh.positions = skin(asset->mesh.positions, asset->rig.weights, *wanted,
                               options.skinning == "dual" ? Skinning::dual_quaternion : Skinning::linear_blend);
  if (Status status = files.add(options.output, polygons_obj(asset->mesh)); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  session.say(options.output.string() + ": " + std::to_string(asset->mesh.vertex_count()) + " vertices posed");
  return {};
}

}  // namespace

void add_pose(CLI::App& app, Run& run) {
  auto options = std::make_shared<PoseCommand>();
  CLI::App* verb =
      app.add_subcommand("pose", "Bend the bones of a surface or of its quads, and write it as it is then");
  add_input(*verb, options->input, std::string(all_formats));
  verb->remove_option(verb->get_option("--bind"));
  verb->get_option("--rig")->needs(verb->get_option("--weights"));
  add_selection(*verb, options->input.selection);
  verb->add_option("-o,--output", options->output, "The posed polygons: .obj")->required()->type_name("OUT.obj");
  verb->add_option("--bone", options->bones, "Bend this bone about its head, and all below it; may be repeated")
      ->allow_extra_args(false)
      ->type_name("NAME");
  verb->add_option("--axis", options->axes, "About this axis of the space that the mesh is in; one a --bone")
      ->allow_extra_args(false)
      ->type_name("x|y|z|X,Y,Z");
  verb->add_option("--angle", options->angles, "By so many degrees; one a --bone")
      ->allow_extra_args(false)
      ->check(CLI::Range(-3600.0, 3600.0))
      ->type_name("DEGREES");
  verb->add_option("--clip", options->clip, "Of a glTF file: as this clip has it")->type_name("NAME");
  verb->add_option("--time", options->time_seconds, "After so long, to the nearest of 30 frames a second")
      ->needs("--clip")
      ->type_name("SECONDS");
  verb->add_option("--skinning", options->skinning, "Linear blend, or dual quaternions")
      ->check(CLI::IsMember({"linear", "dual"}))
      ->option_text("linear|dual = linear");
  verb->footer(R"(Examples:
  quadrig pose quads.obj --rig arm.tgf --weights quads.dmat --bone 2 --axis z --angle 60 -o bent.obj
  quadrig pose knight.glb --clip Walk --time 0.5 -o walking.obj)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return pose(*options, session); }; });
}

}  // namespace quadrig::cli
