#include "gateway/edge/network_model.hpp"

#include <charconv>
#include <cmath>
#include <string>

#include "gateway/edge/asio.hpp"
#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

constexpr double max_delay_ms = 60'000;

[[noreturn]] void fail(std::string_view part) {
  throw Error(
      "network: found " + std::string(part) +
      "; expected parts such as delay=150ms, jitter=50ms, loss=5%, share=50%, address=127.0.0.2, each once, separated "
      "by commas");
}

/// The number before `unit`, which ends the text.
double number(std::string_view part, std::string_view text, std::string_view unit, double most) {
  if (!text.ends_with(unit)) fail(part);
  text.remove_suffix(unit.size());
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= most)) fail(part);
  return value;
}

std::string read_address(std::string_view part, std::string_view text) {
  error_code error;
  const net::ip::address_v4 read = net::ip::make_address_v4(text, error);
  if (error) fail(part);
  return read.to_string();
}

}  // namespace

NetworkModel NetworkModel::parse(std::string_view text) {
  NetworkModel model;
  bool has_delay = false, has_jitter = false, has_loss = false, has_share = false, has_address = false;
  const auto once = [](bool& has, std::string_view part) {
    if (has) fail(part);
    has = true;
  };
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    text = comma == std::string_view::npos ? std::string_view() : text.substr(comma + 1);
    const std::size_t equals = part.find('=');
    if (equals == std::string_view::npos) fail(part);
    const std::string_view name = part.substr(0, equals), value = part.substr(equals + 1);
    if (name == "delay") {
      once(has_delay, part);
      model.delay_s = number(part, value, "ms", max_delay_ms) / 1e3;
    } else if (name == "jitter") {
      once(has_jitter, part);
      model.jitter_s = number(part, value, "ms", max_delay_ms) / 1e3;
    } else if (name == "loss") {
      once(has_loss, part);
      model.loss = number(part, value, "%", 100) / 100;
    } else if (name == "share") {
      once(has_share, part);
      model.share = number(part, value, "%", 100) / 100;
    } else if (name == "address") {
      once(has_address, part);
      model.address = read_address(part, value);
    } else {
      fail(part);
    }
  }
  return model;
}

}  // namespace ringfence::gateway
