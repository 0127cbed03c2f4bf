#include "broad_phase/row_layout.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace ringfence::broad_phase {
namespace {

constexpr std::uint32_t largest_code_extent = 31;  // in quanta; see RowLayout
constexpr double largest = 4294967295.0;

std::uint32_t quantum_for(std::uint32_t limit) {
  std::uint32_t shift = 0;
  while ((limit >> shift) > largest_code_extent - 1) ++shift;
  return shift;
}

// Statistics of the boxes on one axis.
struct AxisSample {
  std::uint32_t first = 0xffffffff, last = 0;  ///< lowest and highest lower corner
  double extent = 0;                           ///< mean
  double span() const { return double(last - first) + extent + 1; }
};

// Expected number of other boxes that start near a box (within a cell of a few size limits), divided by the volume of
// that cell. This is the density around the boxes. In worlds with crowds it is far higher than the mean density of the
// space.
double local_density(const LevelSample& sample, const std::array<AxisSample, 3>& axes) {
  constexpr std::size_t slots = 8192;
  std::uint32_t shift[3];
  double volume = 1;
  for (int a = 0; a < 3; ++a) {
    shift[a] = std::min<std::uint32_t>(31, static_cast<std::uint32_t>(std::bit_width(sample.limit[a])) + 2);
    volume *= std::min(std::ldexp(1.0, static_cast<int>(shift[a])), axes[a].span());
  }
  std::array<std::uint16_t, slots> seen{};
  std::size_t neighbours = 0;
  for (const geometry::Bounds& b : sample.boxes) {
    std::uint64_t hash = 0;
    for (int a = 0; a < 3; ++a) hash = (hash ^ (b.lower[a] >> shift[a])) * 0x9e3779b97f4a7c15;
    neighbours += seen[hash >> 51]++;
  }
  const double m = static_cast<double>(sample.boxes.size());
  const double by_chance = m * m / 2 / slots;  // different cells with the same hash
  const double seen_by_one = 2 * std::max(0.0, static_cast<double>(neighbours) - by_chance) / m;
  const double n = static_cast<double>(sample.count);
  double everywhere = n;
  for (const AxisSample& axis : axes) everywhere /= axis.span();
  return std::max(everywhere, seen_by_one * (n / m) / volume);
}

struct AxisCut {
  std::uint32_t shift = 31, bits = 0;
};

AxisCut cut(const AxisSample& axis, std::uint32_t shift, std::uint32_t least_bits) {
  const std::uint32_t touched = (axis.last >> shift) - (axis.first >> shift) + 1;
  if (touched == 1) return {shift, 0};
  const std::uint32_t bits = std::max(least_bits, static_cast<std::uint32_t>(std::bit_width(touched - 1)));
  return bits + shift > 32 ? AxisCut{shift, 0} : AxisCut{shift, bits};
}

}  // namespace

RowLayout plan_rows(const LevelSample& sample, std::size_t lanes) {
  std::array<AxisSample, 3> axes;
  for (const geometry::Bounds& b : sample.boxes)
    for (int a = 0; a < 3; ++a) {
      axes[a].first = std::min(axes[a].first, b.lower[a]);
      axes[a].last = std::max(axes[a].last, b.lower[a]);
      axes[a].extent += double(b.upper[a] - b.lower[a]) / static_cast<double>(sample.boxes.size());
    }
  const double n = static_cast<double>(sample.count);
  const double density = local_density(sample, axes);
  double everywhere = n;
  for (const AxisSample& axis : axes) everywhere /= axis.span();
  const double most_cells = 6 * n + 1024;

  RowLayout rows{};
  for (int a = 0; a < 3; ++a) {
    rows.limit[a] = sample.limit[a];
    rows.quantum[a] = quantum_for(sample.limit[a]);
  }
  double least = std::numeric_limits<double>::infinity();
  AxisCut best[3];
  // Rows and slabs are at least two limits deep; cells start at a thirtieth of a limit.
  bool more_y = true;
  for (std::uint32_t sy = std::min(31u, rows.quantum[1] + 6); more_y; ++sy) {
    bool more_z = true;
    for (std::uint32_t sz = std::min(31u, rows.quantum[2] + 6); more_z; ++sz) {
      bool more_x = true;
      for (std::uint32_t sx = rows.quantum[0] + 2; more_x; ++sx) {
        const std::uint32_t reach = (sample.limit[0] >> sx) + 2;
        const auto least_x = static_cast<std::uint32_t>(std::bit_width(2 * reach));
        AxisCut x = cut(axes[0], sx, least_x), y = cut(axes[1], sy, 2), z = cut(axes[2], sz, 2);
        more_x = x.bits != 0, more_y = y.bits != 0, more_z = z.bits != 0;
        double aliased = 1;
        // Too many cells for the number of boxes: wrap the grid more often, on the longest axis first.
        while (std::ldexp(1.0, static_cast<int>(x.bits + y.bits + z.bits)) > most_cells) {
          if (x.bits > least_x && x.bits >= y.bits + 2 && x.bits >= z.bits + 2)
            --x.bits;
          else if (y.bits > 2 && y.bits >= z.bits)
            --y.bits;
          else if (z.bits > 2)
            --z.bits;
          else if (x.bits > least_x)
            --x.bits;
          else
            break;
          aliased *= 2;
        }
        const auto depth = [&](const AxisCut& c, int a) {
          return c.bits == 0 ? axes[a].span() : std::min(std::ldexp(1.0, static_cast<int>(c.shift)), axes[a].span());
        };
        const double cell = std::ldexp(1.0, static_cast<int>(sx));
        const double seen = density + everywhere * (aliased - 1);
        const double section = seen * depth(y, 1) * depth(z, 2);
        const double own =
            section * std::min(axes[0].span(), axes[0].extent + (x.bits == 0 ? axes[0].span() : cell) * 0.9);
        const double across =
            section *
            std::min(axes[0].span(), axes[0].extent + (x.bits == 0 ? axes[0].span() : sample.limit[0] + 2 * cell));
        const double into_y = y.bits == 0 ? 0 : axes[1].extent / std::ldexp(1.0, static_cast<int>(sy));
        const double into_z = z.bits == 0 ? 0 : axes[2].extent / std::ldexp(1.0, static_cast<int>(sz));
        const double near_y = y.bits == 0 ? 0 : double(sample.limit[1]) / std::ldexp(1.0, static_cast<int>(sy));
        const double crossings = into_y + into_z * (1 + into_y + near_y);
        const double width = static_cast<double>(lanes);
        const double cells = std::ldexp(1.0, static_cast<int>(x.bits + y.bits + z.bits));
        // A slab and the next one are read repeatedly: codes, entries and boxes, 48 bytes per box.
        const double slabs = std::max(1.0, axes[2].span() / depth(z, 2));
        const double kept_at_hand = 2 * 48 * n / slabs;
        const double misses = z.bits == 0 ? 0 : 1.5 * std::max(0.0, std::log2(kept_at_hand / 1e6));
        // Measured, in nanoseconds: one vector comparison, the bookkeeping of a neighbour row, one cell of the table,
        // misses of the second-level cache.
        const double cost = 1.5 * own / width + crossings * (5 + 1.5 * across / width) + 0.7 * cells / n + misses;
        if (cost < least && cells <= 16 * most_cells) {
          least = cost;
          best[0] = x, best[1] = y, best[2] = z;
        }
      }
    }
  }
  for (int a = 0; a < 3; ++a) {
    rows.cell_shift[a] = best[a].shift;
    rows.cell_mask[a] = (1u << best[a].bits) - 1;
    rows.partitioned[a] = best[a].bits == 0 ? 0 : ~0u;
  }
  rows.x_bits = best[0].bits;
  rows.y_bits = best[1].bits;
  rows.cells = 1u << (best[0].bits + best[1].bits + best[2].bits);
  rows.back = best[0].bits == 0 ? 0 : (sample.limit[0] >> best[0].shift) + 1;
  const std::uint32_t key_bits = best[0].bits + best[1].bits + best[2].bits;
  // Buckets of 2000 boxes, and of 8000 where there are many: what is written to sort one stays in the first-level
  // cache, or in the second-level cache, and few buckets are staged at once.
  const auto bits_for = [&](unsigned boxes_log2) {
    return static_cast<std::uint32_t>(std::bit_width(sample.count >> boxes_log2));
  };
  const std::uint32_t bucket_bits = std::min({std::max(std::min(bits_for(11), 5u), bits_for(13)), key_bits, 7u});
  rows.bucket_shift = key_bits - bucket_bits;
  rows.buckets = 1u << bucket_bits;
  return rows;
}

std::size_t plan_levels(std::span<const geometry::Bounds> boxes, std::span<const std::uint32_t> slots,
                        std::span<SizeLimit, max_levels> levels) {
  // The unit on each axis is the median extent in a sample. The size of a box is its largest extent in units.
  constexpr std::size_t sampled = 1024;
  const std::size_t stride = std::max<std::size_t>(1, slots.size() / sampled);
  std::array<float, 3> unit;
  std::array<std::uint32_t, 2 * sampled> extents;
  for (int a = 0; a < 3; ++a) {
    std::size_t count = 0;
    for (std::size_t k = 0; k < slots.size() && count < extents.size(); k += stride)
      extents[count++] = boxes[slots[k]].upper[a] - boxes[slots[k]].lower[a];
    std::nth_element(extents.begin(), extents.begin() + count / 2, extents.begin() + count);
    unit[a] = static_cast<float>(std::max<std::uint32_t>(1, extents[count / 2]));
  }
  // Histogram of sizes in quarter octaves, from 2^-32 to 2^32.
  constexpr int octaves = 64;
  std::array<std::size_t, 4 * octaves> histogram{};
  std::array<float, 4 * octaves> most{};
  for (const std::uint32_t slot : slots) {
    const geometry::Bounds& b = boxes[slot];
    float size = 0x1p-31f;
    for (int a = 0; a < 3; ++a) size = std::max(size, static_cast<float>(b.upper[a] - b.lower[a]) / unit[a]);
    size = std::min(size, 0x1.fp31f);
    const auto bucket = static_cast<std::size_t>((std::bit_cast<std::uint32_t>(size) >> 21) - (127 - 32) * 4);
    ++histogram[bucket];
    most[bucket] = std::max(most[bucket], size);
  }
  std::size_t count = 0;
  std::size_t left = slots.size();
  std::size_t bucket = 0;
  while (left > 0 && count + 1 < max_levels) {
    // The smallest fiftieth belongs to the same level as the next sizes, however small it is. But many objects outside
    // the world's bounds, where steps are large, need a level of their own.
    constexpr std::size_t most_smaller = 256;
    std::size_t taken = 0;
    while (taken <= std::min(left / 50, most_smaller) && bucket < histogram.size()) taken += histogram[bucket++];
    std::size_t end = std::min(bucket + 7, histogram.size()), top = bucket - 1;
    for (; bucket < end; ++bucket)
      if (histogram[bucket] != 0) {
        taken += histogram[bucket];
        top = bucket;
      }
    SizeLimit limit{};
    for (int a = 0; a < 3; ++a)
      limit.extent[a] =
          static_cast<std::uint32_t>(std::min(largest, std::ceil(double(most[top]) * 1.03 * double(unit[a]))));
    levels[count++] = limit;
    left -= taken;
  }
  levels[count++] = {{0xffffffff, 0xffffffff, 0xffffffff}};
  return count;
}

}  // namespace ringfence::broad_phase
