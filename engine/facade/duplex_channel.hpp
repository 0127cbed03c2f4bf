#pragma once

#include <cstddef>
#include <memory>

#include "link/channel.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/role.hpp"

namespace ringfence::facade {

/// A duplex channel between two roles: one link::Channel in each direction. Between the server and a CD node of this
/// process, or a user thread, it also owns the memory that they share.
///
/// It outlives every use of the two Connections. Threads: each Connection belongs to the thread that steps its role.
struct DuplexChannel {
  /// Allocates two rings of `bytes` bytes each. `first` and `second` are the doorbells of the threads that step the two
  /// roles; they outlive the channel and may be null. Throws Error for a size that link::Channel refuses.
  DuplexChannel(std::size_t bytes, link::Doorbell* first, link::Doorbell* second)
      : forward(bytes, second, first), backward(bytes, first, second) {}
  /// The end of the first role.
  nodes::Connection first() noexcept {
    return {&forward.sender(), &backward.receiver(), node_contacts.get(), publication.get()};
  }
  /// The end of the second role.
  nodes::Connection second() noexcept {
    return {&backward.sender(), &forward.receiver(), node_contacts.get(), publication.get()};
  }
  link::Channel forward;                                ///< from the first role to the second
  link::Channel backward;                               ///< from the second role to the first
  std::shared_ptr<nodes::NodeContacts> node_contacts;   ///< null: the roles share no contacts
  std::shared_ptr<nodes::HostPublication> publication;  ///< null: the server publishes what the host has
};

}  // namespace ringfence::facade
