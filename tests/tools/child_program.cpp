// A child of child_process_test.cpp. Its argument says how it ends.
#include <algorithm>
#include <cstdlib>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <sys/resource.h>
#include <unistd.h>

#include "child_answer.hpp"

namespace {

std::string reversed(std::string_view input) { return {input.rbegin(), input.rend()}; }

[[noreturn]] void hang() {
  volatile bool on = true;  // otherwise the compiler may remove a loop without side effects
  while (on) {
  }
  std::abort();
}

[[noreturn]] void wait_for_ever() {
  for (;;) pause();
}

std::string hard_limits() {
  std::string text;
  for (const auto which : {RLIMIT_CORE, RLIMIT_CPU}) {
    rlimit limits{};
    getrlimit(which, &limits);
    text += std::to_string(limits.rlim_max) + " ";
  }
  rlimit memory{};
  getrlimit(RLIMIT_AS, &memory);
  return text + (memory.rlim_max == RLIM_INFINITY ? "unlimited" : "limited");
}

std::string environment() {
  std::string text;
  for (char** variable = environ; *variable != nullptr; ++variable) text += std::string(*variable) + "\n";
  return text;
}

std::string use_much_memory() {
  std::vector<char> much(std::size_t{1} << 30, 'x');
  const volatile char* middle = much.data() + much.size() / 2;  // otherwise clang removes the allocation
  return std::string(1, *middle);
}

}  // namespace

int main(int argc, char** argv) {
  ringfence::tools::answer_parent(argc, argv, [](std::span<const char* const> arguments, std::string_view input) {
    const std::string_view how = arguments.empty() ? "" : arguments[0];
    if (how == "crash") std::abort();
    if (how == "hang") hang();
    if (how == "throw") throw std::runtime_error("no");
    if (how == "wait") wait_for_ever();
    if (how == "limits") return hard_limits();
    if (how == "environment") return environment();
    return how == "memory" ? use_much_memory() : reversed(input);
  });
}
