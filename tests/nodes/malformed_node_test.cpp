// A server and CD nodes in different processes, one of which breaks the protocol: the receiver counts the message, and
// the server treats the sender as lost. No received number is used as an index before it is checked.
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/replay.hpp"
#include "nodes/test_harness.hpp"
#include "nodes/wandering_model.hpp"

namespace ringfence::nodes::test {
namespace {

using Bytes = std::vector<std::byte>;

constexpr NodeNumber malformed_node = 1;
constexpr std::uint64_t malformed_frame = 3;
constexpr std::size_t frames = 6;
constexpr std::uint32_t no_slot = 0xffffffffu;
const WanderingModel wandering;

HarnessConfig config_of(Placement placement) {
  HarnessConfig config;
  config.placement = placement;
  config.model = &wandering;
  config.grid = {{2, 2, 2}};
  return config;
}

void populate(TestHarness& harness) {
  std::mt19937 random(5);
  const ShapeId ball = harness.add_shape(Sphere{6});
  for (std::size_t i = 0; i < 60; ++i) {
    ObjectSpec spec;
    spec.shape = ball;
    spec.pose.position = {static_cast<double>(random() % 60), static_cast<double>(random() % 60),
                          static_cast<double>(random() % 60)};
    spec.category = i % 20 == 19 ? Category::fixed : Category::active;
    harness.spawn(spec);
  }
  harness.add_shape(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}});
  std::vector<messages::QueryRecord> queries;
  for (std::uint32_t i = 0; i < 15; ++i) {  // one message
    messages::QueryRecord& query = queries.emplace_back();
    query.kind = static_cast<std::uint32_t>(i == 0 ? messages::QueryKind::sweep : messages::QueryKind::overlap);
    query.kind = i % 3 == 2 ? static_cast<std::uint32_t>(messages::QueryKind::nearest) : query.kind;
    query.start.position = {4.0 * i, 30, 30};
    query.distance = 100;
    query.layers = query.categories = ~0u;
  }
  harness.ask(queries);
}

std::vector<Contact> contacts_of(const TestHarness& harness) {
  return {harness.contacts().begin(), harness.contacts().end()};
}
bool same(const std::vector<Contact>& p, const std::vector<Contact>& q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size() * sizeof(Contact)) == 0;
}

std::vector<std::vector<Contact>> expected_contacts(Placement placement) {
  TestHarness harness(config_of(placement));
  populate(harness);
  std::vector<std::vector<Contact>> all;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    harness.frame();
    all.push_back(contacts_of(harness));
  }
  return all;
}

template <class Record>
Bytes with(const LoggedMessage& seen, std::size_t i, const std::function<void(Record&)>& change) {
  Bytes bytes = seen.bytes;
  std::byte* const at = bytes.data() + sizeof(messages::Header) + i * seen.header.record_bytes;
  Record record;
  std::memcpy(&record, at, sizeof record);
  change(record);
  std::memcpy(at, &record, sizeof record);
  return bytes;
}
Bytes with_header(const LoggedMessage& seen, const std::function<void(messages::Header&)>& change) {
  Bytes bytes = seen.bytes;
  messages::Header header = seen.header;
  change(header);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}
Bytes without_records(const LoggedMessage& seen) {
  Bytes bytes = with_header(seen, [](messages::Header& header) {
    header.count = 0;
    header.bytes = sizeof header;
  });
  bytes.resize(sizeof(messages::Header));
  return bytes;
}

/// Messages that the node sends in place of a valid message of that type.
struct MalformedMessage {
  std::string what;
  MessageType type;
  std::size_t min_records;  ///< of the valid message
  std::function<std::vector<Bytes>(const LoggedMessage&)> instead;
};

template <class Record>
MalformedMessage change(std::string what, MessageType type, std::function<void(Record&)> how) {
  return {std::move(what), type, 1,
          [how](const LoggedMessage& seen) { return std::vector<Bytes>{with<Record>(seen, 0, how)}; }};
}

constexpr const char* after_last = "a state after the last";

std::vector<MalformedMessage> malformed_messages() {
  using messages::CollisionRecord;
  using messages::NodeStateRecord;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto collision = [](std::string what, std::function<void(CollisionRecord&)> how) {
    return change<CollisionRecord>(std::move(what), MessageType::collision, std::move(how));
  };
  const auto state = [](std::string what, std::function<void(NodeStateRecord&)> how) {
    return change<NodeStateRecord>(std::move(what), MessageType::node_state, std::move(how));
  };
  const auto replica = [](std::string what, std::function<void(messages::ReplicaRecord&)> how) {
    return change<messages::ReplicaRecord>(std::move(what), MessageType::replica, std::move(how));
  };
  std::vector<MalformedMessage> all = {
      collision("the largest slot number", [](auto& record) { record.slot_a = no_slot; }),
      collision("a slot beyond the table", [](auto& record) { record.slot_b = 1000; }),
      collision("an object with itself", [](auto& record) { record.slot_b = record.slot_a; }),
      collision("the higher number first", [](auto& record) { std::swap(record.slot_a, record.slot_b); }),
      collision("a depth that is not a number", [](auto& record) { record.depth = std::nanf(""); }),
      collision("a point that is not finite",
                [](auto& record) { record.point.z = std::numeric_limits<float>::infinity(); }),
      state("a position that is not a number", [=](auto& record) { record.pose.position.x = nan; }),
      state("an orientation of length 0",
            [](auto& record) {
              record.pose.orientation = {0, 0, 0, 0};
            }),
      replica("a replica whose position is not a number", [=](auto& record) { record.pose.position.y = nan; }),
      replica("a replica of an object that has ended", [](auto& record) { ++record.generation; }),
      replica("a replica of a slot beyond the table", [](auto& record) { record.slot = no_slot; }),
      state("bounds that are inside out", [](auto& record) { std::swap(record.bounds.lower, record.bounds.upper); }),
      change<messages::NarrowDoneRecord>("another number of contacts", MessageType::narrow_done,
                                         [](auto& record) { ++record.contacts; }),
      change<messages::NodeFrameStats>("host-owned changes", MessageType::frame_done,
                                       [](auto& record) { record.host_owned_changes = std::uint64_t{1} << 63; }),
      change<messages::KindRecord>("shapes of an unknown kind", MessageType::kinds,
                                   [](auto& record) { record.first = 77; }),
  };
  const auto hit = [&](std::string what, std::function<void(messages::QueryHitRecord&)> how) {
    all.push_back(change<messages::QueryHitRecord>(std::move(what), MessageType::query_hit, std::move(how)));
  };
  hit("a hit of an unknown query", [](auto& record) { record.query = 20; });
  hit("a hit at a slot beyond the table", [](auto& record) { record.slot = no_slot; });
  hit("a hit at a place that is not a number", [=](auto& record) { record.place = nan; });
  hit("a hit at a point that is not finite", [=](auto& record) { record.point.y = 1 / 0.0; });
  all.push_back({"hits out of order", MessageType::query_hit, 2, [](const LoggedMessage& seen) {
                   Bytes bytes = seen.bytes;
                   const auto first = bytes.begin() + sizeof(messages::Header);
                   const auto last = bytes.end() - seen.header.record_bytes;
                   std::swap_ranges(first, first + seen.header.record_bytes, last);
                   return std::vector<Bytes>{bytes};
                 }});
  all.push_back({"two nearest objects", MessageType::query_hit, 2, [](const LoggedMessage& seen) {
                   const auto to_nearest = [](auto& record) { record.query = 2; };
                   LoggedMessage changed = seen;
                   changed.bytes = with<messages::QueryHitRecord>(seen, 0, to_nearest);
                   return std::vector<Bytes>{with<messages::QueryHitRecord>(changed, 1, to_nearest)};
                 }});
  all.push_back({"hits after the last", MessageType::query_hit, 0, [](const LoggedMessage& seen) {
                   return std::vector<Bytes>{seen.bytes, seen.bytes};
                 }});
  all.push_back({"contacts out of order", MessageType::collision, 2, [](const LoggedMessage& seen) {
                   Bytes bytes = seen.bytes;
                   const auto first = bytes.begin() + sizeof(messages::Header);
                   std::swap_ranges(first, first + seen.header.record_bytes, first + seen.header.record_bytes);
                   return std::vector<Bytes>{bytes};
                 }});
  all.push_back({"contacts twice", MessageType::collision, 1, [](const LoggedMessage& seen) {
                   return std::vector<Bytes>{with_header(seen, [](auto& header) { header.last = 0; }), seen.bytes};
                 }});
  // Repetitions: the first message counts. A later one would change values that other roles already read.
  for (const MessageType type : {MessageType::collision, MessageType::narrow_done}) {
    all.push_back({std::string("after narrow_done: ") + messages::name_of(type), MessageType::narrow_done, 0,
                   [type](const LoggedMessage& seen) {
                     messages::Header header = seen.header;
                     header.type = static_cast<std::uint16_t>(type);
                     header.record_bytes = static_cast<std::uint16_t>(messages::record_bytes(type, 8));
                     header.count = 1;
                     header.bytes = sizeof header + header.record_bytes;
                     Bytes later(header.bytes);
                     std::memcpy(later.data(), &header, sizeof header);
                     messages::CollisionRecord record;
                     record.slot_b = 1;
                     std::memcpy(later.data() + sizeof header, &record, header.record_bytes);
                     return std::vector<Bytes>{seen.bytes, later};
                   }});
  }
  all.push_back({after_last, MessageType::node_state, 0, [](const LoggedMessage& seen) {
                   return std::vector<Bytes>{seen.bytes, seen.bytes};
                 }});
  for (const MessageType type : {MessageType::narrow_done, MessageType::frame_done}) {
    all.push_back({std::string("no record of type ") + messages::name_of(type), type, 1,
                   [](const LoggedMessage& seen) { return std::vector<Bytes>{without_records(seen)}; }});
  }
  const auto with_changed_header = [&](std::string what, std::function<void(messages::Header&)> how) {
    all.push_back({std::move(what), MessageType::narrow_done, 1, [how](const LoggedMessage& seen) {
                     return std::vector<Bytes>{with_header(seen, how), seen.bytes};
                   }});
  };
  with_changed_header("another node as its source", [](auto& header) { header.source = Endpoint::node(0).value; });
  with_changed_header("another frame", [](auto& header) { header.frame += 1; });
  with_changed_header("one record too many", [](auto& header) { header.count += 1; });
  with_changed_header("a message type of the server", [](auto& header) {
    header.type = static_cast<std::uint16_t>(MessageType::region_map);
    header.record_bytes = 8;
    header.count = 3;
  });
  return all;
}

}  // namespace

TEST_CASE("a CD node in another process that breaks the protocol is lost, and no contact changes") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    const auto expected = expected_contacts(placement);
    for (const MalformedMessage& malformed : malformed_messages()) {
      if (malformed.type == MessageType::replica && placement == Placement::server) {
        continue;  // the nodes send none
      }
      CAPTURE(name_of(placement));
      CAPTURE(malformed.what);
      TestHarness harness(config_of(placement));
      populate(harness);
      bool sent = false;
      harness.tamper_nodes = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
        const bool last = malformed.what != after_last || seen.header.last == 1;
        if (!sent && seen.from == Endpoint::node(malformed_node) && seen.type() == malformed.type && last &&
            seen.header.frame >= malformed_frame && seen.header.count >= malformed.min_records) {
          sent = true;
          instead = malformed.instead(seen);
        }
      };
      std::size_t lost = 0;
      std::uint64_t refused = 0;
      for (std::size_t frame = 0; frame < frames; ++frame) {
        CAPTURE(frame);
        harness.frame();
        REQUIRE(same(contacts_of(harness), expected[frame]));
        lost += harness.report().lost.size();
        refused += harness.report().refused[static_cast<std::size_t>(Status::bad_message)];
      }
      REQUIRE(sent);
      CHECK(lost == 1);
      CHECK(refused >= 1);
    }
  }
}

// Except the counts of what a node sends directly to others: these would wait for records that do not come.
TEST_CASE("if any byte of the records of a CD node in another process changes, the server still ends the frame") {
  std::mt19937_64 random(11);
  for (int run = 0; run < 400; ++run) {
    CAPTURE(run);
    TestHarness harness(config_of(run % 2 == 0 ? Placement::server : Placement::region));
    populate(harness);
    std::uint64_t until = random() % 60;
    harness.tamper_nodes = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
      const bool counts = seen.type() == MessageType::ghost_counts || seen.type() == MessageType::contact_counts;
      if (seen.from != Endpoint::node(malformed_node) || seen.header.count == 0 || counts || until-- != 0) {
        return;
      }
      Bytes& bytes = instead[0];
      const std::size_t at = sizeof(messages::Header) + random() % (bytes.size() - sizeof(messages::Header));
      bytes[at] ^= static_cast<std::byte>(1 + random() % 255);
    };
    for (std::size_t frame = 0; frame < frames; ++frame) {
      harness.frame();
    }
  }
}

TEST_CASE("a CD node discards and counts invalid messages of a server in another process") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    CAPTURE(name_of(placement));
    TestHarness harness(config_of(placement));
    populate(harness);
    const std::vector<LoggedMessage> script = script_of(harness, frames);
    Replay(config_of(placement), harness).run(script, [](std::size_t, Bytes&) {});

    const auto is_refused = [&](const std::string& what, MessageType type,
                                const std::function<Bytes(const LoggedMessage&)>& make) {
      CAPTURE(what);
      std::size_t sent = 0;
      Replay replay(config_of(placement), harness);
      replay.run(script, [&](std::size_t i, Bytes& bytes) {
        if (sent == 0 && script[i].type() == type && script[i].header.count != 0 && script[i].header.frame > 1) {
          bytes = make(script[i]);
          ++sent;
        }
      });
      // Some types are not sent with every placement.
      CHECK((sent == 0 || replay.invalid_messages() >= 1));
      return sent;
    };
    const auto changed = [&]<class Record>(const std::string& what, MessageType type, void (*how)(Record&)) {
      return is_refused(what, type, [how](const LoggedMessage& seen) { return with<Record>(seen, 0, how); });
    };
    using messages::HandOverRecord;
    using messages::OwnerRecord;
    using messages::PairRecord;
    using messages::PositionRecord;
    using messages::QueryRecord;
    std::size_t sent = 0;
    sent += changed.operator()<QueryRecord>("a query of an unknown kind", MessageType::query,
                                            [](auto& record) { record.kind = messages::query_kinds; });
    sent += changed.operator()<QueryRecord>("a mesh that moves", MessageType::query,
                                            [](auto& record) { record.shape = 1; });
    sent += changed.operator()<QueryRecord>("an unknown shape that moves", MessageType::query,
                                            [](auto& record) { record.shape = 2; });
    sent += changed.operator()<QueryRecord>("a negative distance", MessageType::query,
                                            [](auto& record) { record.distance = -1; });
    sent += changed.operator()<QueryRecord>("a query without an orientation", MessageType::query, [](auto& record) {
      record.start.orientation = {0, 0, 0, 0};
    });
    sent += changed.operator()<QueryRecord>("a displacement that is not a number", MessageType::query,
                                            [](auto& record) { record.displacement.z = std::nan(""); });
    sent += is_refused("a query without end", MessageType::query, [](const LoggedMessage& seen) {
      return with_header(seen, [](auto& header) { header.last = 0; });
    });
    sent += changed.operator()<PositionRecord>("the largest slot number", MessageType::position_update,
                                               [](auto& record) { record.object.slot = no_slot; });
    sent += changed.operator()<PositionRecord>("an unknown shape", MessageType::position_update,
                                               [](auto& record) { record.shape = 5; });
    sent += changed.operator()<PositionRecord>("an unknown layer", MessageType::position_update,
                                               [](auto& record) { record.layer = 32; });
    sent += changed.operator()<PositionRecord>("an unknown category", MessageType::position_update,
                                               [](auto& record) { record.category = 4; });
    sent += changed.operator()<PositionRecord>("a position that is not a number", MessageType::position_update,
                                               [](auto& record) { record.pose.position.y = std::nan(""); });
    sent += changed.operator()<HandOverRecord>("an object without a number", MessageType::hand_over,
                                               [](auto& record) { record.object.number = 0; });
    sent += changed.operator()<HandOverRecord>("an unknown category", MessageType::hand_over,
                                               [](auto& record) { record.category = 4; });
    sent += is_refused("a hand-over of an unknown node", MessageType::hand_over, [](const LoggedMessage& seen) {
      return with_header(seen, [](auto& header) { header.source = Endpoint::node(900).value; });
    });
    sent += is_refused("an end of the frame without a record", MessageType::frame_end,
                       [](const LoggedMessage& seen) { return without_records(seen); });
    sent += changed.operator()<Contact>("an unknown phase", MessageType::notify,
                                        [](auto& contact) { contact.phase = static_cast<Phase>(9); });
    CHECK(sent >= 15);
    if (placement == Placement::server) {
      CHECK(changed.operator()<PairRecord>("a pair of unknown objects", MessageType::pairs,
                                           [](auto& pair) { pair.b = 1u << 20; }) == 1);
      CHECK(changed.operator()<PairRecord>("an object with itself", MessageType::pairs,
                                           [](auto& pair) { pair.b = pair.a; }) == 1);
    }
  }
}

TEST_CASE("a CD node discards a loss of an unknown node, and a map with unknown owners") {
  TestHarness harness(config_of(Placement::region));
  populate(harness);
  const std::vector<LoggedMessage> script = script_of(harness, 2);
  const auto insert = [&](MessageType type, const void* records, std::size_t count) {
    const std::size_t each = messages::record_bytes(type, 8);
    messages::Header header;
    header.type = static_cast<std::uint16_t>(type);
    header.record_bytes = static_cast<std::uint16_t>(each);
    header.last = 1;
    header.count = static_cast<std::uint32_t>(count);
    header.bytes = static_cast<std::uint32_t>(sizeof header + count * each);
    header.total = count;
    Bytes bytes(header.bytes);
    std::memcpy(bytes.data(), &header, sizeof header);
    std::memcpy(bytes.data() + sizeof header, records, count * each);
    Replay replay(config_of(Placement::region), harness);
    replay.run(script, [](std::size_t, Bytes&) {});
    replay.feed(bytes);
    CHECK(replay.invalid_messages() == 1);
  };
  for (const std::uint32_t node : {0u, 3u, 0x40000001u}) {
    const messages::LostRecord lost{node, 1, 0, 0};
    insert(MessageType::lost, &lost, 1);
  }
  std::vector<messages::OwnerRecord> owners(64);
  owners[63].owner = 3;  // of three nodes
  insert(MessageType::region_map, owners.data(), owners.size());
  owners[63].owner = regions::RegionMap::cut_entry(0, 0);  // no such cut
  insert(MessageType::region_map, owners.data(), owners.size());
  owners[63].owner = 0;
  insert(MessageType::region_map, owners.data(), owners.size() - 1);
}

TEST_CASE("if any byte of its received messages changes, a CD node still runs") {
  // A test of all bytes would take minutes.
  constexpr std::size_t stride = 23;
  for (const Placement placement : {Placement::server, Placement::region}) {
    TestHarness harness(config_of(placement));
    populate(harness);
    const std::vector<LoggedMessage> script = script_of(harness, 3);
    std::mt19937_64 random(7);
    for (std::size_t message = 0; message < script.size(); ++message) {
      for (std::size_t at = random() % stride; at < script[message].bytes.size(); at += stride) {
        CAPTURE(message);
        CAPTURE(at);
        Replay replay(config_of(placement), harness);
        replay.run(script, [&](std::size_t i, Bytes& bytes) {
          if (i == message) {
            bytes[at] ^= static_cast<std::byte>(1 + random() % 255);
          }
        });
      }
    }
  }
}

}  // namespace ringfence::nodes::test
