#include "facade/save/save_check.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "geometry/vector.hpp"
#include "nodes/host/valid_pose.hpp"
#include "nodes/server/request.hpp"
#include "ringfence/error.hpp"
#include "ringfence/motion_model.hpp"
#include "ringfence/object.hpp"

namespace ringfence::facade {

namespace {

constexpr std::size_t max_layers = 32;
constexpr std::uint64_t max_frames = std::uint64_t{1} << 62;

void require(bool holds, const char* what, std::uint64_t which) {
  if (!holds) {
    throw Error(std::string("save: ") + what + " (" + std::to_string(which) + "): it is damaged; use another one");
  }
}

/// Whether a World can have made the pose: it is valid, and its orientation needs no normalisation.
bool is_exact(const Pose& pose) noexcept {
  Pose valid = pose;
  return nodes::make_valid(valid) == Status::ok && valid == pose;
}

bool has_shape(const SavedWorld& saved, std::uint32_t shape) noexcept {
  return shape < saved.shapes.size() && saved.shapes[shape] != nullptr;
}

bool has_layer(const SavedWorld& saved, std::uint8_t layer) noexcept {
  return layer < std::max<std::size_t>(1, saved.layers.names.size());
}

bool was_connected(const SavedWorld& saved, std::uint32_t user) noexcept {
  const auto at = std::lower_bound(saved.users.begin(), saved.users.end(), user,
                                   [](const SavedUser& one, std::uint32_t number) { return one.number < number; });
  return at != saved.users.end() && at->number == user && at->connected != 0;
}

void check_saved_layers(const LayerMatrix& layers) {
  require(layers.names.size() <= max_layers, "there are too many layers", layers.names.size());
  for (const auto& [p, q] : layers.collide) {
    require(std::max(p, q) < layers.names.size(), "an unknown layer collides", std::max(p, q));
  }
}

void check_users(const SavedWorld& saved) {
  for (std::size_t i = 0; i < saved.users.size(); ++i) {
    const std::uint32_t number = saved.users[i].number;
    require(number != no_user_number && (i == 0 || saved.users[i - 1].number < number), "users are not in order",
            number);
  }
}

void check_objects(const SavedWorld& saved) {
  for (std::size_t i = 0; i < saved.objects.size(); ++i) {
    const SavedObject& object = saved.objects[i];
    const bool ordered = i == 0 ? object.number != 0 : saved.objects[i - 1].number < object.number;
    require(ordered, "objects are not in order", object.number);
    require(object.category <= static_cast<std::uint8_t>(Category::fixed), "an object has no category", object.number);
    const bool avatar = object.category == static_cast<std::uint8_t>(Category::avatar);
    require(avatar ? was_connected(saved, object.user) : object.user == no_user_number, "an object has a wrong user",
            object.number);
    require(has_shape(saved, object.shape), "an object has an unknown shape", object.number);
    require(has_layer(saved, object.layer), "an object has an unknown layer", object.number);
    require(is_exact(object.pose), "an object has an invalid pose", object.number);
  }
}

void check_contacts(const SavedWorld& saved) {
  base::NumberIndex known(saved.objects.size());
  for (const SavedObject& object : saved.objects) {
    known.set(object.number, 0);
  }
  const auto exists = [&](std::uint32_t number) {
    return number != 0 && known.find(number) != base::NumberIndex::none;
  };
  for (std::size_t i = 0; i < saved.contacts.size(); ++i) {
    const SavedContact& contact = saved.contacts[i];
    require(contact.a < contact.b && exists(contact.a) && exists(contact.b), "a contact has unknown objects",
            contact.a);
    if (i > 0) {
      const SavedContact& last = saved.contacts[i - 1];
      require(last.a < contact.a || (last.a == contact.a && last.b < contact.b), "contacts are not in order",
              contact.a);
    }
    const bool finite = is_finite(contact.point) && is_finite(contact.normal) && std::isfinite(contact.depth);
    require(finite && contact.phase <= 1, "a contact is not valid", contact.a);
  }
}

void check_request(const SavedWorld& saved, const SavedRequest& request) {
  using Kind = nodes::Request::Kind;
  const auto number = static_cast<std::uint32_t>(request.object);
  require(request.kind <= static_cast<std::uint8_t>(Kind::set_state), "a request has no kind", request.kind);
  const Kind kind = static_cast<Kind>(request.kind);
  require(request.category <= static_cast<std::uint8_t>(Category::fixed), "a request has no category", number);
  if (kind == Kind::spawn || kind == Kind::set_shape) {
    require(has_shape(saved, request.shape), "a request names an unknown shape", number);
  }
  if (kind == Kind::spawn || kind == Kind::set_layer) {
    require(has_layer(saved, request.layer), "a request names an unknown layer", number);
  }
  if (kind == Kind::spawn || kind == Kind::place) {
    require(is_exact(request.pose), "a request has an invalid pose", number);
  }
  if (kind == Kind::set_state) {
    const std::size_t end = request.state + std::size_t{saved.state_bytes};
    require(saved.state_bytes > 0 && end <= saved.request_states.size(), "a request has no state", number);
  }
}

}  // namespace

void check_calls(const SavedWorld& saved) {
  for (const SavedRequest& request : saved.requests) {
    check_request(saved, request);
  }
  for (const SavedMove& move : saved.moves) {
    require(is_exact(move.pose), "a move has an invalid pose", move.number);
  }
  for (const SavedInput& input : saved.inputs) {
    require(input.size <= max_input_bytes, "an input is too long", input.number);
  }
}

void check(const SavedWorld& saved) {
  require(saved.frames < max_frames, "the frame number is out of range", saved.frames);
  require(saved.frames > 0 || saved.objects.empty(), "there are objects before the first frame", saved.objects.size());
  require(saved.state_bytes <= max_motion_state, "the states are too large", saved.state_bytes);
  require(saved.states.size() == saved.objects.size() * saved.state_bytes, "there is not a state for each object",
          saved.states.size());
  check_saved_layers(saved.layers);
  check_users(saved);
  check_objects(saved);
  check_contacts(saved);
  check_calls(saved);
}

}  // namespace ringfence::facade
