#include "link/futex_table.hpp"

#include <bit>

#include <sys/prctl.h>

namespace ringfence::link {

namespace {

// Of linux/prctl.h since Linux 6.16; the library is also compiled with earlier headers.
constexpr int futex_hash = 78;
constexpr unsigned long set_slots = 1, get_slots = 2;

constexpr std::size_t least_slots = 16;
constexpr std::size_t slots_a_thread = 4;
constexpr std::size_t most_threads_a_slot = 2;

}  // namespace

void reserve_futex_slots(std::size_t threads) noexcept {
  if (threads <= most_threads_a_slot * least_slots) return;
  // Zero as long as the process has one thread.
  const int slots = prctl(futex_hash, get_slots, 0ul, 0ul, 0ul);
  if (slots < 0 || most_threads_a_slot * static_cast<std::size_t>(slots) >= threads) return;
  prctl(futex_hash, set_slots, std::bit_ceil(slots_a_thread * threads), 0ul, 0ul);
}

}  // namespace ringfence::link
