#include "dds/parcel_channel.hpp"

#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::dds {
namespace {

/// Room for what is read at once: several parcels, but small enough to stay in the cache until it is processed.
constexpr std::size_t in_bytes = std::size_t{1} << 17;
static_assert(in_bytes >= 2 * (sizeof(ParcelHeader) + ParcelChannel::max_bytes));

}  // namespace

ParcelChannel::ParcelChannel(LinkSocket socket, std::span<const std::byte> hello, std::span<const std::byte> received)
    : socket_(std::move(socket)), out_(hello.begin(), hello.end()), in_(in_bytes), end_(received.size()) {
  out_.reserve(max_unsent + max_bytes);
  if (received.size() > in_.size()) {
    in_.resize(received.size());
  }
  std::copy(received.begin(), received.end(), in_.begin());
}

// A message that next() has returned must be taken, so there must be room before the call.
bool ParcelChannel::gather(link::Receiver& in) {
  bool any = false;
  bool more = true;
  while (more && has_room()) {
    const auto message = in.next();
    more = !message.empty();
    if (more) {
      add(message);
      any = true;
    }
  }
  if (any) {
    in.release();
  }
  return !more;
}

void ParcelChannel::add(std::span<const std::byte> message) {
  const std::size_t filled = (message.size() + 7) / 8 * 8;
  if (parcel_ != no_parcel && out_.size() - parcel_ + sizeof(Packing) + filled > sizeof(ParcelHeader) + max_bytes) {
    flush();
  }
  if (parcel_ == no_parcel) {
    begin_parcel(ParcelKind::messages);
  }
  const Packing packing{static_cast<std::uint32_t>(message.size()), 0};
  const auto* head = reinterpret_cast<const std::byte*>(&packing);
  out_.insert(out_.end(), head, head + sizeof packing);
  out_.insert(out_.end(), message.begin(), message.end());
  out_.resize(out_.size() + (filled - message.size()));
}

void ParcelChannel::enqueue(ParcelKind kind, std::span<const std::byte> bytes) {
  end_parcel();
  begin_parcel(kind);
  out_.insert(out_.end(), bytes.begin(), bytes.end());
  end_parcel();
}

void ParcelChannel::begin_parcel(ParcelKind kind) {
  parcel_ = out_.size();
  const ParcelHeader header{0, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed), 0};
  const auto* head = reinterpret_cast<const std::byte*>(&header);
  out_.insert(out_.end(), head, head + sizeof header);
}

void ParcelChannel::end_parcel() {
  if (parcel_ == no_parcel) {
    return;
  }
  const auto bytes = static_cast<std::uint32_t>(out_.size() - parcel_ - sizeof(ParcelHeader));
  std::memcpy(out_.data() + parcel_ + offsetof(ParcelHeader, bytes), &bytes, sizeof bytes);
  parcel_ = no_parcel;
  if (unanswered_since_ns_ == 0) {
    unanswered_since_ns_ = telemetry::now_ns();
  }
  sent_parcels_.add(1);
  sent_bytes_.add(bytes);
}

bool ParcelChannel::flush() {
  end_parcel();
  if (out_.empty()) {
    return true;
  }
  if (broken_) {
    out_.clear();
    return true;
  }
  std::size_t sent = 0;
  const LinkSocket::Result result = socket_.send(out_, sent);
  if (result == LinkSocket::Result::closed) {
    fail();
    return true;
  }
  out_.erase(out_.begin(), out_.begin() + static_cast<std::ptrdiff_t>(sent));
  if (!out_.empty()) {
    refused_writes_.add(1);
  }
  return out_.empty();
}

void ParcelChannel::fail() noexcept {
  broken_ = true;
  readable_ = false;
  out_.clear();
  parcel_ = no_parcel;
}

// Sets `header` to that of the first parcel. Returns false if the parcel is not complete, or not valid.
bool ParcelChannel::next_parcel(ParcelHeader& header) {
  if (end_ - begin_ < sizeof header) {
    return false;
  }
  std::memcpy(&header, in_.data() + begin_, sizeof header);
  if (header.bytes > max_bytes || header.bytes % 8 != 0) {
    begin_ = end_;
    fail();
    return false;
  }
  return end_ - begin_ - sizeof header >= header.bytes;
}

// Returns whether anything was read. A read that does not fill the room has emptied the socket, so the next byte is a
// new event.
bool ParcelChannel::read() {
  if (!readable_) {
    return false;
  }
  std::copy(in_.begin() + static_cast<std::ptrdiff_t>(begin_), in_.begin() + static_cast<std::ptrdiff_t>(end_),
            in_.begin());
  end_ -= std::exchange(begin_, 0);
  const std::span<std::byte> room = std::span(in_).subspan(end_);
  std::size_t got = 0;
  const LinkSocket::Result result = socket_.receive(room, got);
  readable_ = got == room.size();
  end_ += got;
  if (result == LinkSocket::Result::closed) {
    fail();
  }
  return got != 0;
}

void ParcelChannel::count_received(std::size_t bytes) noexcept {
  if (unanswered_since_ns_ != 0) {
    const std::uint64_t passed = telemetry::now_ns() - std::exchange(unanswered_since_ns_, 0);
    answers_.add(1);
    answer_ns_.add(passed);
    answer_ns_max_.raise(passed);
  }
  received_parcels_.add(1);
  received_bytes_.add(bytes);
}

ParcelChannel::Counters ParcelChannel::counters() const noexcept {
  return {sent_parcels_.value(),   sent_bytes_.value(),     received_parcels_.value(),
          received_bytes_.value(), refused_writes_.value(), answers_.value(),
          answer_ns_.value(),      answer_ns_max_.value(),  socket_.retransmitted_bytes()};
}

}  // namespace ringfence::dds
