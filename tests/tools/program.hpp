#pragma once

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

namespace ringfence::test {

/// Exit code and output of a run of the program.
struct ProgramResult {
  int code = -1;    ///< -1: it could not be started, or a signal ended it
  std::string out;  ///< standard output and standard error, as selected by `redirect`
};

/// Runs a shell command and waits for it. `out` is its standard output.
inline ProgramResult run_shell(const std::string& command) {
  ProgramResult result;
  std::FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return result;
  std::array<char, 4096> block;
  for (std::size_t got; (got = std::fread(block.data(), 1, block.size(), pipe)) > 0;)
    result.out.append(block.data(), got);
  const int status = pclose(pipe);
  if (WIFEXITED(status)) result.code = WEXITSTATUS(status);
  return result;
}

/// Runs the program with `arguments` in a shell and waits for it. By default `out` includes standard error.
/// `environment` is NAME=VALUE or empty. The texts are parts of a shell command, so they need the quotes of the shell.
inline ProgramResult ringfence(const std::string& arguments, const std::string& redirect = "2>&1",
                               const std::string& environment = "") {
  return run_shell(environment + " " + RINGFENCE_PROGRAM + " " + arguments + " " + redirect);
}

/// Creates an empty folder in the folder for temporary files. The destructor removes it with its content.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "ringfence-XXXXXX").string();
    if (mkdtemp(name.data())) path_ = name;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  /// The path of `file` in the folder.
  std::string operator/(const std::string& file) const { return (path_ / file).string(); }

 private:
  std::filesystem::path path_;
};

/// The digest in a report, 16 hexadecimal digits; empty if there is none.
inline std::string digest_in(const std::string& report) {
  const std::size_t at = report.find("digest      ");
  return at == std::string::npos ? std::string() : report.substr(at + 12, 16);
}

}  // namespace ringfence::test
