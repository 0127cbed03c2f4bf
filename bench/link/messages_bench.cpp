// frame/messages/<objects>/<nodes>: the cost of the messages of a frame, without motion, broad phase and narrow phase.
// The server and its CD nodes exchange as many records of each type as in a frame of a simulated world, in the order of
// the frame, written as runs through rings of the usual size and decoded on arrival. Every record is written
// completely; its first word is read. Runs on two cores. Hand-overs and user nodes are left out.
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
#include "link/frame_traffic.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"

namespace ringfence::bench {
namespace {

using messages::MessageType;

constexpr std::size_t ring_bytes = std::size_t{1} << 20;  // the size between the server and a CD node

/// What one end has sent and received. The runs of a frame always have the same order.
struct Totals {
  messages::TrafficCounts counts{};
  std::uint64_t sum = 0;    ///< of the first words of all received records
  std::size_t records = 0;  ///< received
  std::size_t wrong = 0;    ///< messages that decode() refused
};

/// One end of the two channels between the server and a node.
struct End {
  link::Sender& out;
  link::Receiver& in;
  std::size_t state_bytes;
  Totals totals{};
  messages::RunSender run{};

  bool send(MessageType type, std::size_t frame) {
    const std::size_t bytes = messages::record_bytes(type, state_bytes);
    const messages::RunHeader run_header{type, messages::Endpoint::server(), messages::Endpoint::node(0), frame, 0};
    return run.pump(out, run_header, bytes, totals.counts, [bytes](std::size_t i, std::byte* record) {
      // Writes 8 bytes at a time, as a record has several fields.
      for (std::size_t at = 0; at < bytes; at += 8) {
        const std::uint64_t word = i + at;
        std::memcpy(record + at, &word, 8);
      }
    });
  }

  /// Receives what is available. Returns whether the run of `type` has ended.
  bool receive(MessageType type) {
    for (;;) {
      const std::span<const std::byte> bytes = in.next();
      if (bytes.empty()) break;
      messages::MessageView message;
      if (messages::decode(bytes, state_bytes, message) != Status::ok || message.type() != type) {
        ++totals.wrong;
        continue;
      }
      for (std::size_t i = 0; i < message.count(); ++i) {
        std::uint64_t word;
        std::memcpy(&word, message.at(i), sizeof word);
        totals.sum += word;
      }
      totals.records += message.count();
      if (message.last()) {
        in.release();
        return true;
      }
    }
    in.release();
    return false;
  }
};

struct DuplexChannel {
  link::Doorbell bell;
  link::Channel down, up;
  DuplexChannel(link::Doorbell& server) : down(ring_bytes, &bell, &server), up(ring_bytes, &server, &bell) {}
};

/// The runs of a frame in order, with their direction.
struct Step {
  MessageType type;
  bool down;
  std::size_t NodeTraffic::*records;
};
constexpr std::size_t NodeTraffic::*none = nullptr;
constexpr Step steps[] = {{MessageType::frame_begin, true, none},
                          {MessageType::node_state, false, &NodeTraffic::states},
                          {MessageType::position_update, true, &NodeTraffic::positions},
                          {MessageType::pairs, true, &NodeTraffic::pairs},
                          {MessageType::collision, false, &NodeTraffic::collisions},
                          {MessageType::change, false, &NodeTraffic::changes},
                          {MessageType::narrow_done, false, none},
                          {MessageType::frame_end, true, none},
                          {MessageType::frame_done, false, none}};

std::size_t records_of(const Step& step, const NodeTraffic& node) {
  if (step.records != none) return node.*step.records;
  return step.type == MessageType::frame_begin ? 0 : 1;
}

void serve_node(DuplexChannel& channels, const NodeTraffic& traffic, std::size_t state_bytes, std::size_t frames) {
  End end{channels.up.sender(), channels.down.receiver(), state_bytes};
  for (std::size_t frame = 1; frame <= frames; ++frame) {
    for (const Step& step : steps) {
      if (step.down) {
        channels.bell.wait([&] { return end.receive(step.type); });
      } else {
        end.run.start(records_of(step, traffic));
        channels.bell.wait([&] { return end.send(step.type, frame); });
      }
    }
  }
}

void serve(std::vector<End>& ends, link::Doorbell& bell, const FrameTraffic& traffic, std::size_t frame) {
  for (const Step& step : steps) {
    std::vector<End*> unfinished;
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (step.down) ends[i].run.start(records_of(step, traffic.nodes[i]));
      unfinished.push_back(&ends[i]);
    }
    bell.wait([&] {
      std::erase_if(unfinished,
                    [&](End* end) { return step.down ? end->send(step.type, frame) : end->receive(step.type); });
      return unfinished.empty();
    });
  }
}

void exchange_frames(benchmark::State& state, std::uint32_t objects, std::uint32_t nodes) {
  const std::size_t batches = 15, frames = objects > 10000 ? 6 : 40;
  const FrameTraffic traffic = count_frame(objects, nodes);
  const link::Cores cores;
  link::Doorbell server;
  std::vector<std::unique_ptr<DuplexChannel>> channels;
  std::vector<std::thread> threads;
  std::vector<End> ends;
  for (std::size_t i = 0; i < nodes; ++i) {
    channels.push_back(std::make_unique<DuplexChannel>(server));
    ends.push_back({channels.back()->down.sender(), channels.back()->up.receiver(), traffic.state_bytes});
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    threads.emplace_back([&, i] {
      cores.pin_this_thread((i + 1) % 2);
      serve_node(*channels[i], traffic.nodes[i], traffic.state_bytes, batches * frames);
    });
  }
  std::vector<double> wall, cpu;
  std::thread([&] {
    cores.pin_this_thread(0);
    std::size_t frame = 0;
    for (std::size_t batch = 0; batch < batches; ++batch) {
      const double cpu_before = cpu_seconds();
      const auto before = std::chrono::steady_clock::now();
      for (std::size_t i = 0; i < frames; ++i) serve(ends, server, traffic, ++frame);
      const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - before;
      wall.push_back(spent.count() / static_cast<double>(frames));
      cpu.push_back((cpu_seconds() - cpu_before) / static_cast<double>(frames));
    }
  }).join();
  for (std::thread& thread : threads) thread.join();

  std::size_t expected = 0, received = 0, wrong = 0, messages = 0, bytes = 0;
  for (std::size_t i = 0; i < nodes; ++i) {
    for (const Step& step : steps) expected += step.down ? 0 : records_of(step, traffic.nodes[i]);
    received += ends[i].totals.records;
    wrong += ends[i].totals.wrong;
    for (const Step& step : steps) {
      const std::size_t each = messages::record_bytes(step.type, traffic.state_bytes);
      const std::size_t records = records_of(step, traffic.nodes[i]);
      const std::size_t max_records =
          each == 0 ? 1 : (channels[i]->down.sender().largest_message() - sizeof(messages::Header)) / each;
      const std::size_t count = std::max<std::size_t>(1, (records + max_records - 1) / max_records);
      messages += count;
      bytes += count * sizeof(messages::Header) + records * each;
    }
  }
  if (wrong != 0 || received != expected * batches * frames) return state.SkipWithError("records were lost or refused");
  std::sort(wall.begin(), wall.end());
  std::sort(cpu.begin(), cpu.end());
  state.SetIterationTime(wall[wall.size() / 2]);
  state.counters["cpu_us_a_frame"] = cpu[cpu.size() / 2] * 1e6;
  state.counters["us_least"] = wall.front() * 1e6;
  state.counters["messages"] = static_cast<double>(messages);
  state.counters["kilobytes"] = static_cast<double>(bytes) / 1000;
  state.counters["GB_a_second"] = static_cast<double>(bytes) / wall[wall.size() / 2] * 1e-9;
}

}  // namespace

void register_messages() {
  for (const std::uint32_t objects : {4000u, 64000u}) {
    for (const std::uint32_t nodes : {1u, 16u}) {
      const std::string name = "frame/messages/" + std::to_string(objects) + '/' + std::to_string(nodes);
      benchmark::RegisterBenchmark(name.c_str(),
                                   [=](benchmark::State& state) {
                                     for (auto _ : state) exchange_frames(state, objects, nodes);
                                   })
          ->UseManualTime()
          ->Iterations(1)
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace ringfence::bench
