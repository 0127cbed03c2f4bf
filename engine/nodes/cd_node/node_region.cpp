#include "nodes/cd_node/node_region.hpp"

#include "messages/records.hpp"
#include "regions/owned_boxes.hpp"

namespace ringfence::nodes {

NodeRegion::NodeRegion(const regions::RegionMap& map, const geometry::FixedSpace& space, NodeNumber node,
                       std::uint32_t slots)
    : map_(map), space_(space), node_(node), slots_(slots) {
  find_boxes();
  entries_.reserve(map.grid().cells());
}

void NodeRegion::assign(NodeNumber node, std::uint32_t slots) {
  node_ = node;
  slots_ = slots;
  find_boxes();
  fits_ = map_.nodes() <= slots || regions::RegionMap::is_table(map_.table(), map_.grid(), slots);
}

void NodeRegion::find_boxes() {
  interior_ = regions::interior(map_, node_);
  densest_box_ = regions::densest_box(map_, node_);
}

NodeNumber NodeRegion::owner_at(const Vec3d& position) const noexcept {
  std::uint32_t point[3];
  space_.point(position, point);
  return map_.owner_at(point);
}

bool NodeRegion::is_acceptable(const messages::MessageView& message) const {
  if (entries_.size() + message.count() > regions::RegionMap::max_words(map_.grid())) {
    return false;
  }
  if (!message.last()) {
    return true;
  }
  std::vector<std::uint32_t> table = entries_;
  for (std::size_t i = 0; i < message.count(); ++i) {
    table.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  return regions::RegionMap::is_table(table, map_.grid(), slots_);
}

bool NodeRegion::receive(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    entries_.push_back(message.record<messages::OwnerRecord>(i).owner);
  }
  if (!message.last()) {
    return false;
  }
  map_.assign(entries_, slots_, message.header().epoch);
  find_boxes();
  fits_ = changed_ = true;
  entries_.clear();
  return true;
}

void NodeRegion::take(const regions::RegionMap& map) {
  map_ = map;
  find_boxes();
  fits_ = changed_ = true;
}

}  // namespace ringfence::nodes
