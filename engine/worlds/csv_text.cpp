#include "worlds/csv_text.hpp"

#include <fmt/format.h>

#include "worlds/input_error.hpp"

namespace ringfence::worlds {

void CsvText::fail(const std::string& message) const {
  throw InputError(fmt::format("{}:{}: {}", name_, line_, message));
}

void CsvText::fail_unexpected(const char* field, std::string_view text, const std::string& expected) const {
  fail(fmt::format("{}: found \"{}\"; expected {}", field, text, expected));
}

std::optional<std::string_view> CsvText::next_line() {
  if (at_ >= text_.size()) return std::nullopt;
  ++line_;
  std::size_t end = text_.find('\n', at_);
  if (end == std::string_view::npos) end = text_.size();
  std::string_view line = text_.substr(at_, end - at_);
  at_ = end + 1;
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

void CsvText::split(std::string_view line, std::span<std::string_view> parts, std::string_view header) const {
  std::size_t count = 0;
  for (std::size_t at = 0; at <= line.size();) {
    std::size_t end = line.find(',', at);
    if (end == std::string_view::npos) end = line.size();
    if (count < parts.size()) parts[count] = line.substr(at, end - at);
    ++count;
    at = end + 1;
  }
  if (count != parts.size()) fail(fmt::format("found {} fields; expected {}: {}", count, parts.size(), header));
}

Quat CsvText::orientation(std::span<const std::string_view, 4> parts) const {
  const Quat found{finite<float>(parts[0], "qx"), finite<float>(parts[1], "qy"), finite<float>(parts[2], "qz"),
                   finite<float>(parts[3], "qw")};
  if (!is_unit(found)) {
    fail(fmt::format("qx,qy,qz,qw: found {}; expected a unit quaternion (length 1 within 0.001)",
                     format_quaternion(found)));
  }
  return found;
}

bool is_unit(const Quat& q) {
  const double squared =
      double{q.x} * double{q.x} + double{q.y} * double{q.y} + double{q.z} * double{q.z} + double{q.w} * double{q.w};
  return std::abs(std::sqrt(squared) - 1) <= 1e-3;
}

std::string format_quaternion(const Quat& q) { return fmt::format("({}, {}, {}, {})", q.x, q.y, q.z, q.w); }

}  // namespace ringfence::worlds
