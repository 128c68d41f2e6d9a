// Which files the command may write, and which it never does.
#include <sys/stat.h>

#include "cli/run_command.hpp"
#include "gltf_tube.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

constexpr const char* png = "\x89PNG\r\n\x1a\nnot much of a picture";

/// in/a.gltf, which names in/a.bin and the images; a buffer that is the binary chunk of no other.
void write_gltf(const ScratchFolder& folder, std::initializer_list<std::string> images) {
  std::filesystem::create_directories(folder / "in");
  write_text(folder / "in/a.glb", tube_file());
  REQUIRE(run_quadrig(folder, "copy in/a.glb in/a.gltf").exit_code == 0);
  std::filesystem::remove(folder / "in/a.glb");
  std::string json = read_text(folder / "in/a.gltf"), list;
  for (const std::string& image : images) list += (list.empty() ? "" : ",") + ("{\"uri\": \"" + image + "\"}");
  json.insert(json.find('{') + 1, "\"images\": [" + list + "],");
  write_text(folder / "in/a.gltf", json);
}

/// All files below the folder with their bytes.
std::vector<std::pair<std::string, std::string>> everything(const ScratchFolder& folder) {
  std::vector<std::pair<std::string, std::string>> all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path()))
    all.emplace_back(entry.path().string(), entry.is_regular_file() ? read_text(entry.path()) : "");
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

TEST_CASE("command: no output is written over a file that the input names, by whatever name", "[cli][gltf][fast]") {
  const ScratchFolder folder("files");
  write_gltf(folder, {"skin%20one.png", "../far.png", "lost.obj"});
  write_text(folder / "far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write_text(folder / "in/skin one.png", png);
  write_text(folder / "far.png", png);
  std::filesystem::create_directories(folder / "out");
  std::filesystem::create_symlink("../in/a.bin", folder / "out/link.bin");
  std::filesystem::create_hard_link(folder / "in/a.bin", folder / "out/hard.bin");
  std::filesystem::create_directory_symlink("../in", folder / "out/in");
  const auto before = everything(folder);
  for (const char* output : {"in/a.bin", "out/../in/./a.bin", "out/link.bin", "out/hard.bin", "out/in/a.bin",
                             "'in/skin one.png'", "far.png", "in/a.gltf", "out/in/a.gltf", "in/lost.obj"})
    for (const char* arguments :
         {"remesh in/a.gltf --quads 200 -o out/x.glb --report ",
          "remesh in/a.gltf --quads 200 --force -o out/x.glb --report ", "stats far.obj --input in/a.gltf --report ",
          "stats in/a.gltf --report ", "field in/a.gltf --report "}) {
      INFO(arguments << output);
      CHECK(run_quadrig(folder, std::string(arguments) + output).exit_code == 2);
      CHECK(everything(folder) == before);
    }
  for (const char* arguments :
       {"remesh in/a.gltf --quads 200 -o out/x.glb --quads-out in/lost.obj", "copy in/a.gltf out/in/a.gltf",
        "copy in/a.gltf in/../in/a.gltf", "remesh in/a.gltf --quads 200 -o in/a.gltf --force"}) {
    INFO(arguments);
    CHECK(run_quadrig(folder, arguments).exit_code == 2);
    CHECK(everything(folder) == before);
  }
  // The names of levels.
  std::filesystem::rename(folder / "in/a.gltf", folder / "in/x_LOD1.glb");
  const auto renamed = everything(folder);
  CHECK(run_quadrig(folder, "remesh in/x_LOD1.glb --quads 200,100 -o in/x.glb").exit_code == 2);
  CHECK(everything(folder) == renamed);
}

TEST_CASE("command: a file that only the document names replaces none that is there", "[cli][gltf][fast]") {
  const ScratchFolder folder("files");
  write_gltf(folder, {"skin.png"});
  write_text(folder / "in/skin.png", png);
  std::filesystem::create_directories(folder / "out");
  write_text(folder / "out/skin.png", "mine");
  const auto before = everything(folder);
  for (const char* arguments : {"copy in/a.gltf out/a.gltf", "remesh in/a.gltf --quads 200 -o out/a.glb"}) {
    INFO(arguments);
    const CommandResult refused = run_quadrig(folder, arguments);
    CHECK(refused.exit_code == 2);
    CHECK(has(refused.error, "--force"));
    CHECK(everything(folder) == before);
  }
  CHECK(run_quadrig(folder, "copy in/a.gltf out/a.gltf --force").exit_code == 0);
  CHECK(read_text(folder / "out/skin.png") == png);
  CHECK(run_quadrig(folder, "copy in/a.gltf out/b.gltf").exit_code == 0);  // the same bytes are there

  // The buffer beside a .gltf: of the document that is there, or of none.
  write_text(folder / "tube.glb", tube_file());
  CHECK(run_quadrig(folder, "remesh tube.glb --quads 200 -o t.gltf").exit_code == 0);
  CHECK(run_quadrig(folder, "remesh tube.glb --quads 300 -o t.gltf").exit_code == 0);
  std::filesystem::remove(folder / "t.gltf");
  CHECK(run_quadrig(folder, "remesh tube.glb --quads 200 -o t.gltf").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh tube.glb --quads 200 -o t.gltf --force").exit_code == 0);
}

TEST_CASE("command: hidden files, pipes and what is no image do not go with a document", "[cli][gltf][fast]") {
  for (const char* name : {".bashrc", ".ssh/authorized_keys", "sub/.hidden", "%2ebashrc", "pipe", "notes.txt"}) {
    INFO(name);
    const ScratchFolder folder("files");
    write_gltf(folder, {name});
    std::filesystem::create_directories(folder / "in/.ssh");
    std::filesystem::create_directories(folder / "in/sub");
    for (const char* file : {"in/.bashrc", "in/.ssh/authorized_keys", "in/sub/.hidden"}) write_text(folder / file, png);
    write_text(folder / "in/notes.txt", "secret");
    REQUIRE(::mkfifo((folder / "in/pipe").c_str(), 0600) == 0);
    std::filesystem::create_directories(folder / "out");
    for (const char* to : {"out/a.gltf", "out/a.glb"}) {
      const CommandResult result = run_quadrig(folder, std::string("copy in/a.gltf ") + to);
      CHECK((result.exit_code == 3 || result.exit_code == 4));
      CHECK(std::count(result.error.begin(), result.error.end(), '\n') == 1);
      CHECK(names_in(folder / "out").empty());
    }
  }
}

TEST_CASE("command: a link in the output's folder leads no file out of it", "[cli][gltf][fast]") {
  const ScratchFolder folder("files");
  write_gltf(folder, {"textures/skin.png"});
  std::filesystem::create_directories(folder / "in/textures");
  write_text(folder / "in/textures/skin.png", png);
  std::filesystem::create_directories(folder / "out");
  std::filesystem::create_directories(folder / "home");
  std::filesystem::create_directory_symlink("../home", folder / "out/textures");
  const auto before = everything(folder);
  CHECK(run_quadrig(folder, "copy in/a.gltf out/a.gltf").exit_code == 3);
  CHECK(run_quadrig(folder, "copy in/a.gltf out/a.gltf --force").exit_code == 3);
  CHECK(everything(folder) == before);
  std::filesystem::remove(folder / "out/textures");
  CHECK(run_quadrig(folder, "copy in/a.gltf out/a.gltf").exit_code == 0);
  CHECK(read_text(folder / "out/textures/skin.png") == png);
}

TEST_CASE("command: all outputs or none, devices too", "[cli][fast]") {
  if (!std::filesystem::exists("/dev/full")) return;
  const ScratchFolder folder("files");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 1000").exit_code == 0);
  const auto before = everything(folder);
  for (const char* arguments :
       {"remesh pear.obj --quads 300 -o q.obj --report /dev/full", "field pear.obj -o f.obj --report /dev/full",
        "dominance pear.obj --rig pear.tgf --weights pear.dmat -o d.ply --report /dev/full",
        "field pear.obj -o nowhere/f.obj"}) {
    INFO(arguments);
    CHECK(run_quadrig(folder, arguments).exit_code == 3);
    CHECK(everything(folder) == before);
  }
  for (const char* arguments : {"stats pear.obj", "stats pear.obj --json"}) {
    INFO(arguments);
    const std::string full = "('" QUADRIG_COMMAND "' " + std::string(arguments) + " > /dev/full)";
    CHECK(run_quadrig(folder, "--version; " + full).exit_code == 3);
    CHECK(everything(folder) == before);
  }
  // A reader that closes its end has what it wants.
  run_quadrig(folder, "--version; ('" QUADRIG_COMMAND "' remesh pear.obj --quads 300 -o q.obj; echo $? > code) | true");
  CHECK(read_text(folder / "code") == "0\n");
  CHECK(std::filesystem::exists(folder / "q.obj"));
  for (const char* arguments : {"stats q.obj", "stats q.obj --json"}) {
    INFO(arguments);
    run_quadrig(folder,
                "--version; (sleep 0.2; '" QUADRIG_COMMAND "' " + std::string(arguments) + "; echo $? > code) | true");
    CHECK(read_text(folder / "code") == "0\n");
  }
  const std::string longest(245, 'n');
  CHECK(run_quadrig(folder, "field pear.obj -o " + longest + ".obj").exit_code == 0);
}

TEST_CASE("command: limits of memory and time have exit codes of their own", "[cli][fast]") {
  const ScratchFolder folder("files");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 40000").exit_code == 0);
  const auto before = everything(folder);
  const std::string remesh = "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 20000 -o q.obj ";
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which take what they like
  const CommandResult memory = run_quadrig(folder, remesh + "--memory 40");
  CHECK(memory.exit_code == 10);
  CHECK(has(memory.error, "--memory"));
#endif
  const CommandResult time = run_quadrig(folder, remesh + "--time-limit 0.2");
  CHECK(time.exit_code == 12);
  CHECK(has(time.error, "--time-limit"));
  CHECK(everything(folder) == before);
}

TEST_CASE("command: a profile has every stage, within the stage that it is part of", "[cli][fast]") {
  const ScratchFolder folder("files");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 1000").exit_code == 0);
  const std::string remesh = "remesh pear.obj --rig pear.tgf --weights pear.dmat --quads 300 -o q.obj --profile p.json";
  const CommandResult run = run_quadrig(folder, remesh + " --threads 2");
  REQUIRE(run.exit_code == 0);
  for (const char* stage : {"command", "quads", "component", "attempt 1", "field", "map", "polish", "fit"})
    CHECK(has(run.output, std::string(stage) + "  "));
  CHECK(has(run.output, "peak memory"));
  const std::string trace = read_text(folder / "p.json");
  CHECK(trace.starts_with("{\n \"traceEvents\": ["));
  for (const char* stage : {"command", "quads", "component", "attempt", "field", "map", "polish", "fit"})
    CHECK(has(trace, "\"name\": \"" + std::string(stage) + "\""));
  CHECK(has(trace, "\"ph\": \"X\""));
  CHECK(has(trace, "\"name\": \"peak memory\""));
  std::filesystem::remove(folder / "q.obj");
  CHECK(run_quadrig(folder, remesh + "/none").exit_code == 3);  // found out before any work
  CHECK_FALSE(std::filesystem::exists(folder / "q.obj"));
  // Over nothing but a profile: neither an input, nor an output of the same run.
  const std::string mesh = read_text(folder / "pear.obj");
  CHECK(run_quadrig(folder, "field pear.obj --profile pear.obj").exit_code == 2);
  CHECK(read_text(folder / "pear.obj") == mesh);
  CHECK(run_quadrig(folder, "field pear.obj -o f.obj --profile f.obj").exit_code == 0);
  CHECK(read_text(folder / "f.obj").starts_with("# two lines a face"));
  CHECK(run_quadrig(folder, "field pear.obj --profile p.json").exit_code == 0);
  CHECK(read_text(folder / "p.json") != trace);
}

TEST_CASE("command: - is standard input and output", "[cli][slow]") {
  const ScratchFolder folder("streams-of-command");
  REQUIRE(run_quadrig(folder, "-q sample pear --triangles 2000 -o .").exit_code == 0);
  REQUIRE(run_quadrig(folder, "-q remesh pear.obj --quads 300 -o quads.obj").exit_code == 0);
  const std::string quads = read_text(folder / "quads.obj");

  const CommandResult piped = run_quadrig(folder, "remesh - --quads 300 -o - < pear.obj");
  CHECK(piped.exit_code == 0);
  CHECK(piped.output == quads);
  CHECK(has(piped.error, "irregular vertices"));
  CHECK(!std::filesystem::exists(folder / "-"));

  // Known by how it begins, not by a name.
  std::filesystem::copy_file(folder / "quads.obj", folder / "no-extension");
  CHECK(run_quadrig(folder, "stats no-extension").exit_code == 0);
  const CommandResult figures = run_quadrig(folder, "stats - --json < quads.obj");
  CHECK(figures.exit_code == 0);
  CHECK(has(figures.output, "\"standard input\""));
  CHECK(!has(figures.output, "/dev/fd"));

  // A failure leaves standard output empty, and names its input as the user sees it.
  write_text(folder / "noise", "no mesh at all");
  const CommandResult noise = run_quadrig(folder, "remesh - --quads 300 -o - < noise");
  CHECK(noise.exit_code == 5);
  CHECK(noise.output.empty());
  CHECK(has(noise.error, "standard input"));
  const CommandResult nothing = run_quadrig(folder, "remesh - --quads 300 -o - < /dev/null");
  CHECK(nothing.exit_code == 3);
  CHECK(nothing.output.empty());

  CHECK(run_quadrig(folder, "stats - - < quads.obj").exit_code == 2);
  const CommandResult twice = run_quadrig(folder, "remesh pear.obj --quads 300 -o - --report -");
  CHECK(twice.exit_code == 2);
  CHECK(twice.output.empty());
}

TEST_CASE("command: a glTF file goes through standard input and output", "[cli][slow]") {
  const ScratchFolder folder("gltf-streams");
  REQUIRE(run_quadrig(folder, "-q sample head -o head.glb").exit_code == 0);
  const CommandResult copied = run_quadrig(folder, "copy - - < head.glb");
  CHECK(copied.exit_code == 0);
  CHECK(copied.output == read_text(folder / "head.glb"));
  const CommandResult levels = run_quadrig(folder, "remesh - --quads 800,400 -o - < head.glb");
  CHECK(levels.exit_code == 2);
  CHECK(levels.output.empty());
}
