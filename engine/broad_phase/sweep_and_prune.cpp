#include "broad_phase/sweep_and_prune.hpp"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <utility>
#include <vector>

#include "base/buffer.hpp"
#include "broad_phase/box_set.hpp"
#include "broad_phase/crowd_sets.hpp"
#include "broad_phase/kernels.hpp"
#include "broad_phase/pair_sink.hpp"

namespace ringfence::broad_phase {
namespace {

// A part of the sweep: the boxes of `a` among themselves, or against those of `b`.
struct Task {
  RowGrid* a;
  RowGrid* b;  ///< null: `a` among themselves
};
constexpr std::size_t max_tasks = max_levels * (max_levels + 1) / 2 + max_levels * max_levels;  ///< without crowds

bool any_fixed(std::span<const std::uint8_t> layers) noexcept {
  std::uint8_t bits = 0;
  for (const std::uint8_t layer : layers) bits |= layer;
  return (bits & fixed_object) != 0;
}

// Where a box of the resting set is stored.
struct RestingLocation {
  std::uint32_t position;
  std::uint32_t grid;
};

constexpr std::uint32_t boxes_per_step = 4096;

}  // namespace

struct SweepAndPrune::Implementation {
  Kernels kernels = choose_kernels();
  BoxSet moving;
  BoxSet resting;
  CrowdSets crowded;  ///< what has a crowd is in neither of the two
  PairSink sink;      ///< the pairs within the resting set, followed by those found in this call
  base::Buffer<std::uint32_t> moving_slots;
  base::Buffer<std::uint32_t> leaving_slots;
  base::Buffer<std::uint32_t> resting_slots;
  base::Buffer<std::uint8_t> in_resting_set;  ///< by slot: 1 where the resting set holds the box
  base::Buffer<RestingLocation> location;     ///< by slot; valid where the resting set holds the box
  std::size_t slots = 0;                      ///< number of slots in the last call
  std::size_t resting_count = 0;
  std::size_t removed = 0;           ///< boxes removed from the resting set since it was built
  std::size_t resting_pairs = 0;     ///< number of pairs within the resting set
  std::vector<std::uint32_t> words;  ///< of the caller, for each of them
  std::size_t rebuild_debt = 0;      ///< extra cost so far of not rebuilding the resting set, in boxes
  std::vector<Task> tasks;
  std::size_t task = 0;
  std::uint32_t position = 0;
  std::size_t returned = 0;

  LayerMasks masks;
  bool layered;
  bool keep_resting;

  Implementation(std::size_t objects, std::size_t pairs, const LayerMasks& layer_masks, bool keep)
      : moving(objects),
        resting(objects),
        masks(layer_masks),
        layered(layer_masks != all_layers_collide()),
        keep_resting(keep) {
    reserve(objects);
    sink.pairs.grow(pairs + 1, 0, base::Pages::small);  // next() returns a few thousand at a time
    tasks.reserve(max_tasks);
  }

  void reserve(std::size_t objects) {
    moving_slots.reserve(objects + 128);
    leaving_slots.reserve(objects + 128);
    resting_slots.reserve(objects + 128);
    location.grow(objects, slots);
    in_resting_set.grow(objects, slots);
  }

  void resize(std::size_t objects) {
    for (std::size_t slot = objects; slot < slots; ++slot)
      if (in_resting_set[slot] != 0) remove_resting(static_cast<std::uint32_t>(slot));
    reserve(objects);
    for (std::size_t slot = slots; slot < objects; ++slot) in_resting_set[slot] = 0;
    slots = objects;
  }

  void remove_resting(std::uint32_t slot) {
    in_resting_set[slot] = 0;
    --resting_count;
    ++removed;
    resting_pairs_outdated = true;
    resting.grids()[location[slot].grid].remove(location[slot].position);
  }
  bool resting_pairs_outdated = false;  ///< some pair within the resting set may have lost a box

  // Every moving box queries the resting set, which costs more per box than sweeping it. It pays off where at least
  // three fifths of the boxes rest (measured with 64,000). The thresholds are two thirds and a half, to avoid switching
  // back and forth.
  bool resting_set_pays(std::size_t at_rest, std::size_t present) const noexcept {
    return keep_resting && (resting_count == 0 ? 3 * at_rest >= 2 * present : 2 * at_rest >= present);
  }

  void release() {
    std::memset(in_resting_set.data(), 0, slots);
    resting.clear();
    resting_count = removed = rebuild_debt = resting_pairs = 0;
    words.clear();
    resting_pairs_outdated = false;
  }

  void drop_outdated_pairs() {
    std::size_t to = 0;
    for (std::size_t at = 0; at < resting_pairs; ++at) {
      const geometry::CandidatePair pair = sink.pairs[at];
      sink.pairs[to] = pair;
      words[to] = words[at];
      to += in_resting_set[pair.a] & in_resting_set[pair.b];
    }
    resting_pairs = to;
    words.resize(resting_pairs);
    resting_pairs_outdated = false;
  }

  // Moves the pairs that are not yet returned behind those of the resting set, so that the next ones are written where
  // the memory is in the cache. Waits until they are at most as many as those that were returned, so that a pair is
  // moved once on average, however many a step has found.
  void move_to_front() {
    if (returned <= resting_pairs || sink.count - returned > returned - resting_pairs) return;
    geometry::CandidatePair* const pairs = sink.pairs.data();
    std::memmove(pairs + resting_pairs, pairs + returned, (sink.count - returned) * sizeof *pairs);
    sink.count -= returned - resting_pairs;
    returned = resting_pairs;
  }

  void add_tasks_within(BoxSet& set) {
    const auto grids = set.grids();
    for (RowGrid& grid : grids) tasks.push_back({&grid, nullptr});
    for (std::size_t k = 0; k < grids.size(); ++k)
      for (std::size_t l = k + 1; l < grids.size(); ++l) tasks.push_back({&grids[k], &grids[l]});
  }

  void add_tasks_between(BoxSet& p, BoxSet& q) {
    for (RowGrid& a : p.grids())
      for (RowGrid& b : q.grids()) tasks.push_back({&a, &b});
  }

  // All grids are sorted before the first task that compares two of them.
  void add_crowd_tasks() {
    crowded.list_pairs([&](BoxSet& set) { add_tasks_within(set); },
                       [&](BoxSet& p, BoxSet& q) { add_tasks_between(p, q); });
    crowded.each([&](BoxSet& set, BoxSet* near) {
      add_tasks_between(set, near != nullptr ? *near : moving);
      add_tasks_between(set, resting);
    });
  }

  const std::uint32_t* mask_data() const noexcept { return layered ? masks.data() : nullptr; }

  void start_tasks() {
    tasks.clear();
    task = position = 0;
  }

  // Does one more step of the sweep. Returns false when everything is done.
  bool step() {
    if (task == tasks.size()) return false;
    Task& t = tasks[task];
    // Either grid may query the other. Usually the few large boxes query the many small ones, unless they cover too
    // many cells.
    if (t.b != nullptr && position == 0 && t.a->estimated_query_cost(*t.b) < t.b->estimated_query_cost(*t.a))
      std::swap(t.a, t.b);
    std::uint32_t ready = t.b == nullptr ? t.a->sweepable() : t.a->count;
    // Sorts no further ahead than the sweep needs, so that the sweep finds the sorted boxes in the cache.
    if (position == ready && t.a->sorted_buckets < t.a->layout.buckets) {
      kernels.sort(*t.a, t.a->sorted_buckets++);
      ready = t.a->sweepable();
    }
    const std::uint32_t end = std::min(ready, position + boxes_per_step);
    if (t.b == nullptr)
      kernels.sweep(*t.a, position, end, sink);
    else
      kernels.query(*t.a, position, end, *t.b, sink);
    position = end;
    if (end == t.a->staged && t.a->sorted_buckets == t.a->layout.buckets) {
      ++task;
      position = 0;
    }
    return true;
  }

  void rebuild_resting(std::span<const geometry::Bounds> bounds, std::span<const std::uint8_t> resting_flags,
                       const std::uint8_t* layers, std::size_t& moving_count) {
    std::size_t staying = 0, leaving = 0;
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      resting_slots[staying] = slot;
      staying += in_resting_set[slot];
    }
    for (std::size_t k = 0; k < moving_count; ++k) {
      const std::uint32_t slot = moving_slots[k];
      if (resting_flags[slot] != 0) {
        resting_slots[staying++] = slot;
        in_resting_set[slot] = 1;
      } else {
        moving_slots[leaving++] = slot;
      }
    }
    moving_count = leaving;
    std::sort(resting_slots.data(), resting_slots.data() + staying);
    resting.build(kernels, bounds, layers, mask_data(), {resting_slots.data(), staying});
    resting_count = staying;
    removed = rebuild_debt = resting_pairs = sink.count = 0;
    resting_pairs_outdated = false;
    start_tasks();
    add_tasks_within(resting);
    while (step()) {
    }
    resting_pairs = sink.count;
    if (words.capacity() < resting_pairs) words.reserve(sink.pairs.capacity());
    words.assign(resting_pairs, 0);
    const auto grids = resting.grids();
    for (std::uint32_t g = 0; g < grids.size(); ++g)
      for (std::uint32_t p = 0; p < grids[g].count; ++p)
        location[grids[g].boxes[grids[g].entries[p].box].slot()] = {p, g};
  }

  void begin(std::span<const geometry::Bounds> bounds, std::span<const std::uint8_t> present,
             std::span<const std::uint8_t> resting_flags, std::span<const std::uint8_t> layers,
             std::span<const std::uint32_t> groups, std::span<const std::uint32_t> crowds) {
    assert(bounds.size() == present.size() && bounds.size() == resting_flags.size());
    assert(!layered || layers.size() == bounds.size());
    assert(groups.empty() || groups.size() == bounds.size());
    assert(crowds.empty() || crowds.size() == bounds.size());
    sink.groups = groups;
    sink.crowds = {};
    const std::uint8_t* const types = layered || any_fixed(layers) ? layers.data() : nullptr;
    if (bounds.size() != slots) resize(bounds.size());
    const auto classify_slots = [&] {
      Kernels::SlotCounts counts = kernels.classify_slots(present, resting_flags, in_resting_set.data(),
                                                          moving_slots.data(), leaving_slots.data());
      if (!crowds.empty()) {
        counts.moving = crowded.take(crowds, {moving_slots.data(), counts.moving});
        for (const std::uint64_t taken : crowded.taken())
          counts.pending -= resting_flags[CrowdSets::slot_of(taken)] != 0 ? 1 : 0;
      }
      return counts;
    };
    Kernels::SlotCounts slot_counts = classify_slots();
    std::size_t at_rest = resting_count - slot_counts.leaving + slot_counts.pending;
    if (!resting_set_pays(at_rest, resting_count + slot_counts.moving - slot_counts.leaving)) {
      if (resting_count != 0) {
        release();
        slot_counts = classify_slots();
      }
      at_rest = slot_counts.pending = 0;
    }
    for (std::size_t k = 0; k < slot_counts.leaving; ++k) remove_resting(leaving_slots[k]);
    if (resting_pairs_outdated) drop_outdated_pairs();
    std::size_t moving_count = slot_counts.moving;
    // Rebuilding costs about as much per box as sweeping it once more. So the set is rebuilt when the cost of not
    // rebuilding it adds up to that. The total is at most twice that of the best schedule.
    rebuild_debt += slot_counts.pending + removed;
    if (at_rest == 0) {
      resting.clear();
      removed = rebuild_debt = 0;
    } else if (rebuild_debt >= at_rest && rebuild_debt != 0) {
      rebuild_resting(bounds, resting_flags, types, moving_count);
    }
    const std::span<std::uint32_t> to_sweep{moving_slots.data(), moving_count};
    const bool has_crowds = !crowds.empty() && !crowded.empty();
    if (has_crowds) crowded.build(kernels, bounds, types, mask_data(), to_sweep);
    moving.build(kernels, bounds, types, mask_data(), to_sweep);
    start_tasks();
    add_tasks_within(moving);
    add_tasks_between(moving, resting);
    if (has_crowds) {
      add_crowd_tasks();
      if (crowded.needs_filter()) sink.crowds = crowds;
    }
    sink.count = resting_pairs;
    returned = 0;
  }
};

SweepAndPrune::SweepAndPrune(std::size_t objects, std::size_t pairs, const LayerMasks& layer_masks, bool keep_resting)
    : implementation_(std::make_unique<Implementation>(objects, pairs, layer_masks, keep_resting)) {}
SweepAndPrune::~SweepAndPrune() = default;
SweepAndPrune::SweepAndPrune(SweepAndPrune&&) noexcept = default;
SweepAndPrune& SweepAndPrune::operator=(SweepAndPrune&&) noexcept = default;

std::span<const geometry::CandidatePair> SweepAndPrune::find(std::span<const geometry::Bounds> bounds,
                                                             std::span<const std::uint8_t> present,
                                                             std::span<const std::uint8_t> resting,
                                                             std::span<const std::uint8_t> layers,
                                                             std::span<const std::uint32_t> groups,
                                                             std::span<const std::uint32_t> crowds) {
  begin(bounds, present, resting, layers, groups, crowds);
  while (implementation_->step()) {
  }
  return {implementation_->sink.pairs.data(), implementation_->sink.count};
}

void SweepAndPrune::begin(std::span<const geometry::Bounds> bounds, std::span<const std::uint8_t> present,
                          std::span<const std::uint8_t> resting, std::span<const std::uint8_t> layers,
                          std::span<const std::uint32_t> groups, std::span<const std::uint32_t> crowds) {
  implementation_->begin(bounds, present, resting, layers, groups, crowds);
}

std::span<const geometry::CandidatePair> SweepAndPrune::next(std::size_t most) {
  Implementation& sweep = *implementation_;
  sweep.move_to_front();
  while (sweep.sink.count - sweep.returned < most && sweep.step()) {
  }
  const std::size_t count = std::min(most, sweep.sink.count - sweep.returned);
  const geometry::CandidatePair* const first = sweep.sink.pairs.data() + sweep.returned;
  sweep.returned += count;
  return {first, count};
}

std::span<std::uint32_t> SweepAndPrune::kept_words() noexcept { return implementation_->words; }

}  // namespace ringfence::broad_phase
