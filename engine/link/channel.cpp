#include "link/channel.hpp"

#include <cstddef>
#include <string>

#include "base/system_memory.hpp"
#include "ringfence/error.hpp"

namespace ringfence::link {

namespace {

constexpr std::align_val_t alignment{cache_line_pair_bytes};

void* allocate_ring(std::size_t bytes, std::size_t stage_bytes, const char* option) {
  Channel::check(bytes, option);
  const std::size_t footprint = ring_footprint<ThreadAtomics>(bytes) + stage_bytes;
  void* memory = ::operator new(footprint, alignment);
  base::populate_pages(memory, footprint);
  make_ring<ThreadAtomics>(memory, bytes);
  return memory;
}

/// The stage follows the ring.
std::span<std::byte> stage_of(void* memory, std::size_t bytes, std::size_t stage_bytes) {
  return {static_cast<std::byte*>(memory) + ring_footprint<ThreadAtomics>(bytes), stage_bytes};
}

}  // namespace

void Channel::check(std::size_t bytes, const char* option) {
  constexpr std::size_t smallest = 4096;
  constexpr std::size_t largest = std::size_t{1} << 30;
  if (bytes >= smallest && bytes <= largest && (bytes & (bytes - 1)) == 0) return;
  throw Error(std::string(option) + " is " + std::to_string(bytes) + ": a ring takes a power of two from " +
              std::to_string(smallest) + " to " + std::to_string(largest) + " bytes");
}

void Channel::Free::operator()(void* memory) const noexcept { ::operator delete(memory, alignment); }

Channel::Channel(std::size_t bytes, Doorbell* receivers_bell, Doorbell* senders_bell, const char* option)
    : memory_(allocate_ring(bytes, stage_bytes_of(bytes), option)),
      sender_(open_ring<ThreadAtomics>(memory_.get()), receivers_bell,
              stage_of(memory_.get(), bytes, stage_bytes_of(bytes))),
      receiver_(open_ring<ThreadAtomics>(memory_.get()), senders_bell) {}

}  // namespace ringfence::link
