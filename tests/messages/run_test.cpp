#include "messages/run.hpp"

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "link/channel.hpp"
#include "messages/records.hpp"

namespace ringfence::messages {
namespace {

constexpr std::size_t ring_bytes = 4096;

/// Writes record i of a run: bytes that no other record has.
void fill_record(std::uint64_t run, std::size_t i, std::size_t bytes_each, std::byte* out) {
  std::mt19937_64 random(run * 1'000'003 + i);
  for (std::size_t k = 0; k < bytes_each; ++k) {
    out[k] = static_cast<std::byte>(random());
  }
}

/// The received part of a run.
struct Received {
  std::vector<std::byte> bytes;
  std::size_t messages = 0;
  std::size_t records = 0;
  std::size_t longest = 0;
  bool ended = false;
  std::uint64_t total = 0;
};

/// Reads and releases the available messages, at most `max_messages` of them.
void receive(link::Receiver& link, std::size_t state_bytes, Received& received,
             std::size_t max_messages = ~std::size_t{0}) {
  for (std::size_t n = 0; n < max_messages; ++n) {
    const auto bytes = link.next();
    if (bytes.empty()) {
      break;
    }
    MessageView message;
    REQUIRE(decode(bytes, state_bytes, message) == Status::ok);
    REQUIRE_FALSE(received.ended);
    ++received.messages;
    received.records += message.count();
    received.longest = std::max(received.longest, bytes.size());
    received.bytes.insert(received.bytes.end(), bytes.begin() + sizeof(Header), bytes.end());
    received.ended = message.last();
    received.total = message.header().total;
    CHECK((message.last() || message.header().total == 0));
  }
  link.release();
}

std::vector<std::byte> expected_bytes(std::uint64_t run, std::size_t total, std::size_t bytes_each) {
  std::vector<std::byte> bytes(total * bytes_each);
  for (std::size_t i = 0; i < total; ++i) {
    fill_record(run, i, bytes_each, bytes.data() + i * bytes_each);
  }
  return bytes;
}

TEST_CASE("a run of any length passes the smallest ring complete and in order, and states its length") {
  constexpr unsigned seed = 77;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  link::Channel channel(ring_bytes, nullptr, nullptr);
  std::uint64_t run = 0;
  for (const std::size_t state_bytes : {0u, 8u, 256u}) {
    for (const MessageType type :
         {MessageType::adopt, MessageType::drop, MessageType::state_update, MessageType::notify, MessageType::collision,
          MessageType::pairs, MessageType::frame_done}) {
      for (const std::size_t total : {0u, 1u, 2u, 5u, 13u, 14u, 15u, 16u, 100u, 1000u}) {
        CAPTURE(name_of(type));
        CAPTURE(total);
        const std::size_t each = record_bytes(type, state_bytes);
        ++run;
        RunSender sender;
        TrafficCounts counts{};
        Received received;
        sender.start(total);
        REQUIRE_FALSE(sender.done());
        const RunHeader run_header{type, Endpoint::user(9), Endpoint::server(), run, 4};
        std::size_t filled = 0;
        const auto fill = [&](std::size_t i, std::byte* out) {
          REQUIRE(i == filled++);  // each record once, in order
          fill_record(run, i, each, out);
        };
        int waits = 0;
        while (!sender.pump(channel.sender(), run_header, each, counts, fill)) {
          receive(channel.receiver(), state_bytes, received, 1 + random() % 3);
          REQUIRE(++waits < 10000);
        }
        CHECK(sender.done());
        CHECK(sender.pump(channel.sender(), run_header, each, counts, fill));  // a finished run sends nothing more
        receive(channel.receiver(), state_bytes, received);
        CHECK(received.ended);
        CHECK(received.total == total);
        CHECK(received.records == total);
        CHECK((received.bytes == expected_bytes(run, total, each)));
        CHECK(received.longest <= channel.sender().largest_message());
        const TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(type))];
        CHECK(traffic.messages == received.messages);
        CHECK(traffic.records == total);
        CHECK(traffic.bytes == received.bytes.size() + received.messages * sizeof(Header));
        if (total * each > 2 * ring_bytes) {
          CHECK(waits > 0);  // the sender had to wait for room
        }
      }
    }
  }
}

TEST_CASE("the receiver gets the sent part of a run before the run is finished") {
  link::Channel channel(ring_bytes, nullptr, nullptr);
  RunSender sender;
  TrafficCounts counts{};
  sender.start(1000);
  const RunHeader run_header{MessageType::notify, Endpoint::server(), Endpoint::user(0), 0, 1};
  REQUIRE_FALSE(sender.pump(channel.sender(), run_header, sizeof(Contact), counts,
                            [](std::size_t, std::byte* out) { std::memset(out, 0, sizeof(Contact)); }));
  Received received;
  receive(channel.receiver(), 0, received);
  CHECK(received.records > 0);
  CHECK(received.records == counts[static_cast<std::size_t>(Traffic::m4)].records);
  CHECK_FALSE(received.ended);
}

TEST_CASE("a run written record by record passes the smallest ring complete and in order, and states its length") {
  constexpr unsigned seed = 78;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  link::Channel channel(ring_bytes, nullptr, nullptr);
  std::uint64_t run = 1000;
  for (const std::size_t message_bytes : {200u, 1000u, 65536u}) {
    RunWriter writer(message_bytes);
    for (const MessageType type : {MessageType::pairs, MessageType::collision, MessageType::node_state}) {
      for (const std::size_t total : {0u, 1u, 2u, 3u, 19u, 20u, 21u, 100u, 1000u}) {
        CAPTURE(message_bytes);
        CAPTURE(name_of(type));
        CAPTURE(total);
        const std::size_t each = record_bytes(type, 16);
        const RunHeader run_header{type, Endpoint::node(9), Endpoint::server(), ++run, 4};
        TrafficCounts counts{};
        Received received;
        writer.start();
        for (std::size_t i = 0; i < total;) {
          if (std::byte* out = writer.add(channel.sender(), run_header, each, counts)) {
            fill_record(run, i++, each, out);
          } else {
            const std::size_t before = received.records;
            receive(channel.receiver(), 16, received, 1 + random() % 3);
            REQUIRE(
                received.records >
                before);  // all earlier records are published; otherwise sender and receiver would wait for each other
          }
        }
        while (!writer.finish(channel.sender(), run_header, each, counts)) {
          REQUIRE_FALSE(writer.done());
          receive(channel.receiver(), 16, received, 1);
        }
        CHECK(writer.done());
        CHECK(writer.total() == total);
        CHECK(writer.finish(channel.sender(), run_header, each, counts));  // a finished run sends nothing more
        receive(channel.receiver(), 16, received);
        CHECK(received.ended);
        CHECK(received.total == total);
        CHECK(received.records == total);
        CHECK((received.bytes == expected_bytes(run, total, each)));
        CHECK(received.longest <= std::min(message_bytes, channel.sender().largest_message()));
        const TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(type))];
        CHECK(traffic.messages == received.messages);
        CHECK(traffic.records == total);
        CHECK(traffic.bytes == received.bytes.size() + received.messages * sizeof(Header));
      }
    }
  }
}

TEST_CASE("consecutive runs on one channel do not mix") {
  link::Channel channel(ring_bytes, nullptr, nullptr);
  RunSender first, second;
  TrafficCounts counts{};
  first.start(60);
  second.start(0);
  const RunHeader drop{MessageType::drop, Endpoint::server(), Endpoint::node(1), 3, 1};
  const RunHeader begin{MessageType::frame_begin, Endpoint::server(), Endpoint::node(1), 3, 1};
  const auto fill = [](std::size_t i, std::byte* out) { fill_record(5, i, sizeof(DropRecord), out); };
  REQUIRE(first.pump(channel.sender(), drop, sizeof(DropRecord), counts, fill));
  REQUIRE(second.pump(channel.sender(), begin, 0, counts, fill));
  std::vector<MessageType> types;
  Received received;
  for (auto bytes = channel.receiver().next(); !bytes.empty(); bytes = channel.receiver().next()) {
    MessageView message;
    REQUIRE(decode(bytes, 0, message) == Status::ok);
    types.push_back(message.type());
    CHECK(message.header().source == Endpoint::server().value);
    CHECK(message.header().destination == Endpoint::node(1).value);
    CHECK(message.header().frame == 3);
    CHECK(message.last());
    CHECK(message.header().total == message.count());
  }
  CHECK((types == std::vector{MessageType::drop, MessageType::frame_begin}));
}

}  // namespace
}  // namespace ringfence::messages
