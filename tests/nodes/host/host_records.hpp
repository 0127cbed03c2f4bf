#pragma once

#include "messages/records.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// The hand-over of an object whose values follow from its number.
inline messages::HandOverRecord record_of(ObjectNumber number) {
  messages::HandOverRecord record;
  record.object = {number + 7, number * 3, number, messages::flag_present};
  record.pose.position = {static_cast<double>(number), 2, 3};
  record.user_data = number * std::uint64_t{1000};
  record.shape = number % 5;
  record.layer = static_cast<std::uint16_t>(number % 3);
  record.category = static_cast<std::uint16_t>(Category::active);
  record.group = number * 11;
  return record;
}

}  // namespace ringfence::nodes
