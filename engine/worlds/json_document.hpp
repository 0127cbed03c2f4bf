#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "ringfence/pose.hpp"

namespace ringfence::worlds {

/// Keeps the order of the file.
using Json = nlohmann::ordered_json;

/// A JSON text with what is needed to say where something in it is wrong.
class JsonDocument {
 public:
  /// Parses. Throws InputError with FILE:LINE:COLUMN for what is not JSON, and for a key that is there twice in one of
  /// the outer two levels (a shape's name, for one). `text` must outlive the document.
  JsonDocument(std::string_view text, std::string name);

  const Json& root() const noexcept { return root_; }
  const std::string& name() const noexcept { return name_; }

  /// Throws InputError: FILE:LINE of the value at `path` (or of the nearest one around it), the path, the message.
  [[noreturn]] void fail(const Json::json_pointer& path, const std::string& message) const;

 private:
  std::string_view text_;
  std::string name_;
  Json root_;
};

/// A value in a document, with its place. Reading it as what it is not fails with place, finding and expectation.
class JsonValue {
 public:
  explicit JsonValue(const JsonDocument& document) : document_(&document), value_(&document.root()) {}

  bool has(std::string_view key) const;
  /// The member `key`, which must be there.
  JsonValue field(std::string_view key) const;
  /// Precondition: index < size().
  JsonValue item(std::size_t index) const;
  std::size_t size() const noexcept { return value_->size(); }

  /// Fails unless this is an object, or an array, of nothing but what is listed.
  void expect_object(std::initializer_list<std::string_view> known) const;
  void expect_array() const;
  void expect_any_object() const;
  const Json& raw() const noexcept { return *value_; }

  std::string text() const;
  double number() const;
  /// `number`, rounded to float; fails when out of float's range.
  float number_float() const;
  /// A whole number within [least, most].
  std::uint64_t unsigned_integer(std::uint64_t least, std::uint64_t most) const;
  Vec3d vector() const;
  Vec3f vector_float() const;
  /// Four numbers, a quaternion within 10^-3 of unit length.
  Quat orientation() const;

  [[noreturn]] void fail(const std::string& message) const;
  /// "found ...; expected ..." with what is found cut to a readable length.
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
