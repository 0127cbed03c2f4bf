#pragma once

#include <cstdint>

/// The numbers of roles and shapes inside the engine, where they are indices of arrays and fields of messages. The
/// public API has a type for each (ringfence/ids.hpp); the facade and the hosts of motion models convert.
namespace ringfence {

/// Number of a user node: UserId::number().
using UserNumber = std::uint32_t;
/// No user node: no_user.number().
inline constexpr UserNumber no_user_number = 0xffffffffu;

/// Number of a CD node: its slot, or NodeId::number() where the name says id.
using NodeNumber = std::uint32_t;

/// Number of a registered shape: ShapeId::number().
using ShapeNumber = std::uint32_t;

}  // namespace ringfence
