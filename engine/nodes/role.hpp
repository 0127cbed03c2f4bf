#pragma once

#include <cstdint>

#include "link/channel.hpp"

namespace ringfence::nodes {

struct Findings;

/// What a role's step answers. A role never blocks: it does what it can and says how it stands.
enum class Step : std::uint8_t {
  idle,        ///< nothing to do until a message arrives
  progressed,  ///< something was done; step again
  blocked,     ///< waits for room in a link
};

/// Both directions of the way between two roles, seen from one of them. The channels outlive it.
struct Line {
  link::Sender* out = nullptr;
  link::Receiver* in = nullptr;
  Findings* findings = nullptr;  ///< that a CD node shares with the server; null where they are in two processes
};

}  // namespace ringfence::nodes
