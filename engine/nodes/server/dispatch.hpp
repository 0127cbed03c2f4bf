#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "messages/run.hpp"
#include "nodes/server/object_table.hpp"
#include "nodes/server/peer_session.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"

namespace ringfence::nodes {

/// M2: decides which CD nodes receive which objects and, with the broad phase on the server, which node owns which
/// candidate pair; sends both.
///
/// A node receives an object that moves within, into or out of its region, except the objects that it hosts and
/// reported itself. Threads: belongs to the server role. Memory: grows to the largest frame.
class Dispatch {
 public:
  Dispatch(std::size_t nodes, std::size_t objects, std::size_t pairs, Placement placement,
           const std::array<std::uint32_t, 32>& layer_masks, bool keep_resting);

  /// Sets the number of node slots. Between frames.
  void resize(std::size_t slots);

  /// Which objects are sent.
  enum class UpdateScope : std::uint8_t {
    changes,      ///< objects that moved, unless their host keeps the others up to date
    not_hosted,   ///< these, and all present objects that no node hosts: the map has changed, and hosts send the rest
    all_objects,  ///< all present objects: the map has changed
  };
  /// Lists the updates of each node.
  void list_updates(ObjectTable& objects, const regions::RegionMap& map, UpdateScope scope);
  /// Starts sending the listed updates to the active nodes. They stay active until the last pump(), or start() is
  /// called again.
  void start(std::span<const PeerSession> nodes);
  /// Sends as much as the rings take; true when everything is sent. With Placement::server it then sweeps all objects
  /// and sends each candidate to its owner as it is found; a full ring interrupts the sweep. Objects and map must not
  /// change between start() and the final pump().
  bool pump(const ObjectTable& objects, const regions::RegionMap& map, const messages::RunHeader& head,
            messages::TrafficCounts& counts);
  /// Sends the unfinished message of pairs for `node`, so that another message may follow.
  void flush(NodeNumber node, messages::RunHeader head, messages::TrafficCounts& counts);

  /// Number of candidates sent. Only with Placement::server.
  std::size_t candidates() const noexcept { return candidates_; }
  /// Time spent on the sweep and its messages since start().
  std::uint64_t sweep_ns() const noexcept { return sweep_ns_; }

 private:
  static constexpr std::uint32_t gone = 0x80000000u;
  /// Bytes: 2000 pairs keep a node busy while the next message is filled.
  static constexpr std::size_t pair_message = std::size_t{1} << 14;

  void list_update(ObjectTable& objects, const regions::RegionMap& map, std::uint32_t slot, bool all_objects);
  bool pump_updates(NodeNumber node, const ObjectTable& objects, messages::RunHeader head,
                    messages::TrafficCounts& counts);
  bool pump_pairs(const ObjectTable& objects, const regions::RegionMap& map, messages::RunHeader head,
                  messages::TrafficCounts& counts);

  Placement placement_;
  broad_phase::SweepAndPrune sweep_;
  std::vector<link::Sender*> links_;                 ///< by node; null: no active node in the slot
  std::vector<std::vector<std::uint32_t>> updates_;  ///< by node: slots, with the bit `gone`
  std::vector<messages::RunSender> update_runs_;
  std::vector<messages::RunWriter> pair_runs_;
  bool sweeping_ = false;
  std::span<const geometry::CandidatePair> found_;  ///< not sent yet
  std::uint64_t sweep_ns_ = 0;
  std::vector<std::uint64_t> stamps_;
  std::uint64_t stamp_ = 0;
  std::size_t candidates_ = 0;
};

}  // namespace ringfence::nodes
