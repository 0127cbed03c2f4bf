#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "trace.hpp"
#include "worlds/input_error.hpp"

namespace ringfence::tools {
namespace {

constexpr float radius = 0.2f;        // of the capsule, metres
constexpr float half_height = 0.68f;  // of its segment, metres: a person is 1.76 m tall
constexpr double centre_height = 0.88;

/// Reads and removes the next number of a line, with the blanks before it. Empty if there is none.
template <class Number>
std::optional<Number> next_number(std::string_view& line) {
  const std::size_t start = line.find_first_not_of(" \t\r");
  if (start == std::string_view::npos) return std::nullopt;
  line.remove_prefix(start);
  Number value{};
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
  if (error != std::errc()) return std::nullopt;
  line.remove_prefix(static_cast<std::size_t>(end - line.data()));
  return value;
}

}  // namespace

Trace read_crowd(std::string_view text, const std::string& name) {
  Trace trace;
  trace.shape = {"person", Capsule{radius, half_height}, {}};
  trace.longest_gap = 25;
  trace.margin = 1;
  std::size_t number = 0;
  std::uint32_t first = 0xffffffffu;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (line.starts_with('#') || line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    const auto id = next_number<std::uint32_t>(line);
    const auto frame = next_number<std::uint32_t>(line);
    const auto x = next_number<double>(line), y = next_number<double>(line), z = next_number<double>(line);
    if (!id || !frame || !x || !y || !z || !std::isfinite(*x) || !std::isfinite(*y)) {
      throw worlds::InputError(fmt::format("{}:{}: expected five numbers: id frame x/cm y/cm z/cm", name, number));
    }
    std::vector<Sample>& track = trace.tracks[fmt::format("{:010}", *id)];
    if (!track.empty() && track.back().frame >= *frame) {
      throw worlds::InputError(fmt::format("{}:{}: frame: found {} after {} of person {}; expected ascending order",
                                           name, number, *frame, track.back().frame, *id));
    }
    track.push_back({*frame, {*x / 100, *y / 100, centre_height}});
    first = std::min(first, *frame);
  }
  if (trace.tracks.empty()) throw worlds::InputError(fmt::format("{}: expected at least one line of numbers", name));
  for (auto& [track_name, samples] : trace.tracks) {
    for (Sample& sample : samples) sample.frame -= first;
  }
  return trace;
}

}  // namespace ringfence::tools
