// frame/empty/<nodes>: what waiting costs in a frame with nothing to do. A server tells each node to begin and waits
// for all to end, over links. Pinned to the first two cores in turn, or `unpinned`: where the system puts them.
#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include "link/benches.hpp"
#include "link/channel.hpp"
#include "link/cores.hpp"

namespace ringfence::bench {
namespace {

double cpu_seconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Sends one message of 64 bytes: the frame's number, or ~0 to stop.
void say(link::Sender& sender, link::Doorbell& own, std::uint64_t frame) {
  std::span<std::byte> room;
  own.wait([&] { return !(room = sender.claim(64)).empty(); });
  std::memset(room.data(), 0, room.size());
  std::memcpy(room.data(), &frame, sizeof frame);
  sender.commit(64);
  sender.publish();
}

std::uint64_t hear(link::Receiver& receiver) {
  const std::span<const std::byte> message = receiver.next();
  std::uint64_t frame;
  std::memcpy(&frame, message.data(), sizeof frame);
  receiver.release();
  return frame;
}

/// A node and its two links with the server.
struct Node {
  link::Doorbell bell;
  link::Channel in, out;

  explicit Node(link::Doorbell& server) : in(4096, &bell, &server), out(4096, &server, &bell) {}

  void serve() {
    for (;;) {
      bell.wait([&] { return in.receiver().has_message(); });
      const std::uint64_t frame = hear(in.receiver());
      if (frame == ~std::uint64_t{0}) return;
      say(out.sender(), bell, frame);
    }
  }
};

void empty_frames(benchmark::State& state, std::size_t nodes, bool pinned) {
  constexpr std::size_t frames = 50, batches = 21;
  const link::Cores cores;
  link::Doorbell server;
  std::vector<std::unique_ptr<Node>> all;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < nodes; ++i) {
    all.push_back(std::make_unique<Node>(server));
    threads.emplace_back([&cores, node = all.back().get(), i, pinned] {
      if (pinned) cores.pin_this_thread(i % 2);
      node->serve();
    });
  }
  std::vector<double> cpu, wall;
  std::uint64_t frame = 0;
  std::thread([&] {
    if (pinned) cores.pin_this_thread(0);
    for (std::size_t batch = 0; batch < batches; ++batch) {
      const double cpu_before = cpu_seconds();
      const auto before = std::chrono::steady_clock::now();
      for (std::size_t i = 0; i < frames; ++i) {
        ++frame;
        for (const auto& node : all) say(node->in.sender(), server, frame);
        std::size_t heard = 0;
        while (heard < nodes) {
          server.wait([&] {
            return std::any_of(all.begin(), all.end(), [](auto& node) { return node->out.receiver().has_message(); });
          });
          for (const auto& node : all) {
            if (node->out.receiver().has_message()) heard += hear(node->out.receiver()) == frame;
          }
        }
      }
      wall.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count() / frames);
      cpu.push_back((cpu_seconds() - cpu_before) / frames);
    }
    for (const auto& node : all) say(node->in.sender(), server, ~std::uint64_t{0});
  }).join();
  for (std::thread& thread : threads) thread.join();
  std::sort(cpu.begin(), cpu.end());
  std::sort(wall.begin(), wall.end());
  state.SetIterationTime(wall[wall.size() / 2]);
  state.counters["cpu_us_a_frame"] = cpu[cpu.size() / 2] * 1e6;
  state.counters["cpu_us_least"] = cpu.front() * 1e6;
}

}  // namespace

void register_doorbells() {
  for (const bool pinned : {true, false}) {
    for (const std::size_t nodes : {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{16}}) {
      const std::string name = (pinned ? "frame/empty/" : "frame/empty_unpinned/") + std::to_string(nodes);
      const auto run = [nodes, pinned](benchmark::State& state) {
        for (auto _ : state) empty_frames(state, nodes, pinned);
      };
      benchmark::RegisterBenchmark(name.c_str(), run)->UseManualTime()->Iterations(1)->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace ringfence::bench
