#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <utility>

#include <unistd.h>

#include "dds/channel_end.hpp"
#include "dds/link_socket.hpp"
#include "dds/link_stream.hpp"
#include "dds/node_world.hpp"

namespace ringfence::test {

/// What carries the bytes of a link.
enum class LinkKind : std::uint8_t { tcp, socket, shared };
inline constexpr std::array link_kinds{LinkKind::tcp, LinkKind::socket, LinkKind::shared};

/// Where a process listens for links of one kind.
class LinkListener {
 public:
  explicit LinkListener(LinkKind kind)
      : kind_(kind),
        name_(std::uint64_t{std::random_device()()} << 32 | static_cast<std::uint32_t>(getpid())),
        tcp_(dds::LinkSocket::listen(1, 0)),
        local_(kind == LinkKind::tcp ? dds::LinkSocket() : dds::LinkSocket::listen_locally(name_)) {
    REQUIRE(bool(local_) == (kind != LinkKind::tcp));
  }
  std::uint32_t port() const { return tcp_.port(); }
  std::uint64_t name() const noexcept { return name_; }
  LinkKind kind() const noexcept { return kind_; }

  /// Opens a link to this listener. Without rings of a possible size, a local socket carries the bytes.
  dds::LinkStream connect(dds::LinkStream::RingBytes rings = small_rings) const {
    return dds::LinkStream::connect({loopback, port()}, name_, kind_ == LinkKind::socket ? no_rings : rings);
  }
  /// The next link that was opened; none after some seconds.
  dds::LinkStream accept() const {
    dds::LinkSocket socket = accept_socket();
    return kind_ == LinkKind::tcp ? dds::LinkStream(std::move(socket))
                                  : dds::LinkStream::accepted_locally(std::move(socket));
  }
  dds::LinkSocket accept_socket() const {
    dds::LinkSocket socket;
    REQUIRE(wait_until([&] { return bool(socket = kind_ == LinkKind::tcp ? tcp_.accept() : local_.accept()); }));
    return socket;
  }

 private:
  LinkKind kind_;
  std::uint64_t name_;
  dds::LinkSocket tcp_;
  dds::LinkSocket local_;
};

}  // namespace ringfence::test
