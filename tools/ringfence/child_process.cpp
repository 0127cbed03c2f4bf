#include "child_process.hpp"

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#elif defined(__has_feature)
constexpr bool sanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool sanitized = false;
#endif

constexpr int out_of_memory = 3, failed = 4;

void set_limit(int resource, rlim_t value) {
  rlimit now{};
  getrlimit(static_cast<__rlimit_resource_t>(resource), &now);
  if (now.rlim_max != RLIM_INFINITY && value > now.rlim_max) value = now.rlim_max;
  now.rlim_cur = value;
  setrlimit(static_cast<__rlimit_resource_t>(resource), &now);
}

std::size_t address_space() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

bool write_all(int file, const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t some = write(file, text.data() + at, text.size() - at);
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) return false;
    at += static_cast<std::size_t>(some);
  }
  return true;
}

[[noreturn]] void run_child(int out, const std::function<std::string()>& work, const ChildLimits& limits) {
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_CPU, limits.cpu_seconds);
  if (!sanitized) set_limit(RLIMIT_AS, address_space() + limits.memory_bytes);
  // Discard what the library in the child prints: it is not a message of this program.
  const int null_device = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (null_device >= 0) {
    dup2(null_device, STDOUT_FILENO);
    dup2(null_device, STDERR_FILENO);
  }
  // Without this, signal handlers of this process or of a fuzzer would report the child's crash as their own.
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU}) std::signal(signal, SIG_DFL);
  int code = 0;
  try {
    if (!write_all(out, work())) code = failed;
  } catch (const std::bad_alloc&) {
    code = out_of_memory;
  } catch (const std::exception&) {
    code = failed;
  }
  _exit(code);
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

std::string describe_exit(int status, const ChildLimits& limits) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  if (WIFEXITED(status) && WEXITSTATUS(status) == out_of_memory) {
    return fmt::format("needed more than {} MiB of memory", limits.memory_bytes >> 20);
  }
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)) {
    return fmt::format("did not finish within {} s", limits.cpu_seconds);
  }
  if (WIFSIGNALED(status)) return fmt::format("crashed (signal {})", WTERMSIG(status));
  return fmt::format("exited with code {}", WIFEXITED(status) ? WEXITSTATUS(status) : -1);
}

}  // namespace

ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits& limits) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error(fmt::format("cannot create a pipe: {}", std::strerror(errno)));
  const pid_t child = fork();
  if (child == 0) run_child(ends[1], work, limits);
  const int why = errno;
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    throw Error(fmt::format("cannot create a child process: {}", std::strerror(why)));
  }
  ChildResult result;
  result.output = read_all(ends[0]);
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  result.error = describe_exit(status, limits);
  return result;
}

}  // namespace ringfence::tools
