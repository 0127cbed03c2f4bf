#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence {

/// Result of a call that may be refused; also the reasons by which refusals are counted.
enum class Status : std::uint8_t {
  ok,             ///< done
  stale_object,   ///< the id is null or names an object that was destroyed
  not_host,       ///< only the user node that hosts the object may move it, only its owner may destroy it
  not_finite,     ///< a position or orientation holds NaN or infinity, or lies beyond farthest_coordinate
  not_unit,       ///< the orientation is further than 10^-3 from unit length
  unknown_user,   ///< no such user node is connected
  unknown_shape,  ///< no such shape is registered
  unknown_layer,  ///< the layer number is not in WorldConfig::layers
  number_in_use,  ///< a live object or a connected user node already has that number
  bad_number,     ///< zero or out of range
  over_capacity,  ///< exceeds a configured limit; raise it in WorldConfig::limits
  bad_message,    ///< wrong size, count, version or type of a message
  out_of_order,   ///< not allowed now: a frame is running, or none is
  bad_category,   ///< the category does not fit the call: an avatar needs a user, a static object cannot move
  late,           ///< the user node missed its deadline: its old poses stay and it is disconnected at the next cut
  model_failed,   ///< the motion model threw for the object: it does not move in this frame
  over_quota,     ///< exceeds a user node's quota; raise it in WorldConfig::quotas
  out_of_memory,  ///< an allocation failed in a frame or a call: the World runs no more frames; see World
  no_thread,      ///< the system has no thread for a CD node: the number of CD nodes stays
};
inline constexpr std::size_t status_count = 19;

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
                                   "no_thread"};
  return names[static_cast<std::size_t>(status)];
}

}  // namespace ringfence
