// Property: whatever bytes a connection sends, over HTTP and as a WebSocket, the edge answers with replies and frames
// that are well formed, its events are in order, and nothing of the connection is left when it has ended. The input is
// a byte that selects whether guests are admitted, then parts: a byte for what the gateway does before the part
// arrives, two for the length of the part, and the part.
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz/memory_stream.hpp"
#include "fuzz/target.hpp"
#include "gateway/edge/http_session.hpp"
#include "gateway/edge/hub.hpp"
#include "gateway/protocol/client_messages.hpp"

using namespace ringfence;
using namespace ringfence::gateway;

namespace {

EdgeConfig edge_config(bool admits_guests) {
  EdgeConfig config;
  config.world = "w";
  config.limits.message_burst = 16;
  config.limits.waiting_bytes = 256;
  if (!admits_guests) config.token_key = std::string(32, 'k');
  return config;
}

/// A gateway to which one connection after the other is made.
class Gate {
 public:
  explicit Gate(bool admits_guests) : hub_(io_, edge_config(admits_guests)) {}

  void connect() {
    wire_ = std::make_shared<fuzz::Wire>(io_.get_executor());
    phase_ = Phase::waits;
    fuzz::require(hub_.open_address("127.0.0.1", true));
    connection_ = hub_.next_id();
    const auto session = std::make_shared<HttpSession<fuzz::MemoryStream>>(hub_, fuzz::MemoryStream(wire_), connection_,
                                                                           "127.0.0.1", true, 1e9);
    hub_.add(session);
    session->start();
    run();
  }
  void receive(std::span<const std::uint8_t> part) {
    wire_->receive(part);
    run();
  }
  /// Only what was admitted is sent something, or closed.
  void send(Delivery delivery, std::size_t size) {
    if (phase_ != Phase::open) return;
    outbox_.messages.push_back({connection_, delivery, 0, static_cast<std::uint32_t>(size)});
    outbox_.bytes.resize(size);
    hub_.send(outbox_);
    run();
  }
  void close() {
    if (phase_ != Phase::open) return;
    outbox_.closes.push_back({connection_, CloseCode::going_away, "the end"});
    hub_.send(outbox_);
    run();
  }
  /// The client ends the connection; what it was sent is returned.
  std::string end() {
    wire_->end();
    run();
    // Connections that were being closed have two seconds.
    for (int i = 0; i < 2; ++i) {
      hub_.sweep(1e6 * ++sweeps_);
      run();
    }
    fuzz::require(phase_ != Phase::open);
    fuzz::require(hub_.counters().open.load() == 0 && hub_.counters().admitted.load() == 0);
    fuzz::require(wire_.use_count() == 1);
    return std::move(wire_->sent);
  }

 private:
  enum class Phase { waits, open, closed };

  void run() {
    io_.restart();
    io_.poll();
    hub_.take(inbox_);
    for (const Event& event : inbox_.events) take(event);
  }
  void take(const Event& event) {
    fuzz::require(event.connection == connection_);
    switch (event.kind) {
      case Event::Kind::opened:
        fuzz::require(phase_ == Phase::waits);
        phase_ = Phase::open;
        break;
      case Event::Kind::message:
        fuzz::require(phase_ == Phase::open && inbox_.message(event).size() <= max_client_message);
        break;
      case Event::Kind::closed:
        fuzz::require(phase_ == Phase::open);
        phase_ = Phase::closed;
        break;
    }
  }

  net::io_context io_{1};
  Hub hub_;
  std::shared_ptr<fuzz::Wire> wire_;
  ConnectionId connection_ = 0;
  double sweeps_ = 1;
  Phase phase_ = Phase::waits;
  Inbox inbox_;
  Outbox outbox_;
};

/// Removes a reply from the front; whether it is the last that is HTTP.
bool take_reply(std::string_view& text) {
  fuzz::require(text.starts_with("HTTP/1."));
  const std::size_t end = text.find("\r\n\r\n");
  fuzz::require(end != std::string_view::npos);
  const std::string_view header = text.substr(0, end);
  text.remove_prefix(end + 4);
  if (header.substr(8).starts_with(" 101 ")) return true;
  // The body of a reply to HEAD is left out; what follows is then the next reply, or nothing.
  const std::size_t next = text.find("HTTP/1.");
  text.remove_prefix(std::min(next, text.size()));
  return false;
}

/// Removes a frame of a WebSocket from the front.
void take_frame(std::string_view& text) {
  const auto byte = [&](std::size_t index) {
    fuzz::require(index < text.size());
    return static_cast<std::uint8_t>(text[index]);
  };
  const std::uint8_t opcode = byte(0) & 15;
  fuzz::require((byte(0) & 0x70) == 0 && (opcode == 2 || opcode == 8 || opcode == 9 || opcode == 10));
  std::size_t size = byte(1), header = 2;
  fuzz::require(size < 127);  // without a mask, and no message here is longer than 65,535 bytes
  if (size == 126) {
    size = std::size_t{byte(2)} << 8 | byte(3);
    header = 4;
  }
  fuzz::require(opcode == 2 || size <= 125);
  fuzz::require(opcode != 8 || size != 1);
  fuzz::require(header + size <= text.size());
  text.remove_prefix(header + size);
}

void check_sent(std::string_view text) {
  bool is_http = true;
  while (!text.empty()) {
    if (is_http) {
      is_http = !take_reply(text);
    } else {
      take_frame(text);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  static Gate for_guests(true), for_tokens(false);
  if (size == 0) return 0;
  Gate& gate = (input[0] & 1) != 0 ? for_tokens : for_guests;
  std::span<const std::uint8_t> rest(input + 1, size - 1);
  gate.connect();
  while (rest.size() > 3) {
    switch (rest[0] & 7) {
      case 1:
        gate.send(Delivery::newest, 20);
        break;
      case 2:
        gate.send(Delivery::reliable, 130);
        break;
      case 3:
        gate.close();
        break;
      default:
        break;
    }
    const std::size_t length = std::min<std::size_t>(rest[1] | std::size_t{rest[2]} << 8, rest.size() - 3);
    gate.receive(rest.subspan(3, length));
    rest = rest.subspan(3 + length);
  }
  check_sent(gate.end());
  return 0;
}
