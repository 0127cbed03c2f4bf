#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <sqlite3.h>

namespace ringfence::journal {

/// A connection with an SQLite database. Every failure is an Error that names the file.
///
/// Threads: belongs to one thread at a time.
class Database {
 public:
  enum class Access : std::uint8_t { create, write, read };
  Database(const std::filesystem::path& file, Access access);
  ~Database() { sqlite3_close_v2(connection_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void execute(const char* sql);
  sqlite3* connection() const noexcept { return connection_; }
  const std::filesystem::path& file() const noexcept { return file_; }
  /// Throws Error with the reason of the last failure.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::filesystem::path file_;
  sqlite3* connection_ = nullptr;
};

/// A prepared statement.
class Statement {
 public:
  Statement(const Database& database, const char* sql);
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& bind(int position, std::uint64_t value);
  // Not copied: bytes and text outlive the next reset().
  Statement& bind(int position, std::span<const std::byte> bytes);
  Statement& bind(int position, const std::string& text);
  /// Runs until the next row; false at the end.
  bool step();
  /// Runs to the end and resets the statement.
  void run();
  void reset();

  std::uint64_t number(int column) const noexcept;
  /// Valid until the next step or reset.
  std::span<const std::byte> bytes(int column) const noexcept;
  std::string text(int column) const;

 private:
  const Database& database_;
  sqlite3_stmt* statement_ = nullptr;
};

}  // namespace ringfence::journal
