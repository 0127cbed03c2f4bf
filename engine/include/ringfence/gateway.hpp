#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/world.hpp"

namespace ringfence {

/// What the embedder does for the clients of a Gateway. All are called on the thread that calls the Gateway, within
/// before_frame() and after_frame(); they may call the World. They must not call the Gateway, except Gateway::send.
struct GatewayHooks {
  /// Makes the avatar of a player who has connected, by World::spawn. A null id refuses the player. Null: the world has
  /// spectators only.
  std::function<ObjectId(UserId)> spawn;
  /// A player is gone for good; its user is disconnected next, which destroys its avatars. May be null.
  std::function<void(UserId)> left;
  /// Bytes that a player sent for the embedder, at most 1024. Null: such messages are refused.
  std::function<void(UserId, std::span<const std::byte>)> application;
  /// Appends up to 64 bytes that clients receive with an object when it comes into their view. Null: none.
  std::function<void(ObjectNumber, std::vector<std::byte>&)> metadata;
  /// Changes the number of robots, for operators; returns a sentence about the outcome. Null: refused.
  std::function<std::string(std::uint32_t)> robots;
  /// Digest of all frames so far, for spectators; see Digest. Null: they receive none.
  std::function<std::uint64_t()> digest;
};

/// Configuration of a Gateway. The constructor of Gateway checks it and throws Error, which says what to change.
struct GatewayConfig {
  std::string host = "127.0.0.1";   ///< address to listen at
  std::uint16_t port = 8080;        ///< 0: any free port
  std::string world = "ringfence";  ///< name of the world: `aud` of tokens
  /// PEM files: TLS with this certificate chain and private key. Both or none; required unless `host` is a loopback
  /// address.
  std::string certificate_file, key_file;
  /// Secret of at least 32 bytes with which tokens are signed (HS256). Empty: everybody is admitted as a guest; only if
  /// `host` is a loopback address.
  std::string token_key;
  std::vector<std::string>
      origins;                 ///< values of the header Origin that may connect; empty: only the gateway's own page
  std::string page_directory;  ///< files that / serves; empty: none
  std::size_t max_clients = 10000;
  /// Parameters of the motion model that clients receive, to predict it; of the model walk: see WalkConfig.
  std::vector<std::byte> model_parameters;
  /// Frames per second that the embedder runs, above 0, at most 1000; clients predict with it. A client may send two
  /// messages per frame, or 120 per second if that is more.
  double rate = 20;
  std::string
      contact_label;    ///< what a contact means in this world, for spectators: "loss of separation"; may be empty
  double grace_s = 30;  ///< seconds for which the avatar of a player whose connection ended stays
  /// Worsens the network for tests: "delay=150ms,jitter=50ms,loss=5%"; "share=50%": that of half of the clients;
  /// "address=127.0.0.2": that of clients from there; empty: not.
  std::string network;
  GatewayHooks hooks;
};

/// Work of a Gateway since its construction.
struct GatewayReport {
  std::size_t players = 0, spectators = 0;  ///< connected now
  std::size_t away = 0;                     ///< players without a connection whose avatar stays
  std::uint64_t updates = 0;                ///< made
  std::uint64_t replaced_updates = 0;       ///< not sent, because the client reads slowly: a newer one replaced it
  std::uint64_t received_messages = 0, received_bytes = 0, sent_bytes = 0;
  std::uint64_t refused = 0;  ///< connections and messages that were refused
  double frame_cpu_s = 0;     ///< CPU time of before_frame() and after_frame()
  double network_cpu_s = 0;   ///< CPU time of the gateway's own thread
};

/// Lets players, spectators and operators into a World over the network: docs/client-protocol.md is what they speak,
/// docs/serving.md is how to operate it. It is the user node of its players: it connects a user for each, passes the
/// newest input of each to the World in every frame, and sends each what its user node sees. The World never waits for
/// a client.
///
///   ringfence::Gateway gateway(world, config);
///   for (;;) {
///     gateway.before_frame();
///     world.advance();
///     gateway.after_frame();
///     wait_until_next_frame();
///   }
///
/// Players that a restored World has are away at first, and come back with their tokens.
///
/// Threads: the thread that calls the World calls it; one more thread of its own sends and receives. Failure: the
/// constructor throws Error; nothing else throws but std::bad_alloc. Lifetime: the World must outlive it.
class Gateway {
 public:
  Gateway(World& world, GatewayConfig config);
  /// Closes all connections with code 1001.
  ~Gateway();
  Gateway(const Gateway&) = delete;
  Gateway& operator=(const Gateway&) = delete;

  /// Where it listens, such as "http://127.0.0.1:8080".
  const std::string& url() const noexcept;
  /// Admits, removes and reads clients. Call it before World::advance or begin_frame.
  void before_frame();
  /// Sends updates. Call it after World::advance or finish_frame.
  void after_frame();
  /// Sends bytes, at most 1024, to a player; false if it is not connected or they are too many.
  bool send(UserId user, std::span<const std::byte> bytes);
  /// Stops listening, and closes all connections with code 1001. The avatars stay in the World.
  void close();
  GatewayReport report() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence
