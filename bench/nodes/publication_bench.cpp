// publication/<what>/<states>: the cost of publishing, by state, and of reading, by avatar. Objects are 4 m apart and
// move at up to 3 m/s along each axis.
//
// write: objects anywhere in the table of the writer. write_ascending: in the order of the table neighbours are near
// each other, as after a sort. sort: all objects are new, so that they are sorted. read: what one avatar has within
// 25 m.
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "base/prefetch.hpp"
#include "item_reporter.hpp"
#include "nodes/exchange/publication.hpp"
#include "nodes/host/hosted_objects.hpp"
#include "queries/touched_boxes.hpp"

namespace ringfence::bench {
namespace {

using nodes::PublishedState;
using Written = nodes::Publication::Written;

constexpr double interest = 25, seconds = 1.0 / 60;

/// Objects that move in a cube and turn at its sides.
class MovingObjects {
 public:
  explicit MovingObjects(std::size_t count)
      : side_(4 * std::cbrt(static_cast<double>(count))), hosted_(count), velocities_(count) {
    for (std::size_t i = 0; i < count; ++i) {
      hosted_[i].object.number = static_cast<ObjectNumber>(i + 1);
      hosted_[i].pose.position = anywhere();
      velocities_[i] = {6 * uniform() - 3, 6 * uniform() - 3, 6 * uniform() - 3};
    }
  }
  /// The same objects in that order.
  void arrange(std::span<const std::uint32_t> order) {
    const std::vector<nodes::Hosted> hosted = hosted_;
    const std::vector<Vec3d> velocities = velocities_;
    for (std::size_t i = 0; i < order.size(); ++i) hosted_[i] = hosted[order[i]], velocities_[i] = velocities[order[i]];
  }
  void move() {
    for (std::size_t i = 0; i < hosted_.size(); ++i) {
      Vec3d& p = hosted_[i].pose.position;
      Vec3d& v = velocities_[i];
      for (auto [place, speed] : {std::pair(&p.x, &v.x), std::pair(&p.y, &v.y), std::pair(&p.z, &v.z)}) {
        *place += *speed * seconds;
        if ((*place < 0 && *speed < 0) || (*place > side_ && *speed > 0)) *speed = -*speed;
      }
    }
  }
  /// All become other objects at the same places.
  void replace() {
    for (nodes::Hosted& hosted : hosted_) hosted.object.number += static_cast<ObjectNumber>(hosted_.size());
  }
  void publish(nodes::Publication& publication, std::uint64_t frame) const {
    publication.begin(frame);
    publication.list_first(static_cast<std::uint32_t>(hosted_.size()));
    publication.publish([this](std::uint32_t i) { base::prefetch_object(hosted_[i]); },
                        [this](std::uint32_t i, PublishedState& to) {
                          to = {hosted_[i].object.number, 0, hosted_[i].pose};
                          return Written::state;
                        });
  }
  Vec3d anywhere() { return {side_ * uniform(), side_ * uniform(), side_ * uniform()}; }
  std::size_t size() const { return hosted_.size(); }

 private:
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  std::mt19937_64 random_{5};
  double side_;
  std::vector<nodes::Hosted> hosted_;
  std::vector<Vec3d> velocities_;
};

void write(benchmark::State& state, std::size_t states, bool ascending) {
  MovingObjects objects(states);
  nodes::Publication publication(states, interest);
  std::uint64_t frame = 0;
  if (ascending) {
    nodes::Publication sorted(states, interest);
    objects.publish(sorted, 1);
    objects.arrange(sorted.entries());
  }
  for (auto _ : state) {
    state.PauseTiming();
    objects.move();
    state.ResumeTiming();
    objects.publish(publication, ++frame);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(states));
}

void sort(benchmark::State& state, std::size_t states) {
  MovingObjects objects(states);
  nodes::Publication publication(states, interest);
  std::uint64_t frame = 0;
  for (auto _ : state) {
    state.PauseTiming();
    objects.replace();
    state.ResumeTiming();
    objects.publish(publication, ++frame);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(states));
}

void read(benchmark::State& state, std::size_t states) {
  MovingObjects objects(states);
  nodes::Publication publication(states, interest);
  objects.publish(publication, 1);
  std::vector<Vec3d> avatars(1000);
  for (Vec3d& avatar : avatars) avatar = objects.anywhere();
  const queries::BoxTree& tree = *publication.tree(1);
  queries::TouchedBoxes touched;
  std::size_t avatar = 0, ranges = 0;
  for (auto _ : state) {
    const Vec3d p = avatars[++avatar % avatars.size()];
    ranges += touched.find(tree, tree.box_of({p.x - interest, p.y - interest, p.z - interest},
                                             {p.x + interest, p.y + interest, p.z + interest}));
  }
  benchmark::DoNotOptimize(ranges);
  state.counters["ranges"] = static_cast<double>(ranges) / static_cast<double>(state.iterations());
  state.SetItemsProcessed(state.iterations());
}

void register_all() {
  for (const std::size_t states : {std::size_t{40}, std::size_t{4000}, std::size_t{64000}}) {
    const std::string count = std::to_string(states);
    const auto add = [&](const char* what, auto run) {
      benchmark::RegisterBenchmark(("publication/" + std::string(what) + '/' + count).c_str(), run);
    };
    add("write", [states](benchmark::State& state) { write(state, states, false); });
    add("write_ascending", [states](benchmark::State& state) { write(state, states, true); });
    add("sort", [states](benchmark::State& state) { sort(state, states); });
    add("read", [states](benchmark::State& state) { read(state, states); });
  }
}

}  // namespace
}  // namespace ringfence::bench

int main(int count, char** arguments) {
  ringfence::bench::register_all();
  benchmark::Initialize(&count, arguments);
  if (benchmark::ReportUnrecognizedArguments(count, arguments)) return 2;
  return ringfence::bench::run_benchmarks();
}
