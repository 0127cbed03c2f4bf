#include "facade/requests/requests.hpp"

#include <algorithm>
#include <utility>

#include "nodes/host/valid_pose.hpp"

namespace ringfence::facade {

using nodes::Request;

Requests::Requests(const WorldConfig& config, const geometry::ShapeTable& shapes)
    : config_(config), shapes_(shapes), objects_(config.capacities.objects), usage_(config.quotas) {}

Connected Requests::connect(UserId wanted) {
  const UserNumber user = wanted == no_user ? users_.free_number() : wanted.number();
  if (user >= config_.limits.users) {
    return {refuse(Status::over_capacity), no_user};
  }
  if (users_.in_use(user)) {
    return {refuse(Status::number_in_use), no_user};
  }
  users_.connect(user);
  usage_.connect(user);
  Request request;
  request.kind = Request::Kind::connect;
  request.user = user;
  requests_.push_back(request);
  return {Status::ok, UserId(user)};
}

Status Requests::disconnect(UserId id) {
  const UserNumber user = id.number();
  if (!users_.is_connected(user)) {
    return refuse(Status::unknown_user);
  }
  users_.disconnect(user);
  objects_.end_avatars(user);
  Request request;
  request.kind = Request::Kind::disconnect;
  request.user = user;
  requests_.push_back(request);
  return Status::ok;
}

Status Requests::check_spec(const ObjectSpec& spec) const noexcept {
  if (!shapes_.has(spec.shape.number())) {
    return Status::unknown_shape;
  }
  if (const Status status = check_layer(spec.layer); status != Status::ok) {
    return status;
  }
  const bool avatar = spec.category == Category::avatar;
  if (static_cast<std::size_t>(spec.category) > static_cast<std::size_t>(Category::fixed) ||
      avatar != (spec.user != no_user)) {
    return Status::bad_category;
  }
  if (avatar && !users_.is_connected(spec.user.number())) {
    return Status::unknown_user;
  }
  if (spec.number != 0 && objects_.in_use(spec.number)) {
    return Status::number_in_use;
  }
  if (avatar && config_.quotas.avatars != 0 && objects_.avatars(spec.user.number()) >= config_.quotas.avatars) {
    return Status::over_quota;
  }
  return objects_.live() >= config_.limits.objects ? Status::over_capacity : Status::ok;
}

Spawned Requests::spawn(const ObjectSpec& spec) {
  Request request;
  request.kind = Request::Kind::spawn;
  request.spec = spec;
  Status status = check_spec(spec);
  if (status == Status::ok) {
    status = nodes::make_valid(request.spec.pose);
  }
  const ObjectNumber number = spec.number != 0 ? spec.number : objects_.free_number();
  if (status == Status::ok && number == 0) {
    status = Status::bad_number;
  }
  if (status == Status::ok && spec.category == Category::avatar && !usage_.take_spawn(spec.user.number())) {
    status = Status::over_quota;
  }
  if (status != Status::ok) {
    return {refuse(spec.user.number(), status), {}};
  }
  if (spec.number == 0) {
    objects_.take_number(number);  // a refused call takes none: a journal does not have it
  }
  request.spec.number = number;
  request.object = objects_.add(number, spec.category, spec.user.number(), spec.shape.number());
  requests_.push_back(request);
  return {Status::ok, request.object};
}

Status Requests::destroy(ObjectId object) {
  if (objects_.find(object) == nullptr) {
    return refuse(Status::stale_object);
  }
  objects_.end(object);
  Request request;
  request.kind = Request::Kind::destroy;
  request.object = object;
  requests_.push_back(request);
  return Status::ok;
}

Status Requests::check_own(UserId user, ObjectId object) const noexcept {
  if (!users_.is_connected(user.number())) {
    return Status::unknown_user;
  }
  const Registry::Entry* entry = objects_.find(object);
  if (entry == nullptr) {
    return Status::stale_object;
  }
  return entry->user == user.number() ? Status::ok : Status::not_host;
}

Status Requests::destroy(UserId user, ObjectId object) {
  const Status status = check_own(user, object);
  return status == Status::ok ? destroy(object) : refuse(user.number(), status);
}

Status Requests::move(UserId user, ObjectId object, const Pose& pose) {
  Status status = check_own(user, object);
  if (status == Status::ok) {
    status = nodes::check_pose(pose);
  }
  if (status == Status::ok && !usage_.take_move(user.number())) {
    status = Status::over_quota;
  }
  if (status != Status::ok) {
    return refuse(user.number(), status);
  }
  user_orders_.moves.push_back({user.number(), object.number(), pose});
  (void)nodes::make_valid(user_orders_.moves.back().pose);  // normalises
  return Status::ok;
}

Status Requests::input(UserId user, ObjectId object, std::span<const std::byte> bytes) {
  Status status = check_own(user, object);
  if (status == Status::ok && bytes.size() > max_input_bytes) {
    status = Status::bad_message;
  }
  if (status == Status::ok && !usage_.take_move(user.number())) {
    status = Status::over_quota;
  }
  if (status != Status::ok) {
    return refuse(user.number(), status);
  }
  UserOrders::Input& pending = user_orders_.inputs.emplace_back();
  pending.user = user.number();
  pending.input.number = object.number();
  pending.input.size = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), pending.input.bytes.begin());
  return Status::ok;
}

Status Requests::check_movable(ObjectId object) const noexcept {
  const Registry::Entry* entry = objects_.find(object);
  if (entry == nullptr) {
    return Status::stale_object;
  }
  return entry->category == Category::fixed ? Status::bad_category : Status::ok;
}

Status Requests::place(ObjectId object, const Pose& pose) {
  Request request;
  request.kind = Request::Kind::place;
  request.object = object;
  request.spec.pose = pose;
  Status status = check_movable(object);
  if (status == Status::ok) {
    status = nodes::make_valid(request.spec.pose);
  }
  if (status != Status::ok) {
    return refuse(status);
  }
  requests_.push_back(request);
  return Status::ok;
}

Status Requests::set_enabled(ObjectId object, bool enabled) {
  ObjectSpec spec;
  spec.enabled = enabled;
  const Status status = request_change(Request::Kind::set_enabled, object, check_movable(object), spec);
  if (status == Status::ok && !enabled) {
    for (UserOrders::Move& move : user_orders_.moves) {
      move.number = move.number == object.number() ? 0 : move.number;
    }
  }
  return status;
}

Status Requests::request_change(Request::Kind kind, ObjectId object, Status status, const ObjectSpec& spec) {
  if (objects_.find(object) == nullptr) {
    status = Status::stale_object;
  }
  if (status != Status::ok) {
    return refuse(status);
  }
  Request request;
  request.kind = kind;
  request.object = object;
  request.spec = spec;
  requests_.push_back(request);
  return Status::ok;
}

Status Requests::set_group(ObjectId object, std::uint32_t group) {
  ObjectSpec spec;
  spec.group = group;
  return request_change(Request::Kind::set_group, object, Status::ok, spec);
}

Status Requests::check_layer(std::uint8_t layer) const noexcept {
  return layer < std::max<std::size_t>(1, config_.layers.names.size()) ? Status::ok : Status::unknown_layer;
}

Status Requests::set_layer(ObjectId object, std::uint8_t layer) {
  ObjectSpec spec;
  spec.layer = layer;
  return request_change(Request::Kind::set_layer, object, check_layer(layer), spec);
}

Status Requests::set_shape(ObjectId object, ShapeId shape) {
  const Status known = shapes_.has(shape.number()) ? Status::ok : Status::unknown_shape;
  ObjectSpec spec;
  spec.shape = shape;
  const Status status = request_change(Request::Kind::set_shape, object, known, spec);
  if (status == Status::ok) {
    objects_.set_shape(object, shape.number());
  }
  return status;
}

Status Requests::set_state(ObjectId object, std::span<const std::byte> bytes) {
  const std::size_t size = config_.motion == nullptr ? 0 : config_.motion->state_bytes();
  Status status = check_movable(object);
  if (status == Status::ok && bytes.size() != size) {
    status = Status::bad_message;
  }
  if (status == Status::ok && size == 0) {
    return Status::ok;
  }
  status = request_change(Request::Kind::set_state, object, status, {});
  if (status == Status::ok) {
    requests_.back().state = static_cast<std::uint32_t>(states_.size());
    states_.insert(states_.end(), bytes.begin(), bytes.end());
  }
  return status;
}

void Requests::cut(nodes::FrameOrder& order) {
  objects_.cut();
  users_.cut();
  usage_.cut();
  if (!users_.cut_leaving().empty()) {
    const auto has_left = [&](const auto& order_of) { return !users_.is_connected(order_of.user); };
    std::erase_if(user_orders_.moves, has_left);
    std::erase_if(user_orders_.inputs, has_left);
  }
  requests_.insert(requests_.begin(), connects_.begin(), connects_.end());
  connects_.clear();
  order.requests.swap(requests_);
  order.states.swap(states_);
}

void Requests::forget_cut(nodes::FrameOrder& order) {
  order.requests.clear();
  order.states.clear();
  objects_.forget_cut();
  users_.forget_cut();
}

void Requests::restore_user(UserNumber user, bool connected, const UserUsage::Counts& counts) {
  usage_.restore(user, counts);
  if (connected) {
    Request request;
    request.kind = Request::Kind::connect;
    request.user = user;
    users_.connect(user);
    connects_.push_back(request);
  }
}

bool Requests::restore(const Request& request, Counting counting) {
  const bool counts = counting == Counting::in_quotas;
  const Registry::Entry* const entry = objects_.find(request.object);
  switch (request.kind) {
    case Request::Kind::connect:
      if (request.user >= config_.limits.users || users_.in_use(request.user)) {
        return false;
      }
      users_.connect(request.user);
      if (counts) {
        usage_.connect(request.user);
      }
      break;
    case Request::Kind::disconnect:
      if (!users_.is_connected(request.user)) {
        return false;
      }
      users_.disconnect(request.user);
      objects_.end_avatars(request.user);
      break;
    case Request::Kind::spawn: {
      const ObjectSpec& spec = request.spec;
      const bool avatar = spec.category == Category::avatar;
      const bool fits = avatar ? users_.is_connected(spec.user.number()) : spec.user == no_user;
      if (!fits || spec.number == 0 || objects_.in_use(spec.number)) {
        return false;
      }
      objects_.restore(request.object, spec.category, spec.user.number(), spec.shape.number());
      if (avatar && counts) {
        (void)usage_.take_spawn(spec.user.number());  // was within the quota
      }
      break;
    }
    default:
      if (entry == nullptr) {
        return false;
      }
      if (request.kind == Request::Kind::destroy) {
        objects_.end(request.object);
      } else if (request.kind == Request::Kind::set_shape) {
        objects_.set_shape(request.object, request.spec.shape.number());
      }
  }
  requests_.push_back(request);
  return true;
}

bool Requests::restore(const UserOrders::Move& move, Counting counting) {
  if (!users_.in_use(move.user)) {
    return false;
  }
  user_orders_.moves.push_back(move);
  if (counting == Counting::in_quotas) {
    (void)usage_.take_move(move.user);
  }
  return true;
}

bool Requests::restore(const UserOrders::Input& input, Counting counting) {
  if (!users_.in_use(input.user)) {
    return false;
  }
  user_orders_.inputs.push_back(input);
  if (counting == Counting::in_quotas) {
    (void)usage_.take_move(input.user);
  }
  return true;
}

void Requests::report_refused(FrameReport& report) noexcept {
  for (std::size_t reason = 0; reason < status_count; ++reason) {
    report.refused[reason] += std::exchange(refused_[reason], 0);
  }
}

}  // namespace ringfence::facade
