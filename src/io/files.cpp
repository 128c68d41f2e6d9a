// Whole files in, and what names a file.
#include <cstdio>

#include "scan.hpp"

namespace quadrig {
namespace {

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

}  // namespace

std::filesystem::path io::canonical_name(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error);
  std::filesystem::path result = std::filesystem::weakly_canonical(error ? path : whole, error);
  return error ? path.lexically_normal() : result;
}

std::filesystem::path io::followed(std::filesystem::path path) {
  std::error_code error;
  for (int links = 0; links < 40 && std::filesystem::is_symlink(path, error); ++links) {
    const std::filesystem::path target = std::filesystem::read_symlink(path, error);
    if (error) break;
    path = path.parent_path() / target;  // which is the target where that is absolute
  }
  return path;
}

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code ignored;  // hard links are one file under two names; what is not there yet has none but its own
  return io::canonical_name(io::followed(a)) == io::canonical_name(io::followed(b)) ||
         std::filesystem::equivalent(a, b, ignored);
}

Expected<std::string> io::read_file(const std::filesystem::path& path, const FileLimits& limits,
                                    const Context* context) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return io::file_error(path, "is a folder", "name a file");
  errno = 0;
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) return io::file_error(path, "cannot be opened: " + system_reason(), "check the name and the rights");
  const auto size = std::filesystem::file_size(path, ignored);
  const auto too_large = [&] {
    return io::file_error(path, "is larger than the limit of " + std::to_string(limits.bytes) + " bytes",
                          "use a smaller file or raise the limit");
  };
  std::string bytes;
  if (!ignored) {
    if (size > limits.bytes) return too_large();
    bytes.reserve(static_cast<std::size_t>(size) + 1);
  }
  // The announced size is a hint only: pipes and growing files are read to their end, within the limit.
  for (constexpr std::size_t step = std::size_t{1} << 20;;) {
    const std::size_t had = bytes.size();
    const std::size_t room = bytes.capacity() > had ? bytes.capacity() - had : step;
    const std::size_t want = std::min(room, 8 * step);
    if (context && context->cancelled()) return cancelled_error("read");
    bytes.resize(had + want);
    const std::size_t got = std::fread(bytes.data() + had, 1, want, file.get());
    bytes.resize(had + got);
    if (bytes.size() > limits.bytes) return too_large();
    if (got < want) break;
  }
  if (std::ferror(file.get())) return io::file_error(path, "cannot be read: " + system_reason(), "check the disk");
  return bytes;
}

}  // namespace quadrig
