// Catch2 of either generation, and the way to the corpus.
#pragma once

#if __has_include(<catch2/catch_test_macros.hpp>)
#include <catch2/catch_approx.hpp>
#include <catch2/catch_template_test_macros.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
using Catch::Approx;  // in reach without its namespace, as in the older generation
#else
#include <catch2/catch.hpp>
#endif

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <random>
#include <string>

namespace quadrig::test {

#if defined(CATCH_VERSION_MAJOR) && CATCH_VERSION_MAJOR < 3
using Catch::Detail::Approx;  // Catch::Approx is a matcher there
#else
using Catch::Approx;
#endif

/// A file or folder of the corpus of real assets: $QUADRIG_CORPUS, or ../shared/corpus beside the source tree. The
/// corpus is not part of the project; nothing when the asset is absent, and the test is then reported as skipped.
[[nodiscard]] inline std::optional<std::filesystem::path> corpus(const std::string& name) {
  const char* set = std::getenv("QUADRIG_CORPUS");
  const std::filesystem::path root =
      set && *set ? std::filesystem::path(set) : std::filesystem::path(QUADRIG_SOURCE_DIR) / ".." / "shared" / "corpus";
  if (std::filesystem::exists(root / name)) return root / name;
  std::cout << "\nskipped: no " << name << " in the corpus; set QUADRIG_CORPUS to the folder that has it\n";
  return std::nullopt;
}

/// A new empty folder, removed with everything in it at the end of the test.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name) {
    std::random_device entropy;
    path_ = std::filesystem::temp_directory_path() / ("quadrig-" + name + "-" + std::to_string(entropy()));
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace quadrig::test
