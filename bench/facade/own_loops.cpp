#include <algorithm>
#include <deque>
#include <utility>
#include <vector>

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#include "broad_phase/sweep_and_prune.hpp"
#include "facade/own_kernels.hpp"

namespace ringfence::bench {
namespace {

class Loop final : public FrameTester {
 public:
  explicit Loop(const RecordedWorld& world) : crowd_(world), tester_(*world.shapes), sweep_(world.objects(), 0) {}

  void run(const std::vector<Pose>& poses) override {
    crowd_.place(poses, 0, poses.size());
    pairs_.clear();
    for (const geometry::CandidatePair pair : sweep_.find(crowd_.bounds(), crowd_.present(), crowd_.resting())) {
      pairs_.push_back({std::min(pair.a, pair.b), std::max(pair.a, pair.b)});
    }
    tester_.clear();
    tester_.test(crowd_.bodies(), pairs_);
  }
  std::size_t contacts() const override { return tester_.found().size(); }
  std::vector<std::uint64_t> touching() const override { return tester_.found().keys(); }

 private:
  Crowd crowd_;
  PairTester tester_;
  broad_phase::SweepAndPrune sweep_;
  std::vector<geometry::CandidatePair> pairs_;
};

class Tbb final : public FrameTester {
 public:
  Tbb(const RecordedWorld& world, int threads)
      : crowd_(world),
        sweep_(world.objects(), 0),
        arena_(threads),
        testers_([&world] { return PairTester(*world.shapes); }) {}

  void run(const std::vector<Pose>& poses) override {
    for (PairTester& tester : testers_) tester.clear();
    arena_.execute([&] {
      constexpr std::size_t objects_per_task = 512;
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, poses.size(), objects_per_task),
                        [&](const auto& range) { crowd_.place(poses, range.begin(), range.end()); });
      test_pairs();
    });
  }
  std::size_t contacts() const override {
    std::size_t sum = 0;
    for (const PairTester& tester : testers_) sum += tester.found().size();
    return sum;
  }
  std::vector<std::uint64_t> touching() const override {
    std::vector<std::uint64_t> all;
    for (const PairTester& tester : testers_) {
      const auto keys = tester.found().keys();
      all.insert(all.end(), keys.begin(), keys.end());
    }
    return all;
  }

 private:
  // One thread runs the sweep. Its pairs are tested by any free thread, and by that thread after the sweep.
  void test_pairs() {
    constexpr std::size_t pairs_per_task = 256;
    tbb::task_group tasks;
    sweep_.begin(crowd_.bounds(), crowd_.present(), crowd_.resting());
    std::size_t used = 0;
    for (auto found = sweep_.next(pairs_per_task); !found.empty(); found = sweep_.next(pairs_per_task)) {
      if (used == portions_.size()) portions_.emplace_back();
      std::vector<geometry::CandidatePair>& portion = portions_[used++];
      portion.clear();
      for (const geometry::CandidatePair pair : found) {
        portion.push_back({std::min(pair.a, pair.b), std::max(pair.a, pair.b)});
      }
      tasks.run([this, &portion] { testers_.local().test(crowd_.bodies(), portion); });
    }
    tasks.wait();
  }

  Crowd crowd_;
  broad_phase::SweepAndPrune sweep_;
  tbb::task_arena arena_;
  tbb::enumerable_thread_specific<PairTester> testers_;
  std::deque<std::vector<geometry::CandidatePair>> portions_;
};

}  // namespace

std::unique_ptr<FrameTester> make_loop_frame(const RecordedWorld& world) { return std::make_unique<Loop>(world); }
std::unique_ptr<FrameTester> make_tbb_frame(const RecordedWorld& world, int threads) {
  return std::make_unique<Tbb>(world, threads);
}

}  // namespace ringfence::bench
