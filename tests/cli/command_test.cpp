#include "cli/run_command.hpp"

#include "quadrig/io.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

}  // namespace

TEST_CASE("command: help teaches by example, for each verb too", "[cli][fast]") {
  const ScratchFolder folder("cli");
  const CommandResult help = run_quadrig(folder, "--help");
  CHECK(help.exit_code == 0);
  CHECK(has(help.output, "Examples:"));
  CHECK(has(help.output, "Exit codes:"));
  for (const char* verb : {"remesh", "field", "dominance", "stats", "sample"}) {
    INFO(verb);
    CHECK(has(help.output, std::string("quadrig ") + (verb == std::string("dominance") ? "field" : verb)));
    const CommandResult of_verb = run_quadrig(folder, std::string(verb) + " --help");
    CHECK(of_verb.exit_code == 0);
    CHECK(has(of_verb.output, std::string("quadrig ") + verb));
  }
  const CommandResult version = run_quadrig(folder, "--version");
  CHECK(version.exit_code == 0);
  CHECK(version.output.starts_with("quadrig " QUADRIG_VERSION "\n"));
  for (const char* part : {"meshoptimizer", "Draco", "cholmod-simplicial-lgpl"}) CHECK(has(version.output, part));
  if (std::filesystem::exists(std::filesystem::path(QUADRIG_SOURCE_DIR) / ".git"))
    CHECK(has(version.output, "\ncommit "));
}

TEST_CASE("command: the manual page has every verb, every common option and every exit code", "[cli][fast]") {
  const ScratchFolder folder("cli");
  std::ifstream file(std::filesystem::path(QUADRIG_SOURCE_DIR) / "src/cli/installed/quadrig.1.in");
  const std::string page(std::istreambuf_iterator<char>(file), {});
  std::istringstream help(run_quadrig(folder, "--help").output);
  std::size_t verbs = 0;
  bool list = false;
  for (std::string line; std::getline(help, line);) {
    list = line == "Subcommands:" || (list && !line.empty());
    const std::string word = line.size() > 2 ? line.substr(2, line.find(' ', 2) - 2) : "";
    if (!list || line == "Subcommands:" || word.empty()) continue;
    INFO(word);
    CHECK(has(page, "\n.B " + word + "\n"));
    ++verbs;
  }
  CHECK(verbs >= 6);
  for (const char* option : {"\\-\\-quiet", "\\-\\-verbose", "\\-\\-threads", "\\-\\-version"})
    CHECK(has(page, option));
  for (int code = 0; code <= 9; ++code) CHECK(has(page, "\n.B " + std::to_string(code) + "\n"));
}

TEST_CASE("command: completions are the words of the help", "[cli][fast]") {
  const ScratchFolder folder("cli");
  const std::string bash = "bash -c 'source " QUADRIG_SOURCE_DIR
                           "/src/cli/installed/quadrig.bash; try() { COMP_WORDS=(\"$@\"); "
                           "COMP_CWORD=$(($# - 1)); _quadrig; echo \"${COMPREPLY[*]}\"; }; try " QUADRIG_COMMAND
                           " re; try " QUADRIG_COMMAND " remesh --weld-; try " QUADRIG_COMMAND
                           " remesh a.obj --weld s' > " +
                           (folder / "out").string() + " 2>&1";
  REQUIRE(std::system(bash.c_str()) == 0);
  std::ifstream out(folder / "out");
  CHECK(std::string(std::istreambuf_iterator<char>(out), {}) == "remesh\n--weld-distance\nseams\n");
}

TEST_CASE("command: a wrong option is one line and exit code 2", "[cli][fast]") {
  const ScratchFolder folder("cli");
  write_text(folder / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write_text(folder / "a.tgf", "1 0 0 0\n2 1 0 0\n#\n1 2\n");
  for (const char* arguments :
       {"", "polish a.obj", "stats", "stats a.obj --colour", "field a.obj --preset best", "field a.obj --rig a.tgf",
        "sample teapot -o d", "sample pear -o d --triangles 10", "sample pear --triangles 1000", "field a.obj -o a.obj",
        "field a.obj -o f.png", "field a.obj --threads -1", "field a.obj --weld sometimes"}) {
    INFO(arguments);
    const CommandResult result = run_quadrig(folder, arguments);
    CHECK(result.exit_code == 2);
    CHECK(result.output.empty());
    CHECK(lines(result.error) == 1);
    CHECK(has(result.error, "quadrig: "));
  }
  CHECK(names_in(folder.path()) == std::vector<std::string>{"a.obj", "a.tgf"});
}

TEST_CASE("command: parts that are missing and counts that are missed are exit code 9 where asked for", "[cli][fast]") {
  const ScratchFolder folder("cli");
  // A board: twelve triangles.
  write_text(folder / "board.obj",
             "v 0 0 0\nv 2 0 0\nv 2 1.5 0\nv 0 1.5 0\nv 0 0 .06\nv 2 0 .06\nv 2 1.5 .06\nv 0 1.5 .06\n"
             "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  const std::string remesh = "remesh board.obj --quads 116 -o quads.obj --report report.json ";
  CHECK(run_quadrig(folder, remesh).exit_code == 0);
  CHECK(run_quadrig(folder, remesh + "--strict-count --count-tolerance 0.001").exit_code == 9);
  CHECK(run_quadrig(folder, remesh + "--creases none --max-error 0").exit_code == 0);
  CHECK(run_quadrig(folder, remesh + "--creases none --max-error 0.0001").exit_code == 9);
  CHECK(run_quadrig(folder, remesh + "--creases 30").exit_code == 0);
  CHECK(run_quadrig(folder, remesh + "--creases sharp").exit_code == 2);
}

TEST_CASE("command: loose triangles whose corners nearly touch are told how to weld them", "[cli][fast]") {
  const ScratchFolder folder("cli");
  std::string text;
  constexpr int cells = 6;
  int vertices = 0;
  const auto corner = [&](int x, int y) {
    const double off = 1e-6 * (++vertices % 7);
    text += "v " + std::to_string(x + off) + " " + std::to_string(y - off) + " 0\n";
  };
  for (int x = 0; x < cells; ++x)
    for (int y = 0; y < cells; ++y) {
      corner(x, y), corner(x + 1, y), corner(x + 1, y + 1);
      corner(x, y), corner(x + 1, y + 1), corner(x, y + 1);
    }
  for (int v = 1; v < vertices; v += 3)
    text += "f " + std::to_string(v) + " " + std::to_string(v + 1) + " " + std::to_string(v + 2) + "\n";
  write_text(folder / "soup.obj", text);
  const auto loose = run_quadrig(folder, "remesh soup.obj --quads 36 -o quads.obj");
  CHECK(loose.exit_code == 0);
  const std::size_t told = loose.error.find("try --weld-distance ");
  REQUIRE(told != std::string::npos);
  const std::string distance = loose.error.substr(told + 20, loose.error.find('\n', told) - told - 20);
  const auto welded = run_quadrig(folder, "remesh soup.obj --quads 36 -o quads.obj --weld-distance " + distance);
  CHECK(welded.exit_code == 0);
  CHECK(welded.error.find("parts of one triangle") == std::string::npos);
}

TEST_CASE("command: a file that is not there or not writable is exit code 3", "[cli][fast]") {
  const ScratchFolder folder("cli");
  write_text(folder / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK(run_quadrig(folder, "stats none.obj").exit_code == 3);
  CHECK(run_quadrig(folder, "field a.obj --report nowhere/report.json").exit_code == 3);
  CHECK(run_quadrig(folder, "stats a.fbx").exit_code == 5);
  CHECK(names_in(folder.path()) == std::vector<std::string>{"a.obj"});
}

TEST_CASE("command: a sample loads without a warning, and its field and dominance are written", "[cli][fast]") {
  const ScratchFolder folder("cli");
  const CommandResult sample = run_quadrig(folder, "sample pear -o d/e --triangles 1000");
  CHECK(sample.exit_code == 0);
  CHECK(lines(sample.output) == 1);
  CHECK(names_in(folder / "d/e") == std::vector<std::string>{"pear.dmat", "pear.obj", "pear.tgf"});
  const std::string input = "d/e/pear.obj --rig d/e/pear.tgf --weights d/e/pear.dmat --strict ";
  const CommandResult field = run_quadrig(folder, "field " + input + "-o f.obj --report f.json");
  CHECK(field.exit_code == 0);
  CHECK(field.error.empty());
  CHECK(has(read_text(folder / "f.json"), "\"index_sum\": 8,"));
  CHECK(has(read_text(folder / "f.json"), "\"faces_omega1_above_0.9\": "));
  CHECK(has(read_text(folder / "f.obj"), "\nl 1 2\n"));
  CHECK(run_quadrig(folder, "field " + input + "-o f.rawfield -q").output.empty());
  CHECK(read_text(folder / "f.rawfield").rfind("4 ", 0) == 0);
  const CommandResult dominance = run_quadrig(folder, "dominance " + input + "-o c.ply --report d.json");
  CHECK(dominance.exit_code == 0);
  CHECK(has(read_text(folder / "d.json"), "\"blending_area_share\": "));
  Context context;
  const auto coloured = read_ply(folder / "c.ply", {}, context);
  REQUIRE(coloured.has_value());
  const auto original = read_obj(folder / "d/e/pear.obj", {}, context);
  REQUIRE(original.has_value());
  CHECK(coloured->positions == original->positions);
  CHECK(coloured->corners == original->corners);
}

TEST_CASE("command: stats tell a sound quad mesh from one that is not", "[cli][fast]") {
  const ScratchFolder folder("cli");
  write_text(folder / "cube.obj",
             "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
             "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  write_text(folder / "twisted.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 4 3\n");
  const CommandResult sound = run_quadrig(folder, "stats cube.obj --json --input cube.obj");
  CHECK(sound.exit_code == 0);
  for (const char* part : {"\"valid\": true", "\"quads\": 6", "\"irregular\": 8", "\"genus\": 0", "\"minimum\": 1.0"}) {
    INFO(part);
    CHECK(has(sound.output, part));
  }
  const std::size_t distance = sound.output.find("\"hausdorff\": ");
  REQUIRE(distance != std::string::npos);
  CHECK(std::stod(sound.output.substr(distance + 13)) < 1e-12);
  const CommandResult bad = run_quadrig(folder, "stats twisted.obj");
  CHECK(bad.exit_code == 9);
  CHECK(has(bad.output, "twisted.obj: not valid"));
  CHECK(has(bad.output, "scaled Jacobian 0 or less"));
}

TEST_CASE("command: no output is written over an input or another output, by whatever name", "[cli][fast]") {
  const ScratchFolder folder("cli");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 1000").exit_code == 0);
  const std::vector<std::string> before = names_in(folder.path());
  const std::string mesh = read_text(folder / "pear.obj");
  for (const char* arguments :
       {"stats pear.obj --report pear.obj", "stats pear.obj --input pear.obj --report ./pear.obj",
        "remesh pear.obj --quads 300 -o new.obj --report ./new.obj",
        "dominance pear.obj --rig pear.tgf --weights "
        "pear.dmat -o d.obj",
        "stats pear.obj --input pear.obj --poses clips", "stats pear.obj --select a",
        "remesh pear.obj --quads 300 -o new.obj --no-seams", "remesh pear.obj --quads 300 -o new.obj --binary-weights",
        "remesh pear.obj --quads 300 -o new.obj --quads-out new.ply"}) {
    INFO(arguments);
    CHECK(run_quadrig(folder, arguments).exit_code == 2);
    CHECK(names_in(folder.path()) == before);
  }
  CHECK(read_text(folder / "pear.obj") == mesh);
  const CommandResult told =
      run_quadrig(folder, "remesh --quads 300 pear.obj -o new.obj --report /dev/stdout --verbose 2>&1 | cat");
  INFO(told.error);
  CHECK(told.exit_code == 0);
  CHECK(has(told.output, "\"verb\": \"remesh\""));
  CHECK(has(told.output, "quadrig: component 0 of "));
  CHECK(read_text(folder / "new.obj").size() > 1000);
  // A name may be any bytes.
  std::filesystem::copy_file(folder / "pear.obj", folder / "a\xff.obj");
  const CommandResult odd = run_quadrig(folder, "remesh 'a\xff.obj' --quads 300 -o odd.obj --report odd.json");
  INFO(odd.error);
  CHECK(odd.exit_code == 0);
  CHECK(has(read_text(folder / "odd.json"), "\"mesh\": \"a\xEF\xBF\xBD.obj\""));
}

TEST_CASE("command: strict refuses what is mended otherwise", "[cli][fast]") {
  const ScratchFolder folder("cli");
  write_text(folder / "soup.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\nv 9 9 9\n");
  const CommandResult mended = run_quadrig(folder, "field soup.obj");
  CHECK(mended.exit_code == 0);
  CHECK(has(mended.error, "warning: prepare: 2 doubled vertices welded"));
  CHECK(has(mended.error, "warning: prepare: 1 vertex of no face dropped"));
  CHECK(run_quadrig(folder, "field soup.obj -q").error.empty());
  const CommandResult strict = run_quadrig(folder, "field soup.obj --strict");
  CHECK(strict.exit_code == 4);
  CHECK(lines(strict.error) == 1);
}

TEST_CASE("command: remesh writes quads, weights and report, the same bytes at any number of threads", "[cli][fast]") {
  const ScratchFolder folder("cli");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 2000 -q").exit_code == 0);
  const std::string rig = " --rig pear.tgf --weights pear.dmat";
  const CommandResult one = run_quadrig(
      folder, "remesh pear.obj" + rig + " --quads 500 --threads 1 -o q1.obj --weights-out w1.dmat --report r1.json");
  INFO(one.error);
  REQUIRE(one.exit_code == 0);
  CHECK(lines(one.output) == 1);
  const CommandResult many =
      run_quadrig(folder, "remesh pear.obj" + rig + " --quads 500 --threads 5 -o q5.obj --weights-out w5.dmat -q");
  CHECK(many.exit_code == 0);
  CHECK(many.output.empty());
  CHECK(read_text(folder / "q1.obj") == read_text(folder / "q5.obj"));
  CHECK(read_text(folder / "w1.dmat") == read_text(folder / "w5.dmat"));
  const std::string report = read_text(folder / "r1.json");
  for (const char* key : {"\"quads\": ", "\"irregular\": ", "\"scaled_jacobian\": {", "\"average\": ", "\"minimum\": ",
                          "\"seconds\": {", "\"warnings\": [", "\"options\": {", "\"quadrig\": \""}) {
    INFO(key);
    CHECK(has(report, key));
  }
  CHECK(has(run_quadrig(folder, "stats q1.obj").output, "q1.obj: valid"));
  CHECK(run_quadrig(folder, "remesh pear.obj" + rig + " --quads 500 -o q2.obj --map-out m.obj").exit_code == 0);
  CHECK(read_text(folder / "q1.obj") == read_text(folder / "q2.obj"));
  const std::string map = read_text(folder / "m.obj");
  for (const char* part : {"\nvt ", "\nf 1/", "\ng cut\nl ", "\ng singular_quads_3\np "}) CHECK(has(map, part));
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 -o x.obj --map-out m.ply").exit_code == 2);
  Context context;
  const auto quads = read_obj(folder / "q1.obj", {}, context);
  const auto weights = read_dmat(folder / "w1.dmat", {});
  REQUIRE((quads.has_value() && weights.has_value()));
  CHECK(std::abs(quads->polygon_count() - 500) <= 25);
  CHECK(weights->rows() == quads->vertex_count());
  CHECK(weights->cols() == 2);

  const std::vector<std::string> before = names_in(folder.path());
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 2 -o x.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 -o x.ply").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 -o pear.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 -o x.obj --weights-out x.dmat").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 --preset thesis -o x.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh pear.obj --quads 500 -o x.obj --report nowhere/r.json").exit_code == 3);
  CHECK(names_in(folder.path()) == before);
}
