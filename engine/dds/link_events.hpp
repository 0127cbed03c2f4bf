#pragma once

#include <array>
#include <cstdint>

#include "dds/link_socket.hpp"

namespace ringfence::dds {

/// A set of sockets, and which of them have new events: data, room to send, an end. An event is reported once, so who
/// takes it reads, or sends, until the socket has no more.
///
/// Threads: take() by one thread; add() and remove() by any.
class LinkEvents {
 public:
  /// Throws Error if the system has no descriptor for the set.
  LinkEvents();
  ~LinkEvents();
  LinkEvents(const LinkEvents&) = delete;
  LinkEvents& operator=(const LinkEvents&) = delete;

  /// Readable while there are events that were not taken.
  int descriptor() const noexcept { return set_; }
  /// `tag` is passed to `visit` with the socket's events. A closed socket leaves the set by itself.
  /// Room to send is an event only with `awaits_room`. Adding a socket again replaces that.
  void add(const LinkSocket& socket, std::uint64_t tag, bool awaits_room = true) const noexcept;
  void remove(const LinkSocket& socket) const noexcept;
  /// While it is included, another set's untaken events are an event of this one, reported until they are taken there.
  void include(const LinkEvents& other, std::uint64_t tag) const noexcept;
  void exclude(const LinkEvents& other) const noexcept;

  /// Calls visit(tag) for each socket with new events. Never waits. Returns whether there was any.
  template <class Visit>
  bool take(Visit visit) const {
    std::array<std::uint64_t, most> tags;
    std::size_t count = take_some(tags);
    const bool any = count != 0;
    for (;;) {
      for (std::size_t i = 0; i < count; ++i) {
        visit(tags[i]);
      }
      if (count < most) {
        return any;
      }
      count = take_some(tags);
    }
  }

 private:
  static constexpr std::size_t most = 16;
  std::size_t take_some(std::array<std::uint64_t, most>& tags) const noexcept;

  int set_;  ///< epoll
};

}  // namespace ringfence::dds
