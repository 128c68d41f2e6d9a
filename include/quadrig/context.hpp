// One object handed down to every long call: log, progress, cancel and threads. There are no globals.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <ctime>
#include <exception>
#include <functional>
#include <optional>
#include <string_view>
#include <thread>

#include "quadrig/core.hpp"

namespace quadrig {

/// A stretch of work that has ended, as `Context::on_span` gets it. Spans of one thread nest.
struct Span {
  std::string_view name;                      ///< of the stage; a literal
  std::string detail;                         ///< which of its kind; may be empty
  double begin_seconds = 0, end_seconds = 0;  ///< on the steady clock
  double cpu_seconds = 0;                     ///< of its own thread; workers have spans of their own
  std::thread::id thread{}, waiting{};        ///< of a worker `waiting` is the thread that waits for it, else `thread`
};

class Context {
 public:
  /// Stage name and an estimate of the fraction of the whole job that is done, in [0, 1]; it never falls. Called from
  /// the calling thread only.
  using Progress = std::function<void(std::string_view stage, double fraction)>;
  /// What a stage found, a line without an end. Called from the calling thread only.
  using Log = std::function<void(std::string_view line)>;

  Progress on_progress;
  Log on_log;
  /// Set from any thread; polled between faces, rows and iterations of every long loop. May be null.
  const std::atomic<bool>* cancel_flag = nullptr;
  /// Called at each of these polls, from any thread; true cancels, and has to stay true. For hosts that have no flag,
  /// and to count the polls.
  std::function<bool()> on_poll;
  /// Called from any thread, several at once, when a stage or a worker ends; nothing is measured where it is empty.
  std::function<void(const Span&)> on_span;
  /// Upper bound on threads; results are the same bits for every value. 0: as many as the machine has.
  unsigned threads = 0;

  [[nodiscard]] bool cancelled() const {
    return (cancel_flag && cancel_flag->load(std::memory_order_relaxed)) || (on_poll && on_poll());
  }
  /// One for other threads and for trials: cancelled and measured with this one, without its progress, log and
  /// warnings.
  [[nodiscard]] Context quiet(unsigned most_threads) const {
    Context own;
    own.cancel_flag = cancel_flag;
    own.on_poll = on_poll;
    own.on_span = on_span;
    own.threads = most_threads;
    return own;
  }
  void progress(std::string_view stage, double fraction) const {
    if (on_progress) on_progress(stage, fraction);
  }
  void log(std::string_view line) const {
    if (on_log) on_log(line);
  }
  void warn(std::string stage, std::string text) { warnings.push_back({std::move(stage), std::move(text)}); }

  std::vector<Warning> warnings;

  [[nodiscard]] unsigned thread_count() const {
    return threads ? threads : std::max(1u, std::thread::hardware_concurrency());
  }

  /// Calls body(begin, end) over disjoint ranges that cover [0, n). Bodies write only to their own range, so the
  /// result does not depend on the number of threads; sums are made by the caller, in order. What a body throws (memory
  /// that is not there) reaches the caller once all have ended, the first range's first.
  /// \param grain least length of a range that is worth a thread; 0: one thread. \pre no range waits for another
  void parallel_for(std::size_t n, std::size_t grain, function_ref<void(std::size_t, std::size_t)> body) const;
  /// The sum of what body(begin, end) returns for runs of 4096 that cover [0, n), in their order: the bits do not
  /// depend on the number of threads. `sum`: what it begins from.
  template <class Sum = double, class Body>
  [[nodiscard]] Sum parallel_sum(std::size_t n, Body&& body, Sum sum = {}) const {
    constexpr std::size_t run = 4096;
    std::vector<Sum> parts((n + run - 1) / run, sum);
    parallel_for(parts.size(), 4, [&](std::size_t first, std::size_t last) {
      for (std::size_t k = first; k < last; ++k) parts[k] = body(k * run, std::min(n, (k + 1) * run));
    });
    for (const Sum& each : parts) sum += each;
    return sum;
  }
};

namespace detail {

/// CPU seconds of the calling thread; of the process where the system does not count them by thread.
[[nodiscard]] inline double thread_cpu_seconds() {
#if defined(CLOCK_THREAD_CPUTIME_ID)
  std::timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) == 0)
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
#endif
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}
[[nodiscard]] inline double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace detail

/// Reports a span from its construction to its end.
class SpanTimer {
 public:
  /// \param waiting of a worker the thread that waits for it
  SpanTimer(const Context& context, std::string_view name, std::string detail = {},
            std::thread::id waiting = std::this_thread::get_id())
      : context_(context) {
    if (!context.on_span) return;
    span_ = {name, std::move(detail), detail::steady_seconds(), 0, 0, std::this_thread::get_id(), waiting};
    cpu_before_ = detail::thread_cpu_seconds();
  }
  ~SpanTimer() { end(); }
  SpanTimer(const SpanTimer&) = delete;
  SpanTimer& operator=(const SpanTimer&) = delete;

  /// Ends it before its scope does.
  void end() {
    if (span_.name.empty()) return;
    span_.cpu_seconds = detail::thread_cpu_seconds() - cpu_before_;
    span_.end_seconds = detail::steady_seconds();
    context_.on_span(span_);
    span_.name = {};
  }

 private:
  const Context& context_;
  Span span_;
  double cpu_before_ = 0;
};

// Not a template: every loop of the library would compile its own threads.
inline void Context::parallel_for(std::size_t n, std::size_t grain,
                                  function_ref<void(std::size_t, std::size_t)> body) const {
  const std::size_t parts = std::min<std::size_t>(thread_count(), grain ? (n + grain - 1) / grain : 1);
  if (parts <= 1) {
    body(std::size_t{0}, n);
    return;
  }
  std::vector<std::exception_ptr> thrown(parts);
  const std::thread::id caller = std::this_thread::get_id();
  const auto run = [&](std::size_t part) noexcept {
    std::optional<SpanTimer> span;
    if (on_span && std::this_thread::get_id() != caller) span.emplace(*this, "worker", std::string(), caller);
    try {
      body(n * part / parts, n * (part + 1) / parts);
    } catch (...) {
      thrown[part] = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> workers;
    workers.reserve(parts - 1);
    std::size_t part = 1;
    try {
      for (; part < parts; ++part) workers.emplace_back([&run, part] { run(part); });
    } catch (const std::exception&) {  // no more threads can be made: this one does their parts
    }
    run(0);
    for (; part < parts; ++part) run(part);
  }
  for (const std::exception_ptr& one : thrown)
    if (one) std::rethrow_exception(one);
}

namespace detail {
/// Calls one() and other() side by side or, where no thread can be made, one after the other. What they throw reaches
/// the caller.
template <class One, class Other>
void side_by_side(One&& one, Other&& other) {
  std::exception_ptr thrown;
  const auto run = [&]() noexcept {
    try {
      other();
    } catch (...) {
      thrown = std::current_exception();
    }
  };
  {
    std::jthread thread;
    try {
      thread = std::jthread(run);
    } catch (const std::exception&) {  // there is none to be had
    }
    one();
    if (!thread.joinable()) run();
  }
  if (thrown) std::rethrow_exception(thrown);
}
}  // namespace detail

/// While it lives, the progress that is reported to a context becomes the part [from, to] of its caller's.
class ProgressPart {
 public:
  ProgressPart(Context& context, double from, double to) : context_(context), outer_(context.on_progress) {
    if (!outer_) return;
    context.on_progress = [this, from, to, reported = from](std::string_view stage, double fraction) mutable {
      reported = std::max(reported, from + (to - from) * std::clamp(fraction, 0.0, 1.0));
      outer_(stage, reported);
    };
  }
  ~ProgressPart() { context_.on_progress = std::move(outer_); }
  ProgressPart(const ProgressPart&) = delete;
  ProgressPart& operator=(const ProgressPart&) = delete;

 private:
  Context& context_;
  Context::Progress outer_;
};

/// Context::parallel_for in ranges of thousands; in one thread where there is no context.
inline void parallel_for(const Context* context, std::size_t n, function_ref<void(std::size_t, std::size_t)> body) {
  constexpr std::size_t grain = 16384;
  if (context)
    context->parallel_for(n, grain, body);
  else
    body(std::size_t{0}, n);
}
/// Calls body(i) for every i below n. Bodies write only what is theirs.
template <class Body>
void parallel_each(const Context* context, std::size_t n, Body&& body) {
  parallel_for(context, n, [&body](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

inline Error cancelled_error(std::string_view stage) {
  return {ErrorCode::cancelled, "cancelled by the caller", std::string(stage), {}};
}

/// Seconds since its construction, on the steady clock.
class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace quadrig
