#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "gateway/clients/object_table.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// The newest input of one client. It holds for all frames until a newer one arrives.
class NewestInput {
 public:
  /// Takes an input if it is newer than the newest so far. `received_s`: when it arrived, seconds of a steady clock.
  void receive(const Input& input, double received_s) noexcept;
  /// The client is away: its avatar does what the model does without input.
  void release() noexcept { size_ = 0; }
  /// A new connection, whose sequence numbers begin again.
  void restart() noexcept { *this = {}; }
  /// Passes the input to the world, for the frame that will have the stamp `next`.
  Status apply(World& world, UserId user, ObjectId avatar, Stamp next);
  /// Sets the fields of an update that acknowledge inputs. `now_s`: as received_s.
  void acknowledge(Stamp now, double now_s, Update& update) const noexcept;

 private:
  std::array<std::byte, max_input_bytes> bytes_{};
  std::size_t size_ = 0;
  std::uint64_t received_ = 0;  ///< sequence number of the newest input
  double received_s_ = 0;
  std::uint16_t echo_ = 0;
  std::uint64_t applied_ = 0;  ///< sequence number of the newest that was in a frame
  Stamp applied_at_ = 0;
};

}  // namespace ringfence::gateway
