#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/numbers.hpp"
#include "nodes/server/objects/object_table.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// Which avatars of a user collide with each other: if there are more than
/// Quotas::colliding_avatars, those with the lowest numbers. A function of the
/// objects that live after the cut, enabled or not.
///
/// The avatars of such a user have a crowd (broad_phase/crowds.hpp), those of
/// all others have none.
///
/// Threads: belongs to the server role. Memory: 24 bytes a user and 4 an
/// avatar.
class AvatarCrowds {
 public:
  /// `colliding`: Quotas::colliding_avatars; 0: no limit.
  explicit AvatarCrowds(std::size_t colliding) noexcept : colliding_(colliding) {}

  void add(UserNumber user, ObjectNumber avatar);
  void remove(UserNumber user, ObjectNumber avatar);
  /// At the cut, after all calls of the others: sets the crowds in `objects`.
  /// An avatar whose crowd changes counts as moved.
  void settle(ObjectTable& objects);

 private:
  void note(UserNumber user);

  std::size_t colliding_;
  std::vector<std::vector<ObjectNumber>> avatars_;  ///< by user
  std::vector<UserNumber> changed_;                 ///< users with too many avatars, now or before
};

}  // namespace ringfence::nodes
