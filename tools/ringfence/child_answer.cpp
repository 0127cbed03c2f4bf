#include "child_answer.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <exception>
#include <fstream>
#include <new>
#include <stdexcept>

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ringfence::tools {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#elif defined(__has_feature)
constexpr bool sanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool sanitized = false;
#endif

/// Sets both limits, so that this process cannot raise them again.
void set_limits(int resource, rlim_t soft, rlim_t hard) {
  const auto which = static_cast<__rlimit_resource_t>(resource);
  rlimit limits{};
  if (getrlimit(which, &limits) != 0) throw std::runtime_error("getrlimit failed");
  limits.rlim_max = std::min(hard, limits.rlim_max);
  limits.rlim_cur = std::min(soft, limits.rlim_max);
  if (setrlimit(which, &limits) != 0) throw std::runtime_error("setrlimit failed");
}

std::size_t address_space() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

/// The memory file that is the standard input.
std::string_view map_input() {
  struct stat status {};
  if (fstat(STDIN_FILENO, &status) != 0 || status.st_size <= 0) return {};
  const auto bytes = static_cast<std::size_t>(status.st_size);
  const void* input = mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE, STDIN_FILENO, 0);
  if (input == MAP_FAILED) throw std::bad_alloc();
  return {static_cast<const char*>(input), bytes};
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

}  // namespace

void answer_parent(
    int argc, char** argv,
    const std::function<std::string(std::span<const char* const> arguments, std::string_view input)>& work) {
  // A sanitizer would handle these signals, and the parent would not see that its child crashed.
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU}) std::signal(signal, SIG_DFL);
  int code = 0;
  try {
    if (argc < 3) _exit(child_failed);
    const std::string_view input = map_input();
    set_limits(RLIMIT_CORE, 0, 0);
    const rlim_t seconds = std::stoul(argv[argc - 2]);
    set_limits(RLIMIT_CPU, seconds, seconds + 1);  // SIGXCPU, which may be ignored, then SIGKILL
    const rlim_t memory = address_space() + std::stoul(argv[argc - 1]);
    if (!sanitized) set_limits(RLIMIT_AS, memory, memory);
    const std::span<const char* const> arguments(argv + 1, static_cast<std::size_t>(argc - 3));
    if (!write_all(answer_file, work(arguments, input))) code = child_failed;
  } catch (const std::bad_alloc&) {
    code = child_out_of_memory;
  } catch (const std::exception&) {
    code = child_failed;
  }
  _exit(code);
}

}  // namespace ringfence::tools
