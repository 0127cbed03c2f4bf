#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "ringfence/pose.hpp"

namespace ringfence::worlds {

/// The lines of a CSV text, one after another, and the values of their fields. Every failure throws InputError with
/// FILE:LINE, the field, what was found and what is expected. Fields have no quotes. One thread at a time.
class CsvText {
 public:
  /// `name` is the file name in messages. Both must outlive the object.
  CsvText(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  /// The next line without its end; empty after the last.
  std::optional<std::string_view> next_line();
  /// Splits the current line at its commas. Fails unless it has as many fields as `parts`. `header` is for the message.
  void split(std::string_view line, std::span<std::string_view> parts, std::string_view header) const;

  /// Throws InputError for the current line.
  [[noreturn]] void fail(const std::string& message) const;
  /// Fails with: FIELD: found "TEXT"; expected EXPECTED
  [[noreturn]] void fail_unexpected(const char* field, std::string_view text, const std::string& expected) const;

  template <class Number>
  Number number(std::string_view text, const char* field, const char* expected) const {
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) fail_unexpected(field, text, expected);
    return value;
  }
  template <class Number>
  Number finite(std::string_view text, const char* field) const {
    const auto value = number<Number>(text, field, "a finite number");
    if (!std::isfinite(value)) fail_unexpected(field, text, "a finite number");
    return value;
  }
  /// Four fields qx, qy, qz, qw: a quaternion whose length is 1 within 10^-3.
  Quat orientation(std::span<const std::string_view, 4> parts) const;

 private:
  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;
};

/// Whether the length of a quaternion is 1 within 10^-3.
bool is_unit(const Quat& orientation);
/// "(x, y, z, w)"
std::string format_quaternion(const Quat& orientation);

}  // namespace ringfence::worlds
