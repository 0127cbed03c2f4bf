#include "dds/domain.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <mutex>
#include <random>
#include <string_view>
#include <utility>

#include <arpa/inet.h>
#include <dds/ddsrt/log.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "link/scoped_batch_scheduling.hpp"
#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

constexpr std::uint32_t max_domain = 200;

/// Maximum number of Worlds of a domain on one machine: the one without a name has participant index 0, each of the
/// others takes the first free one.
constexpr std::uint32_t max_worlds = 8;

/// UDP port of the participant with that index, by the port mapping of the DDSI standard.
constexpr std::uint32_t world_port(std::uint32_t domain, std::uint32_t index = 0) noexcept {
  return 7400 + 250 * domain + 10 + 2 * index;
}

/// Participant indices that a World with that name may have: [begin, end).
struct IndexRange {
  std::uint32_t begin, end;
};
IndexRange index_range_of(const NetworkConfig& network) noexcept {
  return network.world.empty() ? IndexRange{0, 1} : IndexRange{1, max_worlds};
}

bool is_valid_name(const std::string& world) {
  constexpr std::size_t max_characters = 64;
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
           c == '_';
  };
  return world.size() <= max_characters && std::all_of(world.begin(), world.end(), is_allowed);
}

bool is_loopback(const std::string& interface) { return interface == "lo" || interface.rfind("127.", 0) == 0; }

std::string tag(const std::string& name, const std::string& value) {
  return "<" + name + ">" + value + "</" + name + ">";
}

void check(const NetworkConfig& network, Side side) {
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) {
      throw Error("NetworkConfig: " + what);
    }
  };
  require(network.domain <= max_domain || (side == Side::world && network.domain == NetworkConfig::any_domain),
          "domain (--domain) is " + std::to_string(network.domain) + "; 0 to " + std::to_string(max_domain));
  require(network.lease_ms >= 10 && network.lease_ms <= 60'000,
          "lease_ms (--lease-ms) is " + std::to_string(network.lease_ms) + "; 10 to 60000");
  require(network.socket_bytes >= 65'536 && network.socket_bytes <= std::size_t{1} << 30,
          "socket_bytes (--socket-bytes) is " + std::to_string(network.socket_bytes) + "; 65536 to 1073741824");
  require(network.interface.find_first_of("<>&\"") == std::string::npos,
          "interface (--interface) is " + network.interface);
  require(is_valid_name(network.world),
          "world (--world) is \"" + network.world + "\"; up to 64 letters, digits, '.', '-' and '_'");
  for (const std::string& peer : network.peers) {
    require(!peer.empty() && peer.find_first_of("<>&\" ") == std::string::npos, "a peer (--peers) is \"" + peer + "\"");
  }
}

std::string general_settings(const NetworkConfig& network, bool multicast) {
  std::string general;
  if (!network.interface.empty()) {
    const bool address = network.interface.find_first_not_of("0123456789.") == std::string::npos;
    general += "<Interfaces><NetworkInterface " + std::string(address ? "address" : "name") + "=\"" +
               network.interface + "\"" + (is_loopback(network.interface) ? " multicast=\"false\"" : "") +
               "/></Interfaces>";
  }
  // Multicast is used for discovery only; data is always sent by unicast.
  general += tag("AllowMulticast", multicast ? "spdp" : "false");
  if (is_loopback(network.interface)) {
    // A piece fits one datagram, so it is lost only if a socket buffer is full.
    general +=
        tag("MaxMessageSize", "65000 B") + tag("FragmentSize", "64000 B") + tag("MaxRexmitMessageSize", "65000 B");
  }
  return tag("General", general);
}

std::string settings(const NetworkConfig& network, Side side, std::uint32_t domain, std::uint32_t index) {
  const bool local = is_loopback(network.interface);
  const bool multicast = !local && network.peers.empty();
  std::string discovery = tag("ParticipantIndex", side == Side::world ? std::to_string(index) : "none") +
                          tag("SPDPInterval", "250 ms") + tag("LeaseDuration", "10 s");
  std::vector<std::string> peers = network.peers;
  if (side == Side::node && local && peers.empty()) {
    peers.emplace_back("127.0.0.1");
  }
  std::string list;
  const IndexRange indices = index_range_of(network);
  for (const std::string& peer : peers) {
    if (peer.find(':') != std::string::npos) {
      list += "<Peer address=\"" + peer + "\"/>";
      continue;
    }
    for (std::uint32_t world_index = indices.begin; world_index < indices.end; ++world_index) {
      list += "<Peer address=\"" + peer + ":" + std::to_string(world_port(domain, world_index)) + "\"/>";
    }
  }
  if (!list.empty()) {
    discovery += tag("Peers", list);
  }
  const std::string bytes = std::to_string(network.socket_bytes) + " B";
  const std::string internal =
      "<SocketReceiveBufferSize min=\"default\" max=\"" + bytes + "\"/>" +
      // Linux keeps up to 212,992 bytes of the sender's buffer for each neighbour that it cannot resolve, as behind a
      // broken link. When the buffer is full, a send blocks, and with it the frame.
      "<SocketSendBufferSize min=\"default\" max=\"" + bytes + "\"/>" +
      // A mesh has many pieces, which are written at once.
      tag("Watermarks",
          tag("WhcLow", "1 MB") + tag("WhcHigh", "32 MB") + tag("WhcHighInit", "32 MB") + tag("WhcAdaptive", "false")) +
      // Every heartbeat requests an answer, and every timed heartbeat wakes a thread. The period is the time after
      // which a loss at the end of a stage must be noticed.
      "<HeartbeatInterval min=\"20 ms\" minsched=\"20 ms\" max=\"100 ms\">100 ms</HeartbeatInterval>" +
      tag("NackDelay", "2 ms") + tag("PrioritizeRetransmit", "false") + tag("WriterLingerDuration", "50 ms");
  return "<Domain id=\"any\">" + general_settings(network, multicast) + tag("Discovery", discovery) +
         tag("Internal", internal) + "</Domain>";
}

bool is_port_free(std::uint32_t port) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  if (socket < 0) {
    return true;  // other errors are reported when the domain is created
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_ANY);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool free = ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(socket);
  return free;
}

bool is_domain_free(std::uint32_t domain) {
  return is_port_free(world_port(domain)) && is_port_free(world_port(domain) + 1);
}

std::uint32_t free_domain(std::uint32_t first) {
  for (std::uint32_t domain = first; domain <= max_domain; ++domain) {
    if (is_domain_free(domain)) {
      return domain;
    }
  }
  throw Error("No DDS domain from 0 to " + std::to_string(max_domain) + " has a free port on this machine");
}

/// Log lines of Cyclone DDS, kept until a thread that may call the log hook takes them. Cyclone DDS logs from its own
/// threads and, for a broken link, once per datagram.
class LogLines {
 public:
  static LogLines& all() {
    static LogLines lines;
    return lines;
  }
  void add(const char* line) {
    const std::lock_guard lock(mutex_);
    if (lines_.size() < max_lines) {
      std::string text(line);
      while (!text.empty() && text.back() == '\n') {
        text.pop_back();
      }
      lines_.push_back("Cyclone DDS: " + text);
    } else {
      ++more_;
    }
    any_.store(true, std::memory_order_release);
  }
  /// Returns lines at most once a second, unless `at_once`.
  std::vector<std::string> take(bool at_once) {
    if (!any_.load(std::memory_order_acquire)) {
      return {};
    }
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (!at_once && now - taken_ < std::chrono::seconds(1)) {
      return {};
    }
    taken_ = now;
    std::vector<std::string> lines = std::exchange(lines_, {});
    if (more_ != 0) {
      lines.push_back("Cyclone DDS: and " + std::to_string(std::exchange(more_, 0u)) + " lines more");
    }
    any_.store(false, std::memory_order_release);
    return lines;
  }

 private:
  static constexpr std::size_t max_lines = 4;

  std::mutex mutex_;
  std::atomic<bool> any_{false};
  std::vector<std::string> lines_;
  std::uint64_t more_ = 0;
  std::chrono::steady_clock::time_point taken_;
};

/// The first unicast address in a list like "udp/239.255.0.1:7401@2,udp/192.0.2.7:41234@2"; 0 if there is none.
std::uint32_t unicast_host(std::string_view list) {
  constexpr std::string_view prefix = "udp/";
  for (std::size_t at = list.find(prefix); at != std::string_view::npos; at = list.find(prefix, at)) {
    at += prefix.size();
    const std::string text(list.substr(at, list.find(':', at) - at));
    in_addr address{};
    if (::inet_pton(AF_INET, text.c_str(), &address) == 1 && !IN_MULTICAST(ntohl(address.s_addr))) {
      return ntohl(address.s_addr);
    }
  }
  return 0;
}

void call_data_hook(void* hook) { static_cast<const Domain::Hook*>(hook)->data(); }
void call_others_hook(void* hook) { static_cast<const Domain::Hook*>(hook)->others(); }

dds_qos_t* make_qos(const TopicQos& topic_qos, const std::string& partition) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos, topic_qos.durable ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  if (topic_qos.durable) {
    dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, 1, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  }
  if (topic_qos.lease_ms > 0) {
    dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, static_cast<dds_duration_t>(topic_qos.lease_ms * 1e6));
  }
  // Otherwise an expired lease would look like an announced end.
  dds_qset_writer_data_lifecycle(qos, false);
  if (!partition.empty()) {
    dds_qset_partition1(qos, partition.c_str());
  }
  return qos;
}

struct TopicKind {
  const dds_topic_descriptor_t* type;
  const char* name;
};
/// In the order of Topic.
constexpr std::array<TopicKind, topic_count> topic_kinds = {{{&ringfence_wire_Presence_desc, "ringfence_presence"},
                                                             {&ringfence_wire_Terms_desc, "ringfence_terms"},
                                                             {&ringfence_wire_Piece_desc, "ringfence_piece"},
                                                             {&ringfence_wire_Listener_desc, "ringfence_listener"}}};
constexpr std::size_t index_of(Topic topic) noexcept { return static_cast<std::size_t>(topic); }

}  // namespace

Entity::Entity(dds_entity_t entity, const char* what) : entity_(entity) {
  if (entity < 0) {
    throw Error(std::string("Cyclone DDS cannot create ") + what + ": " + dds_strretcode(-entity));
  }
}

void Entity::reset() noexcept {
  if (entity_ > 0) {
    dds_delete(entity_);
  }
  entity_ = 0;
}

Domain::Domain(const NetworkConfig& network, Side side) {
  check(network, side);
  if (network.domain == NetworkConfig::any_domain) {
    join_any(network, side);
  } else {
    number_ = network.domain;
    join(network, side);
  }
  const auto make_topic = [&](const TopicKind& kind) {
    return Entity(dds_create_topic(participant_.get(), kind.type, kind.name, nullptr, nullptr), kind.name);
  };
  std::transform(topic_kinds.begin(), topic_kinds.end(), topics_.begin(), make_topic);
  pulse_topic_ = make_topic({&ringfence_wire_Pulse_desc, "ringfence_pulse"});
  participants_ = Entity(dds_create_reader(participant_.get(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr),
                         "a reader of participants");
}

// A process that starts at the same time may take the ports of a domain that was free.
void Domain::join_any(const NetworkConfig& network, Side side) {
  for (number_ = free_domain(0);; number_ = free_domain(number_ + 1)) {
    try {
      return join(network, side);
    } catch (const Error&) {
      if (is_domain_free(number_)) {
        throw;
      }
    }
  }
}

void Domain::join(const NetworkConfig& network, Side side) {
  const std::string where = " (domain " + std::to_string(number_) + ", interface " +
                            (network.interface.empty() ? "chosen by Cyclone DDS" : network.interface) + ")";
  const auto is_usable = [&](std::uint32_t candidate) {
    return side == Side::node || is_port_free(world_port(number_, candidate));
  };
  const IndexRange indices = side == Side::node ? IndexRange{0, 1} : index_range_of(network);
  std::uint32_t index = indices.begin;
  for (; index < indices.end && !is_usable(index); ++index) {
  }
  if (index == indices.end) {
    throw Error(network.world.empty()
                    ? "UDP port " + std::to_string(world_port(number_)) + " is taken" + where +
                          ": another World uses this domain; choose another with --domain, or give this World a name "
                          "with --world"
                    : "UDP ports " + std::to_string(world_port(number_, indices.begin)) + " to " +
                          std::to_string(world_port(number_, indices.end - 1)) + " are taken" + where + ": " +
                          std::to_string(indices.end - indices.begin) +
                          " Worlds with names use this domain on this machine; choose another with --domain");
  }
  dds_set_log_sink([](void*, const dds_log_data_t* line) { LogLines::all().add(line->message); }, nullptr);
  for (;;) {
    try {
      return join(network, side, index);
    } catch (const Error& error) {
      domain_.reset();
      std::string why = error.what() + where + "; check that the interface exists (ip addr)";
      for (const std::string& line : LogLines::all().take(true)) {
        why += "; " + line;
      }
      // A process that started at the same time may have taken the port that was free.
      for (++index; index < indices.end && !is_usable(index); ++index) {
      }
      if (index >= indices.end) {
        throw Error(why);
      }
    }
  }
}

void Domain::join(const NetworkConfig& network, Side side, std::uint32_t index) {
  const link::ScopedBatchScheduling batch_scheduling;  // inherited by the threads that Cyclone DDS creates here
  domain_ = Entity(dds_create_domain(number_, settings(network, side, number_, index).c_str()), "a domain");
  participant_ = Entity(dds_create_participant(number_, nullptr, nullptr), "a participant");
}

// A participant sends a liveliness message when four fifths of its shortest lease have passed. This writer, which
// writes no data, has half the lease of the watched writers, so one message may be lost or late.
void Domain::start_heartbeat(double lease_ms) {
  pulse_.reset();
  dds_qos_t* qos = make_qos({false, lease_ms / 2}, {});
  pulse_ = Entity(dds_create_writer(participant_.get(), pulse_topic_.get(), qos, nullptr), "a pulse");
  dds_delete_qos(qos);
}

Domain::~Domain() {
  pulse_.reset();
  participant_.reset();
}

Entity Domain::reader(Topic topic, const TopicQos& topic_qos, const std::string& partition) {
  // The reader accepts any lease; the writer's own lease decides how long it may be silent.
  dds_qos_t* qos = make_qos({topic_qos.durable, 0}, partition);
  const dds_entity_t made = dds_create_reader(participant_.get(), topics_[index_of(topic)].get(), qos, nullptr);
  dds_delete_qos(qos);
  return {made, topic_kinds[index_of(topic)].name};
}

Entity Domain::writer(Topic topic, const TopicQos& topic_qos, const std::string& partition) {
  dds_qos_t* qos = make_qos(topic_qos, partition);
  const dds_entity_t made = dds_create_writer(participant_.get(), topics_[index_of(topic)].get(), qos, nullptr);
  dds_delete_qos(qos);
  return {made, topic_kinds[index_of(topic)].name};
}

std::uint32_t Domain::host_of(const Entity& reader, dds_instance_handle_t publication) const {
  dds_builtintopic_endpoint_t* const writer = dds_get_matched_publication_data(reader.get(), publication);
  if (writer == nullptr) {
    return 0;
  }
  dds_builtintopic_participant_t key{};
  key.key = writer->participant_key;
  dds_builtintopic_free_endpoint(writer);
  const dds_instance_handle_t participant = dds_lookup_instance(participants_.get(), &key);
  void* samples[1] = {};
  dds_sample_info_t info[1];
  if (participant == DDS_HANDLE_NIL || dds_read_instance(participants_.get(), samples, info, 1, 1, participant) <= 0) {
    return 0;
  }
  std::uint32_t host = 0;
  char* addresses = nullptr;
  const auto* const found = static_cast<const dds_builtintopic_participant_t*>(samples[0]);
  if (info[0].valid_data && dds_qget_prop(found->qos, "__NetworkAddresses", &addresses)) {
    host = unicast_host(addresses);
    dds_free(addresses);
  }
  dds_return_loan(participants_.get(), samples, 1);
  return host;
}

void Domain::set_hook(const Entity& entity, const Hook& hook) {
  dds_listener_t* listener = dds_create_listener(const_cast<Hook*>(&hook));
  dds_lset_data_available(listener, [](dds_entity_t, void* arg) { call_data_hook(arg); });
  dds_lset_subscription_matched(
      listener, [](dds_entity_t, const dds_subscription_matched_status_t, void* arg) { call_others_hook(arg); });
  dds_lset_liveliness_changed(
      listener, [](dds_entity_t, const dds_liveliness_changed_status_t, void* arg) { call_others_hook(arg); });
  dds_lset_publication_matched(
      listener, [](dds_entity_t, const dds_publication_matched_status_t, void* arg) { call_others_hook(arg); });
  dds_set_listener(entity.get(), listener);
  dds_delete_listener(listener);
  hook.data();
  hook.others();
}

std::vector<std::string> Domain::take_log_lines() { return LogLines::all().take(false); }

std::string Domain::socket_buffer_shortage(const NetworkConfig& network) {
  const std::string wanted = std::to_string(network.socket_bytes);
  std::string shortage;
  for (const auto& [name, what] : {std::pair("rmem_max", "large shapes are retransmitted in parts"),
                                   std::pair("wmem_max", "a broken link may delay the frame longer")}) {
    std::ifstream file(std::string("/proc/sys/net/core/") + name);
    std::size_t most = 0;
    if (file >> most && most < network.socket_bytes) {
      shortage +=
          shortage.empty() ? "socket buffers of " + wanted + " bytes were requested, the system allows " : ", and ";
      shortage.append(std::to_string(most)).append(": ").append(what);
      shortage.append("; sysctl -w net.core.").append(name).append("=").append(wanted);
    }
  }
  return shortage;
}

std::string partition_of_world(std::uint64_t world) { return "world-" + std::to_string(world); }

std::uint64_t random_incarnation() {
  std::random_device device;
  std::uint64_t drawn = 0;
  while (drawn == 0) {
    drawn = std::uint64_t{device()} << 32 | device();
  }
  return drawn;
}

}  // namespace ringfence::dds
