#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <utility>

#include <unistd.h>

#include "base/floating_point.hpp"
#include "dds/node_session.hpp"
#include "link/scoped_batch_scheduling.hpp"
#include "ringfence/cluster.hpp"
#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

using Clock = std::chrono::steady_clock;

// A World that is silent for longer than a lease may be busy, or the network may recover soon.
constexpr std::chrono::seconds world_timeout(3);

std::string own_name() {
  char host[256] = {};
  gethostname(host, sizeof host - 1);
  return std::string(host) + ":" + std::to_string(getpid());
}

}  // namespace

class NodeService::Implementation {
 public:
  explicit Implementation(NodeServiceConfig config)
      : config_(std::move(config)),
        // Two polls, then sleep: on a machine with more nodes than cores, another process needs this core.
        bell_(link::SpinPolicy{20, 2}),
        control_hook_{[this] { ring_control(); }, [this] { ring_control(); }},
        parcel_hook_{[this] {
                       parcels_wait_.store(true, std::memory_order_release);
                       bell_.ring();
                     },
                     [this] { ring_control(); }},
        domain_(config_.network, Side::node) {
    if (config_.name.empty()) {
      config_.name = own_name();
    }
    up_ = domain_.writer(Topic::up, parcel_qos, {});
    Domain::set_hook(up_, control_hook_);
    read_world();
    if (const std::string shortage = Domain::socket_buffer_shortage(config_.network); !shortage.empty()) {
      log(LogLevel::warning, shortage);
    }
  }

  ~Implementation() {
    session_.reset();
    terms_.reset();
    pieces_.reset();
    up_.reset();
  }

  ExitReason run() {
    const base::DefaultFloatingPoint floating_point;
    const link::ScopedBatchScheduling batch_scheduling;
    // A congested network rings no bell, so pending parcels are retried on a timer.
    constexpr std::chrono::milliseconds tick(20);
    log(LogLevel::info, "waits for a World in domain " + std::to_string(domain_.number()));
    while (!ending_) {
      bell_.wait_for([this] { return has_work(); }, tick);
      while (step() && !ending_) {
      }
    }
    session_.reset();
    return *ending_;
  }

  void drain() noexcept {
    drains_.fetch_add(1, std::memory_order_release);
    bell_.ring();
  }

 private:
  void log(LogLevel level, const std::string& line) const {
    if (config_.log) {
      config_.log(level, line);
    }
  }

  // New readers for each World: they receive again what another World published while this one was served.
  void read_world() {
    terms_ = domain_.reader(Topic::terms, liveliness_qos(config_.network.lease_ms), {});
    pieces_ = domain_.reader(Topic::piece, piece_qos, {});
    Domain::set_hook(terms_, control_hook_);
    Domain::set_hook(pieces_, control_hook_);
  }

  // Whether a step may find work; evaluated many times per frame.
  bool has_work() const noexcept {
    return parcels_wait_.load(std::memory_order_relaxed) || control_waits_.load(std::memory_order_relaxed) ||
           drains_.load(std::memory_order_relaxed) != drains_seen_;
  }

  // Called by the receiving threads.
  void ring_control() {
    control_waits_.store(true, std::memory_order_release);
    bell_.ring();
  }

  bool step() {
    if (ending_) {
      return true;
    }
    bool progressed = false;
    if (control_waits_.exchange(false, std::memory_order_acquire)) {
      read_announcements();
    }
    check_world();
    if (std::exchange(renew_readers_, false)) {
      read_world();
    }
    drains_seen_ = drains_.load(std::memory_order_acquire);
    if (drains_seen_ != 0) {
      leave();
    }
    if (session_ != nullptr) {
      const bool parcels = parcels_wait_.exchange(false, std::memory_order_acquire);
      parcels_arrived_ |= parcels;
      progressed = session_->step(parcels);
      for (const std::string& failure : world_->shapes().take_support_failures()) {
        log(LogLevel::warning, failure + "; pairs for which it fails have no contact");
      }
      if (session_->is_assigned() && !std::exchange(assignment_logged_, true)) {
        log(LogLevel::info, "is assigned and serves the World");
      }
      if (session_->is_over()) {
        end_session();
        progressed = true;
      }
    }
    return progressed;
  }

  void read_announcements() {
    take_all<TermsSample>(terms_, [&](const TermsSample& sample, const dds_sample_info_t& info) {
      if (info.instance_state == DDS_IST_NOT_ALIVE_DISPOSED && world_ != nullptr && sample.world == world_->number()) {
        forget_world(ExitReason::dismissed, "the World has ended");
      } else if (info.valid_data && info.instance_state == DDS_IST_ALIVE && world_ == nullptr) {
        join_world(sample);
      }
    });
    if (world_ == nullptr) {
      return;
    }
    try {
      take_all<PieceSample>(pieces_, [&](const PieceSample& piece, const dds_sample_info_t& info) {
        if (info.valid_data && piece.world == world_->number()) {
          world_->add(piece);
        }
      });
    } catch (const Error& error) {
      refuse(error.what());
      return;
    }
    if (session_ != nullptr) {
      dds_publication_matched_status_t matched{};
      dds_get_publication_matched_status(up_.get(), &matched);
      session_->announce_when_ready(matched.current_count > 0);
    }
  }

  void join_world(const TermsSample& sample) {
    std::uint8_t order[4];
    write_byte_order(order);
    WorldTermsRecord record;
    const auto bytes = bytes_of(sample.bytes);
    if (sample.version != wire_version || !std::equal(order, order + 4, sample.order) ||
        sample.layout != record_layout_hash() || bytes.size() != sizeof record) {
      log(LogLevel::error, "the World of domain " + std::to_string(domain_.number()) +
                               " has another version, byte order or record layout");
      ending_ = config_.once ? std::optional(ExitReason::refused) : ending_;
      return;
    }
    std::memcpy(&record, bytes.data(), sizeof record);
    domain_.start_heartbeat(record.lease_ms);
    presence_ = domain_.writer(Topic::presence, liveliness_qos(record.lease_ms), {});
    try {
      world_ = std::make_unique<JoinedWorld>(sample.world, record, config_);
    } catch (const Error& error) {
      log(LogLevel::error, error.what());
      ending_ = config_.once ? std::optional(ExitReason::refused) : ending_;
      return;
    }
    last_alive_ = Clock::now();
    begin_session();
  }

  void begin_session() {
    assignment_logged_ = false;
    session_ = std::make_unique<NodeSession>(domain_, *world_, presence_.get(), up_.get(), config_.name, parcel_hook_);
  }

  void end_session() {
    if (drains_.load(std::memory_order_acquire) != 0) {
      ending_ = ExitReason::drained;
    } else if (!is_world_silent()) {
      log(LogLevel::info, "is no longer assigned and joins again");
      begin_session();
    }
  }

  void refuse(const std::string& reason) {
    log(LogLevel::error, reason);
    session_->refuse(reason);
    if (config_.once) {
      dds_wait_for_acks(presence_.get(), DDS_MSECS(200));  // gives the World time to receive and log the reason
      ending_ = ExitReason::refused;
    }
  }

  void forget_world(ExitReason ending, const char* why) {
    log(LogLevel::info, why);
    session_.reset();
    presence_.reset();
    world_.reset();
    renew_readers_ = true;
    if (config_.once) {
      ending_ = drains_.load(std::memory_order_acquire) != 0 ? ExitReason::drained : ending;
    }
  }

  // After its lease has expired, DDS considers the World alive only after a new sample of its terms; parcels to this
  // node show it, too.
  bool is_world_silent() {
    if (std::exchange(parcels_arrived_, false)) {
      return false;
    }
    dds_liveliness_changed_status_t liveliness{};
    return dds_get_liveliness_changed_status(terms_.get(), &liveliness) != DDS_RETCODE_OK ||
           liveliness.alive_count == 0;
  }

  // Called with every step, so it queries DDS only every 10 ms, or while the World is silent.
  void check_world() {
    if (world_ == nullptr) {
      return;
    }
    const auto now = Clock::now();
    const bool interrupted =
        now - last_check_ > std::chrono::microseconds(static_cast<long>(world_->terms().lease_ms * 1e3));
    const bool due = silent_ || now - last_check_ > std::chrono::milliseconds(10);
    if (!due) {
      return;
    }
    const bool stopped = interrupted && last_check_ != Clock::time_point{};
    last_check_ = now;
    for (const std::string& line : Domain::take_log_lines()) {
      log(LogLevel::warning, line);
    }
    if (is_world_silent()) {
      silent_ = true;
      if (now - last_alive_ > world_timeout) {
        silent_ = false;
        forget_world(ExitReason::abandoned, "the World is gone");
      }
      return;
    }
    last_alive_ = now;
    if ((std::exchange(silent_, false) || stopped) && session_ != nullptr && session_->is_assigned()) {
      session_->query_assignment();
    }
    if (session_ != nullptr && session_->is_over()) {
      begin_session();
    }
  }

  void leave() {
    if (drains_seen_ > 1 || session_ == nullptr || session_->leave()) {
      ending_ = ExitReason::drained;
    }
  }

  NodeServiceConfig config_;
  link::Doorbell bell_;
  std::atomic<bool> control_waits_{false};
  std::atomic<bool> parcels_wait_{false};
  std::atomic<std::uint32_t> drains_{0};
  std::uint32_t drains_seen_ = 0;
  Domain::Hook control_hook_;
  Domain::Hook parcel_hook_;
  Domain domain_;
  Entity up_, terms_, pieces_, presence_;
  std::unique_ptr<JoinedWorld> world_;
  std::unique_ptr<NodeSession> session_;
  std::optional<ExitReason> ending_;
  Clock::time_point last_alive_{};
  Clock::time_point last_check_{};
  bool silent_ = false;
  bool parcels_arrived_ = false;  ///< a parcel has arrived since the last call of is_world_silent()
  bool renew_readers_ = false;
  bool assignment_logged_ = false;  ///< the session is assigned, and this was logged
};

NodeService::NodeService(NodeServiceConfig config)
    : implementation_(std::make_unique<Implementation>(std::move(config))) {}
NodeService::~NodeService() = default;

ExitReason NodeService::run() { return implementation_->run(); }
void NodeService::drain() noexcept { implementation_->drain(); }

}  // namespace ringfence::dds
