#include <atomic>

#include "quadrig/constraints/posed_metric.hpp"
#include "quadrig/io.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;
using namespace quadrig::test;

namespace {

/// Counts the polls of a job and cancels it from one of them on.
struct Polls {
  std::atomic<long> count{0};
  long last = std::numeric_limits<long>::max();

  Context context(unsigned threads) {
    Context own;
    own.threads = threads;
    own.on_poll = [this] { return ++count > last; };
    return own;
  }
};

Asset pear(Index triangles) {
  Context context;
  Expected<Asset> sample = make_sample("pear", triangles, context);
  REQUIRE(sample.has_value());
  return std::move(*sample);
}

RemeshOptions wanting(Index quads) {
  RemeshOptions options;
  options.quads = quads;
  return options;
}

}  // namespace

TEST_CASE("cancel: from any poll on the job stops, and soon", "[cancel][pipeline]") {
  const Asset asset = pear(6000);
  for (const unsigned threads : {1U, 3U}) {
    Polls whole;
    Context counting = whole.context(threads);
    REQUIRE(remesh(asset, wanting(300), counting).has_value());
    const long polls = whole.count;
    CHECK(polls > 1000);
    for (long k = 0; k < 9; ++k) {
      Polls part;
      part.last = polls * k / 9;
      CAPTURE(threads, part.last);
      Context context = part.context(threads);
      const auto stopped = remesh(asset, wanting(300), context);
      REQUIRE_FALSE(stopped);
      CHECK(stopped.error().code == ErrorCode::cancelled);
      // What is under way in each thread, and the calls that it is part of.
      CHECK(part.count - part.last < 200);
    }
  }
}

TEST_CASE("cancel: files stop being read and mended from any poll on", "[cancel][io][fast]") {
  const Asset asset = pear(8000);
  const ScratchFolder folder("cancel");
  REQUIRE(write_obj(folder / "a.obj", asset.mesh.positions(), asset.mesh.faces()).ok());
  REQUIRE(write_tgf(folder / "a.tgf", asset.rig->skeleton).ok());
  REQUIRE(write_dmat(folder / "a.dmat", asset.rig->weights).ok());
  const AssetFiles files{folder / "a.obj", folder / "a.tgf", folder / "a.dmat"};
  Polls whole;
  Context counting = whole.context(1);
  REQUIRE(load_asset(files, {}, counting).has_value());
  const long polls = whole.count;
  CHECK(polls > 15);
  for (long k = 0; k < polls; ++k) {
    Polls part;
    part.last = k;
    CAPTURE(k);
    Context context = part.context(1);
    const auto stopped = load_asset(files, {}, context);
    REQUIRE_FALSE(stopped);
    CHECK(stopped.error().code == ErrorCode::cancelled);
    CHECK(part.count - part.last < 10);
  }
}

TEST_CASE("cancel: loops over faces and rows ask every so many", "[cancel][fast]") {
  const Asset asset = pear(12'000);
  const Index m = asset.mesh.face_count();
  const Connection<double> connection(asset.mesh);
  Polls polls;
  Context context = polls.context(1);
  const auto asked = [&] { return polls.count.exchange(0); };

  const auto forms =
      PosedForms::create(asset.mesh, connection, asset.rig->weights, bend_poses(asset.rig->skeleton, 60), {}, context);
  REQUIRE(forms.has_value());
  CHECK(asked() > static_cast<long>(asset.rig->skeleton.bones.size()));
  REQUIRE(posed_metric(asset.mesh, *forms, {}, {}, context).has_value());
  CHECK(asked() >= m / 256);

  REQUIRE(Dominance::create(asset.mesh, *asset.rig, &context).has_value());
  CHECK(asked() >= 3);

  QuadraticForm<double> form(m);
  const RowTerm chain{"chain", [&](EmitRow<double> emit) {  // two rows a face
                        for (Index f = 0; f + 1 < m; ++f) {
                          const std::array<Index, 2> where{f, f + 1};
                          const std::array<double, 2> factor{1, -0.5};
                          emit({where, factor, 1, 1});
                          emit({std::span(where).first(1), std::span(factor).first(1), 1, 1});
                        }
                      }};
  REQUIRE(form.assemble(context, chain).ok());
  CHECK(asked() >= 4 * m / 8192);
  auto solver = make_solver<double>();
  REQUIRE(solver.has_value());
  REQUIRE(solver->analyze(form.matrix(), {}, context).ok());
  CHECK(asked() > 5);
  REQUIRE(solver->factorize(form.matrix(), context).ok());
  CHECK(asked() > 8);
  std::vector<double> x(static_cast<std::size_t>(m));
  REQUIRE(solver->solve(form.rhs(), x, context).status.ok());
  CHECK(asked() > 2);
}

TEST_CASE("cancel: a sum that was cancelled is made anew", "[cancel][energy][fast]") {
  constexpr Index n = 20'000;
  QuadraticForm<double> form(n);
  const RowTerm identity{"identity", [](EmitRow<double> emit) {
                           for (Index i = 0; i < n; ++i) {
                             const std::array<Index, 1> where{i};
                             const std::array<double, 1> factor{1};
                             emit({where, factor, 2, 1});
                           }
                         }};
  for (long last = 0; last < 12; ++last) {
    Polls polls;
    polls.last = last;
    const Context context = polls.context(1);
    const Status status = form.assemble(context, identity);
    if (!status.ok()) CHECK(status.error().code == ErrorCode::cancelled);
    REQUIRE(form.assemble(identity).ok());
    CHECK(form.free_count() == n);
    CHECK(form.rhs()[n - 1] == 2);
    CHECK(form.matrix().size == n);
  }
}
