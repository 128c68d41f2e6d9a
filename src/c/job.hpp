// What the functions of c.h share: the job, and the border that no exception crosses.
#pragma once

#include <atomic>
#include <cstring>
#include <new>

#include "quadrig/c.h"
#include "quadrig/pipeline.hpp"

struct quadrig_job {
  std::atomic<bool> cancel = false;
  std::uint32_t threads = 0;
  std::uint64_t memory_limit = 0;
  quadrig_progress progress = nullptr;
  void* user = nullptr;
  std::string message;
  const char* fixed_message = nullptr;  // where there is no memory for another
  std::vector<std::string> warnings;
};

struct quadrig_asset {
  std::shared_ptr<const quadrig::Asset> asset;
  std::vector<quadrig::Index> source_polygon;  // of each face
  // As they were given; empty of an asset from files.
  quadrig::Points<double> positions;
  quadrig::Triangles triangles;
};

namespace quadrig::c {

[[nodiscard]] constexpr quadrig_status status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::bad_option:
      return quadrig_bad_option;
    case ErrorCode::bad_file:
      return quadrig_bad_file;
    case ErrorCode::bad_input:
      return quadrig_bad_input;
    case ErrorCode::unsupported:
      return quadrig_unsupported;
    case ErrorCode::numeric:
      return quadrig_numeric_failure;
    case ErrorCode::stage_failed:
      return quadrig_stage_failed;
    case ErrorCode::cancelled:
      return quadrig_cancelled;
  }
  return quadrig_internal_error;
}

inline void keep_warnings(quadrig_job& job, const Context& context) {
  for (const Warning& warning : context.warnings) job.warnings.push_back(warning.stage + ": " + warning.text);
}

/// Calls body(context) -> Expected<quadrig_status>; what it throws ends here.
template <class Body>
[[nodiscard]] quadrig_status guarded(quadrig_job* job, Body&& body) noexcept {
  if (!job) return quadrig_bad_option;
  job->message.clear();
  job->fixed_message = nullptr;
  job->warnings.clear();
  try {
    Context context;
    context.threads = job->threads;
    context.cancel_flag = &job->cancel;
    if (job->progress)
      context.on_progress = [job](std::string_view stage, double fraction) {
        job->progress(job->user, std::string(stage).c_str(), fraction);
      };
    Expected<quadrig_status> result = context.cancelled() ? cancelled_error("start") : body(context);
    if (result) {
      try {
        keep_warnings(*job, context);
      } catch (const std::bad_alloc&) {  // all is done, and files are in place: that is no failure
        job->warnings.clear();
      }
      return *result;
    }
    keep_warnings(*job, context);
    job->message = result.error().message();
    return status_of(result.error().code);
  } catch (const std::bad_alloc&) {
    job->fixed_message = "out of memory; use a smaller mesh or ask for fewer quads";
    return quadrig_out_of_memory;
  } catch (...) {
    job->fixed_message = "internal error";
    return quadrig_internal_error;
  }
}

/// No struct of any version is larger: a size above is a mistake, and is not read.
inline constexpr std::size_t most_struct_bytes = 4096;

/// The caller's struct over the defaults of ours: members that it does not know keep them.
/// \fails bad_option where its size is that of no struct, or it has members of a later version that are not zero
template <class Struct>
[[nodiscard]] Expected<Struct> known_part(const Struct* given, Struct defaults, const char* name) {
  const std::size_t size = given->size;
  if (size < 2 * sizeof(std::size_t))
    return Error{ErrorCode::bad_option, "has no size", std::string(name) + ".size", "call its _init function"};
  if (size > most_struct_bytes)
    return Error{ErrorCode::bad_option, "is larger than any struct", std::string(name) + ".size",
                 "call its _init function"};
  const auto* bytes = reinterpret_cast<const unsigned char*>(given);
  for (std::size_t i = sizeof(Struct); i < size; ++i)
    if (bytes[i] != 0)
      return Error{ErrorCode::bad_option, "has members that this version does not know", name, "leave them zero"};
  std::memcpy(static_cast<void*>(&defaults), given, std::min(size, sizeof(Struct)));
  defaults.size = sizeof(Struct);
  return defaults;
}

/// The defaults into as much of the caller's struct as there is; a size of 0, which is refused later, where that of the
/// caller is of no struct.
template <class Struct>
void put_defaults(Struct* given, std::size_t size, Struct defaults) noexcept {
  if (!given || size < sizeof(std::size_t)) return;
  if (size > most_struct_bytes) {
    given->size = 0;
    return;
  }
  std::memset(static_cast<void*>(given), 0, size);
  defaults.size = size;
  std::memcpy(static_cast<void*>(given), &defaults, std::min(size, sizeof(Struct)));
}

[[nodiscard]] quadrig_options default_options() noexcept;
/// \fails bad_option
[[nodiscard]] Expected<quadrig_options> read_options(const quadrig_options* options);
[[nodiscard]] Expected<RemeshOptions> remesh_options(const quadrig_options& options);

[[nodiscard]] inline Error null_argument(const char* name) {
  return {ErrorCode::bad_option, "is null", name, "give one"};
}

}  // namespace quadrig::c
