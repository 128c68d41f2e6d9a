// Whole files in, and out by rename.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <random>

#include "scan.hpp"

namespace quadrig {
namespace {

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

Error file_error(const std::filesystem::path& path, const std::string& what, std::string remedy) {
  return {ErrorCode::bad_file, what, path.string(), std::move(remedy)};
}

std::string reason() { return std::strerror(errno); }

/// Whether all was written.
bool put(File file, std::string_view contents) {
  const bool written = std::fwrite(contents.data(), 1, contents.size(), file.get()) == contents.size();
  return std::fclose(file.release()) == 0 && written;
}

std::filesystem::path canonical_name(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error);
  std::filesystem::path result = std::filesystem::weakly_canonical(error ? path : whole, error);
  return error ? path.lexically_normal() : result;
}

std::filesystem::path followed(std::filesystem::path path) {
  std::error_code error;
  for (int links = 0; links < 40 && std::filesystem::is_symlink(path, error); ++links) {
    const std::filesystem::path target = std::filesystem::read_symlink(path, error);
    if (error) break;
    path = path.parent_path() / target;  // which is the target where that is absolute
  }
  return path;
}

}  // namespace

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code ignored;  // hard links are one file under two names; what is not there yet has none but its own
  return canonical_name(followed(a)) == canonical_name(followed(b)) || std::filesystem::equivalent(a, b, ignored);
}

Expected<std::string> io::read_file(const std::filesystem::path& path, const FileLimits& limits,
                                    const Context* context) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return file_error(path, "is a folder", "name a file");
  errno = 0;
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) return file_error(path, "cannot be opened: " + reason(), "check the name and the rights");
  const auto size = std::filesystem::file_size(path, ignored);
  const auto too_large = [&] {
    return file_error(path, "is larger than the limit of " + std::to_string(limits.bytes) + " bytes",
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
  if (std::ferror(file.get())) return file_error(path, "cannot be read: " + reason(), "check the disk");
  return bytes;
}

FileSet::~FileSet() {
  std::error_code ignored;
  for (const Entry& entry : entries_)
    if (!entry.temporary.empty()) std::filesystem::remove(entry.temporary, ignored);
  for (std::size_t k = folders_.size(); k-- > 0;) std::filesystem::remove(folders_[k], ignored);  // those left empty
}

void FileSet::make_folder(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (folder.empty() || std::filesystem::exists(folder, ignored)) return;
  make_folder(folder.parent_path());
  if (std::filesystem::create_directory(folder, ignored)) folders_.push_back(folder);
}

Status FileSet::add(const std::filesystem::path& path, std::string_view contents) {
  std::error_code ignored;
  if (path.empty() || path.filename().empty() || std::filesystem::is_directory(path, ignored))
    return file_error(path, "is not the name of a file", "name a file to write");
  const auto status = std::filesystem::status(path, ignored);
  const bool special = std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
  const std::filesystem::path place = special ? path : followed(path);  // a link to a pipe names no place
  for (const Entry& entry : entries_) {
    if (!same_file(entry.place, place)) continue;
    const Expected<std::string> before =
        entry.temporary.empty() ? Expected<std::string>(entry.contents)
                                : io::read_file(entry.temporary, {.bytes = std::numeric_limits<std::size_t>::max()});
    if (before && *before == contents) return {};
    return Error{ErrorCode::bad_option, "would be written twice", path.string(), "give each output a name of its own"};
  }
  if (special) {
    entries_.push_back({{}, place, std::string(contents)});
    return {};
  }
  std::random_device entropy;
  for (int attempt = 0; attempt < 16; ++attempt) {
    std::filesystem::path temporary = place;
    temporary += ".tmp" + std::to_string(entropy() % 1'000'000'000U);
    errno = 0;
    File file(std::fopen(temporary.c_str(), "wbx"));  // x: never another's file
    if (!file) {
      if (errno == EEXIST) continue;
      return file_error(path, "cannot be written: " + reason(), "check that its folder is there and may be written");
    }
    entries_.push_back({temporary, place, {}});
    if (!put(std::move(file), contents))
      return file_error(path, "cannot be written: " + reason(), "check the space on the disk");
    return {};
  }
  return file_error(path, "no temporary name is free beside it", "clean its folder");
}

Status FileSet::commit() {
  while (!entries_.empty()) {
    const Entry entry = entries_.front();
    if (entry.temporary.empty()) {
      errno = 0;
      File file(std::fopen(entry.place.c_str(), "wb"));
      if (!file || !put(std::move(file), entry.contents))
        return file_error(entry.place, "cannot be written: " + reason(), "check the rights");
    } else {
      std::error_code error;
      std::filesystem::rename(entry.temporary, entry.place, error);
      if (error) return file_error(entry.place, "cannot be written: " + error.message(), "check the rights");
    }
    entries_.erase(entries_.begin());
  }
  folders_.clear();
  return {};
}

Status write_file(const std::filesystem::path& path, std::string_view contents) {
  FileSet files;
  if (Status status = files.add(path, contents); !status) return status;
  return files.commit();
}

}  // namespace quadrig
