#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

#include "gateway/client/replica.hpp"
#include "gateway/client/web_client.hpp"
#include "robots/robot_board.hpp"

namespace ringfence::tools {

/// Figures of all robots of a process.
struct RobotFigures {
  std::uint64_t connected = 0;  ///< robots that were welcomed
  std::uint64_t updates = 0, bytes = 0;
  std::uint64_t complete = 0;                ///< updates with the whole state
  std::uint64_t skipped = 0;                 ///< frames without an update, between two updates
  std::uint64_t ignored = 0;                 ///< updates that came too late
  std::uint64_t objects = 0;                 ///< sum over the updates of the objects that are near
  std::vector<std::uint32_t> effect_frames;  ///< [n]: inputs that took effect n frames after they were sent
  std::vector<double>
      round_trip_ms;  ///< from an input to the first update that echoes it, without the time at the gateway
};

/// What all robots of a process share.
struct RobotConfig {
  std::uint64_t seed = 1;
  bool sends_on_change = false;  ///< an input only when it changes, otherwise one in each frame
};

/// A client that walks in random directions and checks what it receives.
class Robot {
 public:
  Robot(std::uint32_t number, const RobotConfig& config, RobotBoard& board, RobotViolations& violations,
        RobotFigures& figures);
  /// Connects. `token` may be empty.
  void connect(gateway::net::io_context& io, const gateway::GatewayUrl& url, gateway::net::ssl::context* tls,
               const std::string& token);
  /// Closes the connection; its end is not a violation.
  void close();
  bool is_welcomed() const noexcept { return is_welcomed_; }
  bool is_closed() const noexcept { return is_closed_; }

 private:
  void take(std::span<const std::byte> message);
  void take_welcome(std::span<const std::byte> message);
  void take_update(std::span<const std::byte> message);
  void take_shape(std::span<const std::byte> message);
  void measure(const gateway::Update& update);
  void answer();
  void ask_for_shapes();
  void fail(const std::string& what);

  std::uint32_t number_;
  const RobotConfig& config_;
  RobotBoard& board_;
  RobotViolations& violations_;
  RobotFigures& figures_;
  std::shared_ptr<gateway::WebClient> client_;
  std::string token_;
  gateway::Replica replica_;
  gateway::Update update_;
  std::unordered_set<ShapeId> asked_;
  ShapeId avatar_shape_;
  bool is_welcomed_ = false, is_closing_ = false, is_closed_ = false;
  float rate_ = 0;
  std::uint64_t sequence_ = 0;   ///< of the last input that was sent
  std::uint64_t sent_at_ = 0;    ///< acknowledgement number of the replica then
  std::uint64_t answered_ = 0;   ///< the last acknowledgement that was sent
  std::uint64_t measured_ = 0;   ///< sequence number of the last input whose effect was measured
  std::uint64_t epoch_ = ~0ull;  ///< of the direction
  std::uint16_t echoed_ = 0;
};

}  // namespace ringfence::tools
