#include "facade/results/contact_index.hpp"

namespace ringfence::facade {

void ContactIndex::update(std::uint64_t frames, std::span<const Contact> contacts) {
  if (frames_ != frames) {
    build(contacts);
    frames_ = frames;
  }
}

void ContactIndex::build(std::span<const Contact> contacts) {
  objects_ = base::NumberIndex(contacts.size());
  begin_.assign(1, 0);
  ends_.clear();
  for (const Contact& contact : contacts) {
    for (const ObjectNumber number : {contact.a, contact.b}) {
      std::uint32_t object = objects_.find(number);
      if (object == base::NumberIndex::none) {
        object = static_cast<std::uint32_t>(begin_.size() - 1);
        objects_.set(number, object);
        begin_.push_back(0);
      }
      ++begin_[object + 1];
      ends_.push_back(object);
    }
  }
  for (std::size_t i = 1; i < begin_.size(); ++i) {
    begin_[i] += begin_[i - 1];
  }
  order_.resize(ends_.size());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end());
  for (std::size_t e = 0; e < ends_.size(); ++e) {
    order_[next[ends_[e]]++] = static_cast<std::uint32_t>(e / 2);
  }
}

std::span<const std::uint32_t> ContactIndex::of(ObjectNumber number) const noexcept {
  const std::uint32_t object = begin_.empty() ? base::NumberIndex::none : objects_.find(number);
  if (object == base::NumberIndex::none) {
    return {};
  }
  return {order_.data() + begin_[object], begin_[object + 1] - begin_[object]};
}

}  // namespace ringfence::facade
