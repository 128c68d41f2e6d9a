// The verbs around a remesh: bind, pose, stats as a gate, and the report of a run that failed.
#include "cli/run_command.hpp"
#include "gltf_tube.hpp"
#include "quadrig/io.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

Eigen::MatrixXd dmat(const std::filesystem::path& path) {
  Expected<Eigen::MatrixXd> matrix = read_dmat(path, {});
  REQUIRE(matrix);
  return *matrix;
}
PolygonMesh surface(const std::filesystem::path& path) {
  Context context;
  Expected<PolygonMesh> mesh = read_surface(path, {}, context);
  REQUIRE(mesh);
  return *mesh;
}

}  // namespace

TEST_CASE("command: bind writes a row for every vertex of the file, each of sum 1", "[cli][fast]") {
  const ScratchFolder folder("verbs");
  REQUIRE(run_quadrig(folder, "sample pear -o . --triangles 1000").exit_code == 0);
  // A vertex of no face and one that is doubled are vertices of the file too.
  std::string text = read_text(folder / "pear.obj");
  const Eigen::Index vertices = surface(folder / "pear.obj").positions.rows();
  write_text(folder / "odd.obj",
             text + text.substr(text.find("v "), text.find('\n', text.find("v ")) + 1 - text.find("v ")) + "v 0 0 0\n");
  for (const char* method : {"voxel", "biharmonic", "nearest"}) {
    INFO(method);
    const CommandResult done = run_quadrig(
        folder, std::string("bind odd.obj --rig pear.tgf -o w.dmat --influences 2 --report w.json --method ") + method);
    INFO(done.error);
    REQUIRE(done.exit_code == 0);
    const Eigen::MatrixXd weights = dmat(folder / "w.dmat");
    CHECK(weights.rows() == vertices + 2);
    CHECK((weights.rowwise().sum().array() - 1).abs().maxCoeff() < 1e-12);
    CHECK((weights.array() > 0).rowwise().count().maxCoeff() <= 2);
    CHECK(weights.row(vertices) == weights.row(0));
    CHECK(has(read_text(folder / "w.json"), "\"method\": \"" + std::string(method) + "\""));
  }
  CHECK(run_quadrig(folder, "bind pear.obj --rig pear.tgf -o w.obj").exit_code == 2);
  CHECK(run_quadrig(folder, "bind pear.obj -o w.dmat").exit_code == 2);
}

TEST_CASE("command: pose turns what a bone moves about its head, one bone within another", "[cli][fast]") {
  const ScratchFolder folder("verbs");
  // Two bones along x, hinged at x = 1: each of the squares follows one.
  write_text(folder / "a.obj", "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 2 0 0\nv 2 0 1\nf 1 2 3 4\nf 2 5 6 3\n");
  write_text(folder / "a.tgf", "1 0 0 0\n2 1 0 0\n3 2 0 0\n#\n1 2\n2 3\n");
  write_text(folder / "a.dmat", "2 6\n1\n0.5\n0.5\n1\n0\n0\n0\n0.5\n0.5\n0\n1\n1\n");
  const std::string asset = "pose a.obj --rig a.tgf --weights a.dmat -o ";
  REQUIRE(run_quadrig(folder, asset + "p.obj --bone bone1 --axis z --angle 90").exit_code == 0);
  const PolygonMesh bent = surface(folder / "p.obj");
  CHECK(bent.polygon_count() == 2);
  CHECK(bent.polygon(1).size() == 4);
  CHECK((bent.positions.row(4) - Eigen::RowVector3d(1, 1, 0)).norm() < 1e-12);
  CHECK((bent.positions.row(0) - Eigen::RowVector3d(0, 0, 0)).norm() < 1e-12);
  // Both by 90 degrees: the tip comes to (1, 1) turned about the root, whichever is named first.
  const std::string first = " --bone bone0 --axis z --angle 90", second = " --bone bone1 --axis 0,0,2 --angle 90";
  REQUIRE(run_quadrig(folder, asset + "one.obj" + first + second).exit_code == 0);
  REQUIRE(run_quadrig(folder, asset + "two.obj" + second + first).exit_code == 0);
  CHECK((surface(folder / "one.obj").positions.row(4) - Eigen::RowVector3d(-1, 1, 0)).norm() < 1e-12);
  CHECK(surface(folder / "one.obj").positions == surface(folder / "two.obj").positions);
  CHECK(has(run_quadrig(folder, asset + "x.obj --bone bone2 --axis z --angle 9").error, "did you mean bone0, bone1?"));
  for (const char* wrong :
       {"x.obj", "x.obj --bone bone1 --axis z", "x.obj --bone bone1 --axis q --angle 9",
        "x.obj --bone bone1 --axis 0,0,0 --angle 9", "x.ply --bone bone1 --axis z --angle 9", "x.obj --clip Walk"}) {
    INFO(wrong);
    CHECK(run_quadrig(folder, asset + wrong).exit_code == 2);
  }
  write_text(folder / "a.dmat", "2 5\n1\n1\n1\n1\n1\n0\n0\n0\n0\n0\n");
  CHECK(run_quadrig(folder, asset + "x.obj" + first).exit_code == 4);
}

TEST_CASE("command: verbs that look at a surface read glTF files", "[cli][gltf][fast]") {
  const ScratchFolder folder("verbs");
  write_text(folder / "in.glb", tube_file());
  CHECK(run_quadrig(folder, "field in.glb -o f.obj --report f.json").exit_code == 0);
  CHECK(has(read_text(folder / "f.json"), "\"singular_vertices\""));
  REQUIRE(run_quadrig(folder, "dominance in.glb --omegas o.dmat").exit_code == 0);
  const Eigen::MatrixXd omegas = dmat(folder / "o.dmat");
  CHECK((omegas.rowwise().sum().array() - 1).abs().maxCoeff() < 1e-9);
  CHECK(omegas.minCoeff() >= -1e-12);
  REQUIRE(run_quadrig(folder, "remesh in.glb --quads 300 --topology field -o out.glb --quads-out q.obj").exit_code ==
          0);
  CHECK(has(read_text(folder / "out.glb"), "\"generator\":\"quadrig "));
  // Quads are marked in the file: what is read back are the quads, all of them.
  const CommandResult quads = run_quadrig(folder, "stats out.glb --json"),
                      alone = run_quadrig(folder, "stats q.obj --json");
  CHECK(quads.exit_code == 0);
  const auto count = [](const std::string& text) { return std::stoi(text.substr(text.find("\"quads\": ") + 9)); };
  CHECK(count(quads.output) == count(alone.output));
  CHECK(has(quads.output, "\"valid\": true"));
  CHECK(run_quadrig(folder, "stats in.glb").exit_code == 9);
}

TEST_CASE("command: stats is a gate: the exit code is 9 where a mesh is not valid or fails a figure", "[cli][fast]") {
  const ScratchFolder folder("verbs");
  write_text(folder / "sheet.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 3 1 0\nf 1 2 3 4\nf 2 5 6 3\n");
  CHECK(run_quadrig(folder, "stats sheet.obj").exit_code == 0);
  CHECK(run_quadrig(folder, "stats sheet.obj --fail-below sj=0.4 --fail-above faces=2").exit_code == 0);
  const CommandResult failed = run_quadrig(folder, "stats sheet.obj --fail-below sj=0.9,faces=3 --json");
  CHECK(failed.exit_code == 9);
  CHECK(has(failed.output, "\"faces 2.0000 is below 3.0000\""));
  CHECK(has(failed.output, "\"scaled_jacobian.minimum "));
  CHECK(run_quadrig(folder, "stats sheet.obj --fail-above rms=1").exit_code == 2);
  CHECK(run_quadrig(folder, "stats sheet.obj --fail-above sj").exit_code == 2);
}

TEST_CASE("command: a report that was asked for tells of a failure, and replaces nothing but a report", "[cli][fast]") {
  const ScratchFolder folder("verbs");
  write_text(folder / "bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n");
  const std::string remesh = "remesh bad.obj --quads 100 -o q.obj --report ";
  CHECK(run_quadrig(folder, remesh + "r.json").exit_code == 4);
  const std::string report = read_text(folder / "r.json");
  for (const char* part : {"\"code\": \"bad_input\"", "\"exit_code\": 4", "bad.obj", "\"cpu_seconds\"", "\"build\""}) {
    INFO(part);
    CHECK(has(report, part));
  }
  write_text(folder / "notes.txt", "mine");
  CHECK(run_quadrig(folder, remesh + "notes.txt").exit_code == 4);
  CHECK(read_text(folder / "notes.txt") == "mine");
  CHECK(run_quadrig(folder, remesh + "r.json").exit_code == 4);
  CHECK(run_quadrig(folder, remesh + "bad.obj").exit_code == 2);
  CHECK(run_quadrig(folder, remesh + "q.obj").exit_code == 2);
  CHECK(names_in(folder.path()) == std::vector<std::string>{"bad.obj", "notes.txt", "r.json"});
}

TEST_CASE("command: what quads are for sets options where they are not given", "[cli][fast]") {
  const ScratchFolder folder("verbs");
  write_text(folder / "board.obj",
             "v 0 0 0\nv 2 0 0\nv 2 1.5 0\nv 0 1.5 0\nv 0 0 1\nv 2 0 1\nv 2 1.5 1\nv 0 1.5 1\n"
             "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  const auto options_of = [&](const std::string& arguments) {
    const CommandResult done = run_quadrig(folder, "remesh board.obj --quads 60 -o q.obj --report r.json " + arguments);
    INFO(done.error);
    REQUIRE(done.exit_code == 0);
    const std::string report = read_text(folder / "r.json");
    return report.substr(report.find("\"options\""), report.find("\"quads\": 5") - report.find("\"options\""));
  };
  CHECK(has(options_of(""), "\"influences\": 4"));
  const std::string version = run_quadrig(folder, "--version").output;
  if (version.find("OpenSubdiv") > version.find("without")) return;  // no fit for subdivision
  const std::string film = options_of("--for film");
  CHECK(has(film, "\"fit\": \"subdivision\""));
  CHECK(has(film, "\"influences\": 8"));
  CHECK(has(film, "\"symmetry\": \"auto\""));
  const std::string own = options_of("--for film --influences 5 --fit none");
  CHECK(has(own, "\"influences\": 5"));
  CHECK(has(own, "\"fit\": \"none\""));
  CHECK(has(own, "\"for\": \"film\""));
  CHECK(has(options_of("--for scan"), "\"density\": \"rest\""));
  CHECK(has(options_of("--for lod"), "\"loops\": 0"));
  CHECK(run_quadrig(folder, "remesh board.obj --quads 60 -o q.obj --for cinema").exit_code == 2);
}
