#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/number_index.hpp"
#include "gateway/protocol/quantised.hpp"
#include "ringfence/object.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Number of complete frames when something happened; from 1, so that 0 is "never".
using Stamp = std::uint64_t;

/// An object as messages describe it, and when that changed. The same for all clients.
struct SharedObject {
  ObjectNumber number = 0;
  std::uint32_t generation = 0;
  ShapeId shape;
  Category category = Category::active;
  UserId user = no_user;
  std::uint32_t turn = 0;
  QuantisedPosition position;
  Stamp changed = 0;  ///< generation, shape, category, user
  Stamp moved = 0;    ///< position
  Stamp turned = 0;   ///< turn
  Stamp checked = 0;  ///< last frame in which it was compared with the world
};

/// The objects that clients see, quantised once in a frame for all of them.
///
/// A stamp may be later than the change, if no client saw the object in between; it is never earlier. Properties other
/// than the pose and the generation are compared every 16 frames.
///
/// Memory: a row for each object that a client saw in the last 1024 frames or so. Threads: one.
class ObjectTable {
 public:
  explicit ObjectTable(const World& world);

  /// Starts the frame with that stamp. References that were returned before are no longer valid.
  void begin_frame(Stamp now);
  /// Index of the object with that number, which stands at `pose` after the last frame; `none` if it is not in the
  /// world. Only the first call in a frame compares.
  static constexpr std::uint32_t none = base::NumberIndex::none;
  std::uint32_t refresh(ObjectNumber number, const Pose& pose);
  /// Precondition: refresh() returned the index in this frame.
  const SharedObject& operator[](std::uint32_t index) const noexcept { return rows_[index]; }

 private:
  void compare(SharedObject& row, const Pose& pose);
  bool compare_properties(SharedObject& row);
  void remove_unseen();

  const World& world_;
  base::NumberIndex index_;
  std::vector<SharedObject> rows_;
  Stamp now_ = 0;
};

}  // namespace ringfence::gateway
