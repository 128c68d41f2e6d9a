// What a call will take, told before it is taken.
#pragma once

#include "io/estimate.hpp"
#include "job.hpp"

namespace quadrig::c {

using io::prepare_bytes;
using io::remesh_bytes;

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
