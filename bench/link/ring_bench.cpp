// ring/<traffic>/<impl>: one producer and one consumer, pinned to two cores.
//
// A burst is short enough to fit between two interruptions, and is repeated many times. Reports the rate of the median
// burst (the time of the benchmark) and of the burst at the lowest decile (`undisturbed`). Each library batches as its
// interface allows: ringfence stages and publishes 4 to 8 KiB at a time, Boost pushes and pops arrays. Where all
// messages have one size, it is a constant for each library.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>
#include <tbb/concurrent_queue.h>

#if defined(RINGFENCE_HAS_BOOST_LOCKFREE)
#include <boost/lockfree/spsc_queue.hpp>
#endif

#include "link/benches.hpp"
#include "link/channel.hpp"
#include "link/cores.hpp"
#include "link/traffic.hpp"

namespace ringfence::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t ring_bytes = std::size_t{1} << 18;

void pause() { link::ThreadAtomics::pause(); }

/// `fixed_size`: size of all messages in bytes, or 0 if it varies.
template <std::size_t fixed_size>
class Ringfence {
 public:
  static constexpr bool shares_doorbells = true;
  explicit Ringfence(const Traffic&)
      : own_(std::make_unique<std::array<link::Doorbell, 2>>()),
        producers_((*own_)[0]),
        consumers_((*own_)[1]),
        channel_(ring_bytes, &consumers_, &producers_) {}
  /// The channel in the other direction between the same two threads, each of which has one doorbell.
  explicit Ringfence(Ringfence& forward)
      : producers_(forward.consumers_),
        consumers_(forward.producers_),
        channel_(ring_bytes, &consumers_, &producers_) {}

  void produce(const Traffic& traffic) {
    link::Sender& sender = channel_.sender();
    for (std::size_t i = 0; i < traffic.count; ++i) {
      const std::size_t size = fixed_size != 0 ? fixed_size : traffic.size_of(i);
      std::span<std::byte> room = sender.claim(size);
      if (room.empty()) producers_.wait([&] { return !(room = sender.claim(size)).empty(); });
      fill(room.data(), size, i);
      sender.commit(size);
      if (sender.staged() >= batch) sender.publish();
    }
    sender.publish();
  }

  std::uint64_t consume(const Traffic& traffic) {
    link::Receiver& receiver = channel_.receiver();
    std::uint64_t sum = 0;
    std::size_t unreleased = 0;
    for (std::size_t i = 0; i < traffic.count;) {
      const std::span<const std::byte> message = receiver.next();
      if (message.empty()) {
        receiver.release();
        consumers_.wait([&] { return receiver.has_message(); });
        continue;
      }
      const std::size_t size = fixed_size != 0 ? fixed_size : message.size();
      sum += sum_of(message.data(), size);
      unreleased += size + 8;
      if (unreleased >= 4 * batch) {
        receiver.release();
        unreleased = 0;
      }
      ++i;
    }
    receiver.release();
    return sum;
  }

 private:
  static constexpr std::size_t batch = 4096;

  std::unique_ptr<std::array<link::Doorbell, 2>> own_;
  link::Doorbell& producers_;
  link::Doorbell& consumers_;
  link::Channel channel_;
};

/// A message as an element of a queue of fixed-size elements. If sizes vary, only the used part is copied.
template <std::size_t largest, bool varies>
struct Element {
  std::uint32_t size;
  std::array<std::uint64_t, largest / 8> words;

  Element() = default;
  Element(const Element& other) { *this = other; }
  Element& operator=(const Element& other) {
    size = other.size;
    std::memcpy(words.data(), other.words.data(), size);
    return *this;
  }
};
template <std::size_t largest>
struct Element<largest, false> {
  static constexpr std::uint32_t size = largest;
  std::array<std::uint64_t, largest / 8> words;
};

template <class E>
void set(E& element, std::size_t size, std::size_t number) {
  if constexpr (!std::is_const_v<decltype(E::size)>) element.size = static_cast<std::uint32_t>(size);
  fill(element.words.data(), size, number);
}

#if defined(RINGFENCE_HAS_BOOST_LOCKFREE)
template <class E>
class Boost {
 public:
  explicit Boost(const Traffic&) : queue_(ring_bytes / sizeof(E)) {}

  void produce(const Traffic& traffic) {
    for (std::size_t i = 0; i < traffic.count;) {
      std::size_t filled = 0;
      for (; filled < batch && i < traffic.count; ++filled, ++i) set(staged_[filled], traffic.size_of(i), i);
      for (std::size_t pushed = 0; pushed < filled;) {
        const std::size_t transferred = queue_.push(staged_.data() + pushed, filled - pushed);
        if (transferred == 0) pause();
        pushed += transferred;
      }
    }
  }

  std::uint64_t consume(const Traffic& traffic) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < traffic.count;) {
      const std::size_t transferred =
          queue_.consume_all([&](const E& element) { sum += sum_of(element.words.data(), element.size); });
      if (transferred == 0) pause();
      i += transferred;
    }
    return sum;
  }

 private:
  static constexpr std::size_t batch = std::max<std::size_t>(1, 4096 / sizeof(E));
  boost::lockfree::spsc_queue<E> queue_;
  alignas(link::cache_line_pair_bytes) std::array<E, batch> staged_;
};
#endif

template <class E>
class Tbb {
 public:
  explicit Tbb(const Traffic&) { queue_.set_capacity(static_cast<std::ptrdiff_t>(ring_bytes / sizeof(E))); }

  void produce(const Traffic& traffic) {
    for (std::size_t i = 0; i < traffic.count; ++i) {
      set(staged_, traffic.size_of(i), i);
      while (!queue_.try_push(staged_)) pause();
    }
  }

  std::uint64_t consume(const Traffic& traffic) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < traffic.count; ++i) {
      while (!queue_.try_pop(taken_)) pause();
      sum += sum_of(taken_.words.data(), taken_.size);
    }
    return sum;
  }

 private:
  tbb::concurrent_bounded_queue<E> queue_;
  alignas(link::cache_line_pair_bytes) E staged_;
  alignas(link::cache_line_pair_bytes) E taken_;
};

constexpr std::size_t stop_signal = ~std::size_t{0};
constexpr auto max_time = std::chrono::seconds(4);

/// Runs up to `bursts` bursts between two threads that are pinned to two cores. Returns the seconds of each, sorted.
/// One thread calls `produce`, the other `consume`; the time runs from the start signal until both are done.
template <class Produce, class Consume>
std::vector<double> run_bursts(std::size_t bursts, Produce produce, Consume consume) {
  const link::Cores cores;
  alignas(link::cache_line_pair_bytes) std::atomic<std::size_t> started{0};
  alignas(link::cache_line_pair_bytes) std::atomic<std::size_t> done{0};
  std::thread other([&] {
    cores.pin_this_thread(1);
    for (std::size_t burst = 1;; ++burst) {
      std::size_t seen;
      while ((seen = started.load(std::memory_order_acquire)) < burst) pause();
      if (seen == stop_signal) return;
      consume();
      done.store(burst, std::memory_order_release);
    }
  });
  std::vector<double> seconds;
  std::thread one([&] {
    cores.pin_this_thread(0);
    const auto stop_time = Clock::now() + max_time;
    for (std::size_t burst = 1; burst <= bursts && (burst <= 20 || Clock::now() < stop_time); ++burst) {
      const auto begin = Clock::now();
      started.store(burst, std::memory_order_release);
      produce();
      while (done.load(std::memory_order_acquire) < burst) pause();
      seconds.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
    }
    started.store(stop_signal, std::memory_order_release);
  });
  one.join();
  other.join();
  std::sort(seconds.begin(), seconds.end());
  return seconds;
}

constexpr std::size_t bursts = 1500;

void report(benchmark::State& state, const std::vector<double>& seconds, double items, double bytes) {
  const double median = seconds[seconds.size() / 2], undisturbed = seconds[seconds.size() / 10];
  state.SetIterationTime(median);
  state.SetItemsProcessed(static_cast<std::int64_t>(items));
  state.SetBytesProcessed(static_cast<std::int64_t>(bytes));
  state.counters["undisturbed"] = benchmark::Counter(items / undisturbed);
  state.counters["undisturbed_bytes"] = benchmark::Counter(bytes / undisturbed);
}

template <class Link>
void stream(benchmark::State& state, const Traffic& traffic) {
  for (auto _ : state) {
    auto link = std::make_unique<Link>(traffic);
    const std::uint64_t expected = expected_sum(traffic);
    std::uint64_t wrong = 0;
    const std::vector<double> seconds = run_bursts(
        bursts, [&] { link->produce(traffic); }, [&] { wrong += link->consume(traffic) != expected; });
    if (wrong != 0) return state.SkipWithError("the received data differ from the sent data");
    report(state, seconds, static_cast<double>(traffic.count * traffic.items), static_cast<double>(traffic.bytes()));
  }
}

template <class Link>
std::unique_ptr<Link> make_backward(Link& forward, const Traffic& traffic) {
  if constexpr (requires { Link::shares_doorbells; }) {
    return std::make_unique<Link>(forward);
  } else {
    return std::make_unique<Link>(traffic);
  }
}

/// A round trip over two channels, with one message at a time.
template <class Link>
void round_trip(benchmark::State& state, const Traffic& traffic) {
  constexpr std::size_t trips = 100;
  const Traffic one{1, traffic.smallest, traffic.largest, 1};
  for (auto _ : state) {
    const auto forward = std::make_unique<Link>(one);
    const auto backward = make_backward(*forward, one);
    const std::uint64_t expected = expected_sum(one);
    // Separate cache lines: sharing of this data would be measured as a cost of the channel.
    struct alignas(link::cache_line_pair_bytes) End {
      Link* forward;
      Link* backward;
      Traffic one;
      std::uint64_t expected, wrong;
    };
    End near_end{forward.get(), backward.get(), one, expected, 0}, far_end = near_end;
    const std::vector<double> seconds = run_bursts(
        bursts,
        [&] {
          for (std::size_t i = 0; i < trips; ++i) {
            near_end.forward->produce(near_end.one);
            near_end.wrong += near_end.backward->consume(near_end.one) != near_end.expected;
          }
        },
        [&] {
          for (std::size_t i = 0; i < trips; ++i) {
            far_end.wrong += far_end.forward->consume(far_end.one) != far_end.expected;
            far_end.backward->produce(far_end.one);
          }
        });
    if (near_end.wrong + far_end.wrong != 0) return state.SkipWithError("the received data differ from the sent data");
    report(state, seconds, trips, static_cast<double>(2 * trips * one.bytes()));
    state.counters["ns_a_trip"] = seconds[seconds.size() / 10] / trips * 1e9;
  }
}

template <class Run>
void add(const std::string& name, Run run) {
  benchmark::RegisterBenchmark(name.c_str(), run)->UseManualTime()->Iterations(1)->Unit(benchmark::kMicrosecond);
}

template <std::size_t largest, bool varies>
void register_traffic(const std::string& name, const Traffic& traffic) {
  using E = Element<largest, varies>;
  using Own = Ringfence<varies ? 0 : largest>;
  const std::string prefix = "ring/" + name + '/';
  add(prefix + "ringfence", [traffic](benchmark::State& state) { stream<Own>(state, traffic); });
#if defined(RINGFENCE_HAS_BOOST_LOCKFREE)
  add(prefix + "boost", [traffic](benchmark::State& state) { stream<Boost<E>>(state, traffic); });
#endif
  add(prefix + "tbb", [traffic](benchmark::State& state) { stream<Tbb<E>>(state, traffic); });
}

}  // namespace

void register_rings() {
  register_traffic<8, false>("msg8", {20000, 8, 8, 1});
  register_traffic<64, false>("msg64", {10000, 64, 64, 1});
  register_traffic<4096, false>("batch64", {400, 4096, 4096, 64});
  register_traffic<4096, false>("msg4096", {400, 4096, 4096, 1});
  register_traffic<1024, true>("mixed", {4000, 16, 1024, 1});
  const Traffic one{1, 32, 32, 1};
  using E = Element<32, false>;
  add("ring/roundtrip/ringfence", [one](benchmark::State& state) { round_trip<Ringfence<32>>(state, one); });
#if defined(RINGFENCE_HAS_BOOST_LOCKFREE)
  add("ring/roundtrip/boost", [one](benchmark::State& state) { round_trip<Boost<E>>(state, one); });
#endif
  add("ring/roundtrip/tbb", [one](benchmark::State& state) { round_trip<Tbb<E>>(state, one); });
}

}  // namespace ringfence::bench
