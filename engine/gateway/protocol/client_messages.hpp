#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::gateway {

/// Version of the protocol of docs/client-protocol.md.
inline constexpr std::uint8_t client_protocol_version = 1;
/// Largest message of a client, bytes.
inline constexpr std::size_t max_client_message = 2048;
/// Largest body of an application message, bytes.
inline constexpr std::size_t max_application_bytes = 1024;

/// The first byte of a client's message.
enum class ClientMessageType : std::uint8_t {
  hello = 1,
  input = 2,
  ack = 3,
  get_shape = 4,
  application = 5,
  view = 6,
  describe = 7,
  command = 8,
};

// The messages of a client, as docs/client-protocol.md describes them. Spans and texts refer to the bytes that were
// read.

struct Hello {
  std::string_view token;
};
struct Input {
  std::uint64_t ack = 0;       ///< frame + 1; 0: none
  std::uint64_t sequence = 0;  ///< from 1
  std::uint16_t time = 0;
  std::span<const std::byte> body;
};
struct Ack {
  std::uint64_t ack = 0;
};
struct GetShape {
  ShapeId shape;
};
struct Application {
  std::span<const std::byte> body;
};
struct View {
  Vec3d centre;       ///< finite
  double radius = 0;  ///< >= 0, finite
};
struct Describe {
  ObjectNumber number = 0;
};
struct Command {
  enum class Kind : std::uint8_t { resize = 1, kill = 2, robots = 3 };
  Kind kind = Kind::resize;
  std::uint32_t value = 0;
};

/// A message that could not be read, and why; the text is part of a close reason.
struct Malformed {
  const char* reason = "";
};

using ClientMessage = std::variant<Malformed, Hello, Input, Ack, GetShape, Application, View, Describe, Command>;

/// Reads one message of a client. The bytes may be anything; what is not exactly one message is Malformed.
ClientMessage read_client_message(std::span<const std::byte> bytes) noexcept;

/// Appends a message to bytes.
void write(const Hello& message, std::vector<std::byte>& bytes);
void write(const Input& message, std::vector<std::byte>& bytes);
void write(const Ack& message, std::vector<std::byte>& bytes);
void write(const GetShape& message, std::vector<std::byte>& bytes);
void write(const Application& message, std::vector<std::byte>& bytes);
void write(const View& message, std::vector<std::byte>& bytes);
void write(const Describe& message, std::vector<std::byte>& bytes);
void write(const Command& message, std::vector<std::byte>& bytes);

}  // namespace ringfence::gateway
