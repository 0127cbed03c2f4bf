#include "nodes/cd_node/migration.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace ringfence::nodes {

using messages::Endpoint;

Migration::Migration(NodeState& state, NodeExchange& exchange) : state_(state), exchange_(exchange) {
  assign();
  leaving_.reserve(state.setup.objects / 8 + 64);  // few objects leave in a frame
  by_host_.reserve(state.setup.objects / 8 + 64);
}

void Migration::begin() noexcept {
  leaving_.clear();
  listed_ = false;
  expected_ = received_ = 0;
  received_from_.clear();
  std::fill(lost_.begin(), lost_.end(), std::uint8_t{0});
}

// Of objects whose next host is lost the server is the host.
void Migration::list_by_host() {
  Host& host = state_.host;
  by_host_.clear();
  const bool map_is_new = state_.region.take_change();
  if (map_is_new) {
    leaving_.clear();
    for (std::size_t i = 0; i < host.size(); ++i) {
      const NodeNumber next = state_.region.owner_at(host[i].pose.position);
      if (next != state_.setup.node) {
        leaving_.push_back({host[i].object.number, next});
      }
    }
  } else {
    for (const Leaving& leaving : leaving_) {
      host.prefetch_index(leaving.number);
    }
    for (const Leaving& leaving : leaving_) {
      host.prefetch_leaver(leaving.number);
    }
  }
  for (const Leaving& leaving : leaving_) {
    assert(host.find(leaving.number) != base::NumberIndex::none);  // neither dropped nor handed over since it moved
    if (is_lost(leaving.next)) {
      host.drop(leaving.number);
    } else {
      by_host_.add(leaving.next, leaving.number);
    }
  }
  by_host_.finish(state_.setup.slots());
  listed_ = true;
}

void Migration::list() {
  if (exchange_.lists_hand_overs()) {
    list_by_host();
    exchange_.list_hand_overs(by_host_);
  }
}

void Migration::start() {
  if (!listed_ || state_.region.is_changed()) {
    list_by_host();
    exchange_.list_hand_overs(by_host_);
  }
  exchange_.start_hand_overs(by_host_);
}

void Migration::count(NodeNumber sender, std::size_t objects) {
  received_ += objects;
  received_from_.push_back({sender, static_cast<std::uint32_t>(objects)});
}

void Migration::receive(const messages::MessageView& message) {
  const NodeNumber sender = Endpoint{message.header().source}.number();
  if (is_lost(sender)) {
    return;  // the server has reclaimed its objects
  }
  count(sender, message.count());
  state_.host.adopt(message);
}

void Migration::receive(NodeNumber sender, const HandOverList& list) {
  const auto is_sender = [sender](const messages::CountRecord& from) { return from.node == sender; };
  if (std::any_of(received_from_.begin(), received_from_.end(), is_sender)) {
    return;
  }
  const auto places = list.of(state_.setup.node);
  count(sender, places.size());
  for (const std::uint32_t place : places) {
    state_.host.adopt(list.record(place), list.state(place));
  }
}

void Migration::lose(const messages::LostRecord& record) {
  lost_[record.node] = 1;
  if (record.detect_again != 0) {
    return;
  }
  expected_ -= record.hand_overs;
  for (messages::CountRecord& from : received_from_) {
    if (from.node == record.node) {
      received_ -= std::exchange(from.count, 0u);
    }
  }
}

}  // namespace ringfence::nodes
