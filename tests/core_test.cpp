#include "quadrig/core.hpp"

#include <mutex>

#include "quadrig/context.hpp"
#include "quadrig/mesh.hpp"
#include "test.hpp"

using namespace quadrig;

TEST_CASE("core: an error reads as place, fault and remedy", "[core][fast]") {
  const Error error{ErrorCode::bad_input, "vertex index out of range", "face 3", "mend the file"};
  CHECK(error.message() == "face 3: vertex index out of range; mend the file");
  CHECK(Error{ErrorCode::numeric, "singular", {}, {}}.message() == "singular");
}

TEST_CASE("core: Expected holds the value or the error, never both", "[core][fast]") {
  const Expected<int> value(7);
  REQUIRE(value.has_value());
  CHECK(*value == 7);
  const Expected<int> error(Error{ErrorCode::unsupported, "not built", {}, {}});
  REQUIRE_FALSE(error.has_value());
  CHECK(error.error().code == ErrorCode::unsupported);
}

TEST_CASE("core: function_ref calls what it borrows when the target keeps state", "[core][fast]") {
  int calls = 0;
  auto count = [&calls](int by) { return calls += by; };
  const function_ref<int(int)> borrowed(count);
  CHECK(borrowed(2) == 2);
  CHECK(borrowed(3) == 5);
  CHECK(calls == 5);
}

TEST_CASE("context: parts of a job tell their share of the whole, which never falls", "[context][fast]") {
  Context context;
  std::vector<double> told;
  {
    const ProgressPart unheard(context, 0, 1);
    context.progress("nobody listens", 0.5);
  }
  context.on_progress = [&](std::string_view, double fraction) { told.push_back(fraction); };
  {
    const ProgressPart first(context, 0, 0.5);
    for (const double fraction : {0.0, 0.5, 0.25, 2.0}) context.progress("first", fraction);
  }
  {
    const ProgressPart second(context, 0.5, 1);
    const ProgressPart half(context, 0, 0.5);
    context.progress("second", 1);
  }
  context.progress("whole", 1);
  CHECK(told == std::vector<double>{0, 0.25, 0.25, 0.5, 0.75, 1});
}

TEST_CASE("context: sums have the same bits at any number of threads", "[context][fast]") {
  double first = 0;
  for (const std::size_t n : {std::size_t{0}, std::size_t{5}, std::size_t{40961}})
    for (const unsigned threads : {1u, 2u, 5u}) {
      Context context;
      context.threads = threads;
      const double sum = context.parallel_sum(n, [](std::size_t begin, std::size_t end) {
        double part = 0;
        for (std::size_t i = begin; i < end; ++i) part += 1.0 / (1.0 + static_cast<double>(i));
        return part;
      });
      if (threads == 1) first = sum;
      CHECK(sum == first);
      double exact = 0;
      for (std::size_t i = 0; i < n; ++i) exact += 1.0 / (1.0 + static_cast<double>(i));
      CHECK(std::abs(sum - exact) < 1e-12);
    }
}

TEST_CASE("context: what a body throws reaches the caller when all have ended", "[context][fast]") {
  for (const unsigned threads : {1u, 2u, 5u})
    for (std::size_t thrower = 0; thrower < 5; ++thrower) {
      Context context;
      context.threads = threads;
      std::atomic<int> ended{0};
      const auto all = [&] {
        context.parallel_for(5, 1, [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) {
            if (i == thrower) throw std::bad_alloc();
            ++ended;
          }
        });
      };
      CHECK_THROWS_AS(all(), std::bad_alloc);
      CHECK(ended < 5);
      CHECK(ended >= (threads == 5 ? 4 : 0));
    }
  int done = 0;
  const auto thrown = [] { throw std::bad_alloc(); };
  CHECK_THROWS_AS(detail::side_by_side(thrown, [&] { ++done; }), std::bad_alloc);
  CHECK_THROWS_AS(detail::side_by_side([&] { ++done; }, thrown), std::bad_alloc);
  CHECK(done == 2);
}

TEST_CASE("context: spans nest, those of workers name who waits for them", "[context][fast]") {
  Context context;
  context.threads = 2;
  std::mutex mutex;
  std::vector<Span> spans;
  context.on_span = [&](const Span& span) {
    const std::scoped_lock lock(mutex);
    spans.push_back(span);
  };
  {
    const SpanTimer outer(context, "outer", "one");
    const Context quiet = context.quiet(2);
    SpanTimer inner(quiet, "inner");
    inner.end();
    inner.end();
    context.parallel_for(2, 1, [](std::size_t, std::size_t) {});
  }
  REQUIRE(spans.size() == 3);
  CHECK(spans[0].name == "inner");
  CHECK(spans[1].name == "worker");
  CHECK(spans[2].name == "outer");
  CHECK(spans[2].detail == "one");
  CHECK(spans[1].thread != spans[1].waiting);
  CHECK(spans[1].waiting == spans[2].thread);
  for (const Span& span : spans) {
    CHECK(span.begin_seconds >= spans[2].begin_seconds);
    CHECK(span.end_seconds <= spans[2].end_seconds);
    CHECK(span.end_seconds >= span.begin_seconds);
    CHECK(span.cpu_seconds >= 0);
  }
}

TEST_CASE("context: parallel_for covers every index once at any number of threads", "[context][fast]") {
  for (const unsigned threads : {1u, 2u, 3u, 16u}) {
    Context context;
    context.threads = threads;
    for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{17}, std::size_t{1000}}) {
      std::vector<int> hits(n, 0);
      context.parallel_for(n, 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++hits[i];
      });
      CHECK(std::count(hits.begin(), hits.end(), 1) == static_cast<std::ptrdiff_t>(n));
    }
  }
}
