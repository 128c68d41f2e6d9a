// Reads which module may include which from docs/architecture.md and compares the tree's #include lines with it.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace quadrig::test {

/// For every module, the modules it may include (itself and all that it sees through others).
using IncludeOrder = std::map<std::string, std::set<std::string>>;

/// Reads lines of the form `a, b < c < d, e`: each group sees the group to its left.
[[nodiscard]] inline IncludeOrder parse_order(const std::string& text) {
  IncludeOrder order;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::vector<std::string>> groups(1);
    std::string name;
    const auto end_name = [&] {
      if (!name.empty()) groups.back().push_back(std::exchange(name, {}));
    };
    for (const char c : line) {
      if (c == '<') {
        end_name();
        groups.emplace_back();
      } else if (c == ',' || c == ' ') {
        end_name();
      } else {
        name += c;
      }
    }
    end_name();
    for (std::size_t i = 0; i < groups.size(); ++i)
      for (const auto& module : groups[i]) {
        order[module].insert(module);
        if (i > 0) order[module].insert(groups[i - 1].begin(), groups[i - 1].end());
      }
  }
  for (bool grew = true; grew;) {
    grew = false;
    for (auto& [module, sees] : order) {
      const std::set<std::string> direct = sees;
      for (const auto& seen : direct) sees.insert(order[seen].begin(), order[seen].end());
      grew = grew || sees.size() != direct.size();
    }
  }
  return order;
}

/// The text of the block that begins with ```order in a Markdown file.
[[nodiscard]] inline std::string order_block(const std::filesystem::path& markdown) {
  std::ifstream file(markdown);
  std::string block;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (inside && line.starts_with("```")) return block;
    if (inside) block += line + "\n";
    if (line == "```order") inside = true;
  }
  return block;
}

/// The module of a path below include/: `quadrig/quads.hpp` and `quadrig/quads/extract.ipp` are both `quads`.
[[nodiscard]] inline std::string module_of(const std::filesystem::path& below_include) {
  auto part = below_include.begin();
  if (part == below_include.end() || *part != "quadrig" || ++part == below_include.end()) return {};
  return std::next(part) == below_include.end() ? part->stem().string() : part->string();
}

struct Include {
  int line;
  std::string path;
  bool quoted;
};

[[nodiscard]] inline std::vector<Include> includes_of(const std::filesystem::path& source) {
  std::vector<Include> found;
  std::ifstream file(source);
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    std::size_t at = line.find_first_not_of(" \t");
    if (at == std::string::npos || line[at] != '#') continue;
    at = line.find_first_not_of(" \t", at + 1);
    if (at == std::string::npos || line.compare(at, 7, "include") != 0) continue;
    const std::size_t open = line.find_first_of("<\"", at);
    if (open == std::string::npos) continue;
    const std::size_t close = line.find(line[open] == '<' ? '>' : '"', open + 1);
    if (close == std::string::npos) continue;
    found.push_back({number, line.substr(open + 1, close - open - 1), line[open] == '"'});
  }
  return found;
}

/// Everything in `root`/include and `root`/src that the order does not allow, one line each: file, line and reason.
[[nodiscard]] inline std::vector<std::string> include_violations(const std::filesystem::path& root,
                                                                 const IncludeOrder& order) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files;
  for (const char* folder : {"include", "src"})
    if (fs::exists(root / folder))
      for (const auto& entry : fs::recursive_directory_iterator(root / folder))
        if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());

  std::vector<std::string> violations;
  for (const auto& file : files) {
    const fs::path relative = file.lexically_relative(root);
    const std::string extension = file.extension().string();
    if (extension != ".hpp" && extension != ".ipp" && extension != ".h" && extension != ".cpp" && extension != ".c")
      continue;
    const auto blame = [&](int line, const std::string& reason) {
      violations.push_back(relative.generic_string() + ":" + std::to_string(line) + ": " + reason);
    };
    const bool public_header = *relative.begin() == "include";
    const bool c_interface = relative == fs::path("include/quadrig/c.h");
    // A file of solver/ wraps a library of its own, as subdivision.ipp does.
    const bool backend = relative.generic_string().starts_with("include/quadrig/solver/") ||
                         relative == fs::path("include/quadrig/subdivision.ipp");
    const std::string module = public_header ? module_of(file.lexically_relative(root / "include")) : "src";
    const auto known = order.find(module);
    if (!c_interface && known == order.end()) {
      blame(1, "module " + module + " has no place in the order");
      continue;
    }
    for (const Include& include : includes_of(file)) {
      const std::string included = module_of(include.path);
      if (included.empty()) {
        const bool eigen = include.path.starts_with("Eigen/");
        const bool standard = !include.quoted && include.path.find_first_of("/.") == std::string::npos;
        if (c_interface) {
          if (include.quoted || !include.path.ends_with(".h")) blame(include.line, "c.h stands alone");
        } else if (public_header && !standard && !eigen && !backend) {
          blame(include.line, include.path + " is neither ours, nor Eigen's, nor standard");
        }
        continue;
      }
      if (c_interface) {
        blame(include.line, "c.h stands alone");
      } else if (!fs::exists(root / "include" / include.path)) {
        blame(include.line, include.path + " is not there");
      } else if (include.path != "quadrig/c.h" && !known->second.contains(included)) {
        blame(include.line, module + " may not include " + included);
      }
    }
  }
  return violations;
}

}  // namespace quadrig::test
