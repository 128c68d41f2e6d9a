#include "quadrig/io.hpp"

#include <bit>
#include <cstring>
#include <fstream>
#include <set>
#include <thread>

#include <sys/stat.h>

#include "test.hpp"

using namespace quadrig;
using quadrig::test::corpus;
using quadrig::test::ScratchFolder;

namespace {

std::filesystem::path file(const ScratchFolder& folder, const std::string& name, const std::string& text) {
  std::ofstream(folder / name, std::ios::binary) << text;
  return folder / name;
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::size_t files_in(const ScratchFolder& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder.path()), {}));
}

Expected<PolygonMesh> read(const std::filesystem::path& path) {
  Context context;
  return read_surface(path, {}, context);
}

/// The error of a surface file, one line.
std::string fault(const ScratchFolder& folder, const std::string& name, const std::string& text) {
  const Expected<PolygonMesh> mesh = read(file(folder, name, text));
  if (mesh) return "no error";
  CHECK_FALSE(mesh.error().remedy.empty());
  const std::string message = mesh.error().message();
  CHECK(message.find('\n') == std::string::npos);
  return message.substr(folder.path().string().size() + 1);
}

bool starts(const std::string& text, const std::string& beginning) { return text.rfind(beginning, 0) == 0; }

template <class T>
void put(std::string& bytes, T value, bool little) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (little != (std::endian::native == std::endian::little)) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

/// A tetrahedron in binary PLY, with properties in an odd order and an element that is not used.
std::string binary_ply(bool little) {
  std::string bytes = "ply\nformat binary_" + std::string(little ? "little" : "big") +
                      "_endian 1.0\ncomment a tetrahedron\nelement vertex 4\nproperty uchar red\nproperty double z\n"
                      "property float x\nproperty float y\nelement edge 1\nproperty list uchar short ends\n"
                      "element face 4\nproperty float quality\nproperty list uchar uint vertex_indices\nend_header\n";
  const double points[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.1}};
  for (const auto& p : points) {
    put(bytes, std::uint8_t{7}, little);
    put(bytes, p[2], little);
    put(bytes, static_cast<float>(p[0]), little);
    put(bytes, static_cast<float>(p[1]), little);
  }
  put(bytes, std::uint8_t{2}, little);
  put(bytes, std::int16_t{0}, little);
  put(bytes, std::int16_t{1}, little);
  const std::uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  for (const auto& f : faces) {
    put(bytes, 0.5F, little);
    put(bytes, std::uint8_t{3}, little);
    for (const std::uint32_t v : f) put(bytes, v, little);
  }
  return bytes;
}

std::size_t materials_of(const Expected<PolygonMesh>& mesh) {
  REQUIRE(mesh);
  return std::set<Index>(mesh->material.begin(), mesh->material.end()).size();
}

constexpr const char* square_obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
constexpr const char* two_bones = "1 0 0 0\n2 0.5 0 0\n3 1 0 0\n#\n1 2\n2 3\n#\n";

}  // namespace

TEST_CASE("obj: every form of index is read when a file mixes them", "[io][obj][fast]") {
  const ScratchFolder folder("obj");
  const auto path = file(folder, "a.OBJ",
                         "\xEF\xBB\xBF# comment\r\nmtllib x.mtl\r\nv 0 0 0 1.0\r\nv +1 0 0 0.5 0.5 0.5 # red\r\n"
                         "v 1 1e0 0\r\nvt 0 0\r\nvn 0 0 1\r\nf 1/1/1 2//1 3/1\r\n\to thing\r\nv 0 1 0\r\n"
                         "f -1 -4/1 \\\r\n -2//-1\r\nl 1 2\r\nf 1 2 3\\\r\n 4");
  const Expected<PolygonMesh> mesh = read(path);
  REQUIRE(mesh.has_value());
  CHECK(mesh->vertex_count() == 4);
  REQUIRE(mesh->polygon_count() == 3);
  CHECK(mesh->positions.row(1) == Eigen::RowVector3d(1, 0, 0));
  CHECK(std::vector<Index>(mesh->polygon(1).begin(), mesh->polygon(1).end()) == std::vector<Index>{3, 0, 2});
  CHECK(mesh->polygon(2).size() == 4);
}

TEST_CASE("obj: borders of materials, texture islands and lines are kept when asked for", "[io][obj][fast]") {
  const ScratchFolder folder("obj");
  // Four squares in a row; the second border changes the material, the third the texture, the first has a line that
  // goes on where no edge is. Equal coordinates under another number are no border.
  const std::string text =
      "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nv 3 1 0\nv 4 1 0\n"
      "vt 0 0\nvt .1 0\nvt .2 0\nvt .3 0\nvt 0 1\nvt .1 1\nvt .2 1\nvt .3 1\nvt .2 0\nvt .5 .5\nvt .5 1\nvt 1 1\n"
      "usemtl a\nf 1/1 2/2 7/6 6/5\nl 2 7 4\nf 2/2 3/3 8/7 7/6\nusemtl b\nf 3/9 4/4 9/8 8/-6\nf 4/10 5/12 10/12 9/11\n";
  const AssetFiles files{file(folder, "a.obj", text), {}, {}};
  const auto at_x = [&](const KeepOptions& keep, std::size_t warnings) {
    LoadOptions options;
    options.keep = keep;
    Context context;
    const auto loaded = load_asset(files, options, context);
    REQUIRE(loaded);
    CHECK(context.warnings.size() == warnings);
    std::set<double> x;
    for (const Index h : loaded->features) {
      const auto& mesh = loaded->asset.mesh;
      CHECK(mesh.position(mesh.origin(h))[0] == mesh.position(mesh.target(h))[0]);
      x.insert(mesh.position(mesh.origin(h))[0]);
    }
    CHECK(loaded->features.size() == 2 * x.size());
    return x;
  };
  CHECK(materials_of(read(file(folder, "m.obj",
                               "v 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl Mat A\nf 1 2 3\nusemtl Mat B # b\n"
                               "f 1 2 3\nusemtl  Mat  A\nf 1 2 3\n"))) == 2);
  CHECK(at_x({}, 0).empty());
  CHECK(at_x({.materials = true}, 0) == std::set<double>{2});
  CHECK(at_x({.textures = true}, 0) == std::set<double>{3});
  CHECK(at_x({.lines = true}, 0) == std::set<double>{1});
  CHECK(at_x({.materials = true, .textures = true, .lines = true}, 0) == std::set<double>{1, 2, 3});

  const AssetFiles bare{file(folder, "b.obj", square_obj), {}, {}};
  LoadOptions options;
  options.keep = {true, true, true};
  Context context;
  const auto loaded = load_asset(bare, options, context);
  REQUIRE(loaded);
  CHECK(loaded->features.empty());
  CHECK(context.warnings.size() == 3);

  // What is broken there breaks no surface.
  const auto mesh = read(file(folder, "c.obj", std::string(square_obj) + "vt x\nf 1/a 2/9 3/-7\nl 1 77 x 0 2 3\n"));
  REQUIRE(mesh);
  CHECK(mesh->texture == std::vector<Index>(7, no_index));
  CHECK(mesh->lines == std::vector<std::array<Index, 2>>{{1, 2}});
}

TEST_CASE("obj: a face may name vertices that come later", "[io][obj][fast]") {
  const ScratchFolder folder("obj");
  CHECK(read(file(folder, "a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n")).has_value());
}

TEST_CASE("obj: each fault is named by line", "[io][obj][fast]") {
  const ScratchFolder folder("obj");
  CHECK(starts(fault(folder, "a.obj", "v 0 0\n"), "a.obj:1: a vertex of 2 coordinates"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nv 0 x 0\n"), "a.obj:2: 'x' is not a finite number"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 nan\n"), "a.obj:1: 'nan' is not a finite number"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 1e999\n"), "a.obj:1: '1e999' is not a finite number"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 1,5\n"), "a.obj:1: '1,5' is not a finite number"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf 1 1\n"), "a.obj: has no faces"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf\n"), "a.obj:2: a face without corners"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\n\nf 1 1 2\n"), "a.obj:3: vertex number 2 does not exist"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf 1 1 0\n"), "a.obj:2: vertex number 0 does not exist"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf 1 1 -2\n"), "a.obj:2: vertex number -2 does not exist"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf 1 1 99999999999\n"), "a.obj:2: vertex number 99999999999"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\nf 1 1 a\n"), "a.obj:2: 'a' is not a vertex number"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\n\x01\x02 1\n"), "a.obj:2: '\?\?' begins no OBJ statement"));
  CHECK(starts(fault(folder, "a.obj", "v 0 0 0\n"), "a.obj: has no faces"));
  CHECK(starts(fault(folder, "a.obj", ""), "a.obj: has no faces"));
}

TEST_CASE("off: counts, comments and colours are read as people write them", "[io][off][fast]") {
  const ScratchFolder folder("off");
  for (const char* text : {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF 3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
                           "# c\nCOFF\n\n# d\n3 1 3\n0 0 0 255 0 0 1\n1 0 0 1\n\n0 1 0\n3 0 1 2 0.5 0.5 0.5\n"}) {
    const Expected<PolygonMesh> mesh = read(file(folder, "a.off", text));
    INFO(text);
    REQUIRE(mesh.has_value());
    CHECK(mesh->vertex_count() == 3);
    CHECK(mesh->polygon_count() == 1);
  }
}

TEST_CASE("off: each fault is named by line", "[io][off][fast]") {
  const ScratchFolder folder("off");
  CHECK(starts(fault(folder, "a.off", "OBJ\n"), "a.off:1: begins with 'OBJ'"));
  CHECK(starts(fault(folder, "a.off", "OFF\n3 x 0\n"), "a.off:2: 'x' is not a count"));
  CHECK(starts(fault(folder, "a.off", "OFF\n-3 1 0\n"), "a.off:2: '-3' is not a count"));
  CHECK(starts(fault(folder, "a.off", "OFF\n99999999 1 0\n0 0 0\n"),
               "a.off:2: 99999999 vertices and 1 faces are announced"));
  CHECK(starts(fault(folder, "a.off", "OFF\n1 99999999 0\n0 0 0\n"), "a.off:2: 1 vertices and 99999999 faces"));
  CHECK(starts(fault(folder, "a.off", "OFF\n2 1 0\n0 0 0\n1 0\n3 0 0 1\n"), "a.off:4: the text ends in vertex 1"));
  CHECK(starts(fault(folder, "a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n"), "a.off:4: '1' is not a vertex number below 1"));
  CHECK(starts(fault(folder, "a.off", "OFF\n1 1 0\n0 0 0\n4 0 0 0\n"), "a.off:5: a face of 4 corners names 3"));
  CHECK(starts(fault(folder, "a.off", "OFF\n1 2 0\n0 0 0\n3 0 0 0\n"), "a.off:5: the text ends after 1 of 2 faces"));
  CHECK(starts(fault(folder, "a.off", "OFF BINARY\n"), "a.off, byte 11: the counts are missing"));
}

TEST_CASE("ply: ascii and both byte orders give the same mesh", "[io][ply][fast]") {
  const ScratchFolder folder("ply");
  const std::string ascii =
      "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty double z\r\n"
      "element face 4\r\nproperty list uchar int vertex_index\r\nend_header\r\n"
      "0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 0.1\r\n3 0 2 1\r\n3 0 1 3\r\n3 1 2 3\r\n3 2 0 3\r\n";
  const Expected<PolygonMesh> words = read(file(folder, "a.ply", ascii));
  const Expected<PolygonMesh> little = read(file(folder, "l.ply", binary_ply(true)));
  const Expected<PolygonMesh> big = read(file(folder, "b.ply", binary_ply(false)));
  REQUIRE(words.has_value());
  for (const auto* mesh : {&little, &big}) {
    INFO((mesh->has_value() ? std::string() : mesh->error().message()));
    REQUIRE(mesh->has_value());
    CHECK((*mesh)->positions == words->positions);
    CHECK((*mesh)->corners == words->corners);
  }
}

TEST_CASE("ply: each fault is named by line or byte", "[io][ply][fast]") {
  const ScratchFolder folder("ply");
  const std::string head = "ply\nformat ascii 1.0\n";
  const std::string xyz = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  CHECK(starts(fault(folder, "a.ply", "plx\n"), "a.ply:1: does not begin with 'ply'"));
  CHECK(starts(fault(folder, "a.ply", head), "a.ply:3: the header does not end"));
  CHECK(starts(fault(folder, "a.ply", "ply\nformat ternary 1.0\n"), "a.ply:2: format 'ternary' is not known"));
  CHECK(starts(fault(folder, "a.ply", "ply\n" + xyz + faces), "a.ply:8: the header names no format"));
  CHECK(starts(fault(folder, "a.ply", head + "element vertex -1\n"), "a.ply:3: '-1' is not a number of elements"));
  CHECK(starts(fault(folder, "a.ply", head + "element vertex 1\nproperty quad x\n"), "a.ply:4: 'quad' is not a type"));
  CHECK(starts(fault(folder, "a.ply", head + "element vertex 99999999\nproperty float x\nend_header\n0\n"),
               "a.ply:6: 99999999 entries of element 'vertex' are announced"));
  CHECK(starts(fault(folder, "a.ply", head + xyz + faces + "0 0\n"), "a.ply:11: no number for 'z'"));
  CHECK(
      starts(fault(folder, "a.ply", head + xyz + faces + "0 0 inf\n3 0 0 0\n"), "a.ply:10: a coordinate that is not"));
  CHECK(starts(fault(folder, "a.ply", head + xyz + faces + "0 0 0\n3 0 0 1\n"), "a.ply: face 0 names vertex 1 of 1"));
  CHECK(starts(fault(folder, "a.ply", head + xyz + faces + "0 0 0\n3 0 0 -1\n"), "a.ply:11: a vertex number"));
  CHECK(starts(fault(folder, "a.ply", head + xyz + faces + "0 0 0\n200 0\n"), "a.ply:11: a length of list"));
  CHECK(starts(fault(folder, "a.ply", head + xyz + "end_header\n0 0 0\n"), "a.ply: has no faces"));
  const std::string whole = binary_ply(true);
  for (std::size_t cut = 1; cut < 110; cut += 3)
    CHECK(fault(folder, "a.ply", whole.substr(0, whole.size() - cut)) != "no error");
  CHECK(fault(folder, "a.ply", whole.substr(0, whole.size() - 1)).find(", byte ") != std::string::npos);
}

TEST_CASE("tgf: joints and bones are read and further columns passed over", "[io][tgf][fast]") {
  const ScratchFolder folder("tgf");
  Context context;
  const auto skeleton =
      read_tgf(file(folder, "a.tgf",
                    "  1 0 0 0 1e-320 garbage\n 7 1 0 0\n3 1 1 0\n 9 2 0 0\n#\n 7 3 0\n1 7\n 7 9\n#\n1 3\nnonsense"),
               {}, context);
  REQUIRE(skeleton.has_value());
  REQUIRE(skeleton->bone_count() == 3);
  CHECK(skeleton->bones[0].parent == 1);
  CHECK(skeleton->bones[1].parent == no_index);
  CHECK(skeleton->bones[2].parent == 1);
  CHECK(skeleton->bones[0].tail == Vector3(1, 1, 0));
  CHECK(context.warnings.empty());
}

TEST_CASE("tgf: bones without length lose their direction, and rings of bones are cut", "[io][tgf][fast]") {
  const ScratchFolder folder("tgf");
  Context context;
  const auto flat = read_tgf(file(folder, "a.tgf", "1 0 0 0\n2 0 0 0\n3 1 0 0\n#\n1 2\n2 3\n"), {}, context);
  REQUIRE(flat.has_value());
  CHECK_FALSE(flat->bones[0].has_direction);
  CHECK(flat->bones[1].has_direction);
  CHECK(context.warnings.size() == 1);
  const auto ring = read_tgf(file(folder, "a.tgf", "1 0 0 0\n2 1 0 0\n3 0 1 0\n#\n1 2\n2 3\n3 1\n"), {}, context);
  REQUIRE(ring.has_value());
  for (Index b = 0; b < 3; ++b) {
    Index up = b, steps = 0;
    while (up != no_index && steps++ < 4) up = ring->bones[static_cast<std::size_t>(up)].parent;
    CHECK(up == no_index);
  }
  // Each ring is cut once, at its first bone, also where others hang on it and come first.
  const auto rings = read_tgf(
      file(folder, "a.tgf", "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 0 1\n6 2 0 0\n#\n3 6\n1 2\n2 3\n3 1\n4 5\n5 4\n"),
      {}, context);
  REQUIRE(rings.has_value());
  std::vector<Index> parents;
  for (const Bone& bone : rings->bones) parents.push_back(bone.parent);
  CHECK(parents == std::vector<Index>{2, no_index, 1, 2, no_index, 4});
}

TEST_CASE("tgf: each fault is named by line", "[io][tgf][fast]") {
  const ScratchFolder folder("tgf");
  const auto message = [&](const std::string& text) {
    Context context;
    const auto skeleton = read_tgf(file(folder, "a.tgf", text), {}, context);
    return skeleton ? "no error" : skeleton.error().message().substr(folder.path().string().size() + 1);
  };
  CHECK(starts(message("1 0 0\n"), "a.tgf:1: joint 1: '' is not a finite number"));
  CHECK(starts(message("a 0 0 0\n"), "a.tgf:1: 'a' is not a joint number"));
  CHECK(starts(message("1 0 0 nan\n"), "a.tgf:1: joint 1: 'nan' is not a finite number"));
  CHECK(starts(message("1 0 0 0\n1 0 0 0\n"), "a.tgf:2: joint 1 comes twice"));
  CHECK(starts(message("1 0 0 0\n#\n1 2\n"), "a.tgf:3: joint 2 does not exist"));
  CHECK(starts(message("1 0 0 0\n#\n1 1\n"), "a.tgf:3: a bone from joint 1 to itself"));
  CHECK(starts(message("1 0 0 0\n#\n1\n"), "a.tgf:3: '' is not a joint number"));
  CHECK(starts(message("1 0 0 0\n#\n#\n"), "a.tgf: has no bones"));
  CHECK(starts(message(""), "a.tgf: has no bones"));
}

TEST_CASE("dmat: ascii and binary round trips keep every bit", "[io][dmat][fast]") {
  const ScratchFolder folder("dmat");
  std::mt19937_64 random(1);
  Eigen::MatrixXd matrix(17, 3);
  for (Eigen::Index i = 0; i < matrix.size(); ++i)
    matrix.data()[i] = std::ldexp(static_cast<double>(random()), static_cast<int>(random() % 200) - 160);
  matrix(0, 0) = 0.1;
  matrix(1, 0) = 5e-324;
  for (const DmatFormat format : {DmatFormat::ascii, DmatFormat::binary}) {
    REQUIRE(write_dmat(folder / "a.dmat", matrix, format).ok());
    const auto read_back = read_dmat(folder / "a.dmat", {});
    REQUIRE(read_back.has_value());
    CHECK(*read_back == matrix);
    CHECK(starts(text_of(folder / "a.dmat"),
                 format == DmatFormat::binary ? "0 0\n3 17\n" : "3 17\n0.10000000000000001\n"));
  }
}

TEST_CASE("dmat: each fault is named", "[io][dmat][fast]") {
  const ScratchFolder folder("dmat");
  const auto message = [&](const std::string& text) {
    const auto matrix = read_dmat(file(folder, "a.dmat", text), {});
    return matrix ? "no error" : matrix.error().message().substr(folder.path().string().size() + 1);
  };
  CHECK(starts(message(""), "a.dmat:1: '' '' are not the numbers of columns and rows"));
  CHECK(starts(message("2 x\n"), "a.dmat:1: '2' 'x' are not the numbers"));
  CHECK(starts(message("2 -1\n"), "a.dmat:1: '2' '-1' are not the numbers"));
  CHECK(starts(message("2 2\n1\n2\n3\n"), "a.dmat:5: the text ends after 3 of 2 columns of 2 values"));
  CHECK(starts(message("2 2\n1\n2\nx\n4\n"), "a.dmat:4: 'x' is not a finite number"));
  CHECK(starts(message("1 1\nnan\n"), "a.dmat:2: 'nan' is not a finite number"));
  CHECK(starts(message("50000 199999999\n1\n"), "a.dmat:1: 50000 columns of 199999999 values are announced"));
  CHECK(starts(message("99999999 99999999\n1\n"), "a.dmat:1: 99999999 columns of 99999999 values are more than"));
  CHECK(starts(message("0 0\n2 2\n12345678"), "a.dmat:3: 2 columns of 2 values are announced"));
  CHECK(starts(message("0 0\n2 1\n" + std::string(15, '\1')), "a.dmat:3: 2 columns of 1 values are announced"));
  CHECK(starts(message("0 0\n1 1"), "a.dmat: ends after its counts"));
  CHECK(starts(message("0 0\n0 0\n"), "a.dmat: holds no values"));
  std::string not_finite = "0 0\n1 1\n";
  put(not_finite, std::numeric_limits<double>::infinity(), true);
  CHECK(starts(message(not_finite), "a.dmat: value of row 0, column 0 is not finite"));
}

TEST_CASE("obj: quads read back with the same bits", "[io][obj][fast]") {
  const ScratchFolder folder("obj");
  QuadMesh mesh;
  mesh.positions = Points<double>::Random(5, 3) * 1e-3;
  mesh.positions(0, 0) = 1.0 / 3;
  mesh.quads.resize(2, 4);
  mesh.quads << 0, 1, 2, 3, 3, 2, 1, 4;
  REQUIRE(write_obj(folder / "q.obj", mesh).ok());
  const Expected<PolygonMesh> back = read(folder / "q.obj");
  REQUIRE(back.has_value());
  CHECK(back->positions == mesh.positions);
  CHECK(back->corners == std::vector<Index>{0, 1, 2, 3, 3, 2, 1, 4});
}

TEST_CASE("tgf: a skeleton reads back with its tree and bits", "[io][tgf][fast]") {
  const ScratchFolder folder("tgf");
  Context context;
  Skeleton skeleton;
  const auto bone = [&](const Vector3& head, const Vector3& tail, Index parent) {
    Bone b;
    b.head = head, b.tail = tail, b.parent = parent;
    skeleton.bones.push_back(b);
  };
  bone({0, 0, 0}, {0.1, 0, 0}, no_index);
  bone({0.1, 0, 0}, {0.1, 1.0 / 3, 0}, 0);
  bone({0.1, 0, 0}, {0.1, 0, 2}, 0);
  bone({0, 0, 0}, {-1, 0, 0}, no_index);
  REQUIRE(write_tgf(folder / "a.tgf", skeleton).ok());
  const auto back = read_tgf(folder / "a.tgf", {}, context);
  REQUIRE(back.has_value());
  REQUIRE(back->bone_count() == 4);
  for (std::size_t b = 0; b < 4; ++b) {
    CHECK(back->bones[b].head == skeleton.bones[b].head);
    CHECK(back->bones[b].tail == skeleton.bones[b].tail);
    CHECK(back->bones[b].parent == skeleton.bones[b].parent);
  }
}

TEST_CASE("files: a failed write leaves the older file and nothing else", "[io][fast]") {
  const ScratchFolder folder("files");
  file(folder, "a.obj", "old");
  {
    FileSet set;
    REQUIRE(set.add(folder / "a.obj", "new").ok());
    CHECK(text_of(folder / "a.obj") == "old");
    CHECK(files_in(folder) == 1);
    const Status failed = set.add(folder / "nowhere" / "b.obj", "new");
    REQUIRE_FALSE(failed.ok());
    CHECK(failed.error().code == ErrorCode::bad_file);
  }
  CHECK(text_of(folder / "a.obj") == "old");
  CHECK(files_in(folder) == 1);
  REQUIRE(write_file(folder / "a.obj", "new").ok());
  CHECK(text_of(folder / "a.obj") == "new");
  CHECK(files_in(folder) == 1);
  CHECK_FALSE(write_file(folder.path(), "new").ok());
  CHECK_FALSE(write_file("", "new").ok());
}

TEST_CASE("files: a rename that is refused is taken back, with those before it", "[io][fast]") {
  const ScratchFolder folder("files");
  file(folder, "old.obj", "old");
  const std::string longest(255, 'n');
  for (const bool refused : {true, false}) {
    FileSet set;
    set.make_folder(folder / "made");
    REQUIRE(set.add(folder / "old.obj", "newer"));
    REQUIRE(set.add(folder / "made" / longest, "new"));  // whatever the temporary name is
    REQUIRE(set.add(folder / "late", "new"));
    if (refused) std::filesystem::create_directory(folder / "late");  // which a file cannot replace
    CHECK(set.commit().ok() == !refused);
    CHECK(text_of(folder / "old.obj") == (refused ? "old" : "newer"));
    CHECK(files_in(folder) == (refused ? 2 : 3));  // old.obj, late and, once all is done, made
    if (refused) std::filesystem::remove(folder / "late");
  }
  CHECK(text_of(folder / "made" / longest) == "new");
}

TEST_CASE("files: an output is no input, and none is replaced that only a document names", "[io][fast]") {
  const ScratchFolder folder("files");
  file(folder, "in.bin", "in");
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_symlink("../in.bin", folder / "sub/link");
  std::filesystem::create_hard_link(folder / "in.bin", folder / "sub/hard");
  std::filesystem::create_symlink("..", folder / "sub/up");
  for (const char* spelled :
       {"in.bin", "./sub/../in.bin", "sub/link", "sub/hard", "sub/up/in.bin", "sub/up/sub/link"}) {
    INFO(spelled);
    for (const bool input_first : {true, false}) {
      FileSet set;
      const std::filesystem::path one = folder / "in.bin", other = folder / spelled;
      if (input_first) {
        REQUIRE(set.reads(one));
        CHECK(set.writes(other).error().code == ErrorCode::bad_option);
        CHECK(set.add(other, "out").error().code == ErrorCode::bad_option);
        CHECK(set.add_beside(folder / "out", spelled, "out").error().code == ErrorCode::bad_option);
        set.replaces_beside = true;  // which gives no leave for that
        CHECK(set.add_beside(folder / "out", spelled, "out").error().code == ErrorCode::bad_option);
      } else {
        REQUIRE(set.writes(one));
        CHECK(set.reads(other).error().code == ErrorCode::bad_option);
      }
      CHECK(set.commit());
    }
  }
  CHECK(text_of(folder / "in.bin") == "in");

  file(folder, "sub/there", "there");
  FileSet set;
  CHECK(set.add_beside(folder / "sub/out", "there", "there"));
  CHECK(set.add_beside(folder / "sub/out", "new/new", "new"));
  CHECK(set.add_beside(folder / "sub/out", "there", "other").error().code == ErrorCode::bad_option);
  CHECK(set.add_beside(folder / "sub/out", "up/new", "new").error().code == ErrorCode::bad_file);  // a link out
  CHECK(set.add_beside(folder / "sub/out", "link", "new").error().code == ErrorCode::bad_file);
  CHECK_FALSE(std::filesystem::exists(folder / "sub/new"));
  set.replaces_beside = true;
  CHECK(set.add_beside(folder / "sub/out", "there", "other"));
  CHECK(set.add_beside(folder / "sub/out", "there", "third").error().code == ErrorCode::bad_option);
  CHECK(set.commit());
  CHECK(text_of(folder / "sub/there") == "other");
  CHECK(text_of(folder / "sub/new/new") == "new");
}

TEST_CASE("files: one place holds one thing, links are followed, and pipes are written to", "[io][fast]") {
  const ScratchFolder folder("files");
  const std::filesystem::path real = folder / "real.txt", link = folder / "link.txt", pipe = folder / "pipe";
  std::filesystem::create_symlink("real.txt", link);
  CHECK(same_file(folder / "new", folder / "." / "new"));
  CHECK(same_file(link, real));
  CHECK_FALSE(same_file(folder / "new", real));
  {
    FileSet files;
    REQUIRE(files.add(link, "one"));
    REQUIRE(files.add(real, "one"));  // as levels of detail share an image
    const Status twice = files.add(folder / "." / "real.txt", "two");
    REQUIRE(!twice.ok());
    CHECK(twice.error().code == ErrorCode::bad_option);
    REQUIRE(files.commit());
  }
  CHECK(std::filesystem::is_symlink(link));
  CHECK(text_of(real) == "one");

  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  std::string through;
  {
    const std::jthread reader([&] { through = text_of(pipe); });
    CHECK(write_file(pipe, "through"));
  }
  CHECK(through == "through");
  CHECK(std::filesystem::is_fifo(pipe));

  {
    FileSet files;
    files.make_folder(folder / "a" / "b");
    REQUIRE(files.add(folder / "a" / "b" / "c", "gone"));
  }
  CHECK_FALSE(std::filesystem::exists(folder / "a"));
}

TEST_CASE("files: what cannot be read is named", "[io][fast]") {
  const ScratchFolder folder("files");
  for (const auto& path : {folder / "none.obj", folder.path() / "dir.obj"}) {
    if (path.filename() == "dir.obj") std::filesystem::create_directory(path);
    const auto mesh = read(path);
    REQUIRE_FALSE(mesh.has_value());
    CHECK(mesh.error().code == ErrorCode::bad_file);
    CHECK(mesh.error().where == path.string());
  }
  CHECK(read(file(folder, "a.fbx", "")).error().code == ErrorCode::unsupported);
  FileLimits limits;
  limits.bytes = 10;
  Context context;
  CHECK(read_obj(file(folder, "a.obj", square_obj), limits, context).error().what.find("limit of 10 bytes") !=
        std::string::npos);
  limits = {};
  limits.vertices = 3;
  CHECK(read_obj(folder / "a.obj", limits, context).error().what == "more than 3 vertices");
}

TEST_CASE("load: counts that differ between files are an error that names both", "[io][load][fast]") {
  const ScratchFolder folder("load");
  AssetFiles files;
  files.mesh = file(folder, "m.obj", square_obj);
  files.rig = file(folder, "r.tgf", two_bones);
  const auto load = [&](const std::string& weights) {
    files.weights = file(folder, "w.dmat", weights);
    Context context;
    return load_asset(files, {}, context);
  };
  const auto good = load("2 4\n1\n1\n0\n0\n0\n0\n1\n1\n");
  REQUIRE(good.has_value());
  REQUIRE(good->asset.rig.has_value());
  CHECK(good->asset.rig->weights.rows() == 4);
  CHECK(good->asset.mesh.face_count() == 2);
  const auto few_rows = load("2 3\n1\n1\n0\n0\n0\n1\n");
  REQUIRE_FALSE(few_rows.has_value());
  CHECK(few_rows.error().message().find("3 rows of weights for the 4 vertices of " + files.mesh.string()) !=
        std::string::npos);
  const auto few_columns = load("1 4\n1\n1\n1\n1\n");
  REQUIRE_FALSE(few_columns.has_value());
  CHECK(few_columns.error().message().find("1 columns of weights for the 2 bones of " + files.rig.string()) !=
        std::string::npos);
  const auto no_sum = load("2 4\n1\n1\n0\n0\n0\n0\n1\n0.5\n");
  REQUIRE_FALSE(no_sum.has_value());
  CHECK(starts(no_sum.error().message(), files.weights.string() + ", weights of vertex 3: weights sum to 0.5"));
  files.rig.clear();
  CHECK(load("1 1\n1\n").error().code == ErrorCode::bad_option);
}

TEST_CASE("load: the arm is clean when read from its three files", "[io][load][corpus][fast]") {
  const auto folder = corpus("libigl_arm");
  if (!folder) return;
  Context context;
  LoadOptions options;
  options.prepare.strict = true;
  const auto arm =
      load_asset({*folder / "arm.obj", *folder / "arm.tgf", *folder / "arm-weights.dmat"}, options, context);
  INFO((arm ? std::string() : arm.error().message()));
  REQUIRE(arm.has_value());
  CHECK(arm->asset.mesh.vertex_count() == 8311);
  CHECK(arm->asset.mesh.face_count() == 16618);
  CHECK(arm->asset.mesh.closed());
  CHECK(arm->asset.rig->skeleton.bone_count() == 4);
  CHECK(arm->asset.rig->skeleton.bones[3].parent == 2);
  CHECK(arm->asset.rig->weights.nonZeros() == 8311 * 4);
  CHECK(context.warnings.empty());
}

TEST_CASE("load: the surfaces have the topology that is known of them", "[io][load][corpus][fast]") {
  struct Known {
    const char* name;
    Index vertices, faces, euler;
    bool closed;
  };
  for (const Known& known : {Known{"bunny", 3485, 6966, 2, true}, Known{"fertility", 4494, 9000, -6, true},
                             Known{"fandisk", 7229, 14454, 2, true}, Known{"camelhead", 11381, 22704, 1, false}}) {
    const auto path = corpus("surfaces/" + std::string(known.name) + ".off");
    if (!path) return;
    Context context;
    const auto loaded = load_asset({*path, {}, {}}, {}, context);
    INFO(known.name << (loaded ? std::string() : loaded.error().message()));
    REQUIRE(loaded.has_value());
    const TriangleMesh<double>& mesh = loaded->asset.mesh;
    CHECK(mesh.vertex_count() == known.vertices);
    CHECK(mesh.face_count() == known.faces);
    CHECK(mesh.vertex_count() - mesh.edge_count() + mesh.face_count() == known.euler);
    CHECK(mesh.closed() == known.closed);
  }
}
