#include "robots/robots.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "exit_code.hpp"
#include "gateway/edge/admission.hpp"
#include "option_checks.hpp"
#include "option_groups.hpp"
#include "output_file.hpp"
#include "robots/robot.hpp"
#include "run_options.hpp"
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

/// The value that a share of the sorted values does not exceed.
double quantile(std::vector<double>& values, double share) {
  if (values.empty()) return 0;
  const auto index = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(index));
  return values[index];
}

std::uint64_t effect_quantile(const std::vector<std::uint32_t>& counts, double share) {
  std::uint64_t total = 0, seen = 0;
  for (const std::uint32_t count : counts) total += count;
  for (std::size_t frames = 0; frames < counts.size(); ++frames) {
    seen += counts[frames];
    if (total > 0 && static_cast<double>(seen) >= share * static_cast<double>(total)) return frames;
  }
  return 0;
}

class RobotRun {
 public:
  explicit RobotRun(const RobotsOptions& options) : options_(options), board_(violations_) {
    config_.seed = options.seed;
    config_.sends_on_change = options.inputs == "change";
    url_ = gateway::GatewayUrl::parse(options.url);
    if (url_.uses_tls) prepare_tls();
    if (!options.token_key.empty()) key_ = read_token_key(options.token_key);
  }

  int run() {
    raise_file_limit(options_.clients + 64);
    const StopSignals stop;
    connect_all(stop);
    const double begin_s = now_s(), begin_cpu_s = process_cpu_s();
    const RobotFigures before = figures_;
    while (now_s() - begin_s < options_.seconds && !stop.received()) step(0.1);
    seconds_ = now_s() - begin_s;
    cpu_s_ = process_cpu_s() - begin_cpu_s;
    updates_ = figures_.updates - before.updates;
    bytes_ = figures_.bytes - before.bytes;
    objects_ = figures_.objects - before.objects;
    for (const auto& robot : robots_) robot->close();
    for (int i = 0; i < 20 && !all_closed(); ++i) step(0.1);
    board_.finish();
    report();
    return violations_.any() ? check_failed : done;
  }

 private:
  static double now_s() noexcept { return static_cast<double>(telemetry::now_ns()) * 1e-9; }

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
      auto robot = std::make_unique<Robot>(number, config_, board_, violations_, figures_);
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

  void report() {
    const double clients = static_cast<double>(std::max<std::uint64_t>(1, figures_.connected));
    const double updates = static_cast<double>(std::max<std::uint64_t>(1, updates_));
    const double kbit_s = static_cast<double>(bytes_) * 8e-3 / clients / seconds_;
    const double trip_p50 = quantile(figures_.round_trip_ms, 0.5), trip_p99 = quantile(figures_.round_trip_ms, 0.99);
    const std::uint64_t effect_p50 = effect_quantile(figures_.effect_frames, 0.5),
                        effect_p99 = effect_quantile(figures_.effect_frames, 0.99);
    if (!options_.json.empty()) {
      nlohmann::json violations;
      for (std::uint8_t kind = 0; kind < RobotViolations::kind_count; ++kind) {
        const auto each = static_cast<RobotViolations::Kind>(kind);
        violations[RobotViolations::name_of(each)] = violations_.count(each);
      }
      OutputFile file(options_.json);
      const nlohmann::json json{{"clients", options_.clients},
                                {"connected", figures_.connected},
                                {"seconds", seconds_},
                                {"updates", updates_},
                                {"updates_per_client_and_second", updates / clients / seconds_},
                                {"kbit_s_per_client", kbit_s},
                                {"objects_near", static_cast<double>(objects_) / updates},
                                {"complete_updates", figures_.complete},
                                {"skipped_frames", figures_.skipped},
                                {"ignored_updates", figures_.ignored},
                                {"effect_frames", {{"p50", effect_p50}, {"p99", effect_p99}}},
                                {"round_trip_ms", {{"p50", trip_p50}, {"p99", trip_p99}}},
                                {"checked_pairs", board_.checked_pairs()},
                                {"checked_contacts", board_.checked_contacts()},
                                {"cpu_us_per_update", cpu_s_ * 1e6 / updates},
                                {"violations", violations}};
      file.write(json.dump(2) + "\n");
      file.close();
    }
    fmt::print("{} of {} robots connected; {:.1f} s\n", figures_.connected, options_.clients, seconds_);
    fmt::print("each: {:.1f} updates/s, {:.1f} kbit/s, {:.1f} objects near; {:.1f} us of CPU an update\n",
               updates / clients / seconds_, kbit_s, static_cast<double>(objects_) / updates, cpu_s_ * 1e6 / updates);
    fmt::print("input to effect: p50 {}, p99 {} frames; round trip: p50 {:.0f}, p99 {:.0f} ms\n", effect_p50,
               effect_p99, trip_p50, trip_p99);
    fmt::print("{} frames without an update, {} updates too late\n", figures_.skipped, figures_.ignored);
    fmt::print("checked {} pairs of avatars, {} near enough to touch\n", board_.checked_pairs(),
               board_.checked_contacts());
    for (std::uint8_t kind = 0; kind < RobotViolations::kind_count; ++kind) {
      const auto each = static_cast<RobotViolations::Kind>(kind);
      if (violations_.count(each) == 0) continue;
      fmt::print("FAILED: {}: {}, the first: {}\n", RobotViolations::name_of(each), violations_.count(each),
                 violations_.example(each));
    }
  }

  const RobotsOptions& options_;
  RobotConfig config_;
  gateway::GatewayUrl url_;
  std::string key_;
  std::optional<net::ssl::context> tls_;
  RobotViolations violations_;
  RobotFigures figures_;
  RobotBoard board_;
  net::io_context io_{1};
  std::vector<std::unique_ptr<Robot>> robots_;
  double seconds_ = 0, cpu_s_ = 0;
  std::uint64_t updates_ = 0, bytes_ = 0, objects_ = 0;
};

}  // namespace

void add_robots(CLI::App& command, RobotsOptions& options) {
  command.option_defaults()->group(option_groups::clients);
  command.add_option("--url", options.url, "address of the gateway")->required()->type_name("URL");
  command.add_option("--clients", options.clients, "number of robots")
      ->check(between(1u, 60'000u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--seconds", options.seconds, "time for which they walk, after all are connected")
      ->check(between(0.1, 1e6))
      ->capture_default_str()
      ->type_name("S");
  command.add_option("--seed", options.seed, "seed of their ways")
      ->check(between(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()).description(""))
      ->capture_default_str()
      ->type_name("N");
  add_word(command, "--inputs", options.inputs, {"every", "change"}, "when they send inputs: every frame, or changes")
      ->default_str(options.inputs);
  command.add_option("--token-key", options.token_key, "key of serve --token-key; without it they are guests")
      ->type_name("FILE");
  command.add_option("--world", options.world, "name of the world")->capture_default_str()->type_name("NAME");
  command.add_option("--first-user", options.first_user, "user number of the first, with --token-key")
      ->check(between(0u, 65'535u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--authority", options.authority, "certificate that signed that of the gateway, PEM")
      ->type_name("FILE");
  command.option_defaults()->group(option_groups::output);
  command.add_option("--json", options.json, "write the results as JSON")->type_name("FILE");
}

int run_robots(const RobotsOptions& options) { return RobotRun(options).run(); }

}  // namespace ringfence::tools
