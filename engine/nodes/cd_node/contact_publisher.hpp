#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/detector.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/output_merge.hpp"

namespace ringfence::nodes {

/// Makes contacts of a CD node's hits and takes them to their readers: the node's own model, the server, the peers that
/// host their objects, and the output lists. Receives the contacts of hosted objects that others found.
///
/// Contacts are listed in order of (a, b): lists in this order can be merged, and the host reads its contacts in this
/// order when it moves next. If the server shares memory, it and the peers read the list in place. Otherwise the node
/// sends it to the server (`collision`, `change`), receives corrections, and sends the peers their contacts (`notify`).
///
/// Only send(), finish() and send_to_peers() depend on whether memory is shared; read_peer_contacts() and write_slice()
/// read memory of other nodes, behind a gate.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class ContactPublisher {
 public:
  /// Both outlive the publisher.
  ContactPublisher(NodeState& state, const Detector& detector);

  /// After Detector::finish(): lists the contacts, compares them with those of the frame before, and starts to send.
  void list();
  /// Sends to the server what it cannot read, and `narrow_done`. Returns whether all is sent; if not, call it again.
  bool send();
  /// Publishes the partial messages, so that another message can be sent to the server.
  void flush();
  /// Applies a `correct` message: these contacts persist.
  void receive_corrections(const messages::MessageView& message);
  /// A `notify` message of the server between frames: contacts of the last frame, for objects that were adopted.
  void receive_late(const messages::MessageView& message) { state_.host.contacts().add_late(message); }
  /// The number of contacts that arrive from other nodes in this frame, from `frame_end`.
  void expect(std::uint64_t contacts) noexcept { expected_ = contacts; }
  /// A `notify` message of another node: contacts of this frame.
  void receive(const messages::MessageView& message);
  /// A peer is lost when contacts were final: those that it has not sent arrive from the server at the next cut.
  void lose(const messages::LostRecord& record) noexcept;
  /// After `frame_end`: sets the phases of own contacts, and in shared memory writes a slice of the output lists and
  /// reads the other nodes' contacts of hosted objects.
  void finish();
  /// After finish(): sends the other nodes the contacts of their objects. Returns whether all are sent; if not, call it
  /// again.
  bool send_to_peers();
  /// Whether all contacts of other nodes have arrived.
  bool is_complete() const noexcept { return arrived_ >= expected_; }
  /// When all have arrived: adds them to Host, in order.
  void add_received();

 private:
  void compare();
  void list_counts();
  void list_notified_hosts(std::uint32_t position);
  messages::ChangeRecord change(std::size_t i) const noexcept;
  bool send_collisions();
  bool send_changes();
  void confirm_begins();
  void read_peer_contacts();

  NodeState& state_;
  const Detector& detector_;
  std::size_t next_hit_ = 0;  ///< next to send
  OutputMergeScratch scratch_;
  messages::RunWriter collisions_run_;
  messages::RunSender change_run_, counts_run_, done_run_;
  /// Contacts sent to another node, and received from it.
  struct Peer {
    messages::RunSender run;
    std::uint64_t arrived = 0;
    bool lost = false;
  };
  std::vector<Peer> peers_;  ///< by slot
  std::vector<messages::CountRecord> counts_;
  std::vector<Contact> received_;  ///< from other nodes, in the order of arrival
  std::uint64_t expected_ = 0;
  std::uint64_t arrived_ = 0;  ///< without those of nodes that were lost
};

}  // namespace ringfence::nodes
