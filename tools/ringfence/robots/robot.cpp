#include "robots/robot.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "gateway/protocol/client_messages.hpp"
#include "motion/random.hpp"
#include "motion/walk.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::tools {
namespace {

namespace net = gateway::net;

constexpr std::uint32_t way_stream = 401;
constexpr double way_s = 2;            // a robot keeps its direction for this time
constexpr double acknowledge_s = 0.5;  // without an input, acknowledgements are sent this often
constexpr std::size_t max_effect_frames = 64;

std::uint16_t clock_ms() noexcept { return static_cast<std::uint16_t>(telemetry::now_ns() / 1'000'000u); }

}  // namespace

Robot::Robot(std::uint32_t number, const RobotConfig& config, RobotBoard& board, RobotViolations& violations,
             RobotFigures& figures)
    : number_(number), config_(config), board_(board), violations_(violations), figures_(figures) {}

void Robot::connect(net::io_context& io, const gateway::GatewayUrl& url, net::ssl::context* tls,
                    const std::string& token) {
  token_ = token;
  gateway::WebClient::Handlers handlers;
  handlers.opened = [this] {
    std::vector<std::byte> hello;
    write(gateway::Hello{token_}, hello);
    client_->send(std::move(hello));
  };
  handlers.message = [this](std::span<const std::byte> message) { take(message); };
  handlers.closed = [this](std::uint16_t code, const std::string& reason) {
    is_closed_ = true;
    if (!is_closing_) {
      violations_.add(RobotViolations::lost_connection, fmt::format("robot {}: code {}, {}", number_, code, reason));
    }
  };
  client_ = gateway::WebClient::connect(io, url, "/play", tls, std::move(handlers));
}

void Robot::close() {
  is_closing_ = true;
  if (client_ && !is_closed_) client_->close();
}

void Robot::fail(const std::string& what) {
  violations_.add(RobotViolations::invalid_message, fmt::format("robot {}: {}", number_, what));
}

void Robot::take(std::span<const std::byte> message) {
  const auto type = gateway::type_of(message);
  if (!type) return fail("a message of an unknown type");
  figures_.bytes += message.size();
  switch (*type) {
    case gateway::ServerMessageType::welcome:
      return take_welcome(message);
    case gateway::ServerMessageType::update:
      return take_update(message);
    case gateway::ServerMessageType::shape:
      return take_shape(message);
    default:
      break;
  }
}

void Robot::take_welcome(std::span<const std::byte> message) {
  gateway::Welcome welcome;
  if (is_welcomed_ || !read(message, welcome)) return fail("an invalid or second welcome");
  is_welcomed_ = true;
  ++figures_.connected;
  rate_ = welcome.rate;
  board_.set_interest(static_cast<double>(welcome.interest));
}

void Robot::take_update(std::span<const std::byte> message) {
  if (!is_welcomed_ || !read(message, update_)) return fail("an invalid update, or one before the welcome");
  const std::uint64_t before = replica_.acknowledgement();
  switch (replica_.apply(update_)) {
    case gateway::Replica::Outcome::ignored:
      ++figures_.ignored;
      return;
    case gateway::Replica::Outcome::invalid:
      fail(fmt::format("the update of frame {} moves an object that it did not show", update_.frame));
      break;
    case gateway::Replica::Outcome::applied:
      break;
  }
  ++figures_.updates;
  figures_.objects += replica_.objects().size();
  if (update_.since == 0) ++figures_.complete;
  if (before != 0) figures_.skipped += replica_.acknowledgement() - before - 1;
  measure(update_);
  board_.add(replica_);
  if (!board_.has_avatar()) ask_for_shapes();
  answer();
}

void Robot::measure(const gateway::Update& update) {
  if (update.sequence > measured_ && update.sequence == sequence_) {
    const std::uint64_t effect = update.frame + 1 - update.age;
    const std::uint64_t frames = std::min<std::uint64_t>(effect - std::min(effect, sent_at_), max_effect_frames - 1);
    figures_.effect_frames.resize(max_effect_frames);
    ++figures_.effect_frames[frames];
    measured_ = update.sequence;
  }
  if (update.echo != echoed_ && update.sequence != 0) {
    echoed_ = update.echo;
    const auto trip = static_cast<std::uint16_t>(clock_ms() - update.echo);
    figures_.round_trip_ms.push_back(std::max(0.0, static_cast<double>(trip) - static_cast<double>(update.hold_ms)));
  }
}

void Robot::answer() {
  const std::uint64_t frame = replica_.acknowledgement();
  const auto epoch = (frame + number_ * 7ull) /
                     std::max<std::uint64_t>(1, static_cast<std::uint64_t>(way_s * static_cast<double>(rate_)));
  std::vector<std::byte> message;
  if (config_.sends_on_change && epoch == epoch_ && sequence_ != 0) {
    const auto every =
        std::max<std::uint64_t>(1, static_cast<std::uint64_t>(acknowledge_s * static_cast<double>(rate_)));
    if (frame < answered_ + every) return;
    write(gateway::Ack{frame}, message);
  } else {
    epoch_ = epoch;
    motion::Draws draws(config_.seed, way_stream, number_, static_cast<std::uint32_t>(epoch));
    motion::WalkInput wish;
    wish.x = static_cast<std::int8_t>(draws.between(-127, 127));
    wish.y = static_cast<std::int8_t>(draws.between(-127, 127));
    wish.heading = static_cast<std::uint16_t>(draws.word());
    wish.runs = (draws.word() & 1) != 0;
    const auto body = wish.bytes();
    sent_at_ = frame;
    write(gateway::Input{frame, ++sequence_, clock_ms(), body}, message);
  }
  answered_ = frame;
  client_->send(std::move(message));
}

void Robot::ask_for_shapes() {
  for (const auto& [number, object] : replica_.objects()) {
    if (object.category != Category::avatar || !asked_.insert(object.shape).second) continue;
    avatar_shape_ = object.shape;
    std::vector<std::byte> message;
    write(gateway::GetShape{object.shape}, message);
    client_->send(std::move(message));
  }
}

void Robot::take_shape(std::span<const std::byte> message) {
  ShapeId shape;
  std::optional<ShapeDescription> description;
  if (!gateway::read_shape(message, shape, description)) return fail("an invalid shape");
  if (description && shape == avatar_shape_ && !board_.has_avatar()) board_.set_avatar(*description);
}

}  // namespace ringfence::tools
