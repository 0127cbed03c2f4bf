#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "broad_phase/sweep_and_prune.hpp"
#include "messages/run.hpp"
#include "nodes/role.hpp"
#include "nodes/server/object_table.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"

namespace ringfence::nodes {

/// M2: decides which CD node is told of which object and, with the broad phase on the server, which node owns which
/// candidate pair; and sends both.
///
/// A node is told of an object when it moves within, into or out of the node's region, but not of what it hosts and
/// reported itself. Threads: belongs to the server role. Memory: grows to the largest frame.
class Dispatch {
 public:
  Dispatch(std::size_t nodes, std::size_t objects, std::size_t pairs, Placement placement,
           const std::array<std::uint32_t, 32>& layer_masks, bool keep_resting);

  /// Between frames: from now on there are so many nodes.
  void resize(std::size_t nodes);

  /// What nodes are told of.
  enum class UpdateScope : std::uint8_t {
    changes,     ///< what moved and was not passed over
    not_hosted,  ///< that, and every present object anew that no node hosts: the map has changed, and hosts do the same
    all_objects,  ///< every present object anew: the map has changed
  };
  /// Lists who is told.
  void list_updates(ObjectTable& objects, const regions::RegionMap& map, UpdateScope scope);
  /// Starts sending what was listed.
  void start();
  /// Sends as much as the links take; true when all is sent. With Placement::server it then sweeps all objects and
  /// sends each candidate to its owner as it is found; what the links do not take interrupts the sweep. From start()
  /// until then objects and map stay as they are.
  bool pump(std::span<Connection> nodes, const ObjectTable& objects, const regions::RegionMap& map,
            const messages::RunHeader& head, messages::TrafficCounts& counts);
  /// Sends what is begun of a message of pairs for `node` as it is, so that something else may be said to it in
  /// between.
  void flush(NodeNumber node, Connection& connection, messages::RunHeader head, messages::TrafficCounts& counts);

  /// Candidates sent. Only with Placement::server.
  std::size_t candidates() const noexcept { return candidates_; }
  /// Time spent in finding and sending them since start().
  std::uint64_t sweep_ns() const noexcept { return sweep_ns_; }

 private:
  static constexpr std::uint32_t gone = 0x80000000u;
  static constexpr std::size_t pair_message = std::size_t{1} << 14;  ///< bytes: 2000 pairs keep a node busy for a while

  void list_update(ObjectTable& objects, const regions::RegionMap& map, std::uint32_t slot, bool all_objects);
  bool pump_updates(NodeNumber node, Connection& connection, const ObjectTable& objects, messages::RunHeader head,
                    messages::TrafficCounts& counts);
  bool pump_pairs(std::span<Connection> nodes, const ObjectTable& objects, const regions::RegionMap& map,
                  messages::RunHeader head, messages::TrafficCounts& counts);

  Placement placement_;
  broad_phase::SweepAndPrune sweep_;
  std::vector<std::vector<std::uint32_t>> updates_;  ///< by node: slots, with the bit `gone`
  std::vector<messages::RunSender> update_runs_;
  std::vector<messages::RunWriter> pair_runs_;
  bool sweeping_ = false;
  std::span<const geometry::CandidatePair> found_;  ///< not yet sent
  std::uint64_t sweep_ns_ = 0;
  std::vector<std::uint64_t> stamps_;
  std::uint64_t stamp_ = 0;
  std::size_t candidates_ = 0;
};

}  // namespace ringfence::nodes
