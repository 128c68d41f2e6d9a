#include "version.hpp"

#include "quadrig/solver.hpp"
#include "quadrig/subdivision.hpp"
#include "quadrig_commit.hpp"

namespace quadrig::cli {

std::vector<std::string> version_lines() {
  std::vector<std::string> lines{"quadrig " QUADRIG_VERSION};
  if (const std::string commit = QUADRIG_COMMIT; !commit.empty()) lines.push_back("commit " + commit);
  const std::string decoders = QUADRIG_DECODERS;
  std::string with, without;
  const auto part = [&](const char* name, bool built) {
    std::string& list = built ? with : without;
    list += (list.empty() ? "" : ", ") + std::string(name);
  };
  part("meshoptimizer", decoders.find("meshoptimizer") != std::string::npos);
  part("OpenSubdiv", can_subdivide());
  part("Draco", decoders.find("draco") != std::string::npos);
  for (const char* backend : {"cholmod-simplicial-lgpl", "cholmod-supernodal-gpl"})
    part(backend, solver_built<double>(backend));
  if (!with.empty()) lines.push_back("with " + with);
  if (!without.empty()) lines.push_back("without " + without);
  return lines;
}

std::string version_text() {
  std::string text;
  for (const std::string& line : version_lines()) text += (text.empty() ? "" : "\n") + line;
  return text;
}

}  // namespace quadrig::cli
