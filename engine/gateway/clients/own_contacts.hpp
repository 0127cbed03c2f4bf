#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "gateway/clients/object_table.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::gateway {

/// When the contacts of one avatar began and ended, so that a client that misses updates knows it too.
class OwnContacts {
 public:
  /// Largest number of ended contacts that are kept until they are acknowledged; of more, the oldest are dropped.
  static constexpr std::size_t max_ended = 64;

  void forget() noexcept { entries_.clear(); }

  /// Adds the contacts of the avatar to `update`: all that stand after frame `now`, and those that ended after the
  /// acknowledged frame. `contacts` is World::collisions_of of its user after that frame.
  void add_contacts(std::span<const Contact> contacts, ObjectNumber avatar, Stamp now, Stamp acknowledged,
                    Update& update);

 private:
  struct Entry {
    ObjectNumber other = 0;
    Stamp began = 0;
    Stamp ended = 0;  ///< 0: it stands
  };
  void add_standing(const Contact& contact, ObjectNumber avatar, const Entry& entry, Stamp now, Update& update);
  void limit_ended();

  std::vector<Entry> entries_;  ///< in ascending order of `other`
};

}  // namespace ringfence::gateway
