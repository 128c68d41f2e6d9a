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

Expected<std::string> io::read_text(const std::filesystem::path& path, const FileLimits& limits,
                                    const Context* context) {
  Expected<std::string> bytes = read_file(path, limits, context);
  if (!bytes) return bytes;
  return as_utf8(std::move(*bytes), path, context);
}

Expected<std::string> io::as_utf8(std::string bytes, const std::filesystem::path& path, const Context* context) {
  const bool little = bytes.starts_with("\xFF\xFE"), big = bytes.starts_with("\xFE\xFF");
  if (!little && !big) return bytes;
  std::string text;
  text.reserve(bytes.size() / 2);
  const std::size_t units = bytes.size() / 2;
  const auto unit = [&](std::size_t k) {
    const auto byte = [&](std::size_t at) { return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at])); };
    return little ? byte(2 * k) | byte(2 * k + 1) << 8 : byte(2 * k) << 8 | byte(2 * k + 1);
  };
  const auto broken = [&](std::size_t k) {
    return Error{ErrorCode::bad_input, "is no UTF-16", path.string() + ", byte " + std::to_string(2 * k),
                 "save the text as UTF-8"};
  };
  if (bytes.size() % 2 != 0) return broken(units);
  for (std::size_t k = 1; k < units; ++k) {
    if (context && k % (1 << 20) == 0 && context->cancelled()) return cancelled_error("read");
    std::uint32_t code = unit(k);
    if (code >= 0xD800 && code < 0xE000) {
      const std::uint32_t second = k + 1 < units ? unit(k + 1) : 0;
      if (code >= 0xDC00 || second < 0xDC00 || second >= 0xE000) return broken(k);
      code = 0x10000 + ((code - 0xD800) << 10) + (second - 0xDC00);
      ++k;
    }
    const auto put = [&](std::uint32_t byte) { text.push_back(static_cast<char>(byte)); };
    if (code < 0x80) {
      put(code);
    } else {
      const int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
      constexpr std::uint32_t lead[] = {0, 0xC0, 0xE0, 0xF0};
      put(lead[more] | code >> (6 * more));
      for (int n = more - 1; n >= 0; --n) put(0x80 | (code >> (6 * n) & 0x3F));
    }
  }
  return text;
}

}  // namespace quadrig
