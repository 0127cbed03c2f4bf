#include "nodes/host/frame_inputs.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

#include "messages/records.hpp"
#include "nodes/host/host.hpp"

namespace ringfence::nodes {
namespace {

using Bytes = std::vector<std::byte>;

/// Stores the input of each object in the last move, and throws for one object.
class InputModel final : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput>) const override {
    for (const MotionInput& in : inputs) {
      if (in.number == throws_for) throw std::runtime_error("as configured");
    }
    for (const MotionInput& in : inputs) received[in.number] = Bytes(in.input.begin(), in.input.end());
  }
  ObjectNumber throws_for = 0;
  mutable std::map<ObjectNumber, Bytes> received;
};

void adopt(Host& host, ObjectNumber number) {
  messages::HandOverRecord record;
  record.object = {number, 1, number, messages::flag_present};
  record.category = static_cast<std::uint16_t>(Category::avatar);
  host.adopt(record, nullptr);
}

ObjectInput input_of(ObjectNumber number, const Bytes& bytes) {
  ObjectInput input;
  input.number = number;
  input.size = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), input.bytes.begin());
  return input;
}

template <class Random>
Bytes random_bytes(Random& random) {
  Bytes bytes(random() % (max_input_bytes + 1));
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

TEST_CASE("each object gets the last input that was given for it, in one move only, also if the model throws") {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    auto random = [engine = std::mt19937(seed)]() mutable { return static_cast<std::uint32_t>(engine()); };
    InputModel model;
    Host host(&model, 300);
    for (ObjectNumber number = 1; number <= 300; ++number) adopt(host, number);
    for (std::uint64_t frame = 1; frame <= 4; ++frame) {
      std::map<ObjectNumber, Bytes> expected;
      for (std::uint32_t n = random() % 400; n > 0; --n) {
        const ObjectNumber number = 1 + random() % 320;  // those above 300 are not hosted
        host.give_input(input_of(number, expected[number] = random_bytes(random)));
      }
      model.throws_for = frame % 2 == 0 ? 1 + random() % 300 : 0;
      const ObjectNumber dropped = 1 + random() % 300;
      host.drop(dropped);  // the last object takes its index
      model.received.clear();
      host.move(frame);
      for (ObjectNumber number = 1; number <= 300; ++number) {
        CAPTURE(number);
        const bool moves = number != dropped && number != model.throws_for;
        REQUIRE(model.received.contains(number) == moves);
        if (moves) REQUIRE(model.received[number] == expected[number]);
      }
      adopt(host, dropped);
    }
  }
}

TEST_CASE("an input that is given for an object before it is adopted arrives; that of an earlier move does not") {
  InputModel model;
  Host host(&model, 4);
  const Bytes bytes = {std::byte{7}, std::byte{0}};
  host.give_input(input_of(5, bytes));
  adopt(host, 5);
  host.begin_move(1);
  while (host.move_next()) {
  }
  CHECK(model.received.at(5) == bytes);
  host.move(2);
  CHECK(model.received.at(5).empty());
  host.give_input(input_of(9, bytes));
  host.move(3);
  adopt(host, 9);
  host.move(4);
  CHECK(model.received.at(9).empty());
}

}  // namespace
}  // namespace ringfence::nodes
