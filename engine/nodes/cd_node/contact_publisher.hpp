#pragma once

#include <cstddef>
#include <cstdint>

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
/// order when it moves next. If the server shares memory, it and the peers read the list in place; otherwise the node
/// sends it (`collision`, `change`) and receives corrections and contacts as messages.
///
/// Only list(), send() and finish() depend on whether memory is shared; read_peer_contacts() and write_slice() read
/// memory of other nodes, behind a gate.
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
  /// Adds the contacts of a `notify` message to Host.
  void receive(const messages::MessageView& message);
  /// After `frame_end`: sets the phases of own contacts, writes a slice of the output lists, and reads the other nodes'
  /// contacts of hosted objects.
  void finish();

 private:
  bool is_shared() const noexcept { return &state_.contacts != &state_.own_contacts; }
  void compare();
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
  messages::RunSender change_run_, done_run_;
};

}  // namespace ringfence::nodes
