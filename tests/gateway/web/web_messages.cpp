// Prints messages that the gateway's codec wrote, with what they contain, as JSON: client.js has to read the same.
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "gateway/protocol/server_messages.hpp"

namespace ringfence::gateway {
namespace {

using Json = nlohmann::json;
using Random = std::mt19937_64;
using Bytes = std::vector<std::byte>;

std::string hex_of(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    constexpr const char* digits = "0123456789abcdef";
    text += digits[static_cast<unsigned>(byte) >> 4];
    text += digits[static_cast<unsigned>(byte) & 15];
  }
  return text;
}

/// Numbers of all magnitudes that a JavaScript number has exactly.
std::uint64_t any_number(Random& random) { return random() >> (13 + random() % 51); }
QuantisedPosition any_position(Random& random) {
  const auto coordinate = [&] { return static_cast<std::int64_t>(any_number(random) >> 3) * (random() % 2 ? 1 : -1); };
  return {coordinate(), coordinate(), coordinate()};
}
Json json_of(const QuantisedPosition& position) {
  const Vec3d metres = position_of(position);
  return {metres.x, metres.y, metres.z};
}
Json json_of(const Quat& q) { return {q.x, q.y, q.z, q.w}; }

/// An update with every kind of record, and what a reader has to find in it.
Json write_update(Random& random, Bytes& bytes) {
  const Bytes state(random() % 20, std::byte{7});
  Update update;
  update.frame = any_number(random), update.since = any_number(random), update.time_us = any_number(random);
  update.sequence = any_number(random), update.age = any_number(random), update.hold_ms = any_number(random);
  update.echo = static_cast<std::uint16_t>(random());
  update.origin = any_position(random);
  Json entered = Json::array(), moved = Json::array(), contacts = Json::array(), own;
  if (random() % 2 == 0) {
    update.own = OwnState{9, ShapeId(6), {{1.5, -2, 1e9}, {0, 0, 0.6f, 0.8f}}, state};
    own = {{"number", 9},
           {"shape", 6},
           {"position", {1.5, -2, 1e9}},
           {"orientation", {0, 0, 0.6f, 0.8f}},
           {"state", hex_of(state)}};
  }
  ObjectNumber number = 0;
  const auto next_number = [&] { return number += 1 + static_cast<ObjectNumber>(random() % 1'000'000); };
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    const EnteredObject object{next_number(),
                               static_cast<std::uint32_t>(random()),
                               ShapeId(static_cast<std::uint32_t>(random() % 300)),
                               static_cast<Category>(random() % 4),
                               random() % 2 ? no_user : UserId(static_cast<std::uint32_t>(random() % 65536)),
                               any_position(random),
                               static_cast<std::uint32_t>(random()),
                               state};
    update.entered.push_back(object);
    entered.push_back({{"number", object.number},
                       {"generation", object.generation},
                       {"shape", object.shape.number()},
                       {"category", static_cast<int>(object.category)},
                       {"user", object.user == no_user ? -1 : static_cast<std::int64_t>(object.user.number())},
                       {"metadata", hex_of(state)},
                       {"position", json_of(object.position)},
                       {"orientation", json_of(orientation_of(object.turn))}});
  }
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    MovedObject object{next_number(), random() % 2 == 0, 0, any_position(random)};
    if (object.has_turn) object.turn = static_cast<std::uint32_t>(random());
    update.moved.push_back(object);
    moved.push_back({{"number", object.number},
                     {"position", json_of(object.position)},
                     {"orientation", object.has_turn ? json_of(orientation_of(object.turn)) : Json()}});
  }
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) update.removed.push_back(next_number());
  number = 0;
  for (std::uint64_t i = random() % 5; i > 0; --i) {
    OwnContact contact{next_number(), static_cast<Phase>(random() % 3), any_number(random), {}, 0, {}};
    Json record{{"number", contact.other}, {"phase", name_of(contact.phase)}, {"age", contact.age}};
    if (contact.phase != Phase::end) {
      contact.normal = {-127, 5, 127};
      contact.depth = any_number(random) >> 10;
      contact.point = any_position(random);
      record["normal"] = {-1.0, 5.0 / 127, 1.0};
      record["depth"] = static_cast<double>(contact.depth) / 512;
      record["point"] = json_of(contact.point);
    }
    update.contacts.push_back(contact);
    contacts.push_back(record);
  }
  Json touching = Json::array();
  number = 0;
  for (std::uint64_t i = random() % 4; i > 0; --i) {
    const ObjectNumber a = next_number(), b = a + 1 + static_cast<ObjectNumber>(random() % 100'000);
    update.touching.push_back({a, b});
    touching.push_back({a, b});
  }
  write(update, bytes);
  return {{"type", "update"},          {"touching", touching},
          {"frame", update.frame},     {"since", update.since},
          {"time", update.time_us},    {"sequence", update.sequence},
          {"age", update.age},         {"echo", update.echo},
          {"hold", update.hold_ms},    {"own", own},
          {"entered", entered},        {"moved", moved},
          {"removed", update.removed}, {"contacts", contacts}};
}

Json write_welcome(Bytes& bytes) {
  const Bytes parameters(20, std::byte{1});
  const Welcome welcome{Role::operate, no_user, 77,     1'000'000'000'000, 20,     25, {-1, -2, -3},
                        {1, 2, 1e15},  "world", "walk", parameters,        "token"};
  write(welcome, bytes);
  return {{"type", "welcome"},
          {"role", "operate"},
          {"user", -1},
          {"avatar", 77},
          {"frame", 999'999'999'999},
          {"rate", 20},
          {"interest", 25},
          {"bounds", {-1, -2, -3, 1, 2, 1e15}},
          {"world", "world"},
          {"model", "walk"},
          {"parameters", hex_of(parameters)},
          {"token", "token"}};
}

Json write_shape_of(std::uint32_t number, Bytes& bytes) {
  const std::vector<ShapeDescription> shapes{Sphere{2}, Box{{1, 2, 3}}, Capsule{0.5f, 1},
                                             ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                             TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}}};
  const Json hull_points{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, mesh_points{0, 0, 0, 1, 0, 0, 0, 1, 0};
  const Json expected[] = {{{"kind", "sphere"}, {"radius", 2}},
                           {{"kind", "box"}, {"half", {1, 2, 3}}},
                           {{"kind", "capsule"}, {"radius", 0.5}, {"halfLength", 1}},
                           {{"kind", "hull"}, {"points", hull_points}},
                           {{"kind", "mesh"}, {"points", mesh_points}, {"triangles", {0, 1, 2}}},
                           {{"kind", "none"}}};
  write_shape(ShapeId(number), number < shapes.size() ? &shapes[number] : nullptr, bytes);
  Json json = expected[number];
  json["type"] = "shape";
  json["shape"] = number;
  return json;
}

}  // namespace
}  // namespace ringfence::gateway

int main() {
  using namespace ringfence::gateway;
  Json messages = Json::array();
  Random random(11);
  const auto add = [&](auto write) {
    Bytes bytes;
    const Json message = write(bytes);
    messages.push_back({{"bytes", hex_of(bytes)}, {"message", message}});
  };
  add([](Bytes& bytes) { return write_welcome(bytes); });
  for (std::uint32_t shape = 0; shape < 6; ++shape) add([&](Bytes& bytes) { return write_shape_of(shape, bytes); });
  for (int i = 0; i < 500; ++i) add([&](Bytes& bytes) { return write_update(random, bytes); });
  std::printf("%s\n", messages.dump().c_str());
}
