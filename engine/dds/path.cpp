#include "dds/path.hpp"

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
  const std::size_t at = batch_.size();
  batch_.resize(at + sizeof packing + filled);
  std::memcpy(batch_.data() + at, &packing, sizeof packing);
  std::memcpy(batch_.data() + at + sizeof packing, message.data(), message.size());
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
    ++counters_.refused_writes;
    return false;
  }
  const ParcelSample parcel{incarnation_, sent_ + 1, taken_, static_cast<std::uint32_t>(kind), shapes_, borrow(bytes)};
  if (dds_write(writer_, &parcel) != DDS_RETCODE_OK) {
    ++counters_.refused_writes;
    return false;
  }
  ++sent_;
  taken_told_ = taken_;
  ++counters_.sent_parcels;
  counters_.sent_bytes += bytes.size();
  return true;
}

void Path::remark(ParcelKind kind) {
  const ParcelSample parcel{incarnation_, 0, taken_, static_cast<std::uint32_t>(kind), shapes_, {}};
  if (dds_write(writer_, &parcel) == DDS_RETCODE_OK) {
    taken_told_ = taken_;
  }
}

bool Path::note(const ParcelSample& parcel) {
  sent_taken_ = std::max<std::uint64_t>(sent_taken_, std::min<std::uint64_t>(parcel.taken, sent_));
  return parcel.number == 0 || parcel.number == ++received_;
}

void Path::taken(std::size_t bytes) noexcept {
  ++taken_;
  ++counters_.taken_parcels;
  counters_.taken_bytes += bytes;
}

void Path::acknowledge() {
  if (taken_ - taken_told_ >= window / 2) {
    remark(ParcelKind::taken);
  }
}

}  // namespace ringfence::dds
