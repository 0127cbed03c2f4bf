#include "nodes/tapped_channel.hpp"

#include <algorithm>
#include <utility>

#include <doctest/doctest.h>

namespace ringfence::nodes::test {

bool TappedChannel::pass(const Tamper& tamper, std::vector<LoggedMessage>& log, std::size_t most) {
  bool any = false;
  for (std::size_t passed = 0; passed < most; ++passed) {
    const auto bytes = near_.receiver().next();
    if (bytes.empty()) {
      break;
    }
    any = true;
    LoggedMessage seen{from_, to_, {}, {bytes.begin(), bytes.end()}};
    REQUIRE(bytes.size() >= sizeof(messages::Header));
    std::memcpy(&seen.header, bytes.data(), sizeof seen.header);
    std::vector<std::vector<std::byte>> instead{seen.bytes};
    if (tamper) {
      tamper(seen, instead);
    }
    for (const auto& message : instead) {
      forge(message);
    }
    log.push_back(std::move(seen));
  }
  if (any) {
    near_.receiver().release();
  }
  return any;
}

void TappedChannel::forge(std::span<const std::byte> message) {
  const auto room = far_.sender().claim(message.size());
  REQUIRE(room.size() == message.size());
  std::copy(message.begin(), message.end(), room.begin());
  far_.sender().commit(message.size());
  far_.sender().publish();
}

}  // namespace ringfence::nodes::test
