#include "narrow_phase/query/overlap_tests.hpp"

#include <algorithm>
#include <array>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/shape_tag.hpp"

namespace ringfence::narrow_phase {
namespace {

/// What pairs are sorted by: the kinds of object and query, and whether their test is in double.
constexpr std::size_t kinds = static_cast<std::size_t>(ShapeKind::hull) + 1;
constexpr std::size_t overlap_keys = 2 * kinds * kinds;

std::size_t key_of(const geometry::ShapeRow& object, const geometry::ShapeRow& query) noexcept {
  const std::size_t both = static_cast<std::size_t>(object.kind) * kinds + static_cast<std::size_t>(query.kind);
  return both * 2 + (ShapeTag::needs_double(tag_of(object), tag_of(query)) ? 1 : 0);
}

}  // namespace

void OverlapTests::set_query(const Pose& pose, ShapeNumber shape) {
  query_ = static_cast<std::uint32_t>(bodies_.size());
  bodies_.push_back({pose, shape, 2});
}

void OverlapTests::add(const Pose& pose, ShapeNumber shape) {
  if (pairs_.empty() && query_ != 0) {
    // The tests before are gone, but not their last shape.
    const Body query = bodies_[query_];
    bodies_.assign(1, query);
    query_ = 0;
  }
  pairs_.push_back({query_, static_cast<std::uint32_t>(bodies_.size())});
  bodies_.push_back({pose, shape, 1});
}

std::span<const std::uint8_t> OverlapTests::run(const geometry::ShapeView& shapes) {
  std::array<std::uint32_t, overlap_keys + 1> ends{};
  keys_.resize(pairs_.size());
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const std::size_t key =
        key_of(shapes.row(bodies_[pairs_[i].object].shape), shapes.row(bodies_[pairs_[i].query].shape));
    keys_[i] = static_cast<std::uint8_t>(key);
    ++ends[key + 1];
  }
  for (std::size_t key = 0; key < overlap_keys; ++key) ends[key + 1] += ends[key];
  std::array<KernelPair, most> sorted;
  for (std::uint32_t i = 0; i < pairs_.size(); ++i) {
    const std::size_t kind = keys_[i] / 2;
    const Pair pair = pairs_[i];
    // A kernel wants the lower kind first.
    const bool flipped = kind / kinds > kind % kinds;
    sorted[ends[keys_[i]]++] = {flipped ? pair.query : pair.object, flipped ? pair.object : pair.query, i,
                                flipped ? flip_bit : 0u};
  }
  results_.assign(pairs_.size(), 0);
  std::array<PairContact, most + contact_slack> contacts;
  KindCounters counters;
  for (std::size_t key = 0, begin = 0; key < overlap_keys; begin = ends[key++]) {
    if (begin == ends[key]) continue;
    const auto object = static_cast<ShapeKind>(key / 2 / kinds), query = static_cast<ShapeKind>(key / 2 % kinds);
    const KernelInput input{bodies_, shapes, {sorted.data() + begin, ends[key] - begin}, key % 2 != 0};
    const PairContact* const end =
        kernel_of(std::min(object, query), std::max(object, query))(input, contacts.data(), counters);
    for (const PairContact* next = contacts.data(); next != end; ++next) results_[next->pair] = 1;
  }
  pairs_.clear();
  return results_;
}

}  // namespace ringfence::narrow_phase
