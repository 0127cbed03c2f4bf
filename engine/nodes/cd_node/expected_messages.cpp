#include "nodes/cd_node/expected_messages.hpp"

#include <algorithm>

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

PeerInbox::Verdict ExpectedMessages::judge(const MessageView& message) const noexcept {
  using enum PeerInbox::Verdict;
  const messages::Header& header = message.header();
  const std::uint32_t epoch = state_.region.map().epoch();
  if (header.frame < state_.frame || (header.frame == state_.frame && header.epoch < epoch) ||
      migration_.is_lost(Endpoint{header.source}.number())) {
    return drop;
  }
  if (header.frame > state_.frame || header.epoch > epoch) {
    return wait;
  }
  if (message.type() == MessageType::ghost) {
    return !state_.received.positions ? wait : exchange_.expects_ghosts() ? take : drop;
  }
  return state_.received.frame_end && state_.stage >= CdNodeStage::ending ? take : wait;
}

MessageLimits ExpectedMessages::limits() const noexcept {
  return {state_.setup.slots(), static_cast<std::uint32_t>(state_.setup.shapes->size()), state_.setup.max_slots};
}

bool ExpectedMessages::is_from_peer(const MessageView& message) const noexcept {
  const Endpoint source{message.header().source};
  return source.is_node() && source.number() < state_.setup.slots() && source.number() != state_.setup.node &&
         is_between_nodes(message.type()) && is_valid(message, limits());
}

bool ExpectedMessages::is_acceptable(const MessageView& message) const {
  return is_expected(message) && is_valid(message, limits()) &&
         (message.type() != MessageType::query || knows_shapes(message)) &&
         (message.type() != MessageType::sensed || exchange_.takes_sensed(message.count())) &&
         (message.type() != MessageType::pairs || knows_pairs(message)) &&
         (message.type() != MessageType::correct || knows_positions(message)) &&
         (message.type() != MessageType::unlist || knows_contacts(message));
}

// Whether this node found all the contacts, and each is named once, in order.
bool ExpectedMessages::knows_contacts(const MessageView& message) const noexcept {
  const auto keys = state_.contacts.keys.span();
  auto next = keys.begin();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::UnlistRecord>(i);
    next = std::lower_bound(next, keys.end(), record.key);
    if (next == keys.end() || *next != record.key) {
      return false;
    }
    ++next;
  }
  return true;
}

bool ExpectedMessages::knows_positions(const MessageView& message) const noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (message.record<messages::CorrectRecord>(i).position >= state_.contacts.begun.size()) {
      return false;
    }
  }
  return true;
}

// Whether the shapes that queries move are convex. is_valid() has checked the numbers.
bool ExpectedMessages::knows_shapes(const MessageView& message) const noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto query = message.record<messages::QueryRecord>(i);
    if (messages::has_shape(query) && state_.setup.shapes->row(query.shape).kind == ShapeKind::mesh) {
      return false;
    }
  }
  return true;
}

// Whether this node knows all objects of the pairs, and each pair has the object with the lower number first.
bool ExpectedMessages::knows_pairs(const MessageView& message) const noexcept {
  const auto numbers = state_.objects.numbers();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto pair = message.record<messages::PairRecord>(i);
    const std::uint32_t a = state_.objects.find(pair.a);
    const std::uint32_t b = state_.objects.find(pair.b);
    if (a == RegionObjects::none || b == RegionObjects::none || numbers[a] >= numbers[b]) {
      return false;
    }
  }
  return true;
}

// Whether the server may send this message at this stage of the frame. At another stage the message would change arrays
// into which the stage holds indices: hosted objects, known objects, peers, or the region map.
bool ExpectedMessages::is_expected(const MessageView& message) const {
  if (!Endpoint{message.header().source}.is_server()) {
    return false;
  }
  switch (message.type()) {
    case MessageType::adopt:
    case MessageType::drop:
    case MessageType::place:
    case MessageType::notify:
    case MessageType::query:
    case MessageType::sensed:
      return state_.stage == CdNodeStage::waiting;
    case MessageType::frame_begin:
      return state_.stage == CdNodeStage::waiting && state_.region.fits() && exchange_.may_begin();
    case MessageType::position_update:
    case MessageType::ghosts_sent:
      return (state_.stage == CdNodeStage::moving || state_.stage == CdNodeStage::gathering) &&
             !state_.received.positions;
    case MessageType::pairs:
      return state_.stage == CdNodeStage::gathering && state_.received.positions && !state_.received.pairs;
    case MessageType::unlist:
    case MessageType::correct:
    case MessageType::frame_end:
      return state_.stage == CdNodeStage::ending && !state_.received.frame_end;
    case MessageType::region_map:
      return is_map_expected(message);
    case MessageType::lost:
      return is_loss_expected(message);
    case MessageType::probe:
      return true;
    default:
      return false;
  }
}

// A loss must be that of another node. If it requests that the frame is detected again, the contacts must not be final.
// Other losses are ignored after this node has ended the frame, so they are not checked: their slots may be free.
bool ExpectedMessages::is_loss_expected(const MessageView& message) const noexcept {
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::LostRecord>(i);
    if (state_.stage == CdNodeStage::waiting && record.detect_again == 0) {
      continue;
    }
    if (record.node >= state_.setup.slots() || record.node == state_.setup.node ||
        (record.detect_again != 0 && state_.stage > CdNodeStage::ending)) {
      return false;
    }
  }
  return true;
}

// A new map clears the known objects. So it must not arrive between the positions of a frame and the report of the
// contacts: candidates, and contacts that are not sent yet, hold indices of known objects.
bool ExpectedMessages::is_map_expected(const MessageView& message) const {
  const bool open = state_.stage == CdNodeStage::waiting || state_.stage == CdNodeStage::moving ||
                    state_.stage == CdNodeStage::ending ||
                    (state_.stage == CdNodeStage::gathering && !state_.received.positions);
  return open && state_.region.is_acceptable(message);
}

}  // namespace ringfence::nodes
