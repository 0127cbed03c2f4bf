// frame/empty/<nodes>: the cost of waiting in a frame without work. A server sends each node a message and waits for
// the replies of all. Threads are pinned to two cores in turn, or `unpinned`: placed by the system. Frames follow each
// other at once, or `paced`: every 2 ms, so that all threads sleep before each frame.
#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "link/benches.hpp"
#include "link/channel.hpp"
#include "link/cores.hpp"
#include "link/cpu_time.hpp"

namespace ringfence::bench {
namespace {

/// Sends one message of 64 bytes: the frame's number, or ~0 to stop.
void send(link::Sender& sender, link::Doorbell& own, std::uint64_t frame) {
  std::span<std::byte> room;
  own.wait([&] { return !(room = sender.claim(64)).empty(); });
  std::memset(room.data(), 0, room.size());
  std::memcpy(room.data(), &frame, sizeof frame);
  sender.commit(64);
  sender.publish();
}

std::uint64_t receive(link::Receiver& receiver) {
  const std::span<const std::byte> message = receiver.next();
  std::uint64_t frame;
  std::memcpy(&frame, message.data(), sizeof frame);
  receiver.release();
  return frame;
}

/// A node and its two channels to the server.
struct Node {
  link::Doorbell bell;
  link::Channel in, out;

  explicit Node(link::Doorbell& server) : in(4096, &bell, &server), out(4096, &server, &bell) {}

  void serve() {
    for (;;) {
      bell.wait([&] { return in.receiver().has_message(); });
      const std::uint64_t frame = receive(in.receiver());
      if (frame == ~std::uint64_t{0}) return;
      send(out.sender(), bell, frame);
    }
  }
};

void empty_frames(benchmark::State& state, std::size_t nodes, bool pinned, std::chrono::microseconds pace) {
  constexpr std::size_t frames = 50;
  const std::size_t batches = pace.count() == 0 ? 21 : 7;
  const link::Cores cores;
  link::Doorbell server;
  std::vector<std::unique_ptr<Node>> all;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < nodes; ++i) {
    all.push_back(std::make_unique<Node>(server));
    threads.emplace_back([&cores, node = all.back().get(), i, pinned] {
      if (pinned) cores.pin_this_thread((i + 1) % 2);
      node->serve();
    });
  }
  std::vector<double> cpu, wall;
  std::uint64_t frame = 0;
  std::thread([&] {
    if (pinned) cores.pin_this_thread(0);
    for (std::size_t batch = 0; batch < batches; ++batch) {
      const double cpu_before = cpu_seconds();
      std::chrono::steady_clock::duration spent{};
      for (std::size_t i = 0; i < frames; ++i) {
        if (pace.count() != 0) std::this_thread::sleep_for(pace);
        const auto before = std::chrono::steady_clock::now();
        ++frame;
        for (const auto& node : all) send(node->in.sender(), server, frame);
        std::size_t replies = 0;
        while (replies < nodes) {
          server.wait([&] {
            return std::any_of(all.begin(), all.end(), [](auto& node) { return node->out.receiver().has_message(); });
          });
          for (const auto& node : all) {
            if (node->out.receiver().has_message()) replies += receive(node->out.receiver()) == frame;
          }
        }
        spent += std::chrono::steady_clock::now() - before;
      }
      wall.push_back(std::chrono::duration<double>(spent).count() / frames);
      cpu.push_back((cpu_seconds() - cpu_before) / frames);
    }
    for (const auto& node : all) send(node->in.sender(), server, ~std::uint64_t{0});
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
  struct Variant {
    const char* name;
    bool pinned;
    std::chrono::microseconds pace;
  };
  for (const Variant& variant : {Variant{"empty", true, {}},
                                 {"empty_unpinned", false, {}},
                                 {"empty_paced", true, std::chrono::milliseconds(2)}}) {
    for (const std::size_t nodes : {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{16}}) {
      const std::string name = std::string("frame/") + variant.name + '/' + std::to_string(nodes);
      const auto run = [nodes, variant](benchmark::State& state) {
        for (auto _ : state) empty_frames(state, nodes, variant.pinned, variant.pace);
      };
      benchmark::RegisterBenchmark(name.c_str(), run)->UseManualTime()->Iterations(1)->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace ringfence::bench
