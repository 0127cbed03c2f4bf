#include "child_process.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "child_answer.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

using Clock = std::chrono::steady_clock;

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

/// A child process. Whatever happens, it does not outlive this object, nor stay as a zombie.
class Child {
 public:
  explicit Child(pid_t number) : number_(number) {}
  ~Child() {
    if (number_ <= 0) return;
    kill(number_, SIGKILL);
    (void)ended(0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  /// Waits until it ends, but not beyond the deadline; returns whether it ended.
  bool wait_until(Clock::time_point deadline) noexcept {
    while (!ended(WNOHANG)) {
      if (Clock::now() >= deadline) return false;
      poll(nullptr, 0, 1);
    }
    return true;
  }
  /// Precondition: it has ended.
  int status() const noexcept { return status_; }

 private:
  bool ended(int options) noexcept {
    pid_t found = 0;
    while ((found = waitpid(number_, &status_, options)) < 0 && errno == EINTR) {
    }
    if (found != 0) number_ = 0;
    return found != 0;
  }

  pid_t number_;
  int status_ = 0;
};

/// What posix_spawn does in the child before it runs the program.
class SpawnActions {
 public:
  SpawnActions() { check(posix_spawn_file_actions_init(&actions_)); }
  ~SpawnActions() { posix_spawn_file_actions_destroy(&actions_); }
  SpawnActions(const SpawnActions&) = delete;
  SpawnActions& operator=(const SpawnActions&) = delete;
  void duplicate(int file, int as) { check(posix_spawn_file_actions_adddup2(&actions_, file, as)); }
  void discard(int file) { check(posix_spawn_file_actions_addopen(&actions_, file, "/dev/null", O_WRONLY, 0)); }
  void close_from(int file) { check(posix_spawn_file_actions_addclosefrom_np(&actions_, file)); }
  const posix_spawn_file_actions_t* get() const noexcept { return &actions_; }

 private:
  static void check(int why) {
    if (why != 0) fail("prepare a child process", why);
  }
  posix_spawn_file_actions_t actions_;
};

void write_input(int file, std::string_view input) {
  while (!input.empty()) {
    const ssize_t some = write(file, input.data(), input.size());
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) fail("write the input of a child process", errno);
    input.remove_prefix(static_cast<std::size_t>(some));
  }
}

/// Whether the file can be read, or has ended, before the deadline.
bool is_readable_before(Clock::time_point deadline, int file) {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd one{file, POLLIN, 0};
    const int ready = left > 0 ? poll(&one, 1, static_cast<int>(std::min<std::int64_t>(left, 1'000'000))) : 0;
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) fail("wait for a child process", errno);
    if (left <= 0) return false;
  }
}

/// Reads the answer. If it exceeds the limits, the result has the error.
ChildResult read_answer(int file, Clock::time_point deadline, const ChildLimits& limits) {
  ChildResult result;
  char part[65536];
  while (is_readable_before(deadline, file)) {
    const ssize_t some = read(file, part, sizeof part);
    if (some < 0 && errno == EINTR) continue;
    if (some < 0) fail("read the answer of a child process", errno);
    if (some == 0) return result;
    if (static_cast<std::size_t>(some) > limits.answer_bytes - result.output.size()) {
      return {"", fmt::format("answered more than {} MiB", limits.answer_bytes >> 20)};
    }
    result.output.append(part, static_cast<std::size_t>(some));
  }
  return {"", fmt::format("took longer than {} s", limits.wall_seconds)};
}

/// The variables of this environment that a child gets: where its libraries are, and the options of sanitizers. Others
/// may have secrets, or change what it does.
std::vector<char*> environment_of_child() {
  std::vector<char*> variables;
  for (char** variable = environ; variable != nullptr && *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    for (const std::string_view name :
         {"LD_LIBRARY_PATH=", "ASAN_OPTIONS=", "LSAN_OPTIONS=", "TSAN_OPTIONS=", "UBSAN_OPTIONS="}) {
      if (text.starts_with(name)) variables.push_back(*variable);
    }
  }
  variables.push_back(nullptr);
  return variables;
}

/// Starts the program with these standard streams; no other descriptor of this process is open in it.
pid_t start(const std::filesystem::path& program, const std::vector<std::string>& arguments, int input, int answer) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  SpawnActions actions;
  // In this order: `input`, which was opened first, may be descriptor 3, and `answer` cannot be 0.
  actions.duplicate(input, STDIN_FILENO);
  actions.duplicate(answer, answer_file);
  // What the library in the child prints is not a message of this program.
  for (const int file : {STDOUT_FILENO, STDERR_FILENO}) actions.discard(file);
  actions.close_from(answer_file + 1);
  pid_t child = -1;
  const int why =
      posix_spawn(&child, program.c_str(), actions.get(), nullptr, argv.data(), environment_of_child().data());
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
  if (error) throw Error(fmt::format("cannot find {}: /proc/self/exe: {}", name, error.message()));
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
  const Clock::time_point deadline = Clock::now() + std::chrono::seconds(limits.wall_seconds);
  Child child(start(program, arguments, memory.get(), written.get()));
  written.close();
  ChildResult result = read_answer(answer.get(), deadline, limits);
  if (!result.error.empty()) return result;
  result.error = child.wait_until(deadline) ? describe_exit(child.status(), limits)
                                            : fmt::format("took longer than {} s", limits.wall_seconds);
  return result;
}

}  // namespace ringfence::tools
