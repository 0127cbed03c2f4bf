#include "gateway/protocol/client_messages.hpp"

#include <cmath>

#include "gateway/protocol/byte_reader.hpp"
#include "gateway/protocol/byte_writer.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::gateway {
namespace {

void write_type(ByteWriter& writer, ClientMessageType type) { writer.fixed(static_cast<std::uint8_t>(type)); }

ClientMessage read_hello(ByteReader& reader) noexcept {
  if (reader.fixed<std::uint8_t>() != client_protocol_version) {
    return Malformed{"hello: this gateway has version 1 of the protocol"};
  }
  return Hello{reader.text(max_client_message)};
}

ClientMessage read_input(ByteReader& reader) noexcept {
  Input input;
  input.ack = reader.var();
  input.sequence = reader.var();
  input.time = reader.fixed<std::uint16_t>();
  input.body = reader.bytes(max_input_bytes);
  if (reader.ok() && input.sequence == 0) return Malformed{"input: sequence numbers begin with 1"};
  return input;
}

ClientMessage read_view(ByteReader& reader) noexcept {
  View view;
  view.centre.x = reader.fixed<double>();
  view.centre.y = reader.fixed<double>();
  view.centre.z = reader.fixed<double>();
  view.radius = reader.fixed<double>();
  const bool finite = std::isfinite(view.centre.x) && std::isfinite(view.centre.y) && std::isfinite(view.centre.z) &&
                      std::isfinite(view.radius);
  if (!finite || view.radius < 0) return Malformed{"view: the centre must be finite, and the radius at least 0"};
  return view;
}

ClientMessage read_application(ByteReader& reader) noexcept {
  if (reader.left() > max_application_bytes) return Malformed{"application: at most 1024 bytes"};
  return Application{reader.rest()};
}

ClientMessage read_command(ByteReader& reader) noexcept {
  const auto kind = reader.fixed<std::uint8_t>();
  if (kind < 1 || kind > 3) return Malformed{"command: unknown"};
  return Command{static_cast<Command::Kind>(kind), reader.var32()};
}

ClientMessage read_body(ClientMessageType type, ByteReader& reader) noexcept {
  switch (type) {
    case ClientMessageType::hello:
      return read_hello(reader);
    case ClientMessageType::input:
      return read_input(reader);
    case ClientMessageType::ack:
      return Ack{reader.var()};
    case ClientMessageType::get_shape:
      return GetShape{ShapeId(reader.var32())};
    case ClientMessageType::application:
      return read_application(reader);
    case ClientMessageType::view:
      return read_view(reader);
    case ClientMessageType::describe:
      return Describe{reader.var32()};
    case ClientMessageType::command:
      return read_command(reader);
  }
  return Malformed{"unknown type of message"};
}

}  // namespace

ClientMessage read_client_message(std::span<const std::byte> bytes) noexcept {
  if (bytes.empty()) return Malformed{"an empty message"};
  ByteReader reader(bytes);
  const auto type = static_cast<ClientMessageType>(reader.fixed<std::uint8_t>());
  const ClientMessage message = read_body(type, reader);
  if (std::holds_alternative<Malformed>(message) || reader.at_end()) return message;
  return Malformed{"a message whose fields do not fit its length"};
}

void write(const Hello& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::hello);
  writer.fixed(client_protocol_version);
  writer.text(message.token);
}

void write(const Input& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::input);
  writer.var(message.ack);
  writer.var(message.sequence);
  writer.fixed(message.time);
  writer.bytes(message.body);
}

void write(const Ack& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::ack);
  writer.var(message.ack);
}

void write(const GetShape& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::get_shape);
  writer.var(message.shape.number());
}

void write(const Application& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::application);
  writer.raw(message.body);
}

void write(const View& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::view);
  writer.fixed(message.centre.x);
  writer.fixed(message.centre.y);
  writer.fixed(message.centre.z);
  writer.fixed(message.radius);
}

void write(const Describe& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::describe);
  writer.var(message.number);
}

void write(const Command& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ClientMessageType::command);
  writer.fixed(static_cast<std::uint8_t>(message.kind));
  writer.var(message.value);
}

}  // namespace ringfence::gateway
