// Runs the built command in a scratch folder.
#pragma once

#include <sys/wait.h>

#include <algorithm>
#include <fstream>

#include "test.hpp"

namespace quadrig::test {

struct CommandResult {
  int exit_code = -1;  ///< −1 where a signal ended it
  std::string output, error;
};

inline std::string read_text(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}
inline void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// The command with these arguments; `arguments` are words for the shell, paths relative to the folder. A run longer
/// than two minutes counts as a hang and is ended with exit code 124.
inline CommandResult run_quadrig(const ScratchFolder& folder, const std::string& arguments) {
  const ScratchFolder streams("streams");
  const std::string line = "cd '" + folder.path().string() + "' && timeout 120 '" QUADRIG_COMMAND "' " + arguments +
                           " > '" + (streams / "out").string() + "' 2> '" + (streams / "err").string() + "'";
  const int status = std::system(line.c_str());
  CommandResult result;
  // A signal that ends the child of the shell shows as 128 and its number.
  if (WIFEXITED(status) && WEXITSTATUS(status) < 128) result.exit_code = WEXITSTATUS(status);
  result.output = read_text(streams / "out");
  result.error = read_text(streams / "err");
  return result;
}

[[nodiscard]] inline bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Names of the files in a folder, sorted.
inline std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace quadrig::test
