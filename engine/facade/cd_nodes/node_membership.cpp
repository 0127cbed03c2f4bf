#include "facade/cd_nodes/node_membership.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "facade/config_check.hpp"

namespace ringfence::facade {

using nodes::Request;

namespace {

Request join_request(const PoolNode& node) {
  Request request;
  request.kind = Request::Kind::add_node;
  request.node = node.slot;
  request.node_id = node.id;
  request.connection = node.server.first;
  return request;
}

bool is_remote(const PoolNode& node) noexcept { return node.member != RemoteNodes::local_member; }

}  // namespace

Status NodeMembership::resize(std::uint32_t count, const nodes::ServerRole& server) {
  const bool remote = state_.config.remote_nodes != nullptr;
  const std::size_t most = remote ? nodes_.pool().size() : max_nodes;
  if (count == 0 || count > most || count > server.map().grid().cells()) {
    return requests_.refuse(Status::bad_number);
  }
  if (state_.threaded() && !remote && !prepare_threads(count)) {
    resize_to_ = 0;
    return requests_.refuse(Status::no_thread);
  }
  resize_to_ = count;
  return Status::ok;
}

// Creates the threads that are missing for `count` nodes. If one cannot be created, none is, and the log says what to
// do.
bool NodeMembership::prepare_threads(std::uint32_t count) {
  if (nodes_.pool().prepare_threads(count)) {
    return true;
  }
  state_.log.write(LogLevel::error,
                   "the system has no thread for one of " + std::to_string(count) +
                       " CD nodes: the number of nodes stays " + std::to_string(nodes_.pool().size()) +
                       "; resize to fewer, or raise the limit on threads (ulimit -u, pids.max) and resize again");
  return false;
}

void NodeMembership::cut(nodes::ServerRole& server) {
  resizing_to_ = std::exchange(resize_to_, 0u);
  if (state_.config.remote_nodes != nullptr) {
    exchange_remote(server);
  } else if (resizing_to_ != 0) {
    resize_local(server);
  }
}

void NodeMembership::resize_local(nodes::ServerRole& server) {
  // resize() has created the threads, but more are missing if nodes were lost since then.
  if (state_.threaded() && !prepare_threads(resizing_to_)) {
    (void)requests_.refuse(Status::no_thread);  // counted; resize() has returned
    resizing_to_ = 0;
    return;
  }
  NodePool& pool = nodes_.pool();
  const std::vector<NodeNumber> leavers = pool.youngest(pool.size() - std::min<std::size_t>(pool.size(), resizing_to_));
  const bool more = resizing_to_ > pool.size();
  while (pool.size() < resizing_to_) {
    state_.order.requests.push_back(join_request(pool.add(server.map(), resizing_to_, state_.threaded())));
  }
  if (more) {
    nodes_.connect(server);
  }
  request_partition(leavers);
}

// Adds remote nodes that are ready and starts the departure of those that want to leave. If all leave, a role stepped
// by the server's thread takes over; it leaves in turn when remote nodes have joined.
void NodeMembership::exchange_remote(nodes::ServerRole& server) {
  NodePool& pool = nodes_.pool();
  const auto arrivals = state_.config.remote_nodes->arrivals();
  const std::vector<NodeNumber> leavers = remote_leavers(!arrivals.empty());
  // Further nodes wait until there is a free cell.
  const std::size_t cells = server.map().grid().cells();
  const std::size_t staying = pool.size() - leavers.size();
  const std::size_t room = std::min(cells - std::min(cells, staying), max_nodes - pool.size());
  std::vector<RemoteNodes::MemberId> joining(
      arrivals.begin(), arrivals.begin() + static_cast<std::ptrdiff_t>(std::min(arrivals.size(), room)));
  if (joining.empty() && leavers.empty()) {
    return;
  }
  if (joining.empty() && staying == 0) {
    if (room == 0) {
      return;  // no other node can take over in this frame, so all nodes stay
    }
    joining.push_back(RemoteNodes::local_member);
  }
  const std::size_t total = pool.size() + joining.size();
  for (const RemoteNodes::MemberId member : joining) {
    state_.order.requests.push_back(join_request(pool.add(server.map(), total, false, member)));
  }
  if (!joining.empty()) {
    nodes_.connect(server);
  }
  request_partition(leavers);
}

// Slots of those that resize() drops, of remote nodes that want to leave, and of local ones if a remote node is there.
std::vector<NodeNumber> NodeMembership::remote_leavers(bool any_arrival) const {
  const NodePool& pool = nodes_.pool();
  RemoteNodes& remote = *state_.config.remote_nodes;
  std::vector<NodeNumber> leavers;
  if (resizing_to_ != 0) {
    leavers = pool.youngest(pool.size() - std::min<std::size_t>(pool.size(), resizing_to_));
  }
  bool remote_nodes_stay = any_arrival;
  pool.each([&](const PoolNode& node) { remote_nodes_stay |= is_remote(node) && !remote.is_leaving(node.member); });
  pool.each([&](const PoolNode& node) {
    const bool leaves = is_remote(node) ? remote.is_leaving(node.member) : remote_nodes_stay;
    if (leaves && std::find(leavers.begin(), leavers.end(), node.slot) == leavers.end()) {
      leavers.push_back(node.slot);
    }
  });
  return leavers;
}

// The nodes in the slots leave, and all cells are divided again among the others.
void NodeMembership::request_partition(std::span<const NodeNumber> leavers) {
  Request request;
  request.kind = Request::Kind::retire_node;
  for (const NodeNumber slot : leavers) {
    request.node = slot;
    state_.order.requests.push_back(request);
  }
  request.kind = Request::Kind::partition;
  state_.order.requests.push_back(request);
}

void NodeMembership::remove_gone(const FrameReport& report, nodes::ServerRole& server) {
  NodePool& pool = nodes_.pool();
  std::vector<NodeNumber> gone;
  pool.each([&](const PoolNode& node) {
    if (was_lost(report, node.id) || server.has_left(node.slot)) {
      gone.push_back(node.slot);
    }
  });
  if (gone.empty() && report.lost.empty()) {
    return;
  }
  const auto before = static_cast<std::uint32_t>(pool.size());
  state_.assign_server_thread({});
  pool.remove(gone);
  const auto left = static_cast<std::uint32_t>(pool.size());
  const bool local = state_.config.remote_nodes == nullptr;
  if (!report.lost.empty() && resize_to_ == 0 && local && server.has_abandoned_nodes()) {
    resize_to_ = before;
  } else if (!report.lost.empty() && resize_to_ == 0 && resizing_to_ < left) {
    resize_to_ = resizing_to_;  // in the frame of a loss no node leaves
  }
  if (left == 0) {
    requests_.add_first(join_request(pool.add(server.map(), 1, false)));
  }
  nodes_.connect(server);
}

}  // namespace ringfence::facade
