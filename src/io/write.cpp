// Text of the files that are written.
#include <charconv>
#include <map>

#include "quadrig/io.hpp"

namespace quadrig {
namespace {

void append(std::string& text, double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 17);
  text.append(buffer, end);
  (void)error;  // 17 digits, sign, point and exponent fit
}
void append(std::string& text, Index value) {
  char buffer[16];
  text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

template <class Faces>
std::string obj(const Points<double>& positions, const Faces& faces) {
  std::string text;
  text.reserve(static_cast<std::size_t>(positions.rows()) * 64 + static_cast<std::size_t>(faces.size()) * 8);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    text += 'v';
    for (int i = 0; i < 3; ++i) append(text += ' ', positions(v, i));
    text += '\n';
  }
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    text += 'f';
    for (Eigen::Index i = 0; i < faces.cols(); ++i) append(text += ' ', faces(f, i) + 1);
    text += '\n';
  }
  return text;
}

}  // namespace

std::string obj_text(const QuadMesh& mesh) { return obj(mesh.positions, mesh.quads); }
std::string obj_text(const Points<double>& positions, const Triangles& faces) { return obj(positions, faces); }

std::string tgf_text(const Skeleton& skeleton) {
  // Joints are shared only where a bone hangs on its parent's tail, so that reading back gives the same tree.
  const auto n = static_cast<std::size_t>(skeleton.bone_count());
  std::vector<Index> head(n, no_index), tail(n);
  std::vector<Vector3> joints;
  std::map<std::array<double, 3>, Index> roots;
  for (std::size_t b = 0; b < n; ++b) {
    const Bone& bone = skeleton.bones[b];
    const bool hangs =
        bone.parent != no_index && skeleton.bones[static_cast<std::size_t>(bone.parent)].tail == bone.head;
    if (!hangs) {
      const auto [place, fresh] =
          roots.emplace(std::array{bone.head[0], bone.head[1], bone.head[2]}, static_cast<Index>(joints.size()));
      if (fresh) joints.push_back(bone.head);
      head[b] = place->second;
    }
    tail[b] = static_cast<Index>(joints.size());
    joints.push_back(bone.tail);
  }
  std::string text;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    append(text, static_cast<Index>(j + 1));
    for (int i = 0; i < 3; ++i) append(text += ' ', joints[j][i]);
    text += '\n';
  }
  text += "#\n";
  for (std::size_t b = 0; b < n; ++b) {
    const Index from = head[b] != no_index ? head[b] : tail[static_cast<std::size_t>(skeleton.bones[b].parent)];
    append(text, from + 1);
    append(text += ' ', tail[b] + 1);
    text += '\n';
  }
  return text += "#\n";
}

std::string dmat_text(const Eigen::MatrixXd& matrix, DmatFormat format) {
  std::string text;
  if (format == DmatFormat::binary) text += "0 0\n";
  append(text, static_cast<Index>(matrix.cols()));
  append(text += ' ', static_cast<Index>(matrix.rows()));
  text += '\n';
  if (format == DmatFormat::binary) {
    text.append(reinterpret_cast<const char*>(matrix.data()), static_cast<std::size_t>(matrix.size()) * 8);
    return text;
  }
  text.reserve(static_cast<std::size_t>(matrix.size()) * 20);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    append(text, matrix.data()[i]);
    text += '\n';
  }
  return text;
}

std::string dmat_text(const SkinWeights& weights, DmatFormat format) {
  return dmat_text(Eigen::MatrixXd(weights), format);
}

Status write_obj(const std::filesystem::path& path, const QuadMesh& mesh) { return write_file(path, obj_text(mesh)); }
Status write_obj(const std::filesystem::path& path, const Points<double>& positions, const Triangles& faces) {
  return write_file(path, obj_text(positions, faces));
}
Status write_tgf(const std::filesystem::path& path, const Skeleton& skeleton) {
  return write_file(path, tgf_text(skeleton));
}
Status write_dmat(const std::filesystem::path& path, const Eigen::MatrixXd& matrix, DmatFormat format) {
  return write_file(path, dmat_text(matrix, format));
}
Status write_dmat(const std::filesystem::path& path, const SkinWeights& weights, DmatFormat format) {
  return write_file(path, dmat_text(weights, format));
}

}  // namespace quadrig
