#include "nodes/user/interest_reader.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "base/prefetch.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

using geometry::CornerBox;

void InterestReader::begin(std::uint64_t frame, const HostPublication* own) {
  frame_ = frame;
  own_ = own;
  start_list();
  list_sources();
  index_sources();
}

// With many nodes these are many small publications, which other cores have written: what is read of them is prefetched
// in a pipeline.
void InterestReader::list_sources() {
  constexpr std::size_t ahead = 4;
  const std::size_t parity = frame_ & 1;
  const std::vector<const Published*>& all = publications_.relays[parity];
  sources_.clear();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i + 2 * ahead < all.size()) base::prefetch_object(*all[i + 2 * ahead]);
    if (i + ahead < all.size()) all[i + ahead]->publication->prefetch();
    const Published& published = *all[i];
    const queries::BoxTree* const tree = published.publication->tree(frame_);
    if (!published.any[parity] || tree == nullptr) continue;
    const bool is_own = own_ != nullptr && &published == &own_->published;
    sources_.push_back({published.bounds[parity], tree, published.publication->states(frame_),
                        published.publication->leaf_begins(frame_), is_own});
  }
}

// In the order of the nodes: bisection gives consecutive nodes neighbouring regions, so groups of the tree are small.
// Where joins and losses have changed that, the tree is slower and finds the same.
void InterestReader::index_sources() {
  if (sources_.empty()) return;
  const Vec3d origin = sources_.front().bounds.lower;
  queries::BoxGroup* const groups = source_tree_.start(sources_.size(), origin);
  for (std::size_t i = 0; i < sources_.size(); ++i) queries::set_box(groups, i, sources_[i].bounds, origin);
  source_tree_.finish();
}

/// Lists the sources that a box touches.
void InterestReader::list_near(const CornerBox& box) {
  near_.clear();
  if (sources_.empty()) return;
  const std::size_t ranges = touched_.find(source_tree_, source_tree_.box_of(box.lower, box.upper));
  for (std::size_t i = 0; i < ranges; ++i) {
    for (std::uint32_t at = touched_[i].first; at < touched_[i].end; ++at) {
      if (box.touches(sources_[at].bounds)) near_.push_back(&sources_[at]);
    }
  }
}

// The number of spans depends on the order of the states, which may change though the world is steady: so there is room
// for twice as many as before. The other list is not touched, because the caller may be reading it.
void InterestReader::start_list() {
  const std::size_t largest = std::max(seen_[0].size(), seen_[1].size());
  if (3 * largest > 2 * seen_room_) seen_room_ = 2 * largest;
  SeenList& seen = seen_[frame_ & 1];
  seen.clear();
  seen.reserve(seen_room_);
}

SeenPart InterestReader::read(const Host& host, const OwnStates& own) {
  const SeenList& seen = seen_[frame_ & 1];
  const std::size_t first = seen.size();
  list_boxes(host);
  if (!boxes_.empty()) {
    list_own_places(own);
    if (boxes_.size() == 1) {
      read_one_box();
    } else {
      for (const Source& source : sources_) read_union(source);
    }
  }
  return {&seen, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(seen.size() - first)};
}

namespace {

CornerBox around(const CornerBox& box, double by) noexcept {
  return {{box.lower.x - by, box.lower.y - by, box.lower.z - by},
          {box.upper.x + by, box.upper.y + by, box.upper.z + by}};
}

/// The smallest box that contains a box and a point.
CornerBox with(const CornerBox& box, const Vec3d& p) noexcept {
  return {{std::min(box.lower.x, p.x), std::min(box.lower.y, p.y), std::min(box.lower.z, p.z)},
          {std::max(box.upper.x, p.x), std::max(box.upper.y, p.y), std::max(box.upper.z, p.z)}};
}

bool is_small(const CornerBox& box, double most) noexcept {
  const Vec3d size = box.upper - box.lower;
  return size.x <= most && size.y <= most && size.z <= most;
}

}  // namespace

// Avatars that stand together have one box, which is an eighth of the distance wider at most.
void InterestReader::list_boxes(const Host& host) {
  boxes_.clear();
  if (interest_ <= 0) {
    return;
  }
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Hosted& object = host[i];
    if (object.category != static_cast<std::uint16_t>(Category::avatar) ||
        (object.object.flags & messages::flag_present) == 0) {
      continue;
    }
    const Vec3d& p = object.pose.position;
    const CornerBox joined = boxes_.empty() ? CornerBox{} : with(boxes_.back(), p);
    if (!boxes_.empty() && is_small(joined, interest_ / 8)) {
      boxes_.back() = joined;
    } else {
      boxes_.push_back({p, p});
    }
  }
  for (CornerBox& box : boxes_) box = around(box, interest_);
}

void InterestReader::list_own_places(const OwnStates& own) {
  own_places_.clear();
  if (own_ == nullptr) {
    return;
  }
  for (std::uint32_t i = 0; i < own.count; ++i) {
    own_places_.push_back(own_->users.place_of(own.first + i));
  }
  std::sort(own_places_.begin(), own_places_.end());
}

void InterestReader::select(const Source& source) noexcept {
  states_ = source.states;
  leaf_begins_ = source.leaf_begins;
  skipped_ = source.is_own ? std::span<const std::uint32_t>(own_places_) : std::span<const std::uint32_t>();
}

// With many nodes the box touches many small publications, which other cores have written: their trees are prefetched
// in a pipeline.
void InterestReader::read_one_box() {
  constexpr std::size_t ahead = 4;
  list_near(boxes_.front());
  for (std::size_t i = 0; i < near_.size(); ++i) {
    if (i + 2 * ahead < near_.size()) base::prefetch_object(*near_[i + 2 * ahead]->tree);
    if (i + ahead < near_.size()) near_[i + ahead]->tree->prefetch_top();
    read_one_box(*near_[i]);
  }
}

void InterestReader::read_one_box(const Source& source) {
  const CornerBox& box = boxes_.front();
  select(source);
  const std::size_t ranges = touched_.find(*source.tree, source.tree->box_of(box.lower, box.upper));
  for (std::size_t i = 0; i < ranges; ++i) read_range(touched_[i]);
}

// Each box of the tree once, however many boxes around avatars touch it: first marks those that are touched, then reads
// the marked ones. The cost is proportional to the number of boxes, not to its square.
void InterestReader::read_union(const Source& source) {
  bool any = false;
  for (const CornerBox& box : boxes_) {
    if (!box.touches(source.bounds)) continue;
    if (!std::exchange(any, true)) marked_.assign((source.tree->size() + 63) / 64, 0);
    const std::size_t ranges = touched_.find(*source.tree, source.tree->box_of(box.lower, box.upper));
    for (std::size_t i = 0; i < ranges; ++i) mark(touched_[i]);
  }
  if (any) {
    select(source);
    read_marked();
  }
}

void InterestReader::mark(const queries::BoxRange& range) noexcept {
  constexpr std::uint64_t all = ~std::uint64_t{0};
  const std::uint32_t last = range.end - 1;
  for (std::uint32_t word = range.first / 64; word <= last / 64; ++word) {
    const std::uint64_t from = word == range.first / 64 ? all << range.first % 64 : all;
    const std::uint64_t to = word == last / 64 ? all >> (63 - last % 64) : all;
    marked_[word] |= from & to;
  }
}

void InterestReader::read_marked() {
  queries::BoxRange range{0, 0};
  for (std::uint32_t word = 0; word < marked_.size(); ++word) {
    std::uint64_t left = marked_[word];
    while (left != 0) {
      const auto first = static_cast<std::uint32_t>(std::countr_zero(left));
      const auto count = static_cast<std::uint32_t>(std::countr_one(left >> first));
      if (range.end != word * 64 + first) {
        read_range(range);
        range.first = word * 64 + first;
      }
      range.end = word * 64 + first + count;
      left = first + count == 64 ? 0 : left >> (first + count) << (first + count);
    }
  }
  read_range(range);
}

// Cuts out the user node's own states. Most user nodes have one.
void InterestReader::read_range(const queries::BoxRange& range) {
  std::uint32_t first = leaf_begins_[range.first];
  const std::uint32_t end = leaf_begins_[range.end];
  if (!skipped_.empty()) {
    for (auto skipped = std::lower_bound(skipped_.begin(), skipped_.end(), first);
         skipped != skipped_.end() && *skipped < end; ++skipped) {
      add(first, *skipped);
      first = *skipped + 1;
    }
  }
  add(first, end);
}

void InterestReader::add(std::uint32_t first, std::uint32_t end) {
  if (first < end) {
    seen_[frame_ & 1].push_back(states_.subspan(first, end - first));
  }
}

}  // namespace ringfence::nodes
