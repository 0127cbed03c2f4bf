#include "dds/link_stream.hpp"

#include <algorithm>
#include <utility>

#include <unistd.h>

namespace ringfence::dds {
namespace {

constexpr std::byte refused{0}, mapped{1}, wake{2};

constexpr std::size_t filled_size(std::size_t bytes) noexcept { return (bytes + 7) / 8 * 8; }

/// Copies `bytes` and fills up with zeros.
void copy_filled(std::span<const std::byte> bytes, std::byte* to, std::size_t filled) noexcept {
  std::memcpy(to, bytes.data(), bytes.size());
  std::memset(to + bytes.size(), 0, filled - bytes.size());
}

}  // namespace

LinkStream::LinkStream(LinkSocket socket, std::span<const std::byte> received)
    : socket_(std::move(socket)), in_(received.begin(), received.end()), end_(received.size()) {}

LinkStream LinkStream::accepted_locally(LinkSocket socket) {
  LinkStream link(std::move(socket));
  link.handshake_ = Handshake::awaits_offer;
  return link;
}

LinkStream LinkStream::connect(LinkAddress to, std::uint64_t local_name, RingBytes rings) {
  if (LinkSocket local = LinkSocket::connect_locally(local_name)) {
    LinkStream link(std::move(local));
    link.offer(rings);
    return link;
  }
  return LinkStream(LinkSocket::connect(to));
}

void LinkStream::report_to(const LinkEvents& events, std::uint64_t tag) noexcept {
  events_ = &events;
  tag_ = tag;
  update_events();
}

// Room for a byte that wakes is no event: the other process makes some with each such byte that it reads.
void LinkStream::update_events() const noexcept {
  if (events_ != nullptr) {
    events_->add(socket_, tag_, rings_ == nullptr && handshake_ == Handshake::done);
  }
}

// The other process awaits a byte in any case. Without a descriptor it reads everything from the socket.
void LinkStream::offer(RingBytes rings) {
  rings_ = SharedRings::create(rings.out, rings.in);
  handshake_ = Handshake::offered;
  if (rings_ != nullptr && socket_.send_descriptor(rings_->descriptor()) == LinkSocket::Result::done) {
    rings_->close_descriptor();
    return;
  }
  rings_.reset();
  std::size_t sent = 0;
  closed_ = socket_.send({&refused, 1}, sent) != LinkSocket::Result::done;
}

void LinkStream::take_offer() {
  int descriptor = -1;
  const LinkSocket::Result result = socket_.receive_descriptor(descriptor);
  has_events_ = result == LinkSocket::Result::done;
  closed_ = result == LinkSocket::Result::closed;
  if (result == LinkSocket::Result::done) {
    handshake_ = Handshake::done;
    rings_ = SharedRings::open(descriptor);
    update_events();
    std::size_t sent = 0;
    closed_ = socket_.send({rings_ != nullptr ? &mapped : &refused, 1}, sent) != LinkSocket::Result::done;
  }
  if (descriptor >= 0) {
    ::close(descriptor);
  }
}

// If the other process has not mapped the memory, what was written to the ring goes to the socket. The ring was not
// read, so it holds all that was written from position 0 on.
void LinkStream::take_answer(std::byte answer) {
  handshake_ = Handshake::done;
  if (rings_ != nullptr && answer != mapped) {
    erase_sent();
    const std::byte* const written = rings_->out_at(0);
    unsent_.insert(unsent_.begin(), written, written + rings_->end().write_position());
    rings_.reset();
  }
  update_events();
}

void LinkStream::close() noexcept {
  closed_ = true;
  unsent_.clear();
  sent_ = 0;
  begin_ = end_;
  rings_.reset();
}

void LinkStream::append(std::span<const std::byte> bytes) {
  const std::size_t filled = filled_size(bytes.size());
  appended_ += filled;
  if (!closed_ && !append_to_ring(bytes, filled)) {
    unsent_.resize(unsent_.size() + filled);
    copy_filled(bytes, unsent_.data() + unsent_.size() - filled, filled);
  }
}

bool LinkStream::append_to_ring(std::span<const std::byte> bytes, std::size_t filled) noexcept {
  if (rings_ == nullptr || unsent() != 0 || !rings_->end().make_room(filled)) {
    return false;
  }
  copy_filled(bytes, rings_->out_at(rings_->end().write_position()), filled);
  rings_->end().stage(filled);
  return true;
}

void LinkStream::replace(std::uint64_t position, std::span<const std::byte> bytes) noexcept {
  if (closed_) {
    return;
  }
  const std::uint64_t first_unsent = appended_ - unsent();
  std::byte* const at =
      position >= first_unsent ? unsent_.data() + sent_ + (position - first_unsent) : rings_->out_at(position);
  std::memcpy(at, bytes.data(), bytes.size());
}

bool LinkStream::flush() {
  if (handshake_ == Handshake::offered) {
    read_signals();
  }
  if (rings_ != nullptr) {
    fill_ring();
    if (rings_->end().publish()) {
      wake_other();
    }
    closed_ |= rings_->end().is_broken();
  } else if (handshake_ == Handshake::done) {
    send_unsent();
  }
  if (closed_ || sent_ == unsent_.size()) {
    unsent_.clear();
    sent_ = 0;
  } else if (sent_ > unsent_.size() / 2) {
    erase_sent();
  }
  return unsent_.empty();
}

void LinkStream::erase_sent() noexcept {
  unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(std::exchange(sent_, 0)));
}

void LinkStream::fill_ring() {
  SharedRings::End& end = rings_->end();
  while (unsent() != 0 && end.make_room(8)) {
    const std::size_t bytes = std::min<std::size_t>(end.room(), unsent());
    std::memcpy(rings_->out_at(end.write_position()), unsent_.data() + sent_, bytes);
    end.stage(bytes);
    sent_ += bytes;
  }
}

void LinkStream::send_unsent() {
  std::size_t sent = 0;
  if (unsent() != 0 && socket_.send(std::span(unsent_).subspan(sent_), sent) == LinkSocket::Result::closed) {
    closed_ = true;
  }
  sent_ += sent;
}

// If the socket takes no byte, it has some that the other process has not read: that process does not sleep.
void LinkStream::wake_other() noexcept {
  std::size_t sent = 0;
  closed_ |= socket_.send({&wake, 1}, sent) == LinkSocket::Result::closed;
}

bool LinkStream::receive(std::size_t most) {
  if (closed_) {
    return rings_ != nullptr && rings_->end().refresh();
  }
  if (has_events_ && handshake_ == Handshake::awaits_offer) {
    take_offer();
  }
  if (has_events_ && (rings_ != nullptr || handshake_ == Handshake::offered)) {
    read_signals();
  }
  if (rings_ != nullptr) {
    const bool more = rings_->end().refresh();
    closed_ |= rings_->end().is_broken();
    return more;
  }
  return handshake_ == Handshake::done && has_events_ && read_socket(most);
}

// Reads to the end, because the end of the link has no event of its own if it comes with other bytes.
void LinkStream::read_signals() {
  auto result = LinkSocket::Result::done;
  while (result == LinkSocket::Result::done && (rings_ != nullptr || handshake_ == Handshake::offered)) {
    std::byte signals[16];
    std::size_t got = 0;
    // The answer is the first byte; what follows it may be bytes of the stream.
    result = socket_.receive(std::span(signals).first(handshake_ == Handshake::offered ? 1 : sizeof signals), got);
    if (got != 0 && handshake_ == Handshake::offered) {
      take_answer(signals[0]);
    }
  }
  has_events_ = result == LinkSocket::Result::done;
  closed_ |= result == LinkSocket::Result::closed;
}

bool LinkStream::read_socket(std::size_t most) {
  constexpr std::size_t at_once = std::size_t{1} << 16;
  if (begin_ != 0) {
    std::copy(in_.begin() + static_cast<std::ptrdiff_t>(begin_), in_.begin() + static_cast<std::ptrdiff_t>(end_),
              in_.begin());
    end_ -= std::exchange(begin_, 0);
  }
  if (end_ >= most) {
    return false;
  }
  const std::size_t room = std::min(at_once, most - end_);
  in_.resize(std::max(in_.size(), end_ + room));
  std::size_t got = 0;
  const LinkSocket::Result result = socket_.receive(std::span(in_).subspan(end_, room), got);
  end_ += got;
  has_events_ = result == LinkSocket::Result::done;
  closed_ |= result == LinkSocket::Result::closed;
  return got != 0;
}

std::span<const std::byte> LinkStream::received() const noexcept {
  if (rings_ != nullptr) {
    return {rings_->in_at(rings_->end().read_position()), rings_->end().available()};
  }
  return std::span(in_).subspan(begin_, end_ - begin_);
}

void LinkStream::take(std::size_t bytes) noexcept {
  if (rings_ != nullptr) {
    rings_->end().take(bytes);
  } else {
    begin_ += bytes;
  }
}

void LinkStream::release() {
  if (rings_ != nullptr && rings_->end().release()) {
    wake_other();
  }
}

}  // namespace ringfence::dds
