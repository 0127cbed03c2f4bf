#pragma once

#include <cstdio>
#include <string>

namespace ringfence::reference {

/// The values in the format of printf. At most 255 characters; the rest is cut off.
template <class... Values>
std::string text(const char* format, Values... values) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

}  // namespace ringfence::reference
