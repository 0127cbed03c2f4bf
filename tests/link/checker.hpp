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

/// An exhaustive model checker for small programs of a few threads that use atomics, plain memory and futexes.
///
/// The threads of a program are fibers of one system thread. The program is run again until every schedule was explored
/// and, for every load, every store that the load may see. It detects data races on plain memory, threads that sleep
/// and are never woken, and failures that the program itself reports.
///
/// The memory model is the release-acquire part of C++20 in operational form. Each atomic location is the list of its
/// stores. For each location a thread has a store such that it cannot see older ones. A release store carries the view
/// of its thread, and an acquire load merges the carried view into its own. A read-modify-write sees the newest store
/// and continues what that carried (release sequences). Not covered, because no code under test needs it or no compiler
/// produces it:
///  - load buffering: a load never sees a store that comes later in the execution;
///  - plain stores to one location by two threads. One thread may store to a location, others may change it by
///    read-modify-writes only; the checker refuses anything else;
///  - fences and sequential consistency.
///
/// Time is nondeterministic: whenever a thread checks a deadline, it may have passed or not, and a sleep with a
/// deadline may end at any moment. A prefetch is not an operation of the model, but it is checked against the vector
/// clocks.
///
/// Schedules that differ only in the order of independent operations are explored once (sleep sets, Godefroid 1996),
/// which misses no failure. Method: as in CDSChecker (Norris and Demsky 2013), Relacy and loom; races by vector clocks.
namespace ringfence::checker {

inline constexpr int max_threads = 8;  ///< thread 0 sets up the program and checks its result
inline constexpr int max_locations = 8;

/// What a thread knows. Its counters stay below 256 in programs that are small enough to explore; the checker ensures
/// it.
struct View {
  std::array<std::uint8_t, max_locations> newest{};  ///< by location: the oldest store that the thread may still see
  std::array<std::uint8_t, max_threads> clock{};     ///< by thread: its operations up to this one happened before

  void join(const View& other) noexcept {
    for (int i = 0; i < max_locations; ++i) newest[i] = std::max(newest[i], other.newest[i]);
    for (int i = 0; i < max_threads; ++i) clock[i] = std::max(clock[i], other.clock[i]);
  }
};

/// The result of exploring a program.
struct Report {
  std::uint64_t executions = 0;  ///< executions that ran to their end
  std::uint64_t pruned = 0;      ///< executions abandoned because they repeat others
  std::uint64_t steps = 0;       ///< operations on atomics and futexes in all executions
  bool exhausted = false;        ///< whether everything was explored
  std::string failure;           ///< the failure of the last execution; empty if there is none
  std::string trace;             ///< the operations of the failed execution
};

enum class Kind : std::uint8_t { none, load, store, exchange, fetch_or, sleep, wake, timeout };

using Time = std::chrono::steady_clock::time_point;

/// The next operation of a thread.
struct Operation {
  Kind kind = Kind::none;
  std::uint8_t location = 0;
};

/// Runs a program in every possible way. One instance in a process.
class Explorer {
 public:
  using Body = void (*)(void* program, int thread);

  /// The operations that programs and their atomics call.
  int new_location(std::uint64_t value);
  std::uint64_t load(int location, std::memory_order order);
  void store(int location, std::uint64_t value, std::memory_order order);
  std::uint64_t exchange(int location, std::uint64_t value, std::memory_order order);
  std::uint64_t fetch_or(int location, std::uint64_t bits, std::memory_order order);
  void sleep(int location, std::uint64_t expected);
  /// May also end by itself at any later time; the deadline has then passed.
  void sleep_until(int location, std::uint64_t expected, Time deadline);
  void wake(int location);
  /// Returns either value, but never false after true for this deadline or an earlier one.
  bool is_past(Time deadline);
  /// Makes [begin, begin + bytes) the plain memory of the program. `begin` is aligned to 8.
  void watch(std::byte* begin, std::size_t bytes);
  /// Makes [begin, begin + bytes) memory that one thread of the program owns. It may be written like plain memory.
  void own(std::byte* begin, std::size_t bytes);
  void write(std::byte* at, std::uint64_t word);
  std::uint64_t read(const std::byte* at);
  /// A prefetch changes nothing but must not disturb another thread: a line prefetched for writing must have been read
  /// by its reader, and a line prefetched for reading must be published.
  void prefetch_for_write(const std::byte* at, std::size_t line);
  void prefetch_for_read(const std::byte* at);
  /// So must an eviction: no other thread may write the line.
  void evict(const std::byte* at, std::size_t line);
  /// Ends the execution with a failure. Does not return if a thread of the program calls it.
  void fail(const char* why);

  /// Starts a new exploration. Then call begin(), set up, run(), check the result and end(), until end() returns false.
  void reset();
  void begin();
  void run(void* program, Body body, int threads);
  bool failed() const noexcept { return !failure_.empty(); }
  bool pruned() const noexcept { return pruned_; }
  /// Counts the execution. Returns false if there are no more.
  bool end(Report& report);

 private:
  struct Stored {
    std::uint64_t value;
    View carried;
  };
  struct Location {
    std::vector<Stored> stores;
    int plain_writer = -1;  ///< the thread that stores to the location; -1: none so far
  };
  /// For an 8-byte word of plain memory: the last writer, its readers, and their clocks at that time.
  struct Shadow {
    std::uint8_t writer = 0;
    std::uint8_t written = 0;
    std::array<std::uint8_t, max_threads> seen{};
  };
  struct Thread {
    View view;
    Operation pending;
    bool done = true;
    int parked = -1;  ///< location of the futex that the thread sleeps on; -1: none
    Time sleeps_until = Time::max();
    Time past = Time::min();  ///< latest deadline that has passed for this thread
    void* stack_pointer = nullptr;
    std::vector<std::byte> stack;
  };
  struct Choice {
    std::uint8_t taken, count;
  };

  static void enter();

  void announce(Kind kind, int location);
  int find_without_operation(unsigned enabled) const;
  int choose(int count);
  int choose_thread(unsigned candidates, unsigned& tried);
  void park(int location, Time until);
  void step(int thread);
  void append_store(int location, std::uint64_t value, std::memory_order order, bool modifies);
  const Stored& take_newest(int location, std::memory_order order);
  Shadow* shadow_of(const std::byte* at);
  std::string describe_trace() const;

  std::array<Thread, max_threads> threads_;
  std::array<Location, max_locations> locations_;
  int location_count_ = 0;
  int me_ = 0;
  void* scheduler_stack_pointer_ = nullptr;
  void* program_ = nullptr;
  Body body_ = nullptr;

  std::byte* memory_ = nullptr;
  std::vector<Shadow> shadows_;
  std::byte* owned_ = nullptr;
  std::size_t owned_bytes_ = 0;

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

/// Replaces std::atomic.
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

/// The policy that runs ring, doorbell and channel on the checker, with one defect or none.
template <link::Defect seeded>
struct CheckedAtomics {
  static constexpr link::Defect defect = seeded;
  template <class T>
  using Atomic = checker::Atomic<T>;
  static void write(std::byte* at, std::uint64_t word) { explorer().write(at, word); }
  static std::uint64_t read(const std::byte* at) { return explorer().read(at); }
  static void copy(std::byte* to, const std::byte* from, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; i += 8) {
      std::uint64_t word;
      std::memcpy(&word, from + i, sizeof word);
      explorer().write(to + i, word);
    }
  }
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) {
    explorer().sleep(word.location(), expected);
  }
  static void wake(const Atomic<std::uint32_t>& word) { explorer().wake(word.location()); }
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected, Time deadline) {
    explorer().sleep_until(word.location(), expected, deadline);
  }
  static bool is_past(Time deadline) { return explorer().is_past(deadline); }

  /// Lines of 16 bytes, so that a ring of 64 bytes has several. Small messages fill a line, larger ones are padded, and
  /// both sides prefetch. Messages of up to two words are staged where there is a stage, or with StreamedCopies of up
  /// to four.
  static constexpr link::CacheLineTuning lines{.line = 16,
                                               .pad_from = 32,
                                               .stage_up_to = 16,
                                               .stream_from = 16,
                                               .stream_up_to = 32,
                                               .prefetch_from = 8,
                                               .write_prefetch = 48,
                                               .write_prefetch_step = 16,
                                               .read_prefetch = 32,
                                               .read_prefetch_step = 8,
                                               .no_prefetch_from = 64};
  static void prefetch_for_write(const std::byte* at) { explorer().prefetch_for_write(at, lines.line); }
  static void prefetch_for_read(const std::byte* at) { explorer().prefetch_for_read(at); }
  static void prefetch_awaited(const std::byte*) {}
  static void evict(const std::byte* at) { explorer().evict(at, lines.line); }
  static bool streams_copies() { return false; }
  static void pause() {}
  static bool yield() { return true; }
  static void end_yields() {}
  static void add_waiting_thread() {}
  static void remove_waiting_thread() {}
  static link::SpinPolicy spin_policy() { return {}; }
};

/// As on processors where copies into a ring are streamed: nothing is prefetched for writing, the reader evicts what it
/// has read, and larger messages are staged, also those that are published alone.
template <class Policy>
struct StreamedCopies : Policy {
  static bool streams_copies() { return true; }
};

/// Runs `Program` in every possible way, until it fails, everything is explored, or `max_executions` have run.
///
/// A Program is default constructible, which sets it up. It has `threads`, `void thread(int)` for the threads 1 to
/// `threads`, and `void finish()`, which checks the result. Its threads own no memory, because an execution may be
/// abandoned.
template <class Program>
Report explore(std::uint64_t max_executions) {
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
  } while (all.end(report) && report.executions < max_executions);
  return report;
}

}  // namespace ringfence::checker
