#include "dds/cluster_nodes.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "dds/announcement.hpp"
#include "dds/description.hpp"
#include "dds/piece_assembler.hpp"
#include "dds/release.hpp"
#include "facade/config_check.hpp"
#include "nodes/server/server_role.hpp"
#include "ringfence/error.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::dds {

namespace {

/// Announcements that are kept. Further ones are ignored, so that a process that announces ever more nodes cannot take
/// all memory.
constexpr std::size_t max_announced = 4 * std::size_t{facade::max_nodes};

/// On one machine: room for what a node sends in a frame without waiting; it sends more than it receives.
constexpr LinkStream::RingBytes node_rings{std::size_t{1} << 18, std::size_t{1} << 20};

/// Milliseconds from one time to a later one; 0 if one of them is unknown.
double ms_between(std::uint64_t from, std::uint64_t to) noexcept {
  return from == 0 || to < from ? 0 : telemetry::to_ms(to - from);
}

}  // namespace

ClusterNodes::ClusterNodes(ClusterConfig config)
    : config_(std::move(config)),
      world_(random_incarnation()),
      presence_hook_{[this] {
                       presence_waits_.store(true, std::memory_order_release);
                       noted_.notify_all();
                       ring_server();
                     },
                     [] {}},
      domain_(config_.network, Side::world) {
  const double lease = config_.network.lease_ms;
  domain_.start_heartbeat(lease);
  const std::string& name = config_.network.world;
  const std::string own = partition_of_world(world_);
  terms_ = domain_.writer(Topic::terms, liveliness_qos(lease), name);
  pieces_ = domain_.writer(Topic::piece, piece_qos, own);
  listeners_ = domain_.reader(Topic::listener, piece_qos, own);
  presence_ = domain_.reader(Topic::presence, liveliness_qos(lease), name);
  Domain::set_hook(presence_, presence_hook_);
  if (const std::string shortage = Domain::socket_buffer_shortage(config_.network); !shortage.empty()) {
    log(LogLevel::warning, shortage);
  }
}

ClusterNodes::~ClusterNodes() {
  presence_.reset();
  listeners_.reset();
}

void ClusterNodes::log(LogLevel level, const std::string& line) const {
  if (config_.log) {
    config_.log(level, line);
  }
}

// Whether the sample comes from a node of another World. Unknown, so false, for a node with another version: its
// samples may hold `world` in another place.
bool ClusterNodes::is_of_another_world(const PresenceSample& sample) const noexcept {
  return has_own_format(sample.version, sample.order) && sample.world != world_;
}

// Reads announcements and departures. Not called by the receiving threads: they hold locks of Cyclone DDS, which other
// threads take while they hold the mutex.
void ClusterNodes::note_presence() {
  if (!presence_waits_.exchange(false, std::memory_order_acquire)) {
    return;
  }
  take_all<PresenceSample>(
      presence_, [&](const PresenceSample& sample, const dds_sample_info_t& info) { note_presence(sample, info); });
}

void ClusterNodes::note_presence(const PresenceSample& sample, const dds_sample_info_t& info) {
  const bool alive = info.instance_state == DDS_IST_ALIVE;
  const bool is_new = nodes_.count(sample.incarnation) == 0;
  if (is_new && (!alive || !info.valid_data || is_of_another_world(sample))) {
    return;
  }
  if (is_new && nodes_.size() >= max_announced) {
    if (!std::exchange(overflow_logged_, true)) {
      log(LogLevel::warning, std::to_string(max_announced) +
                                 " processes have announced nodes: further ones are ignored; see which processes of "
                                 "the DDS domain announce so many");
    }
    return;
  }
  if (is_new) {
    const auto added = std::make_shared<Node>();
    added->incarnation = sample.incarnation;
    added->seen_ns = telemetry::now_ns();
    nodes_.emplace(sample.incarnation, added);
  }
  Node& node = *nodes_.at(sample.incarnation);
  if (info.valid_data) {
    Announcement announced = read_announcement(sample);
    node.name = std::move(announced.name);
    node.fits = announced.fits;
    node.reason = std::move(announced.reason);
    node.state.store(announced.state, std::memory_order_relaxed);
    if (node.asked_to_leave_ns == 0 && node.state.load(std::memory_order_relaxed) == NodeState::leaving) {
      node.asked_to_leave_ns = telemetry::now_ns();
    }
  }
  if (!alive) {
    node.gone.store(true, std::memory_order_release);
    member_is_gone_.store(true, std::memory_order_release);
  }
}

void ClusterNodes::note_listeners() {
  take_all<ListenerSample>(listeners_, [&](const ListenerSample& sample, const dds_sample_info_t& info) {
    if (info.instance_state != DDS_IST_ALIVE) {
      listening_.erase(sample.incarnation);
    } else if (info.valid_data && sample.port <= 0xffff) {
      listening_[sample.incarnation] = {{0, sample.port}, info.publication_handle};
    }
  });
}

LinkAddress ClusterNodes::address_of(std::uint64_t incarnation) {
  const auto found = listening_.find(incarnation);
  if (found == listening_.end()) {
    return {};
  }
  Listening& listening = found->second;
  if (listening.address.host == 0) {
    listening.address.host = domain_.host_of(listeners_, listening.publication);
  }
  return listening.address;
}

void ClusterNodes::ring_server() {
  if (link::Doorbell* bell = server_bell_.load(std::memory_order_acquire)) {
    bell->ring();
  }
}

void ClusterNodes::open(const WorldParameters& terms) {
  if (server_bell_.load(std::memory_order_relaxed) != nullptr) {
    throw Error("A cluster serves one World; make another Cluster for another World");
  }
  if (terms.server_bell != nullptr) {
    if (!terms.server_bell->prepare_to_watch()) {
      throw Error("the process cannot wait for links of nodes; raise the limit on open files (ulimit -n)");
    }
    terms.server_bell->watch(events_.descriptor());
  }
  server_bell_.store(terms.server_bell, std::memory_order_release);
  const WorldConfig& config = *terms.config;
  WorldTermsRecord record;
  const Vec3d corners[2] = {config.bounds_min, config.bounds_max};
  for (std::size_t end = 0; end < 2; ++end) {
    double* bounds = end == 0 ? record.bounds_min : record.bounds_max;
    bounds[0] = corners[end].x;
    bounds[1] = corners[end].y;
    bounds[2] = corners[end].z;
  }
  record.lease_ms = config_.network.lease_ms;
  record.sense = config.sense;
  record.setup_bytes = config_.setup.size();
  std::copy_n(terms.cells_log2, 3, record.cells_log2);
  record.placement = static_cast<std::uint32_t>(config.placement);
  std::copy(terms.layer_masks.begin(), terms.layer_masks.end(), record.layer_masks);
  record.state_bytes = config.motion == nullptr ? 0 : static_cast<std::uint32_t>(config.motion->state_bytes());
  record.has_model = config.motion == nullptr ? 0 : 1;
  record.keep_resting = config.tuning.keep_resting ? 1 : 0;
  record.remember_axes = config.tuning.remember_axes ? 1 : 0;
  record.hosts = config.deployment == Deployment::user_collision ? 1 : 0;
  constexpr std::size_t max_objects = std::size_t{1} << 31;
  record.max_objects = static_cast<std::uint32_t>(std::clamp<std::size_t>(config.limits.objects, 1, max_objects));
  terms_record_ = record;
  if ((!config_.setup.empty() && !write_pieces(pieces_.get(), world_, PieceKind::setup, 0, 0, config_.setup)) ||
      !publish_terms()) {
    throw Error("Cyclone DDS cannot send the World's parameters; check that the network is up");
  }
}

bool ClusterNodes::publish_terms() {
  std::string name = "ringfence " + own_release();
  TermsSample sample{world_,        wire_version, {},
                     fingerprint(), name.data(),  borrow(std::as_bytes(std::span(&terms_record_, 1)))};
  write_byte_order(sample.order);
  return dds_write(terms_.get(), &sample) == DDS_RETCODE_OK;
}

void ClusterNodes::add_shape(ShapeNumber shape, const ShapeDescription& description) {
  const std::vector<std::byte> bytes = pack_shape(description);
  shape_parts_.resize(shape + std::size_t{1});
  shape_parts_[shape] = static_cast<std::uint32_t>(piece_parts(bytes.size()));
  if (!write_pieces(pieces_.get(), world_, PieceKind::shape, shape, 0, bytes)) {
    throw Error("shape " + std::to_string(shape) + " could not be sent to the nodes; check that the network is up");
  }
  shapes_ = shape + 1;
  for (const auto& node : assigned_by_slot_) {
    if (node != nullptr) {
      node->parcel_channel->set_shapes(shapes_);
    }
  }
}

// A node that does not receive it keeps the memory of the shape; nothing else depends on it.
void ClusterNodes::remove_shape(ShapeNumber shape) {
  if (!write_pieces(pieces_.get(), world_, PieceKind::shape, shape, removed_shape_epoch, {})) {
    log(LogLevel::warning, "the removal of shape " + std::to_string(shape) + " could not be sent to the nodes");
  }
  dispose_pieces(pieces_.get(), world_, PieceKind::shape, shape, 1, shape_parts_[shape]);
}

std::vector<ModelFailure> ClusterNodes::take_model_failures() {
  const std::lock_guard lock(mutex_);
  return std::exchange(model_failures_, {});
}

// Whether the node can be assigned.
bool ClusterNodes::is_ready(const Node& node) const noexcept {
  return node.fits && !node.gone.load(std::memory_order_acquire) && !node.assigned && !node.dismissed &&
         node.state.load(std::memory_order_relaxed) == NodeState::ready && node.parcel_channel != nullptr &&
         !node.parcel_channel->is_broken();
}

// Opens the link to a node, and tries again if that fails or takes long: the node may not listen yet at the address
// that was announced, and TCP waits a second if its first packet is lost.
void ClusterNodes::connect(Node& node) {
  constexpr double pause_ms = 100;
  const std::uint64_t now = telemetry::now_ns();
  const bool is_recent = node.connected_ns != 0 && ms_between(node.connected_ns, now) < pause_ms;
  if (node.parcel_channel != nullptr) {
    node.parcel_channel->flush();
    const bool is_connecting = node.parcel_channel->has_unsent();
    if (!node.parcel_channel->is_broken() && (!is_connecting || is_recent)) {
      return;
    }
    node.parcel_channel.reset();
  }
  const LinkAddress address = address_of(node.incarnation);
  if (!address.is_known() || is_recent) {
    return;
  }
  node.connected_ns = now;
  if (LinkStream link = LinkStream::connect(address, node.incarnation, node_rings)) {
    const LinkHello hello{.sender = world_, .receiver = node.incarnation};
    node.parcel_channel = std::make_unique<ParcelChannel>(std::move(link), std::as_bytes(std::span(&hello, 1)));
    node.parcel_channel->report_to(events_, node.incarnation);
    node.parcel_channel->flush();
  }
}

std::string ClusterNodes::describe_refusal(const Node& node) {
  const NodeState state = node.state.load(std::memory_order_relaxed);
  if (state == NodeState::refused && !node.reason.empty()) {
    return node.reason;
  }
  return "it has another version, byte order, record layout or release" +
         (node.reason.empty() ? std::string() : ": release " + node.reason + ", the World's is " + own_release()) +
         "; install one release of ringfence on all machines";
}

// Opens links to new nodes and erases those that are gone.
void ClusterNodes::update_membership() {
  for (const std::string& line : Domain::take_log_lines()) {
    log(LogLevel::warning, line);
  }
  for (auto at = nodes_.begin(); at != nodes_.end();) {
    Node& node = *at->second;
    const NodeState state = node.state.load(std::memory_order_relaxed);
    note_join(node);
    if (node.gone.load(std::memory_order_acquire) && !node.assigned) {
      at = nodes_.erase(at);
      continue;
    }
    if ((!node.fits || state == NodeState::refused) && !node.refusal_logged) {
      node.refusal_logged = true;
      ++totals_.refused;
      log(LogLevel::warning, "node " + node.name + " is refused: " + describe_refusal(node));
    }
    if (node.fits && !node.assigned && !node.dismissed) {
      connect(node);
    }
    ++at;
  }
}

std::vector<RemoteNodes::MemberId> ClusterNodes::arrivals() {
  const std::lock_guard lock(mutex_);
  note_presence();
  note_listeners();
  update_membership();
  std::vector<MemberId> ready;
  for (const auto& [incarnation, node] : nodes_) {
    if (is_ready(*node)) {
      ready.push_back(incarnation);
    }
  }
  return ready;
}

std::vector<RemoteNodes::MemberId> ClusterNodes::wait_for_nodes(std::uint32_t nodes) {
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::microseconds(static_cast<std::int64_t>(config_.wait_ms * 1e3));
  for (;;) {
    std::vector<MemberId> ready = arrivals();
    if (ready.size() >= nodes) {
      ready.resize(nodes);  // the others join in the first frame
      return ready;
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      const NetworkConfig& network = config_.network;
      throw Error(
          std::to_string(ready.size()) + " of " + std::to_string(nodes) + " nodes joined domain " +
          std::to_string(domain()) + " within " + std::to_string(static_cast<long>(config_.wait_ms)) +
          " ms: start `ringfence node --domain " + std::to_string(domain()) +
          (network.world.empty() ? "" : " --world " + network.world) + "` on machines of the network of " +
          (network.interface.empty() ? "the interface that Cyclone DDS chose (--interface)" : network.interface) +
          ", with --peers and this machine's address where multicast does not pass; UDP and TCP ports " +
          std::to_string(7400 + 250 * domain()) + " and the 249 above must be open");
    }
    std::unique_lock lock(mutex_);
    noted_.wait_for(lock, std::chrono::milliseconds(2));
  }
}

bool ClusterNodes::is_leaving(MemberId member) {
  const std::lock_guard lock(mutex_);
  const auto found = nodes_.find(member);
  return found != nodes_.end() && found->second->state.load() == NodeState::leaving;
}

void ClusterNodes::add_change(MemberChange::Kind kind, const Node& node, std::uint64_t at_ns, double before_ms,
                              double after_ms) {
  if (totals_.changes.size() == ClusterReport::max_changes) {
    totals_.changes.erase(totals_.changes.begin());
  }
  const double passed_s = ms_between(at_ns, telemetry::now_ns()) * 1e-3;
  const double now_s = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  totals_.changes.push_back({kind, node.name, now_s - passed_s, before_ms, after_ms});
}

// Records a join when the node has sent its first message.
void ClusterNodes::note_join(Node& node) {
  const std::uint64_t first_ns = node.first_parcel_ns.load(std::memory_order_relaxed);
  if (first_ns == 0 || std::exchange(node.join_noted, true)) {
    return;
  }
  add_change(MemberChange::Kind::joined, node, node.assigned_ns, ms_between(node.seen_ns, node.assigned_ns),
             ms_between(node.assigned_ns, first_ns));
}

void ClusterNodes::dismiss(Node& node) {
  note_join(node);
  const std::uint64_t now = telemetry::now_ns();
  node.assigned = false;
  node.dismissed = true;
  node.server = {};
  node.peers.clear();
  if (node.lost || node.broken || node.gone.load(std::memory_order_acquire)) {
    ++totals_.lost;
    const std::uint64_t noticed = node.lost_ns != 0 ? node.lost_ns : now;
    add_change(MemberChange::Kind::lost, node, noticed, ms_between(node.last_parcel_ns, noticed),
               ms_between(noticed, now));
    log(LogLevel::error, "node " + node.name + " is lost" +
                             (node.broken ? ": its link has failed, or its messages break the protocol" : ""));
    // A node that has lost sight of the World sees it alive again only by a new sample of this writer, not by
    // heartbeats.
    publish_terms();
  } else {
    ++totals_.left;
    add_change(MemberChange::Kind::left, node, now, ms_between(node.asked_to_leave_ns, now), 0);
    log(LogLevel::info, "node " + node.name + " leaves");
  }
  // Sent even if the process may be gone: if it still lives, the last thing it learns is that it is not assigned.
  // Otherwise it learns that when it uses the link, which is closed.
  node.parcel_channel->enqueue(ParcelKind::dismissed, {});
  node.parcel_channel->flush();
  node.parcel_channel.reset();
}

void ClusterNodes::assign(nodes::ServerRole& server, std::span<const NodeAssignment> assignments,
                          const regions::RegionMap& map) {
  const std::lock_guard lock(mutex_);
  server_ = &server;
  const auto old = std::exchange(assigned_by_slot_, {});
  assigned_by_slot_.resize(assignments.size());
  assigned_by_incarnation_.clear();
  for (std::size_t slot = 0; slot < assignments.size(); ++slot) {
    if (assignments[slot].member != local_member) {
      assigned_by_slot_[slot] = nodes_.at(assignments[slot].member);
      assigned_by_incarnation_[assignments[slot].member] = assigned_by_slot_[slot].get();
    }
  }
  for (const auto& node : old) {
    if (node != nullptr && assigned_by_incarnation_.count(node->incarnation) == 0) {
      node->broken |= server.is_broken(node->slot);
      dismiss(*node);
    }
  }
  const auto is_new = [](const auto& node) { return node != nullptr && !node->assigned; };
  if (published_map_epoch_ != map.epoch() && std::any_of(assigned_by_slot_.begin(), assigned_by_slot_.end(), is_new)) {
    write_pieces(pieces_.get(), world_, PieceKind::regions, 0, map.epoch(), std::as_bytes(map.table()));
    published_map_epoch_ = map.epoch();
  }
  for (std::size_t slot = 0; slot < assignments.size(); ++slot) {
    Node* node = assigned_by_slot_[slot].get();
    if (node == nullptr) {
      continue;
    }
    node->slot = static_cast<NodeNumber>(slot);
    node->id = assignments[slot].id;
    node->server = assignments[slot].server;
    node->peers.clear();
    for (std::size_t peer = 0; peer < assignments[slot].peers.size(); ++peer) {
      if (assignments[slot].peers[peer].out != nullptr) {
        node->peers.emplace_back(static_cast<NodeNumber>(peer), assignments[slot].peers[peer]);
      }
    }
    const AssignmentRecord record{node->slot,
                                  static_cast<std::uint32_t>(assignments.size()),
                                  assignments[slot].objects,
                                  assignments[slot].pairs,
                                  map.epoch(),
                                  map.nodes(),
                                  static_cast<std::uint32_t>(map.table().size()),
                                  0};
    note_assignment(*node);
    node->parcel_channel->set_shapes(shapes_);
    node->parcel_channel->enqueue(ParcelKind::assign, pack_assignment(record, peers_of(slot)));
    node->parcel_channel->flush();
  }
  losses_ = true;  // nodes may have gone meanwhile
}

void ClusterNodes::note_assignment(Node& node) {
  if (std::exchange(node.assigned, true)) {
    return;
  }
  node.assigned_ns = node.last_parcel_ns = telemetry::now_ns();
  ++totals_.joined;
  log(LogLevel::info, "node " + node.name + " joins as CD node " + std::to_string(node.id));
}

// The nodes that the node in that slot reaches by links.
std::vector<PeerRecord> ClusterNodes::peers_of(std::size_t slot) {
  std::vector<PeerRecord> peers(assigned_by_slot_.size());
  for (std::size_t peer = 0; peer < peers.size(); ++peer) {
    if (peer != slot && assigned_by_slot_[peer] != nullptr) {
      peers[peer] = {assigned_by_slot_[peer]->incarnation, address_of(assigned_by_slot_[peer]->incarnation)};
    }
  }
  return peers;
}

void ClusterNodes::close() noexcept {
  try {
    const std::lock_guard lock(mutex_);
    server_bell_.store(nullptr, std::memory_order_release);
    assigned_by_slot_.clear();
    assigned_by_incarnation_.clear();
    TermsSample sample{};
    sample.world = world_;
    dds_dispose(terms_.get(), &sample);
    dds_wait_for_acks(terms_.get(), DDS_MSECS(200));
    terms_.reset();
  } catch (...) {
    // The nodes detect by themselves that the World is gone.
  }
}

}  // namespace ringfence::dds
