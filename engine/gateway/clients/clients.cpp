#include "gateway/clients/clients.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::gateway {
namespace {

Stamp frames_in(double seconds, double rate) noexcept {
  return std::max<Stamp>(1, static_cast<Stamp>(std::llround(seconds * rate)));
}

constexpr double status_period_s = 1;
constexpr double spectator_period_s = 0.1;
/// Removed objects whose removal is not acknowledged are kept up to this number; then the client is sent everything.
constexpr std::size_t max_known = 16384;

}  // namespace

Clients::Clients(World& world, const GatewayConfig& config, Transport& transport, GuestToken guest_token)
    : world_(world),
      config_(config),
      transport_(transport),
      guest_token_(std::move(guest_token)),
      status_period_(frames_in(status_period_s, config.rate)),
      spectator_period_(frames_in(spectator_period_s, config.rate)),
      started_s_(telemetry::now_s()),
      roster_(world, config.hooks, frames_in(config.grace_s, config.rate)),
      table_(world),
      player_view_(world, table_, static_objects_),
      spectator_view_(world, table_),
      requests_(world, config.hooks),
      status_(world, config.contact_label) {}

void Clients::before_frame() {
  receive();
  roster_.expire(world_.frames());
  apply_inputs();
}

void Clients::receive() {
  transport_.receive(inbox_);
  const Stamp now = world_.frames();
  for (const Event& event : inbox_.events) {
    switch (event.kind) {
      case Event::Kind::opened:
        roster_.open(event.connection, event.identity, now, outbox_);
        break;
      case Event::Kind::message:
        // Messages of a connection that is being closed may still arrive.
        if (Client* const client = roster_.find(event.connection); client != nullptr) {
          requests_.handle(*client, inbox_.message(event), now, event.received_s, outbox_);
        }
        break;
      case Event::Kind::closed:
        roster_.close(event.connection, now);
        break;
    }
  }
}

void Clients::apply_inputs() {
  const Stamp next = world_.frames() + 1;
  for (const auto& client : roster_.clients()) {
    if (client->connection != 0 && client->role == Role::play) {
      // Refused if the avatar was destroyed, or beyond the quota of moves: then the input has no effect.
      static_cast<void>(client->input.apply(world_, client->user, client->avatar, next));
    }
  }
}

void Clients::after_frame() {
  const Stamp now = world_.frames();
  table_.begin_frame(now);
  look_at_world();
  status_.add_frame();
  for (const auto& client : roster_.clients()) {
    if (client->connection == 0) continue;
    if (!client->is_welcomed) send_welcome(*client);
    if (needs_status(*client)) send_status(*client);
    if (is_due(*client)) send_update(*client);
  }
  if (now % status_period_ == 0) status_.restart();
  transport_.send(outbox_);
}

bool Clients::is_due(const Client& client) const noexcept {
  return client.role == Role::play || world_.frames() % spectator_period_ == 0;
}

/// A new spectator needs what a contact means before its first update.
bool Clients::needs_status(const Client& client) const noexcept {
  if (client.role == Role::play) return false;
  return world_.frames() % status_period_ == 0 || client.status_nodes != world_.report().nodes.size();
}

/// All objects are read for spectators, and once a second to find static objects.
void Clients::look_at_world() {
  const Stamp now = world_.frames();
  bool has_new_player = false, has_spectator = false;
  for (const auto& client : roster_.clients()) {
    if (client->connection == 0) continue;
    has_new_player = has_new_player || (client->role == Role::play && !client->is_welcomed);
    has_spectator = has_spectator || (client->role != Role::play && is_due(*client));
  }
  const bool finds_static = now % status_period_ == 0 || has_new_player;
  if (!finds_static && !has_spectator) return;
  objects_ = world_.objects();
  if (finds_static) static_objects_.rebuild(objects_, world_, world_.config().interest);
}

void Clients::send_welcome(Client& client) {
  client.is_welcomed = true;
  const WorldConfig& config = world_.config();
  const std::string token = client.is_guest ? guest_token_(client.user) : std::string();
  Welcome welcome;
  welcome.role = client.role;
  welcome.user = client.user;
  welcome.avatar = client.avatar.number();
  welcome.frames = world_.frames();
  welcome.rate = static_cast<float>(config_.rate);
  welcome.interest = static_cast<float>(config.interest);
  welcome.bounds_min = config.bounds_min;
  welcome.bounds_max = config.bounds_max;
  welcome.world = config_.world;
  if (config.motion) welcome.model = config.motion->name();
  welcome.parameters = config_.model_parameters;
  welcome.token = token;
  const std::size_t offset = outbox_.bytes.size();
  write(welcome, outbox_.bytes);
  outbox_.messages.push_back({client.connection, Delivery::reliable, static_cast<std::uint32_t>(offset),
                              static_cast<std::uint32_t>(outbox_.bytes.size() - offset)});
}

void Clients::send_update(Client& client) {
  const Stamp now = world_.frames();
  if (client.known.size() > max_known && client.role == Role::play) {
    client.known.forget();
    client.acknowledged = 0;
    client.complete = now;
  }
  const double time_s = telemetry::now_s();
  update_.clear();
  update_.frame = now - 1;
  update_.since = client.acknowledged == 0 ? 0 : now - client.acknowledged;
  update_.time_us = static_cast<std::uint64_t>((time_s - started_s_) * 1e6);
  if (client.role == Role::play) {
    client.input.acknowledge(now, time_s, update_);
    player_view_.describe(client, now, update_);
  } else {
    spectator_view_.describe(client, objects_, now, update_);
  }
  add_metadata();
  const std::size_t offset = outbox_.bytes.size();
  write(update_, outbox_.bytes);
  outbox_.messages.push_back({client.connection, Delivery::newest, static_cast<std::uint32_t>(offset),
                              static_cast<std::uint32_t>(outbox_.bytes.size() - offset)});
  client.last_update = now;
  ++updates_;
}

void Clients::add_metadata() {
  if (!config_.hooks.metadata || update_.entered.empty()) return;
  // Spans into metadata_ are set when it no longer grows.
  metadata_.clear();
  std::vector<std::size_t> ends;
  for (const EnteredObject& object : update_.entered) {
    const std::size_t begin = metadata_.size();
    config_.hooks.metadata(object.number, metadata_);
    metadata_.resize(std::clamp(metadata_.size(), begin, begin + max_metadata_bytes));
    ends.push_back(metadata_.size());
  }
  std::size_t begin = 0;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    update_.entered[i].metadata = std::span(metadata_).subspan(begin, ends[i] - begin);
    begin = ends[i];
  }
}

void Clients::send_status(Client& client) {
  std::optional<std::uint64_t> digest;
  if (config_.hooks.digest) digest = config_.hooks.digest();
  const std::uint32_t epoch = world_.report().map_epoch;
  send_body(client.connection, ServerMessageType::status,
            status_.text(roster_.connected(), digest, client.map_epoch == epoch), outbox_);
  client.map_epoch = epoch;
  client.status_nodes = world_.report().nodes.size();
}

bool Clients::send(UserId user, std::span<const std::byte> bytes) {
  const Client* const client = roster_.find(user);
  if (client == nullptr || client->connection == 0 || bytes.size() > max_application_bytes) return false;
  send_body(client->connection, ServerMessageType::application, bytes, outbox_);
  return true;
}

void Clients::close_all(CloseCode code, const std::string& reason) {
  for (const auto& client : roster_.clients()) {
    if (client->connection != 0) outbox_.closes.push_back({client->connection, code, reason});
  }
  transport_.send(outbox_);
}

Clients::Counts Clients::counts() const noexcept {
  Counts counts;
  for (const auto& client : roster_.clients()) {
    if (client->connection == 0) {
      ++counts.away;
    } else {
      ++(client->role == Role::play ? counts.players : counts.spectators);
    }
  }
  return counts;
}

}  // namespace ringfence::gateway
