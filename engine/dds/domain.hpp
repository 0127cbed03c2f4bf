#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "dds/wire.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::dds {

/// The side of the network: nodes look for the World at a fixed participant index.
enum class Side : std::uint8_t { world, node };

/// A DDS entity that is deleted with its owner. Movable, not copyable.
class Entity {
 public:
  Entity() = default;
  /// Takes the result of a dds_create_* call; throws Error, naming `what`, if it is an error.
  Entity(dds_entity_t entity, const char* what);
  ~Entity() { reset(); }
  Entity(Entity&& other) noexcept : entity_(std::exchange(other.entity_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(entity_, other.entity_);
    return *this;
  }
  void reset() noexcept;
  dds_entity_t get() const noexcept { return entity_; }
  explicit operator bool() const noexcept { return entity_ > 0; }

 private:
  dds_entity_t entity_ = 0;
};

/// Quality of service of one topic. A reader gets at least the last sample of each key.
struct TopicQos {
  bool durable = false;  ///< the last sample of each key is kept for late joiners
  double lease_ms = 0;   ///< > 0: a writer that is silent for longer is not alive
};

/// Topics between the processes of a world; see wire.idl for their types.
enum class Topic : std::uint8_t {
  presence,
  terms,
  piece,
  listener,
};
inline constexpr std::size_t topic_count = 4;

/// A process's membership in a DDS domain: one participant, with the topics of wire.idl.
///
/// Presence and Terms are in the partition NetworkConfig::world, so Worlds and nodes with different names do not see
/// each other. Pieces and listeners are in the partition of one World.
///
/// Configured from NetworkConfig only, not from the environment. Writers never wait: a write that finds the cache of
/// unacknowledged samples full returns DDS_RETCODE_TIMEOUT.
///
/// Threads: created and used by one thread; the hooks of readers are called by the receiving threads of Cyclone DDS.
class Domain {
 public:
  /// Callbacks: `data` when samples may have arrived, `others` when a matched peer has come or gone.
  struct Hook {
    std::function<void()> data;
    std::function<void()> others;
  };

  /// Throws Error, with what to change, if the interface or the port is not available.
  Domain(const NetworkConfig& network, Side side);
  ~Domain();
  Domain(const Domain&) = delete;
  Domain& operator=(const Domain&) = delete;

  std::uint32_t number() const noexcept { return number_; }
  dds_entity_t participant() const noexcept { return participant_.get(); }

  /// An empty `partition` is the default partition.
  Entity reader(Topic topic, const TopicQos& topic_qos, const std::string& partition);
  Entity writer(Topic topic, const TopicQos& topic_qos, const std::string& partition);
  /// Installs `hook` on a reader or writer and calls it once for what has already happened. The hook outlives the
  /// entity.
  static void set_hook(const Entity& entity, const Hook& hook);

  /// The IPv4 address from which a matched writer sends, in the machine's byte order; 0 if it is not known (yet).
  /// `publication` is dds_sample_info_t::publication_handle of one of its samples.
  std::uint32_t host_of(const Entity& reader, dds_instance_handle_t publication) const;

  /// Sends liveliness messages often enough for writers with that lease.
  void start_heartbeat(double lease_ms);

  /// Lines logged by Cyclone DDS since the last call, from any of its threads: the first ones, and the number of the
  /// rest.
  static std::vector<std::string> take_log_lines();

  /// A warning if the sockets got smaller buffers than requested; otherwise empty.
  static std::string socket_buffer_shortage(const NetworkConfig& network);

 private:
  void join_any(const NetworkConfig& network, Side side);
  void join(const NetworkConfig& network, Side side);
  void join(const NetworkConfig& network, Side side, std::uint32_t index);

  std::uint32_t number_ = 0;
  Entity domain_;
  Entity participant_;
  Entity pulse_;
  std::array<Entity, topic_count> topics_;
  Entity pulse_topic_;
  Entity participants_;  ///< reader of the participants that DDS has discovered
};

/// Quality of service of the topics.
constexpr TopicQos liveliness_qos(double lease_ms) noexcept { return {true, lease_ms}; }
inline constexpr TopicQos piece_qos{true, 0};

/// The partition of one World, for its pieces and its nodes' listeners.
std::string partition_of_world(std::uint64_t world);

/// A random number that identifies a process.
std::uint64_t random_incarnation();

/// Takes all samples that have arrived, up to `most` at a time, and calls `see(sample, info)` for each. Nothing is
/// copied: a sample lives until `see` returns.
template <class Sample, class Visit>
bool take_all(const Entity& reader, Visit visit) {
  constexpr std::uint32_t most = 16;
  void* samples[most] = {};
  dds_sample_info_t infos[most];
  bool any = false;
  for (;;) {
    samples[0] = nullptr;
    const dds_return_t got = dds_take(reader.get(), samples, infos, most, most);
    if (got <= 0) {
      return any;
    }
    for (dds_return_t i = 0; i < got; ++i) {
      visit(*static_cast<const Sample*>(samples[i]), infos[i]);
    }
    dds_return_loan(reader.get(), samples, got);
    any = true;
    if (got < static_cast<dds_return_t>(most)) {
      return true;
    }
  }
}

}  // namespace ringfence::dds
