#include "picture/panel.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "quadrig/dominance.hpp"
#include "quadrig/field.hpp"
#include "quadrig/gltf/surface.hpp"
#include "quadrig/io.hpp"
#include "quadrig/skinning.hpp"

namespace quadrig {

namespace {

constexpr std::array<PanelWord, 18> words_known{{
    {"caption", "text under the panel"},
    {"rig", "bones: .tgf"},
    {"weights", "skin weights, a column a bone: .dmat"},
    {"select", "of a glTF file: the mesh, node, material or skin"},
    {"clip", "of a glTF file: as this clip has it"},
    {"time", "seconds of the clip"},
    {"colour", "bones, omega1, omega2 ..., weight:BONE, jacobian, or FILE.dmat[:COLUMN], a row a vertex or face"},
    {"range", "LOW,HIGH of the colours; else least and largest"},
    {"legend", "text over the legend; no: none"},
    {"bones", "yes: draw the rig"},
    {"field", "lines along the field of a preset (thesis, default, static) and its singular vertices"},
    {"spacing", "of field lines, as a share of the diagonal; 0.012"},
    {"grid", "yes: the grid of remesh --map-out; checker: with squares in two shades"},
    {"dots", "no: none on singular and irregular vertices"},
    {"edges", "no: faces without their edges"},
    {"near", "close-up: X,Y,Z or a bone's head"},
    {"radius", "of the close-up, as a share of the diagonal; 0.1"},
    {"file", "the mesh, where its name is like a setting's"},
}};

Error bad(std::string what, std::string_view name, const std::string& value, std::string remedy) {
  return {ErrorCode::bad_option, std::move(what), std::string(name) + "=" + value, std::move(remedy)};
}

/// Numbers with commas between. \fails bad_option where there are not `count`
Expected<std::vector<double>> numbers(std::string_view name, const std::string& text, std::size_t count) {
  std::vector<double> values;
  std::istringstream stream(text);
  for (std::string word; std::getline(stream, word, ',');) {
    double value = 0;
    const auto [end, fault] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (fault != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) break;
    values.push_back(value);
  }
  if (values.size() != count)
    return bad("wants " + std::to_string(count) + (count == 1 ? " number" : " numbers with commas between"), name, text,
               "write them in plain digits");
  return values;
}

struct Loaded {
  PolygonMesh mesh;
  std::optional<Rig> rig;
};

Expected<Loaded> load_gltf_panel(const PanelWords& words, Context& context) {
  const Expected<GltfDocument> document = GltfDocument::read(words.mesh, {}, context);
  if (!document) return document.error();
  if (words.value("clip").empty() && words.value("select").empty() && words.value("rig").empty() &&
      words.value("colour").empty() && words.value("field").empty() && words.value("bones").empty()) {
    Expected<PolygonMesh> mesh = gltf_polygons(*document, context);
    if (!mesh) return mesh.error();
    return Loaded{std::move(*mesh), {}};
  }
  GltfSelection selection;
  if (const std::string name = words.value("select"); !name.empty()) selection.names = {name};
  GltfClipOptions clips;
  clips.enabled = !words.value("clip").empty();
  Expected<std::vector<GltfSurface>> surfaces = gltf_surfaces(*document, {}, clips, context, selection);
  if (!surfaces) return surfaces.error();
  const auto largest = std::max_element(surfaces->begin(), surfaces->end(), [](const auto& a, const auto& b) {
    return a.asset.mesh.face_count() < b.asset.mesh.face_count();
  });
  Loaded loaded;
  loaded.mesh = PolygonMesh::from_triangles(largest->asset.mesh.positions(), largest->asset.mesh.faces());
  loaded.rig = std::move(largest->asset.rig);
  return loaded;
}

Expected<Loaded> load_panel(const PanelWords& words, Context& context) {
  if (gltf_container(words.mesh)) return load_gltf_panel(words, context);
  Expected<PolygonMesh> mesh = read_surface(words.mesh, {}, context);
  if (!mesh) return mesh.error();
  Loaded loaded{std::move(*mesh), {}};
  if (const std::string rig = words.value("rig"); !rig.empty()) {
    Expected<Skeleton> skeleton = read_tgf(rig, {}, context);
    if (!skeleton) return skeleton.error();
    loaded.rig.emplace();
    loaded.rig->skeleton = std::move(*skeleton);
    if (const std::string weights = words.value("weights"); !weights.empty()) {
      const Expected<Eigen::MatrixXd> read = read_dmat(weights, {}, &context);
      if (!read) return read.error();
      if (read->rows() != loaded.mesh.vertex_count() || read->cols() != loaded.rig->skeleton.bone_count())
        return Error{ErrorCode::bad_input, "is not of this mesh and rig", weights,
                     "give a row a vertex of " + words.mesh.string() + " and a column a bone of " + rig};
      loaded.rig->weights = read->sparseView();
    }
  }
  return loaded;
}

/// Moves the mesh, not its rig, to the frame of the clip nearest to the time.
Status pose_by_clip(const PanelWords& words, Loaded& loaded) {
  const std::string name = words.value("clip");
  if (name.empty()) return {};
  if (!loaded.rig) return bad("clips are of skinned meshes of glTF files", "clip", name, "leave it out");
  double time = 0;
  if (const std::string text = words.value("time"); !text.empty()) {
    const auto value = numbers("time", text, 1);
    if (!value) return value.error();
    time = value->front();
  }
  std::string names;
  for (const Clip& clip : loaded.rig->clips) {
    names += (names.empty() ? "" : ", ") + clip.name;
    if (clip.name != name || clip.poses.empty()) continue;
    std::size_t best = 0;
    for (std::size_t k = 0; k < clip.times_seconds.size(); ++k)
      if (std::abs(clip.times_seconds[k] - time) < std::abs(clip.times_seconds[best] - time)) best = k;
    loaded.mesh.positions = skin(loaded.mesh.positions, loaded.rig->weights, clip.poses[best]);
    for (Bone& bone : loaded.rig->skeleton.bones) {
      const Eigen::Affine3d& moved =
          clip.poses[best][static_cast<std::size_t>(&bone - loaded.rig->skeleton.bones.data())];
      bone.head = moved * bone.head;
      bone.tail = moved * bone.tail;
    }
    return {};
  }
  return bad("names no clip", "clip", name, names.empty() ? "the file has none" : "the clips are: " + names);
}

Expected<Index> bone_named(const Loaded& loaded, std::string_view setting, const std::string& name) {
  if (loaded.rig)
    for (std::size_t b = 0; b < loaded.rig->skeleton.bones.size(); ++b)
      if (loaded.rig->skeleton.bones[b].name == name) return static_cast<Index>(b);
  return bad("names no bone", setting, name, loaded.rig ? "quadrig dominance lists their names" : "give rig=");
}

/// The scalar that `colour` asks for, one a vertex or a polygon. \fails bad_option, and as read_dmat
Expected<Eigen::VectorXd> scalars(const std::string& name, const Loaded& loaded, Context& context) {
  const auto weights = [&]() -> Expected<const SkinWeights*> {
    if (!loaded.rig || loaded.rig->weights.rows() != loaded.mesh.vertex_count())
      return bad("needs skin weights", "colour", name, "give rig= and weights=");
    return &loaded.rig->weights;
  };
  if (name.starts_with("omega") && name.size() == 6 && name[5] >= '1' && name[5] <= '9') {
    const auto w = weights();
    if (!w) return w.error();
    const auto k = static_cast<std::size_t>(name[5] - '0');
    Eigen::VectorXd values(loaded.mesh.vertex_count());
    for (Index v = 0; v < values.size(); ++v) {
      std::vector<double> row(k + 1, 0.0);
      for (SkinWeights::InnerIterator it(**w, v); it; ++it) row.push_back(it.value());
      std::sort(row.rbegin(), row.rend());
      values[v] = static_cast<double>(k) * (row[k - 1] - row[k]);
    }
    return values;
  }
  if (name.starts_with("weight:")) {
    const auto w = weights();
    if (!w) return w.error();
    const Expected<Index> bone = bone_named(loaded, "colour", name.substr(7));
    if (!bone) return bone.error();
    return Eigen::VectorXd((*w)->col(*bone));
  }
  if (name == "jacobian") {
    Eigen::VectorXd values(loaded.mesh.polygon_count());
    for (Index p = 0; p < values.size(); ++p) {
      const auto q = loaded.mesh.polygon(p);
      if (q.size() != 4) return bad("is of quads alone", "colour", name, "leave it out");
      values[p] = scaled_jacobian(loaded.mesh.positions, Eigen::Matrix<Index, 1, 4>(q[0], q[1], q[2], q[3]));
    }
    return values;
  }
  const std::size_t dot = name.rfind(".dmat");
  if (dot == std::string::npos)
    return bad("is no colour", "colour", name, "say bones, omega1, weight:BONE, jacobian or a .dmat file");
  const Expected<Eigen::MatrixXd> matrix = read_dmat(name.substr(0, dot + 5), {}, &context);
  if (!matrix) return matrix.error();
  double column = 1;
  if (dot + 6 < name.size()) {
    const auto value = numbers("colour", name.substr(dot + 6), 1);
    if (!value) return value.error();
    column = value->front();
  }
  if (!(column >= 1 && column <= static_cast<double>(matrix->cols())))
    return bad("names no column", "colour", name, "it has " + std::to_string(matrix->cols()));
  if (matrix->rows() != loaded.mesh.vertex_count() && matrix->rows() != loaded.mesh.polygon_count())
    return bad("has a row neither for each vertex nor for each face", "colour", name, "give one of this mesh");
  return Eigen::VectorXd(matrix->col(static_cast<Eigen::Index>(column) - 1));
}

Status colour_panel(const PanelWords& words, const Loaded& loaded, Panel& panel, Context& context) {
  const std::string name = words.value("colour"), title = words.value("legend");
  if (name.empty()) return {};
  if (name == "bones") {
    if (!loaded.rig || loaded.rig->weights.rows() != loaded.mesh.vertex_count())
      return bad("needs skin weights", "colour", name, "give rig= and weights=");
    panel.colours.assign(static_cast<std::size_t>(loaded.mesh.vertex_count()), Colour::Zero());
    for (Index v = 0; v < loaded.mesh.vertex_count(); ++v)
      for (SkinWeights::InnerIterator it(loaded.rig->weights, v); it; ++it)
        panel.colours[static_cast<std::size_t>(v)] += it.value() * numbered_colour(static_cast<Index>(it.col()));
    if (loaded.rig->skeleton.bone_count() <= 6 && title != "no")
      for (Index b = 0; b < loaded.rig->skeleton.bone_count(); ++b)
        panel.legend.names.emplace_back(loaded.rig->skeleton.bones[static_cast<std::size_t>(b)].name,
                                        numbered_colour(b));
    return {};
  }
  const Expected<Eigen::VectorXd> values = scalars(name, loaded, context);
  if (!values) return values.error();
  double low = values->minCoeff(), high = values->maxCoeff();
  if (name.starts_with("omega") || name.starts_with("weight:")) low = 0, high = 1;
  if (const std::string range = words.value("range"); !range.empty()) {
    const auto ends = numbers("range", range, 2);
    if (!ends) return ends.error();
    low = ends->front(), high = ends->back();
  }
  if (!(high > low)) high = low + 1;
  for (const double value : *values) panel.colours.push_back(scalar_colour((value - low) / (high - low)));
  if (title != "no") panel.legend = {title.empty() ? name.substr(0, name.find(".dmat")) : title, low, high, {}};
  return {};
}

Status add_field(const PanelWords& words, const Loaded& loaded, double diagonal, Panel& panel, Context& context) {
  const std::string preset_name = words.value("field");
  if (preset_name.empty()) return {};
  const Expected<FieldPreset> preset = field_preset(preset_name);
  if (!preset) return preset.error();
  Triangles faces(loaded.mesh.polygon_count(), 3);
  for (Index p = 0; p < loaded.mesh.polygon_count(); ++p) {
    const auto polygon = loaded.mesh.polygon(p);
    if (polygon.size() != 3) return bad("wants triangles", "field", preset_name, "leave it out");
    for (int i = 0; i < 3; ++i) faces(p, i) = polygon[static_cast<std::size_t>(i)];
  }
  const auto mesh = TriangleMesh<double>::create(loaded.mesh.positions, faces);
  if (!mesh) return mesh.error();
  const Connection<double> connection(*mesh);
  FieldOptions options;
  options.preset = *preset;
  const bool rigged = loaded.rig && loaded.rig->weights.rows() == loaded.mesh.vertex_count();
  const Expected<FieldResult> field =
      design_field(*mesh, rigged ? &*loaded.rig : nullptr, connection, options, context);
  if (!field) return field.error();
  double spacing = 0.012;
  if (const std::string text = words.value("spacing"); !text.empty()) {
    const auto value = numbers("spacing", text, 1);
    if (!value) return value.error();
    if (!(value->front() > 0)) return bad("must be more than 0", "spacing", text, "try 0.012");
    spacing = value->front();
  }
  panel.strokes = field_lines(*mesh, field->frames, spacing * diagonal, Colour(0.02, 0.06, 0.16), 1.1);
  if (words.value("dots") == "no") return {};
  for (Index v = 0; v < mesh->vertex_count(); ++v)
    if (const Index index = field->singularities.index4[static_cast<std::size_t>(v)];
        index != 0 && !mesh->on_boundary(v))
      panel.dots.push_back({mesh->position(v), singular_colour(index), 4});
  return {};
}

/// Texture coordinates and points of a map that `remesh --map-out` wrote. \fails bad_input where it has none
Status add_grid(const PanelWords& words, Panel& panel) {
  if (words.value("grid").empty() || words.value("grid") == "no") return {};
  panel.checker = words.value("grid") == "checker";
  panel.edges = false;
  std::ifstream file(words.mesh);
  std::vector<std::array<double, 2>> coordinates;
  Index singular = 0;
  for (std::string line; std::getline(file, line);) {
    std::istringstream stream(line);
    std::string word;
    stream >> word;
    if (word == "vt") {
      auto& at = coordinates.emplace_back();
      stream >> at[0] >> at[1];
    } else if (word == "f") {
      while (stream >> word) {
        const std::size_t slash = word.find('/');
        std::size_t number = 0;
        if (slash != std::string::npos) std::from_chars(word.data() + slash + 1, word.data() + word.size(), number);
        if (number < 1 || number > coordinates.size())
          return Error{ErrorCode::bad_input, "has no texture coordinates", words.mesh.string(),
                       "give an OBJ of remesh --map-out"};
        panel.grid.push_back(coordinates[number - 1]);
      }
    } else if (word == "g") {
      stream >> word;
      singular = word.starts_with("singular_quads_") ? 4 - std::atoi(word.c_str() + 15) : 0;
    } else if (word == "p" && singular != 0 && words.value("dots") != "no") {
      for (Index v = 0; stream >> v;)
        if (v >= 1 && v <= panel.mesh.vertex_count())
          panel.dots.push_back({panel.mesh.positions.row(v - 1).transpose(), singular_colour(singular), 4});
    }
  }
  if (panel.grid.size() != panel.mesh.corners.size())
    return Error{ErrorCode::bad_input, "has no texture coordinates", words.mesh.string(),
                 "give an OBJ of remesh --map-out"};
  panel.colours.assign(static_cast<std::size_t>(panel.mesh.polygon_count()), Colour(0.52, 0.68, 0.80));
  return {};
}

Status add_close_up(const PanelWords& words, const Loaded& loaded, double diagonal, Panel& panel) {
  const std::string near = words.value("near");
  if (near.empty()) return {};
  CloseUp close;
  if (const Expected<Index> bone = bone_named(loaded, "near", near); bone) {
    close.centre = loaded.rig->skeleton.bones[static_cast<std::size_t>(*bone)].head;
  } else {
    const auto at = numbers("near", near, 3);
    if (!at) return loaded.rig ? bone.error() : at.error();
    close.centre = {(*at)[0], (*at)[1], (*at)[2]};
  }
  close.radius = 0.1 * diagonal;
  if (const std::string text = words.value("radius"); !text.empty()) {
    const auto value = numbers("radius", text, 1);
    if (!value) return value.error();
    if (!(value->front() > 0)) return bad("must be more than 0", "radius", text, "try 0.1");
    close.radius = value->front() * diagonal;
  }
  panel.close_up = close;
  return {};
}

void add_bones(const Rig& rig, Panel& panel) {
  const Colour outline(0.01, 0.01, 0.02);
  for (const double pixels : {5.5, 3.0})
    for (std::size_t b = 0; b < rig.skeleton.bones.size(); ++b) {
      const Bone& bone = rig.skeleton.bones[b];
      panel.strokes.push_back(
          {bone.head, bone.tail, pixels > 4 ? outline : numbered_colour(static_cast<Index>(b)), pixels, true});
    }
  for (const Bone& bone : rig.skeleton.bones)
    for (const Vector3& joint : {bone.head, bone.tail}) panel.strokes.push_back({joint, joint, outline, 7, true});
}

}  // namespace

std::span<const PanelWord> panel_words() { return words_known; }

std::string PanelWords::value(std::string_view name) const {
  const auto found = settings.find(name);
  return found == settings.end() ? std::string() : found->second;
}

Expected<std::vector<PanelWords>> parse_panels(std::span<const std::string> words) {
  std::vector<PanelWords> panels;
  PanelWords common;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    const bool setting = equals != std::string::npos && equals > 0 &&
                         std::all_of(word.begin(), word.begin() + static_cast<std::ptrdiff_t>(equals),
                                     [](char c) { return c >= 'a' && c <= 'z'; });
    if (!setting) {
      panels.push_back(common);
      panels.back().mesh = word;
      continue;
    }
    const std::string name = word.substr(0, equals), value = word.substr(equals + 1);
    if (std::none_of(words_known.begin(), words_known.end(), [&](const PanelWord& one) { return one.name == name; }))
      return bad("is no setting of a panel", name, value, "quadrig-picture --help lists them; a file is ./" + word);
    if (name == "file") {
      panels.push_back(common);
      panels.back().mesh = value;
    } else {
      (panels.empty() ? common : panels.back()).settings[name] = value;
    }
  }
  if (panels.empty()) return Error{ErrorCode::bad_option, "no mesh to draw", "picture", "name at least one"};
  return panels;
}

Expected<Panel> read_panel(const PanelWords& words, Context& context) {
  Expected<Loaded> loaded = load_panel(words, context);
  if (!loaded) return loaded.error();
  if (Status status = pose_by_clip(words, *loaded); !status) return status.error();
  Panel panel;
  panel.mesh = loaded->mesh;
  panel.caption = words.value("caption");
  const double diagonal =
      panel.mesh.vertex_count() == 0
          ? 1
          : (panel.mesh.positions.colwise().maxCoeff() - panel.mesh.positions.colwise().minCoeff()).norm();
  if (Status status = colour_panel(words, *loaded, panel, context); !status) return status.error();
  if (Status status = add_grid(words, panel); !status) return status.error();
  if (Status status = add_field(words, *loaded, diagonal, panel, context); !status) return status.error();
  if (Status status = add_close_up(words, *loaded, diagonal, panel); !status) return status.error();
  if (words.value("bones") == "yes") {
    if (!loaded->rig) return bad("has no bones", "bones", "yes", "give rig=");
    add_bones(*loaded->rig, panel);
  }
  if (words.value("edges") == "no") panel.edges = false;
  panel.irregular_vertices = words.value("dots") != "no";
  return panel;
}

}  // namespace quadrig
