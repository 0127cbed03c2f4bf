// How a CD node moves what it hosts, batch by batch, and whom it tells of it.
#include <cstring>
#include <new>

#include "nodes/cd_node_role.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::TrackedTime;

// What a batch changed goes to the server while the next one is moved: it is still in the cache here, and the server
// takes it in meanwhile. False where the link is full.
bool CdNodeRole::move() {
  TrackedTime time(setup_.track, "move", told_.move_ns);
  const messages::RunHead to_server = head(MessageType::node_state, Endpoint::server());
  const std::size_t bytes = sizeof(messages::NodeStateRecord) + host_.state_bytes();
  for (;;) {
    for (; told_changes_ != 0; ++next_changed_) {
      if (!tells_[next_changed_]) {
        continue;
      }
      std::byte* where = states_run_.add(*setup_.server.out, to_server, bytes, traffic_);
      if (where == nullptr) {
        return false;
      }
      tell_own_move(next_changed_, where);
      --told_changes_;
    }
    if (!host_.move_next()) {
      findings_->kept.finish();
      findings_->halo.finish(static_cast<NodeNumber>(setup_.peers.size()));
      return states_run_.finish(*setup_.server.out, to_server, bytes, traffic_);
    }
    changed_ = host_.changed();
    next_changed_ = 0;
    bound_batch();
    place_batch();
  }
}

void CdNodeRole::bound_batch() {
  geometry::PlacedShape placed[Host::batch];
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = host_[changed_[i]];
    placed[i] = {&object.pose, object.shape};
  }
  setup_.shapes->bounds({placed, changed_.size()}, *setup_.space, changed_bounds_.data(), changed_points_.data());
}

// Apart from the bounding: what is read again as a whole right after it was written in parts stalls the processor.
void CdNodeRole::place_batch() {
  if (publishes_) {
    note_cells();
  }
  constexpr std::size_t ahead = 12;
  const auto fetch = [&](std::size_t i) {
    if (i < changed_.size()) {
      known_.fetch(host_.place_in_list(changed_[i]));
    }
  };
  for (std::size_t i = 0; i < ahead; ++i) {
    fetch(i);
  }
  told_changes_ = 0;
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    fetch(i + ahead);
    if (host_.differs()[i]) {
      place(i);
    } else {
      rest(i);
    }
    told_changes_ += tells_[i] ? 1 : 0;
  }
}

// What rests, and is only told because it does, stands in the cell that was noted before.
void CdNodeRole::note_cells() {
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    host_.set_cell(changed_[i], relay_cell(host_[changed_[i]], changed_points_[i].at));
  }
}

// The i-th of the batch is where it was. The server is told if its state has been kept from it so far; else it is
// listed because under a new map nobody knows it yet.
void CdNodeRole::rest(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t was = known_.find(object.object.slot, host_.place_in_list(hosted));
  bool inner = was != KnownObjects::none && known_.inner(was);
  if (was == KnownObjects::none && (object.object.flags & messages::flag_present) != 0) {
    const regions::Cover cover = cover_of(bounds);
    inner = cover == regions::Cover::all;
    if (!inner) {
      tell_peers(object, bounds, true, was);
    }
    if (cover != regions::Cover::none) {
      host_.set_place_in_list(hosted, known_.set(object.object, object.pose, bounds, object.shape, object.layer,
                                                 NextHost::self, inner, was, hosted));
    }
  }
  tells_[i] = (object.object.flags & messages::flag_kept) != 0;
  changed_flags_[i] =
      messages::flag_present | messages::flag_staying | messages::flag_rests | (inner ? messages::flag_inner : 0u);
  host_.keep(hosted, false);
}

regions::Cover CdNodeRole::cover_of(const geometry::Bounds& bounds) const noexcept {
  return geometry::holds(interior_, bounds) ? regions::Cover::all : map_.cover(bounds, setup_.node);
}

// Where the i-th of the batch stands by the map as it is, and whether anybody need be told.
void CdNodeRole::place(std::size_t i) {
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host_[hosted];
  const geometry::Bounds& bounds = changed_bounds_[i];
  const std::uint32_t* const point = changed_points_[i].at;
  const bool present = (object.object.flags & messages::flag_present) != 0;
  const bool was_kept = (object.object.flags & messages::flag_kept) != 0;
  const regions::Cover cover = present ? cover_of(bounds) : regions::Cover::none;
  const bool inner = cover == regions::Cover::all;
  const bool within = geometry::holds(bounds, point);
  // Most stand within their bounds, and those within the region: then nobody need look whose cell it is.
  const NodeNumber next = inner && within ? setup_.node : map_.owner_at(point);
  const bool staying = next == setup_.node;
  const std::uint32_t was = known_.find(object.object.slot, host_.place_in_list(hosted));
  if (was_kept && !(inner && (was == KnownObjects::none || known_.inner(was)))) {
    tell_peers(object, bounds, staying, was);
  }
  if (cover != regions::Cover::none) {
    const std::uint32_t known = known_.set(object.object, object.pose, bounds, object.shape, object.layer,
                                           staying ? NextHost::self : NextHost::node, inner, was, hosted);
    host_.set_place_in_list(hosted, known);
  } else {
    known_.forget(object.object.slot);
  }
  if (!staying) {
    movers_.push_back({object.object.number, next});
  }
  // Where it stands within its bounds, its next host is told of it, too, and knows by them who else was.
  const bool keeps = keeps_ && present && ((inner && staying) || within);
  tells_[i] = !keeps || !staying || !was_kept;
  told_.kept += tells_[i] ? 0 : 1;
  if (!tells_[i] && setup_.may_be_lost) {
    findings_->kept.add(frame_, object.object, object.pose, host_.state(hosted));
  }
  changed_flags_[i] = (present ? messages::flag_present : 0u) | (inner ? messages::flag_inner : 0u) |
                      (staying ? messages::flag_staying : 0u) | (keeps ? messages::flag_kept : 0u);
  host_.keep(hosted, keeps);
}

// The server tells a node of every object in its region but those that the node itself hosts and reported.
void CdNodeRole::tell_own_move(std::size_t i, std::byte* where) {
  const Hosted& object = host_[changed_[i]];
  auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, changed_bounds_[i]};
  record->object.flags = changed_flags_[i];
  if (host_.state_bytes() != 0) {
    std::memcpy(where + sizeof *record, host_.state(changed_[i]), host_.state_bytes());
  }
}

std::uint32_t CdNodeRole::relay_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept {
  return (object.object.flags & messages::flag_present) != 0 ? setup_.interest_grid.cell_of(point) : Host::unpublished;
}

}  // namespace ringfence::nodes
