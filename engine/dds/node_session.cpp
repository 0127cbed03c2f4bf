#include "dds/node_session.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "dds/release.hpp"
#include "regions/region_map.hpp"
#include "ringfence/error.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::dds {

using nodes::Step;

namespace {

constexpr std::size_t ring_bytes = std::size_t{1} << 16;

/// A node without a link announces itself again after this time.
constexpr double announcement_period_ms = 500;

/// TCP ports for the links of a node: the upper half of the ports of a DDS domain, of which DDS uses UDP only.
constexpr std::uint32_t first_link_port(std::uint32_t domain) noexcept { return 7400 + 250 * domain + 125; }
constexpr std::uint32_t last_link_port(std::uint32_t domain) noexcept { return 7400 + 250 * domain + 249; }

/// Whether a message comes from a CD node: one in the process of the World, which has no link.
bool is_from_node(std::span<const std::byte> message) noexcept {
  return message.size() >= sizeof(messages::Header) &&
         messages::Endpoint{read_once<messages::Header>(message).source}.is_node();
}

Vec3d corner(const double (&values)[3]) noexcept { return {values[0], values[1], values[2]}; }

}  // namespace

JoinedWorld::JoinedWorld(std::uint64_t number, const WorldTermsRecord& terms, const NodeServiceConfig& config)
    : number_(number),
      terms_(terms),
      config_(config),
      space_(corner(terms.bounds_min), corner(terms.bounds_max), geometry::Outside::has_octaves) {
  if (terms.setup_bytes == 0) {
    make_model({});
  }
}

void JoinedWorld::make_model(std::span<const std::byte> setup) {
  model_ = config_.model ? config_.model(setup) : nullptr;
  const std::size_t state = model_ == nullptr ? 0 : model_->state_bytes();
  if (state != terms_.state_bytes || (model_ != nullptr) != (terms_.has_model != 0)) {
    throw Error("the World's motion model keeps " + std::to_string(terms_.state_bytes) +
                " bytes per object, this node's " + std::to_string(state) +
                ": give the node the same model (NodeServiceConfig::model)");
  }
  ready_ = true;
}

void JoinedWorld::add(const PieceSample& piece) {
  if (static_cast<PieceKind>(piece.kind) == PieceKind::shape && piece.number < shapes_.size()) {
    if (piece.epoch == removed_shape_epoch) {
      remove_shape(piece.number);
    }
    return;
  }
  assembler_.add(piece);
  if (!ready_ && terms_.setup_bytes != 0) {
    if (const auto* setup = assembler_.find(PieceKind::setup, 0, 0)) {
      if (setup->size() != terms_.setup_bytes) {
        throw Error("the World's setup has " + std::to_string(setup->size()) + " bytes; its terms state " +
                    std::to_string(terms_.setup_bytes));
      }
      make_model(*setup);
    }
  }
  for (;;) {
    const auto number = static_cast<ShapeNumber>(shapes_.size());
    const auto* bytes = assembler_.find(PieceKind::shape, number, 0);
    if (bytes != nullptr) {
      shapes_.add(unpack_shape(*bytes, number, config_.support));
    } else if (assembler_.find(PieceKind::shape, number, removed_shape_epoch) != nullptr) {
      shapes_.add(Sphere{1});  // takes the number
      remove_shape(number);
    } else {
      return;
    }
    assembler_.drop(PieceKind::shape, number);
  }
}

// The World has completed the frame in which the last object with the shape ended, and so has this node.
void JoinedWorld::remove_shape(ShapeNumber shape) {
  if (shapes_.has(shape)) {
    shapes_.remove(shape);
    shapes_.free_removed();
  }
}

NodeSession::NodeSession(const Domain& domain, JoinedWorld& world, dds_entity_t presence, Entity listener_writer,
                         const std::string& name, NodeTotals& totals)
    : world_(world),
      totals_(totals),
      incarnation_(random_incarnation()),
      name_(name),
      presence_(presence),
      listener_(std::move(listener_writer)),
      links_(incarnation_, world.number(), first_link_port(domain.number()), last_link_port(domain.number())),
      channel_(ring_bytes, nullptr, nullptr),
      from_peers_(ring_bytes, nullptr, nullptr) {
  watch_peers(true);
  const ListenerSample listener{incarnation_, links_.port()};
  dds_write(listener_.get(), &listener);
  publish_state(NodeState::joining);
}

NodeSession::~NodeSession() {
  PresenceSample sample{};
  sample.incarnation = incarnation_;
  dds_dispose(presence_, &sample);
  totals_.set_serves(false);
}

void write_presence(dds_entity_t writer, std::uint64_t incarnation, std::uint64_t world, const std::string& name,
                    NodeState state, const std::string& reason) {
  std::string own_name = name;
  std::string own_reason = reason;
  PresenceSample sample{incarnation,     wire_version,     {}, fingerprint(), static_cast<std::uint32_t>(state), world,
                        own_name.data(), own_reason.data()};
  write_byte_order(sample.order);
  dds_write(writer, &sample);
}

void NodeSession::publish_state(NodeState state) {
  state_ = state;
  announced_ns_ = telemetry::now_ns();
  write_presence(presence_, incarnation_, world_.number(), name_, state, own_release());
}

void NodeSession::announce_when_ready() {
  if (state_ == NodeState::joining && channel_to_world_ && world_.is_ready()) {
    publish_state(NodeState::ready);
  }
}

void NodeSession::query_assignment() {
  query_ns_ = telemetry::now_ns();
  channel_to_world_->enqueue(ParcelKind::assignment_query, {});
  channel_to_world_->flush();
}

bool NodeSession::leave() {
  if (role_ == nullptr) {
    return true;
  }
  if (state_ != NodeState::leaving) {
    publish_state(NodeState::leaving);
  }
  return false;
}

bool NodeSession::take_events() {
  return events_.take([this](std::uint64_t tag) {
    if (tag == world_.number()) {
      channel_to_world_->note_events();
    } else {
      links_.take_events();
    }
  });
}

bool NodeSession::has_news() const noexcept {
  return (channel_to_world_ && channel_to_world_->has_news()) || (awaits_peers() && links_.has_news());
}

bool NodeSession::has_work() { return has_news() || take_events() || !arm(); }

bool NodeSession::arm() noexcept {
  armed_ = true;
  const bool is_idle = !channel_to_world_ || channel_to_world_->arm();
  return links_.arm(awaits_peers()) && is_idle;
}

void NodeSession::disarm() noexcept {
  if (std::exchange(armed_, false)) {
    links_.disarm();
    if (channel_to_world_) {
      channel_to_world_->disarm();
    }
  }
}

bool NodeSession::step() {
  disarm();
  if (!channel_to_world_) {
    accept_world();
    return false;
  }
  bool progressed = receive_parcels();
  if (role_ == nullptr || over_) {
    return progressed;
  }
  progressed |= role_->step() == Step::progressed;
  check_messages();
  count_frame();
  send_model_failures();
  if (awaits_peers()) {
    progressed |= receive_from_peers();
  }
  const std::uint64_t before = channel_to_world_->sent();
  send();
  watch_peers(awaits_peers() || links_.has_unsent());
  return progressed || channel_to_world_->sent() != before;
}

// The World opens the link when it knows where this node listens.
void NodeSession::accept_world() {
  links_.receive([](NodeNumber, std::span<const std::byte>) { return false; });
  if (std::optional<LinkStream> link = links_.take_world_link()) {
    channel_to_world_.emplace(std::move(*link));
    channel_to_world_->report_to(events_, world_.number());
    watch_peers(false);
    announce_when_ready();
  } else {
    announce_again();
  }
}

// If the lease of the announcement expires before the World has opened a link, for example because one of the two
// processes stalls, the World forgets this node. Only a new sample shows that the node is alive.
void NodeSession::announce_again() {
  if (telemetry::to_ms(telemetry::now_ns() - announced_ns_) > announcement_period_ms) {
    publish_state(state_);
  }
}

bool NodeSession::receive_parcels() {
  auto deliver_one = [this](ParcelKind kind, std::uint32_t shapes, std::size_t& offset,
                            std::span<const std::byte> bytes) { return deliver(kind, shapes, offset, bytes); };
  const std::uint64_t before = received();
  const bool progressed = channel_to_world_->receive(deliver_one);
  if (received() != before) {
    query_ns_ = 0;
  }
  const bool is_unanswered =
      query_ns_ != 0 && telemetry::to_ms(telemetry::now_ns() - query_ns_) > world_.terms().lease_ms;
  over_ |= channel_to_world_->is_broken() || is_unanswered;
  return progressed;
}

// Messages of other nodes are read only when the role awaits them, so they do not wake a node that waits for the World.
// The link of the World comes like those of other nodes.
bool NodeSession::awaits_peers() const noexcept {
  return role_ != nullptr ? role_->awaits_peers() : !channel_to_world_;
}

void NodeSession::watch_peers(bool watched) {
  if (std::exchange(peers_watched_, watched) == watched) {
    return;
  }
  if (watched) {
    events_.include(links_.events(), 0);
  } else {
    events_.exclude(links_.events());
  }
}

void NodeSession::count_frame() {
  if (role_->is_between_frames() && std::exchange(counted_frames_, role_->frames()) != role_->frames()) {
    totals_.add_frame(role_->last_frame());
  }
}

// Between frames the last message of the frame is written, but not sent: the failures go before it.
void NodeSession::send_model_failures() {
  const nodes::Host& host = role_->host();
  if (!role_->is_between_frames() || host.failures().span().empty() ||
      std::exchange(failures_frame_, host.frame()) == host.frame()) {
    return;
  }
  for (const ModelFailure& failure : host.failures().span()) {
    ModelFailureRecord record{failure.object.value};
    std::copy_n(failure.text.begin(), std::min(failure.text.size(), sizeof record.text), record.text);
    channel_to_world_->enqueue(ParcelKind::model_failed, std::as_bytes(std::span(&record, 1)));
  }
}

// Sends what the role has written: messages for other node processes over the links, all others to the World.
void NodeSession::send() {
  link::Receiver& written = *channel_.first().in;
  bool any = false;
  while (channel_to_world_->has_room()) {
    const std::span<const std::byte> message = written.next();
    if (message.empty()) {
      break;
    }
    any = true;
    messages::Header header;
    std::memcpy(&header, message.data(), sizeof header);
    const messages::Endpoint to{header.destination};
    if (to.is_node() && links_.reaches(to.number())) {
      links_.add(to.number(), message);
    } else {
      channel_to_world_->add(message);
    }
  }
  if (any) {
    written.release();
  }
  links_.flush();
  report_failed_peers();
  channel_to_world_->flush();
}

bool NodeSession::receive_from_peers() {
  const bool any = links_.receive(
      [this](NodeNumber slot, std::span<const std::byte> message) { return deliver_from_peer(slot, message); });
  from_peers_.sender().publish();
  return any;
}

void NodeSession::report_failed_peers() {
  links_.take_failures([this](const PeerRecord& peer) {
    const PeerFailureRecord failure{peer.incarnation};
    channel_to_world_->enqueue(ParcelKind::peer_failed, std::as_bytes(std::span(&failure, 1)));
  });
}

// The World decides who is lost if a node sends invalid messages to another.
bool NodeSession::deliver_from_peer(NodeNumber slot, std::span<const std::byte> message) {
  return copy_to_ring(message, from_peers_.sender(), [&](std::span<const std::byte> copy) {
    const bool is_valid = is_from_peer(slot, copy);
    if (!is_valid) {
      links_.fail(slot);
    }
    return is_valid;
  });
}

bool NodeSession::is_from_peer(NodeNumber slot, std::span<const std::byte> message) const noexcept {
  messages::MessageView view;
  nodes::MessageLimits limits = limits_;
  limits.shapes = static_cast<std::uint32_t>(world_.shapes().size());
  return messages::decode(message, role_->host().state_bytes(), view) == Status::ok &&
         view.header().source == messages::Endpoint::node(slot).value &&
         view.header().destination == messages::Endpoint::node(slot_).value && nodes::is_between_nodes(view.type()) &&
         nodes::is_valid(view, limits);
}

bool NodeSession::deliver(ParcelKind kind, std::uint32_t shapes, std::size_t& offset,
                          std::span<const std::byte> bytes) {
  if (world_.shapes().size() < shapes) {
    return false;  // the shapes are on their way
  }
  if (kind == ParcelKind::messages) {
    const bool all = for_each_message(bytes, offset, [&](std::span<const std::byte> message) {
      return role_ == nullptr ||
             copy_to_ring(message, is_from_node(message) ? from_peers_.sender() : *channel_.first().out);
    });
    channel_.first().out->publish();
    from_peers_.sender().publish();
    return all;
  }
  over_ |= kind == ParcelKind::dismissed;
  return kind != ParcelKind::assign || assign(unpack_assignment(bytes, world_.terms()));
}

void NodeSession::check_messages() const {
  if (role_->invalid_messages() != 0) {
    throw Error("the World sent a message that breaks the protocol");
  }
}

// Called between frames: the role is idle and its rings are empty.
bool NodeSession::assign(const Assignment& assignment) {
  const AssignmentRecord& record = assignment.record;
  if (role_ == nullptr) {
    if (!make_role(record)) {
      return false;
    }
  } else {
    while (role_->step() == Step::progressed) {
    }
    check_messages();
    if (!role_->is_between_frames()) {
      throw Error("the World assigned the node again within a frame");
    }
  }
  slot_ = record.number;
  limits_.nodes = record.count;
  links_.assign(assignment.peers);
  std::vector<nodes::Connection> connections(record.count,
                                             nodes::Connection{channel_.second().out, &from_peers_.receiver()});
  connections[record.number] = {};
  role_->assign(record.number, connections);
  return true;
}

// Returns false if the region map has not arrived yet.
bool NodeSession::make_role(const AssignmentRecord& record) {
  const auto* table = world_.regions(record.epoch);
  if (table == nullptr || table->size() != std::size_t{record.map_words} * sizeof(std::uint32_t)) {
    return false;
  }
  const WorldTermsRecord& terms = world_.terms();
  nodes::CdNodeSetup setup;
  setup.node = record.number;
  setup.shapes = &world_.shapes();
  setup.space = &world_.space();
  setup.model = world_.model();
  setup.sense = terms.sense;
  setup.placement = static_cast<Placement>(terms.placement);
  std::copy(std::begin(terms.layer_masks), std::end(terms.layer_masks), setup.layer_masks.begin());
  setup.hosts = terms.hosts != 0;
  setup.keep_resting = terms.keep_resting != 0;
  setup.remember_axes = terms.remember_axes != 0;
  setup.objects = record.objects;
  setup.pairs = record.pairs;
  setup.server = channel_.second();
  // A removed object keeps its slot for one frame, so there may be twice as many slots as objects.
  setup.max_slots =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(2 * std::uint64_t{terms.max_objects}, 0xffffffffu));
  limits_.slots = setup.max_slots;
  role_ = std::make_unique<nodes::CdNodeRole>(setup, unpack_regions(*table, terms, record));
  totals_.set_serves(true);
  return true;
}

}  // namespace ringfence::dds
