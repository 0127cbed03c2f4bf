#include "gateway/protocol/server_messages.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <variant>

#include "gateway/protocol/byte_reader.hpp"
#include "gateway/protocol/byte_writer.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/shape_radius.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::gateway {
namespace {

// Bits of the flags of an update.
constexpr std::uint8_t has_own = 1;
constexpr std::uint8_t has_touching = 2;
constexpr std::size_t max_mesh_triangles = 65535;
constexpr std::uint8_t no_such_shape = 255;

void write_type(ByteWriter& writer, ServerMessageType type) { writer.fixed(static_cast<std::uint8_t>(type)); }

void write_vector(ByteWriter& writer, const Vec3d& v) {
  writer.fixed(v.x);
  writer.fixed(v.y);
  writer.fixed(v.z);
}
void write_vector(ByteWriter& writer, const Vec3f& v) {
  writer.fixed(v.x);
  writer.fixed(v.y);
  writer.fixed(v.z);
}

void write_offset(ByteWriter& writer, const QuantisedPosition& position, const QuantisedPosition& origin) {
  // Modulo 2^64, as read_offset adds, so that no values of a message can overflow.
  const auto difference = [](std::int64_t a, std::int64_t b) {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
  };
  writer.svar(difference(position.x, origin.x));
  writer.svar(difference(position.y, origin.y));
  writer.svar(difference(position.z, origin.z));
}

/// Users are written as number + 1, so that no user is 0.
std::uint64_t user_code(UserId user) noexcept { return user ? std::uint64_t{user.number()} + 1 : 0; }

/// Writes the differences of ascending numbers.
class Differences {
 public:
  std::uint32_t of(ObjectNumber number) noexcept {
    const std::uint32_t difference = number - last_;
    last_ = number;
    return difference;
  }

 private:
  ObjectNumber last_ = 0;
};

void write_own(ByteWriter& writer, const OwnState& own) {
  writer.var(own.number);
  writer.var(own.shape.number());
  write_vector(writer, own.pose.position);
  writer.fixed(own.pose.orientation.x);
  writer.fixed(own.pose.orientation.y);
  writer.fixed(own.pose.orientation.z);
  writer.fixed(own.pose.orientation.w);
  writer.bytes(own.state);
}

void write_entered(ByteWriter& writer, const Update& update) {
  writer.var(update.entered.size());
  Differences differences;
  for (const EnteredObject& object : update.entered) {
    writer.var(differences.of(object.number));
    writer.var(object.generation);
    writer.var(object.shape.number());
    writer.fixed(static_cast<std::uint8_t>(object.category));
    writer.var(user_code(object.user));
    writer.bytes(object.metadata);
    write_offset(writer, object.position, update.origin);
    writer.fixed(object.turn);
  }
}

void write_moved(ByteWriter& writer, const Update& update) {
  writer.var(update.moved.size());
  Differences differences;
  for (const MovedObject& object : update.moved) {
    writer.var(std::uint64_t{differences.of(object.number)} << 1 | (object.has_turn ? 1 : 0));
    write_offset(writer, object.position, update.origin);
    if (object.has_turn) writer.fixed(object.turn);
  }
}

void write_contacts(ByteWriter& writer, const Update& update) {
  writer.var(update.contacts.size());
  Differences differences;
  for (const OwnContact& contact : update.contacts) {
    writer.var(differences.of(contact.other));
    writer.fixed(static_cast<std::uint8_t>(contact.phase));
    writer.var(contact.age);
    if (contact.phase == Phase::end) continue;
    writer.fixed(contact.normal.x);
    writer.fixed(contact.normal.y);
    writer.fixed(contact.normal.z);
    writer.var(contact.depth);
    write_offset(writer, contact.point, update.origin);
  }
}

void write_touching(ByteWriter& writer, const Update& update) {
  writer.var(update.touching.size());
  ObjectNumber last = 0;
  for (const auto [a, b] : update.touching) {
    writer.var(a - last);
    writer.var(b - a);
    last = a;
  }
}

void write_mesh(ByteWriter& writer, const TriangleMesh& mesh) {
  writer.fixed(static_cast<std::uint8_t>(ShapeKind::mesh));
  writer.var(mesh.vertices.size());
  writer.var(mesh.indices.size() / 3);
  for (const Vec3f& vertex : mesh.vertices) write_vector(writer, vertex);
  for (const std::uint32_t index : mesh.indices) writer.var(index);
}

void write_description(ByteWriter& writer, const ShapeDescription& description) {
  const auto kind = static_cast<std::uint8_t>(description.index());
  if (const auto* sphere = std::get_if<Sphere>(&description)) {
    writer.fixed(kind);
    writer.fixed(sphere->radius);
  } else if (const auto* box = std::get_if<Box>(&description)) {
    writer.fixed(kind);
    write_vector(writer, box->half_extents);
  } else if (const auto* capsule = std::get_if<Capsule>(&description)) {
    writer.fixed(kind);
    writer.fixed(capsule->radius);
    writer.fixed(capsule->half_height);
  } else if (const auto* hull = std::get_if<ConvexHull>(&description)) {
    writer.fixed(kind);
    writer.var(hull->points.size());
    for (const Vec3f& point : hull->points) write_vector(writer, point);
  } else if (const auto* mesh = std::get_if<TriangleMesh>(&description);
             mesh != nullptr && mesh->indices.size() / 3 <= max_mesh_triangles) {
    write_mesh(writer, *mesh);
  } else {
    writer.fixed(static_cast<std::uint8_t>(ShapeKind::support));
    writer.fixed(static_cast<float>(shape_radius(description)));
  }
}

Vec3d read_vector(ByteReader& reader) noexcept {
  Vec3d v;
  v.x = reader.fixed<double>();
  v.y = reader.fixed<double>();
  v.z = reader.fixed<double>();
  return v;
}

QuantisedPosition read_offset(ByteReader& reader, const QuantisedPosition& origin) noexcept {
  // Unsigned sums: the bytes of a gateway that is not ours may overflow.
  const auto sum = [](std::int64_t a, std::int64_t b) {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
  };
  QuantisedPosition position;
  position.x = sum(origin.x, reader.svar());
  position.y = sum(origin.y, reader.svar());
  position.z = sum(origin.z, reader.svar());
  return position;
}

UserId read_user(ByteReader& reader) noexcept {
  const std::uint32_t code = reader.var32();
  return code == 0 ? no_user : UserId(code - 1);
}

/// Reads ascending numbers from their differences.
class Numbers {
 public:
  ObjectNumber next(ByteReader& reader, std::uint64_t difference) noexcept {
    if (difference == 0 || difference > 0xffffffffu - last_) reader.fail();
    last_ += static_cast<ObjectNumber>(difference);
    return last_;
  }

 private:
  ObjectNumber last_ = 0;
};

void read_own(ByteReader& reader, Update& update) noexcept {
  OwnState& own = update.own.emplace();
  own.number = reader.var32();
  own.shape = ShapeId(reader.var32());
  own.pose.position = read_vector(reader);
  own.pose.orientation.x = reader.fixed<float>();
  own.pose.orientation.y = reader.fixed<float>();
  own.pose.orientation.z = reader.fixed<float>();
  own.pose.orientation.w = reader.fixed<float>();
  own.state = reader.bytes(max_motion_state);
}

void read_entered(ByteReader& reader, Update& update) {
  Numbers numbers;
  update.entered.resize(reader.count(13));
  for (EnteredObject& object : update.entered) {
    object.number = numbers.next(reader, reader.var());
    object.generation = reader.var32();
    object.shape = ShapeId(reader.var32());
    const auto category = reader.fixed<std::uint8_t>();
    if (category > static_cast<std::uint8_t>(Category::fixed)) return reader.fail();
    object.category = static_cast<Category>(category);
    object.user = read_user(reader);
    object.metadata = reader.bytes(max_metadata_bytes);
    object.position = read_offset(reader, update.origin);
    object.turn = reader.fixed<std::uint32_t>();
  }
}

void read_moved(ByteReader& reader, Update& update) {
  Numbers numbers;
  update.moved.resize(reader.count(4));
  for (MovedObject& object : update.moved) {
    const std::uint64_t code = reader.var();
    object.number = numbers.next(reader, code >> 1);
    object.has_turn = (code & 1) != 0;
    object.position = read_offset(reader, update.origin);
    object.turn = object.has_turn ? reader.fixed<std::uint32_t>() : 0;
  }
}

void read_contacts(ByteReader& reader, Update& update) {
  Numbers numbers;
  update.contacts.resize(reader.count(3));
  for (OwnContact& contact : update.contacts) {
    contact = {};
    contact.other = numbers.next(reader, reader.var());
    const auto phase = reader.fixed<std::uint8_t>();
    if (phase > static_cast<std::uint8_t>(Phase::end)) return reader.fail();
    contact.phase = static_cast<Phase>(phase);
    contact.age = reader.var();
    if (contact.phase == Phase::end) continue;
    contact.normal.x = reader.fixed<std::int8_t>();
    contact.normal.y = reader.fixed<std::int8_t>();
    contact.normal.z = reader.fixed<std::int8_t>();
    contact.depth = reader.var();
    contact.point = read_offset(reader, update.origin);
  }
}

void read_touching(ByteReader& reader, Update& update) {
  update.touching.resize(reader.count(2));
  if (update.touching.empty()) return reader.fail();
  TouchingPair last;
  for (TouchingPair& pair : update.touching) {
    const std::uint64_t step = reader.var(), difference = reader.var();
    pair.a = last.a + static_cast<ObjectNumber>(step);
    pair.b = pair.a + static_cast<ObjectNumber>(difference);
    const bool is_number = step <= 0xffffffffu - last.a && difference <= 0xffffffffu - pair.a;
    const bool is_after = pair.a > last.a || pair.b > last.b;
    if (!is_number || difference == 0 || !is_after) return reader.fail();
    last = pair;
  }
}

Vec3f read_point(ByteReader& reader) noexcept {
  Vec3f v;
  v.x = reader.fixed<float>();
  v.y = reader.fixed<float>();
  v.z = reader.fixed<float>();
  return v;
}

TriangleMesh read_mesh(ByteReader& reader) {
  const std::size_t vertices = reader.count(1), triangles = reader.count(1);
  TriangleMesh mesh;
  if (vertices > reader.left() / sizeof(Vec3f) || triangles > reader.left() / 3) {
    reader.fail();
    return mesh;
  }
  mesh.vertices.resize(vertices);
  for (Vec3f& vertex : mesh.vertices) vertex = read_point(reader);
  mesh.indices.resize(3 * triangles);
  for (std::uint32_t& index : mesh.indices) index = reader.var32();
  return mesh;
}

std::optional<ShapeDescription> read_description(ByteReader& reader, ShapeKind kind) {
  switch (kind) {
    case ShapeKind::sphere:
      return Sphere{reader.fixed<float>()};
    case ShapeKind::box:
      return Box{read_point(reader)};
    case ShapeKind::capsule: {
      Capsule capsule;
      capsule.radius = reader.fixed<float>();
      capsule.half_height = reader.fixed<float>();
      return capsule;
    }
    case ShapeKind::hull: {
      ConvexHull hull;
      hull.points.resize(reader.count(sizeof(Vec3f)));
      for (Vec3f& point : hull.points) point = read_point(reader);
      return hull;
    }
    case ShapeKind::mesh:
      return read_mesh(reader);
    case ShapeKind::support:
      reader.fixed<float>();
      break;
  }
  return std::nullopt;
}

}  // namespace

void Update::clear() noexcept {
  frame = since = time_us = sequence = age = hold_ms = 0;
  echo = 0;
  own.reset();
  origin = {};
  entered.clear();
  moved.clear();
  removed.clear();
  contacts.clear();
  touching.clear();
}

void write(const Welcome& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ServerMessageType::welcome);
  writer.fixed(client_protocol_version);
  writer.fixed(static_cast<std::uint8_t>(message.role));
  writer.var(user_code(message.user));
  writer.var(message.avatar);
  writer.var(message.frames);
  writer.fixed(message.rate);
  writer.fixed(message.interest);
  write_vector(writer, message.bounds_min);
  write_vector(writer, message.bounds_max);
  writer.text(message.world);
  writer.text(message.model);
  writer.bytes(message.parameters);
  writer.text(message.token);
}

void write(const Update& message, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ServerMessageType::update);
  writer.fixed<std::uint8_t>((message.own ? has_own : 0) | (message.touching.empty() ? 0 : has_touching));
  writer.var(message.frame);
  writer.var(message.since);
  writer.var(message.time_us);
  writer.var(message.sequence);
  writer.var(message.age);
  writer.fixed(message.echo);
  writer.var(message.hold_ms);
  if (message.own) write_own(writer, *message.own);
  write_offset(writer, message.origin, {});
  write_entered(writer, message);
  write_moved(writer, message);
  writer.var(message.removed.size());
  Differences differences;
  for (const ObjectNumber number : message.removed) writer.var(differences.of(number));
  write_contacts(writer, message);
  if (!message.touching.empty()) write_touching(writer, message);
}

void write_shape(ShapeId shape, const ShapeDescription* description, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, ServerMessageType::shape);
  writer.var(shape.number());
  if (description == nullptr) return writer.fixed(no_such_shape);
  write_description(writer, *description);
}

void write_body(ServerMessageType type, std::span<const std::byte> body, std::vector<std::byte>& bytes) {
  ByteWriter writer(bytes);
  write_type(writer, type);
  writer.raw(body);
}

void write_body(ServerMessageType type, std::string_view body, std::vector<std::byte>& bytes) {
  write_body(type, std::as_bytes(std::span(body)), bytes);
}

std::optional<ServerMessageType> type_of(std::span<const std::byte> bytes) noexcept {
  if (bytes.empty()) return std::nullopt;
  const auto type = static_cast<std::uint8_t>(bytes[0]);
  if (type < 1 || type > static_cast<std::uint8_t>(ServerMessageType::notice)) return std::nullopt;
  return static_cast<ServerMessageType>(type);
}

bool read(std::span<const std::byte> bytes, Welcome& message) {
  if (type_of(bytes) != ServerMessageType::welcome) return false;
  ByteReader reader(bytes.subspan(1));
  if (reader.fixed<std::uint8_t>() != client_protocol_version) return false;
  const auto role = reader.fixed<std::uint8_t>();
  if (role > static_cast<std::uint8_t>(Role::operate)) return false;
  message.role = static_cast<Role>(role);
  message.user = read_user(reader);
  message.avatar = reader.var32();
  message.frames = reader.var();
  message.rate = reader.fixed<float>();
  message.interest = reader.fixed<float>();
  message.bounds_min = read_vector(reader);
  message.bounds_max = read_vector(reader);
  message.world = reader.text(reader.left());
  message.model = reader.text(reader.left());
  message.parameters = reader.bytes(reader.left());
  message.token = reader.text(reader.left());
  return reader.at_end();
}

bool read_shape(std::span<const std::byte> bytes, ShapeId& shape, std::optional<ShapeDescription>& description) {
  if (type_of(bytes) != ServerMessageType::shape) return false;
  ByteReader reader(bytes.subspan(1));
  shape = ShapeId(reader.var32());
  description.reset();
  const auto kind = reader.fixed<std::uint8_t>();
  if (kind == no_such_shape) return reader.at_end();
  if (kind > static_cast<std::uint8_t>(ShapeKind::support)) return false;
  description = read_description(reader, static_cast<ShapeKind>(kind));
  return reader.at_end();
}

bool read(std::span<const std::byte> bytes, Update& message) {
  if (type_of(bytes) != ServerMessageType::update) return false;
  ByteReader reader(bytes.subspan(1));
  message.clear();
  const auto flags = reader.fixed<std::uint8_t>();
  if (flags > (has_own | has_touching)) return false;
  message.frame = reader.var();
  message.since = reader.var();
  message.time_us = reader.var();
  message.sequence = reader.var();
  message.age = reader.var();
  message.echo = reader.fixed<std::uint16_t>();
  message.hold_ms = reader.var();
  if ((flags & has_own) != 0) read_own(reader, message);
  message.origin = read_offset(reader, {});
  read_entered(reader, message);
  read_moved(reader, message);
  Numbers numbers;
  message.removed.resize(reader.count(1));
  for (ObjectNumber& number : message.removed) number = numbers.next(reader, reader.var());
  read_contacts(reader, message);
  if ((flags & has_touching) != 0) read_touching(reader, message);
  return reader.at_end();
}

}  // namespace ringfence::gateway
