// A child of child_process_test.cpp. Its argument says how it ends.
#include <algorithm>
#include <cstdlib>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "child_answer.hpp"

namespace {

std::string reversed(std::string_view input) { return {input.rbegin(), input.rend()}; }

[[noreturn]] void hang() {
  volatile bool on = true;  // otherwise the compiler may remove a loop without side effects
  while (on) {
  }
  std::abort();
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
    return how == "memory" ? use_much_memory() : reversed(input);
  });
}
