// A C++ program without exceptions and run-time types: errors, cancel, and where the quads lie on the triangles.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "shape.h"

#if defined(__cpp_exceptions) || defined(__cpp_rtti)
#error built with exceptions or run-time types
#endif

#define CHECK(condition)                                                   \
  do {                                                                     \
    if (!(condition)) {                                                    \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::exit(1);                                                        \
    }                                                                      \
  } while (0)

namespace {

struct Destroy {
  void operator()(quadrig_job* p) const { quadrig_job_destroy(p); }
  void operator()(quadrig_asset* p) const { quadrig_asset_destroy(p); }
  void operator()(quadrig_quads* p) const { quadrig_quads_destroy(p); }
};
template <class T>
using Handle = std::unique_ptr<T, Destroy>;

void cancel_at_once(void* user, const char*, double) { quadrig_job_cancel(static_cast<quadrig_job*>(user)); }

void work() {
  static thread_local shape s;
  quadrig_mesh mesh;
  make_shape(&s, &mesh);
  const Handle<quadrig_job> job(quadrig_job_create());
  quadrig_asset* made = nullptr;
  CHECK(quadrig_asset_create(job.get(), &mesh, &made) == quadrig_ok);
  const Handle<quadrig_asset> asset(made);

  quadrig_options options;
  quadrig_options_init(&options, sizeof options);
  options.quads = 2;
  quadrig_quads* result = nullptr;
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_bad_option);
  CHECK(!result && std::strstr(quadrig_job_message(job.get()), "quads"));
  options.quads = 300;
  quadrig_job_set_progress(job.get(), cancel_at_once, job.get());
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_cancelled);
  quadrig_job_set_progress(job.get(), nullptr, nullptr);
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_cancelled);
  quadrig_job_reset(job.get());
  CHECK(quadrig_remesh(job.get(), asset.get(), &options, &result) == quadrig_ok);
  const Handle<quadrig_quads> quads(result);

  const std::size_t n = quadrig_quads_vertex_count(quads.get());
  std::vector<double> positions(3 * n), barycentric(3 * n);
  std::vector<std::uint32_t> triangles(n);
  CHECK(quadrig_quads_positions(quads.get(), positions.data(), positions.size()) == quadrig_ok);
  CHECK(quadrig_quads_source(quads.get(), triangles.data(), n, barycentric.data(), 3 * n) == quadrig_ok);
  for (std::size_t v = 0; v < n; ++v) {
    CHECK(triangles[v] < shape_triangles);
    for (std::size_t k = 0; k < 3; ++k) {
      double x = 0;
      for (std::size_t i = 0; i < 3; ++i)
        x += barycentric[3 * v + i] * static_cast<double>(s.positions[3 * s.triangles[3 * triangles[v] + i] + k]);
      CHECK(std::fabs(x - positions[3 * v + k]) < 0.1);  // the fit stands off the surface, a little
    }
  }
}

}  // namespace

int main() {
  std::thread other(work);
  work();
  other.join();
  std::puts("C++ without exceptions and run-time types: ok");
  return 0;
}
