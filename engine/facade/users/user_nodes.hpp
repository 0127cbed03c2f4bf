#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "facade/requests/requests.hpp"
#include "facade/users/user_threads.hpp"
#include "facade/world_state.hpp"
#include "nodes/user/user_role.hpp"
#include "ringfence/fault.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::facade {

/// A connected user node with its role. Destroyed in reverse order: first its thread ends.
struct User {
  explicit User(const nodes::UserSetup& setup) : role(setup) {}
  nodes::UserRole role;
  std::size_t thread = 0;  ///< index of the user thread that steps it
  bool late = false;       ///< its move did not end in time; it gets no further frame
  bool leaving = false;    ///< its user disconnects in the running frame, which it does not get any more
  bool is_stepped() const noexcept { return !late && !leaving; }
  /// The thread that was abandoned in this user node's move, or null. It steps no other role.
  std::unique_ptr<UserThread> abandoned;
};

/// The user nodes of a World and the threads that step them: connects them, replaces threads that a user node has
/// stalled, and keeps a disconnected user node until no thread refers to it.
///
/// A user node is late if its move has not ended in time. It is not stepped from then on, and keeps the thread that is
/// still in its move; the next cut disconnects it.
///
/// Threads: the one that calls World, between frames; replace_stalled_threads() while the server waits for user nodes.
/// Memory is allocated only when user nodes connect or leave, and for stalled threads.
class UserNodes {
 public:
  explicit UserNodes(WorldState& state) noexcept : state_(state), threads_(state) {}
  UserNodes(const UserNodes&) = delete;
  UserNodes& operator=(const UserNodes&) = delete;

  /// Call it once. Throws Error if the system has no thread for one of WorldConfig::user_threads.
  void start_threads() { threads_.start(); }
  const UserThreads& threads() const noexcept { return threads_; }
  /// The user node with that number, late or not; null if there is none.
  const User* find(UserNumber number) const noexcept;
  /// Calls visit(user) for all user nodes that are not late.
  template <class Visit>
  void each(Visit visit) const {
    for (const auto& [number, user] : nodes_) {
      if (!user->late) {
        visit(*user);
      }
    }
  }

  // The steps of a frame, in order.
  /// Makes the user nodes that the requests of WorldState::order connect, and writes their connections into them. From
  /// then on no thread steps the user nodes that the requests disconnect.
  void apply_requests();
  /// Passes moves and inputs to their user nodes, and clears both. Precondition: all users are connected.
  void steer(UserOrders& orders);
  /// Called when user nodes have not reported their moves in time. Those whose moves have lasted since the last check
  /// are late: WorldState::order lists them. A new thread steps the other user nodes of their threads, in this frame
  /// too. Without a new thread the frame waits, and the log says so.
  void replace_stalled_threads();
  /// The frame whose cut disconnected the users is complete. Frees those whose threads have not stalled. Precondition:
  /// each is late, or apply_requests() has disconnected it.
  void forget(std::span<const UserNumber> users);
  /// Writes the CPU times of the user threads into the report.
  void report_times(FrameReport& report) { threads_.report_times(report); }
  /// Frees the disconnected user nodes whose stalled threads have ended.
  void free_stalled();
  /// Whether a user node has a stalled thread, connected or not.
  bool has_stalled() const noexcept;

  /// Injects a fault into the user node that it names. Returns false if that is unknown or late, or does not have the
  /// stage.
  bool inject(const Fault& fault);
  /// Calls visit(worker) for all threads, also for stalled ones.
  template <class Visit>
  void each_worker(Visit visit) const {
    const auto visit_thread = [&](const UserThread* thread) {
      if (thread != nullptr && thread->worker != nullptr) {
        visit(*thread->worker);
      }
    };
    for (std::size_t index = 0; index < threads_.size(); ++index) {
      visit_thread(&threads_.at(index));
    }
    for (const auto& [number, user] : nodes_) {
      visit_thread(user->abandoned.get());
    }
    for (const auto& user : stalled_) {
      visit_thread(user->abandoned.get());
    }
  }

 private:
  void connect(nodes::Request& request);
  std::unique_ptr<User> make_user(UserNumber number);
  void abandon(std::size_t thread);
  void assign_roles();

  WorldState& state_;
  UserThreads threads_;
  std::map<UserNumber, std::unique_ptr<User>> nodes_;
  std::vector<std::unique_ptr<User>> stalled_;  ///< disconnected; freed when their threads have ended
};

}  // namespace ringfence::facade
