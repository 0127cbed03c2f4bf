#pragma once

#include <cstdint>
#include <string>

namespace ringfence::tools {

struct ListenAddress {
  std::string host;
  std::uint16_t port = 0;
};

/// Reads "HOST:PORT", where an IPv6 address may be in brackets. Throws Error that names the option.
ListenAddress read_listen_address(const std::string& text, const char* option);

}  // namespace ringfence::tools
