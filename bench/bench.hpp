// What the benchmarks share: samples of a wanted size, made once, and a register of named runs.
#pragma once

#include <benchmark/benchmark.h>

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

/// BM_<verb>/<backend>/<mesh>/<faces>
inline std::string run_name(const std::string& verb, const std::string& backend, const std::string& mesh, Index faces) {
  return "BM_" + verb + "/" + backend + "/" + mesh + "/" + std::to_string(faces);
}

}  // namespace quadrig::bench
