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

/// Whose side of the network: a World stands where nodes look for it.
enum class Side : std::uint8_t { world, node };

/// A DDS entity that is deleted with its owner. Moves, does not copy.
class Entity {
 public:
  Entity() = default;
  /// Takes over what a dds_create_* call answered; throws Error, naming `what`, where that was an error.
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

/// How one topic is carried.
struct TopicQos {
  bool durable = false;  ///< the last of each key is kept for late joiners
  bool keep_all = true;  ///< else the last of each key
  double lease_ms = 0;   ///< > 0: who is silent for so long is not alive
};

/// What passes between the processes of a world; wire.idl has the types.
enum class Topic : std::uint8_t {
  presence,
  terms,
  piece,
  up,    ///< parcels from nodes
  down,  ///< parcels to a node, in the partition of its incarnation
};
inline constexpr std::size_t topic_count = 5;

/// A process's place in a domain: one participant, with the topics of wire.idl.
///
/// Configured without the environment: the settings are made from NetworkConfig. Writers never wait: a write that finds
/// the cache of unacknowledged samples full answers DDS_RETCODE_TIMEOUT.
///
/// Threads: made and used by one; the hooks given to readers are called by the receiving threads of Cyclone DDS.
class Domain {
 public:
  /// What is called where something may have come, or somebody has come or gone.
  struct Hook {
    std::function<void()> data;
    std::function<void()> others;
  };

  /// Throws Error, saying what to change, where the interface or the port cannot be had.
  Domain(const NetworkConfig& network, Side side);
  ~Domain();
  Domain(const Domain&) = delete;
  Domain& operator=(const Domain&) = delete;

  std::uint32_t number() const noexcept { return number_; }
  dds_entity_t participant() const noexcept { return participant_.get(); }

  /// `partition` empty: none.
  Entity reader(Topic topic, const TopicQos& topic_qos, const std::string& partition);
  Entity writer(Topic topic, const TopicQos& topic_qos, const std::string& partition);
  /// Has `hook` called for the reader or writer; and once now, for what has been already. It outlives the entity.
  static void listen(const Entity& entity, const Hook& hook);

  /// Lets the process say often enough that it lives for the writers with that lease.
  void start_heartbeat(double lease_ms);

  /// What Cyclone DDS had to say since the last time, from any of its threads: its first words, and how many more.
  static std::vector<std::string> take_log_lines();

  /// What the sockets were asked for and were not given, as a sentence; empty where they got it.
  static std::string socket_buffer_shortage(const NetworkConfig& network);

 private:
  std::uint32_t number_ = 0;
  Entity domain_;
  Entity participant_;
  Entity pulse_;
  std::array<Entity, topic_count> topics_;
  Entity pulse_topic_;
};

/// How the topics are carried.
constexpr TopicQos liveliness_qos(double lease_ms) noexcept { return {true, false, lease_ms}; }
inline constexpr TopicQos piece_qos{true, false, 0};
inline constexpr TopicQos parcel_qos{false, true, 0};

/// The partition of one node.
std::string partition_of(std::uint64_t incarnation);

/// A number that no other process has drawn.
std::uint64_t random_incarnation();

/// Takes what has come, up to `most` samples at a time until there is none, and shows each to `see(sample, info)`.
/// Without copying: what `see` is shown lives until it returns.
template <class Sample, class See>
bool take_all(const Entity& reader, See see) {
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
      see(*static_cast<const Sample*>(samples[i]), infos[i]);
    }
    dds_return_loan(reader.get(), samples, got);
    any = true;
    if (got < static_cast<dds_return_t>(most)) {
      return true;
    }
  }
}

}  // namespace ringfence::dds
