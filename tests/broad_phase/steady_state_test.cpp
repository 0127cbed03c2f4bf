#include <atomic>
#include <cstdlib>
#include <new>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/box_worlds.hpp"
#include "broad_phase/sweep_and_prune.hpp"

// Counts the allocations of this program. Both forms of operator new take their memory from std::aligned_alloc, so that
// every form of operator delete can free it.
namespace {
std::atomic<std::size_t> allocations{0};

void* counted(std::size_t bytes, std::size_t alignment) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  void* const memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
}  // namespace

void* operator new(std::size_t bytes) { return counted(bytes, alignof(std::max_align_t)); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return counted(bytes, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace ringfence::broad_phase::test {
namespace {

TEST_CASE("in steady state a frame allocates nothing, even when the layout is planned again") {
  for (const double moving : {1.0, 0.1}) {
    CAPTURE(moving);
    std::mt19937_64 random(4);
    constexpr std::size_t count = 3000;
    auto boxes = draw_boxes(box_worlds()[1], count, random);
    const std::vector<std::uint8_t> present(count, 1);
    std::vector<std::uint8_t> resting(count);
    SweepAndPrune sweep(count, count);
    std::size_t before = 0;
    for (int frame = 0; frame < 400; ++frame) {
      if (frame == 100) before = allocations.load();
      (void)sweep.find(boxes, present, resting);
      for (std::size_t i = 0; i < count; ++i) {
        resting[i] = static_cast<double>(random() % 1000) >= moving * 1000;
        if (resting[i] != 0) continue;
        for (int a = 0; a < 3; ++a) {
          const std::uint32_t extent = boxes[i].upper[a] - boxes[i].lower[a];
          boxes[i].lower[a] = static_cast<std::uint32_t>(random() % (0xffffffffu - extent));
          boxes[i].upper[a] = boxes[i].lower[a] + extent;
        }
      }
    }
    CHECK(allocations.load() == before);
  }
}

}  // namespace
}  // namespace ringfence::broad_phase::test
