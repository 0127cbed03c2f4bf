#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence {

/// Result of a call that may be refused, and the reason for which a message or record is refused.
/// FrameReport::refused counts refusals by reason. A caller that ignores a result on purpose says so with (void).
enum class [[nodiscard]] Status : std::uint8_t;
enum class Status : std::uint8_t {
  ok,             ///< done
  stale_object,   ///< the id is null or names an object that was destroyed
  not_host,       ///< the object is not an avatar of the calling user node, or the sender of a state does not host it
  not_finite,     ///< a position or orientation contains NaN or infinity, or lies beyond farthest_coordinate
  not_unit,       ///< the length of the orientation differs from 1 by more than 10^-3
  unknown_user,   ///< no such user node is connected
  unknown_shape,  ///< no such shape is registered
  unknown_layer,  ///< the layer number is not in WorldConfig::layers
  number_in_use,  ///< a live object or a connected user node already has that number
  bad_number,     ///< a number is zero or out of range, or no number is free
  over_capacity,  ///< exceeds a configured limit; raise it in WorldConfig::limits
  bad_message,    ///< a message has an invalid header or contents, or is not allowed at that time
  out_of_order,   ///< the call is not allowed now: a frame is running, or none is
  bad_category,   ///< the category does not fit the call: an avatar needs a user, a static object cannot move
  late,           ///< a user node missed its deadline (see FrameReport::late), or a lost CD node sent a message
  model_failed,   ///< the motion model threw: the object does not move in this frame, or starts with a zero state
  over_quota,     ///< exceeds a user node's quota; raise it in WorldConfig::quotas
  out_of_memory,  ///< an allocation failed in a frame or a call: the World runs no more frames; see World
  no_thread,      ///< the system cannot create the thread of a CD node: the number of CD nodes stays the same
  /// `collide` and `distance` only: a support function threw, or returned an invalid point.
  support_failed,
  shape_in_use,    ///< remove_shape: an object has the shape, or a request for the next frame names it
  bad_shape,       ///< queries only: the shape that sweeps or overlaps is a mesh; it must be convex
  frame_expired,   ///< queries only: the frame is older than WorldConfig::history reaches
  not_written,     ///< save: the sink did not take the bytes
  beyond_sense,    ///< queries of motion models only: it reaches farther than WorldConfig::sense
  journal_failed,  ///< a frame could not be recorded (WorldConfig::recorder): the World runs no more frames
};
inline constexpr std::size_t status_count = 26;

/// Name of a status in reports: "ok", "stale_object", ...
constexpr const char* name_of(Status status) noexcept {
  constexpr const char* names[] = {"ok",
                                   "stale_object",
                                   "not_host",
                                   "not_finite",
                                   "not_unit",
                                   "unknown_user",
                                   "unknown_shape",
                                   "unknown_layer",
                                   "number_in_use",
                                   "bad_number",
                                   "over_capacity",
                                   "bad_message",
                                   "out_of_order",
                                   "bad_category",
                                   "late",
                                   "model_failed",
                                   "over_quota",
                                   "out_of_memory",
                                   "no_thread",
                                   "support_failed",
                                   "shape_in_use",
                                   "bad_shape",
                                   "frame_expired",
                                   "not_written",
                                   "beyond_sense",
                                   "journal_failed"};
  return names[static_cast<std::size_t>(status)];
}

}  // namespace ringfence
