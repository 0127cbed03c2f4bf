#include "nodes/cd_node/mover.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "base/prefetch.hpp"
#include "nodes/exchange/publications.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using telemetry::SpanTimer;

Mover::Mover(NodeState& state, HaloExchange& halo, Migration& migration)
    : state_(state), halo_(halo), migration_(migration) {
  if (halo.shares_states() && state.setup.may_be_lost) {
    state.contacts.host_states.reserve(state.setup.objects, state.host.state_bytes());
  }
}

void Mover::begin() {
  changed_ = {};
  next_ = unreported_ = next_change_ = 0;
  changes_.clear();
  states_run_.start();
  replicas_run_.start();
  const NodePublication* const publication = state_.setup.server.publication;
  const bool published = std::exchange(publishes_, publication != nullptr && publication->wanted);
  if (publishes_ && !published) {
    state_.host.forget_cells();  // the cells were not updated while nothing was published
  }
  SpanTimer time(state_.setup.track, "move", state_.stats.move_ns);
  state_.host.begin_move(state_.frame);
  state_.contacts.host_states.begin(state_.frame);
  halo_.begin();
}

bool Mover::move() {
  SpanTimer time(state_.setup.track, "move", state_.stats.move_ns);
  while (report_batch()) {
    if (!state_.host.move_next()) {
      state_.contacts.host_states.finish();
      return report_changes() && halo_.finish_updates() &&
             states_run_.finish(*state_.setup.server.out, state_.head(MessageType::node_state, Endpoint::server()),
                                report_bytes(), state_.traffic);
    }
    changed_ = state_.host.changed();
    next_ = 0;
    bound_batch();
    place_batch();
  }
  return false;
}

// Returns false if the ring is full. Messages of two types cannot be open at once. So if the server receives replicas,
// which are most of the reports, the other changes wait until all objects have moved.
bool Mover::report_batch() {
  const bool replicates = halo_.replicates();
  for (; unreported_ != 0; ++next_) {
    const Report report = batch_.reports[next_];
    if (report == Report::none) {
      continue;
    }
    const std::uint32_t hosted = changed_[next_];
    const std::uint32_t flags = batch_.flags[next_];
    if (report == Report::state && replicates) {
      changes_.push_back({hosted, flags, batch_.bounds[next_]});
    } else if (!(report == Report::replica ? report_replica(hosted)
                                           : report_state(hosted, flags, batch_.bounds[next_]))) {
      return false;
    }
    --unreported_;
  }
  return true;
}

// The server does not send the object back: it sends a node every object in its region except those that the node
// itself hosts and has reported. Returns false if the ring is full.
bool Mover::report_state(std::uint32_t hosted, std::uint32_t flags, const geometry::Bounds& bounds) {
  std::byte* const where =
      states_run_.add(*state_.setup.server.out, state_.head(MessageType::node_state, Endpoint::server()),
                      report_bytes(), state_.traffic);
  if (where == nullptr) {
    return false;
  }
  const Hosted& object = state_.host[hosted];
  auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, bounds};
  record->object.flags = flags;
  std::copy_n(state_.host.state(hosted), state_.host.state_bytes(), where + sizeof *record);
  return true;
}

bool Mover::report_replica(std::uint32_t hosted) {
  std::byte* const where =
      replicas_run_.add(*state_.setup.server.out, state_.head(MessageType::replica, Endpoint::server()),
                        sizeof(messages::ReplicaRecord) + state_.host.state_bytes(), state_.traffic);
  if (where == nullptr) {
    return false;
  }
  const Hosted& object = state_.host[hosted];
  new (where) messages::ReplicaRecord{object.object.slot, object.object.generation, object.pose};
  std::copy_n(state_.host.state(hosted), state_.host.state_bytes(), where + sizeof(messages::ReplicaRecord));
  return true;
}

// Reports what had to wait for the last replica. Returns false if the ring is full.
bool Mover::report_changes() {
  if (!halo_.replicates()) {
    return true;
  }
  flush_replicas();
  for (; next_change_ < changes_.size(); ++next_change_) {
    const Change& change = changes_[next_change_];
    if (!report_state(change.hosted, change.flags, change.bounds)) {
      return false;
    }
  }
  flush();  // another message follows
  return true;
}

std::size_t Mover::report_bytes() const noexcept {
  return sizeof(messages::NodeStateRecord) + state_.host.state_bytes();
}

void Mover::flush() {
  flush_replicas();
  states_run_.flush(*state_.setup.server.out, state_.head(MessageType::node_state, Endpoint::server()), report_bytes(),
                    state_.traffic);
}

void Mover::flush_replicas() {
  replicas_run_.flush(*state_.setup.server.out, state_.head(MessageType::replica, Endpoint::server()),
                      sizeof(messages::ReplicaRecord) + state_.host.state_bytes(), state_.traffic);
}

void Mover::bound_batch() {
  geometry::PlacedShape placed[Host::batch];
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    const Hosted& object = state_.host[changed_[i]];
    placed[i] = {&object.pose, object.shape};
  }
  state_.setup.shapes->bounds({placed, changed_.size()}, *state_.setup.space, batch_.bounds.data(),
                              batch_.points.data());
}

// Runs after the bounds of the whole batch are computed. Reading bounds as a whole just after their parts were written
// would stall the processor.
void Mover::place_batch() {
  if (publishes_) {
    note_cells();
  }
  constexpr std::size_t ahead = 12;
  const auto prefetch = [&](std::size_t i) {
    if (i < changed_.size()) {
      state_.objects.prefetch(state_.host.place_in_list(changed_[i]));
    }
  };
  for (std::size_t i = 0; i < ahead; ++i) {
    prefetch(i);
  }
  unreported_ = 0;
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    prefetch(i + ahead);
    if (state_.host.differs()[i]) {
      place(i);
    } else {
      rest(i);
    }
    unreported_ += batch_.reports[i] != Report::none ? 1 : 0;
  }
}

// Stores the cells in which the changed objects are published. The other objects are at rest, and still in the cell
// stored before.
void Mover::note_cells() {
  for (std::size_t i = 0; i < changed_.size(); ++i) {
    state_.host.set_cell(changed_[i], publication_cell(state_.host[changed_[i]], batch_.points[i].at));
  }
}

// Updates the entry of object i of the batch, and decides whether the server and which peers need the change.
void Mover::place(std::size_t i) {
  Host& host = state_.host;
  RegionObjects& objects = state_.objects;
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host[hosted];
  const auto filter = [&] { return PairFilter::of(object.layer, false, host.group(hosted)); };  // hosted: not static
  const geometry::Bounds& bounds = batch_.bounds[i];
  const std::uint32_t* const point = batch_.points[i].at;
  const bool present = (object.object.flags & messages::flag_present) != 0;
  const bool was_host_owned = (object.object.flags & messages::flag_host_owned) != 0;
  const regions::Coverage coverage = present ? state_.region.coverage(bounds) : regions::Coverage::none;
  const bool inner = coverage == regions::Coverage::all;
  const bool within = geometry::contains(bounds, point);
  // The position of most objects is within their bounds. If the region contains these bounds, this node owns the cell
  // of the position.
  const NodeNumber next = inner && within ? state_.setup.node : state_.region.map().owner_at(point);
  const bool staying = next == state_.setup.node;
  const std::uint32_t was = objects.find(object.object.slot, host.place_in_list(hosted));
  if (was_host_owned && !(inner && (was == RegionObjects::none || objects.inner(was)))) {
    halo_.add_updates(hosted, bounds, staying, was);
  }
  if (coverage != regions::Coverage::none) {
    const std::uint32_t known =
        objects.set(object, bounds, filter, staying ? NextHost::self : NextHost::node, inner, was, hosted);
    host.set_place_in_list(hosted, known);
  } else {
    objects.remove(object.object.slot);
  }
  if (!staying) {
    migration_.add(object.object.number, next);
  }
  // If the position is within the bounds, the next host owns a cell that the bounds touch. So it receives a ghost
  // update too, and knows from the bounds which other nodes received one.
  const bool keeps = halo_.keeps_host_owned() && present && ((inner && staying) || within);
  const bool host_owned = keeps && staying && was_host_owned;
  batch_.reports[i] = !host_owned ? Report::state : halo_.replicates() ? Report::replica : Report::none;
  state_.stats.host_owned_changes += batch_.reports[i] == Report::none ? 1 : 0;
  if (batch_.reports[i] == Report::none && state_.setup.may_be_lost) {
    state_.contacts.host_states.add(state_.frame, object.object, object.pose, host.state(hosted));
  }
  batch_.flags[i] = (present ? messages::flag_present : 0u) | (inner ? messages::flag_interior : 0u) |
                    (staying ? messages::flag_keeps_host : 0u) | (keeps ? messages::flag_host_owned : 0u);
  host.set_host_owned(hosted, keeps);
}

// Object i of the batch did not move. If its state was host-owned, the server does not have it, so it is reported now.
// Otherwise the object is in the batch because the map is new: no node knows the object under it yet.
void Mover::rest(std::size_t i) {
  Host& host = state_.host;
  RegionObjects& objects = state_.objects;
  const std::uint32_t hosted = changed_[i];
  const Hosted& object = host[hosted];
  const auto filter = [&] { return PairFilter::of(object.layer, false, host.group(hosted)); };  // hosted: not static
  const geometry::Bounds& bounds = batch_.bounds[i];
  const std::uint32_t was = objects.find(object.object.slot, host.place_in_list(hosted));
  bool inner = was != RegionObjects::none && objects.inner(was);
  if (was == RegionObjects::none && (object.object.flags & messages::flag_present) != 0) {
    const regions::Coverage coverage = state_.region.coverage(bounds);
    inner = coverage == regions::Coverage::all;
    if (!inner) {
      halo_.add_updates(hosted, bounds, true, was);
    }
    if (coverage != regions::Coverage::none) {
      host.set_place_in_list(hosted, objects.set(object, bounds, filter, NextHost::self, inner, was, hosted));
    }
  }
  const bool was_host_owned = (object.object.flags & messages::flag_host_owned) != 0;
  batch_.reports[i] = was_host_owned ? Report::state : Report::none;
  batch_.flags[i] = messages::flag_present | messages::flag_keeps_host | messages::flag_at_rest |
                    (inner ? messages::flag_interior : 0u);
  host.set_host_owned(hosted, false);
}

void Mover::publish() {
  if (!publishes_) {
    return;
  }
  std::uint64_t publish_ns = 0;
  SpanTimer time(state_.setup.track, "publish", publish_ns);
  link::Publication& publication = state_.setup.server.publication->publication;
  publication.begin(state_.frame);
  publication.add_table(static_cast<std::uint32_t>(state_.host.size()), [this](std::uint32_t i) {
    if (state_.host.cell(i) == Host::unplaced) [[unlikely]] {
      std::uint32_t point[3];
      state_.setup.space->point(state_.host[i].pose.position, point);
      state_.host.set_cell(i, publication_cell(state_.host[i], point));
    }
    return state_.host.cell(i);
  });
  state_.fault.pass(NodeStage::publication, state_.frame);
  publication.publish_indexed(
      [this](std::uint32_t i) {
        base::prefetch_for_read(&state_.host[i]);
        base::prefetch_for_read(reinterpret_cast<const std::byte*>(&state_.host[i] + 1) - 1);
      },
      [this](std::uint32_t i) {
        return link::PublishedState{state_.host[i].object.number, 0, state_.host[i].pose};
      });
  note_cell_range(state_.setup.server.publication->published, state_.frame);
  published_run_.start(0);
}

std::uint32_t Mover::publication_cell(const Hosted& object, const std::uint32_t point[3]) const noexcept {
  return (object.object.flags & messages::flag_present) != 0 ? state_.setup.interest_grid.cell_of(point)
                                                             : Host::unpublished;
}

}  // namespace ringfence::nodes
