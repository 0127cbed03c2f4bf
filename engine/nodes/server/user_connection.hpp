#pragma once

#include <cstddef>
#include <vector>

#include "base/numbers.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"

namespace ringfence::nodes {

/// The server's end of the connection that the user nodes of one thread share. What concerns all of them is sent once.
struct UserConnection {
  Connection connection;
  std::vector<UserNumber> users;  ///< ascending, not empty
  /// In `users`: the first one to which the current step of the frame has not sent everything.
  std::size_t next = 0;
  messages::RunSender begin_run;
  messages::RunSender read_publications_run;  ///< may be sent as soon as everything is published
};

}  // namespace ringfence::nodes
