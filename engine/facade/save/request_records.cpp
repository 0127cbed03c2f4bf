#include "facade/save/request_records.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "ringfence/error.hpp"

namespace ringfence::facade {

namespace {

SavedRequest save_request(const nodes::Request& request) {
  const ObjectSpec& spec = request.spec;
  SavedRequest saved;
  saved.object = request.object.value;
  saved.user_data = spec.user_data;
  saved.pose = spec.pose;
  saved.shape = spec.shape.number();
  saved.group = spec.group;
  saved.spec_user = spec.user.number();
  saved.user = request.user;
  saved.state = request.state;
  saved.kind = static_cast<std::uint8_t>(request.kind);
  saved.category = static_cast<std::uint8_t>(spec.category);
  saved.layer = spec.layer;
  saved.enabled = spec.enabled ? 1 : 0;
  return saved;
}

nodes::Request request_of(const SavedRequest& saved) {
  nodes::Request request;
  request.kind = static_cast<nodes::Request::Kind>(saved.kind);
  request.object = ObjectId{saved.object};
  request.spec.number = request.object.number();
  request.spec.shape = ShapeId(saved.shape);
  request.spec.category = static_cast<Category>(saved.category);
  request.spec.layer = saved.layer;
  request.spec.group = saved.group;
  request.spec.enabled = saved.enabled != 0;
  request.spec.user = UserId(saved.spec_user);
  request.spec.user_data = saved.user_data;
  request.spec.pose = saved.pose;
  request.state = saved.state;
  request.user = saved.user;
  return request;
}

[[noreturn]] void fail(const std::string& what) { throw Error("save: " + what + ": it is damaged; use another one"); }

}  // namespace

void collect_calls(const Requests& requests, SavedWorld& saved) {
  for (const nodes::Request& request : requests.pending()) {
    if (request.kind <= nodes::Request::Kind::set_state) {
      saved.requests.push_back(save_request(request));
    }
  }
  saved.request_states.assign(requests.pending_states().begin(), requests.pending_states().end());
  for (const UserOrders::Move& move : requests.user_orders().moves) {
    saved.moves.push_back({move.pose, move.user, move.number});
  }
  for (const UserOrders::Input& input : requests.user_orders().inputs) {
    SavedInput& to = saved.inputs.emplace_back();
    to.user = input.user;
    to.number = input.input.number;
    to.size = input.input.size;
    std::transform(input.input.bytes.begin(), input.input.bytes.end(), to.bytes,
                   [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  }
}

void restore_calls(const SavedWorld& saved, Requests::Counting counting, Requests& requests) {
  for (const SavedRequest& request : saved.requests) {
    if (!requests.restore(request_of(request), counting)) {
      fail("a request names an object or a user that does not exist, or a number that is in use");
    }
  }
  requests.restore_states(saved.request_states);
  for (const SavedMove& move : saved.moves) {
    if (!requests.restore(UserOrders::Move{move.user, move.number, move.pose}, counting)) {
      fail("a move names a user that does not exist");
    }
  }
  for (const SavedInput& input : saved.inputs) {
    UserOrders::Input order;
    order.user = input.user;
    order.input.number = input.number;
    order.input.size = static_cast<std::uint8_t>(input.size);
    std::transform(input.bytes, input.bytes + sizeof input.bytes, order.input.bytes.begin(),
                   [](std::uint8_t byte) { return static_cast<std::byte>(byte); });
    if (!requests.restore(order, counting)) {
      fail("an input names a user that does not exist");
    }
  }
}

}  // namespace ringfence::facade
