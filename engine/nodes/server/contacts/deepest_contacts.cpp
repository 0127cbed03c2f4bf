#include "nodes/server/contacts/deepest_contacts.hpp"

#include <algorithm>

namespace ringfence::nodes {

void DeepestContacts::rank(std::uint32_t limit, std::span<NodeContacts* const> node_contacts) {
  limit_ = limit;
  unlisted_.clear();
  from_.assign(node_contacts.size() + 1, 0);
  count(node_contacts);
  if (!any_doubtful(node_contacts)) {
    return;
  }
  list_crowded();
  sort_crowded(node_contacts);
  for (NodeNumber node = 0; node < node_contacts.size(); ++node) {
    const NodeContacts& contacts = *node_contacts[node];
    for (std::uint32_t i = 0; i < contacts.found.size(); ++i) {
      const FoundContact& found = contacts.found[i];
      if (!is_doubtful(found)) {
        continue;
      }
      const Ranked contact{contacts.touches[found.touch].depth, contacts.keys[i]};
      if (!is_among_deepest(found.slot_a, contact) && !is_among_deepest(found.slot_b, contact)) {
        unlisted_.push_back(i);
      }
    }
    from_[node + 1] = unlisted_.size();
  }
}

void DeepestContacts::count(std::span<NodeContacts* const> node_contacts) {
  std::fill(counts_.begin(), counts_.end(), 0u);
  for (const NodeContacts* contacts : node_contacts) {
    for (const FoundContact& found : contacts->found) {
      const std::size_t slots = std::size_t{std::max(found.slot_a, found.slot_b)} + 1;
      if (slots > counts_.size()) [[unlikely]] {
        counts_.resize(std::max(slots, 2 * counts_.size()));
      }
      ++counts_[found.slot_a];
      ++counts_[found.slot_b];
    }
  }
}

bool DeepestContacts::any_doubtful(std::span<NodeContacts* const> node_contacts) const noexcept {
  return std::any_of(node_contacts.begin(), node_contacts.end(), [this](const NodeContacts* contacts) {
    return std::any_of(contacts->found.begin(), contacts->found.end(),
                       [this](const FoundContact& found) { return is_doubtful(found); });
  });
}

void DeepestContacts::list_crowded() {
  std::size_t size = 0;
  crowded_.clear();
  places_.assign(counts_.size(), not_crowded);
  for (std::size_t slot = 0; slot < counts_.size(); ++slot) {
    if (counts_[slot] > limit_) {
      places_[slot] = static_cast<std::uint32_t>(crowded_.size());
      crowded_.push_back({size, size});
      size += counts_[slot];
    }
  }
  ranked_.resize(size);
}

void DeepestContacts::sort_crowded(std::span<NodeContacts* const> node_contacts) {
  for (const NodeContacts* contacts : node_contacts) {
    for (std::size_t i = 0; i < contacts->found.size(); ++i) {
      const FoundContact& found = contacts->found[i];
      for (const std::uint32_t slot : {found.slot_a, found.slot_b}) {
        if (places_[slot] != not_crowded) {
          ranked_[crowded_[places_[slot]].end++] = {contacts->touches[found.touch].depth, contacts->keys[i]};
        }
      }
    }
  }
  for (const Crowded& object : crowded_) {
    Ranked* const first = ranked_.data() + object.begin;
    std::nth_element(first, first + limit_ - 1, ranked_.data() + object.end);
  }
}

bool DeepestContacts::is_among_deepest(std::uint32_t slot, const Ranked& contact) const noexcept {
  return !(ranked_[crowded_[places_[slot]].begin + limit_ - 1] < contact);
}

}  // namespace ringfence::nodes
