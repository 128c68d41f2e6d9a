// Files as a full disk, a broken transfer or a wrong tool leaves them.
#include <cstring>

#include "cli/run_command.hpp"
#include "quadrig/io.hpp"
#include "quadrig/samples.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

using Random = std::mt19937;

std::size_t below(Random& random, std::size_t n) { return n == 0 ? 0 : random() % n; }

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> result;
  std::size_t from = 0;
  for (std::size_t to; (to = text.find('\n', from)) != std::string::npos; from = to + 1)
    result.push_back(text.substr(from, to - from));
  if (from < text.size()) result.push_back(text.substr(from));
  return result;
}
std::string join(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

/// The rigged sample in every format that is read.
struct Originals {
  std::string obj, off, ply, binary_ply, tgf, dmat, binary_dmat;

  Originals() {
    Context context;
    const Expected<Asset> asset = make_sample("pear", 500, context);
    REQUIRE(asset.has_value());
    const TriangleMesh<double>& mesh = asset->mesh;
    obj = obj_text(mesh.positions(), mesh.faces());
    tgf = tgf_text(asset->rig->skeleton);
    dmat = dmat_text(asset->rig->weights);
    binary_dmat = dmat_text(asset->rig->weights, DmatFormat::binary);
    const std::string n = std::to_string(mesh.vertex_count()), m = std::to_string(mesh.face_count());
    off = "OFF\n" + n + " " + m + "\n";
    const std::string head = " 1.0\nelement vertex " + n +
                             "\nproperty double x\nproperty double y\nproperty double z\nelement face " + m +
                             "\nproperty list uchar int vertex_indices\nend_header\n";
    ply = "ply\nformat ascii" + head;
    binary_ply = "ply\nformat binary_little_endian" + head;
    std::string rows;
    for (const std::string& line : split(obj)) {
      if (line[0] != 'v') break;
      rows += line.substr(2) + "\n";
    }
    for (Index f = 0; f < mesh.face_count(); ++f) {
      rows += "3";
      for (int i = 0; i < 3; ++i) rows += " " + std::to_string(mesh.faces()(f, i));
      rows += "\n";
    }
    off += rows;
    ply += rows;
    binary_ply.append(reinterpret_cast<const char*>(mesh.positions().data()),
                      static_cast<std::size_t>(mesh.positions().size()) * 8);
    for (Index f = 0; f < mesh.face_count(); ++f) {
      binary_ply += '\3';
      binary_ply.append(reinterpret_cast<const char*>(mesh.faces().row(f).data()), 12);
    }
  }
};

/// Puts `word` in the place of a random word of a random line, of those from first_line to before last_line that begin
/// with `beginning`; where that ends in a blank, it is kept.
std::string replace_word(const std::string& text, const std::string& beginning, const std::string& word, Random& random,
                         std::size_t first_line = 0, std::size_t last_line = std::string::npos) {
  std::vector<std::string> lines = split(text);
  const std::size_t kept = !beginning.empty() && beginning.back() == ' ' ? beginning.size() : 0;
  std::vector<std::size_t> fit;
  for (std::size_t i = first_line; i < std::min(lines.size(), last_line); ++i)
    if (lines[i].rfind(beginning, 0) == 0 && lines[i].size() > kept) fit.push_back(i);
  REQUIRE_FALSE(fit.empty());
  std::string& line = lines[fit[below(random, fit.size())]];
  std::vector<std::size_t> starts;
  for (std::size_t i = kept; i < line.size(); ++i)
    if (line[i] != ' ' && (i == 0 || line[i - 1] == ' ')) starts.push_back(i);
  const std::size_t at = starts[below(random, starts.size())];
  line.replace(at, std::min(line.find(' ', at), line.size()) - at, word);
  return join(lines);
}

/// The text without a random line that begins with `beginning`.
std::string drop_line(const std::string& text, const std::string& beginning, Random& random,
                      std::size_t first_line = 0) {
  std::vector<std::string> lines = split(text);
  std::vector<std::size_t> fit;
  for (std::size_t i = first_line; i < lines.size(); ++i)
    if (lines[i].rfind(beginning, 0) == 0) fit.push_back(i);
  REQUIRE_FALSE(fit.empty());
  lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(fit[below(random, fit.size())]));
  return join(lines);
}

/// Cut at a random byte between two shares of the length.
std::string cut(const std::string& text, double from, double to, Random& random) {
  const auto a = static_cast<std::size_t>(from * static_cast<double>(text.size()));
  const auto b = static_cast<std::size_t>(to * static_cast<double>(text.size()));
  return text.substr(0, a + below(random, b - a));
}

struct Damage {
  std::string what, mesh_name, mesh, rig, weights;
};

const char* const no_numbers[] = {"x",   "nan", "-inf", "1e999",    "0x10",  "1,5",
                                  "--1", "1e",  ".",    "\xff\xfe", "1.0.0", "%s%n"};

/// Each of these leaves no asset that could be used.
Damage damaged(const Originals& good, unsigned seed) {
  Random random(seed);
  Damage d{"", "m.obj", good.obj, good.tgf, good.dmat};
  const std::string junk = no_numbers[below(random, std::size(no_numbers))];
  const auto surface = [&](const char* name, std::string text) {
    d.mesh_name = name;
    d.mesh = std::move(text);
  };
  const std::string far[] = {"0", "99999", "-99999", "2147483648", "-9223372036854775809", "1.5", "a/b"};
  const std::string out[] = {"-1", "99999", "4294967295", "99999999999999999999", "1.5"};
  switch (seed % 25) {
    case 0:
      d.what = "obj: no number", d.mesh = replace_word(good.obj, "v ", junk, random);
      break;
    case 1:
      d.what = "obj: no vertex", d.mesh = replace_word(good.obj, "f ", far[below(random, 7)], random);
      break;
    case 2:
      d.what = "obj: a vertex lost", d.mesh = drop_line(good.obj, "v ", random);
      break;
    case 3:
      d.what = "obj: cut among the vertices", d.mesh = cut(good.obj, 0, 0.7, random);
      break;
    case 4:
      d.what = "obj: zeros in the middle", d.mesh.replace(d.mesh.size() / 2 - below(random, 999), 512, 512, '\0');
      break;
    case 5:
      d.what = "off: no number", surface("m.off", replace_word(good.off, "", junk, random, 2));
      break;
    case 6:
      d.what = "off: cut", surface("m.off", cut(good.off, 0, 0.99, random));
      break;
    case 7:
      d.what = "off: counts", surface("m.off", replace_word(good.off, "", "98765432109", random, 1, 2));
      break;
    case 8:
      d.what = "off: no vertex", surface("m.off", replace_word(good.off, "3 ", out[below(random, 5)], random));
      break;
    case 9:
      d.what = "ply: cut", surface("m.ply", cut(good.ply, 0, 0.99, random));
      break;
    case 10:
      d.what = "ply: no number", surface("m.ply", replace_word(good.ply, "", junk, random, 9));
      break;
    case 11:
      d.what = "ply: header", surface("m.ply", replace_word(good.ply, "p", "quad", random));
      break;
    case 12:
      d.what = "binary ply: cut", surface("m.ply", cut(good.binary_ply, 0, 1, random));
      break;
    case 13: {
      d.what = "binary ply: not a number";
      std::string bytes = good.binary_ply;
      const std::size_t body = bytes.find("end_header\n") + 11;
      const double nan = std::nan("");
      std::memcpy(bytes.data() + body + 8 * below(random, 600), &nan, 8);
      surface("m.ply", bytes);
      break;
    }
    case 14: {
      d.what = "binary ply: no vertex";
      std::string bytes = good.binary_ply;
      const std::int32_t bad = below(random, 2) ? -1 : 1 << 30;
      std::memcpy(bytes.data() + bytes.size() - 13 * (1 + below(random, 400)) + 1, &bad, 4);
      surface("m.ply", bytes);
      break;
    }
    case 15:
      d.what = "tgf: no number", d.rig = replace_word(good.tgf, std::to_string(1 + below(random, 3)), junk, random);
      break;
    case 16:
      d.what = "tgf: a joint lost", d.rig = drop_line(good.tgf, std::to_string(1 + below(random, 3)) + " 0", random);
      break;
    case 17:
      d.what = "tgf: cut", d.rig = cut(good.tgf, 0, 0.85, random);
      break;
    case 18:
      d.what = "tgf: a bone more", d.rig.insert(d.rig.size() - 2, "1 3\n");
      break;
    case 19:
      d.what = "dmat: cut", d.weights = cut(good.dmat, 0, 0.99, random);
      break;
    case 20:
      d.what = "dmat: no number", d.weights = replace_word(good.dmat, "0.", junk, random);
      break;
    case 21:
      d.what = "dmat: no partition",
      d.weights = replace_word(good.dmat, "0.", below(random, 2) ? "1.9" : "-0.8", random);
      break;
    case 22:
      d.what = "dmat: counts", d.weights = replace_word(good.dmat, "2 ", out[below(random, 5)], random);
      break;
    case 23:
      d.what = "binary dmat: cut", d.weights = cut(good.binary_dmat, 0, 1, random);
      break;
    case 24:
      d.what = "a format's text under another's name", surface("m.ply", seed % 2 ? good.obj : good.off);
      break;
  }
  return d;
}

std::string write_files(const ScratchFolder& folder, const Damage& d) {
  write_text(folder / d.mesh_name, d.mesh);
  write_text(folder / "r.tgf", d.rig);
  write_text(folder / "w.dmat", d.weights);
  return d.mesh_name + " --rig r.tgf --weights w.dmat ";
}

}  // namespace

TEST_CASE("damaged files: the sound ones are read in every format", "[cli][damaged][fast]") {
  const Originals good;
  for (const auto& [name, mesh] : {std::pair{"m.obj", good.obj}, std::pair{"m.off", good.off},
                                   std::pair{"m.ply", good.ply}, std::pair{"m.ply", good.binary_ply}})
    for (const std::string& weights : {good.dmat, good.binary_dmat}) {
      const ScratchFolder folder("sound");
      const std::string input = write_files(folder, {"", name, mesh, good.tgf, weights});
      const CommandResult result = run_quadrig(folder, "dominance --strict " + input);
      INFO(name << ": " << result.error);
      CHECK(result.exit_code == 0);
    }
}

TEST_CASE("damaged files: 200 of them are each an error, an exit code and nothing written but the report",
          "[cli][damaged][fast]") {
  const Originals good;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const ScratchFolder folder("damaged");
    const Damage d = damaged(good, seed);
    const std::string input = write_files(folder, d);
    const std::vector<std::string> before = names_in(folder.path());
    const CommandResult result =
        run_quadrig(folder, "remesh " + input + "--quads 200 -o q.obj --weights-out q.dmat --report q.json");
    INFO("seed " << seed << ", " << d.what << ": exit code " << result.exit_code << ", " << result.error);
    CHECK((result.exit_code == 4 || result.exit_code == 5));
    CHECK(result.error.rfind("quadrig: ", 0) == 0);
    CHECK(std::count(result.error.begin(), result.error.end(), '\n') == 1);
    CHECK((result.error.find(d.mesh_name) != std::string::npos || result.error.find("r.tgf") != std::string::npos ||
           result.error.find("w.dmat") != std::string::npos));
    CHECK(result.output.empty());
    CHECK(has(read_text(folder / "q.json"), "\"exit_code\": " + std::to_string(result.exit_code)));
    std::filesystem::remove(folder / "q.json");
    CHECK(names_in(folder.path()) == before);
  }
}

TEST_CASE("damaged files: bytes changed at random never end in a crash, a hang or half a file",
          "[cli][damaged][fast]") {
  const Originals good;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const ScratchFolder folder("random");
    Random random(1000 + seed);
    const std::string* surfaces[] = {&good.obj, &good.off, &good.ply, &good.binary_ply};
    const char* names[] = {"m.obj", "m.off", "m.ply", "m.ply"};
    const std::size_t format = below(random, 4);
    Damage d{"", names[format], *surfaces[format], good.tgf, below(random, 2) ? good.dmat : good.binary_dmat};
    std::string* parts[] = {&d.mesh, &d.rig, &d.weights};
    std::string& part = *parts[below(random, 3)];
    for (std::size_t changes = 1 + below(random, 8); changes-- > 0;) {
      const std::size_t at = below(random, part.size());
      switch (below(random, 4)) {
        case 0:
          part[at] = static_cast<char>(random());
          break;
        case 1:
          part[at] = "0123456789 -.e\n#"[below(random, 16)];
          break;
        case 2:
          part.erase(at, 1 + below(random, 40));
          break;
        case 3:
          part.insert(at, part.substr(below(random, part.size()), below(random, 60)));
          break;
      }
      if (part.empty()) part = " ";
    }
    const std::string input = write_files(folder, d);
    const std::vector<std::string> before = names_in(folder.path());
    const CommandResult result = run_quadrig(folder, "dominance " + input + "-o c.ply --report c.json");
    INFO("seed " << seed << ": exit code " << result.exit_code << ", " << result.error);
    CHECK(result.exit_code >= 0);
    CHECK(result.exit_code != 1);
    CHECK(result.exit_code <= 8);
    const std::size_t written = names_in(folder.path()).size() - before.size();
    CHECK(written == (result.exit_code == 0 ? 2 : result.exit_code == 2 ? 0 : 1));
  }
}
