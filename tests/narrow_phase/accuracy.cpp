// Compares the narrow phase with the reference in double precision on many pairs of all kinds except support functions,
// and prints how many results are wrong. tools/check-accuracy runs it with millions of pairs, the tests with fewer.
#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh};
/// Number of pairs in a world. The bodies of a world share its hulls and meshes; each world has other ones.
constexpr std::size_t world_pairs = 4000, mesh_world_pairs = 500;
/// Maximum number of triangles of a mesh. It is small because the reference tests every triangle.
constexpr int max_triangles = 80;

/// The first four are numbers of pairs for each pair of kinds.
struct Options {
  std::uint64_t random = 1'000'000, degenerate = 100'000, mesh_random = 1'000'000, mesh_degenerate = 100'000, seed = 1;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
};

struct Tally {
  std::uint64_t pairs = 0, contacts = 0;
  std::uint64_t wrong = 0;        ///< by more than 10^-4 of the smaller object's bounding radius
  std::uint64_t badly_wrong = 0;  ///< of them, by more than 10^-3
  std::string text;               ///< describes some of the wrong results

  void add(const Tally& other) {
    pairs += other.pairs;
    contacts += other.contacts;
    wrong += other.wrong;
    badly_wrong += other.badly_wrong;
    if (text.size() < 4000) text += other.text;
  }
};

/// A world to test: `count` pairs of kinds `p` and `q`. If `seed` is odd, a and b are swapped.
struct Task {
  ShapeKind p, q;
  bool degenerate;
  std::uint64_t seed;
  std::size_t count;
};

bool has_mesh(ShapeKind p, ShapeKind q) { return p == ShapeKind::mesh || q == ShapeKind::mesh; }

PairWorld make_world(const Task& task) {
  if (has_mesh(task.p, task.q)) {  // the mesh is the second shape
    return (task.degenerate ? degenerate_mesh_pairs : ordinary_mesh_pairs)(task.p, task.count, task.seed, {},
                                                                           max_triangles);
  }
  const bool hulls = task.p == ShapeKind::hull || task.q == ShapeKind::hull;
  const auto make = task.degenerate ? (hulls ? degenerate_convex_pairs : degenerate_pairs)
                                    : (hulls ? ordinary_convex_pairs : ordinary_pairs);
  return make(task.p, task.q, task.count, task.seed, {});
}

Tally run(const Task& task) {
  const PairWorld world = make_world(task);
  const std::vector<geometry::CandidatePair> pairs = task.seed % 2 == 0 ? world.pairs : world.swapped();
  narrow_phase::NarrowPhase narrow_phase(world.shapes());
  const auto contacts = narrow_phase.test(world.bodies, pairs);
  const CheckResult result = check_contacts(world, pairs, contacts, 1e-4, 1);
  Tally tally{pairs.size(), result.contacts, result.wrong, 0, {}};
  if (result.wrong > 0) {
    tally.badly_wrong = check_contacts(world, pairs, contacts, 1e-3, 0).wrong;
    tally.text =
        std::string(task.degenerate ? "nasty" : "random") + ", seed " + std::to_string(task.seed) + ", " + result.text;
  }
  return tally;
}

Tally run_all(ShapeKind p, ShapeKind q, bool degenerate, const Options& options) {
  const bool mesh = has_mesh(p, q);
  const std::uint64_t pairs = mesh ? (degenerate ? options.mesh_degenerate : options.mesh_random)
                                   : (degenerate ? options.degenerate : options.random);
  const std::uint64_t pairs_per_world = mesh ? mesh_world_pairs : world_pairs;
  std::vector<Task> tasks;
  for (std::uint64_t done = 0; done < pairs; done += pairs_per_world) {
    tasks.push_back({p, q, degenerate, options.seed * 1'000'000 + tasks.size(),
                     static_cast<std::size_t>(std::min<std::uint64_t>(pairs_per_world, pairs - done))});
  }
  std::atomic<std::size_t> next{0};
  std::mutex sum_mutex;
  Tally sum;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < options.threads; ++t) {
    threads.emplace_back([&] {
      for (std::size_t i; (i = next.fetch_add(1)) < tasks.size();) {
        const Tally tally = run(tasks[i]);
        const std::lock_guard lock(sum_mutex);
        sum.add(tally);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  return sum;
}

std::uint64_t pairs_of(ShapeKind p, ShapeKind q, const Options& options) {
  return has_mesh(p, q) ? options.mesh_random + options.mesh_degenerate : options.random + options.degenerate;
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
    if (name == "--random") {
      options.random = value;
    } else if (name == "--nasty") {
      options.degenerate = value;
    } else if (name == "--mesh-random") {
      options.mesh_random = value;
    } else if (name == "--mesh-nasty") {
      options.mesh_degenerate = value;
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

int check(const Options& options) {
  std::printf("%-17s %10s %10s %7s %7s   %10s %10s %7s %7s\n", "", "random", "contacts", "> 1e-4", "> 1e-3", "nasty",
              "contacts", "> 1e-4", "> 1e-3");
  bool failed = false;
  std::string text;
  for (const ShapeKind p : kinds) {
    for (const ShapeKind q : kinds) {
      if (q < p || pairs_of(p, q, options) == 0) continue;
      std::printf("%-8s %-8s", name_of(p), name_of(q));
      for (const bool degenerate : {false, true}) {
        const Tally tally = run_all(p, q, degenerate, options);
        std::printf(" %10llu %10llu %7llu %7llu%s", static_cast<unsigned long long>(tally.pairs),
                    static_cast<unsigned long long>(tally.contacts), static_cast<unsigned long long>(tally.wrong),
                    static_cast<unsigned long long>(tally.badly_wrong), degenerate ? "\n" : "  ");
        std::fflush(stdout);
        failed |= tally.wrong > 0;
        text += tally.text;
      }
    }
  }
  std::printf("%s", text.c_str());
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace ringfence::narrow_phase_test

int main(int argc, char** argv) {
  ringfence::narrow_phase_test::Options options;
  if (!ringfence::narrow_phase_test::parse_options(argc, argv, options)) {
    std::fprintf(stderr,
                 "usage: check_accuracy [--random PAIRS] [--nasty PAIRS] [--mesh-random PAIRS] [--mesh-nasty PAIRS] "
                 "[--seed N] [--threads N]\n");
    return 2;
  }
  return ringfence::narrow_phase_test::check(options);
}
