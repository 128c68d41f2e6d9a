// What the text readers share: a whole file in memory, and a cursor that knows its line.
#pragma once

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

#include "quadrig/io.hpp"

namespace quadrig::io {

/// A file's bytes. \fails bad_file: not there, a folder, not readable, larger than the limit; cancelled, where there is
/// a context to ask.
[[nodiscard]] Expected<std::string> read_file(const std::filesystem::path& path, const FileLimits& limits,
                                              const Context* context = nullptr);

/// Text as UTF-8: UTF-16 is converted where a mark at its begin says so. \fails bad_input where that is broken;
/// cancelled
[[nodiscard]] Expected<std::string> as_utf8(std::string bytes, const std::filesystem::path& path,
                                            const Context* context = nullptr);
/// A text file as UTF-8. \fails as read_file and as_utf8
[[nodiscard]] Expected<std::string> read_text(const std::filesystem::path& path, const FileLimits& limits,
                                              const Context* context = nullptr);

/// The absolute name without links, `.` and `..`, as far as it is there.
[[nodiscard]] std::filesystem::path canonical_name(const std::filesystem::path& path);
/// Where a link leads, be that there or not.
[[nodiscard]] std::filesystem::path followed(std::filesystem::path path);

[[nodiscard]] inline Error file_error(const std::filesystem::path& path, std::string what, std::string remedy) {
  return {ErrorCode::bad_file, std::move(what), path.string(), std::move(remedy)};
}
/// Why the last call of the system failed.
[[nodiscard]] inline std::string system_reason() { return std::strerror(errno); }

[[nodiscard]] inline Error at_line(const std::filesystem::path& path, std::size_t line, std::string what,
                                   std::string remedy) {
  return {ErrorCode::bad_input, std::move(what), path.string() + ":" + std::to_string(line), std::move(remedy)};
}
[[nodiscard]] inline Error in_file(const std::filesystem::path& path, std::string what, std::string remedy) {
  return {ErrorCode::bad_input, std::move(what), path.string(), std::move(remedy)};
}

/// A word as an error message may show it: printable, and not long.
[[nodiscard]] inline std::string shown(std::string_view word) {
  std::string text = "'";
  for (const char c : word.substr(0, 24)) text += c >= 0x20 && c < 0x7f ? c : '?';
  return text + (word.size() > 24 ? "...'" : "'");
}

[[nodiscard]] inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// What ends the lines of a text: the first of '\n' and '\r', of both together '\n'.
[[nodiscard]] inline char line_end_of(std::string_view text) {
  const std::size_t first = text.find_first_of("\r\n");
  return first != std::string_view::npos && text[first] == '\r' && text.substr(first + 1, 1) != "\n" ? '\r' : '\n';
}

/// Reads words line by line.
class Cursor {
 public:
  explicit Cursor(std::string_view text)
      : at_(text.data()), end_(text.data() + text.size()), line_end_(line_end_of(text)) {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") at_ += 3;
  }
  [[nodiscard]] std::size_t line() const { return line_; }
  [[nodiscard]] bool at_end() const { return at_ == end_; }
  [[nodiscard]] bool at_line_end() const { return at_ == end_ || *at_ == '\n' || *at_ == '\r'; }
  [[nodiscard]] std::size_t bytes_left() const { return static_cast<std::size_t>(end_ - at_); }
  [[nodiscard]] const char* position() const { return at_; }

  /// The next word of this line; empty at its end. A comment, begun by `comment`, ends the line.
  std::string_view word(char comment = '\0') {
    while (at_ != end_ && *at_ != line_end_ && is_blank(*at_)) ++at_;
    const char* first = at_;
    if (at_ != end_ && comment && *at_ == comment) {
      while (at_ != end_ && *at_ != line_end_) ++at_;
      return {};
    }
    while (at_ != end_ && !is_blank(*at_) && *at_ != '\n' && !(comment && *at_ == comment)) ++at_;
    return {first, static_cast<std::size_t>(at_ - first)};
  }
  /// To the first character of the next line. False at the end of the text.
  bool next_line() {
    while (at_ != end_ && *at_ != line_end_) ++at_;
    if (at_ == end_) return false;
    ++at_;
    ++line_;
    return true;
  }
  /// The next word on this line or a later one; empty at the end of the text.
  std::string_view word_across(char comment = '\0') {
    while (true) {
      const std::string_view found = word(comment);
      if (!found.empty() || at_ == end_) return found;
      next_line();
    }
  }

 private:
  const char *at_, *end_;
  char line_end_;
  std::size_t line_ = 1;
};

/// The whole word as a number. Values too small for a double are 0; too large ones are infinite.
[[nodiscard]] inline bool to_number(std::string_view word, double& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  if (word.empty() || word.front() == '+') return false;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::result_out_of_range) value = std::strtod(std::string(word).c_str(), nullptr);
  return error != std::errc::invalid_argument && stop == word.data() + word.size();
}
template <class Integer>
[[nodiscard]] bool to_integer(std::string_view word, Integer& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  if (word.empty() || word.front() == '+') return false;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && stop == word.data() + word.size();
}

}  // namespace quadrig::io
