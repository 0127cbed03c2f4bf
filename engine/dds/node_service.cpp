#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include <unistd.h>

#include "base/floating_point.hpp"
#include "dds/announcement.hpp"
#include "dds/node_session.hpp"
#include "dds/release.hpp"
#include "link/scoped_batch_scheduling.hpp"
#include "ringfence/cluster.hpp"
#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

using Clock = std::chrono::steady_clock;

// A node leaves a World that is silent for this long. It waits longer than a lease, because the World may be busy, or
// the network may recover soon.
constexpr std::chrono::seconds world_timeout(3);

// A node asks a silent World for its terms again after this time.
constexpr std::chrono::milliseconds terms_period(500);

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
        control_hook_{[this] { ring_control(); }, [this] { ring_control(); }},
        domain_(config_.network, Side::node) {
    if (config_.name.empty()) {
      config_.name = own_name();
    }
    if (!bell_.prepare_to_watch()) {
      throw Error("the process cannot wait for links; raise the limit on open files (ulimit -n)");
    }
    read_terms();
    if (const std::string shortage = Domain::socket_buffer_shortage(config_.network); !shortage.empty()) {
      log(LogLevel::warning, shortage);
    }
  }

  ~Implementation() {
    session_.reset();
    refusals_.clear();
    terms_.reset();
    pieces_.reset();
  }

  ExitReason run() {
    const base::DefaultFloatingPoint floating_point;
    const link::ScopedBatchScheduling batch_scheduling;
    constexpr std::chrono::milliseconds tick(20);  // at which a silent World is noticed
    log(LogLevel::info, "waits for a World in domain " + std::to_string(domain_.number()));
    while (!ending_) {
      bell_.watch(session_ == nullptr ? -1 : session_->events_descriptor());
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

  NodeServiceReport report() const noexcept { return totals_.report(); }

 private:
  void log(LogLevel level, const std::string& line) const {
    if (config_.log) {
      config_.log(level, line);
    }
  }

  // Creates a new reader, at the start, after each World, and while the World is silent. It receives the terms of all
  // Worlds that are alive, including those that were published before.
  void read_terms() {
    terms_read_ = Clock::now();
    terms_ = domain_.reader(Topic::terms, liveliness_qos(config_.network.lease_ms), config_.network.world);
    Domain::set_hook(terms_, control_hook_);
  }

  // Whether a step may find work; evaluated many times per frame.
  bool has_work() noexcept {
    return control_waits_.load(std::memory_order_relaxed) || drains_.load(std::memory_order_relaxed) != drains_seen_ ||
           (session_ != nullptr && session_->has_work());
  }

  // Called by the receiving threads of Cyclone DDS.
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
    if (std::exchange(renew_terms_, false)) {
      read_terms();
    }
    drains_seen_ = drains_.load(std::memory_order_acquire);
    if (drains_seen_ != 0) {
      leave();
    }
    if (session_ != nullptr) {
      const std::uint64_t received = session_->received();
      try {
        progressed = session_->step();
      } catch (const std::exception& error) {
        refuse(world_->number(), error.what());
        return true;
      }
      parcels_arrived_ |= session_->received() != received;
      for (const std::string& failure : world_->shapes().take_support_failures()) {
        log(LogLevel::warning, failure + "; pairs for which it fails have no contact");
      }
      if (session_->is_assigned() && !std::exchange(assignment_logged_, true)) {
        log(LogLevel::info, "is assigned and serves the World");
      }
      progressed |= session_->is_over() && end_session();
    }
    return progressed;
  }

  void read_announcements() {
    take_all<TermsSample>(terms_, [&](const TermsSample& sample, const dds_sample_info_t& info) {
      const bool alive = info.instance_state == DDS_IST_ALIVE;
      if (world_ == nullptr) {
        if (info.valid_data && alive && !ending_) {
          join_world(sample);
        }
      } else if (sample.world == world_->number()) {
        world_is_alive_ = alive;
        if (info.instance_state == DDS_IST_NOT_ALIVE_DISPOSED) {
          forget_world(ExitReason::dismissed, "the World has ended");
        }
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
    } catch (const std::exception& error) {
      refuse(world_->number(), error.what());
      return;
    }
    if (session_ != nullptr) {
      session_->announce_when_ready();
    }
  }

  void join_world(const TermsSample& sample) {
    const auto is_of_world = [&](const Refusal& refusal) { return refusal.world == sample.world; };
    if (std::any_of(refusals_.begin(), refusals_.end(), is_of_world)) {
      return;
    }
    try {
      check_release(sample);
      const WorldTermsRecord terms = unpack_terms(bytes_of(sample.bytes));
      world_ = std::make_unique<JoinedWorld>(sample.world, terms, config_);
      domain_.start_heartbeat(terms.lease_ms);
      presence_ = domain_.writer(Topic::presence, liveliness_qos(terms.lease_ms), config_.network.world);
      pieces_ = domain_.reader(Topic::piece, piece_qos, partition_of_world(sample.world));
      Domain::set_hook(pieces_, control_hook_);
    } catch (const std::exception& error) {
      refuse(sample.world, error.what());
      return;
    }
    world_is_alive_ = true;
    last_alive_ = Clock::now();
    begin_session();
  }

  // Throws Error for a World of another version, byte order, record layout or release: this node could misread its
  // records, or find contacts with other bits.
  void check_release(const TermsSample& sample) const {
    if (!has_own_format(sample.version, sample.order) || sample.layout != fingerprint()) {
      throw Error("the World of domain " + std::to_string(domain_.number()) +
                  " has another version, byte order, record layout or release: it is \"" + printable(sample.name) +
                  "\", this node is \"ringfence " + own_release() +
                  "\"; install one release of ringfence on all machines");
    }
  }

  void begin_session() {
    assignment_logged_ = false;
    session_.reset();
    session_ = std::make_unique<NodeSession>(
        domain_, *world_, presence_.get(),
        domain_.writer(Topic::listener, piece_qos, partition_of_world(world_->number())), config_.name, totals_);
  }

  // Returns false if the node has to wait: check_world() begins a session when the World is alive again.
  bool end_session() {
    if (drains_.load(std::memory_order_acquire) != 0) {
      ending_ = ExitReason::drained;
    } else if (is_world_silent()) {
      return false;
    } else {
      log(LogLevel::info, "is no longer assigned and joins again");
      begin_session();
    }
    return true;
  }

  // Leaves the World and sends it the reason. Then the node waits for other Worlds; with NodeServiceConfig::once it
  // ends.
  void refuse(std::uint64_t world, const std::string& reason) {
    log(LogLevel::error, reason + "; the node refuses this World");
    leave_world();
    Entity writer = domain_.writer(Topic::presence, liveliness_qos(config_.network.lease_ms), config_.network.world);
    write_presence(writer.get(), random_incarnation(), world, config_.name, NodeState::refused, reason);
    if (config_.once) {
      await_reader(writer.get());
      ending_ = ExitReason::refused;
    }
    refusals_.push_back({world, std::move(writer)});
    if (refusals_.size() > max_refusals) {
      refusals_.pop_front();
    }
  }

  // Gives the World time to receive the reason before this process ends: the discovery of the World's reader may take
  // several round trips.
  static void await_reader(dds_entity_t writer) {
    constexpr int max_ms = 500;
    dds_publication_matched_status_t matched{};
    for (int ms = 0; ms < max_ms && matched.current_count == 0; ++ms) {
      dds_sleepfor(DDS_MSECS(1));
      dds_get_publication_matched_status(writer, &matched);
    }
    dds_wait_for_acks(writer, DDS_MSECS(200));
  }

  void leave_world() {
    session_.reset();
    presence_.reset();
    pieces_.reset();
    world_.reset();
    silent_ = false;
    renew_terms_ = true;
  }

  void forget_world(ExitReason ending, const char* why) {
    log(LogLevel::info, why);
    leave_world();
    if (config_.once) {
      ending_ = drains_.load(std::memory_order_acquire) != 0 ? ExitReason::drained : ending;
    }
  }

  // Whether nothing shows that the World is alive. After its lease has expired, DDS reports it alive again only when a
  // sample of its terms arrives. A parcel to this node also shows that it is alive.
  bool is_world_silent() {
    if (std::exchange(parcels_arrived_, false)) {
      return false;
    }
    return !world_is_alive_;
  }

  // Detects a World that is silent. Called in every step, but does something only every 10 ms, or in every step while
  // the World is silent.
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
      } else if (now - terms_read_ > terms_period) {
        renew_terms_ = true;  // if only its lease expired, the World answers the new reader
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

  // Ends the node when it has nothing to hand over, or when drain() was called a second time.
  void leave() {
    if (drains_seen_ > 1 || session_ == nullptr || session_->leave()) {
      ending_ = ExitReason::drained;
    }
  }

  static constexpr std::size_t max_refusals = 16;
  /// A refused World, and the writer whose sample holds the reason. The sample exists as long as the writer.
  struct Refusal {
    std::uint64_t world;
    Entity presence;
  };

  NodeServiceConfig config_;
  link::Doorbell bell_;
  std::atomic<bool> control_waits_{false};
  std::atomic<std::uint32_t> drains_{0};
  std::uint32_t drains_seen_ = 0;
  Domain::Hook control_hook_;
  Domain domain_;
  Entity terms_, pieces_, presence_;
  std::deque<Refusal> refusals_;
  NodeTotals totals_;
  std::unique_ptr<JoinedWorld> world_;
  std::unique_ptr<NodeSession> session_;
  std::optional<ExitReason> ending_;
  Clock::time_point last_alive_{};
  Clock::time_point last_check_{};
  Clock::time_point terms_read_{};  ///< when terms_ was created
  bool silent_ = false;
  bool parcels_arrived_ = false;  ///< a parcel has arrived since the last call of is_world_silent()
  bool renew_terms_ = false;
  bool world_is_alive_ = false;     ///< the lease of its terms has not expired
  bool assignment_logged_ = false;  ///< the session is assigned, and this was logged
};

NodeService::NodeService(NodeServiceConfig config)
    : implementation_(std::make_unique<Implementation>(std::move(config))) {}
NodeService::~NodeService() = default;

ExitReason NodeService::run() { return implementation_->run(); }
void NodeService::drain() noexcept { implementation_->drain(); }
NodeServiceReport NodeService::report() const noexcept { return implementation_->report(); }

}  // namespace ringfence::dds
