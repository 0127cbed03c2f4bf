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

constexpr std::uint32_t robot_stream = 401;
constexpr double way_s = 2;            // a robot keeps its direction for this time
constexpr double acknowledge_s = 0.5;  // without an input, acknowledgements are sent this often
constexpr std::size_t max_effect_frames = 64;
constexpr std::size_t max_effect_ms = 10'000;
constexpr std::size_t max_sent = 256;  // of inputs that are waited for

std::uint16_t clock_ms() noexcept { return static_cast<std::uint16_t>(telemetry::now_ns() / 1'000'000u); }
/// Counts a value in a histogram whose last bin also has all larger values.
void count(std::vector<std::uint32_t>& bins, std::size_t value, std::size_t size) {
  bins.resize(size);
  ++bins[std::min(value, size - 1)];
}

}  // namespace

Robot::Robot(std::uint32_t number, const RobotConfig& config, RobotModel& model, RobotBoard& board,
             RobotViolations& violations, RobotFigures& figures)
    : number_(number), config_(config), model_(model), board_(board), violations_(violations), figures_(figures) {}

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
  client_ = gateway::WebClient::connect(io, url, "/play", tls, std::move(handlers), config_.from);
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
  if (config_.predicts) {
    model_.begin(welcome);
    prediction_.emplace(model_.walk(), model_.obstacles());
  }
}

void Robot::take_update(std::span<const std::byte> message) {
  if (!is_welcomed_) return;  // updates may overtake other messages
  if (!read(message, update_)) return fail("an invalid update");
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
  ask_for_shapes();
  if (prediction_) predict();
  answer();
}

void Robot::predict() {
  if (const std::optional<double> error = prediction_->reconcile(update_, replica_)) {
    figures_.prediction_m.push_back(*error);
  }
  const double time_s = static_cast<double>(update_.time_us) * 1e-6, now = telemetry::now_s();
  tracks_.add(update_, replica_);
  clock_.add(time_s, now);
  if (time_s < clock_.display(now)) ++figures_.late;
  figures_.display_ms.push_back(clock_.delay_s() * 1e3);
}

void Robot::measure(const gateway::Update& update) {
  // Inputs that a newer one replaced, or that were lost, never take effect.
  while (!sent_.empty() && sent_.front().sequence < update.sequence) sent_.pop_front();
  if (!sent_.empty() && sent_.front().sequence == update.sequence) {
    const SentInput& input = sent_.front();
    const std::uint64_t effect = update.frame + 1 - update.age;
    count(figures_.effect_frames, effect - std::min(effect, input.frame), max_effect_frames);
    count(figures_.effect_ms, static_cast<std::size_t>((telemetry::now_s() - input.time_s) * 1e4), max_effect_ms * 10);
    sent_.pop_front();
  }
  if (update.echo != echoed_ && update.sequence != 0) {
    echoed_ = update.echo;
    const auto trip = static_cast<std::uint16_t>(clock_ms() - update.echo);
    figures_.round_trip_ms.push_back(std::max(0.0, static_cast<double>(trip) - static_cast<double>(update.hold_ms)));
  }
}

void Robot::answer() {
  const std::uint64_t frame = replica_.acknowledgement();
  choose_input(frame);
  const auto body = wish_.bytes();
  if (prediction_) prediction_->tick(sequence_, body);
  const auto every = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(acknowledge_s * static_cast<double>(rate_)));
  std::vector<std::byte> message;
  if (update_.sequence < sequence_) {  // new, or perhaps lost
    write(gateway::Input{frame, sequence_, clock_ms(), body}, message);
  } else if (frame >= answered_ + every) {
    write(gateway::Ack{frame}, message);
  } else {
    return;
  }
  answered_ = frame;
  client_->send(std::move(message));
}

/// The direction changes from time to time. Unless inputs are sent on change only, each frame has another number.
void Robot::choose_input(std::uint64_t frame) {
  const auto epoch = (frame + number_ * 7ull) /
                     std::max<std::uint64_t>(1, static_cast<std::uint64_t>(way_s * static_cast<double>(rate_)));
  if (config_.sends_on_change && epoch == epoch_) return;
  epoch_ = epoch;
  motion::Draws draws(config_.seed, robot_stream, number_, static_cast<std::uint32_t>(epoch));
  wish_.x = static_cast<std::int8_t>(draws.between(-127, 127));
  wish_.y = static_cast<std::int8_t>(draws.between(-127, 127));
  wish_.heading = static_cast<std::uint16_t>(draws.word());
  wish_.runs = (draws.word() & 1) != 0;
  sent_.push_back({++sequence_, frame, telemetry::now_s()});
  if (sent_.size() > max_sent) sent_.pop_front();
}

void Robot::ask_for_shapes() {
  if (replica_.own() && (!board_.has_avatar() || prediction_)) ask(replica_.own()->shape);
  if (!prediction_) return;
  for (const gateway::EnteredObject& object : update_.entered) ask(object.shape);
}

void Robot::ask(ShapeId shape) {
  if (model_.obstacles().has(shape) || !asked_.insert(shape).second) return;
  std::vector<std::byte> message;
  write(gateway::GetShape{shape}, message);
  client_->send(std::move(message));
}

void Robot::take_shape(std::span<const std::byte> message) {
  ShapeId shape;
  std::optional<ShapeDescription> description;
  if (!gateway::read_shape(message, shape, description)) return fail("an invalid shape");
  if (!description) return;
  if (replica_.own() && shape == replica_.own()->shape && !board_.has_avatar()) board_.set_avatar(*description);
  if (prediction_) model_.obstacles().add(shape, *description);
}

}  // namespace ringfence::tools
