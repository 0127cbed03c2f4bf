#pragma once

#include <memory>
#include <span>
#include <vector>

#include "nodes/exchange/server/server_exchange.hpp"
#include "regions/region_map.hpp"

namespace ringfence::nodes {

/// ServerExchange of a world whose nodes share memory with the server: their contacts, the objects that they host,
/// their ghost updates and their publications. NodeContacts and HostPublication say who may access what when.
///
/// Only this class and ContactLedger open and close gates.
class SharedServerExchange final : public ServerExchange {
 public:
  explicit SharedServerExchange(ServerState& state) noexcept : ServerExchange(state, true) {}

  bool send_map(PeerSession& node, messages::RunSender& run) override;
  void start_end(PeerSession& node, bool hosts_exchange_objects) override;
  void expect_nodes() override;
  void announce(AnnouncedStep step, PeerSession::Reached PeerSession::*reached) override;
  void dismiss(PeerSession& node) noexcept override;
  void admit(PeerSession& node) noexcept override;
  void finish() override;
  void free_abandoned() noexcept override { abandoned_maps_.clear(); }
  void begin_queries() override;
  void begin_senses() override;
  const NodeQueries& queries_of(const PeerSession& node) const noexcept override {
    return node.connection.node_contacts->queries;
  }
  void begin_ghosts(bool exchanged) noexcept override;
  void close_ghost_gates() noexcept override;
  bool is_reading() const noexcept override;
  void list_next_hosts(base::FlatList<NextHostOf>& next_hosts) override;
  void receive_contacts(PeerSession& node, Statistics& statistics) override;
  void count_records(Statistics& statistics) const noexcept override;

 private:
  using SentMap = std::unique_ptr<const regions::RegionMap>;

  bool had_queries_ = false;                        ///< in the last frame
  std::vector<std::span<const NextHostOf>> lists_;  ///< of the nodes, in this frame
  std::vector<SentMap> sent_maps_;                  ///< to nodes, in this frame
  /// The same of earlier frames, in which nodes were lost that may not have read them yet.
  std::vector<SentMap> abandoned_maps_;
};

}  // namespace ringfence::nodes
