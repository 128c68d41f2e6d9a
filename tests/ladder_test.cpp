#include <fstream>
#include <random>
#include <sstream>

#include "quadrig/pipeline/ladder.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

/// What happened, by number of the attempt, for ladders that are walked to their end.
template <class Happens>
std::vector<Tried> walked(const std::vector<Attempt>& attempts, Happens&& happens) {
  std::vector<Tried> history;
  while (const auto next = next_attempt(attempts, history)) {
    Tried tried = happens(*next);
    tried.attempt = *next;
    history.push_back(tried);
  }
  return history;
}
std::vector<std::size_t> numbers(const std::vector<Tried>& history) {
  std::vector<std::size_t> result;
  for (const Tried& tried : history) result.push_back(tried.attempt);
  return result;
}
constexpr Index few = 1000;

}  // namespace

TEST_CASE("ladder: attempts come smoother and finer, a stand-in first where triangles are many or tiny",
          "[ladder][fast]") {
  const std::vector<Attempt> plain = ladder({few, 500, false, false});
  REQUIRE(plain.size() >= 3);
  CHECK_FALSE(plain.front().on_stand_in());
  CHECK(plain.back().on_stand_in());
  double edge = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < plain.size(); ++k) CHECK(plain[k].merge_quads >= plain[k - 1].merge_quads);
  for (const Attempt& attempt : plain) {
    CHECK_FALSE(attempt.keeps_features);
    if (attempt.on_stand_in()) continue;
    CHECK(attempt.longest_edge < edge);
    edge = attempt.longest_edge;
  }
  for (const SurfaceFacts& facts : {SurfaceFacts{few, 500, true, false}, SurfaceFacts{1'000'000, 500, false, false}}) {
    const std::vector<Attempt> other = ladder(facts);
    REQUIRE(other.size() == plain.size() + 1);
    CHECK(other.front().on_stand_in());
    CHECK(std::equal(plain.begin(), plain.end(), other.begin() + 1));
  }
  // 40 triangles a quad, or two and a half times a stand-in's, but never fewer than 20 000.
  CHECK_FALSE(ladder({20'000, 10, false, false}).front().on_stand_in());
  CHECK(ladder({20'001, 10, false, false}).front().on_stand_in());
  CHECK_FALSE(ladder({40'000, 1000, false, false}).front().on_stand_in());
  CHECK(ladder({40'001, 1000, false, false}).front().on_stand_in());
}

TEST_CASE("ladder: features are kept by the first attempts, and then asked for no more", "[ladder][fast]") {
  const std::vector<Attempt> plain = ladder({few, 500, false, false}), all = ladder({few, 500, false, true});
  REQUIRE(all.size() > plain.size());
  const std::size_t keeping = all.size() - plain.size();
  for (std::size_t k = 0; k < keeping; ++k) {
    CHECK(all[k].keeps_features);
    CHECK(all[k].longest_edge == plain[k].longest_edge);
    CHECK(all[k].merge_quads == plain[k].merge_quads);
  }
  CHECK(std::equal(plain.begin(), plain.end(), all.begin() + static_cast<std::ptrdiff_t>(keeping)));
  // The budget is full at the first attempt and at the first without them, unless there are quads.
  std::vector<std::size_t> afresh;
  std::vector<Tried> history;
  while (const auto next = next_attempt(all, history)) {
    if (begins_afresh(all, history, *next)) afresh.push_back(*next);
    history.push_back({*next, Outcome::tangled});
  }
  CHECK(afresh == std::vector<std::size_t>{0, keeping});
  const std::vector<Tried> poor{{keeping - 1, Outcome::poor}};
  CHECK(next_attempt(all, poor) == keeping);
  CHECK_FALSE(begins_afresh(all, poor, keeping));
  // Defects all over end those that keep features, not the others.
  CHECK(next_attempt(all, std::vector<Tried>{{0, Outcome::noisy}}) == keeping);
  CHECK(next_attempt(plain, std::vector<Tried>{{0, Outcome::noisy}}) == 1);
}

TEST_CASE("ladder: good quads end it, poor ones are followed by one more attempt", "[ladder][fast]") {
  const std::vector<Attempt> attempts = ladder({few, 500, false, true});
  for (std::size_t k = 0; k < attempts.size(); ++k) {
    CHECK_FALSE(next_attempt(attempts, std::vector<Tried>{{k, Outcome::good}}).has_value());
    const std::vector<Tried> poor = walked(attempts, [&](std::size_t number) {
      return Tried{0, number == k ? Outcome::poor : Outcome::tangled};
    });
    CHECK(poor.size() == std::min(k + 2, attempts.size()));
  }
}

TEST_CASE("ladder: features that nobody asked for are let go for better quads", "[ladder][fast]") {
  SurfaceFacts facts{1000, 300, false, true};
  facts.unasked = true;
  const std::vector<Attempt> attempts = ladder(facts);
  REQUIRE(attempts[1].keeps_features);
  REQUIRE_FALSE(attempts[2].keeps_features);
  CHECK(next_attempt(attempts, std::vector<Tried>{{0, Outcome::poor}}) == 2);
  CHECK_FALSE(next_attempt(attempts, std::vector<Tried>{{0, Outcome::poor}, {2, Outcome::tangled}}).has_value());
  CHECK(next_attempt(attempts, std::vector<Tried>{{0, Outcome::uncovered}}) == 1);
  CHECK(next_attempt(attempts, std::vector<Tried>{{0, Outcome::flat}}) == 1);
  facts.unasked = false;
  CHECK(next_attempt(ladder(facts), std::vector<Tried>{{0, Outcome::poor}}) == 1);
}

TEST_CASE("ladder: what is spent is not tried again", "[ladder][fast]") {
  const std::vector<Attempt> attempts = ladder({few, 500, false, false});
  const auto on_stand_in = [&](const Tried& tried) { return attempts[tried.attempt].on_stand_in(); };
  // The surface's own triangles have taken their share: stand-ins are left.
  const std::vector<Tried> dear = walked(attempts, [](std::size_t) { return Tried{0, Outcome::budget_spent, 0}; });
  CHECK(std::all_of(dear.begin() + 1, dear.end(), on_stand_in));
  CHECK(dear.size() == 1 + static_cast<std::size_t>(std::ranges::count_if(attempts, &Attempt::on_stand_in)));
  // They cannot be refined so far: finer ones even less.
  const std::vector<Tried> endless = walked(attempts, [&](std::size_t number) {
    return Tried{0, attempts[number].on_stand_in() ? Outcome::tangled : Outcome::triangles_unavailable};
  });
  CHECK(numbers(endless) == numbers(dear));
  // A stand-in that could not be made says nothing about the others.
  CHECK(walked(attempts, [&](std::size_t number) {
          return Tried{0, attempts[number].on_stand_in() ? Outcome::triangles_unavailable : Outcome::tangled};
        }).size() == attempts.size());
  CHECK(walked(attempts, [](std::size_t) { return Tried{0, Outcome::tangled, 1, 0}; }).size() == 1);
  CHECK(walked(attempts, [](std::size_t) { return Tried{0, Outcome::flat}; }).size() == 4);
}

TEST_CASE("ladder: whatever happens each attempt is made at most once, in order", "[ladder][fast]") {
  std::mt19937 random(7);
  for (int run = 0; run < 2000; ++run) {
    const SurfaceFacts facts{static_cast<Index>(random() % 100'000), 500, random() % 2 == 0, random() % 2 == 0};
    const std::vector<Attempt> attempts = ladder(facts);
    const std::vector<std::size_t> made = numbers(walked(attempts, [&](std::size_t) {
      return Tried{0, static_cast<Outcome>(random() % 11), static_cast<std::int64_t>(random() % 2),
                   static_cast<std::int64_t>(random() % 4)};
    }));
    REQUIRE(!made.empty());
    CHECK(made.front() == 0);
    CHECK(std::ranges::adjacent_find(made, std::greater_equal<>()) == made.end());
    CHECK(made.back() < attempts.size());
  }
}

TEST_CASE("budget: what is lent and given back is neither lost nor doubled", "[ladder][fast]") {
  const Budget full(1000, 4000);
  for (const WorkLimit& limit : work_limits) {
    CHECK(full.left(limit.work) == limit.counts(1000, 4000));
    Budget budget = full;
    budget.spend(limit.work, 7);
    for (const WorkLimit& other : work_limits)
      CHECK(budget.left(other.work) == full.left(other.work) - (other.work == limit.work ? 7 : 0));
    Budget lent = budget.lend(limit.work, 100);
    CHECK(lent.left(limit.work) == 100);
    lent.spend(limit.work, 130);  // more than there was
    CHECK(lent.spent(limit.work));
    CHECK(lent.left(limit.work) == -30);
    lent.spend(Work::untangling, 3);  // comes off the whole
    budget.give_back(limit.work, lent);
    CHECK(budget.left(limit.work) == full.left(limit.work) - 7 - 130 - (limit.work == Work::untangling ? 3 : 0));
    if (limit.work != Work::untangling) CHECK(budget.left(Work::untangling) == full.left(Work::untangling) - 3);
  }
}

TEST_CASE("budget: many parts share the bases of a few", "[ladder][fast]") {
  for (const WorkLimit& limit : work_limits) {
    CHECK(limit.counts(100, 200, 8) == limit.counts(100, 200));
    // What grows with the triangles is each one's own.
    const std::int64_t own = limit.counts(100, 200) - limit.base;
    for (const std::size_t parts : {9U, 100U, 10'000U})
      CHECK((limit.counts(100, 200, parts) - own) * static_cast<std::int64_t>(parts) <= 8 * limit.base);
  }
  CHECK(of_all::share(of_all::attempts, 1) == of_all::attempts);
  CHECK(of_all::share(of_all::attempts, 1'000'000) == 1);
}

TEST_CASE("budget: the table of docs/map.md has every limit", "[ladder][fast]") {
  std::ifstream file(std::filesystem::path(QUADRIG_SOURCE_DIR) / "docs" / "map.md");
  std::stringstream text;
  text << file.rdbuf();
  for (const WorkLimit& limit : work_limits) {
    std::stringstream row;
    row << "| " << limit.name << " | " << limit.counted_in << " | " << limit.price << " | " << limit.base << " | "
        << limit.per_face << " | " << limit.per_proxy_face << " | " << limit.scope << " |\n";
    INFO(row.str());
    CHECK(text.str().find(row.str()) != std::string::npos);
  }
}
