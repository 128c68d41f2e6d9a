// Damaged files: each ends in a surface or an Error, within bounds of time and memory. Run under the sanitizers.
#include "gltf_tube.hpp"
#include "quadrig/gltf/surface.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

/// 64 bits that are the same on every machine (Steele et al. 2014, splitmix64).
struct Random {
  std::uint64_t state;
  std::uint64_t operator()() {
    std::uint64_t z = state += 0x9e3779b97f4a7c15ULL;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ z >> 27) * 0x94d049bb133111ebULL;
    return z ^ z >> 31;
  }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>((*this)() % n); }
};

/// Digits become other numbers, bytes other bytes, pieces are cut out, doubled or moved.
std::string damaged(std::string bytes, Random& random) {
  static const char* numbers[] = {"0", "1", "4294967295", "-1", "9007199254740992", "1e300", "0.5", "65536", "null"};
  for (std::size_t step = 0, steps = 1 + random.below(4); step < steps && bytes.size() > 40; ++step) {
    const std::size_t i = random.below(bytes.size());
    switch (random.below(6)) {
      case 0:
        bytes[i] = static_cast<char>(random());
        break;
      case 1: {  // a number
        const auto digit = bytes.find_first_of("0123456789", i);
        if (digit == std::string::npos) break;
        const auto end = bytes.find_first_not_of("0123456789", digit);
        bytes.replace(digit, end == std::string::npos ? std::string::npos : end - digit,
                      numbers[random.below(std::size(numbers))]);
        break;
      }
      case 2:
        bytes.erase(i, 1 + random.below(16));
        break;
      case 3:
        bytes.insert(i, bytes.substr(random.below(bytes.size()), 1 + random.below(64)));
        break;
      case 4: {  // a key loses its name
        const auto quote = bytes.find('"', i);
        if (quote != std::string::npos && quote + 1 < bytes.size()) bytes[quote + 1] = 'x';
        break;
      }
      default:
        bytes.resize(i);
        break;
    }
  }
  // Half of the time the header's lengths are mended, so that the JSON is reached.
  if (bytes.substr(0, 4) == "glTF" && bytes.size() > 20 && random.below(2) == 0) {
    const auto length = static_cast<std::uint32_t>(bytes.size());
    std::memcpy(bytes.data() + 8, &length, 4);
  }
  return bytes;
}

}  // namespace

TEST_CASE("gltf: every damaged file is read or refused by name", "[gltf]") {
  const GltfLimits limits{.bytes = 1 << 22, .json_bytes = 1 << 20, .values = 1 << 20, .nodes = 1000, .frames = 2000};
  Random random{20240607};
  const char* more = std::getenv("QUADRIG_MUTATIONS");
  const int count = more ? std::atoi(more) : 600;
  int read = 0, refused = 0;
  for (int k = 0; k < count; ++k) {
    const Tube tube{.sides = 5, .rings = 4, .two_materials = k % 3 == 0, .as_json = k % 2 == 0};
    const std::string bytes = damaged(tube_file(tube), random);
    INFO("mutation " << k);
    Context context;
    const Expected<GltfDocument> document = GltfDocument::parse(bytes, "damaged.glb", limits, context);
    if (!document) {
      ++refused;
      CHECK(!document.error().what.empty());
      continue;
    }
    const Expected<std::vector<GltfSurface>> surfaces = gltf_surfaces(*document, {}, {}, context);
    surfaces ? ++read : ++refused;
    if (!surfaces)
      CHECK(!surfaces.error().where.empty());
    else
      for (const GltfSurface& surface : *surfaces)
        CHECK((surface.skin == no_index || surface.asset.rig->weights.rows() > 0));
  }
  CHECK(read > count / 50);  // the damage is small enough that some of it is reached deep inside
  CHECK(refused > count / 4);
}
