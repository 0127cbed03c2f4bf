// A node of the star: replies to each parcel. Arguments: domain, incarnation, number of nodes.
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <vector>

#include "dds/domain.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/star.hpp"
#include "facade/duplex_channel.hpp"
#include "link/doorbell.hpp"
#include "link/scoped_batch_scheduling.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 4) return 2;
  dds::NetworkConfig network;
  network.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  network.interface = "lo";
  const auto incarnation = static_cast<std::uint64_t>(std::atoll(argv[2]));
  const auto nodes = static_cast<std::size_t>(std::atoi(argv[3]));
  const std::size_t expected = bench::bytes_out(nodes);
  const std::size_t back = bench::bytes_back(nodes);

  dds::Domain domain(network, dds::Side::node);
  const link::ScopedBatchScheduling batch_scheduling;
  link::Doorbell bell(link::SpinPolicy{20, 2});
  std::atomic<bool> came{false};
  const dds::Domain::Hook hook{[&] {
                                 came.store(true, std::memory_order_release);
                                 bell.ring();
                               },
                               [] {}};
  const dds::Entity up = domain.writer(dds::Topic::up, dds::parcel_qos, {});
  const dds::Entity down = domain.reader(dds::Topic::down, dds::parcel_qos, dds::partition_of(incarnation));
  dds::Domain::set_hook(down, hook);
  dds::ParcelChannel parcel_channel(up.get(), incarnation);
  facade::DuplexChannel channel(std::size_t{1} << 16, nullptr, nullptr);
  link::Sender& out = *channel.second().out;
  bool last = false;
  std::size_t received = 0;
  auto show = [&](dds::ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
    last = kind == dds::ParcelKind::dismissed;
    dds::for_each_message(bytes, offset, [&](std::span<const std::byte> message) {
      received += message.size();
      return true;
    });
    for (std::size_t sent = 0; received >= expected && sent < back;) {
      const std::size_t size = std::min(back - sent, out.largest_message());
      const auto room = out.claim(size);
      if (room.empty()) {
        parcel_channel.gather(*channel.first().in);
        parcel_channel.flush();
        continue;
      }
      out.commit(size);
      sent += size;
    }
    received = received >= expected ? 0 : received;
    out.publish();
    return true;
  };
  while (!last) {
    const bool rung = bell.wait_for([&] { return came.load(std::memory_order_relaxed); }, std::chrono::seconds(20));
    if (!rung) return 1;  // the server process is gone
    came.exchange(false, std::memory_order_acquire);
    dds::take_all<dds::ParcelSample>(down, [&](const dds::ParcelSample& parcel, const dds_sample_info_t& info) {
      if (info.valid_data && !parcel_channel.receive(parcel, show)) last = true;
    });
    parcel_channel.gather(*channel.first().in);
    parcel_channel.flush();
  }
  return 0;
}
