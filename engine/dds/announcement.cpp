#include "dds/announcement.hpp"

#include <algorithm>
#include <cstring>

#include "dds/release.hpp"

namespace ringfence::dds {

std::string printable(const char* text) {
  if (text == nullptr) {
    return {};
  }
  std::string out(text, strnlen(text, max_foreign_text));
  const auto is_control = [](char character) {
    const auto byte = static_cast<unsigned char>(character);
    return byte < 0x20 || byte == 0x7f;
  };
  std::replace_if(out.begin(), out.end(), is_control, '?');
  return out;
}

bool has_own_format(std::uint32_t version, const std::uint8_t (&order)[4]) noexcept {
  std::uint8_t own[4];
  write_byte_order(own);
  return version == wire_version && std::equal(own, own + 4, order);
}

Announcement read_announcement(const PresenceSample& sample) {
  const bool is_known = sample.state <= static_cast<std::uint32_t>(NodeState::refused);
  return {printable(sample.name), printable(sample.reason),
          has_own_format(sample.version, sample.order) && sample.layout == fingerprint(),
          is_known ? static_cast<NodeState>(sample.state) : NodeState::joining};
}

}  // namespace ringfence::dds
