// What the benchmarks share: samples of a wanted size, made once, and a register of named runs.
#pragma once

#include <benchmark/benchmark.h>

#include <cstring>
#include <map>
#include <memory>
#include <string>

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

/// A sample of about 5400 triangles, subdivided `levels` times: 5.4k, 22k, 86k, 346k, 1.38M. The last is kept.
inline const TriangleMesh<double>& surface(const std::string& name, int levels) {
  static std::string kept_name;
  static int kept_levels = -1;
  static TriangleMesh<double> kept;
  if (kept_name != name || kept_levels != levels) {
    const bool finer = kept_name == name && kept_levels < levels;
    if (!finer) kept = sample(name, 5'400).mesh;
    for (int level = finer ? kept_levels : 0; level < levels; ++level) kept = subdivided(kept);
    kept_name = name;
    kept_levels = levels;
  }
  return kept;
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

}  // namespace quadrig::bench
