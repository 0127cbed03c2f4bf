#include "nodes/user/user_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;
using regions::CellBox;

UserRole::UserRole(const UserSetup& setup)
    : setup_(setup),
      self_(Endpoint::user(setup.user)),
      fault_(setup.faults),
      host_(setup.model, setup.objects, &fault_) {}

Step UserRole::step() {
  bool progressed = drain(
      *setup_.server.in, host_.state_bytes(), [this](const MessageView& message) { receive(message); }, [] {});
  while (advance()) {
    progressed = true;
  }
  if (stage_ == Stage::abandoned) [[unlikely]] {
    return Step::abandoned;
  }
  if (progressed) {
    return Step::progressed;
  }
  return stage_ == Stage::sending_states || stage_ == Stage::finishing ? Step::blocked : Step::idle;
}

void UserRole::receive(const MessageView& message) {
  switch (message.type()) {
    case MessageType::frame_begin:
      return begin(message.header().frame);
    case MessageType::refused:
      refused_ += message.count();
      return;
    case MessageType::read_publications:
      may_read_ = true;
      return;
    case MessageType::notify:
      return receive_contacts(message);
    default:
      host_.apply(message);
  }
}

void UserRole::receive_contacts(const MessageView& message) {
  // Contacts that arrive between frames are those of the last frame, for objects that this node has adopted since.
  const bool late = stage_ == Stage::waiting;
  if (!late && stage_ == Stage::awaiting_contacts) {
    enter(telemetry::StepClock::end);
  }
  late ? host_.contacts().add_late(message) : host_.contacts().add(frame_, message);
  contacts_received_ |= message.last() && !late;
}

void UserRole::begin(std::uint64_t frame) {
  frame_ = frame;
  contacts_received_ = false;
  may_read_ = setup_.interest <= 0;  // without interest the node reads nothing and needs no permission
  frame_stats_ = {};
  enter(telemetry::StepClock::move);
  telemetry::SpanTimer time(setup_.thread.track, "move", frame_stats_.move_ns);
  host_.contacts().begin(frame);
  if (!move()) [[unlikely]] {
    stage_ = Stage::abandoned;
    return;
  }
  states_run_.start(host_.changed().size());
  stage_ = Stage::sending_states;
}

// Returns false if the World has abandoned this thread during the move. Then no result of the move may become visible
// to other roles.
bool UserRole::move() {
  Published& visible = setup_.publications->users[setup_.user];
  published_ = visible;
  if (MoveWatch* const watch = setup_.thread.watch) {
    watch->enter(setup_.user);
    move_and_publish();
    if (!watch->leave()) {
      return false;
    }
  } else {
    move_and_publish();
  }
  visible = published_;
  return true;
}

// The publication implements the paper's application-level multicast to other user nodes: it is written once, and every
// user node nearby reads it.
void UserRole::move_and_publish() {
  host_.move(frame_);
  PublicationWriter writer(*setup_.publications, published_, frame_);
  for (std::size_t i = 0; i < host_.size(); ++i) {
    if ((host_[i].object.flags & messages::flag_present) != 0) {
      writer.add(host_[i].object.number, host_[i].pose);
    }
  }
  fault_.pass(NodeStage::publication, frame_);
  frame_stats_.published = writer.publish();
}

void UserRole::read_others() {
  auto& seen = seen_[frame_ & 1];
  seen.clear();
  boxes_.clear();
  if (setup_.interest <= 0) {
    return;
  }
  const Publications& all = *setup_.publications;
  const double r = setup_.interest;
  for (std::size_t i = 0; i < host_.size(); ++i) {
    const Hosted& object = host_[i];
    if (object.category == static_cast<std::uint16_t>(Category::avatar) &&
        (object.object.flags & messages::flag_present) != 0) {
      const Vec3d p = object.pose.position;
      geometry::Bounds bounds;
      all.space->point({p.x - r, p.y - r, p.z - r}, bounds.lower);
      all.space->point({p.x + r, p.y + r, p.z + r}, bounds.upper);
      boxes_.push_back(all.grid.cells_of(bounds));
    }
  }
  const UserIndex& index = all.user_index[frame_ & 1];
  for (std::size_t box = 0; box < boxes_.size(); ++box) {
    for (const Published* relay : all.relays[frame_ & 1]) {
      read_box(*relay, boxes_[box], box);
    }
    for (const UserNumber user : index.wide) {
      if (user != setup_.user) {
        read_box(all.users[user], boxes_[box], box);
      }
    }
    read_indexed(index, boxes_[box], box);
  }
}

bool UserRole::was_read(const CellBox& cell, std::size_t earlier) const noexcept {
  return std::any_of(boxes_.begin(), boxes_.begin() + static_cast<std::ptrdiff_t>(earlier),
                     [&](const CellBox& other) { return other.contains(cell); });
}

// The cells of a row have consecutive numbers, so their entries are adjacent.
void UserRole::read_indexed(const UserIndex& index, const CellBox& box, std::size_t earlier) {
  const Publications& all = *setup_.publications;
  auto& seen = seen_[frame_ & 1];
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      const std::uint32_t last = all.grid.index(box.upper[0], y, z);
      auto entry = std::lower_bound(index.entries.begin(), index.entries.end(),
                                    std::uint64_t{all.grid.index(box.lower[0], y, z)} << 32);
      for (; entry != index.entries.end() && UserIndex::cell_of(*entry) <= last; ++entry) {
        const UserNumber user = UserIndex::user_of(*entry);
        const std::uint32_t cell = UserIndex::cell_of(*entry);
        if (user != setup_.user && !(earlier != 0 && was_read(all.grid.box_of(cell), earlier))) {
          seen.push_back(all.users[user].publication->read(frame_, cell));
        }
      }
    }
  }
}

// Reads the states in `box`, except those in the first `earlier` boxes, which have been read already. For the first box
// it chooses the cheaper of two ways. If the publication has states in many cells, it reads each row of the box,
// because the states of a row of cells are contiguous. If it has states in few cells, as a user node's publication has,
// it tests each of these cells. For later boxes it always tests cells, because only this way skips the cells of earlier
// boxes.
void UserRole::read_box(const Published& published, const CellBox& box, std::size_t earlier) {
  const std::size_t parity = frame_ & 1;
  if (!published.any[parity]) {
    return;
  }
  const CellBox& cell_range = published.cell_range[parity];
  CellBox common;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    common.lower[axis] = std::max(box.lower[axis], cell_range.lower[axis]);
    common.upper[axis] = std::min(box.upper[axis], cell_range.upper[axis]);
    if (common.lower[axis] > common.upper[axis]) {
      return;
    }
  }
  const std::size_t rows =
      std::size_t{common.upper[1] - common.lower[1] + 1u} * (common.upper[2] - common.lower[2] + 1u);
  if (earlier != 0 || published.publication->cells(frame_).size() < 4 * rows) {
    read_cells(published, common, earlier);
  } else {
    read_rows(published, common);
  }
}

void UserRole::read_rows(const Published& published, const CellBox& box) {
  const regions::CellGrid& grid = setup_.publications->grid;
  auto& seen = seen_[frame_ & 1];
  const std::size_t wide = box.upper[1] - box.lower[1] + std::size_t{1};
  std::uint32_t y = box.lower[1];
  std::uint32_t z = box.lower[2];
  published.publication->read_rows(
      frame_, wide * (box.upper[2] - box.lower[2] + std::size_t{1}),
      [&](std::size_t) {
        const std::pair cells(grid.index(box.lower[0], y, z), grid.index(box.upper[0], y, z));
        const bool end = y == box.upper[1];
        y = end ? box.lower[1] : y + 1;
        z += end ? 1 : 0;
        return cells;
      },
      [&](std::span<const link::PublishedState> states) { seen.push_back(states); });
}

void UserRole::read_cells(const Published& published, const CellBox& box, std::size_t earlier) {
  const regions::CellGrid& grid = setup_.publications->grid;
  auto& seen = seen_[frame_ & 1];
  const auto wanted = [&](std::uint32_t cell) {
    const CellBox at = grid.box_of(cell);
    return box.contains(at) && (earlier == 0 || !was_read(at, earlier));
  };
  const auto cells = published.publication->cells(frame_);
  const auto starts = published.publication->starts(frame_);
  const auto states = published.publication->states(frame_);
  for (std::size_t first = 0; first < cells.size(); ++first) {
    if (!wanted(cells[first])) {
      continue;
    }
    std::size_t end = first + 1;
    while (end < cells.size() && wanted(cells[end])) {
      ++end;
    }
    seen.push_back(states.subspan(starts[first], starts[end] - starts[first]));
    first = end;
  }
}

bool UserRole::send_states() {
  const auto changed = host_.changed();
  return states_run_.pump(*setup_.server.out, {MessageType::state_update, self_, Endpoint::server(), frame_, 0},
                          sizeof(messages::StateRecord) + host_.state_bytes(), traffic_,
                          [&](std::size_t i, std::byte* where) {
                            const Hosted& object = host_[changed[i]];
                            const messages::StateRecord record{object.object, object.pose};
                            std::memcpy(where, &record, sizeof record);
                            std::copy_n(host_.state(changed[i]), host_.state_bytes(), where + sizeof record);
                          });
}

bool UserRole::send_frame_done() {
  return frame_done_run_.send(*setup_.server.out, {MessageType::frame_done, self_, Endpoint::server(), frame_, 0},
                              traffic_, [this](std::size_t) {
                                host_.report(frame_stats_);
                                return frame_stats_;
                              });
}

void UserRole::enter(telemetry::StepClock::Step step) noexcept {
  if (setup_.thread.clock != nullptr) {
    setup_.thread.clock->enter(step);
  }
}

// Makes one transition to the next stage. Returns false if the role has to wait.
bool UserRole::advance() {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::sending_states:
      if (!send_states()) {
        return false;
      }
      stage_ = Stage::reading_others;
      return true;
    case Stage::reading_others:
      if (!may_read_) {
        return false;
      }
      enter(telemetry::StepClock::read_publications);
      {
        telemetry::SpanTimer time(setup_.thread.track, "read publications", frame_stats_.busy_ns);
        read_others();
      }
      stage_ = Stage::awaiting_contacts;
      return true;
    case Stage::awaiting_contacts:
      if (!contacts_received_) {
        return false;
      }
      enter(telemetry::StepClock::end);
      frame_done_run_.start(1);
      stage_ = Stage::finishing;
      return true;
    case Stage::finishing:
      if (!send_frame_done()) {
        return false;
      }
      stage_ = Stage::waiting;
      return true;
    case Stage::abandoned:
      return false;
  }
  return false;
}

}  // namespace ringfence::nodes
