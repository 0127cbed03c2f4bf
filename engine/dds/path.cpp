#include "dds/path.hpp"

#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::dds {

Path::Path(dds_entity_t writer, std::uint64_t incarnation) : writer_(writer), incarnation_(incarnation) {
  batch_.reserve(std::size_t{1} << 17);
}

bool Path::gather(link::Receiver& in) {
  // What next() has returned cannot be given back, so there must be room before it is called: a node's rings are of 64
  // KiB, so their messages are of at most half that.
  constexpr std::size_t full = most_bytes - 32'768 - sizeof(Packing);
  bool any = false;
  bool more = true;
  while (more && (batch_.size() <= full || flush()) && (sayings_.empty() || flush())) {
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

bool Path::add(std::span<const std::byte> message) {
  const std::size_t filled = (message.size() + 7) / 8 * 8;
  if (!sayings_.empty() || (!batch_.empty() && batch_.size() + sizeof(Packing) + filled > most_bytes)) {
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

bool Path::flush() {
  if (!batch_.empty()) {
    if (!write(ParcelKind::messages, batch_)) {
      return false;
    }
    batch_.clear();
  }
  while (!sayings_.empty()) {
    if (!write(sayings_.front().kind, sayings_.front().bytes)) {
      return false;
    }
    sayings_.pop_front();
  }
  return true;
}

void Path::say(ParcelKind kind, std::span<const std::byte> bytes) {
  sayings_.push_back({kind, {bytes.begin(), bytes.end()}});
}

bool Path::write(ParcelKind kind, std::span<const std::byte> bytes) {
  if (sent_ - sent_taken_ >= window) {
    refused_writes_.add(1);
    return false;
  }
  const ParcelSample parcel{
      incarnation_, sent_ + 1, taken_, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed),
      borrow(bytes)};
  if (dds_write(writer_, &parcel) != DDS_RETCODE_OK) {
    refused_writes_.add(1);
    return false;
  }
  ++sent_;
  if (asked_ns_ == 0) {
    asked_ns_ = telemetry::now_ns();
  }
  taken_told_ = taken_;
  sent_parcels_.add(1);
  sent_bytes_.add(bytes.size());
  return true;
}

void Path::remark(ParcelKind kind) {
  const ParcelSample parcel{
      incarnation_, 0, taken_, static_cast<std::uint32_t>(kind), shapes_.load(std::memory_order_relaxed), {}};
  if (dds_write(writer_, &parcel) == DDS_RETCODE_OK) {
    taken_told_ = taken_;
  }
}

bool Path::note(const ParcelSample& parcel) {
  sent_taken_ = std::max<std::uint64_t>(sent_taken_, std::min<std::uint64_t>(parcel.taken, sent_));
  if (parcel.number == 0) {
    return true;
  }
  if (asked_ns_ != 0) {
    const std::uint64_t passed = telemetry::now_ns() - std::exchange(asked_ns_, 0);
    answers_.add(1);
    answer_ns_.add(passed);
    answer_ns_max_.raise(passed);
  }
  return parcel.number == ++received_;
}

void Path::taken(std::size_t bytes) noexcept {
  ++taken_;
  taken_parcels_.add(1);
  taken_bytes_.add(bytes);
}

Path::Counters Path::counters() const noexcept {
  return {sent_parcels_.value(),   sent_bytes_.value(), taken_parcels_.value(), taken_bytes_.value(),
          refused_writes_.value(), answers_.value(),    answer_ns_.value(),     answer_ns_max_.value()};
}

void Path::acknowledge() {
  if (taken_ - taken_told_ >= window / 2) {
    remark(ParcelKind::taken);
  }
}

}  // namespace ringfence::dds
