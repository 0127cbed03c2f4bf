#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "link/atomics.hpp"

/// An exhaustive checker for small programs of a few threads over atomics, plain memory and futexes.
///
/// A program is run again and again, its threads as fibers of one thread of the system, until every schedule has been
/// tried, and for every load every store that the load may see. What is found: a data race on plain memory, a thread
/// that sleeps and that nobody wakes, and whatever the program itself asserts.
///
/// The memory model is the release-acquire part of C++20, operationally: each atomic location is the list of its
/// stores, each thread knows of each location a store than which it may not see an older one, a release store carries
/// what its thread knows, an acquire load takes that over, and a read-modify-write sees the newest store and hands on
/// what that carried (release sequences). Not covered, because nothing under test needs it or any compiler produces it:
///  - load buffering: a load never sees a store that comes later in the execution;
///  - plain stores to one location by two threads that settle in another order than they were made. One thread may
///    store to a location, others change it by read-modify-writes alone; the checker refuses anything else;
///  - fences and sequential consistency.
///
/// Time is a choice: a deadline is past, or not yet, whenever a thread looks, and a sleep with a deadline may end at
/// any moment. Asking for cache lines is no operation of the model, but checked against the vector clocks.
///
/// Schedules that differ only in the order of independent operations are tried once (sleep sets, Godefroid 1996), which
/// loses no failure. Method: as in CDSChecker (Norris and Demsky 2013), Relacy and loom; races by vector clocks.
namespace ringfence::checker {

inline constexpr int most_threads = 8;  ///< the first is who sets up and looks at the end
inline constexpr int most_locations = 8;

/// What a thread knows. Counts stay below 256 in programs small enough to explore; the checker sees to it.
struct View {
  std::array<std::uint8_t, most_locations> newest{};  ///< of each location: no store before this one can be seen
  std::array<std::uint8_t, most_threads> clock{};     ///< of each thread: what it did up to then has happened before

  void join(const View& other) noexcept {
    for (int i = 0; i < most_locations; ++i) newest[i] = std::max(newest[i], other.newest[i]);
    for (int i = 0; i < most_threads; ++i) clock[i] = std::max(clock[i], other.clock[i]);
  }
};

/// What came of exploring a program.
struct Report {
  std::uint64_t executions = 0;  ///< run to their end
  std::uint64_t pruned = 0;      ///< left because they would only repeat others
  std::uint64_t steps = 0;       ///< operations on atomics and futexes, in all
  bool exhausted = false;        ///< nothing is left to try
  std::string failure;           ///< empty, or what went wrong in the last execution
  std::string trace;             ///< the operations of the execution that failed
};

enum class Kind : std::uint8_t { none, load, store, exchange, fetch_or, sleep, wake, timeout };

using Time = std::chrono::steady_clock::time_point;

/// What a thread is about to do.
struct Operation {
  Kind kind = Kind::none;
  std::uint8_t location = 0;
};

/// Runs a program in every way there is. One at a time in a process.
class Explorer {
 public:
  using Body = void (*)(void* program, int thread);

  /// What a program and the atomics under it call.
  int new_location(std::uint64_t value);
  std::uint64_t load(int location, std::memory_order order);
  void store(int location, std::uint64_t value, std::memory_order order);
  std::uint64_t exchange(int location, std::uint64_t value, std::memory_order order);
  std::uint64_t fetch_or(int location, std::uint64_t bits, std::memory_order order);
  void sleep(int location, std::uint64_t expected);
  /// May also end by itself at any time from then on; `deadline` is past then.
  void sleep_until(int location, std::uint64_t expected, Time deadline);
  void wake(int location);
  /// Either, but never again false for this deadline or an earlier one.
  bool is_past(Time deadline);
  /// Makes [begin, begin + bytes) the only plain memory there is; aligned to 8.
  void watch(std::byte* begin, std::size_t bytes);
  void write(std::byte* at, std::uint64_t word);
  std::uint64_t read(const std::byte* at);
  /// Asking for a line changes nothing, but must not disturb another thread: what is asked for to write has been read
  /// by whom it was for, what is asked for to read has been published.
  void prefetch_for_write(const std::byte* at, std::size_t line);
  void prefetch_for_read(const std::byte* at);
  /// Ends the execution as failed; does not return in a thread of the program.
  void fail(const char* why);

  /// Starts over. Then begin(), set up, run(), look, end(), until end() says that nothing is left.
  void reset();
  void begin();
  void run(void* program, Body body, int threads);
  bool failed() const noexcept { return !failure_.empty(); }
  bool pruned() const noexcept { return pruned_; }
  /// Counts the execution; false when there is no other.
  bool end(Report& report);

 private:
  struct Stored {
    std::uint64_t value;
    View carried;
  };
  struct Location {
    std::vector<Stored> stores;
    int plain_writer = -1;  ///< the thread that stores, once one did
  };
  /// Who last wrote an 8-byte word of plain memory, who read it, and when by their own clocks.
  struct Shadow {
    std::uint8_t writer = 0;
    std::uint8_t written = 0;
    std::array<std::uint8_t, most_threads> seen{};
  };
  struct Thread {
    View view;
    Operation pending;
    bool done = true;
    int parked = -1;  ///< the location whose futex it sleeps on
    Time sleeps_until = Time::max();
    Time past = Time::min();  ///< the latest deadline that it knows to be past
    void* stack_pointer = nullptr;
    std::vector<std::byte> stack;
  };
  struct Choice {
    std::uint8_t taken, count;
  };

  static void enter();

  void announce(Kind kind, int location);
  int find_fresh(unsigned enabled) const;
  int choose(int count);
  int choose_thread(unsigned candidates, unsigned& tried);
  void park(int location, Time until);
  void step(int thread);
  void put(int location, std::uint64_t value, std::memory_order order, bool modifies);
  const Stored& take_newest(int location, std::memory_order order);
  Shadow* shadow_of(const std::byte* at);
  std::string describe_trace() const;

  std::array<Thread, most_threads> threads_;
  std::array<Location, most_locations> locations_;
  int location_count_ = 0;
  int me_ = 0;
  void* scheduler_stack_pointer_ = nullptr;
  void* program_ = nullptr;
  Body body_ = nullptr;

  std::byte* memory_ = nullptr;
  std::vector<Shadow> shadows_;

  std::vector<Choice> choices_;
  std::size_t depth_ = 0;
  std::string failure_;
  bool pruned_ = false;
  struct Event {
    std::uint8_t thread;
    Operation operation;
    std::uint64_t value;
  };
  std::vector<Event> events_;
  std::uint64_t steps_ = 0;
};

Explorer& explorer();

/// The stand-in for std::atomic.
template <class T>
class Atomic {
 public:
  Atomic(T value) : location_(explorer().new_location(value)) {}
  Atomic(const Atomic&) = delete;
  Atomic& operator=(const Atomic&) = delete;
  T load(std::memory_order order) const { return static_cast<T>(explorer().load(location_, order)); }
  void store(T value, std::memory_order order) { explorer().store(location_, value, order); }
  T exchange(T value, std::memory_order order) { return static_cast<T>(explorer().exchange(location_, value, order)); }
  T fetch_or(T bits, std::memory_order order) { return static_cast<T>(explorer().fetch_or(location_, bits, order)); }
  int location() const { return location_; }

 private:
  int location_;
};

/// The policy that puts ring, doorbell and channel on the checker, with one defect or none.
template <link::Defect seeded>
struct CheckedAtomics {
  static constexpr link::Defect defect = seeded;
  template <class T>
  using Atomic = checker::Atomic<T>;
  static void write(std::byte* at, std::uint64_t word) { explorer().write(at, word); }
  static std::uint64_t read(const std::byte* at) { return explorer().read(at); }
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) {
    explorer().sleep(word.location(), expected);
  }
  static void wake(const Atomic<std::uint32_t>& word) { explorer().wake(word.location()); }
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected, Time deadline) {
    explorer().sleep_until(word.location(), expected, deadline);
  }
  static bool is_past(Time deadline) { return explorer().is_past(deadline); }

  /// Lines so short that rings of 64 bytes have several: small messages fill one, larger ones are padded, and both
  /// sides ask for lines ahead.
  static constexpr link::CacheLineTuning lines{.line = 16,
                                               .pad_from = 32,
                                               .prefetch_from = 8,
                                               .write_prefetch = 48,
                                               .write_prefetch_step = 16,
                                               .read_prefetch = 32,
                                               .read_prefetch_step = 8,
                                               .no_prefetch_from = 64};
  static void prefetch_for_write(const std::byte* at) { explorer().prefetch_for_write(at, lines.line); }
  static void prefetch_for_read(const std::byte* at) { explorer().prefetch_for_read(at); }
  static void prefetch_awaited(const std::byte*) {}
  static void pause() {}
  static void yield() {}
  static void add_waiting_thread() {}
  static void remove_waiting_thread() {}
  static link::SpinPolicy spin_policy() { return {}; }
};

/// Runs `Program` in every way, until it fails, nothing is left, or `most_executions` have been run.
///
/// A Program is default constructible (which sets up), has `threads`, `void thread(int)` for threads 1 to `threads`,
/// and `void finish()`, which looks at what came of it. Its threads own no memory: they may be left in mid-run.
template <class Program>
Report explore(std::uint64_t most_executions) {
  Explorer& all = explorer();
  Report report;
  all.reset();
  do {
    all.begin();
    alignas(Program) std::byte place[sizeof(Program)];
    Program* program = new (place) Program;
    all.run(
        program, [](void* p, int thread) { static_cast<Program*>(p)->thread(thread); }, Program::threads);
    if (!all.failed() && !all.pruned()) program->finish();
    program->~Program();
  } while (all.end(report) && report.executions < most_executions);
  return report;
}

}  // namespace ringfence::checker
