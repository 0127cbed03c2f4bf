#pragma once

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

namespace ringfence::test {

/// What the built program answered.
struct ProgramResult {
  int code = -1;
  std::string out;  ///< standard output and standard error, as asked for
};

/// Runs the program in a shell with `arguments`. Standard error is taken in too, unless `redirect` says otherwise.
/// `environment` stands before the command, as NAME=VALUE.
inline ProgramResult ringfence(const std::string& arguments, const std::string& redirect = "2>&1",
                               const std::string& environment = "") {
  const std::string command = environment + " " + RINGFENCE_PROGRAM + " " + arguments + " " + redirect;
  ProgramResult answer;
  std::FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return answer;
  std::array<char, 4096> block;
  for (std::size_t got; (got = std::fread(block.data(), 1, block.size(), pipe)) > 0;)
    answer.out.append(block.data(), got);
  const int status = pclose(pipe);
  if (WIFEXITED(status)) answer.code = WEXITSTATUS(status);
  return answer;
}

/// A folder that is gone when the test is over.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "ringfence-XXXXXX").string();
    if (mkdtemp(name.data())) path_ = name;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string operator/(const std::string& file) const { return (path_ / file).string(); }

 private:
  std::filesystem::path path_;
};

/// The digest that a report ends with; empty without one.
inline std::string digest_in(const std::string& report) {
  const std::size_t at = report.find("digest      ");
  return at == std::string::npos ? std::string() : report.substr(at + 12, 16);
}

}  // namespace ringfence::test
