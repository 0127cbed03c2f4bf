#include "dds/release.hpp"

#include "base/bits_version.hpp"
#include "dds/wire.hpp"

namespace ringfence::dds {

const std::string& own_release() {
  static const std::string release =
      std::string(RINGFENCE_VERSION) + " (bits " + std::to_string(base::bits_version) + ")";
  return release;
}

std::uint64_t fingerprint(std::string_view release) {
  std::uint64_t hash = record_layout_hash();
  for (const char character : release) {
    hash = (hash ^ static_cast<unsigned char>(character)) * 0x100000001b3u;
  }
  return hash;
}

}  // namespace ringfence::dds
