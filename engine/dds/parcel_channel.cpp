#include "dds/parcel_channel.hpp"

#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::dds {

ParcelChannel::ParcelChannel(dds_entity_t writer, std::uint64_t incarnation)
    : writer_(writer), incarnation_(incarnation) {
  batch_.reserve(std::size_t{1} << 17);
}

// A node's rings have 64 KiB, so their messages have at most half of that.
bool ParcelChannel::has_room() {
  constexpr std::size_t full = max_bytes - 32'768 - sizeof(Packing);
  return (batch_.size() <= full || flush()) && (queued_.empty() || flush());
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

bool ParcelChannel::add(std::span<const std::byte> message) {
  const std::size_t filled = (message.size() + 7) / 8 * 8;
  if (!queued_.empty() || (!batch_.empty() && batch_.size() + sizeof(Packing) + filled > max_bytes)) {
    if (!flush()) {
      return false;
    }
  }
  const Packing packing{static_cast<std::uint32_t>(message.size()), 0};
  const auto* head = reinterpret_cast<const std::byte*>(&packing);
  batch_.insert(batch_.end(), head, head + sizeof packing);
  batch_.insert(batch_.end(), message.begin(), message.end());
  batch_.resize(batch_.size() + (filled - message.size()));
  return true;
}

bool ParcelChannel::flush() {
  if (!batch_.empty()) {
    if (!write(ParcelKind::messages, batch_)) {
      return false;
    }
    batch_.clear();
  }
  while (!queued_.empty()) {
    if (!write(queued_.front().kind, queued_.front().bytes)) {
      return false;
    }
    queued_.pop_front();
  }
  return true;
}

void ParcelChannel::enqueue(ParcelKind kind, std::span<const std::byte> bytes) {
  queued_.push_back({kind, {bytes.begin(), bytes.end()}});
}

bool ParcelChannel::write(ParcelKind kind, std::span<const std::byte> bytes) {
  if (sent_ - sent_acknowledged_ >= window) {
    refused_writes_.add(1);
    return false;
  }
  const ParcelSample parcel{
      incarnation_, sent_ + 1, processed_, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed),
      borrow(bytes)};
  if (dds_write(writer_, &parcel) != DDS_RETCODE_OK) {
    refused_writes_.add(1);
    return false;
  }
  ++sent_;
  if (unanswered_since_ns_ == 0) {
    unanswered_since_ns_ = telemetry::now_ns();
  }
  acknowledgement_sent_ = processed_;
  sent_parcels_.add(1);
  sent_bytes_.add(bytes.size());
  return true;
}

void ParcelChannel::send_unnumbered(ParcelKind kind) {
  const ParcelSample parcel{
      incarnation_, 0, processed_, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed), {}};
  if (dds_write(writer_, &parcel) == DDS_RETCODE_OK) {
    acknowledgement_sent_ = processed_;
  }
}

bool ParcelChannel::read_header(const ParcelSample& parcel) {
  sent_acknowledged_ = std::max<std::uint64_t>(sent_acknowledged_, std::min<std::uint64_t>(parcel.taken, sent_));
  if (parcel.number == 0) {
    return true;
  }
  if (unanswered_since_ns_ != 0) {
    const std::uint64_t passed = telemetry::now_ns() - std::exchange(unanswered_since_ns_, 0);
    answers_.add(1);
    answer_ns_.add(passed);
    answer_ns_max_.raise(passed);
  }
  return parcel.number == ++received_;
}

void ParcelChannel::count_processed(std::size_t bytes) noexcept {
  ++processed_;
  received_parcels_.add(1);
  received_bytes_.add(bytes);
}

ParcelChannel::Counters ParcelChannel::counters() const noexcept {
  return {sent_parcels_.value(),   sent_bytes_.value(), received_parcels_.value(), received_bytes_.value(),
          refused_writes_.value(), answers_.value(),    answer_ns_.value(),        answer_ns_max_.value()};
}

void ParcelChannel::acknowledge() {
  if (processed_ - acknowledgement_sent_ >= window / 2) {
    send_unnumbered(ParcelKind::taken);
  }
}

}  // namespace ringfence::dds
