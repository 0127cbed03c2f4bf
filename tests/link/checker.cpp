#include "link/checker.hpp"

#include <cstdlib>

#if !defined(__x86_64__)
#error "the checker switches stacks in assembly: add the instructions for this processor"
#endif

// Saves the callee-saved registers and continues on the other stack.
extern "C" void ringfence_switch_stack(void** from, void* to);
asm(R"(
.text
.globl ringfence_switch_stack
.type ringfence_switch_stack, @function
ringfence_switch_stack:
  push %rbp
  push %rbx
  push %r12
  push %r13
  push %r14
  push %r15
  mov %rsp, (%rdi)
  mov %rsi, %rsp
  pop %r15
  pop %r14
  pop %r13
  pop %r12
  pop %rbx
  pop %rbp
  ret
.size ringfence_switch_stack, .-ringfence_switch_stack
)");

namespace ringfence::checker {

namespace {

constexpr std::size_t stack_bytes = 64 * 1024;

bool acquires(std::memory_order order) {
  return order == std::memory_order_acquire || order == std::memory_order_acq_rel;
}

bool releases(std::memory_order order) {
  return order == std::memory_order_release || order == std::memory_order_acq_rel;
}

/// Whether the order of two operations of different threads can affect the result.
bool dependent(Operation p, Operation q) {
  if (p.kind == Kind::none || q.kind == Kind::none || p.location != q.location) return false;
  const auto only_reads = [](Kind kind) { return kind == Kind::load || kind == Kind::sleep; };
  return !only_reads(p.kind) || !only_reads(q.kind);
}

}  // namespace

Explorer& explorer() {
  static Explorer one;
  return one;
}

void Explorer::reset() {
  choices_.clear();
  steps_ = 0;
  for (Thread& thread : threads_) thread.stack.resize(stack_bytes);
}

void Explorer::begin() {
  depth_ = 0;
  location_count_ = 0;
  me_ = 0;
  failure_.clear();
  pruned_ = false;
  events_.clear();
  for (Thread& thread : threads_) {
    thread.view = View{};
    thread.done = true;
    thread.parked = -1;
    thread.past = Time::min();
    thread.pending = {};
  }
}

bool Explorer::end(Report& report) {
  report.steps = steps_;
  if (pruned_) {
    ++report.pruned;
  } else {
    ++report.executions;
  }
  if (failed()) {
    report.failure = failure_;
    report.trace = describe_trace();
    return false;
  }
  while (!choices_.empty() && choices_.back().taken + 1 >= choices_.back().count) choices_.pop_back();
  report.exhausted = choices_.empty();
  if (report.exhausted) return false;
  ++choices_.back().taken;
  return true;
}

/// The entry function of a fiber.
void Explorer::enter() {
  Explorer& all = explorer();
  all.body_(all.program_, all.me_);
  all.threads_[all.me_].done = true;
  void* unused;
  ringfence_switch_stack(&unused, all.scheduler_stack_pointer_);
  std::abort();
}

void Explorer::step(int thread) {
  me_ = thread;
  ringfence_switch_stack(&scheduler_stack_pointer_, threads_[thread].stack_pointer);
  me_ = 0;
}

void Explorer::run(void* program, Body body, int threads) {
  program_ = program;
  body_ = body;
  for (int i = 1; i <= threads; ++i) {
    Thread& thread = threads_[i];
    thread.view = threads_[0].view;
    thread.done = false;
    const auto top = reinterpret_cast<std::uintptr_t>(thread.stack.data() + stack_bytes) & ~std::uintptr_t{15};
    void** frame = reinterpret_cast<void**>(top);
    *--frame = nullptr;  // return address of the fiber, which never returns
    *--frame = reinterpret_cast<void*>(&Explorer::enter);
    for (int saved = 0; saved < 6; ++saved) *--frame = nullptr;
    thread.stack_pointer = frame;
  }
  // The sleep set: the next operation of these threads was already explored here, and nothing has changed since.
  unsigned asleep = 0;
  while (!failed()) {
    unsigned enabled = 0, live = 0;
    for (int i = 1; i <= threads; ++i) {
      if (threads_[i].done) continue;
      live |= 1u << i;
      if (threads_[i].parked < 0 || threads_[i].sleeps_until != Time::max()) enabled |= 1u << i;
    }
    if (live == 0) break;
    // A thread that has just started or woken runs to its first operation that another thread can observe.
    if (const int started = find_without_operation(enabled)) {
      step(started);
      continue;
    }
    if (enabled == 0) return fail("a thread sleeps and is never woken");
    if ((enabled & ~asleep) == 0) {
      pruned_ = true;
      return;
    }
    const int chosen = choose_thread(enabled & ~asleep, asleep);
    for (int i = 1; i <= threads; ++i) {
      if (dependent(threads_[i].pending, threads_[chosen].pending)) asleep &= ~(1u << i);
    }
    if (threads_[chosen].pending.kind == Kind::timeout) {
      ++steps_;
      events_.push_back({static_cast<std::uint8_t>(chosen), threads_[chosen].pending, 0});
      threads_[chosen].parked = -1;
      threads_[chosen].past = std::max(threads_[chosen].past, threads_[chosen].sleeps_until);
    }
    step(chosen);
  }
  for (int i = 1; i <= threads; ++i) threads_[0].view.join(threads_[i].view);
}

int Explorer::find_without_operation(unsigned enabled) const {
  for (int i = 1; i < max_threads; ++i) {
    if ((enabled & 1u << i) != 0 && threads_[i].pending.kind == Kind::none) return i;
  }
  return 0;
}

int Explorer::choose(int count) {
  if (count <= 1) return 0;
  if (depth_ == choices_.size()) choices_.push_back({0, static_cast<std::uint8_t>(count)});
  return choices_[depth_++].taken;
}

/// Chooses one of the candidates. Adds those chosen here earlier to `tried`.
int Explorer::choose_thread(unsigned candidates, unsigned& tried) {
  int skip = choose(__builtin_popcount(candidates));
  for (int i = 1;; ++i) {
    if ((candidates & 1u << i) == 0) continue;
    if (skip-- == 0) return i;
    tried |= 1u << i;
  }
}

void Explorer::announce(Kind kind, int location) {
  if (me_ == 0) return;
  Thread& thread = threads_[me_];
  thread.pending = {kind, static_cast<std::uint8_t>(location)};
  ringfence_switch_stack(&thread.stack_pointer, scheduler_stack_pointer_);
  ++steps_;
  events_.push_back({static_cast<std::uint8_t>(me_), thread.pending, 0});
}

void Explorer::fail(const char* why) {
  if (failure_.empty()) failure_ = why;
  if (me_ == 0) return;
  void* unused;
  ringfence_switch_stack(&unused, scheduler_stack_pointer_);
}

int Explorer::new_location(std::uint64_t value) {
  if (location_count_ == max_locations) std::abort();
  Location& location = locations_[location_count_];
  location.stores.clear();
  location.stores.push_back({value, View{}});
  location.plain_writer = -1;
  return location_count_++;
}

std::uint64_t Explorer::load(int location, std::memory_order order) {
  announce(Kind::load, location);
  Thread& thread = threads_[me_];
  const auto& stores = locations_[location].stores;
  const int newest = static_cast<int>(stores.size()) - 1;
  const int oldest = me_ == 0 ? newest : thread.view.newest[location];
  const int seen = newest - choose(newest - oldest + 1);
  thread.view.newest[location] = static_cast<std::uint8_t>(seen);
  if (acquires(order)) thread.view.join(stores[seen].carried);
  if (me_ != 0) events_.back().value = stores[seen].value;
  return stores[seen].value;
}

void Explorer::append_store(int location, std::uint64_t value, std::memory_order order, bool modifies) {
  Thread& thread = threads_[me_];
  auto& stores = locations_[location].stores;
  if (stores.size() >= 250 || thread.view.clock[me_] >= 250) fail("the program has too many steps");
  ++thread.view.clock[me_];
  thread.view.newest[location] = static_cast<std::uint8_t>(stores.size());
  Stored stored{value, View{}};
  if (releases(order)) stored.carried = thread.view;
  stored.carried.newest[location] = static_cast<std::uint8_t>(stores.size());
  if (modifies) stored.carried.join(stores.back().carried);
  stores.push_back(stored);
  if (me_ != 0) events_.back().value = value;
}

void Explorer::store(int location, std::uint64_t value, std::memory_order order) {
  announce(Kind::store, location);
  int& writer = locations_[location].plain_writer;
  if (me_ != 0 && writer >= 0 && writer != me_)
    fail("two threads store to one location, which the model does not cover");
  if (me_ != 0) writer = me_;
  append_store(location, value, order, false);
}

const Explorer::Stored& Explorer::take_newest(int location, std::memory_order order) {
  const Stored& newest = locations_[location].stores.back();
  threads_[me_].view.newest[location] = static_cast<std::uint8_t>(locations_[location].stores.size() - 1);
  if (acquires(order)) threads_[me_].view.join(newest.carried);
  return newest;
}

std::uint64_t Explorer::exchange(int location, std::uint64_t value, std::memory_order order) {
  announce(Kind::exchange, location);
  const std::uint64_t before = take_newest(location, order).value;
  append_store(location, value, order, true);
  return before;
}

std::uint64_t Explorer::fetch_or(int location, std::uint64_t bits, std::memory_order order) {
  announce(Kind::fetch_or, location);
  const std::uint64_t before = take_newest(location, order).value;
  append_store(location, before | bits, order, true);
  return before;
}

void Explorer::park(int location, Time until) {
  Thread& thread = threads_[me_];
  thread.parked = location;
  thread.sleeps_until = until;
  thread.pending = {};
  if (until != Time::max()) thread.pending = {Kind::timeout, static_cast<std::uint8_t>(location)};
  ringfence_switch_stack(&thread.stack_pointer, scheduler_stack_pointer_);
}

void Explorer::sleep(int location, std::uint64_t expected) { sleep_until(location, expected, Time::max()); }

void Explorer::sleep_until(int location, std::uint64_t expected, Time deadline) {
  announce(Kind::sleep, location);
  // The kernel compares under a lock, so it sees the newest value.
  if (locations_[location].stores.back().value == expected) park(location, deadline);
}

bool Explorer::is_past(Time deadline) {
  Time& past = threads_[me_].past;
  if (deadline > past && choose(2) == 1) past = deadline;
  return deadline <= past;
}

void Explorer::wake(int location) {
  announce(Kind::wake, location);
  for (Thread& thread : threads_) {
    if (thread.parked != location) continue;
    thread.parked = -1;
    thread.pending = {};
  }
}

void Explorer::watch(std::byte* begin, std::size_t bytes) {
  memory_ = begin;
  shadows_.assign(bytes / 8, Shadow{});
  owned_bytes_ = 0;
}

void Explorer::own(std::byte* begin, std::size_t bytes) {
  owned_ = begin;
  owned_bytes_ = bytes;
}

Explorer::Shadow* Explorer::shadow_of(const std::byte* at) {
  const std::ptrdiff_t offset = at - memory_;
  if (offset < 0 || offset % 8 != 0 || offset / 8 >= static_cast<std::ptrdiff_t>(shadows_.size())) {
    fail("an access outside the ring or not aligned to its words");
    return nullptr;
  }
  return &shadows_[static_cast<std::size_t>(offset / 8)];
}

void Explorer::write(std::byte* at, std::uint64_t word) {
  if (at >= owned_ && at + sizeof word <= owned_ + owned_bytes_) {
    std::memcpy(at, &word, sizeof word);
    return;
  }
  Shadow* shadow = shadow_of(at);
  if (!shadow) return;
  const View& view = threads_[me_].view;
  if (view.clock[shadow->writer] < shadow->written && shadow->writer != me_) fail("a data race of two writes");
  for (int i = 0; i < max_threads; ++i) {
    if (i != me_ && view.clock[i] < shadow->seen[i]) fail("a write to memory that may still be read");
  }
  shadow->seen.fill(0);
  shadow->writer = static_cast<std::uint8_t>(me_);
  shadow->written = static_cast<std::uint8_t>(view.clock[me_] + 1);
  std::memcpy(at, &word, sizeof word);
}

std::uint64_t Explorer::read(const std::byte* at) {
  Shadow* shadow = shadow_of(at);
  if (!shadow) return 0;
  const View& view = threads_[me_].view;
  if (view.clock[shadow->writer] < shadow->written && shadow->writer != me_)
    fail("a read of memory that is not published");
  shadow->seen[me_] = static_cast<std::uint8_t>(view.clock[me_] + 1);
  std::uint64_t word;
  std::memcpy(&word, at, sizeof word);
  return word;
}

void Explorer::prefetch_for_write(const std::byte* at, std::size_t line) {
  if (!shadow_of(at)) return;
  const std::size_t first = static_cast<std::size_t>(at - memory_) / line * line;
  const View& view = threads_[me_].view;
  for (std::size_t word = first / 8; word < std::min((first + line) / 8, shadows_.size()); ++word) {
    const Shadow& shadow = shadows_[word];
    bool read = shadow.written == 0;
    for (int i = 0; i < max_threads; ++i) {
      if (i != me_ && view.clock[i] < shadow.seen[i]) return fail("a prefetched line may still be read");
      read = read || shadow.seen[i] != 0;
    }
    if (!read) return fail("a line prefetched for writing was not read");
  }
}

void Explorer::prefetch_for_read(const std::byte* at) {
  const Shadow* shadow = shadow_of(at);
  if (!shadow || shadow->writer == me_) return;
  if (threads_[me_].view.clock[shadow->writer] < shadow->written) fail("a prefetched line is not published");
}

void Explorer::evict(const std::byte* at, std::size_t line) {
  if (!shadow_of(at)) return;
  const std::size_t first = static_cast<std::size_t>(at - memory_) / line * line;
  for (std::size_t word = first / 8; word < std::min((first + line) / 8, shadows_.size()); ++word) {
    const Shadow& shadow = shadows_[word];
    if (shadow.writer != me_ && threads_[me_].view.clock[shadow.writer] < shadow.written)
      return fail("an evicted line is being written");
  }
}

std::string Explorer::describe_trace() const {
  constexpr const char* names[] = {"none", "load", "store", "exchange", "fetch_or", "sleep", "wake", "timeout"};
  std::string text;
  for (const Event& event : events_) {
    text += "  thread " + std::to_string(event.thread) + ' ' + names[static_cast<int>(event.operation.kind)] +
            " location " + std::to_string(event.operation.location) + " = " + std::to_string(event.value) + '\n';
  }
  return text;
}

}  // namespace ringfence::checker
