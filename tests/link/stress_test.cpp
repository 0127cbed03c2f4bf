// More threads than cores, the smallest rings, everybody sending and receiving at once: what the exhaustive checker
// proves for small programs, on the machine; and what the thread sanitizer looks at.
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

/// One end of a conversation: sends `messages` numbered messages and checks as many. Never waits inside.
class Talker {
 public:
  Talker(Sender& out, Receiver& in, std::uint64_t seed) : out_(out), in_(in), random_(seed) {}

  /// Goes as far as it can now. True when it got somewhere.
  bool step() {
    const bool heard = hear();
    const bool said = say();
    out_.publish();
    in_.release();
    return heard || said;
  }
  const char* waits_for() const noexcept {
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

  bool say() {
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

  bool hear() {
    bool any = false;
    for (;;) {
      const std::span<const std::byte> message = in_.next();
      if (message.empty()) break;
      std::uint64_t number, check;
      std::memcpy(&number, message.data(), 8);
      std::memcpy(&check, message.data() + 8, 8);
      bool right = number == received_ && check == (number * 0x9e3779b97f4a7c15u ^ message.size());
      for (std::size_t i = 16; right && i < message.size(); ++i) right = message[i] == std::byte(check + i);
      wrong_ += !right;
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

TEST_CASE("a star of nine threads over the smallest rings, all rings full both ways, loses nothing and never stops") {
  constexpr std::size_t nodes = 8;
  const std::uint64_t seed = 99;
  CAPTURE(seed);
  struct Node {
    Doorbell bell;
    Channel in, out;
    explicit Node(Doorbell& server) : in(4096, &bell, &server), out(4096, &server, &bell) {}
  };
  Watchdog dog("a star of nine threads");
  auto server = std::make_unique<Doorbell>();
  std::vector<std::unique_ptr<Node>> all;
  for (std::size_t i = 0; i < nodes; ++i) all.push_back(std::make_unique<Node>(*server));

  std::atomic<std::uint64_t> wrong{0};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < nodes; ++i) {
    threads.emplace_back([&, i] {
      Node& node = *all[i];
      Post& post = dog.post("node " + std::to_string(i));
      Talker talker(node.out.sender(), node.in.receiver(), seed + i);
      while (!talker.done()) {
        if (talker.step()) {
          post.moves();
        } else if (!talker.done()) {
          post.waits_for(talker.waits_for());
          node.bell.wait([&] { return talker.ready(); });
          post.waits_for(nullptr);
        }
      }
      post.leaves();
      wrong.fetch_add(talker.wrong());
    });
  }
  std::vector<Talker> talkers;
  for (std::size_t i = 0; i < nodes; ++i) {
    talkers.emplace_back(all[i]->in.sender(), all[i]->out.receiver(), seed + nodes + i);
  }
  const auto done = [&] {
    return std::all_of(talkers.begin(), talkers.end(), [](const Talker& talker) { return talker.done(); });
  };
  Post& post = dog.post("the server");
  while (!done()) {
    bool progress = false;
    for (Talker& talker : talkers) progress = talker.step() || progress;
    if (progress) post.moves();
    if (progress || done()) continue;
    post.waits_for("a message of any node, or room to any");
    server->wait(
        [&] { return std::any_of(talkers.begin(), talkers.end(), [](Talker& talker) { return talker.ready(); }); });
    post.waits_for(nullptr);
  }
  post.leaves();
  for (std::thread& thread : threads) thread.join();
  for (const Talker& talker : talkers) wrong.fetch_add(talker.wrong());
  CHECK(wrong.load() == 0);
}

}  // namespace
}  // namespace ringfence::link
