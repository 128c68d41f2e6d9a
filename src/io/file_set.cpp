// The files that one job reads and writes: checked before the work, written together after it.
#include <algorithm>
#include <cstdio>
#include <random>

#if defined(__unix__) || defined(__APPLE__)
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#define QUADRIG_POSIX 1
#endif

#include "scan.hpp"

namespace quadrig {
namespace {

namespace fs = std::filesystem;

/// Signals that end a process wait while this lives, so that none leaves temporary files behind. Only the calling
/// thread is held: the command has no other while it writes.
class SignalsHeld {
 public:
#ifdef QUADRIG_POSIX
  SignalsHeld() {
    sigset_t held;
    sigemptyset(&held);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGALRM}) sigaddset(&held, signal);
    active_ = pthread_sigmask(SIG_BLOCK, &held, &before_) == 0;
  }
  ~SignalsHeld() {
    if (active_) pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
#else
  SignalsHeld() = default;
#endif
  SignalsHeld(const SignalsHeld&) = delete;
  SignalsHeld& operator=(const SignalsHeld&) = delete;

#ifdef QUADRIG_POSIX
 private:
  sigset_t before_{};
  bool active_ = false;
#endif
};

/// Writes all of it. \return whether the device took it
bool put(const fs::path& path, const char* mode, std::string_view contents) {
  errno = 0;
  std::FILE* file = std::fopen(path.c_str(), mode);
  if (!file) return false;
  const bool written = std::fwrite(contents.data(), 1, contents.size(), file) == contents.size();
  const int error = errno;
  if (std::fclose(file) != 0) return false;
  if (!written) errno = error;
  return written;
}

/// Likewise to standard output. A reader that has closed its end has what it wanted.
bool put_out(std::string_view contents) {
  errno = 0;
  const bool written = std::fwrite(contents.data(), 1, contents.size(), stdout) == contents.size();
  return (std::fflush(stdout) == 0 && written) || errno == EPIPE;
}

/// Replaces files by new ones, all or none: what was there is kept under a second name until the last is in place.
class Replacement {
 public:
  ~Replacement() {
    std::error_code ignored;
    if (!complete_)
      for (auto one = places_.rbegin(); one != places_.rend(); ++one) {
        if (one->placed && !one->kept) fs::remove(one->place, ignored);
        // Where both names are of one file rename does nothing, and the removal below takes the second name.
        if (one->kept) fs::rename(one->old, one->place, ignored);
      }
    for (const Place& one : places_) {
      if (!one.temporary.empty() && !one.placed) fs::remove(one.temporary, ignored);
      if (one.kept) fs::remove(one.old, ignored);
    }
    if (!complete_)
      for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder) fs::remove(*folder, ignored);
  }
  Replacement() = default;
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;

  /// What cannot be made is told by the files that are to be in it.
  void make_folder(const fs::path& folder) {
    std::error_code ignored;
    if (folder.empty() || fs::exists(folder, ignored)) return;
    make_folder(folder.parent_path());
    folders_.push_back(folder);  // first, so that no failure leaves one that is not known
    if (!fs::create_directory(folder, ignored)) folders_.pop_back();
  }

  Status write(const fs::path& place, std::string_view contents) {
    for (int attempt = 0; attempt < 16; ++attempt) {
      Place made;
      made.place = place;
      const std::string name = ".quadrig-" + std::to_string(entropy_() % 1'000'000'000U);
      made.temporary = place.parent_path() / name;
      made.old = place.parent_path() / (name + ".old");
      places_.push_back(std::move(made));
      if (put(places_.back().temporary, "wbx", contents)) return {};  // x: never another's file
      if (errno != EEXIST)
        return io::file_error(place, "cannot be written: " + io::system_reason(),
                              "check its folder's rights and the space on the disk");
      places_.pop_back();
    }
    return io::file_error(place, "no temporary name is free beside it", "clean its folder");
  }

  Status place_all() {
    for (std::size_t k = 0; k < places_.size(); ++k) {
      Place& one = places_[k];
      std::error_code error;
      // A rename replaces at once, so the last one needs nothing to go back to.
      if (k + 1 < places_.size() && fs::is_regular_file(fs::symlink_status(one.place, error))) {
        fs::create_hard_link(one.place, one.old, error);
        if (error) fs::rename(one.place, one.old, error);  // a file system without hard links
        if (error) return io::file_error(one.place, "cannot be replaced: " + error.message(), "check the rights");
        one.kept = true;
      }
      fs::rename(one.temporary, one.place, error);
      if (error) return io::file_error(one.place, "cannot be written: " + error.message(), "check the rights");
      one.placed = true;
    }
    complete_ = true;
    return {};
  }

 private:
  struct Place {
    fs::path place, temporary, old;
    bool placed = false, kept = false;
  };
  std::vector<Place> places_;
  std::vector<fs::path> folders_;  // that were made, the outermost first
  bool complete_ = false;
  std::random_device entropy_;
};

bool special(const fs::path& path) {
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

}  // namespace

/// What a file is known by: its name without links and spellings and, where it is there, its number on its device.
std::vector<std::string> FileSet::keys_of(const fs::path& path) const {
  if (is_stream(path)) return {"standard output"};
  std::vector<std::string> keys = {"name " + io::canonical_name(io::followed(path)).string()};
#ifdef QUADRIG_POSIX
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0)
    keys.push_back("number " + std::to_string(status.st_dev) + " " + std::to_string(status.st_ino));
#endif
  return keys;
}

void FileSet::make_folder(const fs::path& folder) {
  if (!folder.empty()) folders_.insert(folder);
}

const FileSet::Entry* FileSet::entry_at(const std::vector<std::string>& keys) const {
  for (const std::string& key : keys)
    if (const auto found = outputs_.find(key); found != outputs_.end()) return &entries_[found->second];
  return nullptr;
}

Status FileSet::reads(const fs::path& path) {
  if (path.empty() || special(path)) return {};
  const std::vector<std::string> keys = keys_of(path);
  if (const Entry* taken = entry_at(keys))
    return Error{ErrorCode::bad_option, "would be written over " + path.string() + ", which is read",
                 taken->named.string(), "give each output a name of its own"};
  for (const std::string& key : keys) inputs_.emplace(key, path);
  return {};
}

bool FileSet::uses_standard_output() const {
  return std::ranges::any_of(entries_, [&](const Entry& entry) { return is_stream(entry.named); });
}

Status FileSet::writes(const fs::path& path) {
  std::error_code ignored;
  if (path.empty() || path.filename().empty() || fs::is_directory(path, ignored))
    return io::file_error(path, "is not the name of a file", "name a file to write");
  Entry entry;
  entry.named = path;
  entry.device = is_stream(path) || special(path);
  entry.place = entry.device ? path : io::followed(path);  // a link to a pipe names no place
  const std::vector<std::string> keys = keys_of(path);
  if (!entry.device)
    for (const std::string& key : keys)
      if (const auto input = inputs_.find(key); input != inputs_.end())
        return Error{ErrorCode::bad_option, "would be written over " + input->second.string() + ", which is read",
                     path.string(), "give each output a name of its own"};
  if (entry_at(keys))
    return Error{ErrorCode::bad_option, "would be written twice", path.string(), "give each output a name of its own"};
#ifdef QUADRIG_POSIX
  if (!entry.device) {
    fs::path folder = entry.place.parent_path();
    if (folders_.contains(path.parent_path()))
      while (!folder.empty() && !fs::exists(folder, ignored)) folder = folder.parent_path();
    errno = 0;
    if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) != 0)
      return io::file_error(path, "cannot be written: " + io::system_reason(),
                            "check that its folder is there and may be written");
  }
#endif
  entries_.push_back(std::move(entry));
  for (const std::string& key : keys) outputs_.emplace(key, entries_.size() - 1);
  return {};
}

Status FileSet::add(const fs::path& path, std::string contents) {
  const Entry* found = path.empty() ? nullptr : entry_at(keys_of(path));
  if (!found) {
    if (Status status = writes(path); !status) return status;
    found = &entries_.back();
  } else if (found->contents && *found->contents != contents) {
    return Error{ErrorCode::bad_option, "would be written twice", path.string(), "give each output a name of its own"};
  }
  entries_[static_cast<std::size_t>(found - entries_.data())].contents = std::move(contents);
  return {};
}

Status FileSet::add_beside(const fs::path& place, const fs::path& name, std::string contents) {
  const fs::path path = place.parent_path() / name;
  std::error_code error;
  const auto whole = [](const fs::path& folder) { return io::canonical_name(folder.empty() ? "." : folder); };
  const fs::path inside = whole(path).lexically_relative(whole(place.parent_path()));
  if (inside.empty() || *inside.begin() == "..")
    return io::file_error(path, "leaves the folder of " + place.string() + " by a link",
                          "write into a folder without that link");
  const fs::file_status status = fs::status(path, error);
  if (fs::exists(status)) {
    if (!fs::is_regular_file(status))
      return io::file_error(path, "is there and is no regular file", "write into another folder");
    if (entry_at(keys_of(path)) == nullptr) {
      Expected<std::string> before = io::read_file(path, {.bytes = contents.size()});
      if (before && *before == contents) return {};
      if (!replaces_beside)
        return Error{ErrorCode::bad_option, "is there with other bytes, and only the document names it", path.string(),
                     "write into another folder, or allow it (--force)"};
    }
  }
  make_folder(path.parent_path());
  return add(path, std::move(contents));
}

FileSet FileSet::trial() const {
  FileSet other;
  other.replaces_beside = replaces_beside;
  other.standard_output = standard_output;
  other.entries_ = entries_;
  other.outputs_ = outputs_;
  other.inputs_ = inputs_;
  other.folders_ = folders_;
  return other;
}

Status FileSet::commit() {
  // What is no file cannot be taken back: it comes first, so that its failure leaves no file.
  for (Entry& entry : entries_) {
    if (!entry.device || !entry.contents) continue;
    const bool stream = is_stream(entry.named);
    if (!(stream ? put_out(*entry.contents) : put(entry.place, "wb", *entry.contents)))
      return io::file_error(stream ? "standard output" : entry.place, "cannot be written: " + io::system_reason(),
                            "check the rights and the space");
    entry.contents.reset();
  }
  const SignalsHeld held;
  Replacement replacement;
  for (const fs::path& folder : folders_) replacement.make_folder(folder);
  for (const Entry& entry : entries_)
    if (entry.contents)
      if (Status status = replacement.write(entry.place, *entry.contents); !status) return status;
  if (Status status = replacement.place_all(); !status) return status;
  entries_.clear();
  outputs_.clear();
  folders_.clear();
  return {};
}

Status write_file(const fs::path& path, std::string_view contents) {
  FileSet files;
  if (Status status = files.add(path, std::string(contents)); !status) return status;
  return files.commit();
}

}  // namespace quadrig
