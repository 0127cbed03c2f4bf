// Boxes of a BoxTree near a box, in the order of the tree. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_TOUCHING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_TOUCHING_INL
#undef RINGFENCE_QUERIES_TOUCHING_INL
#else
#define RINGFENCE_QUERIES_TOUCHING_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include <hwy/highway.h>

#include "queries/searching-inl.hpp"
#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

// Which of eight boxes overlap or touch a box.
class TouchTest {
 public:
  HWY_INLINE explicit TouchTest(const TreeBox& box) {
    const Lanes d;
    // Finite sides, because those of unused lanes are infinite.
    constexpr float most = std::numeric_limits<float>::max();
    for (std::size_t a = 0; a < 3; ++a) {
      lower_[a] = hn::Set(d, std::max(box.lower[a], -most));
      upper_[a] = hn::Set(d, std::min(box.upper[a], most));
    }
  }

  HWY_INLINE hn::Mask<Lanes> operator()(const BoxGroup& group, std::size_t lane) const {
    const Lanes d;
    hn::Mask<Lanes> touched[3];
    for (std::size_t a = 0; a < 3; ++a) {
      touched[a] = hn::And(hn::Le(hn::Load(d, group.lower[a] + lane), upper_[a]),
                           hn::Ge(hn::Load(d, group.upper[a] + lane), lower_[a]));
    }
    return hn::And(hn::And(touched[0], touched[1]), touched[2]);
  }

 private:
  hn::Vec<Lanes> lower_[3], upper_[3];
};

// Writes the children of some groups that are touched to `to`. No branch depends on what is touched: it writes whole
// vectors, and then says how many of their lanes count.
HWY_INLINE std::size_t touched_children(const BoxGroup* HWY_RESTRICT groups, const TouchTest& test,
                                        const std::uint32_t* HWY_RESTRICT from, std::size_t count,
                                        std::uint32_t* HWY_RESTRICT to) {
  const Lanes d;
  const hn::Rebind<std::uint32_t, Lanes> numbers;
  std::size_t size = 0;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      const auto touched = test(groups[from[i]], lane);
      const auto first = hn::Set(numbers, static_cast<std::uint32_t>(from[i] * tree_width + lane));
      hn::StoreU(hn::Add(first, lanes_of(d, touched)), numbers, to + size);
      size += hn::CountTrue(d, touched);
    }
  }
  return size;
}

// The same at the lowest level, where the boxes are listed as ranges: `ends` alternates between the first box of a
// range and the one behind its last. Returns how many there are.
HWY_INLINE std::size_t touched_ranges(const BoxGroup* HWY_RESTRICT groups, const TouchTest& test,
                                      const std::uint32_t* HWY_RESTRICT from, std::size_t count,
                                      std::uint32_t* HWY_RESTRICT ends) {
  const Lanes d;
  const hn::Rebind<std::uint32_t, Lanes> numbers;
  std::size_t size = 0;
  std::uint32_t open = 0;    // whether a range includes the box before `next`
  std::uint32_t next = ~0u;  // the box behind the group before
  for (std::size_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(from[i] * tree_width);
    ends[size] = next;
    const std::uint32_t adjoins = first == next ? 1 : 0;
    size += open & (adjoins ^ 1);
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      bits |= bits_of(test(groups[from[i]], lane)) << lane;
    }
    const std::uint32_t changes = bits ^ (bits << 1 | (open & adjoins));
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      const auto mask_bits = static_cast<std::uint8_t>(changes >> lane & ((1u << hn::Lanes(d)) - 1));
      const auto boxes = hn::Set(numbers, static_cast<std::uint32_t>(first + lane));
      hn::StoreU(hn::Add(boxes, lanes_of_bits(numbers, mask_bits)), numbers, ends + size);
      size += static_cast<std::size_t>(std::popcount(mask_bits));
    }
    open = bits >> (tree_width - 1) & 1;
    next = first + tree_width;
  }
  ends[size] = next;
  return size + open;
}

inline std::size_t list_touched(const BoxTree& tree, const TreeBox& box, const TouchMemory& memory) {
  if (tree.size() == 0) return 0;
  const TouchTest test(box);
  std::uint32_t *from = memory.groups[0], *to = memory.groups[1];
  std::size_t count = 1;
  from[0] = 0;
  for (std::size_t level = tree.levels() - 1; level != 0; --level, std::swap(from, to)) {
    count = touched_children(tree.level(level), test, from, count, to);
  }
  return touched_ranges(tree.level(0), test, from, count, memory.ends) / 2;
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
