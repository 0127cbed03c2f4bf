#include "nodes/exchange/node/message_exchange.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

#include "base/pair_sort.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

void MessageExchange::receive_queries(const messages::MessageView& message) {
  if (has_all_queries_) {
    queries_.clear();
  }
  for (std::size_t i = 0; i < message.count(); ++i) {
    queries_.push_back(message.record<messages::QueryRecord>(i));
  }
  has_all_queries_ = message.last();
  queries_frame_ = message.header().frame;
}

// The rows are in the order of arrival, so a slot is a position in this order. The shapes outlive the node.
void MessageExchange::receive_sensed(const messages::MessageView& message) {
  if (has_all_sensed_) {
    sensed_.clear();
  }
  for (std::size_t i = 0; i < message.count(); ++i) {
    sensed_.push_back(message.record<messages::SensedRecord>(i));
  }
  has_all_sensed_ = message.last();
  if (!has_all_sensed_) {
    return;
  }
  if (frame_before_ == nullptr) {
    std::shared_ptr<const geometry::ShapeTable> shapes(std::shared_ptr<void>(), state_.setup.shapes);
    frame_before_ = std::make_unique<queries::RecordedFrame>(std::move(shapes), std::make_shared<queries::LastOrder>());
  }
  frame_before_->begin(sensed_.size(), true);
  for (auto slot = static_cast<std::uint32_t>(sensed_slots_.size()); slot < sensed_.size(); ++slot) {
    sensed_slots_.push_back(slot);
  }
  const queries::RecordedFrame::NewRows rows = frame_before_->add(std::span(sensed_slots_).first(sensed_.size()));
  for (std::uint32_t i = 0; i < sensed_.size(); ++i) {
    const messages::SensedRecord& object = sensed_[i];
    rows.objects[i] = {object.pose,
                       object.shape,
                       object.number,
                       object.generation,
                       static_cast<std::uint16_t>(object.layer),
                       static_cast<std::uint16_t>(object.category),
                       object.user_data};
    rows.groups[i] = object.group;
    rows.jumped[i] = 0;
  }
  frame_before_->finish(message.header().frame - 1);
  sensed_frame_ = message.header().frame;
}

bool MessageExchange::send_hits() {
  const NodeQueries& own = state_.contacts.queries;
  if (own.queries.empty()) {
    return true;
  }
  if (!std::exchange(hits_started_, true)) {
    hits_run_.start(own.hits.size());
  }
  return state_.send(hits_run_, MessageType::query_hit, [&](std::size_t i) { return own.hits[i]; });
}

void MessageExchange::begin() {
  NodeExchange::begin();
  const bool queried = queries_frame_ == state_.frame;
  state_.contacts.queries.queries =
      queried ? std::span<const messages::QueryRecord>(queries_) : std::span<const messages::QueryRecord>();
  state_.contacts.sensed = sensed_frame_ == state_.frame ? frame_before_.get() : nullptr;
  hits_started_ = done_started_ = false;
  next_owned_ = 0;
  replicas_run_.start();
  ghosts_listed_ = false;
}

// Messages of two types cannot be open at once. So if there are replicas, which are most of the reports, the other
// changes wait until all objects have moved.
bool MessageExchange::report_batch() { return state_.keeps_host_owned() ? send_replicas() : send_changes(); }

bool MessageExchange::send_replicas() {
  const messages::RunHeader head = state_.head(MessageType::replica, Endpoint::server());
  for (; next_owned_ < owned_.size(); ++next_owned_) {
    std::byte* const where = replicas_run_.add(*state_.setup.server.out, head, replica_bytes(), state_.traffic);
    if (where == nullptr) {
      return false;
    }
    const std::uint32_t hosted = owned_[next_owned_];
    const Hosted& object = state_.host[hosted];
    auto* record = new (where) messages::ReplicaRecord{object.object.slot, object.object.generation, object.pose};
    std::copy_n(state_.host.state(hosted), state_.host.state_bytes(), where + sizeof *record);
  }
  owned_.clear();
  next_owned_ = 0;
  return true;
}

bool MessageExchange::finish_report() {
  flush_replicas();
  if (!send_changes()) {
    return false;
  }
  flush();  // another message follows
  list_ghosts();
  return state_.send(ghost_counts_run_, MessageType::ghost_counts, [&](std::size_t i) { return ghost_counts_[i]; }) &&
         finish_changes();
}

void MessageExchange::flush() {
  NodeExchange::flush();
  flush_replicas();
  collisions_run_.flush(*state_.setup.server.out, state_.head(MessageType::collision, Endpoint::server()),
                        sizeof(messages::CollisionRecord), state_.traffic);
}

void MessageExchange::flush_replicas() {
  replicas_run_.flush(*state_.setup.server.out, state_.head(MessageType::replica, Endpoint::server()), replica_bytes(),
                      state_.traffic);
}

void MessageExchange::list_ghosts() {
  if (std::exchange(ghosts_listed_, true)) {
    return;
  }
  GhostUpdates& updates = state_.contacts.ghost_updates;
  updates.finish(static_cast<NodeNumber>(peers_.size()));
  ghost_counts_.clear();
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    Peer& peer = peers_[to];
    peer.ghosts.clear();
    updates.list(to, peer.ghosts);
    if (!peer.ghosts.empty()) {
      peer.ghosts_run.start(peer.ghosts.size());
      ghost_counts_.push_back({to, static_cast<std::uint32_t>(peer.ghosts.size())});
    }
  }
  if (!ghost_counts_.empty()) {
    ghost_counts_run_.start(ghost_counts_.size());
  }
}

bool MessageExchange::send_ghosts() {
  bool all = true;
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    Peer& peer = peers_[to];
    all &= state_.send_to(to, peer.ghosts_run, MessageType::ghost, [&](std::size_t i) {
      messages::PositionRecord record = *peer.ghosts[i].record;
      record.object.flags |= peer.ghosts[i].gone ? messages::flag_left_region : 0u;
      return record;
    });
  }
  return all;
}

void MessageExchange::discard_ghosts() noexcept {
  NodeExchange::discard_ghosts();
  for (Peer& peer : peers_) {
    peer.ghosts_run.stop();
  }
}

void MessageExchange::begin_contacts() {
  const NodeContacts& contacts = state_.contacts;
  received_.clear();
  contact_counts_.clear();
  contacts_arrived_ = contacts_expected_ = 0;
  contact_counts_run_.stop();
  change_run_.stop();
  narrow_done_run_.start(1);
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    peers_[to].contacts_run.stop();
    peers_[to].contacts_arrived = 0;
    peers_[to].lost = false;
    if (const std::size_t count = contacts.for_peers.of(to).size(); count != 0) {
      contact_counts_.push_back({to, static_cast<std::uint32_t>(count)});
    }
  }
  if (!contact_counts_.empty()) {
    contact_counts_run_.start(contact_counts_.size());
  }
  next_contact_ = 0;
  collisions_run_.start();
  if (const std::size_t changes = contacts.beginning.size() + contacts.ending.size(); changes != 0) {
    change_run_.start(changes);
  }
}

bool MessageExchange::send_contacts(const messages::NarrowDoneRecord& totals) {
  return send_collisions() && state_.send(change_run_, MessageType::change, [&](std::size_t i) { return change(i); }) &&
         state_.send(contact_counts_run_, MessageType::contact_counts,
                     [&](std::size_t i) { return contact_counts_[i]; }) &&
         state_.send(narrow_done_run_, MessageType::narrow_done, [&](std::size_t) { return totals; });
}

bool MessageExchange::send_collisions() {
  link::Sender& out = *state_.setup.server.out;
  const messages::RunHeader to_server = state_.head(MessageType::collision, Endpoint::server());
  const NodeContacts& contacts = state_.contacts;
  for (; next_contact_ < contacts.found.size(); ++next_contact_) {
    std::byte* where = collisions_run_.add(out, to_server, sizeof(messages::CollisionRecord), state_.traffic);
    if (where == nullptr) {
      return false;
    }
    const FoundContact& found = contacts.found[next_contact_];
    const narrow_phase::PairContact& touch = contacts.touches[found.touch];
    new (where) messages::CollisionRecord{found.slot_a, found.slot_b, 0, touch.depth, touch.normal, touch.point};
  }
  return collisions_run_.finish(out, to_server, sizeof(messages::CollisionRecord), state_.traffic);
}

// First the contacts that began, then those that ended.
messages::ChangeRecord MessageExchange::change(std::size_t i) const noexcept {
  const NodeContacts& contacts = state_.contacts;
  if (i >= contacts.beginning.size()) {
    const std::uint64_t key = contacts.ending[i - contacts.beginning.size()];
    const auto border = contacts.border_ending.span();
    const bool at_border = std::binary_search(border.begin(), border.end(), key);
    return {key, 0, messages::change_ended | (at_border ? messages::change_at_border : 0u)};
  }
  const std::uint32_t position = contacts.beginning[i];
  const auto border = contacts.border_beginning.span();
  const auto at =
      std::lower_bound(border.begin(), border.end(), position,
                       [](const BorderContact& contact, std::uint32_t to) { return contact.position < to; });
  const bool at_border = at != border.end() && at->position == position;
  return {contacts.keys[position], position, at_border ? messages::change_at_border : 0u};
}

void MessageExchange::share_contacts() {
  const PeerLists& for_peers = state_.contacts.for_peers;
  for_peers.each_peer([&](NodeNumber to) {
    if (!peers_[to].lost) {
      peers_[to].contacts_run.start(for_peers.of(to).size());
    }
  });
}

bool MessageExchange::send_to_peers() {
  const NodeContacts& contacts = state_.contacts;
  bool all = true;
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    const auto positions = contacts.for_peers.of(to);
    all &= state_.send_to(to, peers_[to].contacts_run, MessageType::notify, [&](std::size_t i) {
      Contact contact;
      contacts.write(contacts.found[positions[i]], contacts.phase(positions[i]), contact);
      return contact;
    });
  }
  return all;
}

void MessageExchange::receive_contacts(const messages::MessageView& message) {
  contacts_arrived_ += message.count();
  peers_[Endpoint{message.header().source}.number()].contacts_arrived += message.count();
  for (std::size_t i = 0; i < message.count(); ++i) {
    received_.push_back(message.record<Contact>(i));
  }
}

void MessageExchange::start_hand_overs(const PeerLists& leaving) {
  leaving_ = &leaving;
  leaving.each_peer([&](NodeNumber to) { peers_[to].hand_overs_run.start(leaving.of(to).size()); });
}

bool MessageExchange::send_hand_overs() {
  Host& host = state_.host;
  bool all = true;
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    messages::RunSender& run = peers_[to].hand_overs_run;
    if (run.done()) {
      continue;
    }
    state_.fault.pass(NodeStage::hand_over, state_.frame);
    const auto leaving = leaving_->of(to);
    all &= run.pump(*state_.setup.peers[to].out, state_.head(MessageType::hand_over, Endpoint::node(to)),
                    sizeof(messages::HandOverRecord) + host.state_bytes(), state_.traffic,
                    [&](std::size_t i, std::byte* where) {
                      const std::uint32_t hosted = host.find(leaving[i]);
                      const messages::HandOverRecord record = host.hand_over(hosted);
                      std::memcpy(where, &record, sizeof record);
                      std::copy_n(host.state(hosted), host.state_bytes(), where + sizeof record);
                      host.drop(leaving[i]);
                      ++state_.stats.handed_over;
                    });
  }
  return all;
}

void MessageExchange::lose(const messages::LostRecord& record) noexcept {
  if (record.detect_again == 0 && record.node < peers_.size()) {
    Peer& peer = peers_[record.node];
    contacts_expected_ -= record.contacts;
    contacts_arrived_ -= std::exchange(peer.contacts_arrived, 0);
    peer.contacts_run.stop();
    peer.lost = true;
    if (!peer.hand_overs_run.done()) {
      for (const ObjectNumber number : leaving_->of(record.node)) {
        state_.host.drop(number);
      }
      peer.hand_overs_run.stop();
    }
  }
}

bool MessageExchange::complete_contacts() {
  if (contacts_arrived_ < contacts_expected_) {
    return false;
  }
  const auto key = [](const Contact& contact) { return base::PairSort::key(contact.a, contact.b); };
  std::sort(received_.begin(), received_.end(), [&](const Contact& p, const Contact& q) { return key(p) < key(q); });
  for (const Contact& contact : received_) {
    state_.host.contacts().add(state_.frame, contact);
  }
  received_.clear();
  return true;
}

bool MessageExchange::report_done(const messages::NodeFrameStats& stats) {
  if (!std::exchange(done_started_, true)) {
    kinds_run_.start(kinds_.size());
    done_run_.start(1);
  }
  return state_.send(kinds_run_, MessageType::kinds, [&](std::size_t i) { return kinds_[i]; }) &&
         state_.send(done_run_, MessageType::frame_done, [&](std::size_t) { return stats; });
}

}  // namespace ringfence::nodes
