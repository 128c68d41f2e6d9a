// Writes the synthetic surfaces as OBJ files: quadrig-synthetic FOLDER [PART OF A NAME]
#include <filesystem>
#include <iostream>

#include "corpus/synthetic.hpp"
#include "quadrig/io.hpp"

int main(int count, char** words) {
  if (count < 2 || count > 3) {
    std::cerr << "usage: quadrig-synthetic FOLDER [PART OF A NAME]\n";
    return 2;
  }
  const std::filesystem::path folder = words[1];
  const std::string_view part = count > 2 ? words[2] : "";
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  std::size_t written = 0;
  for (const auto& [name, make] : quadrig::test::synthetic_cases()) {
    if (name.find(part) == std::string::npos) continue;
    const quadrig::test::Soup soup = make();
    const quadrig::Status status = quadrig::write_obj(folder / (name + ".obj"), soup.positions(), soup.triangles());
    if (!status.ok()) {
      std::cerr << status.error().message() << '\n';
      return 1;
    }
    ++written;
  }
  std::cout << written << " surfaces in " << folder.string() << '\n';
  return written > 0 ? 0 : 1;
}
