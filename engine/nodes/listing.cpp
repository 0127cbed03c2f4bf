#include "nodes/listing.hpp"

#include <algorithm>
#include <cassert>

#include "nodes/fetch.hpp"

namespace ringfence::nodes {
namespace {

/// Two frames of contacts take turns, so what is written next is not in the cache.
void fetch_ahead(const Contact* next) noexcept {
  constexpr std::ptrdiff_t lines_ahead = 1024;
  fetch_to_write(reinterpret_cast<const std::byte*>(next) + lines_ahead);
  fetch_to_write(reinterpret_cast<const std::byte*>(next) + lines_ahead + 64);
}

/// How many of ascending keys are below `key`.
std::size_t below(std::span<const std::uint64_t> keys, std::uint64_t key) noexcept {
  return static_cast<std::size_t>(std::lower_bound(keys.begin(), keys.end(), key) - keys.begin());
}

void write_ended(const Listing& listing, std::size_t share, ListingScratch& scratch) {
  const std::uint64_t first_key = listing.key_at(share);
  const std::uint64_t end_key = listing.key_at(share + 1);
  std::size_t at = 0;
  scratch.ended_order.clear();
  for (const std::span<const std::uint64_t> ending : listing.endings) {
    std::size_t next = below(ending, first_key);
    at += next;
    for (; next < ending.size() && ending[next] < end_key; ++next) {
      scratch.ended_order.add(ending[next]);
    }
  }
  scratch.ended_order.sort();
  std::size_t passed = below(listing.passed, first_key);
  at -= passed;
  // Keys first, so that what is copied is on its way when it is looked at.
  const std::size_t begin = at;
  scratch.ended.resize(scratch.ended_order.size());
  std::size_t old = share * listing.keys_before.size() / listing.shares;
  for (std::size_t i = 0; i < scratch.ended_order.size(); ++i) {
    const std::uint64_t key = scratch.ended_order.key_at(i);
    if (passed < listing.passed.size() && listing.passed[passed] == key) {
      ++passed;
      continue;
    }
    while (listing.keys_before[old] < key) {
      ++old;
    }
    assert(listing.keys_before[old] == key);
    scratch.ended[at - begin] = old;
    Findings::fetch_lines(listing.contacts_before[old]);
    fetch_to_write(listing.ended + at);
    fetch_to_write(reinterpret_cast<const std::byte*>(listing.ended + at) + 64);
    listing.ended_keys[at++] = key;
  }
  for (std::size_t i = begin; i < at; ++i) {
    Findings::copy(listing.contacts_before[scratch.ended[i - begin]], Phase::end, listing.ended[i]);
  }
}

}  // namespace

std::uint64_t Listing::key_at(std::size_t share) const noexcept {
  if (share == 0 || share == shares) {
    return share == 0 ? 0 : ~std::uint64_t{0};
  }
  std::span<const std::uint64_t> all = keys_before;
  if (all.empty()) {
    for (const Findings* one : findings) {
      all = one->keys.size() > all.size() ? one->keys.span() : all;
    }
  }
  return all.empty() ? 0 : all[share * all.size() / shares];
}

void ListingScratch::reserve(std::size_t contacts) {
  order.reserve(contacts);
  ended_order.reserve(contacts);
  ended.reserve(contacts);
  begins.reserve(contacts);
}

std::uint64_t write_stretch(const Listing& listing, std::size_t share, ListingScratch& scratch) {
  std::uint64_t doubled = 0;
  std::uint64_t last = 0;
  std::size_t at = 0;
  const auto write = [&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase phase) {
    const Findings& findings = *listing.findings[node];
    const FoundContact& found = findings.found[position];
    fetch_ahead(listing.contacts + at);
    fetch_to_write(listing.keys + at + 16);
    fetch_to_write(listing.found + at + 16);
    findings.write(position, found, phase, listing.contacts[at]);
    listing.keys[at] = key;
    listing.found[at] = {found.slot_a, found.slot_b, node};
    ++at;
    doubled += key == last ? 1 : 0;
    last = key;
  };
  if (listing.findings.size() == 1) {  // in order as it is, and all of it
    listing.findings.front()->visit(
        [&](std::uint64_t key, std::uint32_t position, Phase phase) { write(key, 0, position, phase); });
    write_ended(listing, share, scratch);
    return doubled;
  }
  FindingsOrder& order = scratch.order;
  order.start(listing.findings);
  const std::uint64_t first_key = listing.key_at(share);
  const std::uint64_t end_key = listing.key_at(share + 1);
  for (NodeNumber node = 0; node < listing.findings.size(); ++node) {
    const auto keys = listing.findings[node]->keys.span();
    std::size_t next = below(keys, first_key);
    at += next;
    const FoundContact* const found = listing.findings[node]->found.data();
    for (; next < keys.size() && keys[next] < end_key; ++next) {
      fetch_to_read(found + next);  // here one after the other, later here and there
      order.add(node, static_cast<std::uint32_t>(next), keys[next]);
    }
  }
  order.sort();
  order.visit(write);
  write_ended(listing, share, scratch);
  return doubled;
}

}  // namespace ringfence::nodes
