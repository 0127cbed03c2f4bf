#include "nodes/exchange/server/direct_records.hpp"

#include <algorithm>
#include <map>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "messages/run.hpp"

namespace ringfence::nodes {
namespace {

using messages::CountRecord;
using messages::Endpoint;
using messages::MessageType;

/// A `ghost_counts` message of one node.
struct Message {
  Message(NodeNumber sender, const std::vector<CountRecord>& records)
      : bytes(sizeof(messages::Header) + 8 * records.size()) {
    messages::write_header(bytes.data(), {MessageType::ghost_counts, Endpoint::node(sender), Endpoint::server(), 0, 1},
                           sizeof(CountRecord), records.size(), true, records.size());
    std::ranges::copy(std::as_bytes(std::span(records)), bytes.begin() + sizeof(messages::Header));
    REQUIRE(messages::decode(bytes, 0, view) == Status::ok);
  }
  std::vector<std::byte> bytes;
  messages::MessageView view;
};

}  // namespace

TEST_CASE("the records for a receiver are those of all senders together, without those of a lost sender") {
  std::mt19937 random(4);
  DirectRecords direct;
  for (int round = 0; round < 50; ++round) {
    const auto slots = static_cast<NodeNumber>(1 + random() % 6);
    direct.start(slots);
    std::map<std::pair<NodeNumber, NodeNumber>, std::uint32_t> expected;
    for (NodeNumber sender = 0; sender < slots; ++sender) {
      std::vector<CountRecord> records;
      for (NodeNumber receiver = 0; receiver < slots; ++receiver) {
        if (receiver != sender && random() % 2 == 0) {
          records.push_back({receiver, 1 + static_cast<std::uint32_t>(random() % 100)});
          expected[{sender, receiver}] = records.back().count;
        }
      }
      REQUIRE(direct.add(sender, Message(sender, records).view));
    }
    const auto lost = static_cast<NodeNumber>(random() % slots);
    for (const bool removed : {false, true}) {
      if (removed) direct.remove(lost);
      for (NodeNumber receiver = 0; receiver < slots; ++receiver) {
        std::uint64_t sum = 0;
        for (NodeNumber sender = 0; sender < slots; ++sender) {
          const std::uint32_t count = removed && sender == lost ? 0 : expected[{sender, receiver}];
          CHECK(direct.between(sender, receiver) == count);
          sum += count;
        }
        CHECK(direct.to(receiver) == sum);
      }
    }
  }
}

TEST_CASE("a retracted record does not count, and no more are retracted than a sender has reported") {
  DirectRecords direct;
  direct.start(3);
  REQUIRE(direct.add(0, Message(0, {{1, 2}, {2, 5}}).view));
  REQUIRE(direct.add(2, Message(2, {{1, 1}}).view));
  direct.retract(0, 1);
  CHECK(direct.between(0, 1) == 1);
  CHECK(direct.to(1) == 2);
  direct.retract(0, 1);
  direct.retract(0, 1);
  CHECK(direct.between(0, 1) == 0);
  CHECK(direct.to(1) == 1);
  CHECK(direct.to(2) == 5);
}

TEST_CASE("counts for a slot that does not exist, for the sender itself, of zero or for a slot twice are refused") {
  DirectRecords direct;
  const std::vector<std::vector<CountRecord>> invalid = {{{3, 1}}, {{1, 1}}, {{0, 0}}, {{0, 1}, {0, 2}}};
  for (const auto& records : invalid) {
    direct.start(3);
    CHECK_FALSE(direct.add(1, Message(1, records).view));
    for (NodeNumber receiver = 0; receiver < 3; ++receiver) CHECK(direct.to(receiver) == 0);
  }
}

}  // namespace ringfence::nodes
