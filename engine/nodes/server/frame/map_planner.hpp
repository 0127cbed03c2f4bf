#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "regions/balance.hpp"

namespace ringfence::nodes {

/// Computes a region map from weights on a thread of its own, because that takes longer than a frame: 80 ms with
/// 10^6 objects.
///
/// The thread is started with the first map and sleeps unless it computes one. If the system has no thread, start()
/// computes the map itself.
///
/// Threads: one thread calls start() and take(), in turn. Between them it may call Balance::add_frame() only.
class MapPlanner {
 public:
  /// What the map is for: see Balance::propose().
  struct Order {
    regions::RegionMap map;         ///< the map to be replaced
    std::vector<NodeNumber> nodes;  ///< ascending
    std::size_t resent = 0;
  };

  explicit MapPlanner(regions::Balance& balance) : balance_(balance) {}
  /// Waits for a map that is computed, and ends the thread.
  ~MapPlanner();
  MapPlanner(const MapPlanner&) = delete;
  MapPlanner& operator=(const MapPlanner&) = delete;

  /// Begins to compute a map from the weights of the Balance.
  void start(Order order);
  /// Whether start() was called and take() was not.
  bool is_started() const noexcept { return order_.has_value(); }
  /// Waits for the table of the map and returns it; empty if no change pays off. Valid until the next start(). Throws
  /// what the computation threw. Precondition: is_started().
  std::span<const std::uint32_t> take();

 private:
  // Values of state_. While it is `ordered`, the result belongs to the thread, and the order does not change.
  static constexpr std::uint32_t idle = 0, ordered = 1, ending = 2;

  void run();
  void compute() noexcept;

  regions::Balance& balance_;
  std::optional<Order> order_;            ///< from start() to take()
  std::span<const std::uint32_t> table_;  ///< the result
  std::exception_ptr failure_;            ///< why there is none
  std::atomic<std::uint32_t> state_{idle};
  std::thread thread_;
};

}  // namespace ringfence::nodes
