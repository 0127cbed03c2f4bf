#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/system_vector.hpp"
#include "geometry/bounds.hpp"
#include "nodes/server/objects/object_table.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"

namespace ringfence::nodes {

/// A change of an object's host between two frames.
struct HostChange {
  std::uint32_t slot = 0;
  messages::Endpoint from;  ///< none: the object is new
  messages::Endpoint to;
};

/// Decides which role hosts which object: in every frame exactly one role for each object that can move.
///
///                       avatar   active, non-active
///   user                user     the user nodes, in equal shares; the server while there is no user node
///   user-server         user     the server
///   user-collision      user     the CD node that owns the cell of its position
///
/// Threads: belongs to the server role.
class Hosting {
 public:
  Hosting(Deployment deployment, const geometry::FixedSpace& space) : deployment_(deployment), space_(space) {}

  /// At the cut, after spawns, ends and changes of users: assigns a host to every object without one. If user nodes
  /// came or left, evens out their shares with as few changes as possible. Sets the hosts in the table and returns the
  /// changes, each slot once. `users` are the connected ones, ascending.
  std::span<const HostChange> settle(ObjectTable& objects, const regions::RegionMap& map,
                                     std::span<const UserNumber> users, bool users_changed);

 private:
  NodeNumber node_at(const Vec3d& position, const regions::RegionMap& map) const noexcept {
    std::uint32_t point[3];
    space_.point(position, point);
    return map.owner_at(point);
  }
  void change(ObjectTable& objects, std::uint32_t slot, messages::Endpoint to);
  void even_out(ObjectTable& objects, std::span<const UserNumber> users);
  void set_shares(std::size_t total);

  Deployment deployment_;
  const geometry::FixedSpace& space_;
  base::SystemVector<HostChange> changes_;
  std::vector<std::size_t>
      shares_;  ///< by position in `users`: number of hosted objects, then the number it may still take
  std::vector<std::uint32_t> pool_;
  std::size_t next_user_ = 0;
};

}  // namespace ringfence::nodes
