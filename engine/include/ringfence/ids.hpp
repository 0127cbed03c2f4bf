#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace ringfence {

/// Number of an object in scenes, files, digests and contacts: 1 to 2^32 - 1, unique among live objects.
///
/// It orders every pair (a < b) and keys the object's random stream. It is a plain number, so no call takes it in place
/// of an id.
using ObjectNumber = std::uint32_t;

/// Handle of a live object: its number and the generation of its spawn. The value 0 is null.
///
/// Every spawn has its own generation, so the handle of a destroyed object is refused as stale even if its number is in
/// use again. Generations wrap around after 2^32 - 1 spawns.
struct ObjectId {
  std::uint64_t value = 0;

  static constexpr ObjectId of(ObjectNumber number, std::uint32_t generation) noexcept {
    return {std::uint64_t{generation} << 32 | number};
  }
  constexpr ObjectNumber number() const noexcept { return static_cast<ObjectNumber>(value); }
  constexpr std::uint32_t generation() const noexcept { return static_cast<std::uint32_t>(value >> 32); }
  constexpr explicit operator bool() const noexcept { return value != 0; }
  constexpr auto operator<=>(const ObjectId&) const noexcept = default;
};

/// Id of a user node: its number, chosen by the caller that connects it, 0 to Limits::users - 1. The default is
/// no_user.
class UserId {
 public:
  constexpr UserId() noexcept = default;
  constexpr explicit UserId(std::uint32_t number) noexcept : number_(number) {}
  constexpr std::uint32_t number() const noexcept { return number_; }
  /// Whether it is not no_user.
  constexpr explicit operator bool() const noexcept { return number_ != 0xffffffffu; }
  constexpr auto operator<=>(const UserId&) const noexcept = default;

 private:
  std::uint32_t number_ = 0xffffffffu;
};
/// No user node.
inline constexpr UserId no_user{};

/// Id of a CD node: the first nodes have the numbers 0 to nodes - 1, and no number is used again.
class NodeId {
 public:
  constexpr NodeId() noexcept = default;
  constexpr explicit NodeId(std::uint32_t number) noexcept : number_(number) {}
  constexpr std::uint32_t number() const noexcept { return number_; }
  constexpr auto operator<=>(const NodeId&) const noexcept = default;

 private:
  std::uint32_t number_ = 0;
};

/// Id of a registered shape: its number in the order of registration, from 0.
class ShapeId {
 public:
  constexpr ShapeId() noexcept = default;
  constexpr explicit ShapeId(std::uint32_t number) noexcept : number_(number) {}
  constexpr std::uint32_t number() const noexcept { return number_; }
  constexpr auto operator<=>(const ShapeId&) const noexcept = default;

 private:
  std::uint32_t number_ = 0;
};

}  // namespace ringfence

/// Hashes, so that ids can be keys of unordered containers.
template <>
struct std::hash<ringfence::ObjectId> {
  std::size_t operator()(ringfence::ObjectId id) const noexcept { return std::hash<std::uint64_t>()(id.value); }
};
template <>
struct std::hash<ringfence::UserId> {
  std::size_t operator()(ringfence::UserId id) const noexcept { return std::hash<std::uint32_t>()(id.number()); }
};
template <>
struct std::hash<ringfence::NodeId> {
  std::size_t operator()(ringfence::NodeId id) const noexcept { return std::hash<std::uint32_t>()(id.number()); }
};
template <>
struct std::hash<ringfence::ShapeId> {
  std::size_t operator()(ringfence::ShapeId id) const noexcept { return std::hash<std::uint32_t>()(id.number()); }
};
