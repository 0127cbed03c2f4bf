#include "nodes/findings_order.hpp"

namespace ringfence::nodes {

void FindingsOrder::reserve(std::size_t contacts) {
  order_.reserve(contacts);
  sources_.reserve(contacts);
}

void FindingsOrder::start(std::span<Findings* const> findings) {
  findings_ = findings;
  order_.clear();
  sources_.clear();
  ascending_ = true;
}

void FindingsOrder::sort() {
  if (!ascending_) {
    order_.sort();
  }
}

}  // namespace ringfence::nodes
