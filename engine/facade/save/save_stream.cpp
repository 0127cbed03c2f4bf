#include "facade/save/save_stream.hpp"

#define XXH_INLINE_ALL
#include <algorithm>
#include <cstring>
#include <memory>

#include <xxhash.h>

#include "ringfence/error.hpp"

namespace ringfence {

std::size_t MemorySource::read(std::span<std::byte> bytes) {
  const std::size_t count = std::min(bytes.size(), rest_.size());
  std::copy_n(rest_.begin(), count, bytes.begin());
  rest_ = rest_.subspan(count);
  return count;
}

}  // namespace ringfence

namespace ringfence::facade {

struct SaveWriter::Checksum {
  XXH3_state_t state;
};

SaveWriter::SaveWriter(Sink& sink) : sink_(sink), checksum_(std::make_unique<Checksum>()) {
  XXH3_64bits_reset(&checksum_->state);
}
SaveWriter::~SaveWriter() = default;

void SaveWriter::bytes(std::span<const std::byte> bytes) {
  if (taken_ && !bytes.empty()) {
    XXH3_64bits_update(&checksum_->state, bytes.data(), bytes.size());
    taken_ = sink_.write(bytes);
  }
}

bool SaveWriter::finish() {
  const std::uint64_t checksum = XXH3_64bits_digest(&checksum_->state);
  return taken_ && sink_.write(std::as_bytes(std::span(&checksum, 1)));
}

SaveReader::SaveReader(Source& source) {
  constexpr std::size_t block = std::size_t{1} << 20;
  for (std::size_t size = 0;;) {
    all_.resize(size + std::max(block, size));
    const std::size_t read = source.read(std::span(all_).subspan(size));
    size += std::min(read, all_.size() - size);
    if (read == 0) {
      all_.resize(size);
      break;
    }
  }
  std::uint64_t checksum = 0;
  if (all_.size() < sizeof checksum) {
    throw Error("save: has " + std::to_string(all_.size()) + " bytes; it was not written to its end: use another one");
  }
  const std::span<const std::byte> all(all_);
  rest_ = all.first(all.size() - sizeof checksum);
  copy(all.last(sizeof checksum), &checksum);
  if (checksum != XXH3_64bits(rest_.data(), rest_.size())) {
    throw Error("save: the checksum does not match: it is damaged, or was not written to its end: use another one");
  }
}

std::span<const std::byte> SaveReader::bytes(std::size_t count) {
  const auto first = rest_.first(checked_count(count, 1));
  rest_ = rest_.subspan(count);
  return first;
}

std::string SaveReader::text() {
  const std::vector<char> characters = list<char>();
  return std::string(characters.begin(), characters.end());
}

std::size_t SaveReader::checked_count(std::uint64_t count, std::size_t each) const {
  if (count > rest_.size() / each) {
    throw Error("save: a list of " + std::to_string(count) + " records does not fit into the rest of the save, " +
                std::to_string(rest_.size()) + " bytes: it is damaged; use another one");
  }
  return static_cast<std::size_t>(count);
}

void SaveReader::copy(std::span<const std::byte> from, void* to) noexcept {
  if (!from.empty()) {
    std::memcpy(to, from.data(), from.size());
  }
}

}  // namespace ringfence::facade
