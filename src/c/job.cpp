// Jobs, options and names.
#include "job.hpp"

#include <numbers>

namespace quadrig::c {

quadrig_options default_options() noexcept {
  const RemeshOptions defaults;
  quadrig_options options{};
  options.size = sizeof options;
  options.quads = static_cast<std::uint32_t>(defaults.quads);
  options.preset = quadrig_preset_default;
  options.influences = static_cast<std::uint32_t>(defaults.influences);
  options.bend_degrees = defaults.bend_degrees;
  options.count_tolerance = defaults.count_tolerance;
  options.bones = options.curvature = -1;
  options.posed = defaults.directions.posed;
  options.loops = static_cast<std::uint32_t>(defaults.loops.least);
  options.rings = static_cast<std::size_t>(defaults.rims.rings);
  return options;
}

Expected<quadrig_options> read_options(const quadrig_options* options) {
  if (!options) return default_options();
  return known_part(options, default_options(), "options");
}

Expected<RemeshOptions> remesh_options(const quadrig_options& options) {
  constexpr std::uint32_t most = std::numeric_limits<Index>::max();
  RemeshOptions result;
  result.quads = static_cast<Index>(std::min(options.quads, most));
  result.influences = static_cast<Index>(std::min(options.influences, most));
  switch (options.preset) {
    case quadrig_preset_default:
      break;
    case quadrig_preset_thesis:
      result.preset = FieldPreset::thesis;
      break;
    case quadrig_preset_static:
      result.preset = FieldPreset::flat;
      break;
    default:
      return Error{ErrorCode::bad_option, "is none that there is", "options.preset", "give a quadrig_preset"};
  }
  if (!(options.crease_degrees >= 0 && options.crease_degrees <= 180))
    return Error{ErrorCode::bad_option, "out of range", "options.crease_degrees", "give an angle in [0, 180]"};
  if (options.crease_degrees > 0) result.crease_angle_radians = options.crease_degrees * std::numbers::pi / 180;
  result.bend_degrees = options.bend_degrees;
  result.count_tolerance = options.count_tolerance;
  if (std::isnan(options.bones) || std::isnan(options.curvature))
    return Error{ErrorCode::bad_option, "is not a number", "options.bones, options.curvature", "give a weight"};
  if (options.bones >= 0) result.directions.bones = options.bones;
  if (options.curvature >= 0) result.directions.curvature = options.curvature;
  result.directions.posed = options.posed;
  if (options.keep > (quadrig_keep_materials | quadrig_keep_textures | quadrig_keep_groups))
    return Error{ErrorCode::bad_option, "has a bit that there is none of", "options.keep", "add up quadrig_keep_…"};
  result.loops.least = static_cast<Index>(std::min(options.loops, most));
  result.rims.rings = static_cast<Index>(std::min<std::size_t>(options.rings, most));
  result.curl_rounds = static_cast<Index>(std::min<std::size_t>(options.curl_rounds, most));
  if (options.joint_loop_count > 0 && (!options.loop_joints || !options.joint_loops))
    return Error{ErrorCode::bad_option, "is null", "options.loop_joints, options.joint_loops", "give the arrays"};
  for (std::uint32_t k = 0; k < options.joint_loop_count; ++k) {
    if (!options.loop_joints[k])
      return Error{ErrorCode::bad_option, "is null", "options.loop_joints[" + std::to_string(k) + "]", "give a name"};
    result.loops.of_joints.push_back(
        {options.loop_joints[k], static_cast<Index>(std::min(options.joint_loops[k], most))});
  }
  result.group_borders = (options.keep & quadrig_keep_groups) != 0;
  if (options.symmetry > quadrig_symmetry_z)
    return Error{ErrorCode::bad_option, "is none that there is", "options.symmetry", "give a quadrig_symmetry"};
  if (options.symmetry != quadrig_symmetry_default)
    result.symmetry = static_cast<SymmetryChoice>(options.symmetry - quadrig_symmetry_none);
  if (options.fit > quadrig_fit_subdivision)
    return Error{ErrorCode::bad_option, "is none that there is", "options.fit", "give a quadrig_fit"};
  if (options.fit != quadrig_fit_default) result.fit.method = static_cast<FitMethod>(options.fit - quadrig_fit_none);
  if (Status status = result.validate(); !status) return status.error();
  return result;
}

}  // namespace quadrig::c

extern "C" {

const char* quadrig_version(void) { return QUADRIG_VERSION; }

const char* quadrig_status_name(quadrig_status status) {
  switch (status) {
    case quadrig_ok:
      return "ok";
    case quadrig_internal_error:
      return "internal_error";
    case quadrig_bad_option:
      return "bad_option";
    case quadrig_bad_file:
      return "bad_file";
    case quadrig_bad_input:
      return "bad_input";
    case quadrig_unsupported:
      return "unsupported";
    case quadrig_numeric_failure:
      return "numeric_failure";
    case quadrig_stage_failed:
      return "stage_failed";
    case quadrig_cancelled:
      return "cancelled";
    case quadrig_done_in_part:
      return "done_in_part";
    case quadrig_out_of_memory:
      return "out_of_memory";
    case quadrig_too_small:
      return "too_small";
  }
  return "unknown";
}

quadrig_job* quadrig_job_create(void) { return new (std::nothrow) quadrig_job; }
void quadrig_job_destroy(quadrig_job* job) { delete job; }
void quadrig_job_set_threads(quadrig_job* job, uint32_t threads) {
  if (job) job->threads = threads;
}
void quadrig_job_set_memory_limit(quadrig_job* job, uint64_t bytes) {
  if (job) job->memory_limit = bytes;
}
void quadrig_job_set_progress(quadrig_job* job, quadrig_progress progress, void* user) {
  if (!job) return;
  job->progress = progress;
  job->user = user;
}
void quadrig_job_cancel(quadrig_job* job) {
  if (job) job->cancel.store(true, std::memory_order_relaxed);
}
void quadrig_job_reset(quadrig_job* job) {
  if (!job) return;
  job->cancel.store(false, std::memory_order_relaxed);
  job->message.clear();
  job->fixed_message = nullptr;
  job->warnings.clear();
}
const char* quadrig_job_message(const quadrig_job* job) {
  if (!job) return "the job is null";
  return job->fixed_message ? job->fixed_message : job->message.c_str();
}
size_t quadrig_job_warning_count(const quadrig_job* job) { return job ? job->warnings.size() : 0; }
const char* quadrig_job_warning(const quadrig_job* job, size_t index) {
  return job && index < job->warnings.size() ? job->warnings[index].c_str() : nullptr;
}

void quadrig_options_init(quadrig_options* options, size_t size) {
  quadrig::c::put_defaults(options, size, quadrig::c::default_options());
}

}  // extern "C"
