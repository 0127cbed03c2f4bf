#pragma once

#include <string>

namespace ringfence::journal {

/// The release of the library. Frames of one release are reproduced by the same release.
std::string release();

}  // namespace ringfence::journal
