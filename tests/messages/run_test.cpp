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

constexpr std::size_t tiny = 4096;

/// Record i of a run, filled with bytes that no other record has.
void fill_record(std::uint64_t run, std::size_t i, std::size_t bytes_each, std::byte* where) {
  std::mt19937_64 random(run * 1'000'003 + i);
  for (std::size_t k = 0; k < bytes_each; ++k) {
    where[k] = static_cast<std::byte>(random());
  }
}

/// What arrived of one run.
struct Arrived {
  std::vector<std::byte> bytes;
  std::size_t messages = 0;
  std::size_t records = 0;
  std::size_t longest = 0;
  bool ended = false;
  std::uint64_t total = 0;
};

/// Takes what is in the link, at most `most` messages, and releases it.
void take(link::Receiver& link, std::size_t state_bytes, Arrived& arrived, std::size_t most = ~std::size_t{0}) {
  for (std::size_t n = 0; n < most; ++n) {
    const auto bytes = link.next();
    if (bytes.empty()) {
      break;
    }
    MessageView message;
    REQUIRE(decode(bytes, state_bytes, message) == Status::ok);
    REQUIRE_FALSE(arrived.ended);
    ++arrived.messages;
    arrived.records += message.count();
    arrived.longest = std::max(arrived.longest, bytes.size());
    arrived.bytes.insert(arrived.bytes.end(), bytes.begin() + sizeof(Header), bytes.end());
    arrived.ended = message.last();
    arrived.total = message.header().total;
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

TEST_CASE("a run of any length goes through the smallest ring whole, in order, and says how long it was") {
  constexpr unsigned seed = 77;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  link::Channel channel(tiny, nullptr, nullptr);
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
        Arrived arrived;
        sender.start(total);
        REQUIRE_FALSE(sender.done());
        const RunHeader head{type, Endpoint::user(9), Endpoint::server(), run, 4};
        std::size_t filled = 0;
        const auto fill = [&](std::size_t i, std::byte* where) {
          REQUIRE(i == filled++);  // each record once, in order
          fill_record(run, i, each, where);
        };
        int stops = 0;
        while (!sender.pump(channel.sender(), head, each, counts, fill)) {
          take(channel.receiver(), state_bytes, arrived, 1 + random() % 3);
          REQUIRE(++stops < 10000);
        }
        CHECK(sender.done());
        CHECK(sender.pump(channel.sender(), head, each, counts, fill));  // a finished run sends nothing more
        take(channel.receiver(), state_bytes, arrived);
        CHECK(arrived.ended);
        CHECK(arrived.total == total);
        CHECK(arrived.records == total);
        CHECK((arrived.bytes == expected_bytes(run, total, each)));
        CHECK(arrived.longest <= channel.sender().largest_message());
        const TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(type))];
        CHECK(traffic.messages == arrived.messages);
        CHECK(traffic.records == total);
        CHECK(traffic.bytes == arrived.bytes.size() + arrived.messages * sizeof(Header));
        if (total * each > 2 * tiny) {
          CHECK(stops > 0);  // it did have to wait for room
        }
      }
    }
  }
}

TEST_CASE("what a sender could send is there for the receiver although the run is not finished") {
  link::Channel channel(tiny, nullptr, nullptr);
  RunSender sender;
  TrafficCounts counts{};
  sender.start(1000);
  const RunHeader head{MessageType::notify, Endpoint::server(), Endpoint::user(0), 0, 1};
  REQUIRE_FALSE(sender.pump(channel.sender(), head, sizeof(Contact), counts,
                            [](std::size_t, std::byte* where) { std::memset(where, 0, sizeof(Contact)); }));
  Arrived arrived;
  take(channel.receiver(), 0, arrived);
  CHECK(arrived.records > 0);
  CHECK(arrived.records == counts[static_cast<std::size_t>(Traffic::m4)].records);
  CHECK_FALSE(arrived.ended);
}

TEST_CASE("a run written record by record goes through the smallest ring whole, in order, and says how long it was") {
  constexpr unsigned seed = 78;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  link::Channel channel(tiny, nullptr, nullptr);
  std::uint64_t run = 1000;
  for (const std::size_t message_bytes : {200u, 1000u, 65536u}) {
    RunWriter writer(message_bytes);
    for (const MessageType type : {MessageType::pairs, MessageType::collision, MessageType::node_state}) {
      for (const std::size_t total : {0u, 1u, 2u, 3u, 19u, 20u, 21u, 100u, 1000u}) {
        CAPTURE(message_bytes);
        CAPTURE(name_of(type));
        CAPTURE(total);
        const std::size_t each = record_bytes(type, 16);
        const RunHeader head{type, Endpoint::node(9), Endpoint::server(), ++run, 4};
        TrafficCounts counts{};
        Arrived arrived;
        writer.start();
        for (std::size_t i = 0; i < total;) {
          if (std::byte* where = writer.add(channel.sender(), head, each, counts)) {
            fill_record(run, i++, each, where);
          } else {
            const std::size_t before = arrived.records;
            take(channel.receiver(), 16, arrived, 1 + random() % 3);
            REQUIRE(arrived.records > before);  // what was written before is there, or nobody gets on
          }
        }
        while (!writer.finish(channel.sender(), head, each, counts)) {
          REQUIRE_FALSE(writer.done());
          take(channel.receiver(), 16, arrived, 1);
        }
        CHECK(writer.done());
        CHECK(writer.total() == total);
        CHECK(writer.finish(channel.sender(), head, each, counts));  // a finished run sends nothing more
        take(channel.receiver(), 16, arrived);
        CHECK(arrived.ended);
        CHECK(arrived.total == total);
        CHECK(arrived.records == total);
        CHECK((arrived.bytes == expected_bytes(run, total, each)));
        CHECK(arrived.longest <= std::min(message_bytes, channel.sender().largest_message()));
        const TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(type))];
        CHECK(traffic.messages == arrived.messages);
        CHECK(traffic.records == total);
        CHECK(traffic.bytes == arrived.bytes.size() + arrived.messages * sizeof(Header));
      }
    }
  }
}

TEST_CASE("runs follow each other on one link without mixing") {
  link::Channel channel(tiny, nullptr, nullptr);
  RunSender first, second;
  TrafficCounts counts{};
  first.start(60);
  second.start(0);
  const RunHeader drop{MessageType::drop, Endpoint::server(), Endpoint::node(1), 3, 1};
  const RunHeader begin{MessageType::frame_begin, Endpoint::server(), Endpoint::node(1), 3, 1};
  const auto fill = [](std::size_t i, std::byte* where) { fill_record(5, i, sizeof(DropRecord), where); };
  REQUIRE(first.pump(channel.sender(), drop, sizeof(DropRecord), counts, fill));
  REQUIRE(second.pump(channel.sender(), begin, 0, counts, fill));
  std::vector<MessageType> types;
  Arrived arrived;
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
