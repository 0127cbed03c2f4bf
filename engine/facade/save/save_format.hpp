#pragma once

#include <memory>
#include <span>

#include "facade/save/saved_world.hpp"
#include "ringfence/save.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::facade {

/// Version of the format: of the records in saved_world.hpp, and of their order.
inline constexpr std::uint32_t save_version = 1;

/// Writes a save: a head, all fields in the order of SavedWorld, and a checksum (XXH3, 64 bits) of all bytes before it.
/// Returns whether the sink has taken everything.
bool write_save(const SavedWorld& saved, Sink& sink);

/// Reads a save. Throws Error unless it is one of this version and its records fit together, whatever the bytes are:
/// every object and request names a shape and a user that exist, numbers are unique and in order, poses are valid, and
/// contacts are between objects.
SavedWorld read_save(Source& source, std::span<const std::shared_ptr<const SupportFunction>> functions);

}  // namespace ringfence::facade
