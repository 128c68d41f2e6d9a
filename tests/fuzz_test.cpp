// The seeds of the fuzzers, replayed, and a fixed walk of small damage from each.
#include "fuzz/targets.hpp"
#include "test.hpp"

using namespace quadrig::test;

TEST_CASE("fuzz: every seed is taken", "[fuzz][fast]") {
  for (const FuzzTarget& target : fuzz_targets()) {
    std::size_t number = 0;
    for (const std::string& seed : target.seeds()) {
      INFO(target.name << " " << number++);
      CHECK(target.run(seed));
    }
  }
}

TEST_CASE("fuzz: damaged seeds are taken or refused", "[fuzz][fast]") {
  for (const FuzzTarget& target : fuzz_targets()) {
    std::minstd_rand random(1);
    int refused = 0, count = 0;
    for (const std::string& seed : target.seeds())
      for (int k = 0; k < 60; ++k) {
        std::string bytes = seed;
        for (int step = 0; step <= k % 3 && bytes.size() > 1; ++step) {
          const std::size_t at = random() % bytes.size();
          switch (random() % 4) {
            case 0:
              bytes[at] = static_cast<char>(random());
              break;
            case 1:
              bytes.erase(at, 1 + random() % 8);
              break;
            case 2:
              bytes.insert(at, bytes.substr(random() % bytes.size(), 1 + random() % 16));
              break;
            default:
              bytes.resize(at);
          }
        }
        ++count;
        refused += target.run(bytes) ? 0 : 1;
      }
    INFO(target.name << ": " << refused << " of " << count);
    CHECK(refused > 0);
  }
}
