#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gateway/clients/object_table.hpp"
#include "gateway/protocol/server_messages.hpp"

namespace ringfence::gateway {

/// The objects that one client was sent. It decides what an update has to contain, so that a client that applied any
/// update since the acknowledged one has exactly the objects near it afterwards, whichever updates were lost.
///
/// For each object there is the frame since which every update had it, or had it removed. An object is sent as entered
/// until an update of that time is acknowledged, then only if it moved after the acknowledged frame; a removed one is
/// sent as removed until such an update is acknowledged, and then forgotten. docs/client-protocol.md, "update".
class KnownObjects {
 public:
  /// From the next update on the client has nothing.
  void forget() noexcept { entries_.clear(); }
  bool contains(ObjectNumber number) const noexcept;
  /// Number of entries, those of removed objects too.
  std::size_t size() const noexcept { return entries_.size(); }

  /// Adds to the lists of `update` what the client needs after the frame `now`, if it acknowledged frame `acknowledged`
  /// (0: none, then it needs everything). `near` are indices into `table`, in ascending order of number.
  void add_changes(std::span<const std::uint32_t> near, const ObjectTable& table, Stamp now, Stamp acknowledged,
                   Update& update);

 private:
  struct Entry {
    ObjectNumber number = 0;
    bool is_removed = false;
    Stamp since = 0;  ///< first frame whose update had it as entered, or as removed
  };
  static void add_object(const SharedObject& object, Stamp since, Stamp acknowledged, Update& update);

  std::vector<Entry> entries_;  ///< in ascending order of number
};

}  // namespace ringfence::gateway
