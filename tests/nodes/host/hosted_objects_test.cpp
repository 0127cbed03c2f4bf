#include "nodes/host/hosted_objects.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "messages/run.hpp"
#include "nodes/host/host_records.hpp"

namespace ringfence::nodes {
namespace {

TEST_CASE("an object that a host adopts twice is there once, in its last state") {
  HostedObjects host(4, 16);
  const std::uint64_t first[2] = {1, 2}, second[2] = {3, 4};
  host.adopt(record_of(5), reinterpret_cast<const std::byte*>(first));
  host.adopt(record_of(6), reinterpret_cast<const std::byte*>(first));
  messages::HandOverRecord again = record_of(5);
  again.pose.position.x = 77;
  host.adopt(again, reinterpret_cast<const std::byte*>(second));
  REQUIRE(host.size() == 2);
  const std::uint32_t at = host.find(5);
  REQUIRE(at != base::NumberIndex::none);
  CHECK(host[at].pose.position.x == 77);
  CHECK(std::memcmp(host.state(at), second, sizeof second) == 0);
  host.drop(5);
  CHECK(host.size() == 1);
  CHECK(host.find(5) == base::NumberIndex::none);
  CHECK(host[host.find(6)].object.number == 6);
}

TEST_CASE("adopting and dropping in any order keeps every object with its own state") {
  for (const std::size_t bytes : {0u, 16u, 8u}) {
    const unsigned seed = 40 + static_cast<unsigned>(bytes);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    HostedObjects host(2, bytes);
    REQUIRE(host.state_bytes() == bytes);
    std::map<ObjectNumber, std::vector<std::byte>> expected;
    for (int round = 0; round < 6000; ++round) {
      const auto number = static_cast<ObjectNumber>(1 + random() % 120);
      if (expected.count(number) == 0 || random() % 4 == 0) {  // adopting an object that is hosted already replaces it
        std::vector<std::byte> state(host.state_bytes());
        for (std::byte& byte : state) byte = static_cast<std::byte>(random());
        host.adopt(record_of(number), state.data());
        expected[number] = state;
      } else {
        const messages::HandOverRecord record = host.hand_over(host.find(number));
        const messages::HandOverRecord original = record_of(number);
        REQUIRE(std::memcmp(&record, &original, sizeof record) == 0);
        host.drop(number);
        expected.erase(number);
        REQUIRE(host.find(number) == base::NumberIndex::none);
      }
      host.drop(1000);  // never hosted
      REQUIRE(host.size() == expected.size());
      if (round % 50 == 0) {
        for (const auto& [known, state] : expected) {
          REQUIRE(host[host.find(known)].user_data == known * std::uint64_t{1000});
          REQUIRE(std::equal(state.begin(), state.end(), host.state(host.find(known))));
        }
      }
    }
  }
}

TEST_CASE("a hand-over is not applied as a message of the server") {
  HostedObjects host(0, 0);
  const messages::HandOverRecord record = record_of(5);
  std::vector<std::byte> bytes(sizeof(messages::Header) + sizeof record);
  std::memcpy(bytes.data() + sizeof(messages::Header), &record, sizeof record);
  for (const auto type : {messages::MessageType::hand_over, messages::MessageType::adopt}) {
    const messages::RunHeader head{type, messages::Endpoint::node(1), messages::Endpoint::node(0), 0, 0};
    messages::write_header(bytes.data(), head, sizeof record, 1, true, 1);
    messages::MessageView message;
    REQUIRE(messages::decode(bytes, 0, message) == Status::ok);
    const bool by_server = type == messages::MessageType::adopt;
    CHECK(host.apply(message) == by_server);
    CHECK(host.size() == (by_server ? 1 : 0));
  }
  host.drop(5);
  messages::write_header(
      bytes.data(), {messages::MessageType::hand_over, messages::Endpoint::node(1), messages::Endpoint::node(0), 0, 0},
      sizeof record, 1, true, 1);
  messages::MessageView message;
  REQUIRE(messages::decode(bytes, 0, message) == Status::ok);
  host.adopt(message);
  CHECK(host[host.find(5)].user_data == record.user_data);
}

TEST_CASE("an index that was right before is tried first, and a wrong one is corrected") {
  HostedObjects host(4, 0);
  for (const ObjectNumber number : {5u, 6u, 7u}) host.adopt(record_of(number), nullptr);
  host.drop(5);  // 7 takes its index
  CHECK(host.find(7, 0) == 0);
  CHECK(host.find(7, 2) == 0);
  CHECK(host.find(6, 1) == 1);
  CHECK(host.find(5, 0) == base::NumberIndex::none);
  CHECK(host.find(6, base::NumberIndex::none) == 1);
}

}  // namespace
}  // namespace ringfence::nodes
