#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace ringfence::dds {

/// The release of this process, as shown in logs: the project's version and base::bits_version. A World and its nodes
/// must have the same release, because another release may compute contacts with other bits.
const std::string& own_release();

/// Hash that differs if records have another layout or the release is another one: `layout` of Presence and Terms.
std::uint64_t fingerprint(std::string_view release = own_release());

}  // namespace ringfence::dds
