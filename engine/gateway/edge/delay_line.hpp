#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <queue>
#include <random>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "gateway/edge/asio.hpp"
#include "gateway/edge/network_model.hpp"
#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// Delays, reorders and loses messages by a NetworkModel.
///
/// Messages that may be lost are delayed independently of each other, so they overtake one another. The others keep
/// their order in each direction of a connection.
class DelayLine {
 public:
  struct Message {
    double due_s = 0;
    std::uint64_t order = 0;
    ConnectionId connection = 0;
    bool is_incoming = false;
    Delivery delivery = Delivery::newest;
    std::vector<std::byte> bytes;
  };
  using Deliver = std::function<void(Message&)>;

  DelayLine(net::io_context& io, const NetworkModel& model, Deliver deliver);

  /// Whether the model applies to a connection. `address`: of the other side.
  bool applies_to(ConnectionId connection, const std::string& address) const noexcept;
  /// Takes a message of such a connection. `may_be_lost`: whether the protocol allows it.
  void add(ConnectionId connection, bool is_incoming, bool may_be_lost, Delivery delivery,
           std::span<const std::byte> bytes);
  void forget(ConnectionId connection);

 private:
  struct Later {
    bool operator()(const Message& a, const Message& b) const noexcept {
      return a.due_s != b.due_s ? a.due_s > b.due_s : a.order > b.order;
    }
  };
  void wait();
  void deliver_due();

  NetworkModel model_;
  Deliver deliver_;
  Timer timer_;
  std::mt19937_64 random_;
  std::priority_queue<Message, std::vector<Message>, Later> waiting_;
  std::unordered_map<std::uint64_t, double> last_due_;  ///< of reliable messages, by connection and direction
  std::uint64_t order_ = 0;
};

}  // namespace ringfence::gateway
