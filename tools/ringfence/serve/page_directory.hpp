#pragma once

#include <string>

namespace ringfence::tools {

/// The directory of the page: `chosen`, or if that is empty the one installed with the program; empty if there is none.
std::string page_directory(const std::string& chosen);

}  // namespace ringfence::tools
