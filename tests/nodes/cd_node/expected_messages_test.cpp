#include "nodes/cd_node/expected_messages.hpp"

#include <map>
#include <set>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"
#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

using Stage = CdNodeStage;

TEST_CASE("each message of the server is accepted in its stages of the frame only") {
  NodeFixture fixture({.placement = Placement::server, .shares_memory = false});
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  fixture.state().await_positions();
  fixture.state().own_contacts.begun.push_back(1);
  const std::vector<messages::OwnerRecord> owners(64, messages::OwnerRecord{1, 0});
  Contact contact;
  contact.a = 1;
  contact.b = 2;
  messages::HandOverRecord hand_over;
  hand_over.object = {3, 1, 3, messages::flag_present};
  const std::map<std::string, std::pair<messages::MessageView, std::set<Stage>>> cases{
      {"frame_begin", {fixture.message(MessageType::frame_begin), {Stage::waiting}}},
      {"adopt", {fixture.message(MessageType::adopt, hand_over), {Stage::waiting}}},
      {"position_update",
       {fixture.message(MessageType::position_update, fixture.position(3, {10, 10, 10})),
        {Stage::moving, Stage::gathering}}},
      {"correct", {fixture.message(MessageType::correct, messages::CorrectRecord{0, 0}), {Stage::ending}}},
      {"notify", {fixture.message(MessageType::notify, contact), {Stage::waiting}}},
      {"ghosts_sent",
       {fixture.message(MessageType::ghosts_sent, messages::GhostsSentRecord{}), {Stage::moving, Stage::gathering}}},
      {"frame_end", {fixture.message(MessageType::frame_end, messages::FrameEndRecord{}), {Stage::ending}}},
      {"region_map",
       {fixture.message(MessageType::region_map, std::span<const messages::OwnerRecord>(owners)),
        {Stage::waiting, Stage::moving, Stage::gathering, Stage::ending}}},
      {"a message of another node", {fixture.message(MessageType::hand_over, hand_over, Endpoint::node(1)), {}}},
  };
  for (const auto& each : cases) {
    const auto& one = each.second;
    for (int stage = 0; stage <= static_cast<int>(Stage::reporting); ++stage) {
      CAPTURE(each.first);
      CAPTURE(stage);
      fixture.state().stage = static_cast<Stage>(stage);
      CHECK(expected.is_acceptable(one.first) == (one.second.count(static_cast<Stage>(stage)) != 0));
    }
  }
}

TEST_CASE("objects that models may sense are accepted before a frame, if they are valid, and none may be missing") {
  NodeFixture fixture({.shares_memory = false});
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  messages::SensedRecord valid;
  valid.number = 4;
  const auto sensed = [&](void (*change)(messages::SensedRecord&)) {
    messages::SensedRecord record = valid;
    change(record);
    return fixture.message(MessageType::sensed, record);
  };
  for (int stage = 0; stage <= static_cast<int>(Stage::reporting); ++stage) {
    fixture.state().stage = static_cast<Stage>(stage);
    CHECK(expected.is_acceptable(sensed([](auto&) {})) == (fixture.state().stage == Stage::waiting));
  }
  fixture.state().stage = Stage::waiting;
  CHECK(!expected.is_acceptable(sensed([](auto& record) { record.number = 0; })));
  CHECK(!expected.is_acceptable(sensed([](auto& record) { record.shape = 9; })));
  CHECK(!expected.is_acceptable(sensed([](auto& record) { record.layer = 32; })));
  CHECK(!expected.is_acceptable(sensed([](auto& record) { record.category = 4; })));
  CHECK(!expected.is_acceptable(sensed([](auto& record) { record.pose.orientation.w = 2; })));

  const std::vector<messages::SensedRecord> two(2, valid);
  const auto part = fixture.message(MessageType::sensed, std::span<const messages::SensedRecord>(two), false);
  fixture.state().setup.max_slots = 3;
  CHECK(expected.is_acceptable(part));
  fixture.exchange().receive_sensed(part);
  CHECK(!expected.is_acceptable(part));  // more objects than the world can have
  CHECK(!expected.is_acceptable(fixture.message(MessageType::frame_begin)));
  fixture.exchange().receive_sensed(fixture.message(MessageType::sensed, valid));
  CHECK(expected.is_acceptable(fixture.message(MessageType::frame_begin)));
}

TEST_CASE("pairs are accepted after the positions, of known objects, the lower number first") {
  NodeFixture fixture({.placement = Placement::server, .shares_memory = false});
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  fixture.state().stage = Stage::gathering;
  const auto pairs = [&](std::uint32_t a, std::uint32_t b) {
    return fixture.message(MessageType::pairs, messages::PairRecord{a, b});
  };
  CHECK(expected.is_acceptable(pairs(1, 2)));
  CHECK(!expected.is_acceptable(pairs(2, 1)));
  CHECK(!expected.is_acceptable(pairs(1, 3)));
  fixture.state().received.positions = false;
  CHECK(!expected.is_acceptable(pairs(1, 2)));
}

TEST_CASE("a correction names a contact that the node has sent") {
  NodeFixture fixture({.placement = Placement::server, .shares_memory = false});
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  fixture.state().stage = Stage::ending;
  const auto correction = fixture.message(MessageType::correct, messages::CorrectRecord{0, 0});
  CHECK(!expected.is_acceptable(correction));
  fixture.state().own_contacts.begun.push_back(1);
  CHECK(expected.is_acceptable(correction));
}

TEST_CASE("contacts are unlisted at the end of a frame, if the node found them, each once and in order") {
  NodeFixture fixture({.placement = Placement::server, .shares_memory = false});
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  const auto unlist = [&](std::vector<std::uint64_t> keys) {
    std::vector<messages::UnlistRecord> records;
    for (const std::uint64_t key : keys) records.push_back({key});
    return fixture.message(MessageType::unlist, std::span<const messages::UnlistRecord>(records));
  };
  const std::uint64_t first = base::PairSort::key(1, 2), second = base::PairSort::key(1, 3);
  fixture.state().own_contacts.keys.push_back(first);
  fixture.state().own_contacts.keys.push_back(second);
  for (int stage = 0; stage <= static_cast<int>(Stage::reporting); ++stage) {
    fixture.state().stage = static_cast<Stage>(stage);
    CHECK(expected.is_acceptable(unlist({second})) == (fixture.state().stage == Stage::ending));
  }
  fixture.state().stage = Stage::ending;
  CHECK(expected.is_acceptable(unlist({first, second})));
  CHECK(!expected.is_acceptable(unlist({second, first})));
  CHECK(!expected.is_acceptable(unlist({first, first})));
  CHECK(!expected.is_acceptable(unlist({base::PairSort::key(1, 4)})));
  CHECK(!expected.is_acceptable(unlist({base::PairSort::key(2, 1)})));
  fixture.state().received.frame_end = true;
  CHECK(!expected.is_acceptable(unlist({first})));
}

TEST_CASE("a loss is that of another node, and its frame can be detected again until its contacts are final") {
  NodeFixture fixture;
  const Migration migration(fixture.state(), fixture.exchange());
  const ExpectedMessages expected(fixture.state(), fixture.exchange(), migration);
  const auto lost = [&](std::uint32_t node, std::uint32_t again) {
    return fixture.message(MessageType::lost, messages::LostRecord{node, again, 0, 0});
  };
  fixture.state().stage = Stage::ending;
  CHECK(expected.is_acceptable(lost(1, 0)));
  CHECK(expected.is_acceptable(lost(1, 1)));
  CHECK(!expected.is_acceptable(lost(0, 0)));
  CHECK(!expected.is_acceptable(lost(2, 0)));
  fixture.state().stage = Stage::handing_over;
  CHECK(!expected.is_acceptable(lost(1, 1)));
  CHECK(expected.is_acceptable(lost(1, 0)));
}

TEST_CASE(
    "a message of another node waits for its frame and step; those of lost nodes and earlier frames are dropped") {
  using Verdict = PeerInbox::Verdict;
  NodeFixture fixture({.shares_memory = false});
  NodeState& state = fixture.state();
  Migration migration(state, fixture.exchange());
  const ExpectedMessages expected(state, fixture.exchange(), migration);
  messages::HandOverRecord record;
  record.object = {3, 1, 3, messages::flag_present};
  const auto hand_over = fixture.message(MessageType::hand_over, record, Endpoint::node(1));
  const auto ghost = fixture.message(MessageType::ghost, fixture.position(4, {32, 10, 10}), Endpoint::node(1));
  state.stage = Stage::gathering;
  CHECK(expected.judge(hand_over) == Verdict::wait);
  CHECK(expected.judge(ghost) == Verdict::wait);  // positions have not arrived
  state.received.positions = true;
  CHECK(expected.judge(ghost) == Verdict::drop);  // none were announced
  fixture.exchange().expect_ghosts(1);
  CHECK(expected.judge(ghost) == Verdict::take);
  fixture.exchange().count_ghosts(1);
  CHECK(expected.judge(ghost) == Verdict::drop);
  state.stage = Stage::ending;
  CHECK(expected.judge(hand_over) == Verdict::wait);
  state.received.frame_end = true;
  CHECK(expected.judge(hand_over) == Verdict::take);
  migration.lose({1, 0, 0, 0});
  CHECK(expected.judge(hand_over) == Verdict::drop);
  migration.begin();
  state.frame = 2;
  CHECK(expected.judge(hand_over) == Verdict::drop);
  state.frame = 0;
  CHECK(expected.judge(hand_over) == Verdict::wait);
}

}  // namespace
}  // namespace ringfence::nodes::test
