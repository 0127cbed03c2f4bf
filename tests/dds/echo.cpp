// A process that sends back every message it receives. Arguments: TCP port; name of a local socket, which is tried
// first; whether to share memory then; milliseconds between two polls. It ends with 0 after it has sent back the end
// marker, and with 1 if the channel breaks or after 60 s.
#include <chrono>
#include <cstdlib>
#include <thread>

#include "dds/channel_end.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 5) return 2;
  test::ChannelEnd side(dds::LinkStream::connect({test::loopback, static_cast<std::uint32_t>(std::atoi(argv[1]))},
                                                 std::strtoull(argv[2], nullptr, 10),
                                                 std::atoi(argv[3]) != 0 ? test::small_rings : test::no_rings));
  const auto pause = std::chrono::milliseconds(std::atoi(argv[4]));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  bool last = false;
  while (std::chrono::steady_clock::now() < end && !side.parcel_channel().is_broken()) {
    side.step();
    for (;;) {
      if (last) break;
      // Claim room first: a message that was taken out of the ring cannot be put back.
      const auto room = side.out().claim(side.out().largest_message());
      if (room.empty()) break;
      const auto message = side.in().next();
      if (message.empty()) break;
      std::copy(message.begin(), message.end(), room.begin());
      side.out().commit(message.size());
      last = message.size() == 1 && message[0] == test::end_marker;
    }
    side.in().release();
    side.out().publish();
    side.step();
    if (last && !side.parcel_channel().has_unsent()) return 0;
    std::this_thread::sleep_for(pause);
  }
  return 1;
}
