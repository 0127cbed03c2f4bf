#pragma once

#include <cstddef>
#include <vector>

#include "base/numbers.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"

namespace ringfence::nodes {

/// The server's end of the connection that the user nodes of one thread share. What concerns all of them is sent once.
/// A connection without room does not delay what is sent on the others.
struct UserConnection {
  Connection connection;
  std::vector<UserNumber> users;     ///< ascending, not empty
  std::vector<UserNumber> changed;   ///< those to which the next frame_begin sends something before it
  std::vector<UserNumber> notified;  ///< those with contacts in this frame
  std::size_t next = 0;              ///< in the list that is sent now: the first one to which not everything is sent
  messages::RunSender begin_run;
  messages::RunSender read_publications_run;  ///< may be sent as soon as everything is published
  messages::RunSender end_run;                ///< after the contacts of the frame
  // Received from the thread in this frame.
  bool published = false;   ///< the publication of its user nodes can be read
  bool frame_done = false;  ///< its user nodes have completed the frame
};

}  // namespace ringfence::nodes
