// What the benchmarks share: samples of a wanted size, made once, and a register of named runs.
#pragma once

#include <benchmark/benchmark.h>

#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "quadrig/io.hpp"
#include "quadrig/samples.hpp"

namespace quadrig::bench {

/// A sample of about `faces` triangles; the same object at every call.
inline const Asset& sample(const std::string& name, Index faces) {
  static std::map<std::pair<std::string, Index>, std::unique_ptr<Asset>> made;
  auto& asset = made[{name, faces}];
  if (!asset) {
    Context context;
    auto result = make_sample(name, faces, context);
    if (!result) throw std::runtime_error(result.error().message());
    asset = std::make_unique<Asset>(std::move(*result));
  }
  return *asset;
}

/// Every triangle in four.
inline TriangleMesh<double> subdivided(const TriangleMesh<double>& mesh) {
  Points<double> points(mesh.vertex_count() + mesh.edge_count(), 3);
  points.topRows(mesh.vertex_count()) = mesh.positions();
  Index count = mesh.vertex_count();
  std::vector<Index> middle(static_cast<std::size_t>(mesh.halfedge_count()));
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index twin = mesh.twin(h);
    if (twin != no_index && twin < h) continue;
    points.row(count) = (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))).transpose() / 2;
    middle[static_cast<std::size_t>(h)] = count;
    if (twin != no_index) middle[static_cast<std::size_t>(twin)] = count;
    ++count;
  }
  Triangles faces(4 * mesh.face_count(), 3);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto at = static_cast<std::size_t>(3 * f);
    faces.row(4 * f) << mesh.faces()(f, 0), middle[at], middle[at + 2];
    faces.row(4 * f + 1) << middle[at], mesh.faces()(f, 1), middle[at + 1];
    faces.row(4 * f + 2) << middle[at + 2], middle[at + 1], mesh.faces()(f, 2);
    faces.row(4 * f + 3) << middle[at], middle[at + 1], middle[at + 2];
  }
  auto result = TriangleMesh<double>::create(std::move(points), std::move(faces));
  if (!result) throw std::runtime_error(result.error().message());
  return std::move(*result);
}

/// Squares of the integer lattice, two triangles each, as one surface.
class Squares {
 public:
  void add(const std::array<std::array<int, 3>, 4>& corners) {
    std::array<Index, 4> at{};
    for (std::size_t k = 0; k < 4; ++k) {
      const auto [entry, fresh] = number_.try_emplace(corners[k], static_cast<Index>(points_.size()));
      if (fresh) points_.push_back(corners[k]);
      at[k] = entry->second;
    }
    triangles_.push_back({at[0], at[1], at[2]});
    triangles_.push_back({at[0], at[2], at[3]});
  }
  [[nodiscard]] TriangleMesh<double> mesh() const {
    Points<double> points(static_cast<Eigen::Index>(points_.size()), 3);
    for (std::size_t v = 0; v < points_.size(); ++v)
      points.row(static_cast<Eigen::Index>(v)) << points_[v][0], points_[v][1], points_[v][2];
    Triangles faces(static_cast<Eigen::Index>(triangles_.size()), 3);
    for (std::size_t f = 0; f < triangles_.size(); ++f)
      faces.row(static_cast<Eigen::Index>(f)) << triangles_[f][0], triangles_[f][1], triangles_[f][2];
    auto result = TriangleMesh<double>::create(std::move(points), std::move(faces));
    if (!result) throw std::runtime_error(result.error().message());
    return std::move(*result);
  }

 private:
  std::map<std::array<int, 3>, Index> number_;
  std::vector<std::array<int, 3>> points_;
  std::vector<std::array<Index, 3>> triangles_;
};

/// 52 squares by 52, flat, with a border: 5408 triangles.
inline TriangleMesh<double> grid() {
  Squares squares;
  for (int i = 0; i < 52; ++i)
    for (int j = 0; j < 52; ++j) squares.add({{{i, j, 0}, {i + 1, j, 0}, {i + 1, j + 1, 0}, {i, j + 1, 0}}});
  return squares.mesh();
}
/// A plate with five square holes, of genus 5: 208 triangles, split in sixteen: 3328.
inline TriangleMesh<double> plate() {
  const auto solid = [](int i, int j) { return i >= 0 && i < 11 && j >= 0 && j < 3 && !(j == 1 && i % 2 == 1); };
  Squares squares;
  for (int i = 0; i < 11; ++i)
    for (int j = 0; j < 3; ++j) {
      if (!solid(i, j)) continue;
      const int a = i + 1, b = j + 1;
      squares.add({{{i, j, 1}, {a, j, 1}, {a, b, 1}, {i, b, 1}}});
      squares.add({{{i, j, 0}, {i, b, 0}, {a, b, 0}, {a, j, 0}}});
      if (!solid(i - 1, j)) squares.add({{{i, j, 0}, {i, j, 1}, {i, b, 1}, {i, b, 0}}});
      if (!solid(i + 1, j)) squares.add({{{a, j, 0}, {a, b, 0}, {a, b, 1}, {a, j, 1}}});
      if (!solid(i, j - 1)) squares.add({{{i, j, 0}, {a, j, 0}, {a, j, 1}, {i, j, 1}}});
      if (!solid(i, j + 1)) squares.add({{{i, b, 0}, {i, b, 1}, {a, b, 1}, {a, b, 0}}});
    }
  return subdivided(subdivided(squares.mesh()));
}

/// A surface by name: a sample, `grid`, `plate`, or a file.
inline TriangleMesh<double> coarse_surface(const std::string& name) {
  if (name == "grid") return grid();
  if (name == "plate") return plate();
  if (name.find('.') == std::string::npos) return sample(name, 5'400).mesh;
  Context context;
  auto loaded = load_asset({name, {}, {}}, {}, context);
  if (!loaded) throw std::runtime_error(loaded.error().message());
  return std::move(loaded->asset.mesh);
}

/// A surface of about 5400 triangles, subdivided `levels` times: 5.4k, 22k, 86k, 346k, 1.38M. The last is kept.
inline const TriangleMesh<double>& surface(const std::string& name, int levels) {
  static std::string kept_name;
  static int kept_levels = -1;
  static TriangleMesh<double> kept;
  if (kept_name != name || kept_levels != levels) {
    const bool finer = kept_name == name && kept_levels < levels;
    if (!finer) kept = coarse_surface(name);
    for (int level = finer ? kept_levels : 0; level < levels; ++level) kept = subdivided(kept);
    kept_name = name;
    kept_levels = levels;
  }
  return kept;
}

/// A line of /proc/self/status in bytes; 0 where there is none.
inline double memory(const char* line) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == line) {
      double kilobytes = 0;
      status >> kilobytes;
      return 1024 * kilobytes;
    }
  return 0;
}
/// What body() needs at its peak beyond what is held before, bytes; on Linux.
template <class Body>
double peak_memory(Body&& body) {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
  std::ofstream("/proc/self/clear_refs") << "5";
  const double before = memory("VmRSS:");
  body();
  return memory("VmHWM:") - before;
}

/// BM_<verb>/<backend>/<mesh>/<faces>
inline std::string run_name(const std::string& verb, const std::string& backend, const std::string& mesh, Index faces) {
  return "BM_" + verb + "/" + backend + "/" + mesh + "/" + std::to_string(faces);
}

/// Takes a word such as --full out of the arguments; whether it was there.
inline bool take_flag(int& argc, char** argv, const char* flag) {
  for (int k = 1; k < argc; ++k)
    if (std::strcmp(argv[k], flag) == 0) {
      for (int i = k; i + 1 < argc; ++i) argv[i] = argv[i + 1];
      --argc;
      return true;
    }
  return false;
}

/// What stands behind the first such flag, both taken from the arguments.
inline std::optional<std::string> take_value(int& argc, char** argv, const char* flag) {
  for (int k = 1; k + 1 < argc; ++k)
    if (std::strcmp(argv[k], flag) == 0) {
      std::string value = argv[k + 1];
      for (int i = k; i + 2 < argc; ++i) argv[i] = argv[i + 2];
      argc -= 2;
      return value;
    }
  return std::nullopt;
}

}  // namespace quadrig::bench
