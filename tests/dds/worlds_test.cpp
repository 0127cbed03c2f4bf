// Several Worlds in one domain, and Worlds that send invalid data.
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "dds/description.hpp"
#include "dds/domain.hpp"
#include "dds/node_world.hpp"
#include "dds/release.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;

constexpr const char* some_world = "--objects 300 --users 4 --frames 40 --warmup 0 ";

/// Publishes terms as a World with the given name, and reads the announcements of nodes.
class TestWorld {
 public:
  static constexpr std::uint64_t number = 7;

  TestWorld(const std::string& name, std::uint32_t domain, const dds::WorldTermsRecord& record)
      : domain_(network(name, domain), dds::Side::world) {
    domain_.start_heartbeat(test::lease_ms);
    presence_ = domain_.reader(dds::Topic::presence, dds::liveliness_qos(test::lease_ms), name);
    terms_ = domain_.writer(dds::Topic::terms, dds::liveliness_qos(test::lease_ms), name);
    char release[] = "ringfence";
    dds::TermsSample sample{};
    sample.world = number;
    sample.version = dds::wire_version;
    dds::write_byte_order(sample.order);
    sample.layout = dds::fingerprint();
    sample.name = release;
    sample.bytes = dds::borrow(std::as_bytes(std::span(&record, 1)));
    REQUIRE(dds_write(terms_.get(), &sample) == DDS_RETCODE_OK);
  }

  /// The reason for which a node has refused the World; empty if no node has.
  std::string refusal() {
    std::string reason;
    dds::take_all<dds::PresenceSample>(
        presence_, [&](const dds::PresenceSample& sample, const dds_sample_info_t& info) {
          const bool refused = sample.state == static_cast<std::uint32_t>(dds::NodeState::refused);
          if (info.valid_data && sample.world == number && refused) {
            reason = sample.reason;
          }
        });
    return reason;
  }

  /// Takes announcements of nodes until `count` have arrived. Returns how often the node that sent the last one has
  /// announced itself.
  std::size_t announcements(std::size_t count) {
    std::map<std::uint64_t, std::size_t> by_incarnation;
    std::uint64_t last = 0;
    std::size_t taken = 0;
    CHECK(test::wait_until([&] {
      dds::take_all<dds::PresenceSample>(presence_,
                                         [&](const dds::PresenceSample& sample, const dds_sample_info_t& info) {
                                           if (info.valid_data && info.instance_state == DDS_IST_ALIVE) {
                                             ++by_incarnation[last = sample.incarnation];
                                             ++taken;
                                           }
                                         });
      return taken >= count;
    }));
    return by_incarnation[last];
  }

 private:
  static dds::NetworkConfig network(const std::string& name, std::uint32_t domain) {
    dds::NetworkConfig network;
    network.domain = domain;
    network.world = name;
    network.interface = "lo";
    return network;
  }

  dds::Domain domain_;
  dds::Entity presence_;
  dds::Entity terms_;
};

dds::WorldTermsRecord good_terms() {
  dds::WorldTermsRecord record;
  std::fill_n(record.bounds_max, 3, 10.0);
  record.lease_ms = test::lease_ms;
  record.max_objects = 1000;
  return record;
}

}  // namespace

TEST_CASE("two Worlds with different names share a domain, each with its own nodes") {
  const std::string expected = test::digest_in(test::ringfence(std::string("run --nodes 0 ") + some_world).out);
  REQUIRE(expected.size() == 16);
  ProgramResult answers[2];
  const auto run = [&](int i) {
    answers[i] = test::ringfence(std::string("run --link dds --interface lo --domain 171 --nodes 2 --world ") +
                                 (i == 0 ? "first " : "second ") + some_world);
  };
  std::thread other(run, 1);
  run(0);
  other.join();
  for (const ProgramResult& answer : answers) {
    CHECK_MESSAGE(answer.code == 0, answer.out);
    CHECK(test::digest_in(answer.out) == expected);
    CHECK(answer.out.find("is lost") == std::string::npos);
  }
}

TEST_CASE("Worlds that start at the same time each find a domain of their own") {
  for (int round = 0; round < 5; ++round) {
    ProgramResult answers[3];
    std::vector<std::thread> starts;
    for (ProgramResult& answer : answers) {
      starts.emplace_back(
          [&answer] { answer = test::ringfence("run --objects 50 --users 1 --frames 3 --link dds --nodes 1"); });
    }
    for (std::thread& start : starts) {
      start.join();
    }
    for (const ProgramResult& answer : answers) {
      CHECK_MESSAGE(answer.code == 0, answer.out);
    }
  }
}

TEST_CASE("an invalid World name is refused, and the message states what is allowed") {
  const ProgramResult answer = test::ringfence("node --interface lo --domain 172 --world 'a*'");
  CHECK(answer.code == 2);
  CHECK(answer.out.find("world (--world) is \"a*\"; up to 64 letters, digits, '.', '-' and '_'") != std::string::npos);
}

TEST_CASE("a node refuses a World with invalid terms, sends it the reason, and serves the next World") {
  dds::WorldTermsRecord record = good_terms();
  record.lease_ms = std::numeric_limits<double>::quiet_NaN();
  TestWorld invalid("next", 173, record);
  test::Process node({RINGFENCE_PROGRAM, "node", "--quiet", "--interface", "lo", "--domain", "173", "--world", "next"});
  std::string refusal;
  CHECK(test::wait_until([&] {
    refusal = invalid.refusal();
    return !refusal.empty();
  }));
  CHECK(refusal == "the World's terms: a lease of nan ms; expected 10 to 60000");
  const ProgramResult answer = test::ringfence(
      std::string("run --link dds --interface lo --domain 173 --wait-nodes 1 --world next ") + some_world);
  CHECK_MESSAGE(answer.code == 0, answer.out);
  CHECK(!node.has_ended());
  node.signal(SIGTERM);
  CHECK(test::wait_until([&] { return node.has_ended(); }));
  CHECK(node.exit_code() == 0);
}

TEST_CASE("a node with --once exits with 2 if the terms of the World are invalid") {
  const auto is_refused = [](void (*change)(dds::WorldTermsRecord&), const std::string& why) {
    dds::WorldTermsRecord record = good_terms();
    change(record);
    TestWorld invalid("once", 174, record);
    const ProgramResult answer = test::ringfence("node --once --interface lo --domain 174 --world once");
    CHECK(answer.code == 2);
    CHECK_MESSAGE(answer.out.find(why) != std::string::npos, answer.out);
    CHECK(invalid.refusal().find(why) != std::string::npos);
  };
  is_refused([](auto& record) { record.lease_ms = -1; }, "a lease of -1");
  is_refused([](auto& record) { record.bounds_min[1] = 11; }, "min <= max");
  is_refused([](auto& record) { record.cells_log2[2] = 40; }, "2^40 cells on an axis; expected at most 2^10");
  is_refused([](auto& record) { record.placement = 2; }, "placement 2; expected 0 or 1");
}

// Only by a new announcement does the World learn that a node is alive whose lease has expired.
TEST_CASE("a node to which the World has no link announces itself again and again") {
  dds::WorldTermsRecord record = good_terms();
  record.setup_bytes = 8;  // the node waits for the setup
  TestWorld world("silent", 177, record);
  const test::Process node(
      {RINGFENCE_PROGRAM, "node", "--quiet", "--interface", "lo", "--domain", "177", "--world", "silent"});
  CHECK(world.announcements(4) >= 3);
}

}  // namespace ringfence
