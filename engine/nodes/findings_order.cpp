#include "nodes/findings_order.hpp"

#include <algorithm>
#include <cassert>

#include "nodes/fetch.hpp"

namespace ringfence::nodes {

void FindingsOrder::reserve(std::size_t contacts) {
  order_.reserve(contacts);
  sources_.reserve(contacts);
}

void FindingsOrder::start(std::span<Findings* const> findings) {
  findings_ = findings;
  order_.clear();
  sources_.clear();
  ascending_ = true;
}

void FindingsOrder::sort() {
  if (!ascending_) {
    order_.sort();
  }
}

namespace {

/// Two frames of contacts take turns, so what is written next is not in the cache.
void fetch_ahead(const Contact* next) noexcept {
  constexpr std::ptrdiff_t lines_ahead = 1024;
  fetch_to_write(reinterpret_cast<const std::byte*>(next) + lines_ahead);
  fetch_to_write(reinterpret_cast<const std::byte*>(next) + lines_ahead + 64);
}

void write_ended(const Stretch& stretch) {
  const auto keys = stretch.keys_before;
  const std::uint64_t* const end = keys.data() + keys.size();
  const std::uint64_t* old = keys.data();
  for (std::size_t i = 0; i < stretch.ended_keys.size(); ++i) {
    const std::uint64_t key = stretch.ended_keys[i];
    old = i == 0 ? std::lower_bound(old, end, key) : leap_to(old, end, key);
    assert(old != end && *old == key);
    Findings::copy(stretch.contacts_before[old - keys.data()], Phase::end, stretch.ended[i]);
  }
}

}  // namespace

const std::uint64_t* leap_to(const std::uint64_t* first, const std::uint64_t* end, std::uint64_t key) noexcept {
  std::ptrdiff_t leap = 1;
  while (leap < end - first && first[leap] < key) {
    first += leap;
    leap *= 2;
  }
  return std::lower_bound(first, first + std::min(leap + 1, end - first), key);
}

std::uint64_t write_stretch(const Stretch& stretch, FindingsOrder& order) {
  std::uint64_t doubled = 0;
  std::uint64_t last = 0;
  std::size_t at = 0;
  const auto write = [&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase phase) {
    const Findings& findings = *stretch.findings[node];
    const FoundContact& found = findings.found[position];
    fetch_ahead(stretch.contacts + at);
    fetch_to_write(stretch.keys + at + 16);
    fetch_to_write(stretch.found + at + 16);
    findings.write(position, phase, stretch.contacts[at]);
    stretch.keys[at] = key;
    stretch.found[at] = {found.slot_a, found.slot_b, node};
    ++at;
    doubled += key == last ? 1 : 0;
    last = key;
  };
  if (stretch.findings.size() == 1) {  // in order as it is, and all of it
    stretch.findings.front()->visit(
        [&](std::uint64_t key, std::uint32_t position, Phase phase) { write(key, 0, position, phase); });
    write_ended(stretch);
    return doubled;
  }
  order.start(stretch.findings);
  for (NodeNumber node = 0; node < stretch.findings.size(); ++node) {
    const auto& keys = stretch.findings[node]->keys;
    const auto* const first = std::lower_bound(keys.begin(), keys.end(), stretch.first_key);
    const auto* const end = std::lower_bound(first, keys.end(), stretch.end_key);
    at += static_cast<std::size_t>(first - keys.begin());
    for (const auto* key = first; key != end; ++key) {
      order.add(node, static_cast<std::uint32_t>(key - keys.begin()), *key);
    }
  }
  order.sort();
  order.visit(write);
  write_ended(stretch);
  return doubled;
}

}  // namespace ringfence::nodes
