// A node of the star: replies when the bytes of a stage have arrived. Arguments: name of the server's local socket,
// number of nodes.
#include <chrono>
#include <cstdlib>
#include <vector>

#include "dds/link_events.hpp"
#include "dds/parcel_channel.hpp"
#include "dds/star.hpp"
#include "facade/duplex_channel.hpp"
#include "link/doorbell.hpp"
#include "link/scoped_batch_scheduling.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 3) return 2;
  constexpr dds::LinkStream::RingBytes rings{std::size_t{1} << 20, std::size_t{1} << 18};
  const auto nodes = static_cast<std::size_t>(std::atoi(argv[2]));
  const std::size_t expected = bench::bytes_out(nodes);
  const std::size_t back = bench::bytes_back(nodes);

  const link::ScopedBatchScheduling batch_scheduling;
  dds::ParcelChannel parcel_channel(dds::LinkStream::connect({}, std::strtoull(argv[1], nullptr, 10), rings));
  const dds::LinkEvents events;
  parcel_channel.report_to(events, 0);
  link::Doorbell bell;
  if (!bell.prepare_to_watch()) return 3;
  bell.watch(events.descriptor());
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
  while (!last && !parcel_channel.is_broken()) {
    const auto has_work = [&] {
      return events.take([&](std::uint64_t) { parcel_channel.note_events(); }) || !parcel_channel.arm();
    };
    if (!bell.wait_for(has_work, std::chrono::seconds(20))) return 1;  // the server process is gone
    parcel_channel.disarm();
    parcel_channel.receive(show);
    parcel_channel.gather(*channel.first().in);
    parcel_channel.flush();
  }
  return 0;
}
