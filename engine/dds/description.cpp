#include "dds/description.hpp"

#include <cstring>
#include <string>
#include <variant>

#include "ringfence/error.hpp"

namespace ringfence::dds {

namespace {

template <class Value>
void put(std::vector<std::byte>& bytes, const Value& value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof value);
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

template <class Value>
void put_list(std::vector<std::byte>& bytes, const std::vector<Value>& list) {
  put(bytes, std::uint64_t{list.size()});
  const std::size_t at = bytes.size();
  bytes.resize(at + list.size() * sizeof(Value));
  if (!list.empty()) {
    std::memcpy(bytes.data() + at, list.data(), list.size() * sizeof(Value));
  }
}

class Unpacking {
 public:
  Unpacking(std::span<const std::byte> bytes, ShapeNumber shape) : bytes_(bytes), shape_(shape) {}

  template <class Value>
  Value take() {
    Value value;
    std::memcpy(&value, need(sizeof value), sizeof value);
    return value;
  }
  template <class Value>
  std::vector<Value> take_list() {
    const auto count = take<std::uint64_t>();
    if (count > bytes_.size() / sizeof(Value)) {
      fail();
    }
    std::vector<Value> list(static_cast<std::size_t>(count));
    if (!list.empty()) {
      std::memcpy(list.data(), need(list.size() * sizeof(Value)), list.size() * sizeof(Value));
    }
    return list;
  }
  void end() const {
    if (!bytes_.empty()) {
      fail();
    }
  }

 private:
  [[noreturn]] void fail() const {
    throw Error("shape " + std::to_string(shape_) +
                ": its bytes are not a valid shape; World and node may have different versions");
  }
  const std::byte* need(std::size_t bytes) {
    if (bytes_.size() < bytes) {
      fail();
    }
    const std::byte* at = bytes_.data();
    bytes_ = bytes_.subspan(bytes);
    return at;
  }

  std::span<const std::byte> bytes_;
  ShapeNumber shape_;
};

}  // namespace

std::vector<std::byte> pack_shape(const ShapeDescription& shape) {
  std::vector<std::byte> bytes;
  put(bytes, static_cast<std::uint64_t>(shape.index()));
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    put(bytes, *sphere);
  } else if (const auto* box = std::get_if<Box>(&shape)) {
    put(bytes, *box);
  } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    put(bytes, *capsule);
  } else if (const auto* hull = std::get_if<ConvexHull>(&shape)) {
    put_list(bytes, hull->points);
  } else if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) {
    put_list(bytes, mesh->vertices);
    put_list(bytes, mesh->indices);
  }
  return bytes;
}

ShapeDescription unpack_shape(std::span<const std::byte> bytes, ShapeNumber shape,
                              const std::function<std::shared_ptr<const SupportFunction>(ShapeNumber)>& support) {
  Unpacking unpacking(bytes, shape);
  ShapeDescription description;
  switch (static_cast<ShapeKind>(unpacking.take<std::uint64_t>())) {
    case ShapeKind::sphere:
      description = unpacking.take<Sphere>();
      break;
    case ShapeKind::box:
      description = unpacking.take<Box>();
      break;
    case ShapeKind::capsule:
      description = unpacking.take<Capsule>();
      break;
    case ShapeKind::hull:
      description = ConvexHull{unpacking.take_list<Vec3f>()};
      break;
    case ShapeKind::mesh: {
      TriangleMesh mesh;
      mesh.vertices = unpacking.take_list<Vec3f>();
      mesh.indices = unpacking.take_list<std::uint32_t>();
      description = std::move(mesh);
      break;
    }
    case ShapeKind::support: {
      SupportShape function{support ? support(shape) : nullptr};
      if (function.function == nullptr) {
        throw Error("shape " + std::to_string(shape) +
                    " is a support function, which is not sent: supply it with NodeServiceConfig::support");
      }
      description = std::move(function);
      break;
    }
    default:
      throw Error("shape " + std::to_string(shape) + " has a kind that this version does not support");
  }
  unpacking.end();
  return description;
}

}  // namespace ringfence::dds
