#include "dds/announcement.hpp"

#include <string>

#include <doctest/doctest.h>

#include "dds/release.hpp"

namespace ringfence::test {
namespace {

using dds::Announcement;
using dds::NodeState;
using dds::PresenceSample;
using dds::read_announcement;

/// The Presence of a node of this release. `name` and `reason` outlive it.
PresenceSample sample_of(std::string& name, std::string& reason, std::uint32_t state) {
  PresenceSample sample{7, dds::wire_version, {}, dds::fingerprint(), state, 3, name.data(), reason.data()};
  dds::write_byte_order(sample.order);
  return sample;
}

TEST_CASE("the announcement of a node of this release fits, and has its name, reason and state") {
  std::string name = "node-1 \xc3\xa4", reason = dds::own_release();
  const Announcement found = read_announcement(sample_of(name, reason, 1));
  CHECK(found.fits);
  CHECK(found.name == name);
  CHECK(found.reason == reason);
  CHECK(found.state == NodeState::ready);
}

TEST_CASE("another version, byte order or record layout does not fit") {
  std::string name = "n", reason;
  PresenceSample sample = sample_of(name, reason, 1);
  sample.version += 1;
  CHECK_FALSE(read_announcement(sample).fits);
  sample = sample_of(name, reason, 1);
  std::swap(sample.order[0], sample.order[3]);
  CHECK_FALSE(read_announcement(sample).fits);
  sample = sample_of(name, reason, 1);
  sample.layout ^= 1;
  CHECK_FALSE(read_announcement(sample).fits);
}

TEST_CASE("a node with a state that this version does not have is joining, so it is not assigned") {
  std::string name = "n", reason;
  for (const std::uint32_t state : {4u, 255u, ~0u}) {
    CHECK(read_announcement(sample_of(name, reason, state)).state == NodeState::joining);
  }
}

TEST_CASE("texts of other processes are limited and cannot begin a line of the log") {
  CHECK(dds::printable(nullptr).empty());
  CHECK(dds::printable("a\nWARNING b\x1b[2J\x7f\t").find_first_of("\n\x1b\x7f\t") == std::string::npos);
  CHECK(dds::printable("a\nb") == "a?b");
  CHECK(dds::printable(std::string(100'000, 'x').c_str()) == std::string(dds::max_foreign_text, 'x'));
}

}  // namespace
}  // namespace ringfence::test
