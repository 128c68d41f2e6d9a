// An asset from its files.
#include <algorithm>
#include <array>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "keep.hpp"
#include "scan.hpp"

namespace quadrig {
namespace {

/// A surface that fell into single triangles is mostly one whose corners were rounded when it was written: how far
/// apart the nearest of them are, or nothing where most parts are more than a triangle, or the triangles do not nearly
/// touch.
std::optional<std::string> loose_triangles(const TriangleMesh<double>& mesh) {
  constexpr Index many = 20, most_looked_at = 500;
  constexpr double near = 0.1, all_but_few = 0.9;  // of an edge; of the corners
  const Components components = face_components(mesh);
  const Index loose = 2 * components.count - mesh.face_count();  // at least so many parts of one triangle
  if (loose < many || 2 * loose < components.count) return std::nullopt;
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  std::vector<Index> order(at(mesh.vertex_count()));
  for (Index v = 0; v < mesh.vertex_count(); ++v) order[at(v)] = v;
  std::sort(order.begin(), order.end(),
            [&](Index a, Index b) { return mesh.positions()(a, 0) < mesh.positions()(b, 0); });
  std::vector<double> gap;
  const std::size_t step = order.size() / std::min<std::size_t>(order.size(), most_looked_at);
  double edge = 0;
  for (std::size_t k = 0; k < order.size(); k += step) {
    const Index v = order[k], own = mesh.outgoing(v) / 3;
    double least = std::numeric_limits<double>::infinity();
    for (const int way : {-1, 1})
      for (std::size_t n = k + at(way); n < order.size(); n += at(way)) {  // runs out below 0 too
        if (std::abs(mesh.positions()(order[n], 0) - mesh.positions()(v, 0)) >= least) break;
        if (mesh.outgoing(order[n]) / 3 != own)
          least = std::min(least, (mesh.position(order[n]) - mesh.position(v)).norm());
      }
    gap.push_back(least);
    edge += mesh.edge_vector(mesh.outgoing(v)).norm();
  }
  edge /= static_cast<double>(gap.size());
  std::sort(gap.begin(), gap.end());
  const double widest = gap[static_cast<std::size_t>(all_but_few * static_cast<double>(gap.size() - 1))];
  if (!(widest < near * edge)) return std::nullopt;
  std::ostringstream text;
  text << std::setprecision(2) << loose << " parts of one triangle; their nearest corners are " << widest
       << " apart: try --weld-distance " << 2 * widest;
  return text.str();
}

}  // namespace

namespace {

/// The extension that a surface file without one would have, by how it begins; empty where none is like it.
std::string extension_by_content(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return {};  // what is read from a pipe is gone
  std::ifstream file(path, std::ios::binary);
  std::string begin(4096, '\0');
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(file.gcount()));
  if (begin.starts_with("PK")) return ".3mf";
  std::string text = begin;
  if (begin.starts_with("\xFF\xFE") || begin.starts_with("\xFE\xFF"))  // UTF-16: what is ASCII of it tells enough
    std::erase_if(text, [](char c) { return c == '\0' || static_cast<unsigned char>(c) >= 0x80; });
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  std::size_t first = text.find_first_not_of(" \t\r\n");
  bool comment = false;
  while (first < text.size() && text[first] == '#') {
    comment = true;
    first = text.find_first_not_of(" \t\r\n", std::min(text.find_first_of("\r\n", first), text.size()));
  }
  const std::string word =
      first < text.size() ? text.substr(first, text.find_first_of(" \t\r\n", first) - first) : std::string();
  if (word == "ply") return ".ply";
  std::string upper;
  for (const char c : word) upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  if (const std::size_t off = upper.find("OFF"); off <= 4) return ".off";
  constexpr std::size_t stl_head = 84, stl_face = 50;
  if (begin.size() >= stl_head && begin.find('\0') != std::string::npos && text.size() == begin.size()) {
    std::size_t faces = 0;
    for (std::size_t k = 0; k < 4; ++k) faces |= std::size_t{static_cast<unsigned char>(begin[80 + k])} << (8 * k);
    if (std::filesystem::file_size(path, error) >= stl_head + stl_face * faces && !error) return ".stl";
  }
  if (word == "solid") return ".stl";
  constexpr std::array<std::string_view, 11> obj{"v", "vt", "vn", "vp", "f", "l", "p", "o", "g", "s", "usemtl"};
  return comment || word.starts_with('$') || word == "mtllib" || std::ranges::find(obj, word) != obj.end() ? ".obj"
                                                                                                           : "";
}

}  // namespace

Expected<PolygonMesh> read_surface(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (extension.empty()) extension = extension_by_content(path);
  if (extension == ".obj") return read_obj(path, limits, context);
  if (extension == ".off") return read_off(path, limits, context);
  if (extension == ".ply") return read_ply(path, limits, context);
  if (extension == ".stl") return read_stl(path, limits, context);
  if (extension == ".3mf")
    return Error{ErrorCode::unsupported, "3MF packages are not read", path.string(),
                 "convert it to .stl, with PrusaSlicer's --export-stl or Python's trimesh"};
  if (extension.empty())
    return Error{ErrorCode::unsupported, "begins like no surface format that is read", path.string(),
                 "give an .obj, .off, .ply or .stl file"};
  return Error{ErrorCode::unsupported, io::shown(extension) + " is not a surface format that is read", path.string(),
               "give an .obj, .off, .ply or .stl file"};
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
    factors[at(h / 3)] *= elementary::cbrt(density_of_color(polygons.colors.row(v).transpose()));
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
  if (const auto loose = loose_triangles(loaded.asset.mesh)) context.warn("load", *loose);
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
