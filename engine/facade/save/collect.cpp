#include "facade/save/collect.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "facade/save/request_records.hpp"
#include "messages/records.hpp"

namespace ringfence::facade {

namespace {

/// The slots of all live objects, ascending by number.
std::vector<std::pair<ObjectNumber, std::uint32_t>> slots_by_number(const nodes::ObjectTable& objects) {
  std::vector<std::pair<ObjectNumber, std::uint32_t>> slots;
  slots.reserve(objects.live());
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    if (objects.alive(slot)) {
      slots.emplace_back(objects.numbers()[slot], slot);
    }
  }
  std::sort(slots.begin(), slots.end());
  return slots;
}

void collect_objects(const nodes::ServerRole& server, SavedWorld& saved) {
  constexpr std::size_t ahead = 8;
  const nodes::ObjectTable& objects = server.objects();
  const auto slots = slots_by_number(objects);
  saved.objects.resize(slots.size());
  saved.states.resize(slots.size() * saved.state_bytes);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (i + ahead < slots.size()) {
      objects.prefetch_position(slots[i + ahead].second);
    }
    const std::uint32_t slot = slots[i].second;
    const nodes::ObjectRow& row = objects.row(slot);
    SavedObject& to = saved.objects[i];
    to.user_data = objects.origin(slot).user_data;
    to.pose = server.pose(slot);
    to.number = row.object.number;
    to.generation = row.object.generation;
    to.shape = row.shape;
    to.group = objects.group(slot);
    to.user = objects.origin(slot).user;
    to.category = static_cast<std::uint8_t>(row.category);
    to.layer = static_cast<std::uint8_t>(row.layer);
    to.enabled = (row.object.flags & messages::flag_present) != 0 ? 1 : 0;
    if (saved.state_bytes != 0) {
      std::copy_n(server.state(slot), saved.state_bytes, saved.states.data() + i * saved.state_bytes);
    }
  }
}

void collect_contacts(std::span<const Contact> contacts, SavedWorld& saved) {
  saved.contacts.reserve(contacts.size());
  for (const Contact& contact : contacts) {
    saved.contacts.push_back({contact.point, contact.a, contact.b, static_cast<std::uint32_t>(contact.phase),
                              contact.depth, contact.toi, contact.normal});
  }
}

// A user whose connection is still pending was not connected in the last frame.
void collect_users(const Requests& requests, SavedWorld& saved) {
  const auto is_pending = [&](UserNumber user) {
    return std::any_of(saved.requests.begin(), saved.requests.end(), [&](const SavedRequest& request) {
      return request.kind == static_cast<std::uint8_t>(nodes::Request::Kind::connect) && request.user == user;
    });
  };
  const auto numbers = static_cast<UserNumber>(std::max(requests.users().size(), requests.usage().size()));
  for (UserNumber user = 0; user < numbers; ++user) {
    const UserUsage::Counts counts = requests.usage().counts(user);
    const bool in_use = requests.users().in_use(user);
    if (in_use || counts.spawns != 0 || counts.moves != 0) {
      saved.users.push_back({user, in_use && !is_pending(user) ? 1u : 0u, counts.spawns, counts.moves});
    }
  }
}

}  // namespace

bool can_be_saved(const geometry::ShapeTable& shapes) noexcept {
  for (ShapeNumber shape = 0; shape < shapes.size(); ++shape) {
    const auto* const support = shapes.has(shape) ? std::get_if<SupportShape>(&shapes.description(shape)) : nullptr;
    if (support != nullptr && support->function->name().empty()) {
      return false;
    }
  }
  return true;
}

SavedWorld collect(const WorldState& state, const Requests& requests, const nodes::ServerRole& server,
                   std::uint64_t frames, std::span<const std::byte> own) {
  SavedWorld saved;
  saved.frames = frames;
  saved.last_number = requests.objects().last_number();
  saved.generation = requests.objects().generation();
  if (const MotionModel* const model = state.config.motion.get()) {
    saved.model_name = model->name();
    saved.model_version = model->version();
    saved.state_bytes = static_cast<std::uint32_t>(model->state_bytes());
  }
  saved.layers = state.config.layers;
  for (ShapeNumber shape = 0; shape < state.shapes.size(); ++shape) {
    saved.shapes.push_back(state.shapes.has(shape) ? &state.shapes.description(shape) : nullptr);
  }
  collect_objects(server, saved);
  if (frames > 0) {
    collect_contacts(server.ledger().contacts(frames - 1), saved);
  }
  collect_calls(requests, saved);
  collect_users(requests, saved);
  saved.own.assign(own.begin(), own.end());
  return saved;
}

}  // namespace ringfence::facade
