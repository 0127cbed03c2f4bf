#include "nodes/exchange/node_contact_order.hpp"

namespace ringfence::nodes {

void NodeContactOrder::reserve(std::size_t contacts) {
  order_.reserve(contacts);
  sources_.reserve(contacts);
}

void NodeContactOrder::start(std::span<NodeContacts* const> node_contacts) {
  node_contacts_ = node_contacts;
  order_.clear();
  sources_.clear();
  ascending_ = true;
}

void NodeContactOrder::sort() {
  if (!ascending_) {
    order_.sort();
  }
}

}  // namespace ringfence::nodes
