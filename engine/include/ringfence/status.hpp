#pragma once

#include <cstddef>
#include <cstdint>

namespace ringfence {

/// What a call that may be refused answers; also the reasons by which refusals are counted.
enum class Status : std::uint8_t {
  ok,             ///< done
  stale_object,   ///< the id is null or names an object that was destroyed
  not_host,       ///< only the user node that hosts the object may move it, only its owner may destroy it
  not_finite,     ///< a position or orientation holds NaN or infinity, or lies beyond farthest_coordinate
  not_unit,       ///< the orientation is further than 10^-3 from unit length
  unknown_user,   ///< no such user node is connected
  unknown_shape,  ///< no such shape is registered
  unknown_layer,  ///< the layer is not one of the configuration's
  number_in_use,  ///< a live object, or a connected user node, has that number
  bad_number,     ///< zero, or beyond the range
  over_capacity,  ///< past a configured limit; raise it in WorldConfig::limits
  bad_message,    ///< size, count, version or type of a message are wrong
  out_of_order,   ///< not allowed now: a frame is under way, or none is
  bad_category,   ///< the category does not go with the call: an avatar needs a user, a static object cannot move
  late,           ///< the user node missed its deadline: old poses stand and it is disconnected at the next cut
  model_failed,   ///< the motion model threw for the object: it stands still this frame
  over_quota,     ///< past what a user node may use; raise it in WorldConfig::quotas
};
inline constexpr std::size_t status_count = 17;

/// A word for a report: "ok", "stale_object", ...
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
                                   "over_quota"};
  return names[static_cast<std::size_t>(status)];
}

}  // namespace ringfence
