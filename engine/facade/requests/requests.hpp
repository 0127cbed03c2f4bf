#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/system_vector.hpp"
#include "facade/requests/registry.hpp"
#include "facade/requests/user_numbers.hpp"
#include "facade/requests/user_usage.hpp"
#include "geometry/shape_table.hpp"
#include "nodes/host/frame_inputs.hpp"
#include "nodes/server/request.hpp"
#include "nodes/server/server_setup.hpp"
#include "ringfence/world.hpp"

namespace ringfence::facade {

/// What users do with their avatars in the next frame, in the order of the calls.
struct UserOrders {
  struct Move {
    UserNumber user;
    ObjectNumber number;  ///< 0: the move does not count, because the object was disabled later
    Pose pose;
  };
  struct Input {
    UserNumber user = no_user_number;
    nodes::ObjectInput input;
  };
  std::vector<Move> moves;
  std::vector<Input> inputs;
};

/// The calls of a World about users and objects. Checks them, answers at once with ids that are valid in further calls,
/// and keeps what they ask for until the next cut. Between begin_frame and finish_frame they belong to the frame after
/// the running one.
///
/// The calls are those of World with the same names; ringfence/world.hpp has their contracts. A call that is refused
/// changes nothing and is counted.
///
/// Threads: belongs to the thread that calls World. Throws only std::bad_alloc; then a call may be done in part, and no
/// frame may follow.
class Requests {
 public:
  /// `config` and `shapes` outlive this object.
  Requests(const WorldConfig& config, const geometry::ShapeTable& shapes);
  Requests(const Requests&) = delete;
  Requests& operator=(const Requests&) = delete;

  Connected connect(UserId wanted);
  Status disconnect(UserId id);
  Spawned spawn(const ObjectSpec& spec);
  Status destroy(ObjectId object);
  Status destroy(UserId user, ObjectId object);
  Status move(UserId user, ObjectId object, const Pose& pose);
  Status input(UserId user, ObjectId object, std::span<const std::byte> bytes);
  Status place(ObjectId object, const Pose& pose);
  Status set_enabled(ObjectId object, bool enabled);
  Status set_group(ObjectId object, std::uint32_t group);
  Status set_layer(ObjectId object, std::uint8_t layer);
  Status set_shape(ObjectId object, ShapeId shape);
  Status set_state(ObjectId object, std::span<const std::byte> bytes);

  /// Counts a refused call and returns its reason.
  Status refuse(Status reason) noexcept {
    ++refused_[static_cast<std::size_t>(reason)];
    return reason;
  }
  /// The same for a call on behalf of a user, which may be unknown.
  Status refuse(UserNumber user, Status reason) {
    if (users_.is_connected(user)) {
      usage_.refuse(user);
    }
    return refuse(reason);
  }
  /// Calls that were refused to a user since it connected.
  std::uint64_t refused(UserNumber user) const noexcept { return users_.is_connected(user) ? usage_.refused(user) : 0; }
  const Registry& objects() const noexcept { return objects_; }
  const UserNumbers& users() const noexcept { return users_; }
  const UserUsage& usage() const noexcept { return usage_; }
  /// For the next cut, in the order of the calls; and the model states that they refer to.
  std::span<const nodes::Request> pending() const noexcept { return requests_; }
  std::span<const std::byte> pending_states() const noexcept { return states_; }
  const UserOrders& user_orders() const noexcept { return user_orders_; }

  // Restore what a World had between two frames. In this order, before the first call.
  void restore_window(std::uint64_t frames) noexcept { usage_.restore_window(frames); }
  /// A user node, or a number that was used in this window. If `connected`, the next cut connects it first.
  void restore_user(UserNumber user, bool connected, const UserUsage::Counts& counts);
  /// An object of the last frame.
  void restore_object(ObjectId id, Category category, UserNumber user, ShapeNumber shape) {
    objects_.restore(id, category, user, shape);
  }
  enum class Counting : std::uint8_t { in_quotas, not_in_quotas };
  // A call that was accepted before. Return false if it cannot have been.
  bool restore(const nodes::Request& request, Counting counting);
  bool restore(const UserOrders::Move& move, Counting counting);
  bool restore(const UserOrders::Input& input, Counting counting);
  void restore_ids(ObjectNumber last_number, std::uint32_t generation) noexcept {
    objects_.restore_ids(last_number, generation);
  }
  void restore_states(std::span<const std::byte> states) { states_.assign(states.begin(), states.end()); }

  // The frame.
  /// Adds a request that the next cut applies before all others.
  void add_first(const nodes::Request& request) { requests_.insert(requests_.begin(), request); }
  /// A frame begins: moves the requests to `order`, whose lists are empty.
  void cut(nodes::FrameOrder& order);
  /// To be passed to the user nodes and cleared when a frame begins.
  UserOrders& user_orders() noexcept { return user_orders_; }
  /// The frame is complete: clears the lists of `order`, and frees the numbers of objects and users that its cut ended.
  void forget_cut(nodes::FrameOrder& order);
  /// Adds the numbers of calls that were refused since the last call.
  void report_refused(FrameReport& report) noexcept;

 private:
  Status check_spec(const ObjectSpec& spec) const noexcept;
  /// Whether the object is an avatar of the user.
  Status check_own(UserId user, ObjectId object) const noexcept;
  Status check_layer(std::uint8_t layer) const noexcept;
  /// Whether the object exists and may be placed, enabled and disabled.
  Status check_movable(ObjectId object) const noexcept;
  /// Requests a change of an object unless the status is a refusal, or the object does not exist.
  Status request_change(nodes::Request::Kind kind, ObjectId object, Status status, const ObjectSpec& spec);

  const WorldConfig& config_;
  const geometry::ShapeTable& shapes_;
  Registry objects_;
  UserNumbers users_;
  UserUsage usage_;
  base::SystemVector<nodes::Request> requests_;
  std::vector<nodes::Request> connects_;  ///< of user nodes that a save has as connected; until the next cut
  std::vector<std::byte> states_;         ///< of the set_state requests
  UserOrders user_orders_;
  std::array<std::uint64_t, status_count> refused_{};  ///< by status
};

}  // namespace ringfence::facade
