#include "journal/database.hpp"

#include "ringfence/error.hpp"

namespace ringfence::journal {

Database::Database(const std::filesystem::path& file, Access access) : file_(file) {
  const int flags = access == Access::create  ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE
                    : access == Access::write ? SQLITE_OPEN_READWRITE
                                              : SQLITE_OPEN_READONLY;
  const int result = sqlite3_open_v2(file.c_str(), &connection_, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  if (result != SQLITE_OK) {
    const std::string reason = connection_ == nullptr ? "out of memory" : sqlite3_errmsg(connection_);
    sqlite3_close_v2(connection_);
    throw Error("journal: " + file.string() + " cannot be opened (" + reason + "): check the path and its permissions");
  }
  sqlite3_busy_timeout(connection_, 10'000);
}

void Database::execute(const char* sql) {
  if (sqlite3_exec(connection_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    fail("a command failed");
  }
}

void Database::fail(const std::string& what) const {
  const int code = sqlite3_errcode(connection_);
  const char* const remedy = code == SQLITE_CORRUPT || code == SQLITE_NOTADB
                                 ? "it is damaged: use a backup"
                                 : "check the disk, its space and the permissions";
  throw Error("journal: " + file_.string() + ": " + what + " (" + sqlite3_errmsg(connection_) + "): " + remedy);
}

Statement::Statement(const Database& database, const char* sql) : database_(database) {
  if (sqlite3_prepare_v2(database.connection(), sql, -1, &statement_, nullptr) != SQLITE_OK) {
    database.fail("it does not have the tables of a journal");
  }
}

Statement& Statement::bind(int position, std::uint64_t value) {
  if (sqlite3_bind_int64(statement_, position, static_cast<sqlite3_int64>(value)) != SQLITE_OK) {
    database_.fail("a value was refused");
  }
  return *this;
}

Statement& Statement::bind(int position, std::span<const std::byte> bytes) {
  // A null pointer would be NULL instead of an empty value.
  const void* const data = bytes.empty() ? static_cast<const void*>("") : bytes.data();
  if (sqlite3_bind_blob64(statement_, position, data, bytes.size(), SQLITE_STATIC) != SQLITE_OK) {
    database_.fail(std::to_string(bytes.size()) + " bytes were refused");
  }
  return *this;
}

Statement& Statement::bind(int position, const std::string& text) {
  if (sqlite3_bind_text64(statement_, position, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8) != SQLITE_OK) {
    database_.fail("a text was refused");
  }
  return *this;
}

bool Statement::step() {
  const int result = sqlite3_step(statement_);
  if (result != SQLITE_ROW && result != SQLITE_DONE) {
    database_.fail("reading or writing failed");
  }
  return result == SQLITE_ROW;
}

void Statement::run() {
  while (step()) {
  }
  reset();
}

void Statement::reset() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

std::uint64_t Statement::number(int column) const noexcept {
  return static_cast<std::uint64_t>(sqlite3_column_int64(statement_, column));
}

std::span<const std::byte> Statement::bytes(int column) const noexcept {
  const void* const data = sqlite3_column_blob(statement_, column);
  return {static_cast<const std::byte*>(data), static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}

std::string Statement::text(int column) const {
  const auto all = bytes(column);
  return std::string(reinterpret_cast<const char*>(all.data()), all.size());
}

}  // namespace ringfence::journal
