#include "narrow_phase/narrow_phase.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "base/buffer.hpp"
#include "base/prefetch.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/shape_tag.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::narrow_phase {
namespace {

constexpr std::size_t index_of(ShapeKind kind) noexcept { return static_cast<std::size_t>(kind); }

/// Number of pairs that are sorted at a time: what the sort reads is still in the cache when the kernels gather it.
constexpr std::size_t chunk_pairs = 4096;

/// The bodies of a pair are prefetched this many pairs in advance. In a large world they are accessed in an order that
/// the hardware cannot predict. Saves 8 to 10 ns per pair with 64,000 objects.
constexpr std::size_t prefetch_distance = 24;

/// The sort key of a pair: its two kinds (21 unordered pairs of kinds), whether it is computed in double, and for pairs
/// with a hull some bits of the hull's number, so that pairs with the same hull are adjacent and find it in the
/// first-level cache. One more bit, not part of the order, says whether the pair is flipped.
using Key = std::uint16_t;
constexpr unsigned shape_bits = 6;
constexpr unsigned key_in_double = 1;  ///< bit of a key without its shape bits
constexpr unsigned key_flipped = 0x8000;
constexpr unsigned key_order = 0x7fff;
constexpr std::size_t keys = shape_kinds * (shape_kinds + 1);
constexpr std::size_t key_slots = keys << shape_bits;

/// Fewer pairs are not sorted by shape: too few of them share a hull.
constexpr std::size_t min_pairs_sorted_by_shape = 1024;

struct Kinds {
  ShapeKind first, second;
};

/// The keys for all ordered pairs of kinds (in rows of 8), and the kinds for all keys.
struct KeyTable {
  struct Entry {
    Key key = 0;     ///< without shape bits
    Key shapes = 0;  ///< mask of the bits of the second shape's number that belong to the key
  };
  Entry entry[8 * shape_kinds] = {};
  Kinds kinds[keys] = {};

  constexpr KeyTable() {
    unsigned next = 0;
    for (std::size_t second = 0; second < shape_kinds; ++second) {
      const bool hull = static_cast<ShapeKind>(second) == ShapeKind::hull;
      const Key shapes = hull ? (1u << shape_bits) - 1 : 0;
      for (std::size_t first = 0; first <= second; ++first) {
        entry[second * 8 + first] = {static_cast<Key>(next << shape_bits | key_flipped), shapes};
        entry[first * 8 + second] = {static_cast<Key>(next << shape_bits), shapes};
        for (std::size_t i = 0; i < 2; ++i) {
          kinds[next++] = {static_cast<ShapeKind>(first), static_cast<ShapeKind>(second)};
        }
      }
    }
  }
};
constexpr KeyTable key_table;
static_assert(keys < 64, "a set of keys is a word");
static_assert(key_slots <= key_order);

/// How often pairs of two kinds are timed: one block out of so many pairs. For closed forms the block fills the vectors
/// of every target; for other kinds it is a single pair, which takes longer than reading the clock. The cost is 0.1 ns
/// per sphere pair and 1 ns per hull pair.
struct Sampling {
  std::size_t block, interval;
};
constexpr Sampling sampling_of(Kinds kinds) noexcept {
  if (kinds.second <= ShapeKind::capsule) return {64, 31 * 64};
  return kinds.second == ShapeKind::hull ? Sampling{16, 31 * 16} : Sampling{1, 61};
}

/// The bucket of the `cost` histogram for a block of pairs: two buckets per factor of two, without a library call.
std::size_t cost_bucket(std::uint64_t nanoseconds, std::uint64_t pairs) noexcept {
  const std::uint64_t limited = std::min<std::uint64_t>(nanoseconds, 0xffffffffu);
  const std::uint64_t square = limited * limited / (pairs * pairs);
  return std::min<std::size_t>(static_cast<std::size_t>(std::bit_width(square | 1)) - 1, cost_buckets - 1);
}

/// Calls `visit(key)` for each key in `set`, ascending.
template <class Visit>
void for_each_key(std::uint64_t set, const Visit& visit) {
  for (; set != 0; set &= set - 1) visit(static_cast<std::size_t>(std::countr_zero(set)));
}

/// Writes the pair with its bodies in the order of their kinds, as two words. Without a branch, because the order is
/// random.
void write_ordered(const geometry::CandidatePair& pair, std::size_t index, Key key, KernelPair& to) noexcept {
  static_assert(std::endian::native == std::endian::little && flip_bit == 1u << 31);
  const auto both = std::bit_cast<std::uint64_t>(pair);
  const std::uint64_t turned = std::rotl(both, 32);
  const std::uint64_t words[2] = {(key & key_flipped) != 0 ? turned : both,
                                  index | (std::uint64_t{key} << 48 & std::uint64_t{1} << 63)};
  std::memcpy(static_cast<void*>(&to), words, sizeof(words));
}

}  // namespace

Kernel kernel_of(ShapeKind first, ShapeKind second) noexcept {
  static constexpr Kernel none = nullptr;
  static constexpr Kernel table[shape_kinds][shape_kinds] = {
      // sphere, box, capsule, hull, mesh, support
      {test_sphere_sphere, test_sphere_box, test_sphere_capsule, test_sphere_hull, test_sphere_mesh, test_support_any},
      {none, test_box_box, test_box_capsule, test_box_hull, test_box_mesh, test_support_any},
      {none, none, test_capsule_capsule, test_capsule_hull, test_capsule_mesh, test_support_any},
      {none, none, none, test_hull_hull, test_hull_mesh, test_support_any},
      {none, none, none, none, test_mesh_mesh, test_mesh_support},
      {none, none, none, none, none, test_support_any},
  };
  return table[index_of(first)][index_of(second)];
}

struct NarrowPhase::Implementation {
  explicit Implementation(const geometry::ShapeTable& table) : shapes(table) {
    sorted.grow(chunk_pairs, 0);
    pair_keys.grow(chunk_pairs, 0);
  }

  const geometry::ShapeTable& shapes;
  std::vector<ShapeTag> tags;
  std::unique_ptr<AxisMemory> memory;  ///< null if separating axes are not cached
  bool same_kind = true;               ///< all shapes are of one kind
  bool float_is_enough = true;         ///< no pair of shapes needs double
  base::Buffer<PairContact> contacts;
  base::Buffer<KernelPair> sorted;  ///< as long as a chunk; of a small call only the start is ever written
  base::Buffer<Key> pair_keys;
  std::uint32_t ends[key_slots];  ///< for each key: the end of its pairs in `sorted` that are already written
  std::uint32_t key_ends[keys];   ///< the same for keys without shape bits; only valid for keys that occur in the chunk
  KindCounters counters[shape_kinds][shape_kinds];
  std::size_t until_timed[shape_kinds][shape_kinds] = {};  ///< pairs left until the next timed block

  void update_shape_tags();
  void copy(std::span<const geometry::CandidatePair> pairs, std::size_t begin);
  template <bool in_float>
  void compute_keys(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs);
  std::uint64_t sort(std::span<const geometry::CandidatePair> pairs, std::size_t begin);
  KernelInput input_of(std::span<const Body> bodies, std::size_t key) const;
  PairContact* test_key(const KernelInput& input, std::size_t key, std::size_t size, PairContact* out);
  PairContact* time_block(Kernel kernel, const KernelInput& input, std::size_t size, PairContact* out,
                          KindCounters& counter);
  PairContact* test_chunk(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs,
                          std::size_t begin, PairContact* out);
};

void NarrowPhase::Implementation::update_shape_tags() {
  if (tags.size() == shapes.size()) return;
  for (std::size_t shape = tags.size(); shape < shapes.size(); ++shape) {
    tags.push_back(tag_of(shapes.row(static_cast<ShapeNumber>(shape))));
  }
  same_kind = ShapeTag::same_kind(tags);
  float_is_enough = ShapeTag::float_is_enough(tags);
}

/// Writes the pairs to `sorted` in their given order.
void NarrowPhase::Implementation::copy(std::span<const geometry::CandidatePair> pairs, std::size_t begin) {
  KernelPair* const to = sorted.data();
  for (std::size_t i = 0; i < pairs.size(); ++i) write_ordered(pairs[i], begin + i, 0, to[i]);
}

/// Computes the key of each pair and counts in `ends` how often each key occurs. `in_float`: no pair of shapes needs
/// double.
template <bool in_float>
void NarrowPhase::Implementation::compute_keys(std::span<const Body> bodies,
                                               std::span<const geometry::CandidatePair> pairs) {
  const ShapeTag* const tag = tags.data();
  Key* const key = pair_keys.data();
  const unsigned by_shape = pairs.size() >= min_pairs_sorted_by_shape ? ~0u : 0u;
  if (by_shape != 0) {
    std::fill(std::begin(ends), std::end(ends), 0u);
  } else {
    for (std::size_t k = 0; k < keys; ++k) ends[k << shape_bits] = 0;
  }
  const auto add = [&](std::size_t i) {
    const geometry::CandidatePair pair = pairs[i];
    const ShapeNumber p = bodies[pair.a].shape, q = bodies[pair.b].shape;
    const ShapeTag a = tag[p], b = tag[q];
    const KeyTable::Entry entry = key_table.entry[a.kind() * 8 + b.kind()];
    const ShapeNumber second = (entry.key & key_flipped) != 0 ? p : q;
    unsigned k = entry.key | (second & entry.shapes & by_shape);
    if constexpr (!in_float) k |= unsigned{ShapeTag::needs_double(a, b)} << shape_bits;
    key[i] = static_cast<Key>(k);
    ++ends[k & key_order];
  };
  std::size_t i = 0;
  for (const std::size_t ahead = pairs.size() - std::min(prefetch_distance, pairs.size()); i < ahead; ++i) {
    base::prefetch_object(bodies[pairs[i + prefetch_distance].a]);
    base::prefetch_object(bodies[pairs[i + prefetch_distance].b]);
    add(i);
  }
  for (; i < pairs.size(); ++i) add(i);
}

/// Counting sort of a chunk's pairs by key; `begin` is the index of the first pair. Returns the set of keys without
/// shape bits.
std::uint64_t NarrowPhase::Implementation::sort(std::span<const geometry::CandidatePair> pairs, std::size_t begin) {
  const Key* const key = pair_keys.data();
  // With few pairs it costs less to collect their keys than to go over all.
  std::uint64_t possible = (std::uint64_t{1} << keys) - 1, set = 0;
  if (pairs.size() < keys) {
    possible = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) possible |= std::uint64_t{1} << ((key[i] & key_order) >> shape_bits);
  }
  std::uint32_t sum = 0;
  for_each_key(possible, [&](std::size_t k) {
    const bool by_shape = key_table.kinds[k].second == ShapeKind::hull && pairs.size() >= min_pairs_sorted_by_shape;
    const std::size_t from = k << shape_bits, size = by_shape ? std::size_t{1} << shape_bits : 1;
    const std::uint32_t before = sum;
    for (std::size_t slot = from; slot < from + size; ++slot) sum += std::exchange(ends[slot], sum);
    set |= std::uint64_t{sum != before} << k;
    key_ends[k] = sum;
  });
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    write_ordered(pairs[i], begin + i, key[i], sorted[ends[key[i] & key_order]++]);
  }
  return set;
}

KernelInput NarrowPhase::Implementation::input_of(std::span<const Body> bodies, std::size_t key) const {
  KernelInput input{bodies, shapes.view()};
  input.in_double = (key & key_in_double) != 0;
  input.memory = memory.get();
  return input;
}

/// Tests the `size` pairs of the input.
PairContact* NarrowPhase::Implementation::test_key(const KernelInput& input, std::size_t key, std::size_t size,
                                                   PairContact* out) {
  const Kinds kinds = key_table.kinds[key];
  KindCounters& counter = counters[index_of(kinds.first)][index_of(kinds.second)];
  counter.candidates += size;
  const Kernel kernel = kernel_of(kinds.first, kinds.second);
  std::size_t& until = until_timed[index_of(kinds.first)][index_of(kinds.second)];
  const Sampling sampling = sampling_of(kinds);
  KernelInput part = input;
  PairContact* end = out;
  std::size_t begin = 0;
  // Tests whole blocks before the timed one, so that timing does not leave vectors partly filled.
  for (std::size_t at; (at = until / sampling.block * sampling.block) < size - begin;) {
    part.select(input, begin, at);
    if (at > 0) end = kernel(part, end, counter);
    begin += at;
    const std::size_t block = std::min(sampling.block, size - begin);
    part.select(input, begin, block);
    end = time_block(kernel, part, block, end, counter);
    begin += block;
    until = sampling.interval;
  }
  until -= size - begin;
  part.select(input, begin, size - begin);
  if (begin < size) end = kernel(part, end, counter);
  counter.hits += static_cast<std::uint64_t>(end - out);
  return end;
}

PairContact* NarrowPhase::Implementation::time_block(Kernel kernel, const KernelInput& input, std::size_t size,
                                                     PairContact* out, KindCounters& counter) {
  GatherTimer gather_timer;
  KernelInput timed = input;
  timed.gather_timer = &gather_timer;
  const std::uint64_t start = telemetry::now_ns();
  PairContact* const end = kernel(timed, out, counter);
  const std::uint64_t all = telemetry::now_ns() - start, read_cost = telemetry::clock_cost_ns();
  const auto without_clock_reads = [read_cost](std::uint64_t time, std::uint64_t clock_reads) {
    return time - std::min(time, read_cost * clock_reads);
  };
  const std::uint64_t nanoseconds = without_clock_reads(all, gather_timer.clock_reads() + 1);
  counter.timed += size;
  counter.nanoseconds += nanoseconds;
  counter.gather_nanoseconds +=
      std::min(nanoseconds, without_clock_reads(gather_timer.nanoseconds(), gather_timer.clock_reads() / 2));
  counter.cost[cost_bucket(nanoseconds, size)] += static_cast<std::uint32_t>(size);
  return end;
}

PairContact* NarrowPhase::Implementation::test_chunk(std::span<const Body> bodies,
                                                     std::span<const geometry::CandidatePair> pairs, std::size_t begin,
                                                     PairContact* out) {
  if (same_kind && float_is_enough) {
    const std::size_t kind = tags.front().kind();
    const std::size_t key = key_table.entry[kind * 8 + kind].key >> shape_bits;
    KernelInput input = input_of(bodies, key);
    if (kind <= index_of(ShapeKind::capsule)) {
      input.candidates = pairs;
      input.first_candidate = static_cast<std::uint32_t>(begin);
    } else {
      copy(pairs, begin);
      input.pairs = {sorted.data(), pairs.size()};
    }
    return test_key(input, key, pairs.size(), out);
  }
  if (float_is_enough) {
    compute_keys<true>(bodies, pairs);
  } else {
    compute_keys<false>(bodies, pairs);
  }
  const std::uint64_t set = sort(pairs, begin);
  std::uint32_t from = 0;
  for_each_key(set, [&](std::size_t key) {
    KernelInput input = input_of(bodies, key);
    input.pairs = {sorted.data() + from, sorted.data() + key_ends[key]};
    out = test_key(input, key, input.pairs.size(), out);
    from = key_ends[key];
  });
  return out;
}

NarrowPhase::NarrowPhase(const geometry::ShapeTable& shapes)
    : implementation_(std::make_unique<Implementation>(shapes)) {}
NarrowPhase::~NarrowPhase() = default;
NarrowPhase::NarrowPhase(NarrowPhase&&) noexcept = default;
NarrowPhase& NarrowPhase::operator=(NarrowPhase&&) noexcept = default;

std::span<const PairContact> NarrowPhase::test(std::span<const Body> bodies,
                                               std::span<const geometry::CandidatePair> pairs) {
  Implementation& self = *implementation_;
  self.update_shape_tags();
  self.contacts.reserve(pairs.size() + contact_slack);
  PairContact* const begin = self.contacts.data();
  PairContact* out = begin;
  for (std::size_t i = 0; i < pairs.size(); i += chunk_pairs) {
    out = self.test_chunk(bodies, pairs.subspan(i, std::min(chunk_pairs, pairs.size() - i)), i, out);
  }
  return {begin, out};
}

void NarrowPhase::remember_axes(bool on, std::size_t bodies) {
  std::unique_ptr<AxisMemory>& memory = implementation_->memory;
  if (on == (memory != nullptr)) return;
  memory = on ? std::make_unique<AxisMemory>(bodies) : nullptr;
}

void NarrowPhase::forget_axes() noexcept {
  if (implementation_->memory != nullptr) implementation_->memory->clear();
}

const KindCounters& NarrowPhase::counters(ShapeKind p, ShapeKind q) const noexcept {
  return implementation_->counters[index_of(std::min(p, q))][index_of(std::max(p, q))];
}

void NarrowPhase::reset_counters() noexcept {
  for (auto& row : implementation_->counters) std::fill(std::begin(row), std::end(row), KindCounters{});
}

}  // namespace ringfence::narrow_phase
