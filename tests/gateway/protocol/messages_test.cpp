#include <cmath>
#include <limits>
#include <random>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/protocol/byte_reader.hpp"
#include "gateway/protocol/byte_writer.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"

namespace ringfence::gateway {
namespace {

using Random = std::mt19937_64;
using Bytes = std::vector<std::byte>;

/// Numbers of all magnitudes.
std::uint64_t any_number(Random& random) { return random() >> (random() % 64); }

/// The message that is read views `bytes`.
template <class Message>
Message written_and_read(const Message& message, Bytes& bytes) {
  bytes.clear();
  write(message, bytes);
  const ClientMessage read = read_client_message(bytes);
  REQUIRE(std::holds_alternative<Message>(read));
  // No shorter and no longer message is one.
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const ClientMessage part = read_client_message(std::span(bytes).first(size));
    const bool is_shorter_body = std::holds_alternative<Application>(part) && size > 0;
    CHECK_MESSAGE((std::holds_alternative<Malformed>(part) || is_shorter_body), size);
  }
  return std::get<Message>(read);
}

Update any_update(Random& random) {
  Update update;
  update.frame = any_number(random);
  update.since = any_number(random);
  update.time_us = any_number(random);
  update.sequence = any_number(random);
  update.age = any_number(random);
  update.echo = static_cast<std::uint16_t>(random());
  update.hold_ms = any_number(random);
  static const Bytes state(16, std::byte{7});
  if (random() % 2 == 0) update.own = OwnState{9, ShapeId(6), {{1.5, -2, 1e9}, {0, 0, 0.6f, 0.8f}}, state};
  const auto position = [&]() -> QuantisedPosition {
    const auto coordinate = [&] {
      return static_cast<std::int64_t>(any_number(random) >> 2) * (random() % 2 ? 1 : -1);
    };
    return {coordinate(), coordinate(), coordinate()};
  };
  update.origin = position();
  ObjectNumber number = 0;
  const auto next_number = [&] { return number += 1 + static_cast<ObjectNumber>(random() % 100'000); };
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    update.entered.push_back({next_number(), static_cast<std::uint32_t>(random()), ShapeId(3), Category::fixed,
                              random() % 2 ? no_user : UserId(static_cast<std::uint32_t>(random() >> 33)), position(),
                              static_cast<std::uint32_t>(random()), std::span(state).first(random() % 16)});
  }
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    MovedObject moved{next_number(), random() % 2 == 0, 0, position()};
    if (moved.has_turn) moved.turn = static_cast<std::uint32_t>(random());
    update.moved.push_back(moved);
  }
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) update.removed.push_back(next_number());
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    OwnContact contact{next_number(), static_cast<Phase>(random() % 3), any_number(random), {}, 0, {}};
    if (contact.phase != Phase::end) {
      contact.normal = {-127, 5, 127};
      contact.depth = any_number(random);
      contact.point = position();
    }
    update.contacts.push_back(contact);
  }
  ObjectNumber a = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    const bool has_same = !update.touching.empty() && random() % 2 == 0;
    if (!has_same) a += 1 + static_cast<ObjectNumber>(random() % 1000);
    const ObjectNumber after = has_same ? update.touching.back().b : a;
    update.touching.push_back({a, after + 1 + static_cast<ObjectNumber>(random() % 1000)});
  }
  return update;
}

}  // namespace

TEST_CASE("variable-length integers of all magnitudes are read back, in the shortest form only") {
  Random random(1);
  for (int i = 0; i < 10'000; ++i) {
    const std::uint64_t value = any_number(random);
    const auto signed_value = static_cast<std::int64_t>(random());
    Bytes bytes;
    {
      ByteWriter writer(bytes);
      writer.var(value);
      writer.svar(signed_value);
    }
    ByteReader reader(bytes);
    CHECK(reader.var() == value);
    CHECK(reader.svar() == signed_value);
    CHECK(reader.at_end());
  }
  const Bytes longer{std::byte{0x81}, std::byte{0x00}};
  ByteReader reader(longer);
  reader.var();
  CHECK_FALSE(reader.ok());
  const Bytes too_large(10, std::byte{0xff});
  ByteReader large(too_large);
  large.var();
  CHECK_FALSE(large.ok());
}

TEST_CASE("each message of a client is read back") {
  Bytes bytes;
  const Bytes body{std::byte{1}, std::byte{2}, std::byte{3}};
  CHECK(written_and_read(Hello{"a token"}, bytes).token == "a token");
  const Input input = written_and_read(Input{7, 300, 65535, body}, bytes);
  CHECK(input.ack == 7);
  CHECK(input.sequence == 300);
  CHECK(input.time == 65535);
  CHECK(std::ranges::equal(input.body, body));
  CHECK(written_and_read(Ack{1'000'000'000'000}, bytes).ack == 1'000'000'000'000);
  CHECK(written_and_read(GetShape{ShapeId(5)}, bytes).shape == ShapeId(5));
  CHECK(std::ranges::equal(written_and_read(Application{body}, bytes).body, body));
  const View view = written_and_read(View{{1, -2, 3e9}, 40}, bytes);
  CHECK(view.centre == Vec3d{1, -2, 3e9});
  CHECK(view.radius == 40);
  CHECK(written_and_read(Describe{4'000'000'000}, bytes).number == 4'000'000'000);
  const Command command = written_and_read(Command{Command::Kind::kill, 12}, bytes);
  CHECK(command.kind == Command::Kind::kill);
  CHECK(command.value == 12);
}

TEST_CASE("messages of a client with invalid values are malformed, with a reason") {
  const auto reason = [](const auto& message) {
    Bytes bytes;
    write(message, bytes);
    const ClientMessage read = read_client_message(bytes);
    return std::holds_alternative<Malformed>(read) ? std::string(std::get<Malformed>(read).reason) : std::string();
  };
  const Bytes long_body(33), long_application(1025);
  CHECK_FALSE(reason(Input{0, 0, 0, {}}).empty());
  CHECK_FALSE(reason(Input{0, 1, 0, long_body}).empty());
  CHECK_FALSE(reason(Application{long_application}).empty());
  CHECK_FALSE(reason(View{{std::numeric_limits<double>::quiet_NaN(), 0, 0}, 1}).empty());
  CHECK_FALSE(reason(View{{0, 0, 0}, std::numeric_limits<double>::infinity()}).empty());
  CHECK_FALSE(reason(View{{0, 0, 0}, -1}).empty());
  CHECK_FALSE(reason(Command{static_cast<Command::Kind>(4), 0}).empty());
  CHECK(std::holds_alternative<Malformed>(read_client_message({})));
  const Bytes other_version{std::byte{1}, std::byte{2}, std::byte{0}};
  CHECK(std::holds_alternative<Malformed>(read_client_message(other_version)));
}

TEST_CASE(
    "random bytes as messages of a client are read without an error, and written as they were if they are valid") {
  Random random(2);
  std::size_t valid = 0;
  for (int i = 0; i < 200'000; ++i) {
    Bytes bytes(1 + random() % 40);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 3 == 0 ? random() % 10 : random());
    bytes[0] = static_cast<std::byte>(random() % 10);
    const ClientMessage message = read_client_message(bytes);
    if (std::holds_alternative<Malformed>(message)) continue;
    ++valid;
    Bytes again;
    std::visit(
        [&](const auto& each) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(each)>, Malformed>) write(each, again);
        },
        message);
    CHECK(again == bytes);
  }
  CHECK(valid > 1000);
}

TEST_CASE("updates are read back, and their parts and changed bytes are refused or read without an error") {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const Update update = any_update(random);
    Bytes bytes, again;
    write(update, bytes);
    Update read_back;
    REQUIRE(read(bytes, read_back));
    write(read_back, again);
    CHECK(again == bytes);
    CHECK(read_back.frame == update.frame);
    CHECK(read_back.removed == update.removed);
    REQUIRE(read_back.entered.size() == update.entered.size());
    for (std::size_t k = 0; k < update.entered.size(); ++k) {
      CHECK(read_back.entered[k].number == update.entered[k].number);
      CHECK(read_back.entered[k].position == update.entered[k].position);
      CHECK(read_back.entered[k].user == update.entered[k].user);
    }
    REQUIRE(read_back.moved.size() == update.moved.size());
    for (std::size_t k = 0; k < update.moved.size(); ++k) {
      CHECK(read_back.moved[k].number == update.moved[k].number);
      CHECK(read_back.moved[k].position == update.moved[k].position);
      CHECK(read_back.moved[k].turn == update.moved[k].turn);
    }
    for (std::size_t size = 0; size < bytes.size(); ++size) CHECK_FALSE(read(std::span(bytes).first(size), read_back));
    for (int change = 0; change < 20; ++change) {
      Bytes changed = bytes;
      changed[random() % changed.size()] = static_cast<std::byte>(random());
      read(changed, read_back);
    }
  }
}

TEST_CASE("positions at opposite ends of the numbers are read back") {
  constexpr std::int64_t low = std::numeric_limits<std::int64_t>::min(),
                         high = std::numeric_limits<std::int64_t>::max();
  Update update, found;
  update.origin = {high, low, 0};
  update.moved = {{6, false, 0, {low, high, low}}, {7, false, 0, {high, low, high}}};
  Bytes bytes;
  write(update, bytes);
  REQUIRE(read(bytes, found));
  CHECK(found.origin == update.origin);
  REQUIRE(found.moved.size() == 2);
  CHECK(found.moved[0].position == update.moved[0].position);
  CHECK(found.moved[1].position == update.moved[1].position);
}

TEST_CASE("a welcome and shapes are read back") {
  const Bytes parameters(16, std::byte{3});
  Welcome welcome;
  welcome.role = Role::operate;
  welcome.user = UserId(0);
  welcome.avatar = 77;
  welcome.frames = 5;
  welcome.rate = 20;
  welcome.interest = 25;
  welcome.bounds_min = {-1, -2, -3};
  welcome.bounds_max = {1, 2, 3};
  welcome.world = "a world";
  welcome.model = "walk";
  welcome.parameters = parameters;
  welcome.token = "token";
  Bytes bytes;
  write(welcome, bytes);
  Welcome back;
  REQUIRE(read(bytes, back));
  CHECK(back.role == Role::operate);
  CHECK(back.user == UserId(0));
  CHECK(back.avatar == 77);
  CHECK(back.bounds_max == Vec3d{1, 2, 3});
  CHECK(back.world == "a world");
  CHECK(back.model == "walk");
  CHECK(back.token == "token");

  const std::vector<ShapeDescription> shapes{Sphere{2}, Box{{1, 2, 3}}, Capsule{0.5f, 1},
                                             ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                             TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}}};
  for (const ShapeDescription& shape : shapes) {
    Bytes first, second;
    write_shape(ShapeId(4), &shape, first);
    ShapeId id;
    std::optional<ShapeDescription> read_back;
    REQUIRE(read_shape(first, id, read_back));
    CHECK(id == ShapeId(4));
    REQUIRE(read_back.has_value());
    CHECK(read_back->index() == shape.index());
    write_shape(ShapeId(4), &*read_back, second);
    CHECK(first == second);
  }
  Bytes none;
  write_shape(ShapeId(9), nullptr, none);
  ShapeId id;
  std::optional<ShapeDescription> read_back;
  CHECK(read_shape(none, id, read_back));
  CHECK_FALSE(read_back.has_value());
}

TEST_CASE("positions and orientations are within the stated errors") {
  Random random(4);
  std::uniform_real_distribution<double> place(-1e6, 1e6);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3d p{place(random), place(random), place(random)}, q = position_of(quantise(p));
    CHECK(std::abs(p.x - q.x) <= quantum / 2);
    CHECK(std::abs(p.y - q.y) <= quantum / 2);
    CHECK(std::abs(p.z - q.z) <= quantum / 2);
    double a[4] = {normal(random), normal(random), normal(random), normal(random)};
    const double length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + a[3] * a[3]);
    const Quat turn{static_cast<float>(a[0] / length), static_cast<float>(a[1] / length),
                    static_cast<float>(a[2] / length), static_cast<float>(a[3] / length)};
    const Quat back = orientation_of(quantise(turn));
    const double dot =
        std::abs(double{turn.x} * back.x + double{turn.y} * back.y + double{turn.z} * back.z + double{turn.w} * back.w);
    CHECK(2 * std::acos(std::min(1.0, dot)) < 0.005);
  }
  CHECK(quantise(Vec3d{1e300, -1e300, 0}).x == std::int64_t{1} << 62);
  for (const std::uint32_t turn : {0u, 0x3fffffffu, 0xffffffffu, 0x80000000u}) {
    const Quat q = orientation_of(turn);
    CHECK(std::abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1) < 1e-5f);
  }
}

}  // namespace ringfence::gateway
