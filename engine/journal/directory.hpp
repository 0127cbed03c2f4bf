#pragma once

#include <filesystem>

namespace ringfence::journal {

/// The database of a journal.
std::filesystem::path database_of(const std::filesystem::path& directory);

/// The right to write the journal in a directory: one process at a time has it. It ends with the process, however that
/// ends.
class WriteLock {
 public:
  /// Throws Error if another process has it, or if the directory cannot be written.
  explicit WriteLock(const std::filesystem::path& directory);
  ~WriteLock();
  WriteLock(const WriteLock&) = delete;
  WriteLock& operator=(const WriteLock&) = delete;

 private:
  int file_;
};

}  // namespace ringfence::journal
