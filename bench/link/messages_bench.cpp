// frame/messages/<objects>/<nodes>: what carrying the messages of a frame costs, without moving, sweeping and testing.
// The server and its CD nodes exchange as many records of each kind as in a frame of a real world, in the order of the
// frame's steps, written as runs, through rings of the service's size, and decoded as they arrive; every record is
// written whole and looked at. On two cores. Hand-overs and user nodes are left out.
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

constexpr std::size_t ring_bytes = std::size_t{1} << 20;  // as between the server and a CD node

/// What an end has sent and heard so far; the runs of a frame come in the same order always.
struct Account {
  messages::TrafficCounts counts{};
  std::uint64_t sum = 0;    ///< of the first words of all records that came
  std::size_t records = 0;  ///< that came
  std::size_t wrong = 0;    ///< messages that decoding refused
};

/// One end of the two links between the server and a node.
struct End {
  link::Sender& out;
  link::Receiver& in;
  std::size_t state_bytes;
  Account account{};
  messages::RunSender run{};

  bool send(MessageType type, std::size_t frame) {
    const std::size_t bytes = messages::record_bytes(type, state_bytes);
    const messages::RunHeader head{type, messages::Endpoint::server(), messages::Endpoint::node(0), frame, 0};
    return run.pump(out, head, bytes, account.counts, [bytes](std::size_t i, std::byte* where) {
      // As a record is: several words of its own.
      for (std::size_t at = 0; at < bytes; at += 8) {
        const std::uint64_t word = i + at;
        std::memcpy(where + at, &word, 8);
      }
    });
  }

  /// Takes what is there; true when the run of `type` has ended.
  bool hear(MessageType type) {
    for (;;) {
      const std::span<const std::byte> bytes = in.next();
      if (bytes.empty()) break;
      messages::MessageView message;
      if (messages::decode(bytes, state_bytes, message) != Status::ok || message.type() != type) {
        ++account.wrong;
        continue;
      }
      for (std::size_t i = 0; i < message.count(); ++i) {
        std::uint64_t word;
        std::memcpy(&word, message.at(i), sizeof word);
        account.sum += word;
      }
      account.records += message.count();
      if (message.last()) {
        in.release();
        return true;
      }
    }
    in.release();
    return false;
  }
};

struct Lines {
  link::Doorbell bell;
  link::Channel down, up;
  Lines(link::Doorbell& server) : down(ring_bytes, &bell, &server), up(ring_bytes, &server, &bell) {}
};

/// The runs of a frame, in order: what goes down, then what comes back.
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
                          {MessageType::narrow_done, false, none},
                          {MessageType::confirm, true, &NodeTraffic::confirms},
                          {MessageType::frame_end, true, none},
                          {MessageType::frame_done, false, none}};

std::size_t records_of(const Step& step, const NodeTraffic& node) {
  if (step.records != none) return node.*step.records;
  return step.type == MessageType::frame_begin ? 0 : 1;
}

void serve_node(Lines& lines, const NodeTraffic& traffic, std::size_t state_bytes, std::size_t frames) {
  End end{lines.up.sender(), lines.down.receiver(), state_bytes};
  for (std::size_t frame = 1; frame <= frames; ++frame) {
    for (const Step& step : steps) {
      if (step.down) {
        lines.bell.wait([&] { return end.hear(step.type); });
      } else {
        end.run.start(records_of(step, traffic));
        lines.bell.wait([&] { return end.send(step.type, frame); });
      }
    }
  }
}

void serve(std::vector<End>& ends, link::Doorbell& bell, const FrameTraffic& traffic, std::size_t frame) {
  for (const Step& step : steps) {
    std::vector<End*> left;
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (step.down) ends[i].run.start(records_of(step, traffic.nodes[i]));
      left.push_back(&ends[i]);
    }
    bell.wait([&] {
      std::erase_if(left, [&](End* end) { return step.down ? end->send(step.type, frame) : end->hear(step.type); });
      return left.empty();
    });
  }
}

void carry(benchmark::State& state, std::uint32_t objects, std::uint32_t nodes) {
  const std::size_t batches = 15, frames = objects > 10000 ? 6 : 40;
  const FrameTraffic traffic = count_frame(objects, nodes);
  const link::Cores cores;
  link::Doorbell server;
  std::vector<std::unique_ptr<Lines>> lines;
  std::vector<std::thread> threads;
  std::vector<End> ends;
  for (std::size_t i = 0; i < nodes; ++i) {
    lines.push_back(std::make_unique<Lines>(server));
    ends.push_back({lines.back()->down.sender(), lines.back()->up.receiver(), traffic.state_bytes});
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    threads.emplace_back([&, i] {
      cores.pin_this_thread((i + 1) % 2);
      serve_node(*lines[i], traffic.nodes[i], traffic.state_bytes, batches * frames);
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

  std::size_t expected = 0, heard = 0, wrong = 0, messages = 0, bytes = 0;
  for (std::size_t i = 0; i < nodes; ++i) {
    for (const Step& step : steps) expected += step.down ? 0 : records_of(step, traffic.nodes[i]);
    heard += ends[i].account.records;
    wrong += ends[i].account.wrong;
    for (const Step& step : steps) {
      const std::size_t each = messages::record_bytes(step.type, traffic.state_bytes);
      const std::size_t records = records_of(step, traffic.nodes[i]);
      const std::size_t most =
          each == 0 ? 1 : (lines[i]->down.sender().largest_message() - sizeof(messages::Header)) / each;
      const std::size_t count = std::max<std::size_t>(1, (records + most - 1) / most);
      messages += count;
      bytes += count * sizeof(messages::Header) + records * each;
    }
  }
  if (wrong != 0 || heard != expected * batches * frames) return state.SkipWithError("records were lost or refused");
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
                                     for (auto _ : state) carry(state, objects, nodes);
                                   })
          ->UseManualTime()
          ->Iterations(1)
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace ringfence::bench
