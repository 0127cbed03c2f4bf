// Property: any bytes as a configuration file of `ringfence node` are either refused with a message, or give options in
// the ranges that the manual states.
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>
#include <sys/mman.h>
#include <unistd.h>

#include "fuzz/target.hpp"
#include "options.hpp"

using namespace ringfence;

namespace {

/// A file in memory, whose contents are the input.
class InputFile {
 public:
  InputFile() : file_(::memfd_create("fuzz.conf", MFD_CLOEXEC)) { fuzz::require(file_ >= 0); }
  ~InputFile() { ::close(file_); }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  void write(const std::uint8_t* bytes, std::size_t size) const {
    fuzz::require(::ftruncate(file_, 0) == 0);
    fuzz::require(::pwrite(file_, bytes, size, 0) == static_cast<ssize_t>(size));
  }
  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

void check(const tools::NodeOptions& node) {
  fuzz::require(node.network.domain <= 200);
  fuzz::require(node.network.world.size() <= 64);
  fuzz::require(node.network.lease_ms >= 10 && node.network.lease_ms <= 60'000);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  static const InputFile file;
  file.write(input, size);
  std::string program = "ringfence", command = "node", option = "--config", path = file.path();
  char* arguments[] = {program.data(), command.data(), option.data(), path.data(), nullptr};
  tools::CommandLineParser parser;
  try {
    const tools::CommandLine line = parser.parse(4, arguments);
    fuzz::require(line.command == tools::CommandLine::Command::node);
    check(line.node);
  } catch (const CLI::ParseError& error) {
    fuzz::require(error.get_exit_code() == 0 || *error.what() != '\0');
  }
  return 0;
}
