#include "dds/parcel_channel.hpp"

#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::dds {

ParcelChannel::ParcelChannel(LinkStream stream, std::span<const std::byte> hello) : stream_(std::move(stream)) {
  if (!hello.empty()) {
    stream_.append(hello);
  }
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
  if (parcel_ != no_parcel &&
      stream_.appended() - parcel_ + sizeof(Packing) + filled > sizeof(ParcelHeader) + max_bytes) {
    flush();
  }
  if (parcel_ == no_parcel) {
    begin_parcel(ParcelKind::messages);
  }
  const Packing packing{static_cast<std::uint32_t>(message.size()), 0};
  stream_.append(std::as_bytes(std::span(&packing, 1)));
  stream_.append(message);
}

void ParcelChannel::enqueue(ParcelKind kind, std::span<const std::byte> bytes) {
  end_parcel();
  begin_parcel(kind);
  if (!bytes.empty()) {
    stream_.append(bytes);
  }
  end_parcel();
}

void ParcelChannel::begin_parcel(ParcelKind kind) {
  parcel_ = stream_.appended();
  const ParcelHeader header{0, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed), 0};
  stream_.append(std::as_bytes(std::span(&header, 1)));
}

void ParcelChannel::end_parcel() {
  if (parcel_ == no_parcel) {
    return;
  }
  const auto bytes = static_cast<std::uint32_t>(stream_.appended() - parcel_ - sizeof(ParcelHeader));
  stream_.replace(parcel_ + offsetof(ParcelHeader, bytes), std::as_bytes(std::span(&bytes, 1)));
  parcel_ = no_parcel;
  if (unanswered_since_ns_ == 0) {
    unanswered_since_ns_ = telemetry::now_ns();
  }
  sent_parcels_.add(1);
  sent_bytes_.add(bytes);
  shared_bytes_.add(stream_.is_shared() ? bytes : 0);
}

bool ParcelChannel::flush() {
  end_parcel();
  const bool all = stream_.flush();
  if (stream_.is_closed()) {
    fail();
  } else if (!all) {
    refused_writes_.add(1);
  }
  return all;
}

void ParcelChannel::fail() noexcept {
  broken_ = true;
  parcel_ = no_parcel;
}

// Returns whether the first received parcel is complete and valid; then its header is in header_.
bool ParcelChannel::next_parcel() {
  const std::span<const std::byte> received = stream_.received();
  if (!header_) {
    if (received.size() < sizeof(ParcelHeader)) {
      return false;
    }
    header_ = read_once<ParcelHeader>(received);
    if (header_->bytes > max_bytes || header_->bytes % 8 != 0) {
      header_.reset();
      stream_.close();
      fail();
      return false;
    }
  }
  return received.size() - sizeof(ParcelHeader) >= header_->bytes;
}

std::span<const std::byte> ParcelChannel::contents() {
  const auto bytes = stream_.received().subspan(sizeof(ParcelHeader), header_->bytes);
  if (static_cast<ParcelKind>(header_->kind) == ParcelKind::messages) {
    return bytes;
  }
  control_.assign(bytes.begin(), bytes.end());
  return control_;
}

void ParcelChannel::end_of_delivery() {
  const std::uint32_t bytes = header_->bytes;
  stream_.take(sizeof(ParcelHeader) + bytes);
  stream_.release();
  header_.reset();
  offset_ = 0;
  count_received(bytes);
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
  return {sent_parcels_.value(),     sent_bytes_.value(),
          received_parcels_.value(), received_bytes_.value(),
          shared_bytes_.value(),     refused_writes_.value(),
          answers_.value(),          answer_ns_.value(),
          answer_ns_max_.value(),    stream_.socket().retransmitted_bytes()};
}

}  // namespace ringfence::dds
