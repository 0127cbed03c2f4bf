// Property: whatever messages one user node sends, in any deployment, every frame ends; objects of other hosts move as
// if it had sent nothing; its own objects have valid positions; and the contacts are those of the poses.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>

#include "fuzz/target.hpp"
#include "nodes/test_harness.hpp"

namespace ringfence::fuzz {
namespace {

using nodes::test::HarnessConfig;
using nodes::test::LoggedMessage;
using nodes::test::TestHarness;
using Bytes = std::vector<std::byte>;

constexpr UserNumber malformed_sender = 1;
constexpr std::size_t objects = 12;
constexpr double radius = 2;

/// A motion model without response to contacts, so that the test can compute expected positions without the engine.
class Walk : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 8; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x += step(inputs[i].number, frame);
    }
  }
  static double step(ObjectNumber number, std::uint64_t frame) { return (number + frame) % 3 == 0 ? -2.0 : 1.0; }
};
const Walk walk;

Vec3d start_of(std::size_t i) { return {20 + static_cast<double>(i % 4) * 3, 20 + static_cast<double>(i / 4) * 3, 30}; }

/// Reads values from the front of the fuzz input; zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* bytes, std::size_t size) : bytes_(bytes), left_(size) {}
  bool empty() const { return left_ == 0; }
  std::uint8_t byte() { return take<std::uint8_t>(); }
  template <class T>
  T take() {
    T value{};
    const std::size_t size = left_ < sizeof value ? left_ : sizeof value;
    std::memcpy(&value, bytes_, size);
    bytes_ += size;
    left_ -= size;
    return value;
  }
  void fill(Bytes& bytes, std::size_t from) {
    for (; from < bytes.size() && !empty(); ++from) {
      bytes[from] = static_cast<std::byte>(byte());
    }
  }

 private:
  const std::uint8_t* bytes_;
  std::size_t left_;
};

struct Scene {
  explicit Scene(Deployment deployment)
      : harness([&] {
          HarnessConfig config;
          config.deployment = deployment;
          config.model = &walk;
          config.nodes = 2;
          config.delivery_bytes = std::size_t{1} << 15;
          return config;
        }()) {
    const ShapeId ball = harness.add_shape(Sphere{radius});
    for (UserNumber user = 0; user < 3; ++user) {
      harness.connect(user);
    }
    for (std::size_t i = 0; i < objects; ++i) {
      ObjectSpec spec;
      spec.shape = ball;
      spec.pose.position = start_of(i);
      spec.category = i < 6 ? Category::avatar : i == 11 ? Category::fixed : Category::active;
      spec.user = i < 6 ? UserId(static_cast<std::uint32_t>(i % 3)) : no_user;
      harness.spawn(spec);
    }
  }
  const nodes::ObjectRow& row(std::size_t i) const {
    const nodes::ObjectTable& table = harness.table();
    return table.row(table.find(static_cast<ObjectNumber>(i + 1)));
  }
  TestHarness harness;
};

messages::Header header_of(messages::MessageType type, std::uint64_t frame, std::size_t count) {
  const std::size_t each = messages::record_bytes(type, 8);
  messages::Header header;
  header.type = static_cast<std::uint16_t>(type);
  header.record_bytes = static_cast<std::uint16_t>(each);
  header.source = messages::Endpoint::user(malformed_sender).value;
  header.frame = frame;
  header.count = static_cast<std::uint32_t>(count);
  header.bytes = static_cast<std::uint32_t>(sizeof header + count * each);
  return header;
}

Bytes bytes_of(const messages::Header& header) {
  Bytes bytes(header.bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

/// A value that arithmetic and comparisons treat in a special way, at a place that `input` selects.
void put_extreme(Input& input, Bytes& bytes, std::size_t from) {
  if (bytes.size() - from < 8) return;
  const std::size_t at = from + input.take<std::uint16_t>() % ((bytes.size() - from) / 4 - 1) * 4;
  constexpr double doubles[] = {std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::infinity(),
                                -std::numeric_limits<double>::infinity(),
                                1e15,
                                -1e15,
                                1.0000000000000002e15,
                                1e300,
                                5e-324,
                                -0.0};
  constexpr float floats[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 0, 1e30f,
                              1e-40f};
  constexpr std::uint32_t numbers[] = {0, 1, 0x7fffffffu, 0x80000000u, 0xffffffffu};
  const std::uint8_t which = input.byte();
  switch (which % 3) {
    case 0:
      return void(std::memcpy(&bytes[at], &doubles[which / 3 % std::size(doubles)], sizeof(double)));
    case 1:
      return void(std::memcpy(&bytes[at], &floats[which / 3 % std::size(floats)], sizeof(float)));
    default:
      return void(std::memcpy(&bytes[at], &numbers[which / 3 % std::size(numbers)], sizeof(std::uint32_t)));
  }
}

/// Repeats, leaves out or exchanges records, and makes the header fit.
Bytes rearrange_records(Input& input, const Bytes& valid) {
  messages::Header header;
  std::memcpy(&header, valid.data(), sizeof header);
  std::vector<Bytes> records;
  for (std::size_t at = sizeof header; header.record_bytes != 0 && at < valid.size(); at += header.record_bytes) {
    const auto first = valid.begin() + static_cast<std::ptrdiff_t>(at);
    records.emplace_back(first, first + header.record_bytes);
  }
  for (int steps = 1 + input.byte() % 4; steps > 0 && !records.empty(); --steps) {
    const std::size_t i = input.byte() % records.size(), j = input.byte() % records.size();
    switch (input.byte() % 3) {
      case 0:
        records.push_back(Bytes(records[i]));
        break;
      case 1:
        records.erase(records.begin() + static_cast<std::ptrdiff_t>(i));
        break;
      default:
        std::swap(records[i], records[j]);
    }
  }
  header.count = static_cast<std::uint32_t>(records.size());
  header.bytes = static_cast<std::uint32_t>(sizeof header + records.size() * header.record_bytes);
  header.total = header.last != 0 ? records.size() : 0;
  Bytes bytes = bytes_of(header);
  for (std::size_t i = 0; i < records.size(); ++i) {
    std::copy(records[i].begin(), records[i].end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(sizeof header + i * header.record_bytes));
  }
  return bytes;
}

/// Makes a message from the fuzz input. `valid` is the message that the user node would have sent.
Bytes make_malformed_message(Input& input, const Scene& scene, const LoggedMessage& valid) {
  const std::uint64_t frame = valid.header.frame;
  switch (input.byte() % 6) {
    case 0: {  // arbitrary bytes
      Bytes bytes(1 + input.byte() * std::size_t{3});
      input.fill(bytes, 0);
      return bytes;
    }
    case 1: {  // a well-formed message of any type with arbitrary records
      const auto type = static_cast<messages::MessageType>(1 + input.byte() % (messages::message_types - 1));
      const std::size_t count = messages::record_bytes(type, 8) == 0 ? 0 : input.byte() % 5;
      messages::Header header = header_of(type, frame + input.byte() % 3 - 1, count);
      header.last = input.byte() & 1;
      Bytes bytes = bytes_of(header);
      input.fill(bytes, sizeof header);
      return bytes;
    }
    case 2: {  // a state of any object with an arbitrary pose
      messages::Header header = header_of(messages::MessageType::state_update, frame, 1);
      header.last = input.byte() & 1;
      Bytes bytes = bytes_of(header);
      messages::StateRecord record{scene.row(input.byte() % objects).object, input.take<Pose>()};
      record.object.flags = input.byte();
      std::memcpy(bytes.data() + sizeof header, &record, sizeof record);
      return bytes;
    }
    case 3: {  // the valid message with extreme numbers in its records
      Bytes bytes = valid.bytes;
      for (int count = 1 + input.byte() % 3; count > 0; --count) {
        put_extreme(input, bytes, sizeof(messages::Header));
      }
      return bytes;
    }
    case 4:  // other records of the valid message
      return rearrange_records(input, valid.bytes);
    default: {  // the valid message with one changed byte
      Bytes bytes = valid.bytes;
      const std::size_t at = input.take<std::uint16_t>() % bytes.size();
      bytes[at] ^= static_cast<std::byte>(input.byte());
      return bytes;
    }
  }
}

/// Checks the state after a frame. `expected` is the position of each object if the sender sends only valid messages.
void check(const Scene& scene, const Vec3d* expected) {
  Vec3d where[objects];
  for (std::size_t i = 0; i < objects; ++i) {
    const nodes::ObjectRow& row = scene.row(i);
    where[i] = row.pose.position;
    const bool own = scene.harness.table().host(row.object.slot) == messages::Endpoint::user(malformed_sender);
    require(own || (where[i].x == expected[i].x && where[i].y == expected[i].y && where[i].z == expected[i].z));
    require(std::abs(where[i].x) <= farthest_coordinate && std::abs(where[i].y) <= farthest_coordinate &&
            std::abs(where[i].z) <= farthest_coordinate);
  }
  std::size_t touching = 0;
  std::size_t within_tolerance = 0;
  const auto present = scene.harness.table().present();
  for (std::size_t i = 0; i < objects; ++i) {
    for (std::size_t j = i + 1; j < objects; ++j) {
      const double x = where[i].x - where[j].x, y = where[i].y - where[j].y, z = where[i].z - where[j].z;
      const double distance = std::sqrt(x * x + y * y + z * z);
      const bool both = present[scene.row(i).object.slot] != 0 && present[scene.row(j).object.slot] != 0;
      within_tolerance += both && std::abs(distance - 2 * radius) < 1e-4;
      touching += both && distance <= 2 * radius - 1e-4;
    }
  }
  const std::size_t found = scene.harness.contacts().size();
  require(found >= touching && found <= touching + within_tolerance);
  const FrameReport& report = scene.harness.report();
  require(report.tested + report.carried == report.candidates && report.accepted == report.candidates);
}

void fail(const doctest::AssertData&) { std::abort(); }

}  // namespace
}  // namespace ringfence::fuzz

using namespace ringfence;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  // The test harness checks with doctest that a frame does not hang. Here a failed check aborts the program.
  static doctest::Context context;
  context.setAsDefaultForAssertsOutOfTestCases();
  context.setAssertHandler(fuzz::fail);

  fuzz::Input input(bytes, size);
  constexpr Deployment deployments[] = {Deployment::user, Deployment::user_server, Deployment::user_collision};
  fuzz::Scene scene(deployments[input.byte() % 3]);
  scene.harness.tamper = [&](const fuzz::LoggedMessage& seen, std::vector<fuzz::Bytes>& instead) {
    if (seen.from != messages::Endpoint::user(fuzz::malformed_sender)) {
      return;
    }
    for (int count = input.empty() ? 0 : input.byte() % 4; count > 0; --count) {
      const bool before = (input.byte() & 1) != 0;
      instead.insert(before ? instead.begin() : instead.end(), fuzz::make_malformed_message(input, scene, seen));
    }
  };
  Vec3d expected[fuzz::objects];
  for (std::size_t i = 0; i < fuzz::objects; ++i) {
    expected[i] = fuzz::start_of(i);
  }
  for (std::uint64_t frame = 0; frame < 4; ++frame) {
    scene.harness.frame();
    for (std::size_t i = 0; i + 1 < fuzz::objects; ++i) {
      expected[i].x += fuzz::Walk::step(static_cast<ObjectNumber>(i + 1), frame);
    }
    fuzz::check(scene, expected);
  }
  return 0;
}
