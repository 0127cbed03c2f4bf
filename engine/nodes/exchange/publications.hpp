#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "nodes/exchange/publication.hpp"
#include "nodes/exchange/user_states.hpp"
#include "queries/recorded_frame.hpp"

namespace ringfence::nodes {

/// A publication and the box around its positions. Readers skip a publication whose box they do not touch.
struct Published {
  Publication* publication = nullptr;  ///< null: unused entry
  geometry::CornerBox bounds[2];       ///< by parity of the frame
  bool any[2] = {false, false};        ///< by parity of the frame: whether there is any state
};

/// The publication, for the user nodes, of the objects that a CD node in the server's process hosts, or all user nodes
/// of a thread.
///
/// Threads: the server writes `wanted` before it starts the frame, or connects a fallback node within it. The host
/// writes the rest before it reports `published`. From then on the server decides whether the publication is valid
/// (Publications::relays). A CD node that is lost before it has reported `published` may write as long as its thread
/// runs, but its publication is not read. One that is lost later has finished writing, and is never started again. A
/// user thread that was abandoned does not write; the thread that replaces it continues.
struct HostPublication {
  /// As Publication.
  HostPublication(std::size_t states, double interest, std::size_t kept_frames = 2)
      : publication(states, interest, kept_frames) {
    published.publication = &publication;
  }
  HostPublication(const HostPublication&) = delete;
  HostPublication& operator=(const HostPublication&) = delete;
  Publication publication;
  UserStates users;  ///< of user nodes
  Published published;
  bool wanted = false;  ///< of a CD node: set if the publication is read in this frame
};

/// All publications that user nodes read. The user nodes of each thread publish the objects that they host. The server,
/// or the CD nodes that host them, publish the other active and non-active objects.
///
/// Threads: in a frame each writer writes its own publication before it reports, and the others read it after the
/// server has sent read_publications.
struct Publications {
  Published server;  ///< the objects that no CD node publishes
  /// By parity of the frame: the valid publications. Each object is in exactly one of them. The server lists them
  /// before it sends read_publications. They do not change after that, even if nodes are lost, and stay readable until
  /// the next frame is complete.
  std::vector<const Published*> relays[2];
  /// Frame k-1 for the models that ask queries in frame k; null: none. The facade sets it while no frame is running,
  /// and keeps the frame until the threads of user nodes that are late and of CD nodes that are lost in frame k have
  /// ended. A user node reads the pointer before its move begins.
  const queries::RecordedFrame* sensed = nullptr;
};

/// Stores in `own` what readers need to know of its publication for `frame`. Called by the writer after it has
/// published.
inline void note_published(Published& own, std::uint64_t frame) noexcept {
  own.any[frame & 1] = !own.publication->states(frame).empty();
  own.bounds[frame & 1] = own.publication->bounds(frame);
}

}  // namespace ringfence::nodes
