// An asset from its files.
#include "keep.hpp"
#include "scan.hpp"

namespace quadrig {

Expected<PolygonMesh> read_surface(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (extension == ".obj") return read_obj(path, limits, context);
  if (extension == ".off") return read_off(path, limits, context);
  if (extension == ".ply") return read_ply(path, limits, context);
  return Error{ErrorCode::unsupported, io::shown(extension) + " is not a surface format that is read", path.string(),
               "give an .obj, .off or .ply file"};
}

namespace {

/// Factors of the faces, from colours and materials. \fails bad_option
Expected<std::vector<double>> density_factors(const PolygonMesh& polygons, const LoadedAsset& loaded,
                                              const DensityOptions& options, const std::filesystem::path& path) {
  using detail::at;
  const auto absent = [&](const char* what, const char* option) {
    return Error{ErrorCode::bad_option, std::string("has no ") + what, path.string(),
                 std::string("leave out ") + option + ", or give a file that has some"};
  };
  const TriangleMesh<double>& mesh = loaded.asset.mesh;
  std::vector<double> factors(at(mesh.face_count()), 1.0);
  if (!options.materials.empty()) {
    if (polygons.material_names.empty()) return absent("materials", "--material-density");
    const Expected<std::vector<double>> named = named_factors(options.materials, polygons.material_names, "material");
    if (!named) return named.error();
    for (std::size_t f = 0; f < factors.size(); ++f)
      factors[f] *= (*named)[at(polygons.material[at(loaded.source_polygon[f])])];
  }
  if (!options.colors) return factors;
  if (polygons.colors.rows() == 0) return absent("colours of vertices", "--density-colors");
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index v = loaded.source_vertex[at(mesh.origin(h))];
    factors[at(h / 3)] *= std::cbrt(density_of_color(polygons.colors.row(v).transpose()));
  }
  return factors;
}

}  // namespace

Expected<LoadedAsset> load_asset(const AssetFiles& files, const LoadOptions& options, Context& context) {
  if (files.rig.empty() && !files.weights.empty())
    return Error{ErrorCode::bad_option, "weights without a rig", files.weights.string(), "give both files or neither"};
  if (options.bind && (files.rig.empty() || !files.weights.empty()))
    return Error{ErrorCode::bad_option,
                 files.rig.empty() ? "no bones to bind to" : "weights are given, so there is nothing to bind",
                 (files.rig.empty() ? files.mesh : files.weights).string(),
                 files.rig.empty() ? "give a rig, or ask for no binding" : "leave out one of the two"};
  if (!options.bind && !files.rig.empty() && files.weights.empty())
    return Error{ErrorCode::bad_option, "a rig without weights", files.rig.string(),
                 "give weights, or ask for them to be made (--bind voxel)"};
  const auto in_file = [](Error error, const std::filesystem::path& path) {
    error.where = path.string() + (error.where.empty() ? "" : ", " + error.where);
    return error;
  };
  Expected<PolygonMesh> polygons = read_surface(files.mesh, options.limits, context);
  if (!polygons) return polygons.error();

  std::optional<Skeleton> skeleton;
  std::optional<VertexWeights> weights;
  if (!files.rig.empty()) {
    Expected<Skeleton> read = read_tgf(files.rig, options.limits, context);
    if (!read) return read.error();
    skeleton = std::move(*read);
    if (options.prepare.strict)
      for (const Bone& bone : skeleton->bones)
        if (!bone.has_direction)
          return Error{ErrorCode::bad_input, bone.name + " has zero length", files.rig.string(),
                       "mend the file, or leave out the strict option"};
    if (!files.weights.empty()) {
      Expected<Eigen::MatrixXd> dense = read_dmat(files.weights, options.limits, &context);
      if (!dense) return dense.error();
      if (dense->cols() != skeleton->bone_count())
        return Error{ErrorCode::bad_input,
                     std::to_string(dense->cols()) + " columns of weights for the " +
                         std::to_string(skeleton->bone_count()) + " bones of " + files.rig.string(),
                     files.weights.string(), "give one column for each bone"};
      if (dense->rows() != polygons->vertex_count())
        return Error{ErrorCode::bad_input,
                     std::to_string(dense->rows()) + " rows of weights for the " +
                         std::to_string(polygons->vertex_count()) + " vertices of " + files.mesh.string(),
                     files.weights.string(), "give one row for each vertex"};
      if (context.cancelled()) return cancelled_error("read");
      weights = dense->sparseView();
    }
  }
  Expected<Prepared> prepared = prepare(*polygons, weights ? &*weights : nullptr, options.prepare, context);
  if (!prepared) {
    const bool of_weights = prepared.error().where.starts_with("weights");
    return in_file(prepared.error(), of_weights ? files.weights : files.mesh);
  }
  LoadedAsset loaded;
  loaded.asset.mesh = std::move(prepared->mesh);
  if (skeleton && !weights) {
    Expected<BoundWeights> bound = bind_weights(loaded.asset.mesh, *skeleton, *options.bind, context);
    if (!bound) return in_file(bound.error(), files.rig);
    context.warn("bind", bound->summary(*options.bind));
    prepared->weights = std::move(bound->weights);
  }
  if (skeleton) loaded.asset.rig = Rig{std::move(*skeleton), std::move(*prepared->weights), {}};
  loaded.source_vertex = std::move(prepared->source_vertex);
  loaded.source_polygon = std::move(prepared->source_polygon);
  loaded.report = prepared->report;
  if (options.density.any()) {
    Expected<std::vector<double>> factors = density_factors(*polygons, loaded, options.density, files.mesh);
    if (!factors) return factors.error();
    loaded.density_factors = std::move(*factors);
  }
  if (options.keep.any())
    loaded.features =
        io::kept_halfedges(*polygons, loaded.asset.mesh, loaded.source_polygon, options.keep, files.mesh, context);
  return loaded;
}

}  // namespace quadrig
