#pragma once

#include <cstddef>
#include <string>

#include "dds/wire.hpp"

namespace ringfence::dds {

/// Longest text of another process that is kept and logged, bytes.
inline constexpr std::size_t max_foreign_text = 200;

/// A text from another process as it can be logged: at most max_foreign_text bytes, and a question mark for each
/// control character, so that it can neither begin a line of the log nor change a terminal. Null: empty.
std::string printable(const char* text);

/// What a node says about itself in its Presence.
struct Announcement {
  std::string name;    ///< printable
  std::string reason;  ///< printable; see Presence::reason in wire.idl
  bool fits = false;   ///< its version, byte order, record layout and release are those of this process
  NodeState state = NodeState::joining;
};

/// Reads a Presence. Its sender need not be trusted: a state that this version does not have counts as joining, so such
/// a node is never assigned. Any thread; allocates the two texts.
Announcement read_announcement(const PresenceSample& sample);

/// Whether a Presence or Terms is from a process that writes the fields of this version in this byte order.
bool has_own_format(std::uint32_t version, const std::uint8_t (&order)[4]) noexcept;

}  // namespace ringfence::dds
