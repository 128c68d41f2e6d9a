#include "includes/include_order.hpp"

#include "test.hpp"

using namespace quadrig::test;

namespace {

void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

}  // namespace

TEST_CASE("includes: a group sees all that stands left of it, also through other lines", "[includes][fast]") {
  const IncludeOrder order = parse_order("core < mesh < rig\nmesh < closest, prepare\nclosest, rig < polish\n");
  CHECK(order.at("core") == std::set<std::string>{"core"});
  CHECK(order.at("rig") == std::set<std::string>{"core", "mesh", "rig"});
  CHECK(order.at("prepare") == std::set<std::string>{"core", "mesh", "prepare"});
  CHECK(order.at("polish") == std::set<std::string>{"core", "mesh", "rig", "closest", "polish"});
}

TEST_CASE("includes: every kind of breach is found when a tree has one of each", "[includes][fast]") {
  const ScratchFolder root("includes");
  const IncludeOrder order = parse_order("core < mesh < quads < src\n");
  write(root / "include/quadrig/core.hpp", "#include <vector>\n#include <Eigen/Core>\n");
  write(root / "include/quadrig/mesh.hpp", "#include \"quadrig/core.hpp\"\n");
  write(root / "include/quadrig/quads.hpp", "#include \"quadrig/mesh.hpp\"\n#include \"quadrig/quads/extract.ipp\"\n");
  write(root / "include/quadrig/quads/extract.ipp", "#include \"quadrig/quads.hpp\"\n");
  write(root / "include/quadrig/c.h", "#include <stddef.h>\n");
  write(root / "src/io/obj.cpp", "#include \"quadrig/quads.hpp\"\n#include <zlib.h>\n");
  CHECK(include_violations(root.path(), order).empty());

  write(root / "include/quadrig/mesh.hpp", "// up\n  #  include \"quadrig/quads/extract.ipp\"\n");
  write(root / "include/quadrig/core.hpp", "#include <zlib.h>\n#include \"quadrig/gone.hpp\"\n");
  write(root / "include/quadrig/stray.hpp", "");
  write(root / "include/quadrig/c.h", "#include \"quadrig/core.hpp\"\n");
  CHECK(include_violations(root.path(), order) ==
        std::vector<std::string>{"include/quadrig/c.h:1: c.h stands alone",
                                 "include/quadrig/core.hpp:1: zlib.h is neither ours, nor Eigen's, nor standard",
                                 "include/quadrig/core.hpp:2: quadrig/gone.hpp is not there",
                                 "include/quadrig/mesh.hpp:2: mesh may not include quads",
                                 "include/quadrig/stray.hpp:1: module stray has no place in the order"});
}

TEST_CASE("includes: the tree keeps the order of docs/architecture.md", "[includes][fast]") {
  const std::filesystem::path root = QUADRIG_SOURCE_DIR;
  const IncludeOrder order = parse_order(order_block(root / "docs" / "architecture.md"));
  REQUIRE(order.size() > 10);
  CHECK(include_violations(root, order) == std::vector<std::string>{});
}

TEST_CASE("includes: nothing that decides takes functions that the C library chooses by the processor",
          "[includes][fast]") {
  const std::filesystem::path root = QUADRIG_SOURCE_DIR;
  const std::vector<std::string> theirs = {"sin",  "cos",   "tan",  "asin",  "acos",  "atan",  "atan2", "exp",
                                           "exp2", "expm1", "log",  "log2",  "log1p", "log10", "pow",   "cbrt",
                                           "sinh", "cosh",  "tanh", "polar", "arg",   "fma"};
  std::vector<std::string> found;
  std::size_t read = 0;
  for (const char* folder : {"include", "src"})
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const std::string name = entry.path().lexically_relative(root).generic_string();
      if (!entry.is_regular_file() || name.starts_with("src/picture/")) continue;  // pictures decide nothing
      std::ifstream file(entry.path());
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      ++read;
      for (const std::string& each : theirs)
        if (text.find("std::" + each + "(") != std::string::npos) found.push_back(name + ": std::" + each);
      for (const char* each : {"AngleAxis", ".slerp("})
        if (text.find(each) != std::string::npos) found.push_back(name + ": " + each);
    }
  CHECK(read > 100);
  CHECK(found == std::vector<std::string>{});
}

TEST_CASE("includes: every .ipp is compiled into the library once, by src/instantiate*.cpp", "[includes][fast]") {
  const std::filesystem::path root = QUADRIG_SOURCE_DIR;
  std::vector<std::string> there, compiled;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root / "include"))
    if (entry.path().extension() == ".ipp")
      there.push_back(entry.path().lexically_relative(root / "include").generic_string());
  for (const auto& entry : std::filesystem::directory_iterator(root / "src"))
    if (entry.path().filename().string().starts_with("instantiate"))
      for (const auto& include : includes_of(entry.path()))
        if (include.path.ends_with(".ipp")) compiled.push_back(include.path);
  std::sort(there.begin(), there.end());
  std::sort(compiled.begin(), compiled.end());
  CHECK(compiled == there);
}
