#include "facade/node_pool.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "link/futex_table.hpp"

namespace ringfence::facade {

using nodes::Connection;

NodePool::NodePool(NodePoolSetup setup) : setup_(std::move(setup)) {}

std::size_t NodePool::size() const noexcept {
  return nodes_.size() - static_cast<std::size_t>(std::count(nodes_.begin(), nodes_.end(), nullptr));
}

PoolNode* NodePool::find(NodeNumber id) const noexcept {
  const auto at =
      std::find_if(nodes_.begin(), nodes_.end(), [&](const auto& node) { return node != nullptr && node->id == id; });
  return at == nodes_.end() ? nullptr : at->get();
}

std::vector<NodeNumber> NodePool::youngest(std::size_t count) const {
  std::vector<std::pair<NodeNumber, NodeNumber>> by_id;
  each([&](const PoolNode& node) { by_id.emplace_back(node.id, node.slot); });
  std::sort(by_id.rbegin(), by_id.rend());
  by_id.resize(std::min(by_id.size(), count));
  std::vector<NodeNumber> slots;
  for (const auto& [id, slot] : by_id) {
    slots.push_back(slot);
  }
  return slots;
}

std::shared_ptr<const nodes::SharedNodes> NodePool::shared_nodes() const {
  auto shared = std::make_shared<nodes::SharedNodes>(nodes_.size());
  each([&](const PoolNode& node) { (*shared)[node.slot] = node.server.second.node_contacts; });
  return shared;
}

std::vector<Connection> NodePool::peers_of(const PoolNode& node) const {
  std::vector<Connection> peers(nodes_.size());
  each([&](const PoolNode& peer) {
    const auto channel = channels_.find(std::minmax(node.slot, peer.slot));
    if (channel != channels_.end()) {
      peers[peer.slot] = node.slot < peer.slot ? channel->second.first : channel->second.second;
    }
  });
  return peers;
}

bool NodePool::prepare_threads(std::size_t count) {
  const std::size_t missing = count - std::min(count, size());
  link::reserve_futex_slots(count);
  prepared_.reserve(missing);
  while (prepared_.size() > missing) {
    prepared_.pop_back();
  }
  while (prepared_.size() < missing) {
    auto worker = std::make_unique<Worker>();
    if (!setup_.start_worker(*worker)) {
      prepared_.clear();
      return false;
    }
    prepared_.push_back(std::move(worker));
  }
  return true;
}

PoolNode& NodePool::add(const regions::RegionMap& map, std::size_t total, bool own_thread,
                        RemoteNodes::MemberId member) {
  std::unique_ptr<Worker> worker;
  if (own_thread) {
    worker = std::move(prepared_.front());
    prepared_.erase(prepared_.begin());
  }
  const auto free = std::find(nodes_.begin(), nodes_.end(), nullptr);
  const auto slot = static_cast<NodeNumber>(free - nodes_.begin());
  if (free == nodes_.end()) {
    nodes_.emplace_back();
  }
  nodes_[slot] = make_node(slot, total, std::move(worker), member);
  PoolNode& node = *nodes_[slot];
  const bool here = member == RemoteNodes::local_member;
  each([&](const PoolNode& peer) {
    if (!shares() && &peer != &node && (here || peer.member == RemoteNodes::local_member)) {
      const bool lower = slot < peer.slot;
      channels_[std::minmax(slot, peer.slot)] = setup_.connect(lower ? node : peer, lower ? peer : node, total);
    }
  });
  if (here) {
    make_role(node, total, map);
  }
  return node;
}

std::unique_ptr<PoolNode> NodePool::make_node(NodeNumber slot, std::size_t total, std::unique_ptr<Worker> worker,
                                              RemoteNodes::MemberId member) {
  auto node = std::make_unique<PoolNode>();
  node->slot = slot;
  node->id = next_id_++;
  node->member = member;
  node->worker = std::move(worker);
  node->server = setup_.connect_to_server(*node, total);
  return node;
}

void NodePool::make_role(PoolNode& node, std::size_t total, const regions::RegionMap& map) {
  node.track = setup_.timeline ? std::make_unique<telemetry::Track>() : nullptr;
  nodes::CdNodeSetup own = setup_.role;
  own.node = node.slot;
  own.objects = share_of(setup_.objects, total);
  own.pairs = share_of(setup_.pairs, total);
  own.track = node.track.get();
  own.shares_thread = node.worker == nullptr;
  own.faults = node.worker != nullptr ? setup_.faults : nullptr;
  own.server = node.server.second;
  node.role = std::make_unique<nodes::CdNodeRole>(own, map);
}

PoolNode& NodePool::replace(NodeNumber slot, const regions::RegionMap& map) {
  auto node = make_node(slot, size(), nullptr, RemoteNodes::local_member);
  make_role(*node, size(), map);
  if (shares()) {
    node->server.second.node_contacts->report.dismissed = true;  // until the server has connected it
    node->role->assign(slot, std::make_shared<const nodes::SharedNodes>(nodes_.size()));
  } else {
    node->role->assign(slot, std::vector<Connection>(nodes_.size()));
  }
  retire(slot);
  nodes_[slot] = std::move(node);
  return *nodes_[slot];
}

void NodePool::remove(std::span<const NodeNumber> slots) {
  for (const NodeNumber slot : slots) {
    retire(slot);
  }
  while (!nodes_.empty() && nodes_.back() == nullptr) {
    nodes_.pop_back();
  }
}

// Nothing is allocated once the thread is asked to end: what it uses must outlive it.
void NodePool::retire(NodeNumber slot) {
  retired_.reserve(retired_.size() + 1);
  retired_channels_.reserve(retired_channels_.size() + nodes_.size());
  if (nodes_[slot]->worker != nullptr) {
    nodes_[slot]->worker->dismiss();
  }
  retired_.push_back(std::move(nodes_[slot]));
  for (auto channel = channels_.begin(); channel != channels_.end();) {
    const bool ends_here = channel->first.first == slot || channel->first.second == slot;
    if (ends_here) {
      retired_channels_.push_back(std::move(channel->second));
    }
    channel = ends_here ? channels_.erase(channel) : std::next(channel);
  }
}

std::shared_ptr<link::WakeTree> NodePool::make_wake_tree() const {
  std::vector<link::WakeTree::Bell*> bells;
  each([&](const PoolNode& node) {
    if (node.worker != nullptr) {
      bells.push_back(&node.worker->bell());
    }
  });
  const bool all_have_threads = bells.size() == size();
  return all_have_threads && bells.size() > max_woken_directly ? std::make_shared<link::WakeTree>(bells) : nullptr;
}

std::shared_ptr<link::WakeTree> NodePool::connect() {
  const auto shared = shares() ? shared_nodes() : nullptr;
  auto tree = make_wake_tree();
  std::size_t member = 0;
  each([&](PoolNode& node) {
    if (node.role == nullptr) {
      return;
    }
    if (node.worker != nullptr && node.is_stepped) {
      node.worker->assign({});
    }
    node.is_stepped = true;
    if (shares()) {
      node.role->assign(node.slot, shared);
    } else {
      node.role->assign(node.slot, peers_of(node));
    }
    if (node.worker != nullptr) {
      node.worker->assign({Steppable::of(*node.role)}, {tree, member++});
    }
  });
  return tree;
}

bool NodePool::free_retired() {
  const bool all_ended = std::all_of(retired_.begin(), retired_.end(), [](const auto& node) {
    return node->worker == nullptr || node->worker->has_ended();
  });
  if (all_ended) {
    retired_channels_.clear();
    std::erase_if(retired_, [](const auto& node) { return node->outlived_frame; });
  }
  for (const auto& node : retired_) {
    node->outlived_frame = true;
  }
  return all_ended;
}

}  // namespace ringfence::facade
