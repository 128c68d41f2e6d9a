// Where the time of a run went: the spans of its context as trace events, and as a table.
#pragma once

#include <mutex>

#include "command.hpp"

namespace quadrig::cli {

/// Collects spans, from any thread.
class Profile {
 public:
  /// Connects a context, which may not be used longer than this lives.
  void watch(Context& context);

  /// Trace events as Perfetto and chrome://tracing read them, microseconds from the first: one a span, with the CPU
  /// time of its thread, and the peak of memory so far as a counter.
  [[nodiscard]] std::string trace() const;
  /// A line for each stage within each stage: how often, wall and CPU seconds, and how much of these other threads
  /// took.
  [[nodiscard]] std::string table() const;

 private:
  struct Record {
    Span span;
    double peak_bytes = 0;
    std::size_t thread = 0;
    std::size_t inside = none;  ///< the record that it is part of
    double workers_cpu_seconds = 0;
  };
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  /// The records, a thread's in the order of their beginnings, each with what it is part of.
  [[nodiscard]] std::vector<Record> nested() const;

  mutable std::mutex mutex_;
  std::vector<Record> records_;
};

}  // namespace quadrig::cli
