// Compares queries against one shape with the reference in double precision, for all kinds of shapes, and prints how
// many answers are wrong. tools/check-accuracy runs it with millions of queries, the tests with fewer.
#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "narrow_phase/query/query_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box,  ShapeKind::capsule,
                               ShapeKind::hull,   ShapeKind::mesh, ShapeKind::support};
constexpr std::size_t kind_count = std::size(kinds);
enum class Question { ray, sweep, overlap, nearest };
constexpr const char* question_names[] = {"ray", "sweep", "overlap", "nearest"};
/// Number of queries in a world. Each world has other shapes.
constexpr std::size_t world_queries = 1200;
constexpr Vec3d far_away{1e6, -1e6, 1e6};

/// The first three are numbers of queries, divided over the kinds of shapes. `hard`: of each of the four questions.
struct Options {
  std::uint64_t rays = 10'000'000, queries = 1'000'000, hard = 100'000, seed = 1;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
};

/// A world to test. An odd seed puts it far from the origin.
struct Task {
  Question question;
  ShapeKind target, moving;
  bool hard;
  std::uint64_t seed;
  std::size_t count;
};

double accuracy_of(const Task& task) {
  const bool is_moving = task.question == Question::sweep || task.question == Question::overlap;
  if (task.target == ShapeKind::support || (is_moving && task.moving == ShapeKind::support)) return 1e-4;
  if (task.question == Question::sweep) return 1e-7;
  // Overlaps of solid shapes are decided by the kernels of contacts, which compute in float.
  if (task.question == Question::overlap) return task.target == ShapeKind::mesh ? 1e-10 : 1e-5;
  if (task.question != Question::ray) return 1e-10;
  return task.target == ShapeKind::hull ? 2e-6 : task.target == ShapeKind::mesh ? 3e-7 : 1e-10;
}

QueryTally run(const Task& task) {
  const Vec3d origin = task.seed % 2 == 0 ? Vec3d{} : far_away;
  const QueryWorld world = make_queries(task.target, task.moving, task.hard, task.count, task.seed, origin);
  const double accuracy = accuracy_of(task);
  switch (task.question) {
    case Question::ray:
      return check_rays(world, accuracy);
    case Question::sweep:
      return check_sweeps(world, accuracy);
    case Question::overlap:
      return check_overlaps(world, accuracy);
    case Question::nearest:
      break;
  }
  return check_nearest(world, accuracy);
}

/// The worlds for `count` queries of a target. Sweeps and overlaps take each convex kind as the moving shape in turn.
std::vector<Task> tasks_of(Question question, ShapeKind target, bool hard, std::uint64_t count, std::uint64_t seed) {
  const bool has_moving = question == Question::sweep || question == Question::overlap;
  constexpr ShapeKind moving[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull,
                                  ShapeKind::support};
  std::vector<Task> tasks;
  for (std::uint64_t done = 0; done < count; done += world_queries) {
    const ShapeKind with = has_moving ? moving[tasks.size() % std::size(moving)] : ShapeKind::sphere;
    tasks.push_back({question, target, with, hard, seed * 1'000'000 + tasks.size(),
                     static_cast<std::size_t>(std::min<std::uint64_t>(world_queries, count - done))});
  }
  return tasks;
}

/// Runs the tasks on threads.
QueryTally run_all(const std::vector<Task>& tasks, unsigned thread_count) {
  std::atomic<std::size_t> next{0};
  std::mutex sum_mutex;
  QueryTally sum;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < thread_count; ++t) {
    threads.emplace_back([&] {
      for (std::size_t i; (i = next.fetch_add(1)) < tasks.size();) {
        const QueryTally tally = run(tasks[i]);
        const std::lock_guard lock(sum_mutex);
        sum.hits += tally.hits, sum.inside += tally.inside, sum.misses += tally.misses, sum.wrong += tally.wrong;
        if (tally.text.empty() || sum.text.size() > 4000) continue;
        sum.text += std::string("seed ") + std::to_string(tasks[i].seed) + ", moving " + name_of(tasks[i].moving) +
                    "\n" + tally.text;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  return sum;
}

/// Returns false for an unknown option or an invalid number.
bool parse_options(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; i += 2) {
    const std::string_view name = argv[i];
    if (i + 1 == argc) return false;
    std::uint64_t value = 0;
    const char* const end = argv[i + 1] + std::strlen(argv[i + 1]);
    const auto [at, error] = std::from_chars(argv[i + 1], end, value);
    if (error != std::errc() || at != end) return false;
    if (name == "--rays") {
      options.rays = value;
    } else if (name == "--queries") {
      options.queries = value;
    } else if (name == "--hard-queries") {
      options.hard = value;
    } else if (name == "--seed") {
      options.seed = value;
    } else if (name == "--threads" && value > 0 && value <= 1024) {
      options.threads = static_cast<unsigned>(value);
    } else {
      return false;
    }
  }
  return true;
}

/// Prints one line. Returns whether an answer is wrong.
bool check_kind(Question question, ShapeKind target, bool hard, const Options& options) {
  const std::uint64_t all = hard ? options.hard : question == Question::ray ? options.rays : options.queries;
  const std::uint64_t count = (all + kind_count - 1) / kind_count;
  if (count == 0) return false;
  const QueryTally tally = run_all(tasks_of(question, target, hard, count, options.seed), options.threads);
  std::printf("%-8s %-8s %-6s %10llu %10zu %10zu %10zu %7zu\n", question_names[static_cast<int>(question)],
              name_of(target), hard ? "hard" : "random", static_cast<unsigned long long>(count), tally.hits,
              tally.inside, tally.misses, tally.wrong);
  std::printf("%s", tally.text.c_str());
  std::fflush(stdout);
  return tally.wrong > 0;
}

int check(const Options& options) {
  std::printf("%-8s %-8s %-6s %10s %10s %10s %10s %7s\n", "question", "target", "", "queries", "hits", "inside",
              "misses", "wrong");
  bool failed = false;
  for (const bool hard : {true, false}) {
    for (const Question question : {Question::nearest, Question::overlap, Question::sweep, Question::ray}) {
      for (const ShapeKind target : kinds) failed |= check_kind(question, target, hard, options);
    }
  }
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace ringfence::narrow_phase_test

int main(int argc, char** argv) {
  ringfence::narrow_phase_test::Options options;
  if (!ringfence::narrow_phase_test::parse_options(argc, argv, options)) {
    std::fprintf(stderr, "usage: check_queries [--rays N] [--queries N] [--hard-queries N] [--seed N] [--threads N]\n");
    return 2;
  }
  return ringfence::narrow_phase_test::check(options);
}
