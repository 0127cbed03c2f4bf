#include "nodes/exchange/output_merge.hpp"

#include <algorithm>
#include <cassert>

#include "base/prefetch.hpp"

namespace ringfence::nodes {
namespace {

/// Two frames of contacts alternate, so the memory that is written next is not in the cache.
void prefetch_ahead(const Contact* next) noexcept {
  constexpr std::ptrdiff_t lines_ahead = 1024;
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(next) + lines_ahead);
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(next) + lines_ahead + 64);
}

/// Number of ascending keys below `key`.
std::size_t below(std::span<const std::uint64_t> keys, std::uint64_t key) noexcept {
  return static_cast<std::size_t>(std::lower_bound(keys.begin(), keys.end(), key) - keys.begin());
}

/// The same, where it is probably near `guess`: a search from there reads few cache lines of a long list.
std::size_t below(std::span<const std::uint64_t> keys, std::uint64_t key, std::size_t guess) noexcept {
  std::size_t first = std::min(guess, keys.size());
  std::size_t last = first;
  for (std::size_t step = 4; first > 0 && keys[first - 1] >= key; step *= 2) {
    last = first - 1;
    first -= std::min(step, first);
  }
  for (std::size_t step = 4; last < keys.size() && keys[last] < key; step *= 2) {
    first = last + 1;
    last += std::min(step, keys.size() - last);
  }
  return first + below(keys.subspan(first, last - first), key);
}

/// Guesses where in the list of one node the keys of a slice begin: at the same part of each list, because the numbers
/// of objects say little about where they are.
class SliceBegin {
 public:
  SliceBegin(const OutputMerge& output_merge, std::size_t share) noexcept
      : part_((static_cast<std::uint64_t>(share) << 32) / output_merge.shares) {}
  std::size_t in(std::span<const std::uint64_t> keys) const noexcept { return keys.size() * part_ >> 32; }
  void prefetch(std::span<const std::uint64_t> keys) const noexcept { base::prefetch_for_read(keys.data() + in(keys)); }

 private:
  std::uint64_t part_;  ///< times 2^-32
};

}  // namespace

std::uint64_t OutputMerge::key_at(std::size_t share) const noexcept {
  if (share == 0 || share == shares) {
    return share == 0 ? 0 : ~std::uint64_t{0};
  }
  std::span<const std::uint64_t> all = keys_before;
  if (all.empty()) {
    for (const NodeContacts* one : node_contacts) {
      all = one->keys.size() > all.size() ? one->keys.span() : all;
    }
  }
  return all.empty() ? 0 : all[share * all.size() / shares];
}

void OutputMergeScratch::reserve(std::size_t contacts) {
  order.reserve(contacts);
  ended_order.reserve_rarely_used(contacts);
  ended.reserve_rarely_used(contacts);
}

void write_ended(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch) {
  const std::uint64_t first_key = output_merge.key_at(share);
  const std::uint64_t end_key = output_merge.key_at(share + 1);
  std::size_t at = 0;
  scratch.ended_order.clear();
  const SliceBegin begins(output_merge, share);
  constexpr std::size_t ahead = 12;
  for (std::size_t i = 0; i < output_merge.endings.size(); ++i) {
    if (i + ahead < output_merge.endings.size()) {
      begins.prefetch(output_merge.endings[i + ahead]);
    }
    const std::span<const std::uint64_t> ending = output_merge.endings[i];
    std::size_t next = below(ending, first_key, begins.in(ending));
    at += next;
    for (; next < ending.size() && ending[next] < end_key; ++next) {
      scratch.ended_order.add(ending[next]);
    }
  }
  scratch.ended_order.sort();
  std::size_t passed = below(output_merge.passed, first_key);
  at -= passed;
  // First the keys, with prefetches of the contacts; then the copies.
  const std::size_t begin = at;
  scratch.ended.resize(scratch.ended_order.size());
  std::size_t old = share * output_merge.keys_before.size() / output_merge.shares;
  for (std::size_t i = 0; i < scratch.ended_order.size(); ++i) {
    const std::uint64_t key = scratch.ended_order.key_at(i);
    if (passed < output_merge.passed.size() && output_merge.passed[passed] == key) {
      ++passed;
      continue;
    }
    while (output_merge.keys_before[old] < key) {
      ++old;
    }
    assert(output_merge.keys_before[old] == key);
    scratch.ended[at - begin] = old;
    base::prefetch_object(output_merge.contacts_before[old]);
    base::prefetch_for_write(output_merge.ended + at);
    base::prefetch_for_write(reinterpret_cast<const std::byte*>(output_merge.ended + at) + 64);
    output_merge.ended_keys[at++] = key;
  }
  for (std::size_t i = begin; i < at; ++i) {
    NodeContacts::copy(output_merge.contacts_before[scratch.ended[i - begin]], Phase::end, output_merge.ended[i]);
  }
}

void sort_listed(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch) {
  scratch.listed_at = 0;
  if (output_merge.node_contacts.size() == 1) {  // already in order, and in one slice
    return;
  }
  NodeContactOrder& order = scratch.order;
  order.start(output_merge.node_contacts);
  const std::uint64_t first_key = output_merge.key_at(share);
  const std::uint64_t end_key = output_merge.key_at(share + 1);
  // With many nodes the lists of most are in no cache of this core. Each stage reads what the one before has
  // prefetched.
  const SliceBegin begins(output_merge, share);
  constexpr std::size_t keys_ahead = 12;
  constexpr std::size_t lists_ahead = 24;
  const std::size_t nodes = output_merge.node_contacts.size();
  for (NodeNumber node = 0; node < nodes; ++node) {
    if (node + lists_ahead < nodes) {
      base::prefetch_for_read(&output_merge.node_contacts[node + lists_ahead]->keys);
    }
    if (node + keys_ahead < nodes) {
      begins.prefetch(output_merge.node_contacts[node + keys_ahead]->keys.span());
    }
    const auto keys = output_merge.node_contacts[node]->keys.span();
    std::size_t next = below(keys, first_key, begins.in(keys));
    scratch.listed_at += next;
    const FoundContact* const found = output_merge.node_contacts[node]->found.data();
    const std::size_t first = next;
    for (; next < keys.size() && keys[next] < end_key; ++next) {
      base::prefetch_for_read(found + next);  // read sequentially here, at random later
    }
    order.add_list(node, static_cast<std::uint32_t>(first), keys.subspan(first, next - first));
  }
  order.sort();
}

std::uint64_t write_listed(const OutputMerge& output_merge, const OutputMergeScratch& scratch) noexcept {
  std::uint64_t duplicates = 0;
  std::uint64_t last = 0;
  std::size_t at = scratch.listed_at;
  const auto write = [&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase phase) {
    const NodeContacts& node_contacts = *output_merge.node_contacts[node];
    const FoundContact& found = node_contacts.found[position];
    prefetch_ahead(output_merge.contacts + at);
    base::prefetch_for_write(output_merge.keys + at + 16);
    base::prefetch_for_write(output_merge.found + at + 16);
    node_contacts.write(found, phase, output_merge.contacts[at]);
    output_merge.keys[at] = key;
    output_merge.found[at] = {found.slot_a, found.slot_b, node};
    ++at;
    duplicates += key == last ? 1 : 0;
    last = key;
  };
  if (output_merge.node_contacts.size() == 1) {
    output_merge.node_contacts.front()->visit(
        [&](std::uint64_t key, std::uint32_t position, Phase phase) { write(key, 0, position, phase); });
  } else {
    scratch.order.visit(write);
  }
  return duplicates;
}

std::uint64_t write_slice(const OutputMerge& output_merge, std::size_t share, OutputMergeScratch& scratch) {
  write_ended(output_merge, share, scratch);
  sort_listed(output_merge, share, scratch);
  return write_listed(output_merge, scratch);
}

}  // namespace ringfence::nodes
