#include "queries/query_load.hpp"

#include <algorithm>
#include <ctime>
#include <random>
#include <string>
#include <thread>

#include <benchmark/benchmark.h>

#include "queries/played_world.hpp"
#include "queries/query_scene.hpp"
#include "queries/two_processes.hpp"

// Benchmarks query/<what>/64000/ringfence: what queries cost under load, each beside the same without it. The two are
// measured in alternation; `ratio` is the median of the ratios of neighbours.
//   two_threads    two threads on one snapshot; beside two processes, each with a snapshot of its own
//   beside_frames  rays on one thread while another runs frames: CPU times beside the same alone, as `ratio` (rays) and
//                  `frame_ratio`. The same beside frames of another World, with which the rays share the machine alone:
//                  `unrelated_ratio`, `unrelated_frame_ratio`
//   churn          rays after 10^5 spawns and destroys; beside a fresh world with the same objects
//   history        1000 rays at random frames of a history of 64; beside the same rays in the present. `first_ms`: when
//                  they are the first about their frames
//   recording      a frame with a history of 64; beside one without: the difference for each object
//   rest90         a snapshot and its index where nine of ten objects rest; beside the same where all move

namespace ringfence::bench {
namespace {

constexpr std::uint32_t objects = 64000;
constexpr std::size_t recorded_frames = 8;

const RecordedWorld& recorded() {
  static const RecordedWorld world = [] {
    RecordedWorld moving = record_world(worlds::ShapeSetting::mixed, objects, recorded_frames);
    let_all_move(moving);
    return moving;
  }();
  return world;
}

std::vector<RayQuery> random_rays(std::size_t count) {
  const worlds::Scene& scene = recorded().scene;
  return make_rays(scene.bounds_min, scene.bounds_max, count);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

/// CPU time of the calling thread.
double thread_seconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

void cast_repeatedly(const Snapshot& snapshot, const std::vector<RayQuery>& rays, int rounds) {
  std::vector<Hit> hits(rays.size());
  for (int i = 0; i < rounds; ++i) snapshot.cast(rays, hits);
}

void two_threads(benchmark::State& state) {
  constexpr int rounds = 10;
  PlayedWorld world(recorded());
  world.advance(recorded().frames[1]);
  const Snapshot snapshot = world.world().snapshot();
  const std::vector<RayQuery> rays = random_rays(10000);
  const auto work = [&] { cast_repeatedly(snapshot, rays, rounds); };
  work();
  std::vector<double> ratios, processes;
  for (auto _ : state) {
    const double threads = seconds_of([&] {
      std::thread other(work);
      work();
      other.join();
    });
    state.SetIterationTime(threads);
    processes.push_back(seconds_of_two_processes(work));
    ratios.push_back(processes.back() / threads);
  }
  state.counters["processes_ms"] = median(processes) * 1e3;
  state.counters["ratio"] = median(ratios);
}

void beside_frames(benchmark::State& state) {
  constexpr int rounds = 5, frames = 8;
  PlayedWorld world(recorded()), unrelated(recorded());
  std::size_t k = 1;
  world.advance(recorded().frames[k]);
  unrelated.advance(recorded().frames[k]);
  const Snapshot snapshot = world.world().snapshot();
  const std::vector<RayQuery> rays = random_rays(10000);
  // A thread that asks in every frame has its scratch memory already; a new one would first wait for pages of the
  // system.
  const auto query_cpu = [&] {
    cast_repeatedly(snapshot, rays, 1);
    const double start = thread_seconds();
    cast_repeatedly(snapshot, rays, rounds);
    return (thread_seconds() - start) / rounds;
  };
  const auto frame_cpu = [&](PlayedWorld& played) {
    const double start = thread_seconds();
    for (int i = 0; i < frames; ++i) played.advance(recorded().frames[recorded().played(++k)]);
    return (thread_seconds() - start) / frames;
  };
  const auto both = [&](PlayedWorld& played, double& query, double& frame) {
    std::thread other([&] { query = query_cpu(); });
    frame = frame_cpu(played);
    other.join();
  };
  std::vector<double> query_ratios, frame_ratios, query_ratios_unrelated, frame_ratios_unrelated;
  for (auto _ : state) {
    const double query_alone = query_cpu(), frame_alone = frame_cpu(world);
    double query = 0, frame = 0;
    state.SetIterationTime(seconds_of([&] { both(world, query, frame); }));
    query_ratios.push_back(query / query_alone);
    frame_ratios.push_back(frame / frame_alone);
    both(unrelated, query, frame);
    query_ratios_unrelated.push_back(query / query_alone);
    frame_ratios_unrelated.push_back(frame / frame_alone);
  }
  state.counters["ratio"] = median(query_ratios);
  state.counters["frame_ratio"] = median(frame_ratios);
  state.counters["unrelated_ratio"] = median(query_ratios_unrelated);
  state.counters["unrelated_frame_ratio"] = median(frame_ratios_unrelated);
}

/// Destroys and spawns objects until there were `count` of each. What is spawned stands where the destroyed object was
/// recorded, under the same number.
void churn_objects(PlayedWorld& played, std::size_t count) {
  constexpr std::size_t each_frame = 1000;
  std::mt19937_64 random(1);
  World& world = played.world();
  const std::vector<Pose>& poses = recorded().frames[0];
  for (std::size_t done = 0; done < count; done += each_frame) {
    std::vector<ObjectSpec> again;
    std::vector<ObjectView> all = world.objects();
    std::shuffle(all.begin(), all.end(), random);
    for (std::size_t i = 0; i < each_frame; ++i) {
      require_ok(world.destroy(all[i].id));
      again.push_back(all[i].spec);
    }
    played.advance(poses);
    std::shuffle(again.begin(), again.end(), random);
    for (const ObjectSpec& spec : again) require_ok(world.spawn(spec).status);
    played.advance(poses);
  }
}

void churn(benchmark::State& state) {
  PlayedWorld old(recorded()), fresh(recorded());
  old.advance(recorded().frames[0]);
  churn_objects(old, 100000);
  std::vector<double> ratios, index_ratios, total_ratios;
  const std::vector<RayQuery> rays = random_rays(10000);
  std::vector<Hit> hits(rays.size());
  std::size_t k = 0;
  const auto measure = [&](PlayedWorld& world, double& index) {
    world.advance(recorded().frames[recorded().played(k)]);
    Snapshot snapshot;
    index = seconds_of([&] {
      snapshot = world.world().snapshot();
      (void)snapshot.cast(RayQuery{});
    });
    return seconds_of([&] { snapshot.cast(rays, hits); });
  };
  for (auto _ : state) {
    double old_index, fresh_index;
    const double after = measure(old, old_index), before = measure(fresh, fresh_index);
    ++k;
    state.SetIterationTime(after);
    ratios.push_back(after / before);
    index_ratios.push_back(old_index / fresh_index);
    total_ratios.push_back((old_index + after) / (fresh_index + before));
  }
  state.counters["ratio"] = median(ratios);
  state.counters["index_ratio"] = median(index_ratios);
  state.counters["total_ratio"] = median(total_ratios);
}

constexpr std::uint32_t history_frames = 64;

void history(benchmark::State& state) {
  PlayedWorld world(recorded(), history_frames);
  for (std::size_t k = 0; k < history_frames + 2; ++k) world.advance(recorded().frames[recorded().played(k)]);
  const Snapshot snapshot = world.world().snapshot();
  const std::vector<RayQuery> present = random_rays(1000);
  std::vector<RayQuery> past = present;
  std::mt19937_64 random(1);
  for (RayQuery& ray : past) ray.frame = static_cast<double>(snapshot.frame() - random() % (history_frames + 1));
  std::vector<Hit> hits(past.size());
  const double first = seconds_of([&] { snapshot.cast(past, hits); });
  snapshot.cast(present, hits);
  std::vector<double> ratios;
  for (auto _ : state) {
    const double then = seconds_of([&] { snapshot.cast(past, hits); });
    const double now = seconds_of([&] { snapshot.cast(present, hits); });
    state.SetIterationTime(then);
    ratios.push_back(then / now);
  }
  state.counters["first_ms"] = first * 1e3;
  state.counters["ratio"] = median(ratios);
}

void recording(benchmark::State& state) {
  PlayedWorld with(recorded(), history_frames), without(recorded());
  std::size_t k = 0;
  for (; k < history_frames + 2; ++k) with.advance(recorded().frames[recorded().played(k)]);
  without.advance(recorded().frames[recorded().played(k - 1)]);
  std::vector<double> ratios, more;
  for (auto _ : state) {
    const std::vector<Pose>& poses = recorded().frames[recorded().played(k++)];
    const double recorded_frame = seconds_of([&] { with.advance(poses); });
    const double plain = seconds_of([&] { without.advance(poses); });
    state.SetIterationTime(recorded_frame);
    ratios.push_back(recorded_frame / plain);
    more.push_back(recorded_frame - plain);
  }
  state.counters["ratio"] = median(ratios);
  state.counters["more_ns_each_object"] = median(more) * 1e9 / objects;
}

void rest90(benchmark::State& state) {
  RecordedWorld mostly_at_rest = record_world(worlds::ShapeSetting::mixed, objects, recorded_frames);
  let_rest(mostly_at_rest, 90);
  PlayedWorld resting(mostly_at_rest), moving(recorded());
  std::size_t k = 0;
  const auto measure = [&](PlayedWorld& world, const RecordedWorld& poses) {
    world.advance(poses.frames[poses.played(k)]);
    return seconds_of([&] { (void)world.world().snapshot().cast(RayQuery{}); });
  };
  std::vector<double> ratios, all;
  for (auto _ : state) {
    const double some_moved = measure(resting, mostly_at_rest), all_moved = measure(moving, recorded());
    ++k;
    state.SetIterationTime(some_moved);
    ratios.push_back(some_moved / all_moved);
    all.push_back(all_moved);
  }
  state.counters["ratio"] = median(ratios);
  state.counters["moving_ms"] = median(all) * 1e3;
}

}  // namespace

void register_query_loads() {
  const auto add = [](const char* what, void (*run)(benchmark::State&)) {
    const std::string name = std::string("query/") + what + '/' + std::to_string(objects) + "/ringfence";
    benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMillisecond)->UseManualTime();
  };
  add("two_threads", two_threads);
  add("beside_frames", beside_frames);
  add("churn", churn);
  add("history", history);
  add("recording", recording);
  add("rest90", rest90);
}

}  // namespace ringfence::bench
