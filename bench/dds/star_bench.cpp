// One stage of a frame over loopback: a server sends messages to each of n processes and waits for all replies. The
// path is that of the bridge and a node: ring, parcel, sample, and back.
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dds/domain.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/star.hpp"
#include "facade/duplex_channel.hpp"
#include "item_reporter.hpp"
#include "link/doorbell.hpp"

namespace ringfence::bench {
namespace {

class Star {
 public:
  explicit Star(std::uint32_t nodes)
      : hook_{[this] {
                came_.store(true, std::memory_order_release);
                bell_.ring();
              },
              [] {}},
        domain_(network(), dds::Side::world),
        up_(domain_.reader(dds::Topic::up, dds::parcel_qos, {})),
        out_bytes_(bytes_out(nodes)),
        back_bytes_(bytes_back(nodes)) {
    dds::Domain::set_hook(up_, hook_);
    for (std::uint32_t node = 0; node < nodes; ++node) {
      auto& spoke = spokes_.emplace_back(std::make_unique<Spoke>(domain_, node + 1));
      std::string arguments_text[] = {RINGFENCE_PEER, std::to_string(domain_.number()), std::to_string(node + 1),
                                      std::to_string(nodes)};
      char* arguments[] = {arguments_text[0].data(), arguments_text[1].data(), arguments_text[2].data(),
                           arguments_text[3].data(), nullptr};
      if (posix_spawn(&spoke->process, RINGFENCE_PEER, nullptr, nullptr, arguments, environ) != 0) std::abort();
    }
  }
  ~Star() {
    for (const auto& spoke : spokes_) {
      spoke->parcel_channel.enqueue(dds::ParcelKind::dismissed, {});
      spoke->parcel_channel.flush();
    }
    for (const auto& spoke : spokes_) {
      int status = 0;
      for (int turn = 0; turn < 500 && waitpid(spoke->process, &status, WNOHANG) == 0; ++turn) usleep(10'000);
      kill(spoke->process, SIGKILL);
    }
  }

  bool wait_for_nodes() {
    for (int turn = 0; turn < 20'000; ++turn) {
      bool all = true;
      for (const auto& spoke : spokes_) {
        dds_publication_matched_status_t matched{};
        dds_get_publication_matched_status(spoke->writer.get(), &matched);
        all &= matched.current_count > 0;
      }
      dds_subscription_matched_status_t matched{};
      dds_get_subscription_matched_status(up_.get(), &matched);
      if (all && matched.current_count == spokes_.size()) return true;
      usleep(1000);
    }
    return false;
  }

  /// Runs one stage; false if a reply does not arrive.
  bool step() {
    for (const auto& spoke : spokes_) {
      link::Sender& out = *spoke->channel.first().out;
      for (std::size_t sent = 0; sent < out_bytes_;) {
        const std::size_t bytes = std::min(out_bytes_ - sent, out.largest_message());
        const auto room = out.claim(bytes);
        if (room.empty()) {
          carry(*spoke);
          continue;
        }
        out.commit(bytes);
        sent += bytes;
      }
      out.publish();
      carry(*spoke);
    }
    const std::size_t awaited = spokes_.size() * back_bytes_;
    const bool all = bell_.wait_for(
        [&] {
          if (came_.exchange(false, std::memory_order_acquire)) take();
          return received_bytes_ >= awaited;
        },
        std::chrono::seconds(5));
    received_bytes_ = 0;
    return all;
  }

 private:
  struct Spoke {
    Spoke(dds::Domain& domain, std::uint64_t incarnation)
        : writer(domain.writer(dds::Topic::down, dds::parcel_qos, dds::partition_of(incarnation))),
          parcel_channel(writer.get(), incarnation),
          channel(std::size_t{1} << 16, nullptr, nullptr) {}
    dds::Entity writer;
    dds::ParcelChannel parcel_channel;
    facade::DuplexChannel channel;
    pid_t process = 0;
  };

  static dds::NetworkConfig network() {
    dds::NetworkConfig network;
    network.domain = dds::NetworkConfig::any_domain;
    network.interface = "lo";
    return network;
  }

  void carry(Spoke& spoke) {
    spoke.parcel_channel.gather(*spoke.channel.second().in);
    spoke.parcel_channel.flush();
  }

  void take() {
    dds::take_all<dds::ParcelSample>(up_, [&](const dds::ParcelSample& parcel, const dds_sample_info_t& info) {
      if (!info.valid_data) return;
      auto show = [&](dds::ParcelKind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
        return dds::for_each_message(bytes, offset, [&](std::span<const std::byte> message) {
          benchmark::DoNotOptimize(message.data());
          received_bytes_ += message.size();
          return true;
        });
      };
      spokes_[parcel.incarnation - 1]->parcel_channel.receive(parcel, show);
    });
  }

  link::Doorbell bell_{link::SpinPolicy{20, 2}};
  std::atomic<bool> came_{false};
  dds::Domain::Hook hook_;
  dds::Domain domain_;
  dds::Entity up_;
  std::vector<std::unique_ptr<Spoke>> spokes_;
  std::size_t out_bytes_;
  std::size_t back_bytes_;
  std::size_t received_bytes_ = 0;
};

/// The star with that number of nodes, or null if they do not start. Kept until another number is requested: the
/// library calls a benchmark several times, and starting 64 processes takes seconds.
Star* star_of(std::uint32_t nodes) {
  static std::unique_ptr<Star> star;
  static std::uint32_t size = 0;
  if (size != nodes) {
    star.reset();
    star = std::make_unique<Star>(nodes);
    size = nodes;
    if (!star->wait_for_nodes()) {
      star.reset();
      return nullptr;
    }
    for (int turn = 0; turn < 50; ++turn) star->step();
  }
  return star.get();
}

void star(benchmark::State& state) {
  Star* star = star_of(static_cast<std::uint32_t>(state.range(0)));
  if (star == nullptr) {
    state.SkipWithError("the processes do not come");
    return;
  }
  for (auto _ : state) {
    if (!star->step()) {
      state.SkipWithError("an answer does not come");
      return;
    }
  }
}
BENCHMARK(star)
    ->Name("dds/star")
    ->Arg(1)
    ->Arg(4)
    ->Arg(16)
    ->Arg(64)
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime()
    ->MinTime(1.0);

}  // namespace
}  // namespace ringfence::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  return ringfence::bench::run_benchmarks();
}
