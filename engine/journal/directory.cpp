#include "journal/directory.hpp"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::journal {

std::filesystem::path database_of(const std::filesystem::path& directory) { return directory / "journal.db"; }

WriteLock::WriteLock(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "lock";
  file_ = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  if (file_ < 0) {
    throw Error("journal: " + path.string() + " cannot be written (" + std::strerror(errno) +
                "): check the path and its permissions");
  }
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const bool taken = errno == EWOULDBLOCK;
    const std::string reason = std::strerror(errno);
    close(file_);
    throw Error(taken ? "journal: another process writes the journal in " + directory.string() +
                            ": stop it first, or use another directory"
                      : "journal: " + path.string() + " cannot be locked (" + reason + ")");
  }
}

WriteLock::~WriteLock() { close(file_); }

}  // namespace ringfence::journal
