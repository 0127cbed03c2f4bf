#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "gateway/protocol/quantised.hpp"
#include "gateway/transport.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::gateway {

/// The first byte of a message of the gateway.
enum class ServerMessageType : std::uint8_t {
  welcome = 1,
  update = 2,
  shape = 3,
  application = 4,
  status = 5,
  described = 6,
  notice = 7,
};

/// Largest metadata of an object, bytes.
inline constexpr std::size_t max_metadata_bytes = 64;

// The messages of the gateway, as docs/client-protocol.md describes them.

struct Welcome {
  Role role = Role::play;
  UserId user = no_user;
  ObjectNumber avatar = 0;   ///< 0: none
  std::uint64_t frames = 0;  ///< number of complete frames
  float rate = 0;            ///< frames per second
  float interest = 0;        ///< metres
  Vec3d bounds_min, bounds_max;
  std::string_view world;
  std::string_view model;
  std::span<const std::byte> parameters;
  std::string_view token;
};

/// The avatar of the client, exact.
struct OwnState {
  ObjectNumber number = 0;
  ShapeId shape;
  Pose pose;
  std::span<const std::byte> state;
};
struct EnteredObject {
  ObjectNumber number = 0;
  std::uint32_t generation = 0;
  ShapeId shape;
  Category category = Category::active;
  UserId user = no_user;
  QuantisedPosition position;
  std::uint32_t turn = 0;
  std::span<const std::byte> metadata;
};
struct MovedObject {
  ObjectNumber number = 0;
  bool has_turn = false;
  std::uint32_t turn = 0;
  QuantisedPosition position;
};
struct OwnContact {
  ObjectNumber other = 0;
  Phase phase = Phase::begin;
  std::uint64_t age = 0;  ///< frames since it began, or ended
  // Not if the phase is end.
  QuantisedNormal normal;   ///< from the avatar to the other object
  std::uint64_t depth = 0;  ///< quanta
  QuantisedPosition point;
};

/// Two objects that touch, for spectators; a < b.
struct TouchingPair {
  ObjectNumber a = 0, b = 0;
};

/// The state of what a client sees after one frame, or what changed in it. Lists are in ascending order of number.
struct Update {
  std::uint64_t frame = 0;
  std::uint64_t since = 0;  ///< 0: everything
  std::uint64_t time_us = 0;
  std::uint64_t sequence = 0;
  std::uint64_t age = 0;
  std::uint16_t echo = 0;
  std::uint64_t hold_ms = 0;
  std::optional<OwnState> own;
  QuantisedPosition origin;
  std::vector<EnteredObject> entered;
  std::vector<MovedObject> moved;
  std::vector<ObjectNumber> removed;
  std::vector<OwnContact> contacts;
  std::vector<TouchingPair> touching;
  /// Empties it, and keeps the memory of the lists.
  void clear() noexcept;
};

/// Appends a message to bytes.
void write(const Welcome& message, std::vector<std::byte>& bytes);
void write(const Update& message, std::vector<std::byte>& bytes);
/// `description` null: there is no such shape.
void write_shape(ShapeId shape, const ShapeDescription* description, std::vector<std::byte>& bytes);
/// A message whose body is bytes or a text: application, status, described, notice.
void write_body(ServerMessageType type, std::span<const std::byte> body, std::vector<std::byte>& bytes);
void write_body(ServerMessageType type, std::string_view body, std::vector<std::byte>& bytes);

// For clients. They return false for bytes that are not exactly one such message; then `message` is undefined. Spans
// and texts refer to the bytes.
bool read(std::span<const std::byte> bytes, Welcome& message);
bool read(std::span<const std::byte> bytes, Update& message);
/// `description` is empty if there is no such shape, or if it is not described (a support function, a large mesh).
bool read_shape(std::span<const std::byte> bytes, ShapeId& shape, std::optional<ShapeDescription>& description);
/// Type of a message; empty if there is no such type.
std::optional<ServerMessageType> type_of(std::span<const std::byte> bytes) noexcept;

}  // namespace ringfence::gateway
