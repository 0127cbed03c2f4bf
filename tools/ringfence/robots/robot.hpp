#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

#include "gateway/client/interpolation.hpp"
#include "gateway/client/prediction.hpp"
#include "gateway/client/replica.hpp"
#include "gateway/client/web_client.hpp"
#include "motion/walk.hpp"
#include "robots/robot_board.hpp"
#include "robots/robot_figures.hpp"
#include "robots/robot_model.hpp"

namespace ringfence::tools {

/// What all robots of a process share.
struct RobotConfig {
  std::uint64_t seed = 1;
  bool sends_on_change = false;  ///< an input only when it changes, otherwise one in each frame
  bool predicts = false;         ///< their avatars, and interpolates others
  std::string from;              ///< IP address from which they connect; empty: the system chooses
};

/// A client that walks in random directions and checks what it receives.
class Robot {
 public:
  Robot(std::uint32_t number, const RobotConfig& config, RobotModel& model, RobotBoard& board,
        RobotViolations& violations, RobotFigures& figures);
  /// Connects. `token` may be empty.
  void connect(gateway::net::io_context& io, const gateway::GatewayUrl& url, gateway::net::ssl::context* tls,
               const std::string& token);
  /// Closes the connection; its end is not a violation.
  void close();
  bool is_welcomed() const noexcept { return is_welcomed_; }
  bool is_closed() const noexcept { return is_closed_; }

 private:
  struct SentInput {
    std::uint64_t sequence = 0;
    std::uint64_t frame = 0;  ///< acknowledgement number of the replica then
    double time_s = 0;        ///< of a steady clock
  };
  void take(std::span<const std::byte> message);
  void take_welcome(std::span<const std::byte> message);
  void take_update(std::span<const std::byte> message);
  void take_shape(std::span<const std::byte> message);
  void measure(const gateway::Update& update);
  void answer();
  void choose_input(std::uint64_t frame);
  void predict();
  void ask_for_shapes();
  void ask(ShapeId shape);
  void fail(const std::string& what);

  std::uint32_t number_;
  const RobotConfig& config_;
  RobotModel& model_;
  RobotBoard& board_;
  RobotViolations& violations_;
  RobotFigures& figures_;
  std::shared_ptr<gateway::WebClient> client_;
  std::string token_;
  gateway::Replica replica_;
  gateway::Update update_;
  std::optional<gateway::Prediction> prediction_;  ///< if it predicts, from the welcome on
  gateway::DisplayClock clock_;
  gateway::Tracks tracks_;
  std::unordered_set<ShapeId> asked_;
  bool is_welcomed_ = false, is_closing_ = false, is_closed_ = false;
  float rate_ = 0;
  std::uint64_t sequence_ = 0;   ///< of the last input that was sent
  std::deque<SentInput> sent_;   ///< whose effect was not measured yet
  std::uint64_t answered_ = 0;   ///< the last acknowledgement that was sent
  std::uint64_t epoch_ = ~0ull;  ///< of the direction
  motion::WalkInput wish_;       ///< the last input
  std::uint16_t echoed_ = 0;
};

}  // namespace ringfence::tools
