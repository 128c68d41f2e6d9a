// What a call will take, told before it is taken.
#pragma once

#include "job.hpp"
#include "quadrig/pipeline/ladder.hpp"

namespace quadrig::c {

/// Bytes that remeshing takes at its peak, from above: measured as docs/c.md says, where the peak of the process
/// was 0.37 to 0.87 of it.
[[nodiscard]] inline double remesh_bytes(double triangles, double bones, double quads) {
  // The map is made on the triangles themselves or, of far more than it needs, on a stand-in.
  const double mapped = std::min(triangles, enough_triangles(quads));
  const double poses = 512 * bones * bones;  // every bone bent four ways, a transform of each bone in each
  return 32e6 + poses + triangles * (1.2e3 + 13 * bones) + 3.5e3 * mapped + 8.5e3 * quads;
}

/// Bytes that an asset takes while it is welded and mended, from above.
[[nodiscard]] inline double prepare_bytes(double triangles, double influences) {
  return 8e6 + triangles * (900 + 16 * influences);
}

/// The largest file that is read under the job's limit.
[[nodiscard]] inline std::size_t file_bytes(const quadrig_job* job) {
  return static_cast<std::size_t>(
      std::min<std::uint64_t>(job->memory_limit / 4, std::numeric_limits<std::size_t>::max()));
}

/// \return quadrig_ok where the bytes fit the job's limit, else quadrig_out_of_memory with a message
[[nodiscard]] inline quadrig_status within_limit(quadrig_job* job, double bytes, const char* remedy) {
  if (job->memory_limit == 0 || bytes <= static_cast<double>(job->memory_limit)) return quadrig_ok;
  job->message = "memory: may need " + std::to_string(static_cast<std::uint64_t>(bytes / 1e6)) +
                 " MB, above the limit of " + std::to_string(job->memory_limit / 1'000'000) + " MB; " + remedy;
  return quadrig_out_of_memory;
}

}  // namespace quadrig::c
