// One stage of a frame on one machine: a server sends messages to each of n processes and waits for all replies. The
// path is that of the bridge and a node: ring, parcel, link, and back.
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dds/link_events.hpp"
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
      : listener_(dds::LinkSocket::listen_locally(static_cast<std::uint64_t>(getpid()))),
        out_bytes_(bytes_out(nodes)),
        back_bytes_(bytes_back(nodes)) {
    if (!listener_ || !bell_.prepare_to_watch()) std::abort();
    bell_.watch(events_.descriptor());
    for (std::uint32_t node = 0; node < nodes; ++node) {
      std::string arguments_text[] = {RINGFENCE_PEER, std::to_string(getpid()), std::to_string(nodes)};
      char* arguments[] = {arguments_text[0].data(), arguments_text[1].data(), arguments_text[2].data(), nullptr};
      if (posix_spawn(&processes_.emplace_back(), RINGFENCE_PEER, nullptr, nullptr, arguments, environ) != 0) {
        std::abort();
      }
    }
  }
  ~Star() {
    for (const auto& spoke : spokes_) {
      spoke->parcel_channel.enqueue(dds::ParcelKind::dismissed, {});
      spoke->parcel_channel.flush();
    }
    for (const pid_t process : processes_) {
      int status = 0;
      for (int turn = 0; turn < 500 && waitpid(process, &status, WNOHANG) == 0; ++turn) usleep(10'000);
      kill(process, SIGKILL);
    }
  }

  bool wait_for_nodes() {
    for (int turn = 0; turn < 20'000 && spokes_.size() < processes_.size(); ++turn) {
      if (dds::LinkSocket socket = listener_.accept()) {
        auto& spoke =
            spokes_.emplace_back(std::make_unique<Spoke>(dds::LinkStream::accepted_locally(std::move(socket))));
        spoke->parcel_channel.report_to(events_, spokes_.size() - 1);
      } else {
        usleep(1000);
      }
    }
    return spokes_.size() == processes_.size();
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
          while (received_bytes_ < awaited && !take_all()) {
          }
          return received_bytes_ >= awaited;
        },
        std::chrono::seconds(5));
    received_bytes_ = 0;
    return all;
  }

 private:
  struct Spoke {
    explicit Spoke(dds::LinkStream link)
        : parcel_channel(std::move(link)), channel(std::size_t{1} << 16, nullptr, nullptr) {}
    dds::ParcelChannel parcel_channel;
    facade::DuplexChannel channel;
  };

  void carry(Spoke& spoke) {
    spoke.parcel_channel.gather(*spoke.channel.second().in);
    spoke.parcel_channel.flush();
  }

  /// Returns whether the thread may sleep.
  bool take_all() {
    events_.take([this](std::uint64_t spoke) { spokes_[spoke]->parcel_channel.note_events(); });
    bool is_idle = true;
    for (const auto& spoke : spokes_) {
      spoke->parcel_channel.disarm();
      take(*spoke);
      // A link takes nothing before the node has accepted its memory.
      if (spoke->parcel_channel.has_unsent()) spoke->parcel_channel.flush();
      is_idle &= spoke->parcel_channel.arm();
    }
    return is_idle;
  }

  void take(Spoke& spoke) {
    auto show = [&](dds::ParcelKind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
      return dds::for_each_message(bytes, offset, [&](std::span<const std::byte> message) {
        benchmark::DoNotOptimize(message.data());
        received_bytes_ += message.size();
        return true;
      });
    };
    spoke.parcel_channel.receive(show);
  }

  link::Doorbell bell_;
  dds::LinkSocket listener_;
  dds::LinkEvents events_;
  std::vector<pid_t> processes_;
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
