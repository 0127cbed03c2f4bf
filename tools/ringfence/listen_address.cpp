#include "listen_address.hpp"

#include <charconv>
#include <system_error>

#include <fmt/format.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {

ListenAddress read_listen_address(const std::string& text, const char* option) {
  const std::size_t colon = text.rfind(':');
  std::uint32_t port = 0;
  const bool has_colon = colon != std::string::npos && colon > 0;
  const char* const begin = text.data() + (has_colon ? colon + 1 : text.size());
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), port);
  if (!has_colon || error != std::errc() || end != text.data() + text.size() || port > 65535) {
    throw Error(fmt::format("{}: found {}; expected HOST:PORT such as 127.0.0.1:8080", option, text));
  }
  ListenAddress address{text.substr(0, colon), static_cast<std::uint16_t>(port)};
  if (address.host.starts_with('[') && address.host.ends_with(']')) {
    address.host = address.host.substr(1, address.host.size() - 2);
  }
  return address;
}

}  // namespace ringfence::tools
