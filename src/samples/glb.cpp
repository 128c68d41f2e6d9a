// Binary glTF of characters made by code.
#include "character.hpp"
#include "io/json.hpp"

namespace quadrig::samples {
namespace {

using Json = nlohmann::ordered_json;

constexpr int gl_bytes = 5121, gl_shorts = 5123, gl_ints = 5125, gl_floats = 5126, gl_vertices = 34962,
              gl_corners = 34963;

void add_number(std::string& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> 8 * i & 0xFFU);
}
void add_big(std::string& bytes, std::uint32_t value) {
  for (int i = 3; i >= 0; --i) bytes += static_cast<char>(value >> 8 * i & 0xFFU);
}

/// A PNG whose rows are stored as they are.
std::string png(const Picture& picture) {
  std::string rows, stored = "\x78\x01", file = "\x89PNG\r\n\x1a\n";
  const auto row = static_cast<std::size_t>(3 * picture.width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(picture.height); ++y)
    rows += '\0' + picture.rgb.substr(y * row, row);
  constexpr std::size_t most = 65535;
  for (std::size_t at = 0; at < rows.size(); at += most) {
    const std::string block = rows.substr(at, most);
    stored += at + most >= rows.size() ? '\1' : '\0';
    add_number(stored, static_cast<std::uint32_t>(block.size()), 2);
    add_number(stored, ~static_cast<std::uint32_t>(block.size()), 2);
    stored += block;
  }
  std::uint32_t low = 1, high = 0;  // Adler's sums
  for (const char c : rows) {
    low = (low + static_cast<unsigned char>(c)) % 65521;
    high = (high + low) % 65521;
  }
  add_big(stored, high << 16 | low);
  const auto chunk = [&](std::string body) {
    add_big(file, static_cast<std::uint32_t>(body.size() - 4));
    std::uint32_t sum = ~0U;
    for (const char c : body) {
      sum ^= static_cast<unsigned char>(c);
      for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ (0xEDB88320U & (~(sum & 1U) + 1U));
    }
    file += body;
    add_big(file, ~sum);
  };
  std::string header = "IHDR";
  add_big(header, static_cast<std::uint32_t>(picture.width));
  add_big(header, static_cast<std::uint32_t>(picture.height));
  chunk(header + std::string("\x08\x02\0\0\0", 5));
  chunk("IDAT" + stored);
  chunk("IEND");
  return file;
}

class Writer {
 public:
  explicit Writer(const Character& character) : character_(character) {
    json_["asset"] = {{"version", "2.0"}, {"generator", "quadrig sample"}};
    json_["scene"] = 0;
    json_["scenes"] = Json::array({{{"nodes", Json::array()}}});
  }

  std::string file() {
    add_materials();
    add_bones();
    for (const CharacterMesh& mesh : character_.meshes) add_mesh(mesh);
    add_clip();
    json_["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string made = "glTF";
    add_number(made, 2, 4);
    add_number(made, static_cast<std::uint32_t>(28 + text.size() + bytes_.size()), 4);
    add_number(made, static_cast<std::uint32_t>(text.size()), 4);
    made += "JSON" + text;
    add_number(made, static_cast<std::uint32_t>(bytes_.size()), 4);
    return made + std::string("BIN\0", 4) + bytes_;
  }

 private:
  std::size_t append(const char* array, Json value) {
    json_[array].push_back(std::move(value));
    return json_[array].size() - 1;
  }
  std::size_t view(const std::string& bytes, int target) {
    Json made = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}};
    if (target != 0) made["target"] = target;
    bytes_ += bytes;
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    return append("bufferViews", std::move(made));
  }
  std::size_t floats(const Eigen::Ref<const Eigen::MatrixXd>& rows, const char* type, int target, bool bounds) {
    std::string bytes;
    for (Eigen::Index r = 0; r < rows.rows(); ++r)
      for (Eigen::Index c = 0; c < rows.cols(); ++c)
        add_number(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(rows(r, c))), 4);
    Json made = {
        {"bufferView", view(bytes, target)}, {"componentType", gl_floats}, {"count", rows.rows()}, {"type", type}};
    if (bounds)
      for (Eigen::Index c = 0; c < rows.cols(); ++c) {
        made["min"].push_back(static_cast<float>(rows.col(c).minCoeff()));
        made["max"].push_back(static_cast<float>(rows.col(c).maxCoeff()));
      }
    return append("accessors", std::move(made));
  }

  void add_materials() {
    for (const CharacterMaterial& material : character_.materials) {
      Json surface = {
          {"baseColorFactor", material.color}, {"metallicFactor", 0}, {"roughnessFactor", material.roughness}};
      if (material.picture) {
        const std::size_t image =
            append("images", {{"bufferView", view(png(*material.picture), 0)}, {"mimeType", "image/png"}});
        surface["baseColorTexture"] = {{"index", append("textures", {{"source", image}})}};
      }
      Json made = {{"name", material.name}, {"pbrMetallicRoughness", std::move(surface)}};
      if (material.both_sides) made["doubleSided"] = true;
      if (material.color[3] < 1) made["alphaMode"] = "BLEND";
      (void)append("materials", std::move(made));
    }
  }

  void add_bones() {  // the nodes of the same numbers
    const std::vector<Bone>& bones = character_.skeleton.bones;
    for (const Bone& bone : bones) {
      const Vector3 from = bone.parent == no_index ? Vector3::Zero() : bones[detail::at(bone.parent)].head;
      const Vector3 at = bone.head - from;
      (void)append("nodes", {{"name", bone.name}, {"translation", {at[0], at[1], at[2]}}});
    }
    for (std::size_t b = 0; b < bones.size(); ++b) hang(b, bones[b].parent);
  }
  void hang(std::size_t node, Index parent) {
    if (parent == no_index)
      json_["scenes"][0]["nodes"].push_back(node);
    else
      json_["nodes"][detail::at(parent)]["children"].push_back(node);
  }

  Json primitive(const Part& part, const Vector3& origin) {
    const auto count = part.positions.rows();
    Json made;
    made["attributes"]["POSITION"] = floats(part.positions.rowwise() - origin.transpose(), "VEC3", gl_vertices, true);
    made["attributes"]["NORMAL"] = floats(part.normals, "VEC3", gl_vertices, false);
    if (part.texture.rows() > 0) made["attributes"]["TEXCOORD_0"] = floats(part.texture, "VEC2", gl_vertices, false);
    if (part.weights.rows() > 0) {
      std::string joints;
      Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(count, 4);
      for (Eigen::Index v = 0; v < count; ++v) {
        std::vector<BoneShare> strongest;
        for (Eigen::Index j = 0; j < part.weights.cols(); ++j)
          strongest.push_back({static_cast<Index>(j), part.weights(v, j)});
        (void)keep_strongest(strongest, 4);
        for (std::size_t i = 0; i < 4; ++i) {
          joints += static_cast<char>(i < strongest.size() ? strongest[i].bone : 0);
          if (i < strongest.size()) shares(v, static_cast<Eigen::Index>(i)) = strongest[i].weight;
        }
      }
      made["attributes"]["JOINTS_0"] = append(
          "accessors",
          {{"bufferView", view(joints, gl_vertices)}, {"componentType", gl_bytes}, {"count", count}, {"type", "VEC4"}});
      made["attributes"]["WEIGHTS_0"] = floats(shares, "VEC4", gl_vertices, false);
    }
    std::string indices;
    for (Eigen::Index f = 0; f < part.faces.rows(); ++f)
      for (int i = 0; i < 3; ++i)
        add_number(indices, static_cast<std::uint32_t>(part.faces(f, i)), count < 65536 ? 2 : 4);
    made["indices"] = append("accessors", {{"bufferView", view(indices, gl_corners)},
                                           {"componentType", count < 65536 ? gl_shorts : gl_ints},
                                           {"count", 3 * part.faces.rows()},
                                           {"type", "SCALAR"}});
    made["material"] = part.material;
    for (const Points<double>& target : part.targets)
      made["targets"].push_back({{"POSITION", floats(target, "VEC3", gl_vertices, true)}});
    return made;
  }

  void add_mesh(const CharacterMesh& mesh) {
    const Vector3 origin =
        mesh.parent == no_index ? Vector3::Zero() : character_.skeleton.bones[detail::at(mesh.parent)].head;
    Json made = {{"name", mesh.name}};
    for (const Part& part : mesh.parts) made["primitives"].push_back(primitive(part, origin));
    if (!mesh.target_names.empty()) {
      made["weights"] = std::vector<double>(mesh.target_names.size(), 0.0);
      made["extras"] = {{"targetNames", mesh.target_names}};
    }
    Json node = {{"name", mesh.name}, {"mesh", append("meshes", std::move(made))}};
    if (!mesh.joints.empty()) {
      Eigen::MatrixXd inverse(static_cast<Eigen::Index>(mesh.joints.size()), 16);
      for (std::size_t j = 0; j < mesh.joints.size(); ++j) {
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        matrix.topRightCorner<3, 1>() = -character_.skeleton.bones[detail::at(mesh.joints[j])].head;
        inverse.row(static_cast<Eigen::Index>(j)) = matrix.reshaped().transpose();
      }
      node["skin"] = append(
          "skins",
          {{"name", mesh.name}, {"inverseBindMatrices", floats(inverse, "MAT4", 0, false)}, {"joints", mesh.joints}});
    }
    hang(append("nodes", std::move(node)), mesh.parent);
  }

  void add_clip() {
    if (character_.clip.empty()) return;
    const std::vector<double>& seconds = character_.clip.front().seconds;
    const std::size_t times =
        floats(Eigen::Map<const Eigen::VectorXd>(seconds.data(), static_cast<Eigen::Index>(seconds.size())), "SCALAR",
               0, true);
    Json made = {{"name", "turn"}};
    for (const CharacterTurn& turn : character_.clip) {
      Eigen::MatrixXd turns(static_cast<Eigen::Index>(turn.degrees.size()), 4);
      for (std::size_t i = 0; i < turn.degrees.size(); ++i) {
        const elementary::SinCos half = elementary::sincos(turn.degrees[i] * std::numbers::pi / 360);
        turns.row(static_cast<Eigen::Index>(i)) << half.sin * turn.axis.transpose(), half.cos;
      }
      made["channels"].push_back({{"sampler", made.contains("samplers") ? made["samplers"].size() : 0},
                                  {"target", {{"node", turn.bone}, {"path", "rotation"}}}});
      made["samplers"].push_back({{"input", times}, {"output", floats(turns, "VEC4", 0, false)}});
    }
    (void)append("animations", std::move(made));
  }

  const Character& character_;
  Json json_;
  std::string bytes_;
};

}  // namespace

std::string character_glb(const Character& character) { return Writer(character).file(); }

Points<double> vertex_normals(const Points<double>& positions, const Triangles& faces) {
  Points<double> normals = Points<double>::Zero(positions.rows(), 3);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Vector3 a = positions.row(faces(f, 0)), b = positions.row(faces(f, 1)), c = positions.row(faces(f, 2));
    for (int i = 0; i < 3; ++i) normals.row(faces(f, i)) += (b - a).cross(c - a).transpose();
  }
  for (Eigen::Index v = 0; v < normals.rows(); ++v) {
    const double length = normals.row(v).norm();
    normals.row(v) = length > 0 ? Eigen::RowVector3d(normals.row(v) / length) : Eigen::RowVector3d(0, 1, 0);
  }
  return normals;
}

}  // namespace quadrig::samples
