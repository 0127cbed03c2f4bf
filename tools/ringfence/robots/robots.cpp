#include "robots/robots.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <sys/resource.h>

#include "exit_code.hpp"
#include "gateway/edge/admission.hpp"
#include "robots/robot.hpp"
#include "robots/robot_report.hpp"
#include "serve/token_command.hpp"
#include "stop_signals.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::tools {
namespace {

namespace net = gateway::net;

constexpr std::int64_t token_margin_s = 3600;
constexpr std::size_t connects_at_once = 50;

/// Each connection is a file of the process.
void raise_file_limit(std::size_t files) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= files) return;
  limit.rlim_cur = std::min<rlim_t>(files, limit.rlim_max);
  setrlimit(RLIMIT_NOFILE, &limit);
  if (limit.rlim_cur < files) {
    throw Error(
        fmt::format("--clients: the system permits {} open files to a process; expected at least {} (ulimit -n)",
                    limit.rlim_cur, files));
  }
}

double process_cpu_s() noexcept {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

class RobotRun {
 public:
  explicit RobotRun(const RobotsOptions& options) : options_(options), board_(violations_) {
    config_.seed = options.seed;
    config_.sends_on_change = options.inputs == "change";
    config_.predicts = options.predicts;
    config_.from = options.from;
    url_ = gateway::GatewayUrl::parse(options.url);
    if (url_.uses_tls) prepare_tls();
    if (!options.token_key.empty()) key_ = read_token_key(options.token_key);
  }

  int run() {
    raise_file_limit(options_.clients + 64);
    const StopSignals stop;
    connect_all(stop);
    const double begin_s = telemetry::now_s(), begin_cpu_s = process_cpu_s();
    const RobotFigures before = figures_;
    while (telemetry::now_s() - begin_s < options_.seconds && !stop.received()) step(0.1);
    const RobotInterval interval{telemetry::now_s() - begin_s, process_cpu_s() - begin_cpu_s,
                                 figures_.updates - before.updates, figures_.bytes - before.bytes,
                                 figures_.objects - before.objects};
    for (const auto& robot : robots_) robot->close();
    for (int i = 0; i < 20 && !all_closed(); ++i) step(0.1);
    board_.finish();
    report_robots(options_, interval, figures_, board_, violations_);
    return violations_.any() ? check_failed : done;
  }

 private:
  void prepare_tls() {
    tls_.emplace(net::ssl::context::tls_client);
    if (options_.authority.empty()) {
      tls_->set_default_verify_paths();
    } else {
      tls_->load_verify_file(options_.authority);
    }
    tls_->set_verify_mode(net::ssl::verify_peer);
  }

  void step(double seconds) {
    io_.restart();
    io_.run_for(std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9)));
  }

  std::string token_of(std::uint32_t user) const {
    if (key_.empty()) return {};
    const std::int64_t expires = std::time(nullptr) + static_cast<std::int64_t>(options_.seconds) + token_margin_s;
    return gateway::sign_token({UserId(user), gateway::Role::play, options_.world, expires}, key_);
  }

  /// A few at a time, so that the listener's queue is not exceeded.
  void connect_all(const StopSignals& stop) {
    for (std::uint32_t number = 0; number < options_.clients && !stop.received(); ++number) {
      auto robot = std::make_unique<Robot>(number, config_, model_, board_, violations_, figures_);
      robot->connect(io_, url_, tls_ ? &*tls_ : nullptr, token_of(options_.first_user + number));
      robots_.push_back(std::move(robot));
      while (pending() >= connects_at_once && !stop.received()) step(0.002);
    }
    for (int i = 0; i < 100 && pending() > 0 && !stop.received(); ++i) step(0.1);
  }

  std::size_t pending() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(robots_, [](const auto& robot) { return !robot->is_welcomed() && !robot->is_closed(); }));
  }
  bool all_closed() const {
    return std::ranges::all_of(robots_, [](const auto& robot) { return robot->is_closed(); });
  }

  const RobotsOptions& options_;
  RobotConfig config_;
  gateway::GatewayUrl url_;
  std::string key_;
  std::optional<net::ssl::context> tls_;
  RobotModel model_;
  RobotViolations violations_;
  RobotFigures figures_;
  RobotBoard board_;
  net::io_context io_{1};
  std::vector<std::unique_ptr<Robot>> robots_;
};

}  // namespace

int run_robots(const RobotsOptions& options) { return RobotRun(options).run(); }

}  // namespace ringfence::tools
