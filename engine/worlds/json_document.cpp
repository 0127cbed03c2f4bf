#include "worlds/json_document.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "worlds/input_error.hpp"

namespace ringfence::worlds {
namespace {

/// Input iterator that counts line breaks. The parser copies its iterators, so the counter lives outside.
class LineCounter {
 public:
  // NOLINTNEXTLINE(readability-identifier-naming): the C++ standard prescribes this name
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  LineCounter(const char* at, std::size_t* line) : at_(at), line_(line) {}
  reference operator*() const { return *at_; }
  LineCounter& operator++() {
    if (*at_ == '\n') ++*line_;
    ++at_;
    return *this;
  }
  LineCounter operator++(int) {
    LineCounter before = *this;
    ++*this;
    return before;
  }
  bool operator==(const LineCounter& other) const { return at_ == other.at_; }
  bool operator!=(const LineCounter& other) const { return at_ != other.at_; }

 private:
  const char* at_;
  std::size_t* line_;
};

/// SAX handler that finds the line of a JSON path. If only the beginning of the path exists, finds the line of the
/// last step that exists.
class LineFinder : public nlohmann::json_sax<Json> {
 public:
  LineFinder(std::vector<std::string> path, const std::size_t* line) : path_(std::move(path)), line_(line) {}
  std::size_t found() const { return found_; }

  bool null() override { return value(); }
  bool boolean(bool) override { return value(); }
  bool number_integer(number_integer_t) override { return value(); }
  bool number_unsigned(number_unsigned_t) override { return value(); }
  bool number_float(number_float_t, const string_t&) override { return value(); }
  bool string(string_t&) override { return value(); }
  bool binary(binary_t&) override { return value(); }
  bool start_object(std::size_t) override { return open(false); }
  bool start_array(std::size_t) override { return open(true); }
  bool key(string_t& name) override {
    levels_.back().step = name;
    if (on_path()) found_ = *line_;
    return true;
  }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override { return false; }

 private:
  struct Level {
    bool array;
    std::size_t next;
    std::string step;
  };
  /// True if the current position is on the searched path.
  bool on_path() const {
    if (levels_.size() > path_.size()) return false;
    for (std::size_t i = levels_.size(); i-- > 0;) {
      if (levels_[i].step != path_[i]) return false;
    }
    return true;
  }
  void enter() {
    if (!levels_.empty() && levels_.back().array) {
      levels_.back().step = std::to_string(levels_.back().next++);
      if (on_path()) found_ = *line_;
    }
  }
  bool value() {
    enter();
    return true;
  }
  bool open(bool array) {
    enter();
    levels_.push_back({array, 0, {}});
    return true;
  }
  bool close() {
    levels_.pop_back();
    return true;
  }

  std::vector<std::string> path_;
  const std::size_t* line_;
  std::vector<Level> levels_;
  std::size_t found_ = 1;
};

std::size_t line_of(std::string_view text, Json::json_pointer path) {
  std::vector<std::string> steps;
  for (; !path.empty(); path.pop_back()) steps.push_back(path.back());
  std::reverse(steps.begin(), steps.end());
  std::size_t line = 1;
  LineFinder finder(std::move(steps), &line);
  Json::sax_parse(LineCounter(text.data(), &line), LineCounter(text.data() + text.size(), &line), &finder);
  return finder.found();
}

/// Formats a JSON pointer for messages: /objects/3/position becomes "objects[3].position".
std::string format_path(Json::json_pointer path) {
  std::vector<std::string> steps;
  for (; !path.empty(); path.pop_back()) steps.push_back(path.back());
  std::string text;
  for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
    const bool index =
        !step->empty() && std::all_of(step->begin(), step->end(), [](char c) { return c >= '0' && c <= '9'; });
    if (index) {
      text += fmt::format("[{}]", *step);
    } else {
      if (!text.empty()) text += '.';
      text += *step;
    }
  }
  return text;
}

std::string position_of_byte(std::string_view text, std::size_t byte) {
  const std::string_view before = text.substr(0, byte == 0 ? 0 : byte - 1);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t start = before.rfind('\n');
  const std::size_t column = start == std::string_view::npos ? before.size() + 1 : before.size() - start;
  return fmt::format("{}:{}", line, column);
}

/// The JSON library recurses when it prints a value, as an error message does. A scene has 5 levels.
constexpr std::size_t max_levels = 64;

/// Position of the first bracket that exceeds the maximum nesting; npos if there is none. In a text that is not JSON,
/// brackets in an unterminated string may count as levels; such a text is refused in any case.
std::size_t find_too_deep(std::string_view text) {
  std::size_t levels = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_string = false;
      }
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++levels > max_levels) return i;
    } else if ((c == ']' || c == '}') && levels > 0) {
      --levels;
    }
  }
  return std::string_view::npos;
}

}  // namespace

JsonDocument::JsonDocument(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {
  if (const std::size_t at = find_too_deep(text); at != std::string_view::npos) {
    throw InputError(
        fmt::format("{}:{}: arrays and objects are nested more than {} deep; expected at most {} levels, "
                    "remove the surplus brackets",
                    name_, position_of_byte(text, at + 1), max_levels, max_levels));
  }
  std::set<std::string> keys[3];
  std::string duplicate_key;
  const auto find_duplicate = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (depth < 0 || depth > 2) return true;
    if (event == Json::parse_event_t::object_start && depth < 2) keys[depth + 1].clear();
    if (event == Json::parse_event_t::key && !keys[depth].insert(parsed.get<std::string>()).second &&
        duplicate_key.empty()) {
      duplicate_key = parsed.get<std::string>();
    }
    return true;
  };
  try {
    root_ = Json::parse(text.begin(), text.end(), find_duplicate);
  } catch (const Json::parse_error& error) {
    const std::string what = error.what();
    const std::size_t reason = what.find("syntax error");
    const bool literal = what.find("invalid literal") != std::string::npos;
    throw InputError(fmt::format("{}:{}: not JSON: {}{}", name_, position_of_byte(text, error.byte),
                                 reason == std::string::npos ? what : what.substr(reason),
                                 literal ? " (JSON has neither NaN nor infinity)" : ""));
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("{}: JSON cannot be read: {}", name_, error.what()));
  }
  if (!duplicate_key.empty()) {
    throw InputError(fmt::format("{}: key \"{}\" occurs twice in one object; expected once", name_, duplicate_key));
  }
}

void JsonDocument::fail(const Json::json_pointer& path, const std::string& message) const {
  const std::string place = format_path(path);
  throw InputError(
      fmt::format("{}:{}: {}{}{}", name_, line_of(text_, path), place, place.empty() ? "" : ": ", message));
}

void JsonValue::fail(const std::string& message) const { document_->fail(path_, message); }

void JsonValue::fail_unexpected(const std::string& expected) const {
  constexpr std::size_t max_length = 60;
  std::string found = value_->dump();
  if (found.size() > max_length) found = found.substr(0, max_length) + "...";
  fail(fmt::format("found {}; expected {}", found, expected));
}

bool JsonValue::has(std::string_view key) const { return value_->contains(key); }

JsonValue JsonValue::field(std::string_view key) const {
  const auto member = value_->find(std::string(key));
  if (member == value_->end()) fail(fmt::format("the field \"{}\" is missing", key));
  return {*document_, *member, path_ / std::string(key)};
}

JsonValue JsonValue::item(std::size_t index) const { return {*document_, (*value_)[index], path_ / index}; }

void JsonValue::expect_any_object() const {
  if (!value_->is_object()) fail_unexpected("an object { }");
}

void JsonValue::expect_object(std::initializer_list<std::string_view> known) const {
  expect_any_object();
  for (const auto& member : value_->items()) {
    if (std::find(known.begin(), known.end(), member.key()) == known.end()) {
      fail(fmt::format("unknown field \"{}\"; expected {}", member.key(), fmt::join(known, ", ")));
    }
  }
}

void JsonValue::expect_array() const {
  if (!value_->is_array()) fail_unexpected("an array [ ]");
}

std::string JsonValue::text() const {
  if (!value_->is_string()) fail_unexpected("a string");
  return value_->get<std::string>();
}

double JsonValue::number() const {
  if (!value_->is_number()) fail_unexpected("a number");
  return value_->get<double>();
}

float JsonValue::number_float() const {
  const double wide = number();
  const auto narrow = static_cast<float>(wide);
  if (!std::isfinite(narrow)) fail_unexpected("a number within the range of float");
  return narrow;
}

std::uint64_t JsonValue::unsigned_integer(std::uint64_t least, std::uint64_t most) const {
  if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() < least || value_->get<std::uint64_t>() > most) {
    fail_unexpected(fmt::format("a whole number from {} to {}", least, most));
  }
  return value_->get<std::uint64_t>();
}

void JsonValue::expect_numbers(std::size_t count, const char* expected) const {
  const bool right = value_->is_array() && value_->size() == count &&
                     std::all_of(value_->begin(), value_->end(), [](const Json& item) { return item.is_number(); });
  if (!right) fail_unexpected(expected);
}

Vec3d JsonValue::vector() const {
  expect_numbers(3, "three numbers [x, y, z]");
  return {(*value_)[0].get<double>(), (*value_)[1].get<double>(), (*value_)[2].get<double>()};
}

Vec3f JsonValue::vector_float() const {
  expect_numbers(3, "three numbers [x, y, z]");
  return {item(0).number_float(), item(1).number_float(), item(2).number_float()};
}

Quat JsonValue::orientation() const {
  expect_numbers(4, "a quaternion of four numbers [x, y, z, w]");
  const Quat q{item(0).number_float(), item(1).number_float(), item(2).number_float(), item(3).number_float()};
  const double squared =
      double{q.x} * double{q.x} + double{q.y} * double{q.y} + double{q.z} * double{q.z} + double{q.w} * double{q.w};
  if (!(std::abs(std::sqrt(squared) - 1) <= 1e-3)) {
    fail_unexpected(
        fmt::format("a unit quaternion (length 1 within 0.001, this one has length {:.6g})", std::sqrt(squared)));
  }
  return q;
}

}  // namespace ringfence::worlds
