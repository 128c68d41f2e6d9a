// Bones and weights: TGF and DMAT.
#include <bit>
#include <cstring>
#include <map>

#include "scan.hpp"

namespace quadrig {

using io::at_line;
using io::shown;

Expected<Skeleton> read_tgf(const std::filesystem::path& path, const FileLimits& limits, Context& context) {
  Expected<std::string> text = io::read_file(path, limits);
  if (!text) return text.error();
  struct Joint {
    Vector3 position;
  };
  std::map<std::int64_t, Joint> joints;
  std::map<std::int64_t, Index> bone_ending_at;
  std::vector<std::pair<std::int64_t, std::int64_t>> ends;
  Skeleton skeleton;
  Index without_length = 0;
  int part = 0;
  io::Cursor cursor(*text);
  do {
    const std::string_view first = cursor.word();
    const std::size_t line = cursor.line();
    if (first.empty()) continue;
    if (first.front() == '#') {
      if (++part == 2) break;  // pseudo-edges follow in some files
      continue;
    }
    std::int64_t number = 0;
    if (!io::to_integer(first, number))
      return at_line(path, line, shown(first) + " is not a joint number", "check that the file is TGF");
    if (part == 0) {
      Joint joint;
      for (int i = 0; i < 3; ++i) {
        const std::string_view word = cursor.word();
        if (!io::to_number(word, joint.position[i]) || !std::isfinite(joint.position[i]))
          return at_line(path, line, "joint " + std::to_string(number) + ": " + shown(word) + " is not a finite number",
                         "give number, x, y and z");
      }
      if (joints.size() > static_cast<std::size_t>(limits.bones))
        return at_line(path, line, "more than " + std::to_string(limits.bones) + " joints", "raise the limit");
      if (!joints.emplace(number, joint).second)
        return at_line(path, line, "joint " + std::to_string(number) + " comes twice", "number each joint once");
    } else {
      std::int64_t tail = 0;
      const std::string_view word = cursor.word();
      if (!io::to_integer(word, tail))
        return at_line(path, line, shown(word) + " is not a joint number", "give the two joints of each bone");
      for (const std::int64_t joint : {number, tail})
        if (!joints.contains(joint))
          return at_line(path, line, "joint " + std::to_string(joint) + " does not exist",
                         "name joints of the first part");
      if (number == tail)
        return at_line(path, line, "a bone from joint " + std::to_string(number) + " to itself",
                       "give two different joints");
      if (skeleton.bone_count() >= limits.bones)
        return at_line(path, line, "more than " + std::to_string(limits.bones) + " bones", "raise the limit");
      Bone bone;
      bone.head = joints[number].position;
      bone.tail = joints[tail].position;
      bone.name = "bone" + std::to_string(skeleton.bone_count());
      if (bone.head == bone.tail) {
        bone.has_direction = false;
        ++without_length;
      }
      bone_ending_at.emplace(tail, skeleton.bone_count());
      ends.emplace_back(number, tail);
      skeleton.bones.push_back(std::move(bone));
    }
  } while (cursor.next_line());
  if (skeleton.bones.empty())
    return io::in_file(path, "has no bones", "give joints, a line '#', and one line of two joint numbers a bone");
  for (std::size_t b = 0; b < ends.size(); ++b) {
    const auto found = bone_ending_at.find(ends[b].first);
    if (found != bone_ending_at.end()) skeleton.bones[b].parent = found->second;
  }
  std::vector<std::size_t> walk(ends.size(), ends.size());  // the first walk upward that came by each bone
  for (std::size_t b = 0; b < ends.size(); ++b) {
    auto up = b;
    while (walk[up] == ends.size()) {
      walk[up] = b;
      const Index next = skeleton.bones[up].parent;
      if (next == no_index) break;
      if (walk[static_cast<std::size_t>(next)] == b) {  // a ring of bones, cut at the first of the file
        Index first = next;
        for (Index k = skeleton.bones[static_cast<std::size_t>(next)].parent; k != next;
             k = skeleton.bones[static_cast<std::size_t>(k)].parent)
          first = std::min(first, k);
        skeleton.bones[static_cast<std::size_t>(first)].parent = no_index;
        break;
      }
      up = static_cast<std::size_t>(next);
    }
  }
  if (without_length > 0)
    context.warn("read", path.string() + ": " + std::to_string(without_length) +
                             (without_length == 1 ? " bone" : " bones") + " of zero length, without direction");
  return skeleton;
}

Expected<Eigen::MatrixXd> read_dmat(const std::filesystem::path& path, const FileLimits& limits,
                                    const Context* context) {
  Expected<std::string> text = io::read_file(path, limits, context);
  if (!text) return text.error();
  io::Cursor cursor(*text);
  std::int64_t columns = 0, rows = 0;
  bool binary = false;
  while (true) {
    const std::string_view first = cursor.word_across(), second = cursor.word_across();
    if (!io::to_integer(first, columns) || !io::to_integer(second, rows) || columns < 0 || rows < 0)
      return at_line(path, cursor.line(),
                     shown(first) + " " + shown(second) + " are not the numbers of columns and rows",
                     "check that the file is DMAT");
    if (columns != 0 || rows != 0 || binary) break;
    binary = true;
  }
  if (columns == 0 || rows == 0) return io::in_file(path, "holds no values", "give one row a vertex");
  const std::string announced = std::to_string(columns) + " columns of " + std::to_string(rows) + " values";
  if (rows > limits.vertices || columns > limits.bones)
    return at_line(path, cursor.line(), announced + " are more than the limit", "raise the limit");
  if (binary && !cursor.next_line()) return io::in_file(path, "ends after its counts", "check that it is complete");
  const std::uint64_t values = static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns);
  if (values > (binary ? cursor.bytes_left() / 8 : (cursor.bytes_left() + 1) / 2))
    return at_line(path, cursor.line(), announced + " are announced, more than the file can hold",
                   "check that the file is complete");
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
  if (binary) {
    static_assert(std::endian::native == std::endian::little, "DMAT holds little-endian doubles");
    std::memcpy(matrix.data(), cursor.position(), static_cast<std::size_t>(values) * 8);
    for (Eigen::Index i = 0; i < matrix.size(); ++i)
      if (!std::isfinite(matrix.data()[i]))
        return io::in_file(path,
                           "value of row " + std::to_string(i % matrix.rows()) + ", column " +
                               std::to_string(i / matrix.rows()) + " is not finite",
                           "give numbers");
    return matrix;
  }
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    if (i % 65536 == 0 && context && context->cancelled()) return cancelled_error("read");
    const std::string_view word = cursor.word_across();
    if (word.empty())
      return at_line(path, cursor.line(), "the text ends after " + std::to_string(i) + " of " + announced,
                     "check that the file is complete");
    if (!io::to_number(word, matrix.data()[i]) || !std::isfinite(matrix.data()[i]))
      return at_line(path, cursor.line(), shown(word) + " is not a finite number", "give numbers");
  }
  return matrix;
}

}  // namespace quadrig
