#include "nodes/host/host.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"
#include "messages/run.hpp"
#include "nodes/host/host_records.hpp"
#include "nodes/host/valid_pose.hpp"

namespace ringfence::nodes {
namespace {

/// A model that records its inputs and returns outputs from a table.
class RecordingModel : public MotionModel {
 public:
  struct Output {
    bool throws = false;
    bool pose_set = false;
    Pose pose;
    bool enabled = true;
    bool state_set = false;
    std::uint64_t state[2] = {};
  };
  explicit RecordingModel(std::size_t bytes) : bytes_(bytes) {}
  std::size_t state_bytes() const noexcept override { return bytes_; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    last_frame = frame;
    REQUIRE(inputs.size() == outputs.size());
    REQUIRE(inputs.size() <= 64);
    largest_batch = std::max(largest_batch, inputs.size());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const MotionInput& in = inputs[i];
      auto& list = received_contacts[in.number];
      list.clear();
      for (std::size_t c = 0; c < in.contacts.size(); ++c) {
        list.push_back(in.contacts[c]);
      }
      poses[in.number] = in.pose;
      user_data[in.number] = in.user_data;
      REQUIRE(reinterpret_cast<std::uintptr_t>(in.state) % 8 == 0);
      const auto at = outputs_by_number.find(in.number);
      if (at == outputs_by_number.end()) {
        continue;
      }
      // Output written before the exception must have no effect.
      if (at->second.pose_set || at->second.throws) outputs[i].pose = at->second.pose;
      outputs[i].enabled = at->second.enabled;
      if (at->second.state_set || at->second.throws)
        std::copy_n(reinterpret_cast<const std::byte*>(at->second.state), bytes_, outputs[i].state);
      if (at->second.throws) throw std::runtime_error("as configured");
    }
  }
  std::size_t bytes_;
  std::map<ObjectNumber, Output> outputs_by_number;
  mutable std::map<ObjectNumber, std::vector<Contact>> received_contacts;
  mutable std::map<ObjectNumber, Pose> poses;
  mutable std::map<ObjectNumber, std::uint64_t> user_data;
  mutable std::uint64_t last_frame = 0;
  mutable std::size_t largest_batch = 0;
};

struct State {
  std::uint64_t words[2];
};
State state_of(const Host& host, ObjectNumber number) {
  State state;
  std::memcpy(&state, host.state(host.find(number)), sizeof state);
  return state;
}
const Hosted& hosted(const Host& host, ObjectNumber number) {
  const std::uint32_t at = host.find(number);
  REQUIRE(at != base::NumberIndex::none);
  REQUIRE(host[at].object.number == number);
  return host[at];
}
void adopt(Host& host, ObjectNumber number) {
  const State state{{number, number * std::uint64_t{31}}};
  host.adopt(record_of(number), reinterpret_cast<const std::byte*>(&state));
}
std::set<ObjectNumber> changed_numbers(const Host& host) {
  std::set<ObjectNumber> numbers;
  for (const std::uint32_t i : host.changed()) {
    REQUIRE(numbers.insert(host[i].object.number).second);
  }
  return numbers;
}
Contact contact_of(ObjectNumber a, ObjectNumber b, Phase phase = Phase::begin) {
  Contact contact;
  contact.a = a;
  contact.b = b;
  contact.phase = phase;
  contact.depth = static_cast<float>(a * 100 + b);
  return contact;
}
using Keys = std::vector<std::pair<ObjectNumber, ObjectNumber>>;
Keys keys(const std::vector<Contact>& contacts) {
  Keys out;
  for (const Contact& contact : contacts) out.push_back({contact.a, contact.b});
  return out;
}

TEST_CASE("a model that does not use contacts gets none, and one that does gets all contacts of its objects") {
  class ContactlessModel : public RecordingModel {
   public:
    ContactlessModel() : RecordingModel(0) {}
    bool uses_contacts() const noexcept override { return false; }
  };
  const ContactlessModel without_contacts;
  const RecordingModel with_contacts(0);
  for (const RecordingModel* model : {static_cast<const RecordingModel*>(&without_contacts), &with_contacts}) {
    Host host(model, 4);
    for (const ObjectNumber number : {1u, 2u, 3u}) host.adopt(record_of(number), nullptr);
    host.move(1);
    host.contacts().begin(1);
    Contact contact;
    contact.a = 1;
    contact.b = 3;
    host.contacts().add(1, contact);
    host.move(2);
    const std::size_t expected = model == &with_contacts ? 1 : 0;
    CHECK(model->received_contacts.at(1).size() == expected);
    CHECK(model->received_contacts.at(2).empty());
    CHECK(model->received_contacts.at(3).size() == expected);
    CHECK(host.contacts().received(1).size() == 1);
  }
}

TEST_CASE("the model gets exactly the begin and persist contacts of each hosted object, in order of (a, b)") {
  for (const unsigned seed : {1u, 2u, 3u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    RecordingModel model(16);
    Host host(&model, 4);
    std::set<ObjectNumber> own;
    while (own.size() < 90) {
      own.insert(static_cast<ObjectNumber>(1 + random() % 200));
    }
    for (const ObjectNumber number : own) adopt(host, number);
    for (std::uint64_t frame = 0; frame < 20; ++frame) {
      std::map<std::pair<ObjectNumber, ObjectNumber>, Contact> known, late;
      for (int i = 0; i < 400; ++i) {
        const auto a = static_cast<ObjectNumber>(1 + random() % 199);
        const auto b = a + 1 + static_cast<ObjectNumber>(random() % (200 - a));
        const Phase phase = random() % 4 == 0 ? Phase::end : random() % 2 == 0 ? Phase::begin : Phase::persist;
        known[{a, b}] = contact_of(a, b, phase);
      }
      host.contacts().begin(frame);
      for (const auto& [key, contact] : known) host.contacts().add(frame, contact);
      const std::size_t received = known.size();
      if (frame % 2 == 1) {
        // Late contacts come in any order. Some are already known, and some come twice.
        std::vector<Contact> some;
        for (int i = 0; i < 60; ++i) {
          const auto a = static_cast<ObjectNumber>(1 + random() % 199);
          const auto b = a + 1 + static_cast<ObjectNumber>(random() % (200 - a));
          if (known.count({a, b}) != 0 && known[{a, b}].phase == Phase::end) continue;
          late[{a, b}] = known.count({a, b}) != 0 ? known[{a, b}] : contact_of(a, b);
          some.push_back(late[{a, b}]);
          if (random() % 3 == 0) some.push_back(late[{a, b}]);
        }
        std::shuffle(some.begin(), some.end(), random);
        for (const Contact& contact : some) host.contacts().add_late(contact);
      }
      host.contacts().begin(frame + 1);
      host.move(frame + 1);
      CHECK(model.last_frame == frame + 1);
      CHECK(model.largest_batch == 64);
      known.insert(late.begin(), late.end());
      for (const ObjectNumber number : own) {
        Keys expected;
        for (const auto& [key, contact] : known) {
          if (contact.phase != Phase::end && (key.first == number || key.second == number)) expected.push_back(key);
        }
        CAPTURE(number);
        CAPTURE(frame);
        REQUIRE((keys(model.received_contacts[number]) == expected));
        REQUIRE(model.user_data[number] == number * std::uint64_t{1000});
      }
      // The received contacts, ended ones too, stay readable.
      REQUIRE(host.contacts().received(frame).size() == received);
    }
  }
}

TEST_CASE(
    "the model gets own contacts, found in any order, merged by (a, b) with received ones, with confirmed phases") {
  for (const unsigned seed : {1u, 2u, 3u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    RecordingModel model(16);
    Host host(&model, 4);
    for (ObjectNumber number = 1; number <= 60; ++number) adopt(host, number);
    for (std::uint64_t frame = 0; frame < 20; ++frame) {
      CAPTURE(frame);
      std::map<std::pair<ObjectNumber, ObjectNumber>, Contact> own, received;
      for (int i = 0; i < 300; ++i) {
        const auto a = static_cast<ObjectNumber>(1 + random() % 99);
        const auto b = a + 1 + static_cast<ObjectNumber>(random() % (100 - a));
        const std::uint64_t kind = random() % 3;
        if (own.count({a, b}) + received.count({a, b}) == 0) {
          (kind == 0 ? received : own)[{a, b}] = contact_of(a, b, kind == 1 ? Phase::begin : Phase::persist);
        }
      }
      std::vector<std::pair<ObjectNumber, ObjectNumber>> found;
      for (const auto& [key, contact] : own) found.push_back(key);
      std::shuffle(found.begin(), found.end(), random);
      host.contacts().begin(frame);
      for (const auto& key : found) {
        Contact& contact = host.contacts().add_own(frame);
        const Phase guess = contact.phase;
        contact = own[key];
        contact.phase = guess;
      }
      for (const auto& [key, contact] : own) {
        const auto at = static_cast<std::uint32_t>(std::find(found.begin(), found.end(), key) - found.begin());
        const auto likely_place = [&](ObjectNumber number) {  // an index that is right, missing, or of another object
          const std::uint64_t draw = random() % 4;
          return draw == 0   ? base::NumberIndex::none
                 : draw == 1 ? static_cast<std::uint32_t>(random() % 80)
                             : host.find(number);
        };
        host.contacts().order_own(frame, std::uint64_t{key.first} << 32 | key.second, at, likely_place(key.first),
                                  likely_place(key.second));
        if (contact.phase == Phase::begin) host.contacts().confirm_begin(frame, at);
      }
      for (const auto& [key, contact] : received) host.contacts().add(frame, contact);
      REQUIRE(host.contacts().received(frame).size() == received.size());
      host.contacts().begin(frame + 1);
      host.move(frame + 1);
      received.insert(own.begin(), own.end());
      for (ObjectNumber number = 1; number <= 60; ++number) {
        CAPTURE(number);
        Keys expected;
        std::vector<Phase> phases, received_contacts;
        for (const auto& [key, contact] : received) {
          if (key.first == number || key.second == number) {
            expected.push_back(key);
            phases.push_back(contact.phase);
          }
        }
        for (const Contact& contact : model.received_contacts[number]) received_contacts.push_back(contact.phase);
        REQUIRE((keys(model.received_contacts[number]) == expected));
        REQUIRE((received_contacts == phases));
      }
    }
  }
}

TEST_CASE("the model gets the contacts of given lists instead of the host's own, for one frame") {
  RecordingModel model(16);
  Host host(&model, 4);
  adopt(host, 5);
  host.contacts().begin(0);
  host.contacts().add(0, contact_of(2, 5));
  const std::vector<Contact> given = {contact_of(1, 5), contact_of(5, 9), contact_of(6, 7)};
  std::vector<std::uint64_t> given_keys;
  for (const Contact& contact : given) given_keys.push_back(base::PairSort::key(contact.a, contact.b));
  host.contacts().read(given, given_keys);
  host.contacts().begin(1);
  host.contacts().add(1, contact_of(3, 5));
  host.move(1);
  CHECK((keys(model.received_contacts[5]) == Keys{{1, 5}, {5, 9}}));
  host.contacts().begin(2);
  host.move(2);
  CHECK((keys(model.received_contacts[5]) == Keys{{3, 5}}));
}

TEST_CASE("late contacts count for one frame only") {
  RecordingModel model(16);
  Host host(&model, 4);
  adopt(host, 5);
  host.contacts().begin(0);
  host.contacts().add_late(contact_of(5, 9));
  host.contacts().begin(1);
  host.move(1);
  CHECK(model.received_contacts[5].size() == 1);
  host.contacts().begin(2);
  host.move(2);
  CHECK(model.received_contacts[5].empty());
}

TEST_CASE(
    "an object that was placed has jumped in that frame only, also where the model throws for another of its batch") {
  for (const bool throws : {false, true}) {
    CAPTURE(throws);
    RecordingModel model(0);
    model.outputs_by_number[2].throws = throws;
    Host host(&model, 4);
    for (const ObjectNumber number : {1u, 2u, 3u}) host.adopt(record_of(number), nullptr);
    host.place(1, {{5, 5, 5}, {}}, true);
    host.move(1);
    CHECK(hosted(host, 1).object.flags == (messages::flag_present | messages::flag_jumped));
    CHECK(hosted(host, 3).object.flags == messages::flag_present);
    host.move(2);
    CHECK(hosted(host, 1).object.flags == messages::flag_present);
  }
}

TEST_CASE("objects for which the model throws keep pose, presence and state and are counted; the others move") {
  for (const unsigned seed : {1u, 2u, 3u, 4u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    RecordingModel model(16);
    Host host(&model, 4);
    const ObjectNumber count = 150;
    std::set<ObjectNumber> throwing;
    for (ObjectNumber number = 1; number <= count; ++number) {
      adopt(host, number);
      RecordingModel::Output output;
      output.pose_set = output.state_set = true;
      output.pose.position = {static_cast<double>(number), 50, 3};
      output.state[0] = number + 1;
      output.throws = seed == 4 || random() % (seed == 3 ? 2 : 20) == 0;
      output.enabled = !output.throws;
      if (output.throws) throwing.insert(number);
      model.outputs_by_number[number] = output;
    }
    host.contacts().begin(0);
    host.move(0);
    CHECK(host.refusals().model_failed == throwing.size());
    CHECK(host.refusals().not_finite == 0);
    for (ObjectNumber number = 1; number <= count; ++number) {
      CAPTURE(number);
      const bool unchanged = throwing.count(number) != 0;
      CHECK(hosted(host, number).pose.position.y == (unchanged ? 2 : 50));
      CHECK(hosted(host, number).object.flags == messages::flag_present);
      CHECK(state_of(host, number).words[0] == number + (unchanged ? 0 : 1));
    }
    CHECK(changed_numbers(host).size() == count - throwing.size());
    // The count is per frame.
    model.outputs_by_number.clear();
    host.contacts().begin(1);
    host.move(1);
    CHECK(host.refusals().model_failed == 0);
  }
}

TEST_CASE("a model output that is not finite or not unit is refused by reason and the object does not move") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const Pose bad[] = {{{nan, 0, 0}, {}},          {{0, -1.0 / 0.0, 0}, {}},      {{0, 0, 0}, {inf, 0, 0, 1}},
                      {{0, 0, 0}, {0, 0, 0, 0}},  {{0, 0, 0}, {0, 0, 0, 1.01f}}, {{0, 0, 0}, {0, 0, 0, 1e30f}},
                      {{0, 0, 0}, {0, 0, 0, -2}}, {{0, 0, nan}, {0, 0, 0, 5}}};
  RecordingModel model(16);
  Host host(&model, 4);
  for (ObjectNumber number = 1; number <= 20; ++number) {
    adopt(host, number);
    RecordingModel::Output output;
    output.pose_set = output.state_set = true;
    output.state[0] = 99;
    if (number <= std::size(bad)) {
      output.pose = bad[number - 1];
      output.enabled = false;
    } else {
      output.pose.position = {7, 7, 7};
    }
    model.outputs_by_number[number] = output;
  }
  host.contacts().begin(0);
  host.move(0);
  CHECK(host.refusals().not_finite == 4);
  CHECK(host.refusals().not_unit == 4);
  CHECK(host.refusals().model_failed == 0);
  for (ObjectNumber number = 1; number <= 20; ++number) {
    const bool unchanged = number <= std::size(bad);
    CHECK(hosted(host, number).pose.position.x == (unchanged ? number : 7));
    CHECK(state_of(host, number).words[0] == (unchanged ? number : 99u));
    CHECK(hosted(host, number).object.flags == messages::flag_present);
  }
  CHECK(changed_numbers(host).size() == 12);
}

TEST_CASE("exactly the objects with changed pose, presence or state, placed or steered, are listed as changed") {
  RecordingModel model(16);
  Host host(&model, 4);
  for (ObjectNumber number = 1; number <= 7; ++number) adopt(host, number);
  RecordingModel::Output output;
  output.pose_set = true;
  output.pose = record_of(1).pose;
  output.pose.position.y = 10;
  model.outputs_by_number[1] = output;
  output = {};
  output.enabled = false;
  model.outputs_by_number[2] = output;
  output = {};
  output.state_set = true;
  output.state[0] = 8;
  model.outputs_by_number[3] = output;
  host.place(4, {{1, 1, 1}, {}}, true);
  host.steer(5, {{2, 2, 2}, {}});
  host.steer(5, {{3, 3, 3}, {}});
  host.steer(77, {});        // not hosted here
  host.place(78, {}, true);  // not hosted here
  host.contacts().begin(0);
  host.move(0);
  CHECK((changed_numbers(host) == std::set<ObjectNumber>{1, 2, 3, 4, 5}));
  CHECK(model.poses[4].position.x == 1);  // the model continues from the placed pose
  CHECK(hosted(host, 5).pose.position.x == 3);
  CHECK(hosted(host, 2).object.flags == 0);
  model.outputs_by_number.clear();
  host.contacts().begin(1);
  host.move(1);
  CHECK(host.changed().empty());
  CHECK(hosted(host, 2).object.flags == 0);  // an absent object stays absent without an output
}

TEST_CASE("a steered object stands at its steered pose for one frame, whatever the model computes") {
  RecordingModel model(16);
  Host host(&model, 4);
  adopt(host, 1);
  RecordingModel::Output output;
  output.pose_set = true;
  output.pose.position = {9, 9, 9};
  model.outputs_by_number[1] = output;
  host.steer(1, {{4, 4, 4}, {}});
  host.contacts().begin(0);
  host.move(0);
  CHECK(hosted(host, 1).pose.position.x == 4);
  host.contacts().begin(1);
  host.move(1);
  CHECK(hosted(host, 1).pose.position.x == 9);
}

TEST_CASE("without a model nothing moves by itself, but places and steers still count") {
  Host host(nullptr, 0);
  const std::byte none{};
  for (ObjectNumber number = 1; number <= 3; ++number) host.adopt(record_of(number), &none);
  host.place(1, {{5, 5, 5}, {}}, false);
  host.steer(2, {{6, 6, 6}, {}});
  host.contacts().begin(0);
  host.move(0);
  CHECK((changed_numbers(host) == std::set<ObjectNumber>{1, 2}));
  CHECK(hosted(host, 1).object.flags == messages::flag_jumped);
  CHECK(hosted(host, 3).pose.position.x == 3);
  host.contacts().begin(1);
  host.move(1);
  CHECK(hosted(host, 1).object.flags == 0);
  host.drop(1);
  CHECK(host.size() == 2);
}

TEST_CASE("a pose within 10^-3 of unit length is valid, is normalised once, and does not change afterwards") {
  constexpr unsigned seed = 6;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> off(-3e-3, 3e-3);
  for (int round = 0; round < 100000; ++round) {
    double q[4] = {normal(random), normal(random), normal(random), normal(random)};
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double scale = (round % 3 == 0 ? 1.0 : 1.0 + off(random)) / length;
    Pose pose;
    pose.orientation = {static_cast<float>(q[0] * scale), static_cast<float>(q[1] * scale),
                        static_cast<float>(q[2] * scale), static_cast<float>(q[3] * scale)};
    const Pose received_contacts = pose;
    const auto length_of = [](const Quat& r) {
      return std::sqrt(double{r.x} * double{r.x} + double{r.y} * double{r.y} + double{r.z} * double{r.z} +
                       double{r.w} * double{r.w});
    };
    const double error = std::abs(length_of(received_contacts.orientation) - 1);
    const Status status = make_valid(pose);
    if (error < 0.999e-3) {
      REQUIRE(status == Status::ok);
    } else if (error > 1.01e-3) {
      REQUIRE(status == Status::not_unit);
    }
    if (status != Status::ok) {
      REQUIRE(pose == received_contacts);
      continue;
    }
    REQUIRE(std::abs(length_of(pose.orientation) - 1) < 6e-7);
    Pose again = pose;
    REQUIRE(make_valid(again) == Status::ok);
    REQUIRE(std::memcmp(&again, &pose, sizeof pose) == 0);
  }
}

}  // namespace
}  // namespace ringfence::nodes
