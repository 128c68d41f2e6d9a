// One tetrahedron in every variant of the surface formats that is read: the same mesh comes out.
#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>

#include "quadrig/io.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

struct Variant {
  std::string name, bytes;
};

constexpr int tetrahedron_points[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
constexpr int tetrahedron_sides[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};

std::string numbers(const int (&row)[3]) {
  return std::to_string(row[0]) + " " + std::to_string(row[1]) + " " + std::to_string(row[2]);
}

/// The text with lines that end otherwise, and in other codings.
std::vector<Variant> spellings(const std::string& name, const std::string& text) {
  std::vector<Variant> result;
  const auto replaced = [&](const std::string& end) {
    std::string other;
    for (const char c : text) c == '\n' ? other += end : other += c;
    return other;
  };
  for (const auto& [of, end] : {std::pair{"LF", "\n"}, {"CRLF", "\r\n"}, {"CR", "\r"}}) {
    const std::string lines = replaced(end);
    std::string little = "\xFF\xFE", big = "\xFE\xFF";
    for (const char c : lines) {
      (little += c) += '\0';
      (big += '\0') += c;
    }
    result.push_back({name + ", " + of, lines});
    result.push_back({name + ", " + of + ", UTF-16 little", little});
    result.push_back({name + ", " + of + ", UTF-16 big", big});
  }
  result.push_back({name + ", UTF-8 with its mark", "\xEF\xBB\xBF" + text});
  return result;
}

void append(std::vector<Variant>& all, std::vector<Variant> more) {
  all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

template <class T>
void put_bytes(std::string& bytes, T value, bool little) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (little != (std::endian::native == std::endian::little)) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::vector<Variant> obj_variants() {
  std::string points, plain, relative, whole;
  for (const auto& corner : tetrahedron_points) points += "v " + numbers(corner) + "\n";
  for (const auto& side : tetrahedron_sides) {
    plain += "f", relative += "f", whole += "f";
    for (const int v : side) {
      plain += " " + std::to_string(v + 1);
      relative += " " + std::to_string(v - 4);
      whole += " " + std::to_string(v + 1) + "/1/1";
    }
    plain += "\n", relative += "\n", whole += "\n";
  }
  std::vector<Variant> all = spellings("obj", points + plain);
  append(all, spellings("obj with dollar comments", "$ of an exporter\n" + points + "$\n" + plain));
  append(all, spellings("obj with faces of two corners", points + "f 1 2\nf 3\n" + plain));
  all.push_back({"obj, relative", points + relative});
  all.push_back({"obj, all indices", points + "vt 0 0\nvn 0 0 1\n" + whole});
  all.push_back({"obj, faces first", plain + points});
  all.push_back({"obj, no line end at the end", points + plain.substr(0, plain.size() - 1)});
  return all;
}

std::vector<Variant> off_variants() {
  std::vector<Variant> all;
  const auto text = [](const std::string& head, const std::string& more, const std::string& between) {
    std::string result = head;
    for (const auto& corner : tetrahedron_points) result += numbers(corner) + more + "\n";
    for (const auto& side : tetrahedron_sides)
      result += "3" + between + std::to_string(side[0]) + between + std::to_string(side[1]) + " " +
                std::to_string(side[2]) + "\n";
    return result;
  };
  append(all, spellings("off", text("OFF\n4 4 6\n", "", " ")));
  append(all, spellings("off, glued counts", text("OFF4 4 0\n", "", " ")));
  append(all, spellings("off, lower case", text("off\n4 4 0\n", "", " ")));
  append(all, spellings("off, wrapped faces", text("OFF\n4 4 0\n", "", "\n")));
  for (const auto& [head, more] : {std::pair{"COFF", " 255 0 0 255"},
                                   {"NOFF", " 0 0 1"},
                                   {"CNOFF", " 1 0 0 1 0 0 1"},
                                   {"STOFF", " 0 0"},
                                   {"noff", " 0 0 1"}})
    all.push_back({head, text(head + std::string("\n4 4 0\n"), more, " ")});
  all.push_back({"off, one line", text("OFF 4 4 0\n", "", " ")});
  all.push_back({"off, no edges", text("OFF\n4 4\n", "", " ")});
  all.push_back({"off, comments", text("# a\nOFF # b\n# c\n4 4 0 # d\n", " # e", " ")});
  for (const auto& [head, more] :
       {std::pair{"OFF", std::size_t{0}}, {"COFF", std::size_t{4}}, {"NOFF", std::size_t{3}}}) {
    std::string bytes = head + std::string(" BINARY\n");
    for (const int count : {4, 4, 6}) put_bytes(bytes, count, false);
    for (const auto& corner : tetrahedron_points) {
      for (const int x : corner) put_bytes(bytes, static_cast<float>(x), false);
      bytes.append(4 * more, '\0');
    }
    for (const auto& side : tetrahedron_sides) {
      put_bytes(bytes, 3, false);
      for (const int v : side) put_bytes(bytes, v, false);
      put_bytes(bytes, 1, false);
      put_bytes(bytes, 0.5F, false);
    }
    all.push_back({head + std::string(", bytes"), bytes});
  }
  return all;
}

std::vector<Variant> ply_variants() {
  std::vector<Variant> all;
  const std::string head = " 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement ";
  const std::string faces = "face 4\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string strips = "tristrips 1\nproperty list int int vertex_indices\nend_header\n";
  // 0 2 1 3 is the sides 0 2 1 and 1 2 3; each of the others begins anew.
  const std::vector<int> strip{0, 2, 1, 3, -1, 0, 3, 2, -1, 0, 1, 3};
  std::string text, strip_text = std::to_string(strip.size());
  for (const auto& corner : tetrahedron_points) text += numbers(corner) + "\n";
  for (const int v : strip) strip_text += " " + std::to_string(v);
  std::string face_text;
  for (const auto& side : tetrahedron_sides) face_text += "3 " + numbers(side) + "\n";
  append(all, spellings("ply", "ply\nformat ascii" + head + faces + text + face_text));
  append(all, spellings("ply of strips", "ply\nformat ascii" + head + strips + text + strip_text + "\n"));
  for (const bool little : {true, false})
    for (const std::string end : {"\n", "\r\n", "\r"})
      for (const bool of_strips : {true, false}) {
        std::string bytes = "ply\nformat binary_" + std::string(little ? "little" : "big") + "_endian" + head +
                            (of_strips ? strips : faces);
        for (std::size_t k = 0; (k = bytes.find('\n', k)) != std::string::npos; k += end.size())
          bytes.replace(k, 1, end);
        for (const auto& corner : tetrahedron_points)
          for (const int x : corner) put_bytes(bytes, static_cast<float>(x), little);
        if (of_strips) {
          put_bytes(bytes, static_cast<int>(strip.size()), little);
          for (const int v : strip) put_bytes(bytes, v, little);
        } else {
          for (const auto& side : tetrahedron_sides) {
            put_bytes(bytes, std::uint8_t{3}, little);
            for (const int v : side) put_bytes(bytes, v, little);
          }
        }
        all.push_back({std::string("ply, bytes") + (little ? ", little" : ", big") + (of_strips ? ", strips" : "") +
                           ", header ends " + std::to_string(end.size()) + (end == "\r" ? " CR" : ""),
                       bytes});
      }
  return all;
}

std::vector<Variant> stl_variants() {
  std::vector<Variant> all;
  std::string text = "solid tetrahedron\n", bytes;
  for (const auto& side : tetrahedron_sides) {
    text += "  facet normal 0 0 0\n    outer loop\n";
    bytes.append(12, '\0');
    for (const int v : side) {
      text += "      vertex " + numbers(tetrahedron_points[v]) + "\n";
      for (const int x : tetrahedron_points[v]) put_bytes(bytes, static_cast<float>(x), true);
    }
    text += "    endloop\n  endfacet\n";
    bytes.append(2, '\0');
  }
  append(all, spellings("stl", text + "endsolid tetrahedron\n"));
  std::string count;
  put_bytes(count, 4, true);
  for (const std::string title : {"", "solid but of bytes"}) {
    std::string head = title;
    head.resize(80, ' ');
    all.push_back({"stl, bytes, titled '" + title + "'", head + count + bytes});
    all.push_back({"stl, bytes and more, titled '" + title + "'", std::string(80, '\0') + count + bytes + "trailer"});
  }
  return all;
}

}  // namespace

TEST_CASE("formats: every variant of a surface file gives the same mesh", "[io][formats][fast]") {
  const test::ScratchFolder folder("quadrig_formats");
  std::size_t read = 0;
  for (const auto& [extension, variants] : {std::pair{".obj", obj_variants()},
                                            {".off", off_variants()},
                                            {".ply", ply_variants()},
                                            {".stl", stl_variants()}})
    for (const Variant& variant : variants) {
      INFO(variant.name);
      const std::filesystem::path path = folder / ("surface" + std::string(extension));
      std::ofstream(path, std::ios::binary) << variant.bytes;
      Context context;
      const Expected<PolygonMesh> mesh = read_surface(path, {}, context);
      INFO((mesh ? std::string() : mesh.error().message()));
      REQUIRE(mesh);
      CHECK(mesh->vertex_count() == 4);
      CHECK(mesh->polygon_count() == 4);
      // Without an extension it is known by how it begins.
      std::ofstream(folder / "surface", std::ios::binary) << variant.bytes;
      const Expected<PolygonMesh> unnamed = read_surface(folder / "surface", {}, context);
      INFO((unnamed ? std::string() : unnamed.error().message()));
      REQUIRE(unnamed);
      CHECK(unnamed->positions == mesh->positions);
      CHECK(unnamed->corners == mesh->corners);
      const Expected<Prepared> prepared = prepare(*mesh, nullptr, {}, context);
      REQUIRE(prepared);
      CHECK(prepared->mesh.closed());
      CHECK(prepared->report.turned_faces == 0);
      CHECK(prepared->mesh.position(prepared->mesh.vertex_count() - 1).norm() > 0);
      ++read;
    }
  CHECK(read >= 83);
}

TEST_CASE("formats: what no reader reads is named with a way out", "[io][formats][fast]") {
  const test::ScratchFolder folder("quadrig_formats");
  const auto fault = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    Context context;
    const Expected<PolygonMesh> mesh = read_surface(folder / name, {}, context);
    return mesh ? std::string("no error") : mesh.error().message();
  };
  const auto has = [](const std::string& text, const std::string& part) {
    INFO(text);
    CHECK(text.find(part) != std::string::npos);
  };
  has(fault("a.3mf", "PK"), "convert it to .stl");
  has(fault("a", "PK"), "convert it to .stl");
  has(fault("a", "a letter"), "begins like no surface format");
  has(fault("a.stl", std::string(80, ' ') + "\1"), "84 bytes");
  has(fault("a.stl", std::string(80, ' ') + std::string("\xFF\xFF\xFF\x7F", 4)), "more than the file can hold");
  has(fault("a.stl", "solid\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n"), "a loop of 2 vertices");
  has(fault("a.stl", "solid\nouter loop\nvertex 0 0 nan\n"), "not a finite number");
  has(fault("a.stl", "solid\nendsolid\n"), "no triangles");
  has(fault("a.off", "4OFF\n"), "files are not read");
  has(fault("a.off", "OFF BINARY\n"), "counts are missing");
  has(fault("a.off", std::string("OFF BINARY\n\xFF\xFF\xFF\xFF\0\0\0\1\0\0\0\0", 23)), "more than the file can hold");
  has(fault("a.obj", std::string("\xFF\xFE\0\xD8v\0", 6)), "no UTF-16");
  has(fault("a.obj", std::string("\xFF\xFEv", 3)), "no UTF-16");
  has(fault("a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n3 0 -2 0\n"),
      "cannot be");
}
