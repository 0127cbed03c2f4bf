#pragma once

#include <cstddef>
#include <memory>

#include "link/channel.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/role.hpp"

namespace ringfence::facade {

/// A duplex channel between two roles: one link::Channel in each direction; between the server and a CD node of this
/// process also the memory that they share.
struct DuplexChannel {
  DuplexChannel(std::size_t bytes, link::Doorbell* first, link::Doorbell* second)
      : forward(bytes, second, first), backward(bytes, first, second) {}
  nodes::Connection first() noexcept {
    return {&forward.sender(), &backward.receiver(), node_contacts.get(), publication.get()};
  }
  nodes::Connection second() noexcept {
    return {&backward.sender(), &forward.receiver(), node_contacts.get(), publication.get()};
  }
  link::Channel forward;
  link::Channel backward;
  std::unique_ptr<nodes::NodeContacts> node_contacts;
  std::unique_ptr<nodes::NodePublication> publication;
};

}  // namespace ringfence::facade
