#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <type_traits>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::facade {

// The records of a save. Each is written as it lies in memory (little-endian), so it has no padding, and its layout
// changes only together with `save_version`.

/// An object after the last frame.
struct SavedObject {
  std::uint64_t user_data = 0;
  Pose pose;
  std::uint32_t number = 0;
  std::uint32_t generation = 0;
  std::uint32_t shape = 0;
  std::uint32_t group = 0;
  std::uint32_t user = 0;  ///< no_user_number unless it is an avatar
  std::uint8_t category = 0;
  std::uint8_t layer = 0;
  std::uint8_t enabled = 0;
  std::uint8_t zero = 0;
};
static_assert(sizeof(SavedObject) == 72 && std::is_trivially_copyable_v<SavedObject>);

/// A begin or persist contact of the last frame. All else that a Contact states follows from its two objects.
struct SavedContact {
  Vec3d point;
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::uint32_t phase = 0;
  float depth = 0;
  float toi = 1;
  Vec3f normal;
};
static_assert(sizeof(SavedContact) == 56 && std::is_trivially_copyable_v<SavedContact>);

/// A user node, or what a number used in the current window of its quotas.
struct SavedUser {
  std::uint32_t number = 0;
  std::uint32_t connected = 0;  ///< 1: connected in the last frame
  std::uint32_t spawns = 0;     ///< in the window
  std::uint32_t moves = 0;
};
static_assert(sizeof(SavedUser) == 16 && std::is_trivially_copyable_v<SavedUser>);

/// A request for the next cut: nodes::Request without what concerns CD nodes and connections.
struct SavedRequest {
  std::uint64_t object = 0;  ///< ObjectId::value
  std::uint64_t user_data = 0;
  Pose pose;
  std::uint32_t shape = 0;
  std::uint32_t group = 0;
  std::uint32_t spec_user = 0;
  std::uint32_t user = 0;
  std::uint32_t state = 0;  ///< position of the new model state in SavedWorld::request_states
  std::uint8_t kind = 0;    ///< a nodes::Request::Kind up to set_state
  std::uint8_t category = 0;
  std::uint8_t layer = 0;
  std::uint8_t enabled = 0;
};
static_assert(sizeof(SavedRequest) == 80 && std::is_trivially_copyable_v<SavedRequest>);

struct SavedMove {
  Pose pose;
  std::uint32_t user = 0;
  std::uint32_t number = 0;
};
static_assert(sizeof(SavedMove) == 48 && std::is_trivially_copyable_v<SavedMove>);

struct SavedInput {
  std::uint32_t user = 0;
  std::uint32_t number = 0;
  std::uint32_t size = 0;
  std::uint8_t bytes[32] = {};
};
static_assert(sizeof(SavedInput) == 44 && std::is_trivially_copyable_v<SavedInput>);

/// Everything that determines the future of a World.
struct SavedWorld {
  std::uint64_t frames = 0;       ///< completed
  std::uint32_t last_number = 0;  ///< Registry::last_number
  std::uint32_t generation = 0;   ///< Registry::generation
  std::string model_name;
  std::uint64_t model_version = 0;
  std::uint32_t state_bytes = 0;  ///< of an object: MotionModel::state_bytes()
  LayerMatrix layers;
  std::vector<const ShapeDescription*> shapes;  ///< by number; null: removed
  std::deque<ShapeDescription> read_shapes;     ///< those of `shapes`, if the save was read
  std::vector<SavedObject> objects;             ///< ascending by number
  std::vector<std::byte> states;                ///< of the objects, in their order
  std::vector<SavedContact> contacts;           ///< ascending by (a, b)
  std::vector<SavedUser> users;                 ///< ascending by number
  std::vector<SavedRequest> requests;           ///< in the order of the calls
  std::vector<std::byte> request_states;
  std::vector<SavedMove> moves;  ///< in the order of the calls
  std::vector<SavedInput> inputs;
  std::vector<std::byte> own;  ///< the caller's
};

}  // namespace ringfence::facade
