#include "cli/run_command.hpp"
#include "gltf_tube.hpp"

using namespace quadrig;
using namespace quadrig::test;

TEST_CASE("command: a part of a glTF file that fails stays, is told, and is exit code 9", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "in.glb", tube_file({.broken = true}));
  const CommandResult done = run_quadrig(folder, "remesh in.glb --quads 200 -o out.glb --report r.json");
  INFO(done.error);
  CHECK(done.exit_code == 9);
  CHECK(has(done.error, "skins[1] 'bad' stays as it is: "));
  CHECK(has(done.error, "not finite"));
  CHECK(has(read_text(folder / "r.json"), "\"part\": \"skins[1] 'bad'\""));
  CHECK(run_quadrig(folder, "copy out.glb copy.gltf").exit_code == 0);
  const CommandResult strict = run_quadrig(folder, "remesh in.glb --quads 200 -o strict.glb --strict");
  CHECK(strict.exit_code == 4);
  CHECK(!std::filesystem::exists(folder / "strict.glb"));
}

TEST_CASE("command: VRM is read and written as itself, and a binary file whatever its name", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "in.vrm", tube_file());
  write_text(folder / "in.bin", tube_file());
  for (const char* name : {"in.vrm", "in.bin"}) {
    const CommandResult done = run_quadrig(folder, std::string("remesh ") + name + " --quads 150 -o out.vrm");
    INFO(done.error);
    CHECK(done.exit_code == 0);
    CHECK(has(done.output, "triangles in all"));
    CHECK(read_text(folder / "out.vrm").substr(0, 4) == "glTF");
    std::filesystem::remove(folder / "out.vrm");
  }
}

TEST_CASE("command: what strays or misses the count is told, and is exit code 9", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "in.glb", tube_file({.sides = 24, .rings = 32}));
  const CommandResult strict = run_quadrig(folder, "remesh in.glb --quads 60 -o out.glb --max-error 0.001");
  CHECK(strict.exit_code == 9);
  CHECK(has(strict.error, "strays"));
  CHECK(has(strict.output, "1 shell strays"));
  const CommandResult loose = run_quadrig(folder, "remesh in.glb --quads 300 -o out.glb --max-error 0");
  INFO(loose.error);
  CHECK(loose.exit_code == 0);
  CHECK(!has(loose.error, "strays"));
  const std::string exact = "remesh in.glb --quads 300 -o out.glb --max-error 0 --count-tolerance 0.00001";
  CHECK(run_quadrig(folder, exact).exit_code == 0);
  CHECK(run_quadrig(folder, exact + " --strict-count").exit_code == 9);
}

TEST_CASE("command: quads that bend where coarse triangles stay straight do not stray", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-bends");
  write_text(folder / "in.glb", tube_file({.sides = 16, .rings = 4}));
  const CommandResult fine = run_quadrig(folder, "remesh in.glb --quads 6000 -o out.glb --report r.json");
  INFO(fine.error);
  CHECK(fine.exit_code == 0);
  const std::string report = read_text(folder / "r.json");
  const std::size_t shells = report.find("\"shells\"");
  const auto number = [&](const std::string& key) {
    return std::stod(report.substr(report.find("\"" + key + "\": ", shells) + key.size() + 4));
  };
  const double edge = number("edge"), bent = number("largest"), unbent = number("largest_unbent");
  CHECK(bent > 2 * edge);
  CHECK(unbent < edge);
}

TEST_CASE("command: several counts make one file each, all or none", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "in.glb", tube_file());
  const CommandResult done = run_quadrig(
      folder, "remesh in.glb --quads 300,150 --topology field -o out.glb --report r.json --quads-out q.obj");
  INFO(done.error);
  CHECK(done.exit_code == 0);
  CHECK(names_in(folder.path()) == std::vector<std::string>{"in.glb", "out_LOD0.glb", "out_LOD1.glb", "q_LOD0.obj",
                                                            "q_LOD1.obj", "r_LOD0.json", "r_LOD1.json"});
  CHECK(has(read_text(folder / "r_LOD1.json"), "\"quads\": 150"));
  CHECK(has(read_text(folder / "r_LOD1.json"), "\"field\": \"automatic: "));  // of the solvers
  const std::vector<std::string> before = names_in(folder.path());
  CHECK(run_quadrig(folder, "remesh in.glb --quads 300,2 -o new.glb").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh in.glb --quads 300,200 -o new.glb --report new.glb").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh q_LOD0.obj --quads 300,200 -o new.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh q_LOD0.obj --quads 300 --select a -o new.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "remesh in.glb --quads 300 --select nobody -o new.glb").exit_code == 2);
  CHECK(names_in(folder.path()) == before);
  // The levels have names of their own, so that of the input is free, as in the help's example.
  const std::string input = read_text(folder / "in.glb");
  CHECK(run_quadrig(folder, "remesh in.glb --quads 300,150 -o in.glb").exit_code == 0);
  CHECK(read_text(folder / "in.glb") == input);
  CHECK(std::filesystem::exists(folder / "in_LOD1.glb"));
  const CommandResult one = run_quadrig(folder, "remesh in.glb --quads 150 --select tube --source-map -o one.glb");
  CHECK(one.exit_code == 0);
  CHECK(has(read_text(folder / "one.glb"), "\"_SOURCE\""));
}

TEST_CASE("command: an expression that goes back over what it read takes no time", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  std::string json = tube_file({.as_json = true});
  const std::string name = "\"name\":\"tube\"";
  const auto place = json.find(name);
  REQUIRE(place != std::string::npos);
  json.replace(place, name.size(), "\"name\":\"" + std::string(200, 'a') + "!\"");
  write_text(folder / "in.gltf", json);
  for (const char* expression : {"(a+)+", "(a|aa)+", "(a*)*b", "a.*a.*a.*a.*b"})
    CHECK(run_quadrig(folder, "remesh in.gltf --quads 100 -o out.glb --select '" + std::string(expression) + "'")
              .exit_code == 2);
  CHECK(run_quadrig(folder, "remesh in.gltf --quads 100 -o out.glb --select '(a+)+!'").exit_code == 0);
}

TEST_CASE("command: stats bends quads by the clips of a glTF file", "[cli][gltf][slow]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "in.glb", tube_file());
  REQUIRE(run_quadrig(folder, "remesh in.glb --quads 300 --topology field -o out.glb --quads-out q.obj").exit_code ==
          0);
  struct Bending {
    double poses, rms;
  };
  const auto bending = [&](const std::string& options) {
    const CommandResult done = run_quadrig(folder, "stats q.obj --input in.glb --json " + options);
    REQUIRE(done.exit_code == 0);
    const auto number = [&, from = done.output.find("\"deformation\"")](const std::string& after, const char* name) {
      const auto place = done.output.find(name, done.output.find(after, from));
      REQUIRE(place != std::string::npos);
      return std::stod(done.output.substr(place + std::string(name).size()));
    };
    return Bending{number("{", "\"poses\":"), number("\"all\"", "\"rms\":")};
  };
  const Bending bends = bending(""), clips = bending("--poses clips"), dual = bending("--poses clips --skinning dual");
  CHECK(bends.poses == 8);       // two joints, two axes, both ways
  CHECK(clips.poses == 31);      // a second at 30 frames
  CHECK(clips.rms < bends.rms);  // 40 degrees about one axis, against 60 about two
  CHECK(clips.rms != dual.rms);
  CHECK(bending("--poses clips --frames 5").poses == 5);
  CHECK(run_quadrig(folder, "stats q.obj --input q.obj --poses nods").exit_code == 2);
}

TEST_CASE("command: directions by clips need clips", "[cli][gltf][fast]") {
  const ScratchFolder folder("gltf-command");
  write_text(folder / "tube.glb", tube_file());
  write_text(folder / "solid.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  CHECK(run_quadrig(folder, "field tube.glb --directions clips --report f.json").exit_code == 0);
  CHECK(has(read_text(folder / "f.json"), "\"directions\": \"clips\""));
  const CommandResult done = run_quadrig(folder, "remesh tube.glb --quads 200 --directions clips -o q.glb");
  INFO(done.error);
  CHECK((done.exit_code == 0 || done.exit_code == 9));
  const CommandResult obj = run_quadrig(folder, "field solid.obj --directions clips");
  CHECK(obj.exit_code == 2);
  CHECK(has(obj.error, "clips"));
  write_text(folder / "still.glb", tube_file({.skinned = false}));
  const CommandResult still = run_quadrig(folder, "remesh still.glb --quads 200 --all --directions clips -o s.glb");
  CHECK(still.exit_code == 2);
  CHECK(has(still.error, "no clip"));
}
