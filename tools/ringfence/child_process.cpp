#include "child_process.hpp"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "child_answer.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

/// A file descriptor that is closed in the end, and is not inherited by a child.
class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const noexcept { return file_; }
  void close() noexcept {
    if (file_ >= 0) ::close(std::exchange(file_, -1));
  }

 private:
  int file_;
};

[[noreturn]] void fail(const std::string& what, int why) {
  throw Error(fmt::format("cannot {}: {}", what, std::strerror(why)));
}

void write_input(int file, std::string_view input) {
  while (!input.empty()) {
    const ssize_t some = write(file, input.data(), input.size());
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) fail("write the input of a child process", errno);
    input.remove_prefix(static_cast<std::size_t>(some));
  }
}

std::string read_all(int file) {
  std::string text;
  char part[65536];
  for (;;) {
    const ssize_t some = read(file, part, sizeof part);
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) return text;
    text.append(part, static_cast<std::size_t>(some));
  }
}

/// Starts the program with these standard streams; no other descriptor of this process is open in it.
pid_t start(const std::filesystem::path& program, const std::vector<std::string>& arguments, int input, int answer) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // In this order: `input`, which was opened first, may be descriptor 3, and `answer` cannot be 0.
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, answer, answer_file);
  // What the library in the child prints is not a message of this program.
  for (const int file : {STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, file, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addclosefrom_np(&actions, answer_file + 1);
  pid_t child = -1;
  const int why = posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (why != 0) fail("start " + program.string(), why);
  return child;
}

std::string describe_exit(int status, const ChildLimits& limits) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  if (WIFEXITED(status) && WEXITSTATUS(status) == child_out_of_memory) {
    return fmt::format("needed more than {} MiB of memory", limits.memory_bytes >> 20);
  }
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)) {
    return fmt::format("did not finish within {} s", limits.cpu_seconds);
  }
  if (WIFSIGNALED(status)) return fmt::format("crashed (signal {})", WTERMSIG(status));
  return fmt::format("exited with code {}", WIFEXITED(status) ? WEXITSTATUS(status) : -1);
}

}  // namespace

std::filesystem::path helper_program(const std::string& name) {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return program.parent_path().parent_path() / "libexec" / "ringfence" / name;
}

ChildResult run_child(const std::filesystem::path& program, std::vector<std::string> arguments, std::string_view input,
                      const ChildLimits& limits) {
  arguments.push_back(std::to_string(limits.cpu_seconds));
  arguments.push_back(std::to_string(limits.memory_bytes));
  const Descriptor memory(memfd_create("input", MFD_CLOEXEC));
  if (memory.get() < 0) fail("create a file in memory", errno);
  write_input(memory.get(), input);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) fail("create a pipe", errno);
  const Descriptor answer(ends[0]);
  Descriptor written(ends[1]);
  const pid_t child = start(program, arguments, memory.get(), written.get());
  written.close();
  ChildResult result;
  result.output = read_all(answer.get());
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  result.error = describe_exit(status, limits);
  return result;
}

}  // namespace ringfence::tools
