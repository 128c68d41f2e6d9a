// quadrig dominance: how strongly one bone, or several, rule each place.
#include <charconv>
#include <cmath>

#include "command.hpp"
#include "quadrig/dominance.hpp"

namespace quadrig::cli {
namespace {

struct DominanceCommand {
  Input input;
  std::filesystem::path output, omegas, report;
};

/// Colours that neighbouring numbers do not share: hues a golden angle apart.
Eigen::Vector3d bone_colour(Index bone) {
  const double hue = std::fmod(0.08 + 0.381966 * bone, 1.0) * 6;
  const auto channel = [hue](double shift) {
    return std::clamp(std::abs(std::fmod(hue + shift, 6.0) - 3) - 1, 0.0, 1.0);
  };
  return 0.25 * Eigen::Vector3d::Ones() + 0.75 * Eigen::Vector3d(channel(0), channel(4), channel(2));
}

/// PLY: each vertex coloured by its bones, with ω1 as `quality`.
std::string coloured_ply(const TriangleMesh<double>& mesh, const Rig& rig, const Dominance& dominance) {
  std::string text = "ply\nformat ascii 1.0\ncomment colours: bones by weight; quality: omega_1\nelement vertex " +
                     std::to_string(mesh.vertex_count()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n"
                     "property uchar green\nproperty uchar blue\nproperty double quality\nelement face " +
                     std::to_string(mesh.face_count()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto append = [&text](double value) {
    char buffer[32];
    text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
    text += ' ';
  };
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    Eigen::Vector3d colour = Eigen::Vector3d::Zero();
    for (SkinWeights::InnerIterator it(rig.weights, v); it; ++it)
      colour += it.value() * bone_colour(static_cast<Index>(it.col()));
    for (int i = 0; i < 3; ++i) append(mesh.positions()(v, i));
    for (int i = 0; i < 3; ++i) text += std::to_string(std::lround(255 * std::clamp(colour[i], 0.0, 1.0))) + ' ';
    append(dominance.vertex_omega1()[static_cast<std::size_t>(v)]);
    text.back() = '\n';
  }
  for (Index f = 0; f < mesh.face_count(); ++f)
    text += "3 " + std::to_string(mesh.faces()(f, 0)) + ' ' + std::to_string(mesh.faces()(f, 1)) + ' ' +
            std::to_string(mesh.faces()(f, 2)) + '\n';
  return text;
}

/// One row a face, column k - 1 its omega_k.
Eigen::MatrixXd omegas(const Dominance& dominance, Index faces, std::size_t most) {
  Eigen::MatrixXd rows(faces, static_cast<Eigen::Index>(most));
  for (Index f = 0; f < faces; ++f)
    for (std::size_t k = 1; k <= most; ++k) rows(f, static_cast<Eigen::Index>(k) - 1) = dominance.omega(f, k);
  return rows;
}

Status dominance(const DominanceCommand& options, Session& session) {
  FileSet files;
  if (Status status = declare(files, options.input, {options.output, options.omegas, options.report}); !status)
    return status;
  if (!options.output.empty() && !goes_to(options.output, ".ply"))
    return Error{ErrorCode::bad_option, "coloured surfaces are written as PLY alone", options.output.string(),
                 "name a .ply file"};
  const Expected<LoadedAsset> loaded = load(options.input, files, session);
  if (!loaded) return loaded.error();
  if (!loaded->asset.rig)
    return Error{ErrorCode::bad_input, "has no bones", options.input.files.mesh.string(),
                 is_gltf(options.input.files.mesh) ? "select a mesh that a skin moves" : "give --rig and --weights"};
  const TriangleMesh<double>& mesh = loaded->asset.mesh;
  const Rig& rig = *loaded->asset.rig;
  const Expected<Dominance> made = Dominance::create(mesh, rig);
  if (!made) return made.error();

  std::vector<double> strongest(static_cast<std::size_t>(rig.skeleton.bone_count()), 0.0), ruled(strongest);
  double sum[3] = {0, 0, 0}, blending = 0, area = 0;
  std::size_t most = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) sum[k] += made->omega(f, k + 1);
    const BoneShare first = made->share(f, 1);
    area += mesh.area(f);
    strongest[static_cast<std::size_t>(first.bone)] += mesh.area(f);
    (made->omega(f, 1) > 0.9 ? ruled[static_cast<std::size_t>(first.bone)] : blending) += mesh.area(f);
    most = std::max(most, made->shares(f).size());
  }
  Json report = report_head("dominance", options.input, *loaded);
  for (std::size_t k = 0; k < 3; ++k) report["sum_omega" + std::to_string(k + 1)] = sum[k];
  report["most_bones_a_face"] = most;
  report["blending_area_share"] = blending / area;
  std::string text = "bone       strongest  ruled alone (omega_1 > 0.9), shares of the area";
  for (std::size_t b = 0; b < strongest.size(); ++b) {
    const Bone& bone = rig.skeleton.bones[b];
    report["bones"].push_back({{"name", bone.name},
                               {"length", (bone.tail - bone.head).norm()},
                               {"strongest_area_share", strongest[b] / area},
                               {"ruled_area_share", ruled[b] / area}});
    text += "\n" + bone.name + std::string(bone.name.size() < 11 ? 11 - bone.name.size() : 1, ' ') +
            decimals(strongest[b] / area, 4) + "     " + decimals(ruled[b] / area, 4);
  }
  text += "\nblending   " + decimals(blending / area, 4);
  report["warnings"] = warnings_json(session.context.warnings);

  if (!options.output.empty())
    if (Status status = files.add(options.output, coloured_ply(mesh, rig, *made)); !status) return status;
  if (!options.omegas.empty())
    if (Status status = files.add(options.omegas, dmat_text(omegas(*made, mesh.face_count(), most))); !status)
      return status;
  if (!options.report.empty())
    if (Status status = files.add(options.report, report_text(report, session)); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  session.say(text);
  return {};
}

}  // namespace

void add_dominance(CLI::App& app, Run& run) {
  auto options = std::make_shared<DominanceCommand>();
  CLI::App* verb = app.add_subcommand("dominance", "Where one bone rules the surface and where bones blend");
  add_input(*verb, options->input);
  add_selection(*verb, options->input.selection);
  verb->add_option("-o,--output", options->output, "Write the surface coloured by bone: .ply")->type_name("OUT.ply");
  verb->add_option("--omegas", options->omegas, "Write omega_1, omega_2 ... of each face, a column each: .dmat")
      ->type_name("OUT.dmat");
  verb->add_option("--report", options->report, "Write the figures as JSON")->type_name("FILE");
  verb->footer(R"(Examples:
  quadrig dominance arm.obj --rig arm.tgf --weights arm.dmat
  quadrig dominance arm.obj --rig arm.tgf --weights arm.dmat -o coloured.ply
  quadrig dominance knight.glb -o coloured.ply --omegas omegas.dmat)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return dominance(*options, session); }; });
}

}  // namespace quadrig::cli
