#include "profile.hpp"

#include <sys/resource.h>

#include <map>

namespace quadrig::cli {
namespace {

double peak_bytes() {
  rusage usage{};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
#if defined(__APPLE__)
  return static_cast<double>(usage.ru_maxrss);
#else
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
#endif
}

bool is_worker(const Span& span) { return span.waiting != span.thread; }

}  // namespace

void Profile::watch(Context& context) {
  context.on_span = [this](const Span& span) {
    const double peak = peak_bytes();
    const std::scoped_lock lock(mutex_);
    records_.push_back({span, peak});
  };
}

std::vector<Profile::Record> Profile::nested() const {
  const std::scoped_lock lock(mutex_);
  std::vector<Record> all = records_;
  std::map<std::thread::id, std::size_t> numbers;
  std::stable_sort(all.begin(), all.end(), [](const Record& a, const Record& b) {
    return a.span.begin_seconds != b.span.begin_seconds ? a.span.begin_seconds < b.span.begin_seconds
                                                        : a.span.end_seconds > b.span.end_seconds;
  });
  for (Record& record : all) record.thread = numbers.try_emplace(record.span.thread, numbers.size()).first->second;
  // Spans of a thread nest: those that are open when another begins contain it.
  std::vector<std::vector<std::size_t>> open(numbers.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Span& span = all[k].span;
    const auto innermost = [&](std::thread::id thread) {
      const auto found = numbers.find(thread);
      if (found == numbers.end()) return none;
      const std::vector<std::size_t>& stack = open[found->second];
      const auto at = std::find_if(stack.rbegin(), stack.rend(),
                                   [&](std::size_t other) { return all[other].span.end_seconds >= span.end_seconds; });
      return at == stack.rend() ? none : *at;
    };
    all[k].inside = innermost(span.waiting);
    std::vector<std::size_t>& own = open[all[k].thread];
    while (!own.empty() && all[own.back()].span.end_seconds < span.end_seconds) own.pop_back();
    open[all[k].thread].push_back(k);
    if (is_worker(span))
      for (std::size_t up = all[k].inside; up != none; up = all[up].inside)
        all[up].workers_cpu_seconds += span.cpu_seconds;
  }
  return all;
}

std::string Profile::trace() const {
  const std::vector<Record> all = nested();
  Json events = Json::array();
  const double begin = all.empty() ? 0 : all.front().span.begin_seconds;
  const auto micros = [](double seconds) { return std::round(1e9 * seconds) / 1e3; };
  std::map<std::size_t, bool> named;
  for (const Record& record : all) {
    const Span& span = record.span;
    if (!std::exchange(named[record.thread], true))
      events.push_back({{"name", "thread_name"},
                        {"ph", "M"},
                        {"pid", 1},
                        {"tid", record.thread},
                        {"args", {{"name", record.thread == 0 ? "main" : "worker " + std::to_string(record.thread)}}}});
    Json event = {{"name", span.name},
                  {"cat", "quadrig"},
                  {"ph", "X"},
                  {"ts", micros(span.begin_seconds - begin)},
                  {"dur", micros(span.end_seconds - span.begin_seconds)},
                  {"pid", 1},
                  {"tid", record.thread},
                  {"args", {{"cpu_seconds", span.cpu_seconds}, {"workers_cpu_seconds", record.workers_cpu_seconds}}}};
    if (!span.detail.empty()) event["args"]["detail"] = span.detail;
    events.push_back(std::move(event));
    events.push_back({{"name", "peak memory"},
                      {"ph", "C"},
                      {"ts", micros(span.end_seconds - begin)},
                      {"pid", 1},
                      {"args", {{"MB", std::round(record.peak_bytes / 1e6)}}}});
  }
  const Json document = {
      {"traceEvents", std::move(events)}, {"displayTimeUnit", "ms"}, {"otherData", {{"quadrig", QUADRIG_VERSION}}}};
  return document.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string Profile::table() const {
  struct Row {
    std::size_t depth = 0;
    std::string name;
    Index times = 0;
    double wall_seconds = 0, cpu_seconds = 0, workers_cpu_seconds = 0;
    std::vector<std::size_t> inner;
  };
  const std::vector<Record> all = nested();
  std::vector<Row> rows(1);
  std::vector<std::size_t> row_of(all.size(), 0);
  double peak = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Span& span = all[k].span;
    peak = std::max(peak, all[k].peak_bytes);
    const std::size_t outer = all[k].inside == none ? 0 : row_of[all[k].inside];
    row_of[k] = outer;
    if (is_worker(span)) continue;  // its time stands in the line of what it works for
    const std::string name = std::string(span.name) + (span.name == "attempt" ? " " + span.detail : "");
    std::size_t row = none;
    for (const std::size_t inner : rows[outer].inner)
      if (rows[inner].name == name) row = inner;
    if (row == none) {
      row = rows.size();
      rows[outer].inner.push_back(row);
      rows.push_back({rows[outer].depth + 1, name, 0, 0, 0, 0, {}});
    }
    row_of[k] = row;
    ++rows[row].times;
    rows[row].wall_seconds += span.end_seconds - span.begin_seconds;
    rows[row].cpu_seconds += span.cpu_seconds + all[k].workers_cpu_seconds;
    rows[row].workers_cpu_seconds += all[k].workers_cpu_seconds;
  }
  char line[160];
  std::snprintf(line, sizeof line, "%-36s %6s %8s %8s %8s\n", "stage", "times", "wall s", "CPU s", "workers");
  std::string text = line;
  const auto print = [&](auto&& self, std::size_t k) -> void {
    const Row& row = rows[k];
    if (k > 0) {
      const double share = row.cpu_seconds > 0 ? 100 * row.workers_cpu_seconds / row.cpu_seconds : 0;
      std::snprintf(line, sizeof line, "%-36s %6d %8.3f %8.3f %6.0f %%\n",
                    (std::string(2 * (row.depth - 1), ' ') + row.name).c_str(), row.times, row.wall_seconds,
                    row.cpu_seconds, share);
      text += line;
    }
    for (const std::size_t inner : row.inner) self(self, inner);
  };
  print(print, 0);
  return text + "peak memory " + decimals(peak / 1e6, 0) + " MB";
}

}  // namespace quadrig::cli
