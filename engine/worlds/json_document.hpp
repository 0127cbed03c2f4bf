#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "ringfence/pose.hpp"

namespace ringfence::worlds {

/// Keeps members in the order of the file.
using Json = nlohmann::ordered_json;

/// A parsed JSON text that can report the line of each of its values. One thread at a time.
class JsonDocument {
 public:
  /// Parses `text`, which must outlive the document. `name` is the file name in messages.
  ///
  /// Throws InputError with FILE:LINE:COLUMN for text that is not JSON, and for arrays and objects that are nested
  /// more than 64 deep. Also throws it for a duplicate key in one of the outer two levels of objects, for example a
  /// duplicate shape name.
  JsonDocument(std::string_view text, std::string name);

  const Json& root() const noexcept { return root_; }
  const std::string& name() const noexcept { return name_; }

  /// Throws InputError with FILE:LINE, the path and `message`. The line is that of the value at `path`, or of the
  /// innermost existing value that encloses it. Cost: parses the text again.
  [[noreturn]] void fail(const Json::json_pointer& path, const std::string& message) const;

 private:
  std::string_view text_;
  std::string name_;
  Json root_;
};

/// A value of a document and its path. A view: the document must outlive it.
///
/// Each accessor checks type and range. On failure it throws InputError with line, path, found value and expectation.
class JsonValue {
 public:
  explicit JsonValue(const JsonDocument& document) : document_(&document), value_(&document.root()) {}

  bool has(std::string_view key) const;
  /// The member `key`; fails if it is missing. Precondition: this is an object.
  JsonValue field(std::string_view key) const;
  /// Precondition: this is an array and index < size().
  JsonValue item(std::size_t index) const;
  std::size_t size() const noexcept { return value_->size(); }

  /// Fails unless this is an object whose keys are all in `known`.
  void expect_object(std::initializer_list<std::string_view> known) const;
  void expect_array() const;
  void expect_any_object() const;
  const Json& raw() const noexcept { return *value_; }

  std::string text() const;
  double number() const;
  /// `number()` rounded to float; fails if it is out of the range of float.
  float number_float() const;
  /// An integer within [least, most].
  std::uint64_t unsigned_integer(std::uint64_t least, std::uint64_t most) const;
  Vec3d vector() const;
  Vec3f vector_float() const;
  /// Four numbers: a quaternion x, y, z, w whose length is 1 within 10^-3.
  Quat orientation() const;

  [[noreturn]] void fail(const std::string& message) const;
  /// Fails with "found VALUE; expected EXPECTED". Shortens a long value.
  [[noreturn]] void fail_unexpected(const std::string& expected) const;

 private:
  JsonValue(const JsonDocument& document, const Json& value, Json::json_pointer path)
      : document_(&document), value_(&value), path_(std::move(path)) {}
  void expect_numbers(std::size_t count, const char* expected) const;

  const JsonDocument* document_;
  const Json* value_;
  Json::json_pointer path_;
};

}  // namespace ringfence::worlds
