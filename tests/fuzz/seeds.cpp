// Writes the seeds of every target: quadrig-fuzz-seeds FOLDER makes FOLDER/TARGET/N.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "targets.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  for (const quadrig::test::FuzzTarget& target : quadrig::test::fuzz_targets()) {
    const std::filesystem::path folder = std::filesystem::path(argv[1]) / target.name;
    std::filesystem::create_directories(folder);
    int number = 0;
    for (const std::string& seed : target.seeds())
      std::ofstream(folder / std::to_string(number++), std::ios::binary) << seed;
  }
  return 0;
}
