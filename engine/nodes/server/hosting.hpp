#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "nodes/server/object_table.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"

namespace ringfence::nodes {

/// An object whose host changes between two frames, by order of the server.
struct HostChange {
  std::uint32_t slot = 0;
  messages::Endpoint from;  ///< none: newly spawned
  messages::Endpoint to;
};

/// Who hosts which object in which deployment: exactly one role an object that can move, in every frame.
///
///                     avatar   active, non-active
///   user              user     the user nodes, in equal shares; the server while there is no user node
///   user-server       user     the server
///   user-collision    user     the CD node that owns the cell of its position
///
/// Threads: belongs to the server role.
class Hosting {
 public:
  Hosting(Deployment deployment, const geometry::FixedSpace& space) : deployment_(deployment), space_(space) {}

  /// At the cut, after spawns, ends and changes of users: gives every object without a host one, and where user nodes
  /// came or went, evens out their shares with as few changes as that takes. Sets the rows' hosts and lists the
  /// changes, each slot once. `users` are the connected ones, ascending.
  std::span<const HostChange> settle(ObjectTable& objects, const regions::RegionMap& map,
                                     std::span<const UserNumber> users, bool users_changed);

  /// The CD node that hosts an object at this position.
  NodeNumber node_at(const Vec3d& position, const regions::RegionMap& map) const noexcept {
    std::uint32_t point[3];
    space_.point(position, point);
    return map.owner_at(point);
  }

 private:
  void change(ObjectTable& objects, std::uint32_t slot, messages::Endpoint to);
  void share_out(ObjectTable& objects, std::span<const UserNumber> users);
  void set_shares(std::size_t total);

  Deployment deployment_;
  const geometry::FixedSpace& space_;
  std::vector<HostChange> changes_;
  std::vector<std::size_t> shares_;  ///< by position in `users`: how many it hosts, then how many it still may
  std::vector<std::uint32_t> pool_;
  std::size_t next_user_ = 0;
};

}  // namespace ringfence::nodes
