#include "journal/release.hpp"

#include "base/bits_version.hpp"

namespace ringfence::journal {

std::string release() { return std::string(RINGFENCE_VERSION) + " (bits " + std::to_string(base::bits_version) + ")"; }

}  // namespace ringfence::journal
