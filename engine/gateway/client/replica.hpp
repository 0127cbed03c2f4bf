#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "gateway/protocol/server_messages.hpp"

namespace ringfence::gateway {

/// What a client knows of the world: the updates of the gateway, applied as docs/client-protocol.md says.
class Replica {
 public:
  struct Object {
    std::uint32_t generation = 0;
    ShapeId shape;
    Category category = Category::active;
    UserId user = no_user;
    QuantisedPosition position;
    std::uint32_t turn = 0;
    std::vector<std::byte> metadata;
  };
  struct Own {
    ObjectNumber number = 0;
    ShapeId shape;
    Pose pose;
    std::vector<std::byte> state;
  };

  enum class Outcome : std::uint8_t {
    applied,
    ignored,  ///< not newer than the last one, or it builds on one that did not arrive
    invalid,  ///< it moves an object that the client does not have: the gateway has made an error
  };
  Outcome apply(const Update& update);

  /// The number that acknowledges the last update: its frame + 1; 0: none.
  std::uint64_t acknowledgement() const noexcept { return frames_; }
  const std::unordered_map<ObjectNumber, Object>& objects() const noexcept { return objects_; }
  const std::vector<OwnContact>& contacts() const noexcept { return contacts_; }
  /// Of spectators: pairs in their view that touch each other.
  const std::vector<TouchingPair>& touching() const noexcept { return touching_; }
  const std::optional<Own>& own() const noexcept { return own_; }

 private:
  std::uint64_t frames_ = 0;
  std::unordered_map<ObjectNumber, Object> objects_;
  std::vector<OwnContact> contacts_;
  std::vector<TouchingPair> touching_;
  std::optional<Own> own_;
};

}  // namespace ringfence::gateway
