// More threads than cores, with the smallest rings, all sending and receiving at once. Tests on the machine what the
// model checker proves for small programs; also run under the thread sanitizer.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "link/channel.hpp"
#include "link/watchdog.hpp"

namespace ringfence::link {
namespace {

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr std::uint64_t messages = 3000;
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
constexpr std::uint64_t messages = 3000;
#else
constexpr std::uint64_t messages = 20000;
#endif
#else
constexpr std::uint64_t messages = 20000;
#endif

/// One end of a duplex channel: sends `messages` numbered messages and checks as many. Never blocks.
class Peer {
 public:
  Peer(Sender& out, Receiver& in, std::uint64_t seed) : out_(out), in_(in), random_(seed) {}

  /// Does everything that is possible without waiting. Returns whether there was progress.
  bool step() {
    const bool received = receive_some();
    const bool sent = send_some();
    out_.publish();
    in_.release();
    return received || sent;
  }
  const char* awaited() const noexcept {
    return sent_ == messages ? "a message" : received_ == messages ? "room to send" : "a message, or room to send";
  }
  bool ready() { return in_.has_message() || (sent_ < messages && !out_.claim(next_size()).empty()); }
  bool done() const { return sent_ == messages && received_ == messages; }
  std::uint64_t wrong() const { return wrong_; }

 private:
  std::size_t next_size() {
    if (size_ == 0) size_ = 16 + random_() % 2000;
    return size_;
  }

  bool send_some() {
    bool any = false;
    while (sent_ < messages) {
      const std::size_t size = next_size();
      const std::span<std::byte> room = out_.claim(size);
      if (room.empty()) break;
      const std::uint64_t number = sent_++;
      const std::uint64_t check = number * 0x9e3779b97f4a7c15u ^ size;
      std::memcpy(room.data(), &number, 8);
      std::memcpy(room.data() + 8, &check, 8);
      for (std::size_t i = 16; i < size; ++i) room[i] = std::byte(check + i);
      out_.commit(size);
      size_ = 0;
      any = true;
      if (random_() % 4 == 0) out_.publish();
      if (random_() % 16 == 0) break;
    }
    return any;
  }

  bool receive_some() {
    bool any = false;
    for (;;) {
      const std::span<const std::byte> message = in_.next();
      if (message.empty()) break;
      std::uint64_t number, check;
      std::memcpy(&number, message.data(), 8);
      std::memcpy(&check, message.data() + 8, 8);
      bool correct = number == received_ && check == (number * 0x9e3779b97f4a7c15u ^ message.size());
      for (std::size_t i = 16; correct && i < message.size(); ++i) correct = message[i] == std::byte(check + i);
      wrong_ += !correct;
      ++received_;
      any = true;
      if (random_() % 4 == 0) in_.release();
      if (random_() % 16 == 0) break;
    }
    return any;
  }

  Sender& out_;
  Receiver& in_;
  std::mt19937_64 random_;
  std::uint64_t sent_ = 0, received_ = 0, wrong_ = 0;
  std::size_t size_ = 0;
};

TEST_CASE("a star of nine threads over the smallest rings, all full both ways, loses nothing and never hangs") {
  constexpr std::size_t nodes = 8;
  const std::uint64_t seed = 99;
  CAPTURE(seed);
  struct Node {
    Doorbell bell;
    Channel in, out;
    explicit Node(Doorbell& server) : in(4096, &bell, &server), out(4096, &server, &bell) {}
  };
  Watchdog watchdog("a star of nine threads");
  auto server = std::make_unique<Doorbell>();
  std::vector<std::unique_ptr<Node>> all;
  for (std::size_t i = 0; i < nodes; ++i) all.push_back(std::make_unique<Node>(*server));

  std::atomic<std::uint64_t> wrong{0};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < nodes; ++i) {
    threads.emplace_back([&, i] {
      Node& node = *all[i];
      ThreadProgress& progress = watchdog.add_thread("node " + std::to_string(i));
      Peer peer(node.out.sender(), node.in.receiver(), seed + i);
      while (!peer.done()) {
        if (peer.step()) {
          progress.note_progress();
        } else if (!peer.done()) {
          progress.set_waiting_for(peer.awaited());
          node.bell.wait([&] { return peer.ready(); });
          progress.set_waiting_for(nullptr);
        }
      }
      progress.set_done();
      wrong.fetch_add(peer.wrong());
    });
  }
  std::vector<Peer> peers;
  for (std::size_t i = 0; i < nodes; ++i) {
    peers.emplace_back(all[i]->in.sender(), all[i]->out.receiver(), seed + nodes + i);
  }
  const auto done = [&] {
    return std::all_of(peers.begin(), peers.end(), [](const Peer& peer) { return peer.done(); });
  };
  ThreadProgress& server_progress = watchdog.add_thread("the server");
  while (!done()) {
    bool progress = false;
    for (Peer& peer : peers) progress = peer.step() || progress;
    if (progress) server_progress.note_progress();
    if (progress || done()) continue;
    server_progress.set_waiting_for("a message from any node, or room to any");
    server->wait([&] { return std::any_of(peers.begin(), peers.end(), [](Peer& peer) { return peer.ready(); }); });
    server_progress.set_waiting_for(nullptr);
  }
  server_progress.set_done();
  for (std::thread& thread : threads) thread.join();
  for (const Peer& peer : peers) wrong.fetch_add(peer.wrong());
  CHECK(wrong.load() == 0);
}

}  // namespace
}  // namespace ringfence::link
