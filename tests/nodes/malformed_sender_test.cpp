// A user node that sends invalid messages: each is refused with its reason, and no other role is affected.
#include <chrono>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr UserNumber sender = 1;
constexpr std::uint64_t malformed_frame = 3;

/// All objects drift, so that each frame has its own states and contacts.
class DriftingModel : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 8; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const double sign = (inputs[i].number + frame) % 3 == 0 ? -0.5 : 0.25;
      outputs[i].pose.position.x += sign;
      outputs[i].pose.position.y += inputs[i].contacts.empty() ? 0.0 : 0.125;
    }
  }
};
const DriftingModel drifting;

/// Of the receivers' halves of channels, for tests that send thousands of messages at once.
constexpr std::size_t room_for_floods = std::size_t{1} << 20;

struct Scene {
  static HarnessConfig config_of(Deployment deployment) {
    HarnessConfig config;
    config.deployment = deployment;
    config.model = &drifting;
    return config;
  }
  explicit Scene(Deployment deployment) : Scene(config_of(deployment)) {}
  explicit Scene(const HarnessConfig& config) : harness(config) {
    const ShapeId ball = harness.add_shape(Sphere{2});
    for (UserNumber user = 0; user < 3; ++user) harness.connect(user);
    for (ObjectNumber i = 0; i < 40; ++i) {
      ObjectSpec spec;
      spec.shape = ball;
      spec.pose.position = {20 + static_cast<double>(i % 7) * 3, 20 + static_cast<double>(i / 7) * 3, 30};
      spec.category = i < 6 ? Category::avatar : i == 39 ? Category::fixed : Category::active;
      spec.user = i < 6 ? UserId(i % 3) : no_user;
      ids.push_back(harness.spawn(spec));
    }
  }
  messages::ObjectRef ref(std::size_t i) const {
    const ObjectTable& table = harness.table();
    return table.row(table.find(ids[i].number())).object;
  }
  TestHarness harness;
  std::vector<ObjectId> ids;
};

using Bytes = std::vector<std::byte>;

messages::Header header_of(MessageType type, std::uint64_t frame, std::size_t count) {
  const std::size_t each = messages::record_bytes(type, 8);
  messages::Header header;
  header.type = static_cast<std::uint16_t>(type);
  header.record_bytes = static_cast<std::uint16_t>(each);
  header.source = Endpoint::user(sender).value;
  header.frame = frame;
  header.count = static_cast<std::uint32_t>(count);
  header.bytes = static_cast<std::uint32_t>(sizeof header + count * each);
  return header;
}
Bytes message_of(const messages::Header& header, const void* record = nullptr, std::size_t size = 0) {
  Bytes bytes(header.bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
  if (size != 0) std::memcpy(bytes.data() + sizeof header, record, size);
  return bytes;
}
Bytes state_of(const messages::ObjectRef& object, const Pose& pose, std::uint64_t frame = malformed_frame) {
  const messages::StateRecord record{object, pose};
  return message_of(header_of(MessageType::state_update, frame, 1), &record, sizeof record);
}

struct MalformedMessage {
  std::string what;
  Status reason;
  std::function<Bytes(const Scene&)> make;
  bool afterwards = false;  ///< whether it is sent after the user's last valid message of the frame, or before it
};

std::vector<MalformedMessage> malformed_messages() {
  const Pose pose{{1, 1, 1}, {}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  std::vector<MalformedMessage> all;
  const auto state = [&](std::string what, Status reason, std::function<messages::ObjectRef(const Scene&)> object,
                         Pose where) {
    all.push_back({std::move(what), reason, [=](const Scene& scene) { return state_of(object(scene), where); }});
  };
  const auto own = [](const Scene& scene) { return scene.ref(sender); };
  state(
      "another user's avatar", Status::not_host, [](const Scene& scene) { return scene.ref(0); }, pose);
  state(
      "a static object", Status::not_host, [](const Scene& scene) { return scene.ref(39); }, pose);
  state(
      "a stale generation", Status::stale_object,
      [](const Scene& scene) {
        auto object = scene.ref(sender);
        ++object.generation;
        return object;
      },
      pose);
  state(
      "another's slot with an own number", Status::stale_object,
      [](const Scene& scene) {
        auto object = scene.ref(sender);
        object.slot = scene.ref(0).slot;
        return object;
      },
      pose);
  state(
      "a slot that no table has", Status::stale_object,
      [](const Scene& scene) {
        auto object = scene.ref(sender);
        object.slot = 0xffffffffu;
        return object;
      },
      pose);
  state(
      "a null object", Status::stale_object, [](const Scene&) { return messages::ObjectRef{}; }, pose);
  state("a NaN position", Status::not_finite, own, {{nan, 0, 0}, {}});
  state("an infinite position", Status::not_finite, own, {{0, 0, -1.0 / 0.0}, {}});
  state("a NaN orientation", Status::not_finite, own, {{0, 0, 0}, {0, 0, 0, inf - inf}});
  state("an infinite orientation", Status::not_finite, own, {{0, 0, 0}, {inf, 0, 0, 1}});
  state("a zero orientation", Status::not_unit, own, {{0, 0, 0}, {0, 0, 0, 0}});
  state("a long orientation", Status::not_unit, own, {{0, 0, 0}, {0, 0, 0, 1.01f}});
  all.push_back({"the frame before", Status::bad_message,
                 [=](const Scene& scene) { return state_of(scene.ref(sender), pose, malformed_frame - 1); }});
  all.push_back({"the frame after", Status::bad_message,
                 [=](const Scene& scene) { return state_of(scene.ref(sender), pose, malformed_frame + 1); }});
  all.push_back({"a state after the last one", Status::bad_message,
                 [=](const Scene& scene) { return state_of(scene.ref(sender), pose); }, true});
  for (const Endpoint source :
       {Endpoint::server(), Endpoint::node(0), Endpoint::user(0), Endpoint::user(2), Endpoint::none()}) {
    all.push_back({"a forged source", Status::bad_message, [=](const Scene& scene) {
                     Bytes bytes = state_of(scene.ref(0), pose);
                     messages::Header header;
                     std::memcpy(&header, bytes.data(), sizeof header);
                     header.source = source.value;
                     std::memcpy(bytes.data(), &header, sizeof header);
                     return bytes;
                   }});
  }
  // Well-formed messages of types that a user node may not send.
  for (std::uint16_t type = 1; type < messages::message_types; ++type) {
    const auto kind = static_cast<MessageType>(type);
    if (kind == MessageType::state_update) continue;
    const std::size_t count = messages::record_bytes(kind, 8) == 0 ? 0 : 1;
    for (const bool afterwards : {false, true}) {
      all.push_back({std::string("a message of type ") + messages::name_of(kind), Status::bad_message,
                     [=](const Scene&) {
                       messages::Header header = header_of(kind, malformed_frame, count);
                       header.last = 1;
                       return message_of(header);
                     },
                     afterwards});
    }
    all.push_back({std::string("no record of type ") + messages::name_of(kind), Status::bad_message,
                   [=](const Scene&) { return message_of(header_of(kind, malformed_frame, 0)); }});
  }
  for (unsigned seed = 0; seed < 30; ++seed) {
    all.push_back({"garbage " + std::to_string(seed), Status::bad_message, [=](const Scene&) {
                     std::mt19937_64 random(seed);
                     Bytes bytes(1 + random() % 400);
                     for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
                     return bytes;
                   }});
  }
  for (const std::size_t keep : {1u, 47u, 48u, 49u, 100u}) {
    all.push_back({"a truncated state", Status::bad_message, [=](const Scene& scene) {
                     Bytes bytes = state_of(scene.ref(sender), pose);
                     bytes.resize(keep);
                     return bytes;
                   }});
  }
  return all;
}

/// Everything observable after a frame.
struct Outcome {
  std::vector<Pose> poses;
  std::vector<Contact> contacts;
  bool operator==(const Outcome& other) const {
    return poses == other.poses && contacts.size() == other.contacts.size() &&
           std::memcmp(contacts.data(), other.contacts.data(), contacts.size() * sizeof(Contact)) == 0;
  }
};
Outcome outcome_of(const Scene& scene) {
  Outcome outcome;
  for (const ObjectId id : scene.ids) {
    outcome.poses.push_back(scene.harness.table().row(scene.harness.table().find(id.number())).pose);
  }
  outcome.contacts.assign(scene.harness.contacts().begin(), scene.harness.contacts().end());
  return outcome;
}

TEST_CASE("an invalid message is refused with its reason, and the frame is as if it had not been sent") {
  constexpr int frames = 6;
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    std::vector<Outcome> expected;
    {
      Scene scene(deployment);
      for (int frame = 0; frame < frames; ++frame) {
        scene.harness.frame();
        expected.push_back(outcome_of(scene));
      }
      REQUIRE(expected.back().contacts.size() > 10);
    }
    for (const MalformedMessage& malformed : malformed_messages()) {
      CAPTURE(name_of(deployment));
      CAPTURE(malformed.what);
      CAPTURE(malformed.afterwards);
      Scene scene(deployment);
      bool inserted = false;
      scene.harness.tamper = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
        if (seen.from == Endpoint::user(sender) && seen.header.frame == malformed_frame &&
            seen.type() == MessageType::state_update && seen.header.last == 1 && !inserted) {
          inserted = true;
          instead.insert(malformed.afterwards ? instead.end() : instead.begin(), malformed.make(scene));
        }
      };
      for (int frame = 0; frame < frames; ++frame) {
        CAPTURE(frame);
        scene.harness.frame();
        REQUIRE((outcome_of(scene) == expected[static_cast<std::size_t>(frame)]));
        scene.harness.require_one_host_each();
        const FrameReport& report = scene.harness.report();
        REQUIRE(report.tested + report.carried == report.candidates);
        REQUIRE(report.accepted == report.candidates);
        for (std::size_t reason = 0; reason < status_count; ++reason) {
          const bool counted = frame == int{malformed_frame} && reason == static_cast<std::size_t>(malformed.reason);
          CAPTURE(name_of(static_cast<Status>(reason)));
          REQUIRE(report.refused[reason] == (counted ? 1 : 0));
        }
        // The sender gets a refusal in the next frame; no other user gets one.
        std::vector<messages::RefusedRecord> refusals;
        for (const LoggedMessage& seen : scene.harness.log()) {
          if (seen.type() != MessageType::refused) continue;
          REQUIRE(seen.to == Endpoint::user(sender));
          for (std::size_t i = 0; i < seen.header.count; ++i)
            refusals.push_back(seen.record<messages::RefusedRecord>(i));
        }
        REQUIRE(refusals.size() == (frame == int{malformed_frame} + 1 ? 1 : 0));
        REQUIRE((refusals.empty() || refusals[0].reason == static_cast<std::uint32_t>(malformed.reason)));
      }
      REQUIRE(inserted);
    }
  }
}

TEST_CASE("an invalid state among valid ones is refused alone") {
  Scene scene(Deployment::user_server);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int frame = 0; frame < 3; ++frame) scene.harness.frame();
  scene.harness.tamper = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
    if (seen.from != Endpoint::user(sender) || seen.type() != MessageType::state_update) return;
    messages::Header header = header_of(MessageType::state_update, seen.header.frame, 4);
    header.last = 1;
    header.total = 4;
    Bytes bytes(header.bytes);
    std::memcpy(bytes.data(), &header, sizeof header);
    const messages::StateRecord records[4] = {{scene.ref(sender), {{50, 50, 50}, {}}},
                                              {scene.ref(0), {{51, 51, 51}, {}}},
                                              {scene.ref(sender), {{nan, 0, 0}, {}}},
                                              {scene.ref(sender + 3), {{52, 52, 52}, {}}}};
    for (std::size_t i = 0; i < 4; ++i) {
      std::memcpy(bytes.data() + sizeof header + i * header.record_bytes, &records[i], sizeof records[i]);
    }
    instead = {bytes};
  };
  scene.harness.frame();
  const auto x = [&](std::size_t i) {
    return scene.harness.table().row(scene.harness.table().find(scene.ids[i].number())).pose.position.x;
  };
  CHECK(x(sender) == 50);
  CHECK(x(sender + 3) == 52);
  CHECK(x(0) < 50);
  CHECK(scene.harness.report().refused[static_cast<std::size_t>(Status::not_host)] == 1);
  CHECK(scene.harness.report().refused[static_cast<std::size_t>(Status::not_finite)] == 1);
}

TEST_CASE("all invalid records of a flood are counted, and only a few are reported back") {
  HarnessConfig config = Scene::config_of(Deployment::user_collision);
  config.delivery_bytes = room_for_floods;
  Scene scene(config);
  constexpr std::size_t flood = 3000;
  bool inserted = false;
  scene.harness.tamper = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
    if (seen.from != Endpoint::user(sender) || seen.type() != MessageType::state_update || inserted) return;
    inserted = true;
    for (std::size_t i = 0; i < flood; ++i) {
      instead.insert(instead.begin(), state_of(scene.ref(0), {{1, 1, 1}, {}}, seen.header.frame));
    }
  };
  scene.harness.frame();
  CHECK(scene.harness.report().refused[static_cast<std::size_t>(Status::not_host)] == flood);
  scene.harness.frame();
  std::size_t answered = 0;
  for (const LoggedMessage& seen : scene.harness.log()) {
    answered += seen.type() == MessageType::refused ? seen.header.count : 0;
  }
  CHECK(answered > 0);
  CHECK(answered <= 64);
  CHECK(scene.harness.user(sender).refused() == answered);
}

TEST_CASE("a user node that sends without end misses its deadline like a silent one") {
  HarnessConfig config;
  config.model = &drifting;
  config.user_deadline_ns = 200'000'000;  // longer than a busy machine delays this thread
  Scene scene(config);
  scene.harness.frame();
  bool flooding = false;
  scene.harness.tamper = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
    if (seen.from != Endpoint::user(sender)) return;
    instead.clear();
    flooding = true;
  };
  // The server never finds the sender's ring empty. The test is that the frame ends at all.
  const auto start = std::chrono::steady_clock::now();
  scene.harness.between = [&] {
    REQUIRE(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
    if (flooding) scene.harness.from(sender).forge(state_of(scene.ref(0), {{1, 1, 1}, {}}, 1));
  };
  scene.harness.frame();
  CHECK(scene.harness.report().late == std::vector<UserId>{UserId(sender)});
  CHECK(scene.harness.report().refused[static_cast<std::size_t>(Status::not_host)] > 0);
}

TEST_CASE("messages beyond a user node's quota are ignored, and no other frame changes") {
  for (const bool by_bytes : {false, true}) {
    CAPTURE(by_bytes);
    HarnessConfig config;
    config.delivery_bytes = room_for_floods;
    config.deployment = Deployment::user_server;
    config.model = &drifting;
    std::vector<Outcome> expected;
    for (const bool flooding : {false, true}) {
      if (flooding) {
        // The quota has room for the correct states, which come first here, and a little more.
        (by_bytes ? config.quotas.bytes : config.quotas.updates) = by_bytes ? 600 : 5;
      }
      Scene scene(config);
      scene.harness.tamper = [&](const LoggedMessage& seen, std::vector<Bytes>& instead) {
        if (!flooding || seen.from != Endpoint::user(sender) || seen.type() != MessageType::state_update) return;
        Bytes flood = state_of(scene.ref(sender), {{1, 1, 1}, {}}, seen.header.frame);
        messages::Header last = seen.header;
        std::memcpy(&last, instead.back().data(), sizeof last);
        Bytes first = instead.back();
        last.last = 0;
        std::memcpy(first.data(), &last, sizeof last);
        // Up to the quota the flood repeats the correct poses, so only records beyond it could have an effect.
        std::vector<Bytes> all{first};
        for (int i = 0; i < 4000; ++i) all.push_back(i < 2 ? first : flood);
        all.push_back(instead.back());
        instead = all;
      };
      for (int frame = 0; frame < 4; ++frame) {
        CAPTURE(frame);
        scene.harness.frame();
        const FrameReport& report = scene.harness.report();
        const std::uint64_t over = report.refused[static_cast<std::size_t>(Status::over_quota)];
        if (flooding) {
          REQUIRE((outcome_of(scene) == expected[static_cast<std::size_t>(frame)]));
          REQUIRE(over > 3900);
        } else {
          expected.push_back(outcome_of(scene));
          REQUIRE(over == 0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
