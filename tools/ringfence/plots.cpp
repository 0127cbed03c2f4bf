#include "plots.hpp"

#include <cerrno>
#include <cstring>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "exit_code.hpp"

namespace ringfence::tools {
namespace {

std::string script_path(const std::string& prefix) { return prefix + ".gnuplot"; }

}  // namespace

void check_plots(const std::string& prefix) { OutputFile(script_path(prefix)).close(); }

void draw_plots(const std::string& prefix, const ScaleResult& result) {
  const std::string path = script_path(prefix);
  OutputFile script(path);
  script.print("{}", plot_script(prefix, result));
  script.close();

  std::string program = "gnuplot", argument = path;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ);
  int status = 0;
  if (error == ENOENT ||
      (error == 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 127)) {
    throw IncompleteError(fmt::format(
        "gnuplot: not found, so nothing was drawn; install it (Debian: gnuplot-nox) and run: gnuplot {}", path));
  }
  if (error != 0) throw IncompleteError(fmt::format("cannot start gnuplot: {}", std::strerror(error)));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw IncompleteError(fmt::format("gnuplot {}: failed; its messages are above", path));
  }
}

}  // namespace ringfence::tools
